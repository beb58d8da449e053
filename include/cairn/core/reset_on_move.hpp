// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A member that is as new where its object was moved from. Vectors are empty then; a count beside them that
/// stayed would promise points that are elsewhere.
#pragma once

#include <utility>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Used as the T that it holds: by conversion where that is a number, by -> where it is a class. An object
/// with such members needs no move operations of its own. Moving does not throw where T's copy does not.
template <class T>
class ResetOnMove {
public:
  ResetOnMove() = default;
  explicit ResetOnMove(T value) noexcept : value_(value) {}
  ResetOnMove& operator=(T value) noexcept {
    value_ = value;
    return *this;
  }
  ResetOnMove(const ResetOnMove&) = default;
  ResetOnMove& operator=(const ResetOnMove&) = default;
  ~ResetOnMove() = default;

  ResetOnMove(ResetOnMove&& other) noexcept : value_(std::exchange(other.value_, T{})) {}
  /// In this order: as a vector does, it ends as new where it is assigned to itself.
  ResetOnMove& operator=(ResetOnMove&& other) noexcept {
    value_ = other.value_;
    other.value_ = T{};
    return *this;
  }

  [[nodiscard]] explicit(false) operator T&() noexcept { return value_; }
  [[nodiscard]] explicit(false) operator const T&() const noexcept { return value_; }
  [[nodiscard]] const T* operator->() const noexcept { return &value_; }

private:
  T value_{};
};

}}  // namespace cairn::CAIRN_ABI
