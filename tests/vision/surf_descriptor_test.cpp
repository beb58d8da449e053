// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/vision/detail/surf_descriptor.hpp>

#include "support/random.hpp"
#include "vision/pictures.hpp"

namespace surf_descriptor_test {
namespace {

/// Sum over a square of side `size` about (x, y), pixels being unit squares; doubles throughout.
double square_sum(const cairn::Image& image, double x, double y, double size) {
  const double left = x + 0.5 - size / 2, top = y + 0.5 - size / 2;
  double sum = 0;
  for (int row = static_cast<int>(top); row <= static_cast<int>(top + size); ++row)
    for (int column = static_cast<int>(left); column <= static_cast<int>(left + size); ++column) {
      const double wide = std::min(left + size, column + 1.0) - std::max(left, static_cast<double>(column));
      const double tall = std::min(top + size, row + 1.0) - std::max(top, static_cast<double>(row));
      if (wide > 0 && tall > 0) sum += wide * tall * image(column, row);
    }
  return sum;
}

/// A cell of the turned grid: between the four upright cells around its centre.
double turned_cell(const cairn::Image& image, const cairn::Keypoint& at, double u, double v) {
  const double c = std::cos(double{at.angle}), s = std::sin(double{at.angle});
  const double x = c * u - s * v, y = s * u + c * v;
  const double i = std::floor(x), j = std::floor(y);
  const auto cell = [&](double column, double row) {
    return square_sum(image, at.x + column * at.scale, at.y + row * at.scale, at.scale);
  };
  return (1 - (y - j)) * ((1 - (x - i)) * cell(i, j) + (x - i) * cell(i + 1, j)) +
         (y - j) * ((1 - (x - i)) * cell(i, j + 1) + (x - i) * cell(i + 1, j + 1));
}

/// The definition in the header, and by how much a response computed in floats may change each number of it.
struct SlowDescriptor {
  std::vector<double> numbers;
  std::vector<double> slack;
};

/// Response by response, in doubles. In floats a cell is the difference of two sums along a row of up to 35
/// cells: of 128 s^2 each, s the scale, that rounds a response by about 4e-4 s^2 (root mean square). Where
/// responses are split by a sign, those within five times that may be on either side.
SlowDescriptor slow_descriptor(const cairn::Image& image, const cairn::Keypoint& at, bool overlapping,
                               bool extended) {
  std::array<std::array<double, 25>, 25> cells{};
  for (std::size_t j = 0; j < 25; ++j)
    for (std::size_t i = 0; i < 25; ++i)
      cells[j][i] = turned_cell(image, at, static_cast<double>(i) - 12, static_cast<double>(j) - 12);
  const double rounding = 4e-4 * at.scale * at.scale;
  std::vector<double> numbers, slack;
  for (int block_y = 0; block_y < 4; ++block_y)
    for (int block_x = 0; block_x < 4; ++block_x) {
      std::array<double, 8> sums{}, doubt{};
      double weights = 0;  // squared
      for (int k = 0; k < (overlapping ? 81 : 25); ++k) {
        const int side = overlapping ? 9 : 5, first = overlapping ? 0 : 2;
        const int i = first + 5 * block_x + k % side, j = first + 5 * block_y + k / side;
        const auto cell = [&](int down, int right) {
          return cells[static_cast<std::size_t>(j + down)][static_cast<std::size_t>(i + right)];
        };
        double weight = 0;
        if (overlapping) {
          const double du = k % 9 - 4, dv = k / 9 - 4, bu = block_x - 1.5, bv = block_y - 1.5;
          weight = std::exp(-(du * du + dv * dv) / (2 * 2.5 * 2.5) - (bu * bu + bv * bv) / (2 * 1.5 * 1.5));
        } else {
          const double u = i - 11.5, v = j - 11.5;
          weight = std::exp(-(u * u + v * v) / (2 * 3.3 * 3.3));
        }
        weights += weight * weight;
        const double dx = weight * (cell(0, 1) + cell(1, 1) - cell(0, 0) - cell(1, 0));
        const double dy = weight * (cell(1, 0) + cell(1, 1) - cell(0, 0) - cell(0, 1));
        if (!extended) {
          const std::array<double, 4> terms{dx, dy, std::abs(dx), std::abs(dy)};
          for (std::size_t n = 0; n < 4; ++n) sums[n] += terms[n];
        } else {
          sums[dy < 0 ? 2 : 0] += dx;
          sums[dy < 0 ? 3 : 1] += std::abs(dx);
          sums[dx < 0 ? 6 : 4] += dy;
          sums[dx < 0 ? 7 : 5] += std::abs(dy);
          for (std::size_t n = 0; n < 8; ++n)
            if (std::abs(n < 4 ? dy : dx) < 5 * weight * rounding) doubt[n] += std::abs(n < 4 ? dx : dy);
        }
      }
      for (double& number : doubt) number += 6 * rounding * std::sqrt(weights);
      numbers.insert(numbers.end(), sums.begin(), sums.begin() + (extended ? 8 : 4));
      slack.insert(slack.end(), doubt.begin(), doubt.begin() + (extended ? 8 : 4));
    }
  double squares = 0;
  for (const double number : numbers) squares += number * number;
  // What changes one number changes the length of all.
  const double length = std::sqrt(squares);
  double of_length = 0;
  for (std::size_t n = 0; n < numbers.size(); ++n) {
    numbers[n] /= length;
    slack[n] /= length;
    of_length += slack[n] * std::abs(numbers[n]);
  }
  for (std::size_t n = 0; n < numbers.size(); ++n) slack[n] += of_length * std::abs(numbers[n]);
  return {numbers, slack};
}

}  // namespace

TEST_SUITE("surf_descriptor") {
  TEST_CASE(
      "describe_keypoint: equals the definition computed slowly in doubles, but for the rounding of floats") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::Image image = cairn_test::texture(320, 300, seed);
    const cairn::IntegralImage sums(image);
    for (int trial = 0; trial < 24; ++trial) {
      cairn::Keypoint keypoint;
      keypoint.scale = static_cast<float>(random.uniform(0.8, 7));
      keypoint.x = static_cast<float>(random.uniform(18 * keypoint.scale, 319 - 18 * keypoint.scale));
      keypoint.y = static_cast<float>(random.uniform(18 * keypoint.scale, 299 - 18 * keypoint.scale));
      keypoint.angle = trial % 3 == 0 ? 0.0F : static_cast<float>(random.uniform(-3.1, 3.1));
      const bool extended = trial % 2 == 1;
      const bool overlapping = trial % 5 != 0;
      std::array<float, 128> fast;
      cairn::detail::describe_keypoint(sums, keypoint, false, overlapping, extended, fast.data());
      const auto [slow, slack] = slow_descriptor(image, keypoint, overlapping, extended);
      CAPTURE(trial);
      for (std::size_t n = 0; n < slow.size(); ++n) CHECK(std::abs(fast[n] - slow[n]) < slack[n]);
    }
  }

  TEST_CASE("describe_keypoint: of a plain image is all zeros, for every option") {
    const cairn::IntegralImage sums(cairn::Image(80, 80, 130));
    for (const bool extended : {false, true}) {
      cairn::Keypoint keypoint;
      keypoint.x = keypoint.y = 40;
      keypoint.scale = 1.5F;
      std::array<float, 128> numbers;
      numbers.fill(-1);
      cairn::detail::describe_keypoint(sums, keypoint, true, true, extended, numbers.data());
      const auto end = numbers.begin() + (extended ? 128 : 64);
      CHECK(std::all_of(numbers.begin(), end, [](float number) { return std::abs(number) < 1e-6F; }));
    }
  }
}

}  // namespace surf_descriptor_test
