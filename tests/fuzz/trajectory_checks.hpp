// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What holds for a trajectory that any reader returned, and for the file that a writer makes of it.
#pragma once

#include <cmath>
#include <cstddef>
#include <filesystem>

#include <cairn/io/trajectory.hpp>

#include "fuzz/scratch.hpp"

namespace cairn_fuzz {

/// Finite poses in the order of time.
inline void check_trajectory(const cairn::Trajectory& trajectory) {
  expect(!trajectory.empty(), "a trajectory has poses");
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const cairn::SE3& pose = trajectory[i].T_world_body;
    expect(std::isfinite(trajectory[i].time) && pose.matrix().allFinite(), "numbers are finite");
    expect(i == 0 || trajectory[i].time >= trajectory[i - 1].time, "times do not run backwards");
    const cairn::Matrix<3> R = pose.rotation().matrix();
    expect((R.transpose() * R - cairn::Matrix<3>::Identity()).norm() < 1e-12, "rotations are rotations");
  }
}

/// The same poses, times but for `seconds`, rotations but for rounding.
inline void check_same(const cairn::Trajectory& a, const cairn::Trajectory& b, double seconds) {
  expect(a.size() == b.size(), "as many poses come back");
  for (std::size_t i = 0; i < a.size(); ++i) {
    expect(std::abs(a[i].time - b[i].time) <= seconds, "times come back");
    expect(a[i].T_world_body.translation() == b[i].T_world_body.translation(), "positions come back");
    expect((a[i].T_world_body.rotation().matrix() - b[i].T_world_body.rotation().matrix()).norm() < 1e-13,
           "rotations come back");
  }
}

}  // namespace cairn_fuzz
