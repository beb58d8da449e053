// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What stands for std::from_chars where the library has none for floating-point numbers, against
// std::from_chars.
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/io/text.hpp>

namespace read_number_test {
namespace {

template <class Number>
void check_as_from_chars(const std::string& text) {
  if constexpr (cairn::detail::ReadByFromChars<Number>) {
    CAPTURE(text);
    Number expected = 7, found = 7;
    const char *const first = text.data(), *const last = first + text.size();
    const auto right = std::from_chars(first, last, expected);
    const auto mine = cairn::detail::read_by_strtod(first, last, found);
    CHECK(mine.ec == right.ec);
    CHECK(mine.ptr == right.ptr);
    if (std::isnan(expected))
      CHECK(std::isnan(found));
    else
      CHECK((found == expected && std::signbit(found) == std::signbit(expected)));
  }
}

void check_both(const std::string& text) {
  check_as_from_chars<double>(text);
  check_as_from_chars<float>(text);
}

}  // namespace

TEST_SUITE("io/read_number") {
  TEST_CASE("read_number: words, points, exponents, and what is no number") {
    for (const char* text : {"",
                             "-",
                             ".",
                             "-.",
                             "e5",
                             "1",
                             "-0",
                             "-0.0",
                             "0e5",
                             ".5",
                             "5.",
                             "-.5e-1",
                             "1e",
                             "1e+",
                             "1e-",
                             "1e+3",
                             "1E-3",
                             "1e5x",
                             "+1",
                             " 1",
                             "1 ",
                             "0x10",
                             "1.2.3",
                             "1,5",
                             "--1",
                             "inf",
                             "-INF",
                             "infi",
                             "Infinity",
                             "infinit",
                             "nan",
                             "-NaN",
                             "nanx",
                             "1e400",
                             "-1e400",
                             "1e-400",
                             "1e39",
                             "1e-50",
                             "4.9e-324",
                             "2e-324",
                             "2.5e-324",
                             "1e-45",
                             "1e-46",
                             "0e-400",
                             "0.000e999",
                             "00012",
                             "1e0000000001",
                             "1e99999999999999999999",
                             "0.1e-99999999999999999999"})
      check_both(text);
  }

  TEST_CASE("read_number: every number that is written is read back, and its first digits too") {
    cairn::Random random(3);
    for (int i = 0; i < 2000; ++i) {
      const auto value = std::bit_cast<double>(random());
      if (!std::isfinite(value)) continue;
      std::string text = cairn::shortest(value);
      check_both(text);
      check_both(std::to_string(value));
      text.resize(text.size() * static_cast<std::size_t>(i % 4) / 4);
      check_both(text);
    }
  }

  TEST_CASE("read_number: letters at random") {
    cairn::Random random(4);
    const std::string letters = "0123456789019..eE+--infa x";
    for (int i = 0; i < 20000; ++i) {
      std::string text;
      const auto size = static_cast<std::size_t>(random.uniform(0, 12));
      while (text.size() < size)
        text += letters[static_cast<std::size_t>(random.uniform(0, static_cast<double>(letters.size())))];
      check_both(text);
    }
  }
}

}  // namespace read_number_test
