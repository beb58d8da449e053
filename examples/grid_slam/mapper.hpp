// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The grid mapper: scans with odometry in, a path with its spread and a map out.
///
/// A scan is processed after so much motion, or where the robot stops; the others get their pose by odometry
/// between the processed ones. The robot drives forwards or backwards, and odometry does not always know
/// which: the direction is a part of each particle's state and may change where the robot stood. One setting
/// serves all logs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include <cairn/eval/relations.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/io/carmen.hpp>
#include <cairn/scan/occupancy_grid.hpp>

#include "loop_closing.hpp"
#include "occupancy_map.hpp"
#include "scan_delay.hpp"

namespace example {
class Reader;
}

namespace grid_slam {

/// Standard deviations of odometry over D metres and A radians: offset + per_metre D + per_radian A.
struct OdometryNoise {
  double offset = 0.02, per_metre = 0.1, per_radian = 0.02;                    ///< to either axis [m]
  double angle_offset = 0.01, angle_per_metre = 0.05, angle_per_radian = 0.1;  ///< of the heading [rad]
};

struct LoopOptions {
  bool on = true;
  double check_every = 0.5;   ///< [m] of path between two looks
  double apart = 12;          ///< [m] of path between a place and its revisit
  std::size_t places = 3;     ///< old places that are looked at, at most
  double reach = 25;          ///< [m]: places farther from where the robot believes to be are not looked at
  double check_share = 0.1;   ///< of how far a look reaches: the least path between two
  double view = 12;           ///< [m]: what is farther from the robot is not compared
  double look_alike = 0.7;    ///< [m] between two places that are told apart
  double still_alike = 0.9;   ///< of the best place's score: a second place with more makes it one of many
  double spacing = 3;         ///< [m] of path between two loops that are kept
  double submap = 4;          ///< [m] of path to either side of the old place
  double query = 3;           ///< [m] of path before the new one
  double enough_score = 0.5;  ///< of the correlation
  double least_cell = 0.05;   ///< [m]: finer maps are compared in cells of this size
  /// Of the points that fall where the old place was seen; and of all points, where the error is less than
  /// matching bridges: farther off, the robot may see what it did not see then.
  double enough_inliers = 0.75;
  double bridged = 0.2;  ///< [m]
  /// Of both, where the looks of a whole `query` agree that the path is farther off.
  double enough_of_many = 0.5;
  double gate = 25;           ///< squared Mahalanobis distance of a loop's error in the path's covariance
  double moved = 0.08;        ///< [m] an error from which on the paths are moved
  double turned = 0.01;       ///< [rad] the same of the heading
  std::size_t survivors = 2;  ///< distinct particles when the paths are moved: each costs a map
};

struct MapperOptions {
  /// Of the laser in the map; none: where odometry has it. From a pose that is the same for all logs, what
  /// comes out does not depend on where odometry has its origin.
  std::optional<cairn::SE2> start = cairn::SE2();
  std::size_t particles = 30;
  std::uint64_t seed = 1;
  unsigned threads = 1;
  double cell_size = 0.05;  ///< [m]
  double field_radius = 6;  ///< cells
  cairn::EndPointModel model{.sigma = 0.03, .outliers = 0.05, .independence = 0.42};
  OdometryNoise odometry{};
  double step_distance = 0.3;   ///< [m] between processed scans
  double step_angle = 0.2;      ///< [rad]
  double standstill = 0.02;     ///< [m] between two scans: the robot stood
  double turn_back = 0.04;      ///< probability that it goes on in the other direction
  double turn_unseen = 0.002;   ///< the same where no standstill was seen
  double slip = 0.002;          ///< probability that odometry says little: a collision, a push
  double slip_distance = 0.25;  ///< [m], standard deviation of the motion then
  double slip_angle = 0.25;     ///< [rad]
  double resample_below = 0.5;
  double evidence_share = 0.12;
  /// FromMatch's, narrower than the posterior: by its own defaults one seed of four lost ACES (docs/grid.md).
  double widened = 1;
  std::size_t draws = 1;
  LoopOptions loops{};
};

/// What a processed scan brought.
struct StepRecord {
  std::size_t scan = 0;  ///< index in the log
  double effective_size = 0;
  bool resampled = false;
  bool moved = false;  ///< a loop moved the paths
  cairn::Gaussian<cairn::SE2> pose;
};

/// What a run asks of a saved map; what it does not ask for is as it was.
struct MapRequest {
  std::optional<double> cell_size{};       ///< refused where the map has another
  std::optional<std::size_t> particles{};  ///< the same, but for a localiser
  std::optional<std::uint64_t> seed{};
  unsigned threads = 1;
};

/// Where a robot may be [m].
struct PlaceWindow {
  double left = 0, bottom = 0, right = 0, top = 0;
};

/// A place that explains a scan, and its share of what all such places explain.
struct PossiblePlace {
  cairn::SE2 pose;
  double share = 0;
};

/// The last look that asked for the paths to be moved.
struct Asked {
  cairn::Vector<3> error;
  double at = 0, since = 0;  ///< [m] travelled there, and at the first of those before that agree with it
  bool whole = false;
};

/// Takes scans one by one.
class Mapper {
public:
  using Belief = cairn::MappedPaths<OccupancyMap>;

