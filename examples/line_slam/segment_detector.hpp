// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Segments found in pictures: OpenCV's line segment detector (R. Grompone von Gioi, J. Jakubowicz, J.-M.
/// Morel, G. Randall, "LSD: a fast line segment detector with a false detection control", PAMI 32, 2010).
#pragma once

#include <vector>

#include <cairn/geometry/line_triangulation.hpp>
#include <cairn/vision/image.hpp>

namespace line_slam {

/// Whether this program was built with OpenCV, which has the detector.
[[nodiscard]] bool has_segment_detector() noexcept;

/// Segments of at least `shortest` pixels, in coordinates whose whole numbers are the middles of pixels.
/// Throws cairn::Error where there is no detector.
[[nodiscard]] std::vector<cairn::LineSegment> segments_of(cairn::ImageView image, double shortest);

}  // namespace line_slam
