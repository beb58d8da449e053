// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/index/detail/byte_scale.hpp>

#include "support/processors.hpp"
#include "support/random.hpp"

namespace detail = cairn::detail;

TEST_SUITE("byte_scale") {
  TEST_CASE(
      "ByteScale: bytes are coordinates divided by the unit, rounded, on every processor, also by powers of "
      "two") {
    cairn::Random random(cairn_test::seed(91));
    cairn_test::for_each_processor([&] {
      for (const float unit : {1.0F, 0.25F, 0x1p-40F, 0x1p60F, 0.3F, 0x1p-127F})
        for (const std::size_t dim : {1U, 16U, 37U}) {
          std::vector<float> low(dim), row(dim);
          for (float& number : low) number = unit * static_cast<float>(random.uniform(-50, 50));
          for (std::size_t a = 0; a < dim; ++a)
            row[a] = low[a] + unit * static_cast<float>(random.uniform(-9, 270));
          std::vector<std::uint8_t> bytes(dim);
          const auto missed = detail::ByteScale(low, unit).encode(row.data(), bytes.data());
          double rounding = 0, outside = 0;
          for (std::size_t a = 0; a < dim; ++a) {
            const float scaled = (row[a] - low[a]) / unit, inside = std::clamp(scaled, 0.0F, 255.0F);
            CHECK(bytes[a] == std::floor(inside + 0.5F));
            rounding += std::pow(inside - static_cast<float>(bytes[a]), 2);
            outside += std::pow(scaled - inside, 2);
          }
          CHECK(missed.rounding >= std::sqrt(rounding));
          CHECK(missed.rounding <= 1.002 * std::sqrt(rounding) + 2e-3);
          CHECK(missed.outside_squared == doctest::Approx(outside).epsilon(1e-4));
        }
    });
  }

  TEST_CASE("ByteScale: a point misses nothing only where all its coordinates are bytes' values") {
    cairn_test::for_each_processor([] {
      for (const std::size_t odd : {0U, 15U, 20U}) {
        std::vector<float> row(21);
        for (std::size_t a = 0; a < row.size(); ++a) row[a] = static_cast<float>(a) / 4;
        std::vector<std::uint8_t> bytes(row.size());
        const detail::ByteScale scale(std::vector<float>(row.size(), 0), 0.25F);
        CHECK(scale.encode(row.data(), bytes.data()).rounding == 0);
        row[odd] += 0.0625F;
        CHECK(scale.encode(row.data(), bytes.data()).rounding >= 0.25F);
        row[odd] = 64;
        CHECK(scale.encode(row.data(), bytes.data()).outside_squared == 1);
      }
    });
  }
}