  /// Throws cairn::Error on options out of range.
  explicit Mapper(const MapperOptions& options);

  /// A mapper that goes on where the saved one stood, bit for bit. Throws cairn::Error where the file is no
  /// map, is damaged, or is not what is wanted.
  [[nodiscard]] static Mapper loaded(const std::filesystem::path& path, const MapRequest& wanted = {});
  /// A mapper that leaves the saved map of the best particle as it is. It begins where the saved one stood,
  /// or, with a window, at the place in it, of any heading, that explains the first scan best. Throws as
  /// loaded(), and where the window has no part of the map in it. The first scan is refused where no place
  /// explains it; places() says what looks like the place taken.
  [[nodiscard]] static Mapper localiser(const std::filesystem::path& path, const MapRequest& wanted = {},
                                        const std::optional<PlaceWindow>& window = std::nullopt);
  /// Writes all that the mapper is, or, throwing cairn::Error, leaves the file as it was.
  void save(const std::filesystem::path& path) const;

  /// The next scan of the log. Returns whether it was processed. Throws cairn::Error where the filter refuses
  /// the step or the map cannot reach so far, naming why; but for the first scan's, all is then as it was.
  bool add(const cairn::StampedScan& scan);

  [[nodiscard]] const MapperOptions& options() const noexcept { return options_; }
  /// Those taken so far, their poses of the laser seen from the first one.
  [[nodiscard]] const std::vector<cairn::StampedScan>& scans() const noexcept { return scans_; }
  [[nodiscard]] const std::vector<StepRecord>& steps() const noexcept { return steps_; }
  [[nodiscard]] const std::vector<Loop>& loops() const noexcept { return loops_; }
  /// Of a mapper that has taken a scan.
  [[nodiscard]] const Belief& belief() const;
  /// The newest pose, seen from where the map begins. To the spread of the particles, whose ancestors are one
  /// soon, comes what the path of the best of them has gathered, step by step, since it began, and what loops
  /// have told of it since. In a map that stays as it is, the particles' spread is all there is. O(steps).
  [[nodiscard]] cairn::Gaussian<cairn::SE2> newest() const;
  /// Whether the map stays as it was loaded.
  [[nodiscard]] bool localises() const noexcept { return frozen_.has_value(); }
  /// How far scans lag behind odometry, as far as turns have shown.
  [[nodiscard]] const ScanDelay& delay() const noexcept { return delay_; }
  /// Of a localiser with a window that has taken a scan: the place where it began, then those that look like
  /// it, if any.
  [[nodiscard]] const std::vector<PossiblePlace>& places() const noexcept { return places_; }

  /// Of a localiser that has taken a scan the share of all points so far that lie at the map's obstacles,
  /// from the best particle's path; nothing of a mapper, whose scans made the map. O(points).
  [[nodiscard]] std::optional<double> explained() const;
  /// Steps that were made by scans alone, which moved on where odometry stood.
  [[nodiscard]] std::size_t steps_unseen() const noexcept { return unseen_.steps; }

