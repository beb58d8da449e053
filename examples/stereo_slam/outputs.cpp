// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <system_error>
#include <vector>

#include <Eigen/Eigenvalues>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/ply.hpp>
#include <cairn/io/trajectory.hpp>

#include "../support/report.hpp"
#include "run_report.hpp"
#include "summary.hpp"

namespace stereo_slam {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse_folder(const fs::path& folder, const std::string& why) {
  cairn::raise(folder.string() + ": cannot write there (" + why + "); expected a writable folder");
}

/// A fresh folder inside another one, removed with what is left in it.
class StagingFolder {
public:
  explicit StagingFolder(const fs::path& parent)
      : path_(cairn::detail::temporary_beside(parent / "outputs")) {
    std::error_code failure;
    fs::create_directory(path_, failure);
    if (failure) refuse_folder(parent, failure.message());
  }
  ~StagingFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  StagingFolder(const StagingFolder&) = delete;
  StagingFolder& operator=(const StagingFolder&) = delete;

  [[nodiscard]] fs::path operator/(const char* name) const { return path_ / name; }

  /// What would keep deliver() from its work: nothing is delivered unless everything can be.
  void expect_deliverable(const char* name) const {
    const fs::path target = path_.parent_path() / name;
    std::error_code ignored;
    if (fs::is_directory(target, ignored))
      cairn::raise(target.string() + ": is a folder; expected a file or nothing");
  }

  /// Moves the file out into the folder above, over an older one of that name.
  void deliver(const char* name) const {
    std::error_code failure;
    fs::rename(path_ / name, path_.parent_path() / name, failure);
    if (failure) refuse_folder(path_.parent_path() / name, failure.message());
  }

private:
  fs::path path_;
};

cairn::Trajectory trajectory_of(const RunRecord& run) {
  cairn::Trajectory trajectory;
  for (const FrameRecord& frame : run.frames) trajectory.push_back({frame.time, frame.T_world_camera});
  return trajectory;
}

/// Root of the largest eigenvalue of a covariance; 0 where it is not finite.
double largest_sigma(const cairn::Matrix<3, 3>& covariance) {
  if (!covariance.allFinite()) return 0;
  const Eigen::SelfAdjointEigenSolver<cairn::Matrix<3, 3>> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()(2)));
}

}  // namespace

void prepare_output_folder(const fs::path& folder) {
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (failure) refuse_folder(folder, failure.message());
  if (!fs::is_directory(folder)) refuse_folder(folder, "not a folder");
  const StagingFolder proof(folder);
}

void write_map(const fs::path& path, const std::vector<LandmarkRecord>& landmarks) {
  std::array<std::vector<float>, 3> position;
  std::vector<std::uint8_t> grey;
  std::vector<float> sigma;
  std::vector<std::int32_t> age, sightings;
  for (const LandmarkRecord& landmark : landmarks) {
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
  const std::vector<std::string> comments{
      "landmarks in metres, x right, y down, z ahead of the first camera"};
  cairn::write_ply(path, properties, comments);
}

std::optional<std::string> write_outputs(const RunRecord& run, const fs::path& folder) {
  const Summary summary = summarise(run);
  prepare_output_folder(folder);
  const StagingFolder staging(folder);
  const cairn::Trajectory trajectory = trajectory_of(run);
  cairn::write_tum(staging / "trajectory.tum", trajectory);
  cairn::write_kitti(staging / "trajectory.kitti", trajectory);
  write_map(staging / "map.ply", run.landmarks);
  cairn::write_file_atomically(staging / "summary.json", summary_json(run, summary));
  const std::optional<std::string> page = run_report(run, summary).html();
  if (page) cairn::write_file_atomically(staging / "report.html", *page);

  std::vector<const char*> finished{"trajectory.tum", "trajectory.kitti", "map.ply", "summary.json"};
  if (page) finished.push_back("report.html");
  for (const char* name : finished) staging.expect_deliverable(name);
  for (const char* name : finished) staging.deliver(name);
  if (page) return std::nullopt;
  std::error_code ignored;
  fs::remove(folder / "report.html", ignored);  // it would show another run
  return example::why_no_report();
}

}  // namespace stereo_slam
