// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/alignment.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/triangulation.hpp>

#include "geometry_rivals.hpp"
#include "rows.hpp"
#include "support/data.hpp"
#include "support/rigs.hpp"
#include "support/stereo_tracks.hpp"

namespace {

using cairn::SE3;
using cairn::StereoMatch;
using cairn::Vector;
using cairn_bench::Row;
using cairn_bench::Scoreboard;

constexpr double degree = M_PI / 180;

std::string text(const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

void add_tracks(Scoreboard& board) {
  const auto folder = cairn_test::real_data("stereo_tracks_kitti00");
  const bool known = folder && cairn_test::real_data("trajectories");
  std::optional<cairn_test::TrackError> steps, map;
  if (known) {
    const cairn_test::StereoTracks tracks = cairn_test::read_stereo_tracks(folder->parent_path());
    steps = cairn_test::run_stereo_tracks(tracks, false);
    map = cairn_test::run_stereo_tracks(tracks, true);
  }
  const auto row = [&](const char* name, const std::optional<cairn_test::TrackError>& error,
                       double cairn_test::TrackError::* figure, const char* unit, double must, double aim) {
    Row result{.name = name, .unit = unit, .must = must, .aim = aim};
    if (error && error->lost == 0) result.measured = (*error).*figure;
    result.note = !error            ? "no data"
                  : error->lost > 0 ? std::to_string(error->lost) + " frames lost"
                                    : "end " + text("%.2f m off after 70 m", error->end_metres);
    board.add(result);
  };
  using Error = cairn_test::TrackError;
  row("KITTI 00 frame to frame, translation", steps, &Error::metres, "m", 0.0125, 0.0115);
  row("KITTI 00 frame to frame, rotation", steps, &Error::degrees, "deg", 0.035, 0.034);
  row("KITTI 00 against fused landmarks", map, &Error::metres, "m", 0.0110, 0.0105);
}

/// Rms errors in the simulated room of anything that makes a pose of matches.
struct RoomError {
  double metres = 0, degrees = 0;
  int lost = 0;
};

template <class Solve>
RoomError room(double outliers, int runs, const Solve& solve) {
  const cairn::StereoRig rig = cairn_test::rectified_rig();
  cairn::Random random(7);
  RoomError result;
  for (int run = 0; run < runs; ++run) {
    const SE3 T = cairn_test::random_pose(random);
    const auto matches = cairn_test::random_matches(rig, T, {.outliers = outliers}, random);
    const std::optional<SE3> pose = solve(rig, matches);
    if (!pose) {
      ++result.lost;
      continue;
    }
    const Vector<6> error = cairn::local(T, *pose);
    result.metres += error.head<3>().squaredNorm();
    result.degrees += error.tail<3>().squaredNorm();
  }
  const int good = std::max(1, runs - result.lost);
  result.metres = std::sqrt(result.metres / good);
  result.degrees = std::sqrt(result.degrees / good) / degree;
  return result;
}

std::optional<SE3> ours(const cairn::StereoRig& rig, std::span<const StereoMatch> matches) {
  const cairn::StereoPose pose = cairn::estimate_stereo_pose(rig, matches);
  return pose.good() ? std::optional<SE3>(pose.T_world_camera) : std::nullopt;
}

/// The most accurate rival in the room.
struct Best {
  std::string name;
  RoomError error;
};

std::optional<Best> best_rival(double outliers, int runs) {
  std::optional<Best> best;
  for (const rivals::PoseRival& rival : rivals::pose_rivals()) {
    const RoomError error = room(outliers, runs, rival.solve);
    if (!best || error.metres < best->error.metres) best = Best{rival.name, error};
  }
  return best;
}

void add_room(Scoreboard& board) {
  constexpr int runs = 200;
  const auto row = [&](const std::string& name, double measured, const char* unit, double must,
                       std::optional<double> aim, const std::optional<Best>& rival, double rival_figure,
                       int lost) {
    Row result{.name = name, .measured = measured, .unit = unit, .must = must, .aim = aim};
    if (rival) {
      result.rival = rival_figure;
      result.rival_name = rival->name;
    }
    result.note = std::to_string(lost) + " of " + std::to_string(runs) + " lost";
    board.add(result);
  };
  const RoomError clean = room(0, runs, ours), wrong = room(0.3, runs, ours);
  const auto clean_rival = best_rival(0, runs), wrong_rival = best_rival(0.3, runs);
  row("room, 150 points, 0.5 px, translation", 1e3 * clean.metres, "mm", 1, 0.85, clean_rival,
      clean_rival ? 1e3 * clean_rival->error.metres : 0, clean.lost);
  row("room, 150 points, 0.5 px, rotation", clean.degrees, "deg", 0.02, std::nullopt, clean_rival,
      clean_rival ? clean_rival->error.degrees : 0, clean.lost);
  row("room with 30 % outliers, translation", 1e3 * wrong.metres, "mm", 4, 2, wrong_rival,
      wrong_rival ? 1e3 * wrong_rival->error.metres : 0, wrong.lost);
}

void add_consistency(Scoreboard& board) {
  const cairn::StereoRig rig = cairn_test::rectified_rig();
  cairn::Random random(11);
  constexpr int runs = 100;
  double nees = 0;
  int lost = 0;
  for (int run = 0; run < runs; ++run) {
    const SE3 T = cairn_test::random_pose(random);
    const auto matches =
        cairn_test::random_matches(rig, T, {.landmark_sigma = 0.01, .outliers = 0.3}, random);
    const cairn::StereoPose pose = cairn::estimate_stereo_pose(rig, matches);
    lost += !pose.good();
    const Vector<6> error = cairn::local(T, pose.T_world_camera);
    nees += error.dot(pose.information * error) / runs;
  }
  const auto band = cairn::chi_square_mean_band(6, runs);
  Row row{.name = "pose covariance, mean 6-dof NEES of 100 runs, distance from 6",
          .unit = "",
          .must = nees < 6 ? 6 - band.low : band.high - 6};
  if (lost == 0) row.measured = std::abs(nees - 6);
  row.note = text("NEES %.2f", nees) + text(", 95 %% band %.2f", band.low) + text(" to %.2f", band.high);
  board.add(row);
}

void add_time(Scoreboard& board) {
  const cairn::StereoRig rig = cairn_test::rectified_rig();
  cairn::Random random(5);
  std::vector<std::vector<StereoMatch>> scenes;
  for (int i = 0; i < 10; ++i)
    scenes.push_back(cairn_test::random_matches(rig, cairn_test::random_pose(random),
                                                {.matches = 500, .landmark_sigma = 0.005, .outliers = 0.3},
                                                random));
  const auto contender = [&](const std::string& name, auto solve) {
    return cairn_bench::Contender{name,
                                  [&scenes, &rig, solve] {
                                    for (const auto& matches : scenes)
                                      cairn_bench::do_not_optimise(solve(rig, matches));
                                  },
                                  static_cast<double>(scenes.size())};
  };
  std::vector<cairn_bench::Contender> contenders{contender("cairn", &ours)};
  for (const rivals::PoseRival& rival : rivals::pose_rivals())
    contenders.push_back(contender(rival.name, rival.solve));
  const auto timings = cairn_bench::interleave(contenders);
  Row row{.name = "full robust pose, 500 matches, 30 % outliers",
          .measured = 1e3 * timings[0].fastest,
          .unit = "ms",
          .must = 2,
          .aim = 0.5};
  row.note = text("fastest round; median %.3f ms", 1e3 * timings[0].median);
  for (std::size_t i = 1; i < timings.size(); ++i)
    if (!row.rival || 1e3 * timings[i].fastest < *row.rival) {
      row.rival = 1e3 * timings[i].fastest;
      row.rival_name = timings[i].name;
    }
  board.add(row);
}

void add_alignment(Scoreboard& board) {
  cairn::Random random(3);
  std::vector<Vector<3>> source(500), target;
  const SE3 T = cairn_test::random_pose(random);
  for (Vector<3>& p : source) {
    p = Vector<3>(random.normal(), random.normal(), random.normal());
    target.push_back(T * p);
  }
  const cairn::Matrix<4> answer = cairn::align_points(source, target).T_target_source.matrix();
  const std::vector<rivals::AlignmentRival> all = rivals::alignment_rivals(source, target);
  std::vector<cairn_bench::Contender> contenders{
      {"cairn", [&] { cairn_bench::do_not_optimise(cairn::align_points(source, target).rms); }, 1}};
  for (const rivals::AlignmentRival& rival : all)
    contenders.push_back({rival.name, [&] { cairn_bench::do_not_optimise(rival.solve()(0, 0)); }, 1});
  const auto timings = cairn_bench::interleave(contenders);
  for (std::size_t i = 0; i < all.size(); ++i) {
    Row row = cairn_bench::against_rival("alignment of 500 points, with covariance, against " + all[i].name,
                                         1e6 * timings[0].median, 1e6 * timings[i + 1].median, all[i].name,
                                         std::nullopt, std::nullopt, "us");
    row.note += text(", answers differ by %.1e", (all[i].solve() - answer).norm());
    board.add(row);
  }
}

void add_triangulation(Scoreboard& board) {
  const cairn::StereoRig rig = cairn_test::unrectified_rig();
  cairn::Random random(3);
  std::vector<Vector<4>> pairs(500);
  for (Vector<4>& pixels : pairs) pixels = *rig.project(cairn_test::visible_point(rig, random, 2, 30));
  const cairn::Triangulator triangulator(rig);
  const auto timings =
      cairn_bench::interleave({{"cairn",
                                [&] {
                                  for (const Vector<4>& x : pairs)
                                    cairn_bench::do_not_optimise(triangulator(x.head<2>(), x.tail<2>()));
                                },
                                500}});
  board.add({.name = "triangulation, distorted rig, with covariance",
             .measured = 1e6 * timings[0].median,
             .unit = "us"});
}

}  // namespace

void add_geometry_rows(Scoreboard& board) {
  add_tracks(board);
  add_room(board);
  add_consistency(board);
  add_time(board);
  add_alignment(board);
  add_triangulation(board);
}
