// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How far lines that are mapped along the true path are from the true edges, in sigmas.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/random.hpp>
#include <cairn/geometry/line.hpp>

#include "line_slam/drive.hpp"
#include "line_slam/run.hpp"

namespace cairn_test {

/// Squared error of a line over its covariance; nothing where the true one is not before the line's anchor.
inline std::optional<double> nees(const cairn::Gaussian<line_slam::MappedLine>& belief,
                                  const line_slam::Edge& edge) {
  const auto truth = belief.mean.line.about(cairn::Line::through(edge.from, edge.to));
  if (!truth) return std::nullopt;
  const cairn::Cholesky<4> root(belief.covariance);
  if (!root.good()) cairn::raise("a mapped line has a covariance that is none");
  return root.whiten(cairn::local(belief.mean.line, *truth)).squaredNorm();
}

struct LineNees {
  std::size_t lines = 0;
  double sum = 0;
  [[nodiscard]] double mean() const { return sum / static_cast<double>(lines); }
};
/// Of at least so many lines, campus after campus of this seed.
inline LineNees nees_of_lines(std::uint64_t seed, std::size_t least) {
  LineNees result;
  for (std::uint64_t campus = 0; result.lines < least; ++campus) {
    line_slam::DriveOptions options{.seed = seed * 100 + campus, .metres = 120};
    options.detector.made_up = 0;
    options.detector.broken = 0;  // pieces that are joined again err less than a segment, as they should
    const line_slam::Drive drive = line_slam::simulated_drive(options);
    line_slam::LineSensor sensor;
    sensor.rig = std::make_shared<const line_slam::Rig>(drive.rig);
    sensor.sigma = options.detector.sigma;
    cairn::LandmarkOptions landmarks = line_slam::RunOptions{}.landmarks;
    landmarks.gate_of_named = landmarks.gate;  // as the program, which knows no names
    line_slam::Map map(sensor, landmarks);
    for (std::size_t k = 0; k < drive.frames.size(); ++k) {
      line_slam::Map::Observation seen;
      for (const auto& sighting : drive.frames[k].seen)  // as many as are told apart without doubt
        if (sighting.z.edge != line_slam::no_edge) seen.push_back({sighting.z, sighting.z.edge});
      cairn::Random none(1);
      map.insert(drive.truth[k], seen, map.choose(drive.truth[k], seen, none).choice);
    }
    map.for_each([&](std::uint32_t edge, const cairn::MappedLandmark<line_slam::MappedLine>& landmark) {
      if (landmark.sightings < 2) return;  // what one sighting says is in tests/geometry
      if (const auto e = nees(landmark.belief, drive.campus.edges()[edge])) {
        result.sum += *e;
        ++result.lines;
      }
    });
  }
  return result;
}

}  // namespace cairn_test
