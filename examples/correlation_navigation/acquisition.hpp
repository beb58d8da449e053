// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How often does a correlation search find where a vehicle is, within two kilometres, and does it know?
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <cairn/field/correlation.hpp>
#include <cairn/field/grid.hpp>
#include <cairn/field/patch.hpp>

namespace correlation_navigation {

struct AcquisitionTrial {
  double truth_x = 0, truth_y = 0;  ///< of the last frame searched for [m]
  cairn::Fix fix;                   ///< of that frame
  double error = 0;                 ///< distance of the fix from the truth [m]
  std::size_t frames = 0;           ///< searched for, the accepted one included
};

struct AcquisitionResult {
  std::vector<AcquisitionTrial> trials;
  double rate = 0;          ///< share accepted and right
  double first_rate = 0;    ///< share accepted and right at the first frame
  double wrong_rate = 0;    ///< share accepted and wrong
  double right_within = 0;  ///< what counts as right [m]
  double rms_error = 0;     ///< of the right ones [m]
};

struct AcquisitionOptions {
  cairn::PatchShape shape{};
  std::size_t starts = 100;
  std::size_t frames = 5;       ///< to search for, one after the other, until one is accepted
  double uncertainty = 2000;    ///< half side of the square the start is known to lie in [m]
  double sensor_noise = 0.1;    ///< white, as a share of the field's standard deviation
  double heading_sigma = 0.01;  ///< [rad]
  double scale_sigma = 0.01;    ///< relative
  double reckoning = 0.02;      ///< error of dead reckoning along each axis, as a share of the way
  std::uint64_t seed = 1;
  unsigned threads = 1;
  std::function<void()>
      on_start{};  ///< called after each start, by any thread; what it throws ends the search
};

/// Random places, headings, gains and biases over the field. A frame that the search refuses is followed by
/// the next one ahead, where the ground may say more. A fix is right within one and a half samples.
[[nodiscard]] AcquisitionResult acquire(const cairn::FieldGrid& field, const AcquisitionOptions& options);

}  // namespace correlation_navigation
