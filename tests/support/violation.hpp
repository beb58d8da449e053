// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The sentence of the precondition that a call breaks.
#pragma once

#include <stdexcept>
#include <string>

#include <cairn/core/check.hpp>

namespace cairn_test {

/// What the violation handler is told while `call` runs; empty where nothing is broken. The handler throws,
/// as one of a caller's may.
template <class Call>
std::string violation_of(Call&& call) {
  struct Guard {
    cairn::ViolationHandler previous = cairn::set_violation_handler(
        [](const cairn::Violation& violation) { throw std::logic_error(violation.sentence); });
    Guard() = default;
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;
    ~Guard() { cairn::set_violation_handler(previous); }
  };
  const Guard guard;
  try {
    call();
  } catch (const std::logic_error& error) {
    return error.what();
  }
  return {};
}

}  // namespace cairn_test
