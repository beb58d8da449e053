// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// A EuRoC sequence: the cameras' sensor.yaml and data.csv and the true poses are the fuzzer's.
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>

#include "fuzz/drive_checks.hpp"
#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  static const bool made = (cairn_fuzz::put_images(scratch, {"mav0/cam0/data/a", "mav0/cam1/data/a"}), true);
  static_cast<void>(made);
  const auto files = cairn_fuzz::files_of(cairn_fuzz::text_of(data, size), 5);
  scratch.put("mav0/cam0/sensor.yaml", files[0]);
  scratch.put("mav0/cam1/sensor.yaml", files[1]);
  scratch.put("mav0/cam0/data.csv", files[2]);
  scratch.put("mav0/cam1/data.csv", files[3]);
  scratch.put("mav0/state_groundtruth_estimate0/data.csv", files[4]);
  try {
    cairn_fuzz::check_drive(stereo_slam::read_euroc(scratch / "."));
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
