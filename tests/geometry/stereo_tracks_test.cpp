// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/stereo_tracks.hpp"

#include <doctest/doctest.h>

#include "support/data.hpp"

TEST_SUITE("stereo_tracks") {
  TEST_CASE(
      "estimate_stereo_pose: KITTI 00 from frame to frame and against fused landmarks, as published or "
      "better") {
    const auto folder = cairn_test::real_data("stereo_tracks_kitti00");
    if (!folder || !cairn_test::real_data("trajectories")) return;
    const cairn_test::StereoTracks tracks = cairn_test::read_stereo_tracks(folder->parent_path());
    const cairn_test::TrackError steps = cairn_test::run_stereo_tracks(tracks, false);
    CHECK(steps.lost == 0);
    CHECK(steps.metres < 0.0125);
    CHECK(steps.degrees < 0.035);
    CHECK(steps.end_metres < 0.6);
    const cairn_test::TrackError map = cairn_test::run_stereo_tracks(tracks, true);
    CHECK(map.lost == 0);
    CHECK(map.metres < 0.0110);
    CHECK(map.metres < steps.metres);
    CHECK(map.end_metres < 0.5);
  }
}
