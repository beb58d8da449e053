// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a robot's odometry gets wrong every time, learned from landmarks whose names it reads: how late it
/// moves, and how far it turns for a radian of odometry. No place of a landmark or of the robot need be
/// known.
#pragma once

#include <span>

namespace fastslam {

/// A line of odometry: how the robot moves from then on.
struct WheelSpeeds {
  double time;   ///< [s]
  double speed;  ///< [m/s]
  double turn;   ///< [rad/s]
};

/// Whether the robot turns where it stands, or stands still: there its wheels slip otherwise than in curves.
[[nodiscard]] bool is_on_the_spot(const WheelSpeeds& odometry);

/// A bar code seen from the robot.
struct CodeSighting {
  double time;     ///< [s]
  int code;        ///< what the code says
  double range;    ///< [m]
  double bearing;  ///< [rad], to the left of straight ahead
};

/// How odometry differs from what the robot does: turns on the spot err by another factor than curves.
struct WheelErrors {
  double delay = 0;                       ///< [s] that the robot moves later than odometry says so
  double turn = 1, turn_on_the_spot = 1;  ///< what it turns where odometry says one

  bool operator==(const WheelErrors&) const = default;
};

/// By the codes that the robot sees twice: the delay to a hundredth of a second within 0.5 s and the turns to
/// a thousandth from 0.38 to 1.62, each by the least sum of errors in bearing with the others as they are,
/// until all stay. Sightings that follow one another tell the delay; of the turns they have too little, and
/// the jitter of their times makes these look smaller than they are: over a second it does not. Where too
/// little was seen of one, odometry is believed. Both lists are by time, all numbers finite. A few hundred
/// passes over the sightings, O(log(lines of odometry)) for each.
[[nodiscard]] WheelErrors wheel_errors(std::span<const WheelSpeeds> odometry,
                                       std::span<const CodeSighting> sightings);

}  // namespace fastslam
