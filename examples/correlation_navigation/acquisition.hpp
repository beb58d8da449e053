// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How often does a correlation search find where a vehicle is, within two kilometres, and does it know?
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/field/correlation.hpp>
#include <cairn/field/grid.hpp>
#include <cairn/field/patch.hpp>

namespace correlation_navigation {

struct AcquisitionTrial {
  double truth_x = 0, truth_y = 0;  ///< [m]
  cairn::Fix fix;
  double error = 0;  ///< distance of the fix from the truth [m]
};

struct AcquisitionResult {
  std::vector<AcquisitionTrial> trials;
  double rate = 0;          ///< share accepted and right
  double wrong_rate = 0;    ///< share accepted and wrong
  double right_within = 0;  ///< what counts as right [m]
  double rms_error = 0;     ///< of the right ones [m]
};

struct AcquisitionOptions {
  cairn::PatchShape shape{};
  std::size_t starts = 100;
  double uncertainty = 2000;    ///< half side of the square the start is known to lie in [m]
  double sensor_noise = 0.1;    ///< white, as a share of the field's standard deviation
  double heading_sigma = 0.01;  ///< [rad]
  double scale_sigma = 0.01;    ///< relative
  std::uint64_t seed = 1;
  unsigned threads = 1;
};

/// Random places, headings, gains and biases over the field. A fix is right within one and a half samples.
[[nodiscard]] AcquisitionResult acquire(const cairn::FieldGrid& field, const AcquisitionOptions& options);

}  // namespace correlation_navigation
