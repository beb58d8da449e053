// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Segments as a detector reports them in the pictures of three cameras, and which of them are of one line.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/geometry/line_triangulation.hpp>
#include <cairn/manifold/se3.hpp>

#include "campus.hpp"

namespace line_slam {

inline constexpr std::size_t cameras = 3;
/// One in the middle, one to the left of it, one above: any two are blind to lines along their baseline. The
/// rig's frame is the first camera's.
using Rig = std::array<cairn::LineCamera, cameras>;
[[nodiscard]] Rig three_cameras(double baseline = 0.6);

/// No edge: what the detector made up. Which edge a segment is of is known to the one who renders it, and
/// used to judge the result only.
inline constexpr std::uint32_t no_edge = 0xffffffffU;

struct Detected {
  cairn::LineSegment segment{};
  std::uint32_t edge = no_edge;
};
using Detections = std::array<std::vector<Detected>, cameras>;

/// How the detector errs. Lengths in pixels.
struct DetectorOptions {
  double sigma = 0.5;     ///< of a segment's ends, both ways
  double shortest = 20;   ///< what is shorter is not found
  double farthest = 30;   ///< [m]
  double missed = 0.2;    ///< share of what is in view
  double made_up = 0.1;   ///< segments of nothing, over those of something
  double broken = 0.3;    ///< share of lines that break, into two or three pieces
  double widest_gap = 6;  ///< between the pieces
};

enum class DetectorKind {
  noise,  ///< the edges in view, with the errors that DetectorOptions say
  lsd     ///< what OpenCV's detector finds in the rendered pictures
};

/// The edges in view: clipped by the picture, hidden parts left out, broken, missed, and some made up.
[[nodiscard]] Detections detect(const Campus& campus, const Rig& rig, const cairn::SE3& pose,
                                const DetectorOptions& options, cairn::Random& random);

/// What the detector finds in the three pictures that are rendered from here. A segment is of the edge in
/// view that it lies along, to two pixels: to judge the result only. Throws cairn::Error where there is no
/// detector.
[[nodiscard]] Detections detect_in_pictures(const Campus& campus, const Rig& rig, const cairn::SE3& pose,
                                            const DetectorOptions& options);

/// A line that all three cameras saw.
struct LineSighting {
  std::array<cairn::LineSegment, cameras> seen{};
  cairn::TriangulatedLine line{};  ///< rig's frame
  /// Standard deviations of its direction in depth [rad] and of its distance [m] by the segments' length and
  /// place, whatever the line came out as: a short one far away may come out so steep that it seems sure.
  double tilt = 0, depth = 0;
  std::uint32_t edge = no_edge;  ///< where all three segments are of the same
};

struct MatchingOptions {
  double sigma = 0.5;                 ///< of a segment's ends across it [pixels]
  double nearest = 1, farthest = 30;  ///< [m]
  double overlap = 0.8;    ///< least share that two cameras both saw of what either saw of the line
  double of_overlap = 20;  ///< what the rest of that share costs, in units of the residual's chi^2
  double doubt = 4;        ///< two matches that share a segment must differ by so much, else none is taken
  double gate = 0.99;      ///< share of true matches whose residual is inside
};

/// Joins pieces of one line in one picture.
[[nodiscard]] std::vector<Detected> joined(std::vector<Detected> segments, double sigma);

/// Sightings by geometry alone: planes of the three segments that meet in one line, seen along the same part
/// of it. Each segment is used once, the best matches first.
[[nodiscard]] std::vector<LineSighting> match(const Rig& rig, const Detections& detections,
                                              const MatchingOptions& options);

}  // namespace line_slam