  /// A pose for every scan so far: of the best particle at the processed ones, along the odometry between.
  /// By the drawn poses, or by the means of the densities that they were drawn from.
  [[nodiscard]] std::vector<cairn::StampedPose2> trajectory(bool means) const;
  /// The same, each scan matched once more to the best particle's map: offline.
  [[nodiscard]] std::vector<cairn::StampedPose2> rematched() const;

private:
  /// Since the last processed scan.
  struct Motion {
    double distance = 0, angle = 0;
    bool stood = false;
  };

  /// What odometry has not seen: scans that moved on where it stood.
  struct Unseen {
    std::size_t still_since = 0;  // scan; odometry has not moved after it
    std::size_t steps = 0;
    bool newest = false;  // the newest step is one of them
  };

  template <class Archive>
  static void plain_parts(Archive& archive, Mapper& mapper);
  [[nodiscard]] static Mapper loaded(example::Reader& reader, const MapRequest& wanted);
  void expect_sound(const example::Reader& reader) const;  // of what was read, but for map and paths
  void begin(const cairn::LaserScan& scan);
  [[nodiscard]] cairn::Gaussian<cairn::SE2> place_in_window(const cairn::LaserScan& scan);
  void accumulate(const cairn::SE2& moved);
  /// Whether odometry moved too little for a robot on its way, from the scan before. Copies of a scan do not
  /// tell, so the scan before is one of another time.
  [[nodiscard]] bool stands(const cairn::StampedScan& next) const;
  /// Whether the newest scan shows another place than the first ones where odometry stands.
  [[nodiscard]] bool odometry_is_stuck() const;
  void process(const cairn::StampedScan& scan, bool stopped, bool stuck);
  [[nodiscard]] cairn::Matrix<3> motion_noise() const;
  /// Of the step to the newest scan: what the delay leaves open of the turn is a part of the covariance.
  [[nodiscard]] cairn::Gaussian<cairn::SE2> motion_step(bool forwards) const;
  void learn_delay(const cairn::Matrix<3>& noise);
  void look_for_loop();
  [[nodiscard]] std::vector<std::size_t> old_places(const std::vector<cairn::SE2>& poses,
                                                    const ChainCovariance& uncertain) const;
  /// Where an old place is looked for: by how far the path between has become uncertain.
  struct LoopWindow {
    double reach, turn;  // [m], [rad] to either side
    double every;        // [m] of path between two looks
  };
  [[nodiscard]] LoopWindow loop_window(const cairn::Matrix<3>& covariance) const;
  /// A loop, and the shares of points that the old place explains: of those where it was seen, and of all.
  struct MeasuredLoop {
    Loop loop;
    double inliers, matched;
  };
  /// A loop, and how far the path between is off by it.
  struct Look {
    Loop loop;
    bool whole;  // else the old place explains only a part of what the robot sees
    cairn::Vector<3> error;
    double every;  // [m] of path between two such looks
  };
  void take_loop(const Look& look);
  [[nodiscard]] bool believed(const Look& look);
  [[nodiscard]] std::optional<Look> looked_at(const std::vector<cairn::SE2>& poses,
                                              const ChainCovariance& uncertain, std::size_t near,
                                              const LoopWindow& window) const;
  [[nodiscard]] std::optional<MeasuredLoop> measured_loop(const std::vector<cairn::SE2>& poses,
                                                          std::size_t near, const LoopWindow& window) const;
  void move_paths();
  [[nodiscard]] OccupancyMap empty_map() const;

  MapperOptions options_;
  std::optional<Belief> belief_;
  std::optional<OccupancyMap> frozen_;  // what a localiser moves in
  std::optional<PlaceWindow> window_;
  std::vector<PossiblePlace> places_;
  std::optional<cairn::Gaussian<cairn::SE2>> start_;
  std::vector<StepRecord> steps_;
  std::vector<std::vector<cairn::ScanPoint>> points_;  // of the processed scans
  std::vector<double> travelled_;                      // [m] at each pose of the path
  cairn::SE2 T_odom_first_;                            // of the laser, at the first scan
  std::vector<cairn::StampedScan> scans_;              // of poses seen from there
  std::vector<Loop> loops_;
  Motion motion_;
  Unseen unseen_;
  ScanDelay delay_;
  double looked_ = 0;  // travelled at the last look for a loop
  std::optional<Asked> asked_;
};

}  // namespace grid_slam
