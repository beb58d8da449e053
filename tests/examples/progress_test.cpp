// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/progress.hpp"

#include <algorithm>
#include <sstream>
#include <string>

#include <doctest/doctest.h>

namespace progress_test {
namespace {

std::string after(std::size_t total, std::size_t steps, bool terminal) {
  std::ostringstream out;
  {
    example::Progress progress(out, "tracking", total, terminal);
    for (std::size_t i = 0; i < steps; ++i) progress.step("12 landmarks");
  }
  return out.str();
}

}  // namespace

TEST_SUITE_BEGIN("examples/progress");

TEST_CASE("progress: one line for every tenth where there is no terminal") {
  for (const std::size_t total : {10U, 37U, 100U, 1234U}) {
    CAPTURE(total);
    const std::string text = after(total, total, false);
    CHECK(std::count(text.begin(), text.end(), '\n') == 10);
    CHECK(text.find('\r') == std::string::npos);
    CHECK(text.find("tracking 100 %  " + std::to_string(total) + "/" + std::to_string(total)) !=
          std::string::npos);
  }
}

TEST_CASE("progress: fewer steps than tenths give a line each") {
  const std::string text = after(3, 3, false);
  CHECK(std::count(text.begin(), text.end(), '\n') == 3);
}

TEST_CASE("progress: on a terminal one line is rewritten and ended once") {
  const std::string text = after(500, 500, true);
  CHECK(std::count(text.begin(), text.end(), '\n') == 1);
  CHECK(text.back() == '\n');
  CHECK(text.front() == '\r');
  CHECK(text.find("tracking 100 %  500/500") != std::string::npos);
  CHECK(text.find("12 landmarks") != std::string::npos);
}

TEST_CASE("progress: a run that stops early leaves the cursor on a new line") {
  CHECK(after(500, 2, true).back() == '\n');
  CHECK(after(500, 0, true).empty());
}

TEST_CASE("progress: no total and too many steps do no harm") {
  CHECK(after(0, 3, false).empty());
  const std::string text = after(2, 5, false);
  CHECK(std::count(text.begin(), text.end(), '\n') == 2);
}

TEST_SUITE_END();

}  // namespace progress_test
