// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/trajectory.hpp>

#include "examples/synthetic_run.hpp"
#include "support/folder.hpp"
#include "support/report.hpp"

namespace fs = std::filesystem;
using cairn_test::Folder;
using cairn_test::message_of;

namespace outputs_test {
namespace {

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

std::set<std::string> expected_names() {
  std::set<std::string> names{"map.ply",          "summary.json",   "timing.json",
                              "trajectory.kitti", "trajectory.tum", "trajectory_covariance.csv"};
  if (example::has_report_page()) names.insert("report.html");
  return names;
}

template <class Value>
Value take(const std::string& bytes, std::size_t& at) {
  Value value;
  REQUIRE(at + sizeof value <= bytes.size());
  std::memcpy(&value, bytes.data() + at, sizeof value);
  at += sizeof value;
  return value;
}

}  // namespace

TEST_SUITE_BEGIN("stereo_slam/outputs");

TEST_CASE("outputs: every file is there and nothing else") {
  const Folder folder;
  const auto why = stereo_slam::write_outputs(cairn_test::circular_run(50, 100), folder / "new" / "out");
  CHECK(why.has_value() != example::has_report_page());
  CHECK(names_in(folder / "new" / "out") == expected_names());
  const auto json = nlohmann::json::parse(cairn::read_file(folder / "new" / "out" / "summary.json"));
  CHECK(json["frames"] == 50);
}

TEST_CASE("outputs: the trajectories read back as they were") {
  const Folder folder;
  const auto run = cairn_test::circular_run(40, 0);
  (void)stereo_slam::write_outputs(run, folder.path());
  const cairn::Trajectory tum = cairn::read_tum(folder / "trajectory.tum");
  const cairn::Trajectory kitti = cairn::read_kitti(folder / "trajectory.kitti");
  REQUIRE(tum.size() == 40);
  REQUIRE(kitti.size() == 40);
  for (std::size_t i = 0; i < 40; ++i) {
    CHECK(tum[i].time == run.frames[i].time);
    const cairn::SE3& expected = run.frames[i].T_world_camera;
    CHECK((expected.inverse() * tum[i].T_world_body).log().norm() < 1e-12);
    CHECK((expected.inverse() * kitti[i].T_world_body).log().norm() < 1e-12);
  }
}

TEST_CASE("outputs: the covariances are there row by row, the upper triangle") {
  const Folder folder;
  auto run = cairn_test::straight_run(3);
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) run.frames[1].covariance(i, j) = 0.5 * std::min(i, j) + 10 * std::max(i, j);
  run.frames[2].tracked = false;
  stereo_slam::write_covariances(folder / "c.csv", run.frames);
  const std::string text = cairn::read_file(folder / "c.csv");
  CHECK(text.starts_with("frame,time,tracked,x_x,x_y,x_z,x_rx,x_ry,x_rz,y_y,"));
  CHECK(text.find(",rz_rz\n0,0,1,1e-04,0,0,0,0,0,1e-04,") != std::string::npos);
  CHECK(text.find(
            "\n1,0.1,1,0,10,20,30,40,50,10.5,20.5,30.5,40.5,50.5,21,31,41,51,31.5,41.5,51.5,42,52,52.5\n") !=
        std::string::npos);
  CHECK(text.find("\n2,0.2,0,") != std::string::npos);
  CHECK(std::count(text.begin(), text.end(), '\n') == 4);
}

