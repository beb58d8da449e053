// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// A KITTI raw drive of three frames: the calibration, the time stamps and the true poses are the fuzzer's.
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>

#include "fuzz/drive_checks.hpp"
#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  static const bool made =
      (cairn_fuzz::put_images(scratch, {"image_00/data/0.pgm", "image_00/data/1.pgm", "image_00/data/4.pgm",
                                        "image_01/data/0.pgm", "image_01/data/1.pgm", "image_01/data/4.pgm"}),
       true);
  static_cast<void>(made);
  const auto files = cairn_fuzz::files_of(cairn_fuzz::text_of(data, size), 3);
  scratch.put("calib_cam_to_cam.txt", files[0]);
  scratch.put("image_00/timestamps.txt", files[1]);
  scratch.put("poses_cam0_rectified.txt", files[2]);
  try {
    cairn_fuzz::check_drive(stereo_slam::read_kitti_raw(scratch / "."));
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
