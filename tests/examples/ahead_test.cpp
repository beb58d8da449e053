// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/ahead.hpp"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>

#include "support/random.hpp"

namespace ahead_test {
namespace {

using example::Ahead;

/// Some items take long, most take no time: what came first need not be ready first.
void dawdle(std::size_t i) {
  cairn::Random random(cairn_test::seed(), i);
  if (random.below(4) == 0) std::this_thread::sleep_for(std::chrono::microseconds(random.below(400)));
}

/// True when `condition` comes to hold within ten seconds.
template <class Condition>
bool comes_true(const Condition& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!condition() && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  return condition();
}

}  // namespace

TEST_SUITE_BEGIN("examples/ahead");

TEST_CASE("ahead: items come in order, each made once, for any number of threads and any bound") {
  for (const unsigned threads : {0U, 1U, 2U, 3U, 8U})
    for (const std::size_t bound : {0U, 1U, 2U, 5U, 1000U}) {
      CAPTURE(threads);
      CAPTURE(bound);
      constexpr std::size_t count = 120;
      std::vector<std::atomic<int>> times(count);
      Ahead<std::unique_ptr<std::size_t>> ahead(count, threads, bound, [&](std::size_t i, unsigned) {
        dawdle(i);
        ++times[i];
        return std::make_unique<std::size_t>(i * i);  // moved, never copied
      });
      for (std::size_t i = 0; i < count; ++i) REQUIRE(*ahead.take() == i * i);
      for (const std::atomic<int>& one : times) CHECK(one == 1);
    }
}

TEST_CASE("ahead: never more than the bound is begun and not taken, and as much as that is begun") {
  for (const std::size_t bound : {1U, 2U, 7U}) {
    CAPTURE(bound);
    constexpr std::size_t count = 60;
    std::atomic<std::size_t> begun = 0, taken = 0;
    std::atomic<bool> exceeded = false;
    Ahead<std::size_t> ahead(count, 4, bound, [&](std::size_t i, unsigned) {
      // Counted as taken a moment after it is, so that one more may be there
      if (++begun > taken + bound + 1) exceeded = true;
      dawdle(i);
      return i;
    });
    CHECK(comes_true([&] { return begun == bound; }));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    CHECK(begun == bound);
    for (std::size_t i = 0; i < count; ++i) {
      REQUIRE(ahead.take() == i);
      ++taken;
    }
    CHECK_FALSE(exceeded);
    CHECK(begun == count);
  }
}

TEST_CASE("ahead: no two items are made at once under one thread's number") {
  std::vector<std::atomic<int>> busy(3);
  std::atomic<bool> shared = false;
  std::set<std::thread::id> by_number_0;
  Ahead<int> ahead(200, 3, 4, [&](std::size_t i, unsigned thread) {
    if (busy[thread]++ != 0) shared = true;
    if (thread == 0) by_number_0.insert(std::this_thread::get_id());
    dawdle(i);
    --busy[thread];
    return 0;
  });
  for (int i = 0; i < 200; ++i) static_cast<void>(ahead.take());
  CHECK_FALSE(shared);
  by_number_0.insert(std::this_thread::get_id());
  CHECK(by_number_0.size() == 1);
}

TEST_CASE("ahead: one that waits makes another item in the meantime") {
  std::atomic<bool> second = false, alone = false;
  Ahead<std::size_t> ahead(2, 2, 2, [&](std::size_t i, unsigned) {
    if (i == 0 && !comes_true([&] { return second.load(); })) alone = true;
    if (i == 1) second = true;
    return i;
  });
  CHECK(ahead.take() == 0);  // would wait for ever if nobody made item 1
  CHECK_FALSE(alone);
}

TEST_CASE("ahead: an exception comes out where its item would, after all items before it") {
  for (const unsigned threads : {1U, 2U, 5U}) {
    CAPTURE(threads);
    std::atomic<std::size_t> last = 0;
    Ahead<std::size_t> ahead(1000, threads, 4, [&](std::size_t i, unsigned) {
      dawdle(i);
      if (i == 17) throw std::runtime_error("item 17 is torn");
      if (i > last) last = i;
      return i;
    });
    for (std::size_t i = 0; i < 17; ++i) REQUIRE(ahead.take() == i);
    for (int again = 0; again < 2; ++again) {
      std::string what;
      try {
        static_cast<void>(ahead.take());
      } catch (const std::runtime_error& error) {
        what = error.what();
      }
      CHECK(what == "item 17 is torn");
    }
    CHECK(last <= 17 + 4);
  }
}

TEST_CASE("ahead: after an exception nothing is begun any more") {
  std::atomic<std::size_t> begun = 0;
  std::atomic<bool> failed = false;
  {
    Ahead<std::size_t> ahead(1000, 4, 1000, [&](std::size_t i, unsigned) {
      ++begun;
      if (i == 17) {
        failed = true;
        throw std::runtime_error("item 17 is torn");
      }
      if (i > 17) comes_true([&] { return failed.load(); });
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return i;
    });
    for (std::size_t i = 0; i < 17; ++i) REQUIRE(ahead.take() == i);
    CHECK_THROWS_AS(static_cast<void>(ahead.take()), std::runtime_error);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  CHECK(begun <= 17 + 1 + 4);  // what the others were about, one a thread
}

TEST_CASE("ahead: the first of several failures is the one that is heard of") {
  for (int trial = 0; trial < 20; ++trial) {
    Ahead<std::size_t> ahead(50, 4, 8, [&](std::size_t i, unsigned) -> std::size_t {
      dawdle(i + 100 * static_cast<std::size_t>(trial));
      if (i >= 5) throw i;
      return i;
    });
    std::size_t taken = 0, thrown = 0;
    try {
      for (;; ++taken) static_cast<void>(ahead.take());
    } catch (std::size_t item) {
      thrown = item;
    }
    CHECK(taken == 5);
    CHECK(thrown == 5);
  }
}

TEST_CASE("ahead: left early it ends with what is under way, and nothing is made afterwards") {
  std::atomic<std::size_t> begun = 0, over = 0;
  {
    Ahead<std::size_t> ahead(1000000, 4, 8, [&](std::size_t i, unsigned) {
      ++begun;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      ++over;
      return i;
    });
    CHECK(ahead.take() == 0);
  }
  CHECK(begun == over);
  CHECK(begun <= 9);
  {
    const Ahead<std::size_t> untouched(1000000, 3, 2, [&](std::size_t i, unsigned) { return i; });
  }
}

TEST_CASE("ahead: of no items there are none to make, and none to wait for") {
  std::atomic<int> made = 0;
  {
    const Ahead<int> ahead(0, 4, 4, [&](std::size_t, unsigned) { return ++made; });
  }
  CHECK(made == 0);
}

TEST_SUITE_END();

}  // namespace ahead_test
