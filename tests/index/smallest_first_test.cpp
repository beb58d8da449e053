// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/smallest_first.hpp>

#include "support/processors.hpp"
#include "support/random.hpp"

namespace detail = cairn::detail;

namespace smallest_first_test {
namespace {

/// Writes numbers, and smaller ones behind them up to a whole block, which must not come out.
void give(detail::SmallestFirst& smallest, const std::vector<std::int32_t>& numbers) {
  smallest.resize(numbers.size());
  std::copy(numbers.begin(), numbers.end(), smallest.keys());
  for (std::size_t i = numbers.size(); i % detail::block_size != 0; ++i) smallest.keys()[i] = -7;
  smallest.reset();
}

/// How many of the first `count` come in another order than std::sort's, equals by place.
std::size_t wrong_among(detail::SmallestFirst& smallest, const std::vector<std::int32_t>& numbers,
                        std::size_t count) {
  std::vector<std::pair<std::int32_t, std::size_t>> order;
  for (std::size_t i = 0; i < numbers.size(); ++i) order.emplace_back(numbers[i], i);
  std::sort(order.begin(), order.end());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto item = smallest.next();
    wrong += item.place != order[i].second || item.key != order[i].first;
  }
  return wrong;
}

}  // namespace

TEST_SUITE("smallest_first") {
  TEST_CASE("SmallestFirst: in ascending order, equals by place") {
    cairn::Random random(cairn_test::seed(87));
    cairn_test::for_each_processor([&] {
      detail::SmallestFirst smallest;
      for (const std::size_t count : {1U, 15U, 16U, 17U, 128U, 256U, 257U, 300U, 5000U})
        for (const std::uint64_t different : {std::uint64_t{1}, std::uint64_t{3}, std::uint64_t{count}}) {
          std::vector<std::int32_t> numbers(count);
          for (std::int32_t& number : numbers) number = static_cast<std::int32_t>(random.below(different));
          give(smallest, numbers);
          CHECK(wrong_among(smallest, numbers, count) == 0);
          CHECK(smallest.next().place == detail::SmallestFirst::none);
          CHECK(smallest.next().place == detail::SmallestFirst::none);
        }
    });
  }

  TEST_CASE("SmallestFirst: the largest number that may be, none at all, and a list used again half read") {
    detail::SmallestFirst smallest;
    const std::int32_t most = detail::SmallestFirst::taken - 1;
    std::vector<std::int32_t> numbers(40, most);
    numbers[33] = 0;
    give(smallest, numbers);
    CHECK(wrong_among(smallest, numbers, 5) == 0);
    numbers.assign(3, 8);
    give(smallest, numbers);
    CHECK(wrong_among(smallest, numbers, 3) == 0);
    CHECK(smallest.next().place == detail::SmallestFirst::none);
    numbers.clear();
    give(smallest, numbers);
    CHECK(smallest.next().place == detail::SmallestFirst::none);
  }
}

}  // namespace smallest_first_test
