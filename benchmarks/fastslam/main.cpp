// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The scoreboard of FastSLAM: scripts/scoreboard fastslam [PART...]. Five seeds of published logs with one
// setting, a published map with simulated drives, what it costs to keep many landmarks in many particles, and
// lines seen by three cameras. EKF-SLAM on the library's joint Gaussian runs on the same logs. Parts: robots,
// park, nees, joint, index, linear, lines.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <malloc.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/index/shared_kd_tree.hpp>

#include "batch.hpp"
#include "ekf_slam.hpp"
#include "joint_rival.hpp"
#include "linear.hpp"
#include "lines.hpp"
#include "scores.hpp"
#include "shared_buckets.hpp"
#include "slam.hpp"
#include "support/data.hpp"
#include "support/scoreboard.hpp"

namespace {

using namespace cairn_bench;
using namespace fastslam;
using cairn::SE2;
using cairn::Vector;

// Settings were looked for with the seeds 1 to 5, which then flatter: these are others.
constexpr std::uint64_t first_seed = 101, seeds = 5;

std::string worst(const std::vector<double>& values) {
  return "worst of 5 seeds " + std::to_string(*std::ranges::max_element(values));
}

SlamOptions options_of(std::size_t particles, std::uint64_t seed) {
  return {.particles = particles, .seed = seed, .threads = std::max(1U, std::thread::hardware_concurrency())};
}

struct Runs {
  std::vector<double> path, landmarks, nees;  ///< NEES: of the pose, median over the log's frames
};
Runs runs_of(const LandmarkLog& log, std::size_t particles) {
  Runs runs;
  for (std::uint64_t seed = first_seed; seed < first_seed + seeds; ++seed) {
    const Results r = run(log, options_of(particles, seed));
    runs.path.push_back(*r.path_error);
    runs.landmarks.push_back(r.landmark_error.value_or(0));
    runs.nees.push_back(r.median_nees.value_or(0));
    std::cerr << log.name << ", seed " << seed << ": path " << runs.path.back() << " m, landmarks "
              << runs.landmarks.back() << " m, NEES " << runs.nees.back() << ", " << r.cpu_seconds << " s\n";
  }
  return runs;
}

/// Poses at the frames of a path that has more.
std::vector<Vector<2>> at_frames(const LandmarkLog& log, const std::vector<cairn::StampedPose2>& path) {
  std::vector<Vector<2>> places;
  for (const auto& p : path)
    if (places.size() < log.frames.size() && p.time == log.frames[places.size()].time)
      places.push_back(p.pose.translation());
  return places;
}

double fitted(const std::vector<Vector<2>>& path, const std::vector<Vector<2>>& is) {
  return rms(path, is, rigid_fit(path, is));
}

/// EKF-SLAM's path, measured as FastSLAM's.
double ekf_path_error(const LandmarkLog& log) {
  std::vector<SE2> poses;
  for (const auto& pose : ekf_slam(log).poses) poses.push_back(pose.mean);
  std::vector<Vector<2>> path, is;
  for (const auto& p : filled(log, poses)) {
    const auto after = std::upper_bound(log.truth.begin(), log.truth.end(), p.time,
                                        [](double t, const auto& truth) { return t < truth.time; });
    if (after == log.truth.begin()) continue;
    path.push_back(p.pose.translation());
    is.push_back(std::prev(after)->pose.translation());
  }
  return fitted(path, is);
}

void add_robots(Scoreboard& board) {
  const auto folder = cairn_test::real_data("mrclam_7");
  for (const int robot : {1, 2, 3}) {
    const std::string title = "UTIAS 7, robot " + std::to_string(robot) + ": ";
    Row path{.name = title + "path, identities known, M = 20", .unit = "m", .must = 0.25, .aim = 0.15};
    Row landmarks{.name = title + "landmarks", .unit = "m", .must = 0.15, .aim = 0.08};
    Row ratio{.name = title + "path, withheld, M = 100, over known", .unit = "x", .must = 1.5, .aim = 1.1};
    Row nees{.name = title + "NEES of the pose, median of the frames (2.4 is right), known, M = 20",
             .unit = ""};
    if (folder) {
      LandmarkLog log = read_mrclam(*folder, robot);
      const Runs known = runs_of(log, 20);
      path.rival = ekf_path_error(log);
      path.rival_name = "EKF-SLAM, its online path";
      log.withhold_identities();
      const Runs withheld = runs_of(log, 100);
      path.measured = cairn::median(known.path);
      path.note = worst(known.path);
      landmarks.measured = cairn::median(known.landmarks);
      landmarks.note = worst(known.landmarks);
      ratio.measured = cairn::median(withheld.path) / cairn::median(known.path);
      ratio.note = worst(withheld.path) + " m";
      nees.measured = cairn::median(known.nees);
      nees.note = worst(known.nees) + "; withheld, M = 100: " + std::to_string(cairn::median(withheld.nees));
    } else {
      path.note = landmarks.note = ratio.note = nees.note = "no data";
    }
    board.add(path);
    board.add(landmarks);
    board.add(ratio);
    board.add(nees);
  }
}

void add_park(Scoreboard& board) {
  const auto folder = cairn_test::real_data("victoria_park");
  Row error{.name = "Victoria Park: rms to the batch optimum, M = 50", .unit = "m", .must = 3, .aim = 1};
  Row few{.name = "the same, M = 10", .unit = "m"};
  Row time{.name = "the same, M = 50: CPU", .unit = "s", .must = 10, .aim = 1};
  if (folder) {
    LandmarkLog log = read_graph(*folder / "victoria_park_graph.txt");
    std::vector<Vector<2>> is;
    for (const SE2& pose : growing_batch_optimum(log).poses) is.push_back(pose.translation());
    const auto errors = [&](std::size_t particles, std::vector<double>& seconds) {
      std::vector<double> all;
      for (std::uint64_t seed = first_seed; seed < first_seed + seeds; ++seed) {
        const Results r = run(log, options_of(particles, seed));
        all.push_back(fitted(at_frames(log, r.mean), is));
        seconds.push_back(r.cpu_seconds);
      }
      return all;
    };
    std::vector<double> seconds, ignored;
    const std::vector<double> fifty = errors(50, seconds), ten = errors(10, ignored);
    error.measured = cairn::median(fifty);
    error.note = "after a rigid fit; " + worst(fifty);
    few.measured = cairn::median(ten);
    few.note = worst(ten);
    time.measured = cairn::median(seconds);
    const EkfSlamRun ekf = ekf_slam(log);
    std::vector<Vector<2>> path;
    for (const auto& pose : ekf.poses) path.push_back(pose.mean.translation());
    error.rival = fitted(path, is);
    time.rival = ekf.cpu_seconds;
    error.rival_name = time.rival_name = "EKF-SLAM, its online path";
  } else {
    error.note = few.note = time.note = "no data";
  }
  board.add(error);
  board.add(few);
  board.add(time);
}

/// Mean NEES of the pose over 20 simulated drives, one for each step.
std::vector<double> mean_nees(const PointMap& map, std::size_t particles, std::size_t frames) {
  constexpr std::uint64_t runs = 20;
  std::vector<double> nees(frames, 0);
  for (std::uint64_t seed = first_seed; seed < first_seed + runs; ++seed) {
    const Results r = run(simulated(map, seed, frames), options_of(particles, seed));
    for (std::size_t k = 0; k < frames; ++k) nees[k] += *r.steps[k].nees / runs;
  }
  return nees;
}

/// Share of the first steps whose mean of 20 is inside the band of 99 %.
double share_inside(const std::vector<double>& nees, std::size_t steps) {
  const auto band = cairn::chi_square_mean_band(3, 20, 0.99);
  const auto end = nees.begin() + static_cast<std::ptrdiff_t>(steps);
  const auto inside = std::count_if(nees.begin(), end, [&](double v) { return band.contains(v); });
  return static_cast<double>(inside) / static_cast<double>(steps);
}

void add_nees(Scoreboard& board) {
  const auto folder = cairn_test::real_data("fastslam_maps");
  const std::string title = "webmap, 20 runs: steps whose NEES of the pose is in the 99 % band, ";
  Row few{.name = title + "first 100, M = 100", .unit = "%", .must = 99, .better = larger};
  Row first{.name = title + "first 100, M = 500", .unit = "%", .better = larger};
  Row later{.name = title + "first 300, M = 500", .unit = "%", .aim = 99, .better = larger};
  if (folder) {
    const PointMap map = read_point_map(*folder / "example_webmap.mat");
    few.measured = 100 * share_inside(mean_nees(map, 100, 100), 100);
    const std::vector<double> nees = mean_nees(map, 500, 300);
    first.measured = 100 * share_inside(nees, 100);
    later.measured = 100 * share_inside(nees, 300);
  } else {
    few.note = first.note = later.note = "no data";
  }
  board.add(few);
  board.add(first);
  board.add(later);
}

/// Milliseconds to make a hundred copies of a map their own by an update of one landmark in each, which is
/// seen so far from where it was believed to be. Beyond its filing distance the index changes too.
struct UpdateCost {
  double milliseconds = 0, plain_milliseconds = 0;
  std::size_t most_copies = 0;
};
UpdateCost update_cost(std::uint32_t landmarks, double off) {
  using Clock = std::chrono::steady_clock;
  constexpr std::size_t particles = 100;
  constexpr int rounds = 20;
  cairn::Random random(1);
  Map map{PointSensor{}};
  std::vector<Vector<2>> places;
  for (std::uint32_t i = 0; i < landmarks; ++i) {
    places.emplace_back(random.uniform(-500, 500), random.uniform(-500, 500));
    map.insert({}, {{map.sensor().predict({}, places.back()), i}}, {cairn::new_landmark});
  }
  std::vector<double> times, plain_times;
  UpdateCost cost;
  std::vector<cairn::MappedLandmark<Vector<2>>> plain;
  map.for_each([&](std::uint32_t, const auto& landmark) { plain.push_back(landmark); });
  for (int round = 0; round < rounds; ++round) {
    const auto number = static_cast<std::uint32_t>(random.below(landmarks));
    const SE2 x(places[number](0) - 3, places[number](1), 0);
    const Map::Observation z{{map.sensor().predict(x, places[number] + Vector<2>(0, off)), number}};
    auto begin = Clock::now();
    std::vector<Map> copies(particles, map);
    for (Map& copy : copies) copy.insert(x, z, {number});
    times.push_back(1e3 * std::chrono::duration<double>(Clock::now() - begin).count());
    for (const Map& copy : copies)
      cost.most_copies = std::max(cost.most_copies, copy.node_copies() - map.node_copies());
    if (round % 5 != 0) continue;
    begin = Clock::now();
    for (std::size_t i = 0; i < particles; ++i) {
      auto copy = plain;
      ++copy[number].sightings;
      plain.swap(copy);
    }
    plain_times.push_back(1e3 * std::chrono::duration<double>(Clock::now() - begin).count());
  }
  cost.milliseconds = cairn::median(times);
  cost.plain_milliseconds = cairn::median(plain_times);
  return cost;
}

void add_index(Scoreboard& board) {
  for (const std::uint32_t n : {100U, 1000U, 10000U, 50000U}) {
    const UpdateCost cost = update_cost(n, 0.1), refiled = update_cost(n, 3);
    const bool is_owed = n == 50000;
    const std::string title =
        std::to_string(n) + " landmarks, 100 particles: copied and one landmark updated in each";
    board.add({.name = title,
               .measured = cost.milliseconds,
               .unit = "ms",
               .must = is_owed ? std::optional(1.0) : std::nullopt,
               .aim = is_owed ? std::optional(0.2) : std::nullopt,
               .rival = cost.plain_milliseconds,
               .rival_name = "plain copies"});
    board.add({.name = "the same: nodes copied in a particle, at most",
               .measured = static_cast<double>(cost.most_copies),
               .unit = "",
               .must = is_owed ? std::optional(10.0) : std::nullopt});
    board.add({.name = "the same where the landmark moves out of its place in the index",
               .measured = refiled.milliseconds,
               .unit = "ms",
               .note = std::to_string(refiled.most_copies) + " nodes copied in a particle, at most"});
  }
}

/// What an index costs a step of a hundred particles: each copies it, looks for what is near a place, and
/// files one landmark anew.
struct IndexCost {
  double microseconds = 0;  ///< for one particle
  double bytes = 0;         ///< that the copy has of its own
  std::uint64_t found = 0;  ///< sum of what the boxes hold: the same for all
};
template <class Index>
IndexCost index_cost(std::uint32_t landmarks) {
  using Clock = std::chrono::steady_clock;
  using Point = typename Index::Point;
  constexpr std::size_t particles = 100;
  const double reach = 5 * std::sqrt(static_cast<double>(landmarks));  // a landmark on 100 m^2
  cairn::Random random(1);
  std::vector<Point> places;
  Index index;
  for (std::uint32_t i = 0; i < landmarks; ++i) {
    places.push_back({random.uniform(-reach, reach), random.uniform(-reach, reach)});
    index.insert(places.back(), i);
  }
  IndexCost cost;
  std::vector<double> times;
  for (int round = 0; round < 11; ++round) {
    const auto number = static_cast<std::uint32_t>(random.below(landmarks));
    const Point at = places[number], to{at[0] + 0.7, at[1] - 0.4};
    std::vector<Index> copies;
    copies.reserve(particles);
    const auto before = ::mallinfo2();
    const auto begin = Clock::now();
    for (std::size_t i = 0; i < particles; ++i) {
      copies.push_back(index);
      Index& copy = copies.back();
      copy.for_each_in_box({at[0] - 3, at[1] - 3}, {at[0] + 3, at[1] + 3},
                           [&](std::uint32_t id, const Point&) { cost.found += id; });
      copy.erase(at, number);
      copy.insert(to, number);
    }
    times.push_back(1e6 * std::chrono::duration<double>(Clock::now() - begin).count() / particles);
    const auto after = ::mallinfo2();
    cost.bytes = static_cast<double>(after.uordblks + after.hblkhd - before.uordblks - before.hblkhd) /
                 static_cast<double>(particles);
  }
  cost.microseconds = cairn::median(times);
  return cost;
}

void add_index_rivals(Scoreboard& board) {
  for (const std::uint32_t n : {100U, 1000U, 10000U, 50000U}) {
    const IndexCost tree = index_cost<cairn::SharedKdTree<2>>(n), buckets = index_cost<SharedBuckets>(n),
                    plain = index_cost<PlainPoints>(n);
    if (tree.found != buckets.found || tree.found != plain.found) {
      std::cerr << "the indices do not find the same\n";
      std::exit(1);
    }
    const std::string title = "index of " + std::to_string(n) + ", a particle: copied, asked, one filed anew";
    const auto note = [](const char* unit, double bucket, double copy) {
      return "shared buckets " + std::to_string(bucket) + unit + ", plain copies " + std::to_string(copy) +
             unit;
    };
    board.add({.name = title + ": time, shared kd-tree",
               .measured = tree.microseconds,
               .unit = "us",
               .rival = std::min(buckets.microseconds, plain.microseconds),
               .rival_name = buckets.microseconds < plain.microseconds ? "shared buckets" : "plain copies",
               .note = note(" us", buckets.microseconds, plain.microseconds)});
    board.add({.name = "the same: memory of its own",
               .measured = tree.bytes,
               .unit = "bytes",
               .rival = std::min(buckets.bytes, plain.bytes),
               .rival_name = buckets.bytes < plain.bytes ? "shared buckets" : "plain copies",
               .note = note(" bytes", buckets.bytes, plain.bytes)});
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (const auto code = answer(argc, argv, "scoreboard_fastslam",
                               {"robots", "park", "nees", "joint", "index", "linear", "lines"}))
    return *code;
  const std::vector<std::string_view> parts(argv + 1, argv + argc);
  const auto wanted = [&](std::string_view part) {
    return parts.empty() || std::ranges::find(parts, part) != parts.end();
  };
  Scoreboard board("fastslam");
  if (wanted("robots")) add_robots(board);
  if (wanted("park")) add_park(board);
  if (wanted("nees")) add_nees(board);
  if (wanted("joint")) add_joint_rival(board);
  if (wanted("index")) {
    add_index(board);
    add_index_rivals(board);
  }
  if (wanted("linear")) add_linear(board);
  if (wanted("lines")) add_lines(board);
  return board.finish();
}
