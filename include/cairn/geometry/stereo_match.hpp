// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a stereo pose is estimated from: landmarks of a map and where both cameras see them.
#pragma once

#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A landmark of the map seen by both cameras of a rig.
struct StereoMatch {
  Vector<3> landmark = Vector<3>::Zero();    ///< world frame [m]
  Matrix<3> covariance = Matrix<3>::Zero();  ///< of the landmark [m^2]; zero where known exactly
  Vector<2> left = Vector<2>::Zero();        ///< observed pixels
  Vector<2> right = Vector<2>::Zero();
  double sigma_left = 0.5, sigma_right = 0.5;  ///< pixel noise in each coordinate [pixels]
};

}}  // namespace cairn::CAIRN_ABI
