// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Floating-point numbers from text where std::from_chars does not read them: libc++ does from version 20 on.
#pragma once

#include <locale.h>  // NOLINT(modernize-deprecated-headers): newlocale is POSIX's
#include <stdlib.h>  // NOLINT(modernize-deprecated-headers): strtod_l too
#if defined(__APPLE__)
#include <xlocale.h>
#endif

#include <charconv>
#include <cmath>
#include <concepts>
#include <string>
#include <string_view>
#include <system_error>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// The characters from the first on that are a number by the grammar of std::from_chars: a minus, then "inf",
/// "infinity" or "nan" of any case, or digits with a point and an exponent.
[[nodiscard]] inline std::string_view leading_number(std::string_view text) noexcept {
  std::size_t end = 0;
  const auto digits = [&] {
    const std::size_t first = end;
    while (end < text.size() && text[end] >= '0' && text[end] <= '9') ++end;
    return end - first;
  };
  const auto word = [&](std::string_view lower) {
    if (text.size() - end < lower.size()) return false;
    for (std::size_t i = 0; i < lower.size(); ++i)
      if ((text[end + i] | 0x20) != lower[i]) return false;
    end += lower.size();
    return true;
  };
  if (text.starts_with('-')) ++end;
  if (word("infinity") || word("inf") || word("nan")) return text.substr(0, end);
  std::size_t found = digits();
  if (end < text.size() && text[end] == '.') {
    ++end;
    found += digits();
  }
  if (found == 0) return {};
  const std::size_t mantissa = end;
  if (end < text.size() && (text[end] | 0x20) == 'e') {
    ++end;
    if (end < text.size() && (text[end] == '+' || text[end] == '-')) ++end;
    if (digits() == 0) end = mantissa;
  }
  return text.substr(0, end);
}

/// std::from_chars of a float or double by the C library, in the "C" locale whatever the program's is.
template <class Number>
  requires(std::same_as<Number, float> || std::same_as<Number, double>)
[[nodiscard]] std::from_chars_result read_by_strtod(const char* first, const char* last, Number& value) {
  static const locale_t plain = newlocale(LC_ALL_MASK, "C", nullptr);
  const std::string number(leading_number({first, static_cast<std::size_t>(last - first)}));
  if (number.empty()) return {first, std::errc::invalid_argument};
  const char* const end = first + number.size();
  Number read;
  if constexpr (std::same_as<Number, float>)
    read = strtof_l(number.c_str(), nullptr, plain);
  else
    read = strtod_l(number.c_str(), nullptr, plain);
  const bool has_digits = number.find_first_of("123456789") < number.find_first_of("eE");
  const bool is_word = number.find_first_of("0123456789") == std::string::npos;
  if ((std::isinf(read) && !is_word) || (read == Number(0) && has_digits))
    return {end, std::errc::result_out_of_range};
  value = read;
  return {end, std::errc()};
}

template <class Number>
concept ReadByFromChars = requires(const char* text, Number& value) { std::from_chars(text, text, value); };

/// std::from_chars, or what stands for it.
template <class Number>
[[nodiscard]] std::from_chars_result read_number(const char* first, const char* last, Number& value) {
  if constexpr (ReadByFromChars<Number>)
    return std::from_chars(first, last, value);
  else
    return read_by_strtod(first, last, value);
}

}}}  // namespace cairn::CAIRN_ABI::detail
