// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What grid_slam leaves in its folder: map.pgm and map.yaml (ROS map_server's; neither where the map is too
/// large for a picture), trajectory.txt (TUM), summary.json, report.html, timing.json. All but the last are
/// the same bytes for the same log, options and seed, whatever the number of threads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <cairn/eval/relations.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/scan/occupancy_grid.hpp>

#include "ancestors.hpp"
#include "map_image.hpp"
#include "mapper.hpp"

namespace grid_slam {

/// Of all cells that are known, with a margin of one; one unknown pixel where none is.
[[nodiscard]] MapImage map_image(const cairn::OccupancyGrid& grid);

/// Bytes of the particles' maps, what they share counted once.
[[nodiscard]] std::size_t map_bytes(const Mapper::Belief& belief);

/// How things stood after some scan: a frame of the report's film.
struct Snapshot {
  std::size_t scans = 0, processed = 0, loops = 0;  ///< so far
  double effective_size = 0;
  cairn::Matrix<3> newest = cairn::Matrix<3>::Zero();  ///< covariance of the newest pose
  PackedMap map;                                       ///< of the best particle
  std::vector<std::array<cairn::SE2, 2>> paths{};      ///< steps of all particles' paths, each once
  std::vector<cairn::SE2> best{};                      ///< the best particle's path
  std::size_t bytes = 0;                               ///< as map_bytes()
  std::size_t separate_bytes = 0;                      ///< if no particle shared anything
  std::size_t tile_bytes = 0;         ///< of a tree of ancestors: if they were shared tiles instead
  std::vector<Ancestor> ancestors{};  ///< of a tree of ancestors
};
/// Puts in all particles' paths and the best one's.
template <class Map>
void put_paths(Snapshot& s, const cairn::MappedPaths<Map>& belief) {
  const auto record = belief.record();
  s.paths.reserve(record.nodes.size());
  for (const auto& [pose, parent] : record.nodes)
    if (parent < record.nodes.size()) s.paths.push_back({record.nodes[parent].pose.pose, pose.pose});
  for (const auto& pose : belief.path(belief.best())) s.best.push_back(pose.pose);
}
[[nodiscard]] Snapshot snapshot_of(const Mapper& mapper);

struct Results {
  std::string name;  ///< of the log
  std::uint64_t seed = 0;
  std::size_t particles = 0, scans = 0;
  std::vector<StepRecord> steps;
  std::vector<Loop> loops;
  std::vector<PossiblePlace> places;  ///< where a localiser may have begun, the one taken first
  std::vector<cairn::StampedPose2> odometry, drawn, means, rematched;
  std::vector<cairn::Gaussian<cairn::SE2>>
      drawn_from;              ///< by the best particle's path, a processed scan each
  bool drawn_by_scans = true;  ///< those know of the scan, not of odometry alone
  std::optional<cairn::RelationError> of_odometry, of_drawn, of_means, of_rematched;
  cairn::Gaussian<cairn::SE2> newest;
  bool newest_has_path = true;  ///< its covariance has what the path gathered, not the particles' alone
  double delay = 0, delay_spread = 0;  ///< of scans behind odometry [scans]
  MapImage map;
  std::size_t bytes = 0;
  std::vector<std::vector<cairn::SE2>> paths;  ///< of all particles
  std::vector<Snapshot> snapshots;             ///< in their order, if any were asked for
  std::optional<std::string> ended_early;
  bool data_ended = false;         ///< by the log, not from outside
  std::vector<std::string> notes;  ///< what the reader should know of these results
  unsigned threads = 1;
  double seconds = 0, cpu_seconds = 0;
};

/// Puts the errors by relations in, where there are any, and a note where the path lacks times of theirs.
void measure(Results& results, const std::vector<cairn::PoseRelation>& relations);

[[nodiscard]] std::string summary(const Results& results);
[[nodiscard]] std::optional<std::string> report(const Results& results);

/// Makes the folder where it is missing and checks that a file can be written, and `besides`, if they have
/// names, beside the results. Throws cairn::Error.
void prepare_folder(const std::filesystem::path& folder,
                    const std::vector<std::filesystem::path>& besides = {});

/// Writes all files or, throwing cairn::Error, none. Returns why there is no report, where there is none.
[[nodiscard]] std::optional<std::string> write_outputs(const Results& results,
                                                       const std::filesystem::path& folder);

}  // namespace grid_slam
