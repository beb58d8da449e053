// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstddef>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/index/detail/byte_blocks.hpp>

#include "support/processors.hpp"
#include "support/random.hpp"

namespace detail = cairn::detail;

namespace byte_blocks_test {
namespace {

std::vector<std::uint8_t> drawn(std::size_t count, cairn::Random& random) {
  std::vector<std::uint8_t> codes(count);
  for (std::uint8_t& code : codes) {
    const std::uint64_t number = random.below(300);  // the ends of the range often
    code = static_cast<std::uint8_t>(number < 256 ? number : number % 2 * 255);
  }
  return codes;
}

std::int32_t by_definition(const std::uint8_t* a, const std::uint8_t* b, std::size_t dim) {
  std::int32_t sum = 0;
  for (std::size_t i = 0; i < dim; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

/// Wrong distances of some blocks, with the lanes in force.
std::size_t wrong_distances(std::size_t dim, std::size_t blocks, cairn::Random& random) {
  const std::size_t count = blocks * detail::block_size;
  const auto codes = drawn(count * dim, random);
  const auto point = drawn(dim, random);
  detail::ByteBlocks all(dim, blocks);
  for (std::size_t i = 0; i < count; ++i) all.set(i, &codes[i * dim]);
  detail::ByteQuery query;
  query.set(point.data(), dim);
  std::vector<std::int32_t> distances(count);
  all.distances(0, blocks, query, distances.data());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < count; ++i)
    wrong += distances[i] != by_definition(point.data(), &codes[i * dim], dim);
  return wrong;
}

}  // namespace

TEST_SUITE("byte_blocks") {
  TEST_CASE("distances are exact, whatever the processor offers and the number of coordinates") {
    cairn::Random random(cairn_test::seed(86));
    cairn_test::for_each_processor([&] {
      for (std::size_t dim = 1; dim <= 130; ++dim) CHECK(wrong_distances(dim, dim % 3 + 1, random) == 0);
      CHECK(wrong_distances(detail::most_byte_axes, 1, random) == 0);
    });
  }

  TEST_CASE("the farthest points of the most coordinates fit 32 bits") {
    const std::size_t dim = detail::most_byte_axes;
    const std::vector<std::uint8_t> low(dim, 0), high(dim, 255);
    detail::ByteBlocks block(dim, 1);
    for (std::size_t lane = 0; lane < detail::block_size; ++lane)
      block.set(lane, lane % 2 == 0 ? low.data() : high.data());
    detail::ByteQuery query;
    std::int32_t distances[detail::block_size];
    const auto most = static_cast<std::int32_t>(255 * 255 * dim);
    for (const bool from_high : {false, true}) {
      query.set(from_high ? high.data() : low.data(), dim);
      block.distances(0, 1, query, distances);
      CHECK(distances[0] == (from_high ? most : 0));
      CHECK(distances[1] == (from_high ? 0 : most));
    }
  }
}

}  // namespace byte_blocks_test
