// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Lines and numbers of text formats, strict and independent of the locale.
///
/// Numbers are read by std::from_chars and written by std::to_chars in the shortest form that reads back to
/// the same bits. Every refusal names file, line, what was expected and what stands there.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include <cairn/core/check.hpp>
#include <cairn/io/detail/read_number.hpp>
#include <cairn/io/file.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// `text` without blanks (space, tab, carriage return) at both ends.
[[nodiscard]] inline std::string_view trimmed(std::string_view text) noexcept {
  constexpr std::string_view blanks = " \t\r";
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

/// The number that `text` is from its first to its last character (one leading '+' allowed), or nothing.
/// "nan" and "inf" are numbers to this function.
template <class Number = double>
[[nodiscard]] std::optional<Number> parse_number(std::string_view text) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  Number value{};
  const auto [end, error] = detail::read_number(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Appends `value` in the shortest form that parse_number reads back bit for bit.
template <class Number>
void append_number(std::string& text, Number value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  text.append(buffer, end);
}

/// The number as append_number writes it: for messages, where 1e300 is not to take 300 digits.
template <class Number>
[[nodiscard]] std::string shortest(Number value) {
  std::string text;
  append_number(text, value);
  return text;
}

/// The lines of a text file, with the place of the current one for messages. Accepts LF and CR LF, with or
/// without a last line end, and skips a byte-order mark of UTF-8 at the start.
class TextLines {
public:
  /// Reads the whole file; throws Error as read_file does, and where it is packed.
  explicit TextLines(const std::filesystem::path& path, std::string_view expected)
      : name_(path.string()), text_(read_file(path, expected)) {
    expect_unpacked(expected);
    if (std::string_view(text_).substr(0, 3) == "\xEF\xBB\xBF") position_ = 3;
  }
  TextLines(const TextLines&) = delete;  // line() looks into the text held here
  TextLines& operator=(const TextLines&) = delete;

  /// Moves to the next line that is neither blank nor, when `comment` is not 0, starts with it. False at the
  /// end.
  bool next(char comment = '#') {
    while (position_ < text_.size()) {
      const std::size_t end = std::min(text_.find('\n', position_), text_.size());
      line_ = trimmed(std::string_view(text_).substr(position_, end - position_));
      position_ = end + 1;
      ++number_;
      if (!line_.empty() && (comment == '\0' || line_.front() != comment)) return true;
    }
    line_ = {};
    return false;
  }

  [[nodiscard]] std::string_view line() const noexcept { return line_; }
  [[nodiscard]] std::size_t number() const noexcept { return number_; }

  /// Cuts the current line at `separator` (' ' stands for any run of blanks) into numbers[0..count) and
  /// returns how many fields the line has, which may be more than count. Throws on a field among the first
  /// count that is no finite number.
  std::size_t numbers(char separator, double* numbers, std::size_t count) const {
    std::size_t fields = 0;
    for (std::string_view rest = line_;; ++fields) {
      const std::size_t end = rest.find_first_of(separator == ' ' ? " \t" : std::string_view(&separator, 1));
      const std::string_view field = trimmed(rest.substr(0, end));
      if (fields < count) numbers[fields] = finite(field, fields);
      if (end == std::string_view::npos) return fields + 1;
      rest.remove_prefix(end + 1);
      if (separator == ' ') rest = trimmed(rest);
    }
  }

  /// Throws Error: file:line, what was expected, and the line itself.
  [[noreturn]] void fail(const std::string& expected) const {
    constexpr std::size_t most_shown = 80;
    const std::string shown(line_.substr(0, most_shown));
    raise(name_ + ":" + std::to_string(number_) + ": expected " + expected +
          (shown.empty() ? std::string(", found the end of the file") : ", found '" + shown + "'"));
  }

private:
  void expect_unpacked(std::string_view expected) const {
    struct Packer {
      std::string_view begin, name, unpack;
    };
    static constexpr Packer packers[] = {{"\x1F\x8B", "gzip", "gunzip"},
                                         {"BZh", "bzip2", "bunzip2"},
                                         {"\xFD"
                                          "7zXZ",
                                          "xz", "unxz"},
                                         {"PK\x03\x04", "zip", "unzip"}};
    for (const Packer& packer : packers)
      if (text_.starts_with(packer.begin))
        raise(name_ + ": expected " + std::string(expected) + ", found a file packed by " +
              std::string(packer.name) + " (" + std::string(packer.unpack) + " makes it text)");
  }

  double finite(std::string_view field, std::size_t index) const {
    const std::optional<double> value = parse_number(field);
    if (!value || !std::isfinite(*value))
      fail("a finite number in column " + std::to_string(index + 1) + " ('" + std::string(field) +
           "' is none)");
    return *value;
  }

  std::string name_;
  std::string text_;
  std::string_view line_;
  std::size_t position_ = 0;
  std::size_t number_ = 0;
};

}}  // namespace cairn::CAIRN_ABI
