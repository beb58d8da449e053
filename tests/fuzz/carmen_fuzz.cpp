// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// CARMEN logs: what is read is finite, and every beam says something.
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>
#include <cairn/io/carmen.hpp>

#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  try {
    cairn::CarmenLog log = cairn::read_carmen(scratch.put("a", cairn_fuzz::text_of(data, size)));
    cairn_fuzz::expect(!log.scans.empty(), "a log has scans");
    cairn::place_by_odometry(log, "a");
    for (const cairn::StampedScan& scan : log.scans) {
      cairn_fuzz::expect(std::isfinite(scan.time), "times are finite");
      cairn_fuzz::expect(std::isfinite(scan.T_odom_laser.x()) && std::isfinite(scan.T_odom_laser.angle()),
                         "poses are finite");
      for (const cairn::ScanPoint& p : cairn::scan_points(scan.scan))
        cairn_fuzz::expect(std::hypot(p.x, p.y) < 41, "hits are within reach");
    }
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
