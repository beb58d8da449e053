// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// A KITTI odometry sequence of three frames: calib.txt, times.txt and poses.txt are the fuzzer's.
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>

#include "fuzz/drive_checks.hpp"
#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  static const bool made =
      (cairn_fuzz::put_images(scratch, {"image_0/0.pgm", "image_0/1.pgm", "image_0/2.pgm", "image_1/0.pgm",
                                        "image_1/1.pgm", "image_1/2.pgm"}),
       true);
  static_cast<void>(made);
  const auto files = cairn_fuzz::files_of(cairn_fuzz::text_of(data, size), 3);
  scratch.put("calib.txt", files[0]);
  scratch.put("times.txt", files[1]);
  scratch.put("poses.txt", files[2]);
  try {
    cairn_fuzz::check_drive(stereo_slam::read_kitti_odometry(scratch / "."));
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
