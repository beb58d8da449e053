// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a robot did and saw of landmarks, from a published set or simulated; and the truth, where it is
/// known.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/eval/relations.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se2.hpp>

#include "point_sensor.hpp"

namespace fastslam {

/// A moment at which something was seen.
struct Frame {
  double time = 0;                      ///< [s]
  cairn::Gaussian<cairn::SE2> moved{};  ///< since the frame before, by odometry, as seen from there
  Map::Observation seen{};

  /// Of the pose, from that of the frame before.
  [[nodiscard]] cairn::Gaussian<cairn::SE2> motion_from(const cairn::SE2& before) const {
    return {before * moved.mean, moved.covariance};
  }
};

/// A pose that odometry gives between two frames.
struct Between {
  double time = 0;
  std::size_t frame = 0;  ///< the one before
  cairn::SE2 moved{};     ///< since then
};

/// A place by satellites, in a frame of its own: east and north [m].
struct GpsFix {
  double time = 0;  ///< of the log: of the frame or pose at which the robot was there
  cairn::Vector<2> place{};
};

struct LandmarkLog {
  std::string name{};
  PointSensor sensor{};
  std::vector<Frame> frames{};
  std::vector<Between> between{};
  std::vector<cairn::StampedPose2> truth{};               ///< by growing times; none where it is not known
  std::map<std::uint32_t, cairn::Vector<2>> landmarks{};  ///< true ones by identity
  std::optional<cairn::SE2> start{};  ///< true pose before the first frame, where it is known
  std::vector<std::string> notes{};   ///< what was left out
  std::vector<GpsFix> gps{};          ///< for a picture: nothing is estimated from it

  /// Ends after so many frames, if there are more.
  void keep_first(std::size_t count) {
    if (frames.size() <= count) return;
    frames.resize(count);
    std::erase_if(between, [&](const Between& pose) { return pose.frame + 1 >= count; });
  }

  /// Whether any sighting of the first frames says which landmark it is of.
  [[nodiscard]] bool has_identities(std::size_t first) const {
    return std::any_of(frames.begin(), frames.begin() + static_cast<std::ptrdiff_t>(first),
                       [](const Frame& f) {
                         return std::ranges::any_of(
                             f.seen, [](const auto& sighting) { return sighting.identity.has_value(); });
                       });
  }

  /// Forgets which landmarks were seen.
  void withhold_identities() {
    for (Frame& frame : frames)
      for (auto& sighting : frame.seen) sighting.identity.reset();
  }
};

/// One robot of a folder of the UTIAS set (K. Leung et al., IJRR 30, 2011). Other robots and unknown bar
/// codes that it saw are left out. How long after odometry the robot moves is found by the bar codes. Lines
/// whose times go back are taken in the order of their times; a robot that nobody watched has no truth: notes
/// say so. Throws cairn::Error naming file and line.
[[nodiscard]] LandmarkLog read_mrclam(const std::filesystem::path& folder, int robot);

/// A graph of ODOMETRY and LANDMARK lines, as Victoria Park's is published (J. Guivant, E. Nebot, T-RA 17,
/// 2001; the graph by M. Kaess, F. Dellaert, T-RO 24, 2008). Throws cairn::Error naming the line.
[[nodiscard]] LandmarkLog read_graph(const std::filesystem::path& path);

/// Adds Victoria Park's GPS to its graph, which has no times: a fix belongs to the pose at the same share of
/// the way that the wheels have turned. Files of MATLAB 5: `fixes` with timeGps, Lo_m, La_m, `wheels` with
/// time, speed. Throws cairn::Error naming the file.
void read_gps(LandmarkLog& log, const std::filesystem::path& fixes, const std::filesystem::path& wheels);

/// Landmarks and way points.
struct PointMap {
  std::string name{};
  std::vector<cairn::Vector<2>> landmarks{}, way{};
};

/// T. Bailey's maps: "lm 2 N" with N lines, "wp 2 M" with M lines. Throws cairn::Error naming the line.
[[nodiscard]] PointMap read_point_map(const std::filesystem::path& path);
/// A loop of 60 x 40 m with 48 landmarks beside it.
[[nodiscard]] PointMap loop_map();

/// A drive along the way points, around again where they are passed: at 3 m/s, seeing up to 30 m ahead five
/// times a second, with the noise of Bailey's simulator (0.3 m/s, 3 degrees of steering, 0.1 m, 1 degree)
/// drawn from the very models that the filter has.
[[nodiscard]] LandmarkLog simulated(const PointMap& map, std::uint64_t seed, std::size_t frames);

}  // namespace fastslam
