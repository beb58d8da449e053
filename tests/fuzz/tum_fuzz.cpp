// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// TUM trajectories: what is read is a trajectory, and a written one reads back.
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
    const cairn::Trajectory read = cairn::read_tum(scratch.put("a", cairn_fuzz::text_of(data, size)));
    cairn_fuzz::check_trajectory(read);
    cairn::write_tum(scratch / "b", read);
    cairn_fuzz::check_same(read, cairn::read_tum(scratch / "b"), 0);
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
