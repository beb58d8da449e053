// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <concepts>
#include <cstdint>
#include <limits>
#include <utility>

#include <doctest/doctest.h>

#include <cairn/vision/image.hpp>

#include "support/folder.hpp"

namespace image_test {
namespace {

static_assert(std::regular<cairn::Image>);
static_assert(std::is_trivially_copyable_v<cairn::ImageView>);
static_assert(std::convertible_to<const cairn::Image&, cairn::ImageView>);

}  // namespace

TEST_SUITE("image") {
  TEST_CASE("Image: is filled, and keeps each pixel at its column and row") {
    cairn::Image image(3, 2, 7);
    CHECK(image.width() == 3);
    CHECK(image.height() == 2);
    image(2, 1) = 9;
    CHECK(image(0, 0) == 7);
    CHECK(image.row(1)[2] == 9);
  }

  TEST_CASE("Image: copies are independent, a moved-from image is empty and usable") {
    cairn::Image image(4, 4, 1);
    cairn::Image copy = image;
    copy(0, 0) = 2;
    CHECK(copy != image);
    const cairn::Image taken = std::move(image);
    CHECK(image.empty());            // NOLINT(bugprone-use-after-move): the promise under test
    CHECK(image == cairn::Image());  // NOLINT
    CHECK(taken.width() == 4);
    image = taken;
    CHECK(image == taken);
  }

  TEST_CASE("ImageView: steps over the gap between rows, and a copy of it has none") {
    const std::array<std::uint8_t, 8> bytes{1, 2, 3, 99, 4, 5, 6, 99};
    const cairn::ImageView view(bytes.data(), 3, 2, 4);
    CHECK(view(0, 1) == 4);
    CHECK(view(2, 1) == 6);
    const cairn::Image copy(view);
    CHECK(copy(2, 1) == 6);
    CHECK(cairn::ImageView(copy).stride() == 3);
  }

  TEST_CASE("image: a bad size is refused with the size in the message") {
    using cairn_test::message_of;
    const std::uint8_t pixel = 0;
    CHECK(message_of([] { cairn::Image(-1, 5); }).find("-1 x 5") != std::string::npos);
    CHECK(message_of([] { cairn::Image(5, std::numeric_limits<int>::max()); }).find("5 x 2147483647") !=
          std::string::npos);
    CHECK(message_of([&] { cairn::ImageView(&pixel, 3, 1, 2); }).find("width 3, found 2") !=
          std::string::npos);
    CHECK(message_of([] { cairn::ImageView(nullptr, 3, 1, 3); }).find("null") != std::string::npos);
    CHECK(message_of([] { cairn::ImageView(nullptr, 0, 0, 0); }).empty());
  }
}

}  // namespace image_test
