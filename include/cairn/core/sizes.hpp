// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Products of sizes that may be larger than a size: templates over the size type, so that what happens where
/// std::size_t has 32 bits is tested on machines where it has 64.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Whether a * b is a Size.
template <std::unsigned_integral Size>
[[nodiscard]] constexpr bool product_fits(Size a, Size b) noexcept {
  return b == 0 || a <= std::numeric_limits<Size>::max() / b;
}

/// floor(whole * part / parts) for part <= parts, parts > 0: not larger than whole, though the product may
/// be. Exact where the product has 64 bits.
template <std::unsigned_integral Size>
[[nodiscard]] constexpr Size share(Size whole, Size part, Size parts) noexcept {
  return static_cast<Size>(std::uint64_t{whole} * part / parts);
}

/// `count` times `each` numbers; throws Error, naming `what` they are for, where no memory has so many.
[[nodiscard]] inline std::size_t room_for(std::size_t count, std::size_t each, const char* what) {
  if (!product_fits(count, each)) [[unlikely]]
    raise(std::string(what) + ": " + std::to_string(count) + " times " + std::to_string(each) +
          " numbers are more than memory can be addressed for");
  return count * each;
}

}}}  // namespace cairn::CAIRN_ABI::detail
