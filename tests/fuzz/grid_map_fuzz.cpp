// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Saved maps of grid_slam, the file's head and checksum made to fit: what is loaded is saved as the same
// bytes, has a path, and goes on with the next scan or says why it cannot.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>

#include "fuzz/scratch.hpp"
#include "mapper.hpp"
#include "support/made_up_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  const auto path =
      scratch.put("map", cairn_test::file_holding(cairn_fuzz::text_of(data, size), "cairngrd", 6));
  try {
    grid_slam::Mapper mapper = grid_slam::Mapper::loaded(path);
    mapper.save(scratch / "again");
    const std::string once = cairn::read_file(scratch / "again");
    grid_slam::Mapper::loaded(scratch / "again").save(scratch / "twice");
    cairn_fuzz::expect(once == cairn::read_file(scratch / "twice"), "a map that was loaded can be saved");
    const auto poses = mapper.trajectory(true);
    cairn_fuzz::expect(poses.size() == mapper.scans().size(), "every scan has a pose");
    for (const auto& pose : poses)
      cairn_fuzz::expect(!std::isnan(pose.pose.x() + pose.pose.angle()), "poses are numbers");
    cairn::StampedScan next = mapper.scans().back();
    if (next.scan.size() > 50 || mapper.options().particles > 4) return 0;
    next.T_odom_laser = next.T_odom_laser * cairn::SE2(0.5, 0, 0);
    mapper.add(next);
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
