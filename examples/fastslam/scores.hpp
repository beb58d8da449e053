// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How far a path and a map are from the truth.
#pragma once

#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/eval/relations.hpp>
#include <cairn/manifold/se2.hpp>

#include "landmark_log.hpp"
#include "slam.hpp"

namespace fastslam {

/// The motion that brings points nearest to others, in the sense of least squares.
[[nodiscard]] cairn::SE2 rigid_fit(const std::vector<cairn::Vector<2>>& from,
                                   const std::vector<cairn::Vector<2>>& to);
/// Root mean square distance of the moved points from the others.
[[nodiscard]] double rms(const std::vector<cairn::Vector<2>>& from, const std::vector<cairn::Vector<2>>& to,
                         const cairn::SE2& by);
[[nodiscard]] std::vector<cairn::Vector<2>> places_of(const std::vector<cairn::StampedPose2>& path);
/// The pose at a time, or nothing before the first; the truth is sampled far more often than it moves.
[[nodiscard]] const cairn::StampedPose2* last_until(const std::vector<cairn::StampedPose2>& path,
                                                    double time);

/// Fills in truth, gps and the errors of a run over this log, as far as the log knows the truth.
void measure(Results& results, const LandmarkLog& log);

}  // namespace fastslam
