// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/reset_on_move.hpp>

namespace reset_on_move_test {

/// As the containers that use it: numbers, and how many of them count.
struct Bag {
  std::vector<int> numbers;
  cairn::ResetOnMove<int> used;
};

static_assert(std::is_nothrow_move_constructible_v<Bag> && std::is_nothrow_move_assignable_v<Bag>);

TEST_CASE("What was moved from counts nothing, and what it was moved to counts all") {
  Bag first{{1, 2, 3}, cairn::ResetOnMove<int>(3)};
  Bag second = std::move(first);
  CHECK(second.used == 3);
  CHECK(first.used == 0);  // NOLINT(bugprone-use-after-move): the promise that is tested
  CHECK(first.numbers.empty());

  first = std::move(second);
  CHECK(first.used == 3);
  CHECK(second.used == 0);  // NOLINT(bugprone-use-after-move)
}

TEST_CASE("A copy counts on its own") {
  Bag first{{1, 2}, cairn::ResetOnMove<int>(2)};
  Bag second = first;
  second.used += 5;
  second.used -= 1;
  CHECK(first.used == 2);
  CHECK(second.used == 6);
  second = first;
  CHECK(second.used == 2);
}

TEST_CASE("Assigned to itself it ends as a vector does") {
  Bag bag{{1, 2}, cairn::ResetOnMove<int>(2)};
  Bag& same = bag;
  bag = std::move(same);
  CHECK(static_cast<std::size_t>(bag.used) == bag.numbers.size());
}

}  // namespace reset_on_move_test
