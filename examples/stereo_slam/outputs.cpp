// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Eigenvalues>

#include <cairn/geometry/rig_correction.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/ply.hpp>
#include <cairn/io/text.hpp>
#include <cairn/io/trajectory.hpp>

#include "../support/report.hpp"
#include "../support/result_folder.hpp"
#include "run_report.hpp"
#include "summary.hpp"

namespace stereo_slam {
namespace {

namespace fs = std::filesystem;

example::ResultFolder results_in(const fs::path& folder) {
  return {folder,
          {"trajectory.tum", "trajectory.kitti", "trajectory_covariance.csv", "map.ply", "summary.json",
           "timing.json", "report.html"}};
}

cairn::Trajectory trajectory_of(const RunRecord& run) {
  cairn::Trajectory trajectory;
  for (const FrameRecord& frame : run.frames) trajectory.push_back({frame.time, frame.T_world_camera});
  return trajectory;
}

/// Root of the largest eigenvalue of a finite covariance.
double largest_sigma(const cairn::Matrix<3, 3>& covariance) {
  const Eigen::SelfAdjointEigenSolver<cairn::Matrix<3, 3>> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()(2)));
}

}  // namespace

void prepare_output_folder(const fs::path& folder, const std::vector<std::filesystem::path>& besides) {
  results_in(folder).prepare(besides);
}

example::CalibratedRig learned_rig(const example::CalibratedRig& given, const RunRecord& run) {
  example::CalibratedRig learned = given;
  learned.rig = run.rig;
  const std::string of = run.dataset + ", " + std::to_string(run.frames.size()) + " frames";
  learned.note = (run.calibration.on ? "learned from " : "as it was given: not corrected with ") + of;
  if (!run.calibration.on) return learned;
  const cairn::RigState& sigmas = run.calibration.sigmas;
  const cairn::RigCorrection correction(given.rig);
  const cairn::Vector<3> along = correction.direction(cairn::Vector<5>::Zero());
  const cairn::Matrix<3, 2> turned = correction.direction_jacobian();
  learned.rotation_sigma = sigmas.head<3>();
  learned.translation_sigma = cairn::Vector<3>::Zero();
  for (int i = 0; i < 3; ++i)
    (*learned.translation_sigma)(i) =
        given.rig.baseline() *
        std::hypot(turned(i, 0) * sigmas(3), turned(i, 1) * sigmas(4), along(i) * sigmas(5));
  if (!(sigmas.tail<6>().minCoeff() > 0)) return learned;  // the cameras' own numbers were not estimated
  const auto of_camera = [](const cairn::PinholeCamera& camera, double focal, double x, double y) {
    const cairn::PinholeParameters& p = camera.parameters();
    return std::array<double, 4>{p.fx * focal, p.fy * focal, p.fx * x, p.fy * y};
  };
  learned.left.intrinsics = of_camera(run.rig.left, sigmas(6), sigmas(8), sigmas(9));
  learned.right.intrinsics = of_camera(run.rig.right, std::hypot(sigmas(6), sigmas(7)),
                                       std::hypot(sigmas(8), sigmas(10)), std::hypot(sigmas(9), sigmas(11)));
  return learned;
}

void write_covariances(const fs::path& path, const std::vector<FrameRecord>& frames) {
  constexpr std::array<const char*, 6> names{"x", "y", "z", "rx", "ry", "rz"};
  std::string text = "frame,time,tracked";
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = i; j < 6; ++j) text += std::string(",") + names[i] + "_" + names[j];
  text += '\n';
  for (const FrameRecord& frame : frames) {
    cairn::append_number(text, frame.index);
    text += ',';
    cairn::append_number(text, frame.time);
    text += frame.tracked ? ",1" : ",0";
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) {
        text += ',';
        cairn::append_number(text, frame.covariance(i, j));
      }
    text += '\n';
  }
  cairn::write_file_atomically(path, text);
}

void write_map(const fs::path& path, const std::vector<LandmarkRecord>& landmarks) {
  std::array<std::vector<float>, 3> position;
  std::vector<std::uint8_t> grey;
  std::vector<float> sigma;
  std::vector<std::int32_t> age, sightings;
  std::size_t left_out = 0;
  for (const LandmarkRecord& landmark : landmarks) {
    if (!landmark.position.cast<float>().allFinite() || !landmark.covariance.cast<float>().allFinite()) {
      ++left_out;
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis)
      position[axis].push_back(static_cast<float>(landmark.position(static_cast<int>(axis))));
    grey.push_back(landmark.grey);
    sigma.push_back(static_cast<float>(largest_sigma(landmark.covariance)));
    age.push_back(landmark.age);
    sightings.push_back(landmark.sightings);
  }
  const std::vector<cairn::PlyProperty> properties{
      {"x", std::span<const float>(position[0])},    {"y", std::span<const float>(position[1])},
      {"z", std::span<const float>(position[2])},    {"grey", std::span<const std::uint8_t>(grey)},
      {"red", std::span<const std::uint8_t>(grey)},  {"green", std::span<const std::uint8_t>(grey)},
      {"blue", std::span<const std::uint8_t>(grey)}, {"sigma", std::span<const float>(sigma)},
      {"age", std::span<const std::int32_t>(age)},   {"sightings", std::span<const std::int32_t>(sightings)}};
  std::vector<std::string> comments{"landmarks in metres, x right, y down, z ahead of the first camera"};
  if (left_out > 0)
    comments.push_back("left out, with numbers that are not finite: " + std::to_string(left_out));
  cairn::write_ply(path, properties, comments);
}

std::optional<std::string> write_outputs(const RunRecord& run, const fs::path& folder) {
  const Summary summary = summarise(run);
  const std::optional<std::string> page = run_report(run, summary).html();
  results_in(folder).replace([&](const fs::path& staging) {
    const cairn::Trajectory trajectory = trajectory_of(run);
    cairn::write_tum(staging / "trajectory.tum", trajectory);
    cairn::write_kitti(staging / "trajectory.kitti", trajectory);
    write_covariances(staging / "trajectory_covariance.csv", run.frames);
    write_map(staging / "map.ply", run.landmarks);
    cairn::write_file_atomically(staging / "summary.json", summary_json(run, summary));
    cairn::write_file_atomically(staging / "timing.json", timing_json(run));
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace stereo_slam
