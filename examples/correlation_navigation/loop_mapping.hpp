// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The document's conclusion: map an unknown field along a loop with an imperfect sensor, return to the
/// start, correct.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <cairn/field/grid.hpp>
#include <cairn/field/patch.hpp>

namespace correlation_navigation {

struct LoopFlight {
  cairn::PatchShape shape{};
  double velocity = 150;         ///< [m/s]
  double interval = 2;           ///< between frames [s]
  double radius = 3500;          ///< of the circle that is flown [m]
  double drift_sigma = 1.0;      ///< of dead reckoning's velocity [m/s]
  double drift_density = 2e-4;   ///< of the noise that changes it [m^2/s^3]
  double sensor_noise = 0.1;     ///< white, as a share of the field's standard deviation
  std::size_t start_frames = 6;  ///< the first frames, which the return is matched with
  std::uint64_t seed = 1;
  std::function<void()> on_frame{};  ///< called after each frame; what it throws ends the flight
};

/// How many frames the circle has, and some beyond it.
[[nodiscard]] std::size_t frames_of(const LoopFlight& flight);

/// One frame of the loop: where it was, where dead reckoning put it, where the correction puts it.
struct LoopFrame {
  double time = 0, truth_x = 0, truth_y = 0, before_x = 0, before_y = 0, after_x = 0, after_y = 0;
  double sigma_before = 0, sigma_after = 0;  ///< root of the summed variances of x and y [m]
};

struct LoopResult {
  bool closed = false;  ///< the return was recognised
  std::vector<LoopFrame> frames;
  double placement_rms_before = 0, placement_rms_after = 0;  ///< distance of frames from the truth [m]
  double map_rms_before = 0, map_rms_after = 0;  ///< map against field over the nodes mapped, in its unit
  double field_deviation = 0;                    ///< of the field over them: what an empty map would err
  /// Map less field, on the field's grid; void where nothing was mapped.
  std::optional<cairn::FieldGrid> map_error_before, map_error_after;
  double closing_error = 0;  ///< of the fix that closed the loop [m]
};

/// Throws cairn::Error when the field is too small for the loop.
[[nodiscard]] LoopResult fly_loop(const cairn::FieldGrid& field, const LoopFlight& flight);

}  // namespace correlation_navigation
