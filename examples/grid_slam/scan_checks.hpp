// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a log says of its scanner without saying it, and whether its scans can be what they are taken for.
#pragma once

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

/// Whether scans turn against odometry, of all turns almost on the spot that are long enough to tell: the
/// beams run clockwise, or odometry counts its headings so. O(turns x beams).
[[nodiscard]] bool turns_against_odometry(const std::vector<cairn::StampedScan>& scans);

/// Takes what stands for no return as that, and returns what a reader of the results should know. Throws
/// cairn::Error, beginning with `name`, where scans turn against odometry: no map comes of them.
[[nodiscard]] std::vector<std::string> check_scans(cairn::CarmenLog& log, const std::string& name);

}  // namespace grid_slam
