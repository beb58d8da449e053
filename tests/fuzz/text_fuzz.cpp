// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Lines and numbers: what is parsed is written back to the same bits, and fields are counted as a plain split
// counts them.
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>

#include "fuzz/scratch.hpp"

namespace {

using cairn_fuzz::expect;

template <class Number>
void check_number(std::string_view text) {
  const auto value = cairn::parse_number<Number>(text);
  if (!value) return;
  std::string again;
  cairn::append_number(again, *value);
  const auto back = cairn::parse_number<Number>(again);
  expect(back.has_value(), "a written number is a number");
  if constexpr (std::is_floating_point_v<Number>) {
    if (std::isnan(*value)) return;
    expect(std::bit_cast<std::uint64_t>(double{*back}) == std::bit_cast<std::uint64_t>(double{*value}),
           "a number comes back to the bit");
  } else {
    expect(*back == *value, "a number comes back");
  }
}

/// Fields of a line that is trimmed, by the words of TextLines::numbers.
std::size_t fields_of(std::string_view line, char separator) {
  std::size_t fields = 1;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const bool blank = line[i] == ' ' || line[i] == '\t';
    if (separator == ' ' ? blank : line[i] == separator) ++fields;
    if (separator == ' ' && blank)
      while (i + 1 < line.size() && std::string_view(" \t\r").find(line[i + 1]) != std::string_view::npos)
        ++i;
  }
  return fields;
}

void check_lines(const std::filesystem::path& file, char comment, char separator) {
  cairn::TextLines lines(file, "text");
  std::size_t last = 0;
  while (lines.next(comment)) {
    const std::string_view line = lines.line();
    expect(!line.empty() && line == cairn::trimmed(line), "a line is trimmed and not blank");
    expect(comment == '\0' || line.front() != comment, "a line is no comment");
    expect(lines.number() > last, "lines are counted");
    last = lines.number();
    expect(lines.numbers(separator, nullptr, 0) == fields_of(line, separator), "fields are counted");
    try {
      double numbers[3] = {NAN, NAN, NAN};
      const std::size_t fields = lines.numbers(separator, numbers, 3);
      for (std::size_t i = 0; i < 3; ++i)
        expect(std::isfinite(numbers[i]) == (i < fields), "numbers are finite, as many as there are fields");
    } catch (const cairn::Error&) {
      continue;
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  const std::string_view text = cairn_fuzz::text_of(data, size);
  check_number<double>(text);
  check_number<float>(text);
  check_number<int>(text);
  check_number<std::int64_t>(text);
  check_number<std::uint64_t>(text);
  check_number<std::uint8_t>(text);
  const std::filesystem::path file = scratch.put("text", text);
  try {
    static_cast<void>(cairn::TextLines(file, "text"));
  } catch (const cairn::Error&) {  // packed
    return cairn_fuzz::refused();
  }
  for (const char comment : {'#', '\0'})
    for (const char separator : {' ', ',', ';'}) check_lines(file, comment, separator);
  return 0;
}
