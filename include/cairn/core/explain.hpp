// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What has a sentence prints as it: `std::cout << filter.predict(belief, model, dt)`.
#pragma once

#include <concepts>
#include <iosfwd>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Every status and verdict of the library, by its explain().
template <class Char, class Traits, class Explained>
  requires requires(const Explained& value) {
    { explain(value) } -> std::same_as<const char*>;
  }
std::basic_ostream<Char, Traits>& operator<<(std::basic_ostream<Char, Traits>& out, const Explained& value) {
  return out << explain(value);
}

}}  // namespace cairn::CAIRN_ABI
