// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/parallel.hpp>

TEST_SUITE("parallel") {
  TEST_CASE("parallel_for: visits every index once, whatever the counts") {
    for (const std::size_t count : {0UL, 1UL, 2UL, 7UL, 1000UL})
      for (const unsigned threads : {0U, 1U, 2U, 3U, 8U}) {
        std::vector<int> visits(count, 0);
        cairn::parallel_for(count, threads, [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) ++visits[i];
        });
        CAPTURE(count);
        CAPTURE(threads);
        CHECK(std::accumulate(visits.begin(), visits.end(), 0) == static_cast<int>(count));
        CHECK(std::all_of(visits.begin(), visits.end(), [](int n) { return n == 1; }));
      }
  }

  TEST_CASE("parallel_for: an exception of any block reaches the caller") {
    const auto body = [](std::size_t begin, std::size_t) {
      if (begin > 0) throw std::runtime_error("block");
    };
    CHECK_THROWS_WITH_AS(cairn::parallel_for(10, 3, body), "block", std::runtime_error);
  }
}
