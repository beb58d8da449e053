// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/vision/surf.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"
#include "vision/pictures.hpp"

namespace surf_test {
namespace {

using cairn_test::message_of;
using cairn_test::texture;

double distance(std::span<const float> a, std::span<const float> b) {
  double squares = 0;
  for (std::size_t n = 0; n < a.size(); ++n) squares += std::pow(double{a[n]} - b[n], 2);
  return std::sqrt(squares);
}

/// The keypoint nearest to a place and scale.
std::size_t nearest(const cairn::Features& features, double x, double y, double scale) {
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < features.size(); ++i) {
    const cairn::Keypoint& keypoint = features.keypoints[i];
    const double far = std::hypot(keypoint.x - x, keypoint.y - y, keypoint.scale - scale);
    if (far < least) {
      least = far;
      best = i;
    }
  }
  return best;
}

bool same(const cairn::Features& a, const cairn::Features& b) {
  return a.keypoints == b.keypoints && a.descriptors == b.descriptors && a.dimension == b.dimension;
}

}  // namespace

TEST_SUITE("surf") {
  TEST_CASE("surf: finds a Gaussian blob at its centre, to a tenth of a pixel, at a scale in proportion") {
    for (const double sigma : {1.6, 2.0, 2.5, 3.5, 4.5, 7.0, 10.0})
      for (const double offset : {0.0, 0.25, 0.5})
        for (const double contrast : {100.0, -100.0}) {
          const cairn::Image image = cairn_test::blob(241, 231, 120 + offset, 115 - offset, sigma, contrast);
          const cairn::Features features = cairn::surf(image);
          CAPTURE(sigma);
          CAPTURE(offset);
          REQUIRE(features.size() > 0);
          const cairn::Keypoint& centre = features.keypoints[nearest(features, 120, 115, 0.75 * sigma)];
          CHECK(std::abs(centre.x - (120 + offset)) < 0.1);
          CHECK(std::abs(centre.y - (115 - offset)) < 0.1);
          CHECK(centre.laplacian == (contrast > 0 ? -1 : 1));
          CHECK(centre.scale / sigma > 0.69);
          CHECK(centre.scale / sigma < 0.89);
        }
  }

  TEST_CASE("surf: the negative image has the same points with opposite sign and opposite gradients") {
    const cairn::Image image = texture(300, 260, 5);
    cairn::SurfOptions options;
    options.upright = true;
    const cairn::Features plain = cairn::surf(image, options);
    const cairn::Features negative = cairn::surf(cairn_test::inverted(image), options);
    REQUIRE(plain.size() > 100);
    REQUIRE(plain.size() == negative.size());
    for (std::size_t i = 0; i < plain.size(); ++i) {
      cairn::Keypoint expected = plain.keypoints[i];
      expected.laplacian = static_cast<std::int8_t>(-expected.laplacian);
      CHECK(negative.keypoints[i] == expected);
      for (std::size_t n = 0; n < 64; n += 4) {
        CHECK(negative.descriptor(i)[n] == doctest::Approx(-plain.descriptor(i)[n]).epsilon(1e-4));
        CHECK(negative.descriptor(i)[n + 2] == doctest::Approx(plain.descriptor(i)[n + 2]).epsilon(1e-4));
      }
    }
  }

  TEST_CASE("surf: half the contrast on another brightness changes no descriptor by more than 1e-3") {
    const cairn::Image even = [] {
      const cairn::Image source = texture(300, 260, 6);
      return cairn_test::picture(
          300, 260, [&](int x, int y) { return static_cast<std::uint8_t>(source(x, y) / 2 * 2); });
    }();
    const cairn::Image pale = cairn_test::picture(
        300, 260, [&](int x, int y) { return static_cast<std::uint8_t>(even(x, y) / 2 + 100); });
    cairn::Surf extractor;
    const cairn::Features strong = extractor(even);
    const cairn::Features weak = extractor.describe(pale, strong.keypoints);
    REQUIRE(strong.size() > 100);
    for (std::size_t i = 0; i < strong.size(); ++i)
      CHECK(distance(strong.descriptor(i), weak.descriptor(i)) < 1e-3);
  }

  TEST_CASE("surf: a quarter turn turns keypoints and directions exactly and leaves descriptors alone") {
    const cairn::Image image = texture(257, 257, 7);  // 256 is a multiple of every octave's step
    cairn::Image turned = image;
    const cairn::Features before = cairn::surf(image);
    REQUIRE(before.size() > 100);
    for (int quarters = 1; quarters <= 3; ++quarters) {
      turned = cairn_test::quarter_turn(turned);
      const cairn::Features after = cairn::surf(turned);
      CHECK(after.size() == before.size());
      std::size_t same_angle = 0;
      for (std::size_t i = 0; i < before.size(); ++i) {
        const cairn::Keypoint& was = before.keypoints[i];
        double x = was.x, y = was.y;
        for (int q = 0; q < quarters; ++q) {
          const double old_x = x;
          x = 256 - y;
          y = old_x;
        }
        const std::size_t j = nearest(after, x, y, was.scale);
        const cairn::Keypoint& is = after.keypoints[j];
        CHECK(std::abs(is.x - x) < 1e-3);
        CHECK(std::abs(is.y - y) < 1e-3);
        CHECK(std::abs(is.scale - was.scale) < 1e-3);
        CHECK(is.laplacian == was.laplacian);
        const double turn = is.angle - was.angle - quarters * std::numbers::pi / 2;
        if (std::abs(std::remainder(turn, 2 * std::numbers::pi)) > 1e-3) continue;  // two sectors as long
        ++same_angle;
        CHECK(distance(after.descriptor(j), before.descriptor(i)) < 2e-3);
      }
      CHECK(same_angle >= before.size() - before.size() / 50);
    }
  }

  TEST_CASE("surf: a shift by a multiple of the coarsest step shifts the points and nothing else") {
    const cairn::Image wide = texture(400, 360, 8);
    const auto window = [&](int left, int top) {
      return cairn_test::picture(340, 320, [&](int x, int y) { return wide(x + left, y + top); });
    };
    cairn::SurfOptions options;
    options.upright = true;
    const cairn::Features here = cairn::surf(window(0, 0), options);
    const cairn::Features there = cairn::surf(window(16, 8), options);
    std::size_t compared = 0;
    for (std::size_t i = 0; i < here.size(); ++i) {
      const cairn::Keypoint& keypoint = here.keypoints[i];
      if (keypoint.at_rim || keypoint.x < 180 || keypoint.y < 160 || keypoint.scale > 6) continue;
      const std::size_t j = nearest(there, keypoint.x - 16, keypoint.y - 8, keypoint.scale);
      CHECK(there.keypoints[j].x == doctest::Approx(keypoint.x - 16).epsilon(1e-6));
      CHECK(there.keypoints[j].response == keypoint.response);
      CHECK(distance(there.descriptor(j), here.descriptor(i)) < 1e-4);
      ++compared;
    }
    CHECK(compared > 50);
  }

  TEST_CASE("surf: large blobs are found again in the image of half the size, at half the scale") {
    const cairn::Image image = texture(512, 480, 9);
    const cairn::Image half = cairn_test::picture(256, 240, [&](int x, int y) {
      return static_cast<std::uint8_t>((image(2 * x, 2 * y) + image(2 * x + 1, 2 * y) +
                                        image(2 * x, 2 * y + 1) + image(2 * x + 1, 2 * y + 1) + 2) /
                                       4);
    });
    const cairn::Features large = cairn::surf(image), small = cairn::surf(half);
    std::size_t tried = 0, found = 0;
    for (const cairn::Keypoint& keypoint : large.keypoints) {
      if (keypoint.scale < 3 || keypoint.scale > 10 || keypoint.at_rim) continue;
      const double x = (keypoint.x - 0.5) / 2, y = (keypoint.y - 0.5) / 2, scale = keypoint.scale / 2;
      const cairn::Keypoint& again = small.keypoints[nearest(small, x, y, scale)];
      ++tried;
      if (std::hypot(again.x - x, again.y - y) < 0.5 * scale &&
          std::abs(std::log2(again.scale / scale)) < 0.3)
        ++found;
    }
    CHECK(tried > 100);
    CHECK(found > 0.7 * static_cast<double>(tried));
  }

  TEST_CASE("surf: gives the same bits for every number of threads, and whatever the object did before") {
    const cairn::Image image = texture(400, 300, 10);
    for (const bool upright : {false, true}) {
      cairn::SurfOptions options;
      options.upright = upright;
      options.target_count = 300;
      const cairn::Features one = cairn::surf(image, options, 1);
      CHECK(one.size() == 300);
      for (const unsigned threads : {0U, 2U, 3U, 8U}) CHECK(same(cairn::surf(image, options, threads), one));
      cairn::Surf reused(options, 2);
      CHECK(reused(texture(450, 350, 11)).size() == 300);
      CHECK(reused(cairn::Image(3, 3)).size() == 0);
      CHECK(same(reused(image), one));
    }
  }

  TEST_CASE("surf: a target keeps the strongest of all, and a view with a stride is read as the image is") {
    const cairn::Image image = texture(320, 240, 12);
    cairn::SurfOptions options;
    const cairn::Features all = cairn::surf(image, options);
    options.target_count = 100;
    const cairn::Features some = cairn::surf(image, options);
    REQUIRE(all.size() > 150);
    REQUIRE(some.size() == 100);
    for (std::size_t i = 0; i < some.size(); ++i) {
      CHECK(some.keypoints[i] == all.keypoints[i]);
      CHECK(distance(some.descriptor(i), all.descriptor(i)) == 0);
    }
    std::vector<std::uint8_t> padded(240 * 333, 77);
    for (int y = 0; y < 240; ++y) std::copy_n(image.row(y), 320, padded.begin() + y * 333);
    CHECK(same(cairn::surf({padded.data(), 320, 240, 333}, options), some));
  }

  TEST_CASE("surf: a grid of any number of cells is taken, and one of more than are kept changes nothing") {
    const cairn::Image image = texture(200, 160, 13);
    const int most = std::numeric_limits<int>::max();
    const cairn::Features strongest = cairn::surf(image, {.target_count = 40});
    REQUIRE(strongest.size() == 40);
    for (const auto& [columns, rows] : {std::pair{65536, 65536}, {most, most}, {46341, 46341}, {1, most}}) {
      CAPTURE(columns);
      CHECK(same(strongest,
                 cairn::surf(image, {.target_count = 40, .grid_columns = columns, .grid_rows = rows})));
    }
    CHECK_FALSE(same(strongest, cairn::surf(image, {.target_count = 40, .grid_columns = 1, .grid_rows = 8})));
  }

  TEST_CASE("surf: detect and describe together give what the call does") {
    const cairn::Image image = texture(320, 240, 13);
    for (const bool upright : {false, true}) {
      cairn::SurfOptions options;
      options.upright = upright;
      options.extended = true;
      cairn::Surf extractor(options);
      const cairn::Features whole = extractor(image);
      CHECK(whole.dimension == 128);
      CHECK(same(extractor.describe(image, extractor.detect(image)), whole));
    }
  }

  TEST_CASE("surf: turned by any angle, most points are found again and matched right") {
    const double angle = 0.6, c = std::cos(angle), s = std::sin(angle);
    const cairn::Image image = texture(301, 301, 14);
    const cairn::Image turned = cairn_test::picture(301, 301, [&](int x, int y) {
      const double u = c * (x - 150) + s * (y - 150) + 150, v = -s * (x - 150) + c * (y - 150) + 150;
      if (u < 0 || v < 0 || u >= 300 || v >= 300) return std::uint8_t{128};
      const int i = static_cast<int>(u), j = static_cast<int>(v);
      const double above = (1 - (u - i)) * image(i, j) + (u - i) * image(i + 1, j);
      const double below = (1 - (u - i)) * image(i, j + 1) + (u - i) * image(i + 1, j + 1);
      return cairn_test::grey((1 - (v - j)) * above + (v - j) * below);
    });
    const cairn::Features before = cairn::surf(image), after = cairn::surf(turned);
    std::size_t tried = 0, right = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      const cairn::Keypoint& keypoint = before.keypoints[i];
      const double dx = keypoint.x - 150, dy = keypoint.y - 150;
      if (std::hypot(dx, dy) > 110 || keypoint.at_rim) continue;
      std::size_t best = 0;
      for (std::size_t j = 1; j < after.size(); ++j)
        if (distance(after.descriptor(j), before.descriptor(i)) <
            distance(after.descriptor(best), before.descriptor(i)))
          best = j;
      const double x = c * dx - s * dy + 150, y = s * dx + c * dy + 150;
      const bool close = std::hypot(after.keypoints[best].x - x, after.keypoints[best].y - y) < 2;
      ++tried;
      right += close ? 1 : 0;
    }
    CHECK(tried > 80);
    CHECK(right > 0.75 * static_cast<double>(tried));
  }

  TEST_CASE("surf: noise and points at the rim give finite descriptors of unit length") {
    const cairn::Image image = cairn_test::noise(90, 70, 15);
    for (const bool extended : {false, true}) {
      cairn::SurfOptions options;
      options.threshold = 0;
      options.extended = extended;
      const cairn::Features features = cairn::surf(image, options);
      CHECK(features.size() > 50);
      CHECK(std::any_of(features.keypoints.begin(), features.keypoints.end(),
                        [](const cairn::Keypoint& keypoint) { return keypoint.at_rim; }));
      for (std::size_t i = 0; i < features.size(); ++i) {
        double squares = 0;
        for (const float number : features.descriptor(i)) squares += double{number} * number;
        CHECK(squares == doctest::Approx(1).epsilon(1e-4));
      }
    }
  }

  TEST_CASE("surf: images too small for a filter, one pixel wide, constant or empty have no points") {
    for (const auto& [width, height] :
         {std::pair{0, 0}, {1, 1}, {1, 500}, {500, 1}, {8, 8}, {14, 200}, {200, 14}})
      for (const unsigned threads : {1U, 4U}) {
        CHECK(cairn::surf(cairn::Image(width, height, 50), {}, threads).size() == 0);
        if (std::min(width, height) < 15)
          CHECK(cairn::surf(cairn_test::noise(width, height, 16)).size() == 0);
      }
    cairn::SurfOptions all;
    all.threshold = 0;
    CHECK(cairn::surf(cairn::Image(200, 150, 255), all).size() == 0);
  }

  TEST_CASE("surf: options out of range and keypoints that cannot be described are refused by name") {
    const auto refusal = [](auto change) {
      cairn::SurfOptions options;
      change(options);
      return message_of([&] { cairn::Surf extractor(options); });
    };
    using Options = cairn::SurfOptions;
    const auto has = [](const std::string& message, const char* words) {
      return message.find(words) != std::string::npos;
    };
    CHECK(has(refusal([](Options& o) { o.octaves = 0; }), "octaves between 1 and 5, found 0"));
    CHECK(has(refusal([](Options& o) { o.intervals = 99; }), "intervals"));
    CHECK(has(refusal([](Options& o) { o.initial_step = -1; }), "initial_step"));
    CHECK(has(refusal([](Options& o) { o.threshold = std::nanf(""); }), "threshold"));
    CHECK(has(refusal([](Options& o) { o.threshold = -1; }), "threshold"));
    CHECK(has(refusal([](Options& o) { o.target_count = -5; }), "target_count"));
    CHECK(has(refusal([](Options& o) { o.grid_rows = 0; }), "grid"));
    cairn::Surf extractor;
    const cairn::Image image = texture(60, 50, 17);
    const auto with = [&](auto change) {
      std::vector<cairn::Keypoint> keypoints(3);
      change(keypoints[2]);
      return message_of([&] { static_cast<void>(extractor.describe(image, keypoints)); });
    };
    CHECK(with([](cairn::Keypoint&) {}).empty());
    CHECK(has(with([](cairn::Keypoint& k) { k.x = std::nanf(""); }), "keypoint 2"));
    CHECK(has(with([](cairn::Keypoint& k) { k.y = 1e30F; }), "keypoint 2"));
    CHECK(has(with([](cairn::Keypoint& k) { k.scale = 0; }), "scale"));
    CHECK(has(with([](cairn::Keypoint& k) { k.angle = INFINITY; }), "angle"));
  }

  TEST_CASE("thresholds: the conversions agree with each other on the published table") {
    CHECK(cairn::threshold_from_opensurf(0.0004F) == doctest::Approx(26).epsilon(0.01));
    CHECK(cairn::threshold_from_opencv(875) == doctest::Approx(30).epsilon(0.01));
    CHECK(cairn::threshold_from_opencv(100) ==
          doctest::Approx(cairn::threshold_from_opensurf(5.3e-5F)).epsilon(0.01).scale(0));
  }
}

}  // namespace surf_test
