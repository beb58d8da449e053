// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the satellite receiver of a KITTI raw drive says of its height in two ways: by its altitude, and by
/// its upward velocity. Where they part, the altitude has slipped: satellites came and went.
#pragma once

#include <filesystem>
#include <vector>

namespace stereo_slam_bench {

class ReceiverHeights {
public:
  /// Reads oxts/data of a drive: files named by hundredths of a second, of which some may be missing. Empty
  /// where there is no such folder or a file has less than 30 numbers.
  explicit ReceiverHeights(const std::filesystem::path& drive);
  [[nodiscard]] bool empty() const noexcept { return seconds_.empty(); }
  /// Altitude less the integral of the upward velocity since the first file [m], between files by a straight
  /// line.
  [[nodiscard]] double slip(double seconds) const;

private:
  std::vector<double> seconds_, slips_;
};

}  // namespace stereo_slam_bench
