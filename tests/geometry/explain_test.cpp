// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include <cairn/geometry/alignment.hpp>
#include <cairn/geometry/motion_calibration.hpp>
#include <cairn/geometry/robust_alignment.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/triangulation.hpp>

#include "support/explained.hpp"

namespace explain_test {
namespace {

TEST_CASE("every status has a sentence of its own") {
  CHECK(cairn_test::sentences<cairn::StereoPoseStatus>() ==
        static_cast<int>(cairn::StereoPoseStatus::degenerate) + 1);
  CHECK(cairn_test::sentences<cairn::AlignmentStatus>() ==
        static_cast<int>(cairn::AlignmentStatus::mirrored) + 1);
  CHECK(cairn_test::sentences<cairn::MotionCalibrationStatus>() ==
        static_cast<int>(cairn::MotionCalibrationStatus::degenerate) + 1);
  CHECK(cairn_test::sentences<cairn::TriangulationStatus>() ==
        static_cast<int>(cairn::TriangulationStatus::gap_too_large) + 1);
  CHECK(cairn_test::sentences<cairn::RobustAlignmentStatus>() ==
        static_cast<int>(cairn::RobustAlignmentStatus::degenerate) + 1);
}

}  // namespace
}  // namespace explain_test
