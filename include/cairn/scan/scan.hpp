// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A planar laser scan: a fan of ranges, what each of them says, and the points they end in.
///
/// Beam i leaves the origin at first_angle + i * angle_step, anticlockwise from the scanner's x axis. A range
/// is a hit, or says that nothing came back, or says nothing at all.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What a range says.
enum class BeamKind : std::uint8_t {
  hit,        ///< the beam ended at a surface
  no_return,  ///< as far as the scanner sees nothing sent it back: free space, glass or black
  invalid,    ///< too near to be measured, or no number: nothing is known of this beam
};

/// Ranges [m] of one turn of the mirror, in the scanner's frame.
struct LaserScan {
  double first_angle = 0;      ///< [rad]
  double angle_step = 0;       ///< [rad]
  double nearest = 0.05;       ///< [m]; a shorter range is invalid
  double farthest = 40;        ///< [m]; a range from here on is no return
  std::vector<float> range{};  ///< [m]; anything, also NaN

  [[nodiscard]] std::size_t size() const noexcept { return range.size(); }
  [[nodiscard]] double angle(std::size_t beam) const noexcept {
    return first_angle + static_cast<double>(beam) * angle_step;
  }
  [[nodiscard]] BeamKind kind(std::size_t beam) const noexcept {
    const auto r = static_cast<double>(range[beam]);
    if (!(r >= nearest)) return BeamKind::invalid;
    return r < farthest ? BeamKind::hit : BeamKind::no_return;
  }
};

/// A point of a scan in the scanner's frame [m].
struct ScanPoint {
  double x = 0;
  double y = 0;
};

/// End points of the hits, in the order of the beams. Throws Error where the angles are not finite.
[[nodiscard]] inline std::vector<ScanPoint> scan_points(const LaserScan& scan) {
  if (!std::isfinite(scan.first_angle) || !std::isfinite(scan.angle_step))
    raise("scan_points: expected angles that are finite");
  std::vector<ScanPoint> points;
  points.reserve(scan.size());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (scan.kind(i) != BeamKind::hit) continue;
    const auto r = static_cast<double>(scan.range[i]);
    points.push_back({r * std::cos(scan.angle(i)), r * std::sin(scan.angle(i))});
  }
  return points;
}

/// The points less those closer than `spacing` [m] to the last one kept: near walls fill a scan with points
/// that all say the same. All of them for a spacing of 0.
[[nodiscard]] inline std::vector<ScanPoint> thinned(const std::vector<ScanPoint>& points, double spacing) {
  CAIRN_EXPECTS(spacing >= 0, "thinned needs a spacing that is not negative");
  std::vector<ScanPoint> kept;
  for (const ScanPoint& p : points)
    if (kept.empty() || std::hypot(p.x - kept.back().x, p.y - kept.back().y) >= spacing) kept.push_back(p);
  return kept;
}

}}  // namespace cairn::CAIRN_ABI