TEST_CASE("outputs: the map reads back with every property of every landmark") {
  const Folder folder;
  stereo_slam::LandmarkRecord first, second;
  first.position = {1, -2, 3.5};
  first.covariance = cairn::Vector<3>(0.01, 0.04, 0.0025).asDiagonal();
  first.grey = 200;
  first.age = 12;
  first.sightings = 5;
  second.position = {-7, 0, 0.25};
  second.covariance << 1, -0.5, 0, -0.5, 1, 0, 0, 0, 0.1;  // largest variance 1.5, across the axes
  second.grey = 3;
  stereo_slam::write_map(folder / "map.ply", {first, second});

  const std::string bytes = cairn::read_file(folder / "map.ply");
  const std::string end = "end_header\n";
  std::size_t at = bytes.find(end);
  REQUIRE(at != std::string::npos);
  const std::string header = bytes.substr(0, at);
  CHECK(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
  CHECK(header.find("element vertex 2\n") != std::string::npos);
  CHECK(header.find("property float x\nproperty float y\nproperty float z\nproperty uchar grey\n"
                    "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float sigma\n"
                    "property int age\nproperty int sightings\n") != std::string::npos);
  at += end.size();
  for (const auto& landmark : {first, second}) {
    for (int axis = 0; axis < 3; ++axis)
      CHECK(take<float>(bytes, at) == static_cast<float>(landmark.position(axis)));
    for (int colour = 0; colour < 4; ++colour) CHECK(take<std::uint8_t>(bytes, at) == landmark.grey);
    CHECK(take<float>(bytes, at) == doctest::Approx(landmark.grey == 3 ? std::sqrt(1.5) : 0.2));
    CHECK(take<std::int32_t>(bytes, at) == landmark.age);
    CHECK(take<std::int32_t>(bytes, at) == landmark.sightings);
  }
  CHECK(at == bytes.size());
}

TEST_CASE("outputs: a second run replaces the first") {
  const Folder folder;
  (void)stereo_slam::write_outputs(cairn_test::straight_run(5), folder.path());
  (void)stereo_slam::write_outputs(cairn_test::straight_run(9), folder.path());
  CHECK(cairn::read_tum(folder / "trajectory.tum").size() == 9);
  CHECK(names_in(folder.path()) == expected_names());
}

TEST_CASE("outputs: the same run gives the same bytes, whatever time it took and on how many threads") {
  const Folder one, other;
  auto run = cairn_test::circular_run(30, 50);
  (void)stereo_slam::write_outputs(run, one.path());
  (void)stereo_slam::write_outputs(run, other.path());
  for (const std::string& name : expected_names())
    CHECK(cairn::read_file(one / name) == cairn::read_file(other / name));
  run.seconds *= 1.5;
  run.threads += 1;
  for (auto& frame : run.frames) frame.milliseconds.fill(1.25);
  (void)stereo_slam::write_outputs(run, other.path());
  for (const std::string& name : expected_names()) {
    CAPTURE(name);
    CHECK((cairn::read_file(one / name) == cairn::read_file(other / name)) == (name != "timing.json"));
  }
}

TEST_CASE("outputs: a landmark that is not finite is left out of the map, which says so") {
  const Folder folder;
  std::vector<stereo_slam::LandmarkRecord> landmarks(4);
  for (auto& landmark : landmarks) {
    landmark.position.setZero();
    landmark.covariance.setIdentity();
  }
  landmarks[1].position(2) = std::numeric_limits<double>::quiet_NaN();
  landmarks[2].covariance(0, 1) = std::numeric_limits<double>::infinity();
  landmarks[3].position(0) = 1e300;  // beyond a float
  stereo_slam::write_map(folder / "map.ply", landmarks);
  const std::string bytes = cairn::read_file(folder / "map.ply");
  CHECK(bytes.find("element vertex 1\n") != std::string::npos);
  CHECK(bytes.find("comment left out, with numbers that are not finite: 3\n") != std::string::npos);
}

TEST_CASE("outputs: a folder that cannot be made is named, and nothing is left") {
  const Folder folder;
  folder.put("file", "in the way");
  for (const fs::path& impossible : {folder / "file", folder / "file" / "out"}) {
    const std::string message =
        message_of([&] { (void)stereo_slam::write_outputs(cairn_test::straight_run(3), impossible); });
    CAPTURE(message);
    CHECK(message.find(impossible.string()) != std::string::npos);
    CHECK(message.find("expected a writable folder") != std::string::npos);
    CHECK(message_of([&] { stereo_slam::prepare_output_folder(impossible); }) == message);
  }
  CHECK(names_in(folder.path()) == std::set<std::string>{"file"});
}

TEST_CASE("outputs: when one file is in the way of a folder none is written") {
  const Folder folder;
  fs::create_directories(folder / "summary.json" / "inside");
  const std::string message =
      message_of([&] { (void)stereo_slam::write_outputs(cairn_test::straight_run(3), folder.path()); });
  CAPTURE(message);
  CHECK(message.find((folder / "summary.json").string()) != std::string::npos);
  CHECK(names_in(folder.path()) == std::set<std::string>{"summary.json"});
}

TEST_SUITE_END();

}  // namespace outputs_test
