// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// A robot of the UTIAS set: its three files, the bar codes and the landmarks are the fuzzer's.
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>

#include "fuzz/landmark_checks.hpp"
#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  const auto files = cairn_fuzz::files_of(cairn_fuzz::text_of(data, size), 5);
  scratch.put("Robot1_Odometry.dat", files[0]);
  scratch.put("Robot1_Measurement.dat", files[1]);
  scratch.put("Barcodes.dat", files[2]);
  scratch.put("Landmark_Groundtruth.dat", files[3]);
  scratch.put("Robot1_Groundtruth.dat", files[4]);
  try {
    cairn_fuzz::check_landmark_log(fastslam::read_mrclam(scratch / ".", 1));
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
