// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Keeps the work on a frame near a time, by leaving out what is missed least.
///
/// Two measures. What a frame would cost if nothing were left out sets how many interest points the next ones
/// have: with n points and a cost c(n) = a + b n the wish n T / c(n), T the budget, has the n of c(n) = T as
/// its fixed point and never swings about it, however many frames later it takes effect, because its slope
/// a / c lies between 0 and 1. And within a frame, work that can wait is not begun when what it took of late
/// does not fit into the rest: the world is tidied up in another frame, a landmark missed is seen in the
/// next. The pose itself is never left out.
///
/// Knows numbers only: whoever calls says what time it is.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <optional>

namespace stereo_slam {

/// What a frame can do without, the least missed first; names as they stand in summary.json.
enum class Shed {
  tidying,  ///< old and twin landmarks leave another time; of a loop that closes its worth is not computed
  points,   ///< fewer interest points than were asked for, the strongest
  second_look,  ///< no search where landmarks must be
  patches,      ///< landmarks are where keypoints are found, not where their surface is
  keyframe      ///< put off, unless that was done until much less is known
};
inline constexpr std::array<const char*, 5> shed_names{"tidying", "points", "second_look", "patches",
                                                       "keyframe"};
using ShedSet = std::bitset<shed_names.size()>;

struct FrameBudgetOptions {
  std::optional<double> milliseconds;  ///< of work a frame, all but reading; nothing: there is no limit
  int least_points = 300;              ///< an image is left, or all that are asked for if these are fewer
};

class FrameBudget {
public:
  /// `points`: as many as are asked for in an image. Throws cairn::Error unless the budget is positive and
  /// finite.
  FrameBudget(const FrameBudgetOptions& options, int points);

  [[nodiscard]] bool on() const noexcept { return options_.milliseconds.has_value(); }

  /// Whether there is time for some work, `spent` milliseconds after the frame began. Where there is not it
  /// counts as left out.
  [[nodiscard]] bool allows(Shed work, double spent);
  /// What the work took where it was done. [ms]
  void took(Shed work, double milliseconds);

  /// The frame is over: it had `points` interest points, `wanted` of them, and took `spent`. Returns what it
  /// did without.
  ShedSet finish(int points, int wanted, double spent);

  /// Interest points that an image should have from here on.
  [[nodiscard]] int points() const noexcept { return points_; }

private:
  FrameBudgetOptions options_;
  int most_points_;
  int points_;
  double wish_;                                       // points, not rounded
  std::array<double, shed_names.size()> expected_{};  // what each kind took of late [ms]
  ShedSet left_out_;
};

}  // namespace stereo_slam
