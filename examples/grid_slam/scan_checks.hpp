// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a log says of its scanner without saying it, and whether its scans can be what they are taken for.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <cairn/io/carmen.hpp>

namespace grid_slam {

/// The reading that stands for no return: the largest of the log [m], where it is met again and again while
/// the robot drives. FLASER lines have no place for it, and many scanners report their largest range where
/// nothing comes back; taken for walls, those beams are an arc that travels with the robot. Readings from the
/// scans' own `farthest` on are no return already. O(beams).
[[nodiscard]] std::optional<double> reading_of_no_return(const std::vector<cairn::StampedScan>& scans);

/// How scans turn, next to odometry: of all turns almost on the spot that are long enough to tell.
enum class ScanTurns {
  as_said,    ///< by as much, or nothing tells
  against,    ///< the other way: the beams run clockwise, or odometry counts its headings so
  not_at_all  ///< odometry's headings are no radians
};
/// O(turns x beams).
[[nodiscard]] ScanTurns scan_turns(const std::vector<cairn::StampedScan>& scans);

/// The field of view [rad] of scans that are taken to see half a turn, where another one of those in use
/// (240, 270, 360 degrees) makes them turn as odometry does: FLASER lines do not say it. O(turns x beams).
[[nodiscard]] std::optional<double> other_field_of_view(const std::vector<cairn::StampedScan>& scans);

/// Of each scan the beams whose reading nothing confirms, neither a beam beside it nor a scan just before or
/// after: dust, rain, a sensor's errors. A reading counts as confirmed where nothing could have done so: in
/// quick turns, and where all other scans near by are copies of its own. O(beams).
[[nodiscard]] std::vector<std::vector<std::size_t>> unconfirmed(const std::vector<cairn::StampedScan>& scans);

/// Takes what stands for no return as that, beams by the field of view that fits, and readings that nothing
/// confirms for none where there are many; returns what a reader of the results should know. Throws
/// cairn::Error, beginning with `name`, where scans do not turn as odometry does: no map comes of them.
[[nodiscard]] std::vector<std::string> check_scans(cairn::CarmenLog& log, const std::string& name);

}  // namespace grid_slam
