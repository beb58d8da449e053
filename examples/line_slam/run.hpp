// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// One drive mapped three times: with the true poses, along odometry, and by particles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/slam/landmark_map.hpp>

#include "drive.hpp"
#include "line_sensor.hpp"

namespace line_slam {

struct RunOptions {
  std::size_t particles = 100;
  std::uint64_t seed = 1;
  unsigned threads = 1;
  double resample_below = 0.5;
  /// How often the best particle's path is led to the least squares of all that was seen along it, and mapped
  /// along anew: a particle never goes back, so that what a loop tells at its end bends nothing before.
  int smoothings = 2;
  /// Densities over the six distances: a line anywhere in a picture of 640 x 480 pixels is as likely as any
  /// other, at distances from a metre on; the third camera's two numbers are then known but for the noise.
  cairn::LandmarkOptions landmarks{.gate = 0.999, .new_density = 1e-10, .clutter_density = 1e-11};
};

/// A line of a map.
struct FoundLine {
  std::uint32_t number = 0;
  cairn::Gaussian<MappedLine> belief{};
  std::uint32_t sightings = 0;
};

/// A map and how far it is from the truth.
struct MadeMap {
  std::vector<cairn::SE3> path{};
  std::vector<FoundLine> lines{};  ///< seen often enough to be believed
  std::size_t tentative = 0;       ///< others
  std::size_t edges = 0;           ///< different true edges among the lines
  std::size_t of_nothing = 0;      ///< lines that began with segments of different edges
  double rms = 0;                  ///< distance of the lines' ends and middles from the true edges' lines [m]
  double path_rms = 0;             ///< [m]
};

struct StepRecord {
  double effective_size = 0;
  bool resampled = false;
  std::size_t sightings = 0, known = 0, lines = 0;  ///< of the frame; of those in the first particle's map
  cairn::Gaussian<cairn::SE3> pose{};
};

struct Results {
  RunOptions options{};
  DriveOptions drive{};
  MadeMap exact{}, odometry{}, slam{};
  std::vector<StepRecord> steps{};
  std::vector<std::vector<cairn::SE3>> paths{};  ///< of the particles that differ
  std::optional<std::string> ended_early{};
  double seconds = 0, cpu_seconds = 0;
};

/// `on_frame` is called after every frame; what it returns, if anything, ends the run and says why.
[[nodiscard]] Results run(const Drive& drive, const RunOptions& options,
                          const std::function<std::optional<std::string>()>& on_frame = {});

}  // namespace line_slam
