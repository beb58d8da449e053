// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Statuses and their sentences.
#pragma once

#include <set>
#include <string>

namespace cairn_test {

/// How many values from the first on have a sentence, each another one.
template <class Status>
[[nodiscard]] int sentences() {
  std::set<std::string> seen;
  int count = 0;
  for (;; ++count) {
    const std::string text = explain(static_cast<Status>(count));
    if (text.empty() || text.rfind("unknown", 0) == 0 || !seen.insert(text).second) return count;
  }
}

}  // namespace cairn_test
