// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Places by satellites beside a graph: the fixes, and the wheels that give them their place on the way.
#include <cstddef>
#include <cstdint>
#include <filesystem>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>

#include "fuzz/landmark_checks.hpp"
#include "fuzz/scratch.hpp"
#include "support/matlab_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  static const std::filesystem::path wheels =
      scratch.put("wheels", cairn_test::matlab_file({{"time", {0, 10, 20}}, {"speed", {1, 2, 0}}}));
  static const std::filesystem::path fixes = scratch.put(
      "fixes", cairn_test::matlab_file({{"timeGps", {-1, 5, 30}}, {"Lo_m", {0, 1, 2}}, {"La_m", {3, 4, 5}}}));
  const std::filesystem::path given = scratch.put("given", cairn_fuzz::text_of(data, size));
  int read = 0;
  for (const bool is_wheels : {false, true}) {
    fastslam::LandmarkLog log;
    for (int k = 1; k <= 3; ++k)
      log.frames.push_back({1.0 * k, {cairn::SE2(1, 0, 0), cairn::Matrix<3>::Zero()}, {}});
    try {
      fastslam::read_gps(log, is_wheels ? fixes : given, is_wheels ? given : wheels);
    } catch (const cairn::Error&) {
      continue;
    }
    ++read;
    for (const fastslam::GpsFix& fix : log.gps) {
      cairn_fuzz::expect(fix.place.allFinite(), "places are finite");
      cairn_fuzz::expect(fix.time >= 1 && fix.time <= 3, "a fix belongs to a pose of the log");
    }
  }
  return read > 0 ? 0 : cairn_fuzz::refused();
}
