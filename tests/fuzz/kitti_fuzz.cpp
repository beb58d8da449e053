// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// KITTI pose files with their times: what is read is a trajectory, and a written one reads back.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>
#include <cairn/io/trajectory.hpp>

#include "fuzz/scratch.hpp"
#include "fuzz/trajectory_checks.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  try {
    const auto files = cairn_fuzz::files_of(cairn_fuzz::text_of(data, size), 2);
    const auto poses = scratch.put("poses", files[0]), times = scratch.put("times", files[1]);
    const cairn::Trajectory read = cairn::read_kitti(poses);
    cairn_fuzz::check_trajectory(read);
    cairn_fuzz::expect(cairn::read_kitti_rows(poses).size() == read.size(), "as many rows as poses");
    cairn::write_kitti(scratch / "b", read);
    cairn_fuzz::check_same(read, cairn::read_kitti(scratch / "b"), 0);
    cairn_fuzz::check_trajectory(cairn::read_kitti(poses, times));
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
