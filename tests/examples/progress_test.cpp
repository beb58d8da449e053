// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/progress.hpp"

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <string>

#include <doctest/doctest.h>
#include <unistd.h>

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

TEST_CASE("progress: the line is never as wide as the terminal, so that it does not scroll") {
  for (const std::size_t columns : {1U, 2U, 20U, 50U, 79U, 200U}) {
    CAPTURE(columns);
    std::ostringstream out;
    {
      example::Progress progress(out, "tracking", 2000, true, columns);
      for (std::size_t i = 0; i < 2000; ++i)
        progress.step("1234 of 1448 points agree, 1677 landmarks, \xe2\x82\xac and \xc3\xa4");
    }
    const std::string text = out.str();
    for (std::size_t from = text.find('\r'); from != std::string::npos; from = text.find('\r', from + 1)) {
      const std::string line = text.substr(from + 1, text.find("\x1b[K", from) - from - 1);
      CHECK(line.size() < columns);
      CHECK(line.substr(0, 8) == std::string("tracking").substr(0, columns - 1));
    }
  }
}

TEST_CASE("progress: a cut line ends with a whole character") {
  for (std::size_t columns = 40; columns < 60; ++columns) {
    std::ostringstream out;
    {
      example::Progress progress(out, "x", 1, true, columns);
      progress.step("\xe2\x82\xac\xe2\x82\xac\xe2\x82\xac\xe2\x82\xac\xe2\x82\xac\xe2\x82\xac\xe2\x82\xac");
    }
    const std::string text = out.str();
    const std::size_t bytes = static_cast<std::size_t>(std::count_if(
        text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0x80U) != 0; }));
    CHECK(bytes % 3 == 0);
  }
}

TEST_CASE("progress: COLUMNS says how wide a terminal is at most") {
  const char* before = std::getenv("COLUMNS");
  const std::string kept = before != nullptr ? before : "";
  ::setenv("COLUMNS", "33", 1);
  CHECK(example::terminal_columns(-1) == 33);
  CHECK(example::terminal_columns(STDERR_FILENO) <= 33);
  for (const char* useless : {"", "0", "-5", "wide", "1e3"}) {
    ::setenv("COLUMNS", useless, 1);
    CHECK(example::terminal_columns(-1) == 80);
  }
  ::unsetenv("COLUMNS");
  CHECK(example::terminal_columns(-1) == 80);
  if (before != nullptr) ::setenv("COLUMNS", kept.c_str(), 1);
}

TEST_CASE("progress: no total and too many steps do no harm") {
  CHECK(after(0, 3, false).empty());
  const std::string text = after(2, 5, false);
  CHECK(std::count(text.begin(), text.end(), '\n') == 2);
}

TEST_SUITE_END();

}  // namespace progress_test
