// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// When a place is met again: a frame that agrees with many landmarks which had been out of view for long.
///
/// Closing a loop is no step of its own here: the joint covariance lets the earliest landmarks decide in
/// every frame. What is counted is the frame in which that begins to happen.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>

namespace stereo_slam {

struct LoopWatchOptions {
  int away = 50;               ///< steps out of view after which a landmark comes back
  std::size_t landmarks = 25;  ///< so many come back with a place: as many as find a lost camera
};

class LoopWatch {
public:
  explicit LoopWatch(const LoopWatchOptions& options = {}) : options_(options) {}

  [[nodiscard]] bool comes_back(int away) const noexcept { return away > options_.away; }

  /// `away`: how many steps before `step` each agreeing landmark was last seen. True where a place is met
  /// again, which was not the case in the steps before.
  [[nodiscard]] bool observe(int step, std::span<const int> away) {
    const auto back = std::ranges::count_if(away, [&](int one) { return comes_back(one); });
    if (static_cast<std::size_t>(back) < options_.landmarks) return false;
    const bool begins = step - last_return_ > options_.away;
    last_return_ = step;
    return begins;
  }

private:
  LoopWatchOptions options_;
  int last_return_ = std::numeric_limits<int>::min() / 2;
};

}  // namespace stereo_slam
