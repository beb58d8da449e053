// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <stdexcept>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>

namespace check_test {
namespace {

void throwing_handler(const cairn::Violation& violation) {
  throw std::logic_error(violation.sentence);
}

struct HandlerGuard {
  cairn::ViolationHandler previous = cairn::set_violation_handler(&throwing_handler);
  HandlerGuard() = default;
  HandlerGuard(const HandlerGuard&) = delete;
  HandlerGuard& operator=(const HandlerGuard&) = delete;
  ~HandlerGuard() { cairn::set_violation_handler(previous); }
};

}  // namespace

TEST_SUITE("check") {
  TEST_CASE("CAIRN_EXPECTS: hands the sentence to the installed handler, and only when broken") {
    const HandlerGuard guard;
    const auto half = [](int n) {
      CAIRN_EXPECTS(n % 2 == 0, "half needs an even number");
      return n / 2;
    };
    CHECK(half(4) == 2);
    CHECK_THROWS_WITH_AS(half(3), "half needs an even number", std::logic_error);
  }

  TEST_CASE("raise: throws cairn::Error with the message") {
    CHECK_THROWS_WITH_AS(cairn::raise("the file 'x' is empty"), "the file 'x' is empty", cairn::Error);
  }
}

}  // namespace check_test
