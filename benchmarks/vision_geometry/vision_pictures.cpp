// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "vision_pictures.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include <png.h>

#include <cairn/core/check.hpp>

namespace vision_bench {

namespace {

std::uint8_t rounded(double level) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(level, 0.0, 255.0)));
}

/// Level between pixels, the rim continued outwards.
double level_at(const cairn::Image& image, double x, double y) {
  x = std::clamp(x, 0.0, image.width() - 1.0);
  y = std::clamp(y, 0.0, image.height() - 1.0);
  const int i = std::min(static_cast<int>(x), image.width() - 2);
  const int j = std::min(static_cast<int>(y), image.height() - 2);
  const double u = x - i, v = y - j;
  return (1 - v) * ((1 - u) * image(i, j) + u * image(i + 1, j)) +
         v * ((1 - u) * image(i, j + 1) + u * image(i + 1, j + 1));
}

cairn::Image smoothed(const cairn::Image& image, double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<double> kernel;
  double sum = 0;
  for (int k = -reach; k <= reach; ++k) sum += kernel.emplace_back(std::exp(-0.5 * k * k / (sigma * sigma)));
  const int width = image.width(), height = image.height();
  std::vector<double> rows(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const auto index = [&](int x, int y) {
    return static_cast<std::size_t>(std::clamp(y, 0, height - 1)) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  };
  const auto weight = [&](int k) { return kernel[static_cast<std::size_t>(k + reach)] / sum; };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int k = -reach; k <= reach; ++k)
        rows[index(x, y)] += weight(k) * image(std::clamp(x + k, 0, width - 1), y);
  cairn::Image result(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double level = 0;
      for (int k = -reach; k <= reach; ++k) level += weight(k) * rows[index(x, y + k)];
      result(x, y) = rounded(level);
    }
  return result;
}

}  // namespace

Place Homography::operator()(Place at) const {
  const double w = h[6] * at.x + h[7] * at.y + h[8];
  return {(h[0] * at.x + h[1] * at.y + h[2]) / w, (h[3] * at.x + h[4] * at.y + h[5]) / w};
}

Homography Homography::inverse() const {
  // The adjugate: a common factor does not change the map.
  return {{h[4] * h[8] - h[5] * h[7], h[2] * h[7] - h[1] * h[8], h[1] * h[5] - h[2] * h[4],
           h[5] * h[6] - h[3] * h[8], h[0] * h[8] - h[2] * h[6], h[2] * h[3] - h[0] * h[5],
           h[3] * h[7] - h[4] * h[6], h[1] * h[6] - h[0] * h[7], h[0] * h[4] - h[1] * h[3]}};
}

double Homography::scale(Place at) const {
  const double step = 0.5;
  const Place left = (*this)({at.x - step, at.y}), right = (*this)({at.x + step, at.y});
  const Place up = (*this)({at.x, at.y - step}), down = (*this)({at.x, at.y + step});
  return std::sqrt(std::abs((right.x - left.x) * (down.y - up.y) - (down.x - up.x) * (right.y - left.y)));
}

cairn::Image read_png(const std::filesystem::path& path) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_file(&png, path.c_str()) == 0)
    cairn::raise(path.string() + ": expected a PNG image: " + png.message);
  png.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> colours(PNG_IMAGE_SIZE(png));
  if (png_image_finish_read(&png, nullptr, colours.data(), 0, nullptr) == 0)
    cairn::raise(path.string() + ": expected a whole PNG image: " + png.message);
  cairn::Image image(static_cast<int>(png.width), static_cast<int>(png.height));
  const std::uint8_t* colour = colours.data();
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x, colour += 3)
      image(x, y) = rounded(0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2]);
  return image;
}

cairn::Image cropped(const cairn::Image& image, int left, int top, int width, int height) {
  return cairn::Image(cairn::ImageView(image.row(top) + left, width, height, image.width()));
}

Pair similar(const cairn::Image& image, double degrees, double factor) {
  const double angle = degrees * std::numbers::pi / 180;
  const double c = factor * std::cos(angle), s = factor * std::sin(angle);
  const double x = 0.5 * (image.width() - 1), y = 0.5 * (image.height() - 1);
  Pair pair{image,
            cairn::Image(image.width(), image.height()),
            {{c, -s, x - c * x + s * y, s, c, y - s * x - c * y, 0, 0, 1}}};
  const cairn::Image source =
      factor < 1 ? smoothed(image, 0.5 * std::sqrt(1 / (factor * factor) - 1)) : image;
  const Homography back = pair.map.inverse();
  for (int row = 0; row < image.height(); ++row)
    for (int column = 0; column < image.width(); ++column) {
      const Place from = back({static_cast<double>(column), static_cast<double>(row)});
      pair.second(column, row) = rounded(level_at(source, from.x, from.y));
    }
  return pair;
}

Pair blurred(const cairn::Image& image, double sigma) {
  return {image, smoothed(image, sigma), {}};
}

Pair relit(const cairn::Image& image, double gain, double offset) {
  Pair pair{image, image, {}};
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) pair.second(x, y) = rounded(gain * image(x, y) + offset);
  return pair;
}

}  // namespace vision_bench
