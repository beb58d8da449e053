// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The same with the instructions of every processor up to the one at hand.
#pragma once

#include <cairn/simd/processor.hpp>

namespace cairn_test {

/// Calls check() once for each, the one at hand last.
template <class Check>
void for_each_processor(const Check& check) {
  using cairn::detail::Processor;
  struct Restored {
    Processor at_hand = cairn::detail::processor();
    ~Restored() { cairn::detail::processor() = at_hand; }
  };
  const Restored restored;
  for (int processor = 0; processor <= static_cast<int>(restored.at_hand); ++processor) {
    cairn::detail::processor() = static_cast<Processor>(processor);
    check();
  }
}

}  // namespace cairn_test
