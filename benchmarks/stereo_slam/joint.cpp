// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "joint.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <iostream>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <cairn/eval/consistency.hpp>
#include <cairn/io/text.hpp>
#include <cairn/slam/keyframe_map.hpp>

#include "rival_ceres.hpp"
#include "slam/simulated_arena.hpp"

namespace stereo_slam_bench {
namespace {

using cairn::SE3;
using cairn_bench::Row;
using Dense = Eigen::MatrixXd;

constexpr std::uint64_t drives = 10;
constexpr std::size_t window_size = 10;
constexpr double sigma = 0.4, tenth = 0.1;  // of the arena [pixels], and of the noise

/// With so many digits behind the point.
std::string in_short(double value, int digits) {
  const double scale = std::pow(10, digits);
  return cairn::shortest(std::round(value * scale) / scale);
}

/// The least squares problem that a map stands for: its keyframes and the lists of its landmarks, begun where
/// the map has them.
Bundle bundle_of(cairn::KeyframeMap& map) {
  Bundle bundle;
  bundle.first_sigma = map.options().first_sigma;
  std::unordered_map<std::size_t, std::size_t> place;  // of a keyframe
  for (std::size_t k = 0; k < map.keyframes_added(); ++k)
    if (const auto pose = map.keyframe_pose(k)) {
      place.emplace(k, bundle.poses.size());
      bundle.poses.push_back(*pose);
    }
  for (const std::uint32_t id : map.landmark_ids()) {
    const auto landmark = map.landmark(id);
    if (!landmark) continue;
    for (const cairn::KeyframeSighting& s : map.sightings_of(id))
      bundle.sightings.push_back(
          {place.at(s.keyframe), bundle.points.size(), s.sighting.left, s.sighting.right, s.sighting.sigma});
    bundle.points.push_back(landmark->mean);
  }
  return bundle;
}

/// The map against the minimum of its problem.
struct Agreement {
  double apart = 0;                 ///< of a keyframe's number at most, in standard deviations
  double apart_mean = 0;            ///< root of the mean square of those
  double variance = 0;              ///< largest difference of a variance in any direction, relative
  double nees = 0, rival_nees = 0;  ///< of the keyframes against the truth, mean
  double rival_seconds = 0;
  std::size_t keyframes = 0, sightings = 0;
};

double step_nees(const cairn::Vector<6>& step, const Dense& covariance) {
  return step.dot(covariance.ldlt().solve(step));
}

/// `truth`: of the keyframes, in the order of the map. The first keyframe is the gauge of both.
std::optional<Agreement> compare(const cairn::StereoRig& rig, cairn::KeyframeMap& map,
                                 const std::vector<SE3>& truth) {
  const Bundle bundle = bundle_of(map);
  const auto minimum = solve_with_ceres(rig, bundle);
  if (!minimum || minimum->covariance.rows() == 0) return std::nullopt;
  Agreement result;
  result.keyframes = bundle.poses.size();
  result.sightings = bundle.sightings.size();
  result.rival_seconds = minimum->seconds;
  const auto n = minimum->covariance.rows();
  const Dense ours = map.covariance().bottomRightCorner(n, n);
  const Eigen::LLT<Dense> factor(minimum->covariance);
  const Dense half = factor.matrixL().solve(ours);
  const Dense ratio = factor.matrixL().solve(half.transpose());
  const Eigen::SelfAdjointEigenSolver<Dense> parts((ratio + ratio.transpose()) / 2, Eigen::EigenvaluesOnly);
  result.variance = (parts.eigenvalues().array() - 1).abs().maxCoeff();
  const auto frames = static_cast<double>(bundle.poses.size() - 1);
  for (std::size_t k = 1; k < bundle.poses.size(); ++k) {
    const auto at = 6 * static_cast<Eigen::Index>(k - 1);
    const auto step = [&](const SE3& from, const SE3& to) { return (to * from.inverse()).log(); };
    const Dense P = minimum->covariance.block(at, at, 6, 6);
    const cairn::Vector<6> d = step(minimum->poses[k], bundle.poses[k]);
    for (int i = 0; i < 6; ++i) {
      const double sigmas = std::abs(d(i)) / std::sqrt(P(i, i));
      result.apart = std::max(result.apart, sigmas);
      result.apart_mean += sigmas * sigmas / (6 * frames);
    }
    result.nees += step_nees(step(bundle.poses[k], truth[k]), ours.block(at, at, 6, 6)) / frames;
    result.rival_nees += step_nees(step(minimum->poses[k], truth[k]), P) / frames;
  }
  result.apart_mean = std::sqrt(result.apart_mean);
  return result;
}

/// Nothing but least squares, as Ceres is given it.
cairn::KeyframeMapOptions plain() {
  cairn::KeyframeMapOptions options;
  options.loss = cairn::RobustLoss::none;
  options.gate_probability = options.contradiction = 1 - 1e-12;
  return options;
}

/// The true poses of the keyframes of a drive that lost no frame and dropped no keyframe.
std::vector<SE3> truth_of(const cairn_test::ArenaRun& run,
                          const std::vector<cairn_test::ArenaFrame>& frames) {
  std::vector<SE3> truth{frames[0].T_world_camera};
  for (std::size_t i = 0; i < run.keyframes.size(); ++i)
    if (run.keyframes[i] > truth.size()) truth.push_back(frames[i + 1].T_world_camera);
  return truth;
}

/// Means over drives: NEES of all frames, root of the mean square error of the first lap and of all.
struct Scores {
  double nees = 0, lap = 0, all = 0, seconds = 0;
  double least = 1e300, most = 0;  ///< mean NEES of a drive
  void add(const std::vector<double>& nees_of, const std::vector<double>& off, double cpu) {
    double sum = 0, squares = 0, of_lap = 0;
    constexpr std::size_t a_lap = 200;
    for (const double one : nees_of) sum += one / static_cast<double>(nees_of.size());
    for (std::size_t i = 0; i < off.size(); ++i) {
      squares += off[i] * off[i] / static_cast<double>(off.size());
      if (i < a_lap) of_lap += off[i] * off[i] / a_lap;
    }
    nees += sum / drives;
    least = std::min(least, sum);
    most = std::max(most, sum);
    all += squares / drives;
    lap += of_lap / drives;
    seconds += cpu / drives;
  }
  [[nodiscard]] std::string range() const { return in_short(least, 1) + " to " + in_short(most, 1); }
};

std::optional<double> seconds_of_window(const std::vector<cairn_test::ArenaFrame>& frames, Scores& scores) {
  const auto run = drive_ceres_window(cairn_test::arena_rig(), frames, {}, window_size);
  if (!run) return std::nullopt;
  std::vector<double> nees, off;
  for (std::size_t i = 0; i < run->poses.size(); ++i) {
    const cairn::Vector<6> error = cairn::local(run->poses[i], frames[i + 1].T_world_camera);
    nees.push_back(cairn::normalised_squared(error, run->covariances[i]).value_or(1e6));
    off.push_back(error.head<3>().norm());
  }
  scores.add(nees, off, run->seconds);
  return run->seconds;
}

}  // namespace

void add_joint_rows(cairn_bench::Scoreboard& board) {
  Scores ours, window;
  bool rival = true;
  std::vector<Agreement> agreements, quiet;
  for (std::uint64_t seed = 1; seed <= drives; ++seed) {
    std::cout << "driving the simulated arena, seed " << seed << std::endl;
    const auto frames = cairn_test::arena_frames({.seed = seed});
    cairn::KeyframeMap map(cairn_test::arena_rig());
    const std::clock_t start = std::clock();
    const cairn_test::ArenaRun run = cairn_test::run_arena(frames, map);
    ours.add(run.nees, run.off, static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    rival = rival && seconds_of_window(frames, window);
    // And with a tenth of the noise that the map is told of, what linearising once costs is a tenth of that.
    for (const double noise : {1.0, tenth}) {
      if (!rival || (noise < 1 && seed > 3)) continue;
      auto seen = cairn_test::arena_frames({.seed = seed, .sigma = noise * sigma});
      for (cairn_test::ArenaFrame& frame : seen)
        for (cairn::StereoSighting& s : frame.sightings) s.sigma = sigma;
      cairn::KeyframeMap least_squares(cairn_test::arena_rig(), plain());
      const cairn_test::ArenaRun plainly = cairn_test::run_arena(seen, least_squares);
      const std::vector<SE3> truth = truth_of(plainly, seen);
      if (plainly.lost > 0 || truth.size() != least_squares.keyframes_added()) continue;
      if (auto one = compare(cairn_test::arena_rig(), least_squares, truth)) {
        one->apart /= noise;
        one->apart_mean /= noise;
        (noise < 1 ? quiet : agreements).push_back(*one);
      }
    }
  }
  const auto largest = [](const std::vector<Agreement>& all, double Agreement::* what) {
    double result = 0;
    for (const Agreement& one : all) result = std::max(result, one.*what);
    return result;
  };
  const auto mean = [](const std::vector<Agreement>& all, double Agreement::* what) {
    double sum = 0;
    for (const Agreement& one : all) sum += one.*what / static_cast<double>(all.size());
    return sum;
  };
  const std::string of = std::to_string(drives) + " simulated drives: ";
  const std::string name = "Ceres, window of " + std::to_string(window_size) + " keyframes";
  const auto of_rival = [&](double value) { return rival ? std::optional(value) : std::nullopt; };
  const auto same = [&](const std::string& what, const std::vector<Agreement>& all,
                        double Agreement::* measured, double unit, double must, std::string note) {
    if (all.empty())
      board.add({.name = of + what, .note = "no rival"});
    else
      board.add({.name = of + what,
                 .measured = largest(all, measured) * unit,
                 .unit = unit > 1 ? "%" : "sigma",
                 .must = must,
                 .rival_name = "Ceres",
                 .note = std::move(note)});
  };
  same("keyframes off the minimum of all keyframes and landmarks, at most", agreements, &Agreement::apart, 1,
       0.25,
       agreements.empty() ? ""
                          : "RMS " + in_short(mean(agreements, &Agreement::apart_mean), 3) + "; " +
                                std::to_string(agreements[0].keyframes) + " keyframes, " +
                                std::to_string(agreements[0].sightings) + " sightings, seed 1; NEES " +
                                in_short(mean(agreements, &Agreement::nees), 2) + ", at the minimum " +
                                in_short(mean(agreements, &Agreement::rival_nees), 2) + ", found in " +
                                in_short(mean(agreements, &Agreement::rival_seconds), 2) + " s");
  same("the same with a tenth of the noise", quiet, &Agreement::apart, 1, 0.025,
       quiet.empty() ? "" : "RMS " + in_short(mean(quiet, &Agreement::apart_mean), 4));
  same("their variances against those there, in any direction", agreements, &Agreement::variance, 100, 10,
       quiet.empty()
           ? ""
           : "with a tenth of the noise " + in_short(100 * largest(quiet, &Agreement::variance), 2) + " %");
  board.add({.name = of + "NEES of the pose",
             .measured = ours.nees,
             .unit = "of 6",
             .must = 8,
             .rival = of_rival(window.nees),
             .rival_name = name,
             .note = ours.range() + (rival ? "; the rival's " + window.range() : "")});
  board.add({.name = of + "error on the first lap, RMS",
             .measured = 1e3 * std::sqrt(ours.lap),
             .unit = "mm",
             .rival = of_rival(1e3 * std::sqrt(window.lap)),
             .rival_name = name});
  board.add({.name = of + "error on two laps, RMS",
             .measured = 1e3 * std::sqrt(ours.all),
             .unit = "mm",
             .rival = of_rival(1e3 * std::sqrt(window.all)),
             .rival_name = name});
  board.add(cairn_bench::against_rival(of + "CPU time of two laps", ours.seconds, of_rival(window.seconds),
                                       name, std::nullopt, std::nullopt));
}

}  // namespace stereo_slam_bench
