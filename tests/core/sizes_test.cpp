// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/sizes.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

TEST_SUITE("sizes") {
  TEST_CASE("sizes: a product fits a size of 32 bits exactly where 64 bits say so") {
    const std::uint64_t seed = cairn_test::seed(201);
    CAPTURE(seed);
    cairn::Random random(seed);
    int fitting = 0;
    for (int round = 0; round < 20000; ++round) {
      const auto a = static_cast<std::uint32_t>(random.below(std::uint64_t{1} << random.below(33)));
      const auto b = static_cast<std::uint32_t>(random.below(std::uint64_t{1} << random.below(33)));
      const bool fits = std::uint64_t{a} * b <= 0xffffffffU;
      REQUIRE(cairn::detail::product_fits(a, b) == fits);
      fitting += fits;
    }
    CHECK(fitting > 1000);
    CHECK(fitting < 19000);
    CHECK(cairn::detail::product_fits(65536U, 65535U));
    CHECK_FALSE(cairn::detail::product_fits(65536U, 65536U));
  }

  TEST_CASE("sizes: shares of a size of 32 bits are those of 64, though the product is larger") {
    const std::uint64_t seed = cairn_test::seed(202);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int round = 0; round < 20000; ++round) {
      const auto whole = static_cast<std::uint32_t>(random.below(std::uint64_t{1} << 32));
      const auto parts = static_cast<std::uint32_t>(1 + random.below((std::uint64_t{1} << 32) - 1));
      const auto part = static_cast<std::uint32_t>(random.below(std::uint64_t{parts} + 1));
      REQUIRE(cairn::detail::share(whole, part, parts) == std::uint64_t{whole} * part / parts);
    }
    static_assert(cairn::detail::share(std::uint32_t{262145}, std::uint32_t{16384}, std::uint32_t{16385}) ==
                  262129);
  }

  TEST_CASE("sizes: room for more numbers than there are addresses is refused with both counts") {
    CHECK(cairn::detail::room_for(3, 4, "a test") == 12);
    CHECK(cairn::detail::room_for(0, std::numeric_limits<std::size_t>::max(), "a test") == 0);
    const std::size_t half = std::size_t{1} << (4 * sizeof(std::size_t));
    const std::string message =
        cairn_test::message_of([&] { static_cast<void>(cairn::detail::room_for(half, half, "a test")); });
    CHECK(message.find("a test: " + std::to_string(half) + " times " + std::to_string(half)) == 0);
  }
}
