// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What holds for a recorded drive that any reader returned, and the images that drives are made with.
#pragma once

#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/vision/image.hpp>

#include "fuzz/scratch.hpp"
#include "recording.hpp"

namespace cairn_fuzz {

/// Makes the images `names`, 12 x 8 pixels each.
inline void put_images(const Scratch& scratch, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    scratch.put(name, "");  // its folder
    cairn::write_pgm(scratch / name, cairn::Image(12, 8, 100));
  }
}

/// Finite calibration, frames in the order of time, each with its images.
inline void check_drive(stereo_slam::Recording recording) {
  expect(!recording.frames.empty(), "a drive has frames");
  expect(recording.rig.T_left_right.matrix().allFinite() && recording.rig.left.fx() > 0 &&
             recording.rig.right.fy() > 0,
         "the rig is finite");
  double before = -INFINITY;
  for (const stereo_slam::RecordedFrame& frame : recording.frames) {
    expect(std::isfinite(frame.time) && frame.time >= before, "times are finite and do not run backwards");
    before = frame.time;
    expect(!frame.truth || frame.truth->matrix().allFinite(), "true poses are finite");
  }
  const auto dataset = stereo_slam::play(std::move(recording), 2);
  for (std::size_t i = 0; i < dataset->size(); ++i) {
    const stereo_slam::StereoFrame frame = dataset->frame(i);
    expect(frame.left.width() == dataset->rig().left.width(), "images have the size of their camera");
  }
}

}  // namespace cairn_fuzz
