// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/eval/relations.hpp>
#include <cairn/io/carmen.hpp>

#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"

namespace relations_test {
namespace {

using namespace cairn;

std::vector<StampedPose2> drawn_path(Random& random, std::size_t count) {
  std::vector<StampedPose2> path;
  for (std::size_t i = 0; i < count; ++i)
    path.push_back({0.1 * static_cast<double>(i),
                    SE2(random.uniform(-9, 9), random.uniform(-9, 9), random.uniform(-3, 3))});
  return path;
}

}  // namespace

TEST_SUITE("eval/relations") {
  TEST_CASE("relations: a path has no error by its own relations, in any frame and order") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::vector<StampedPose2> path = drawn_path(random, 50);
    std::vector<PoseRelation> relations;
    for (std::size_t i = 0; i + 7 < path.size(); ++i)
      relations.push_back({path[i].time, path[i + 7].time, path[i].pose.inverse() * path[i + 7].pose});
    for (StampedPose2& p : path) p.pose = SE2(123.4, -56.7, 1.1) * p.pose;
    std::reverse(path.begin(), path.end());
    const RelationError error = relation_error(path, relations);
    CHECK(error.count == relations.size());
    CHECK(error.largest < 1e-12);
    CHECK(error.mean_angle < 1e-12);
  }

  TEST_CASE("relations: an error is its length and angle, and times the path does not have are counted") {
    const std::vector<StampedPose2> path{{0, SE2()}, {1, SE2(1, 0, 0)}, {2, SE2(2, 0, 0)}};
    const std::vector<PoseRelation> relations{
        {0, 1, SE2(1.3, 0.4, 0)}, {1, 2, SE2(1, 0, -0.1)}, {0, 1.5, SE2()}, {7, 1, SE2()}};
    const RelationError error = relation_error(path, relations);
    CHECK(error.count == 2);
    CHECK(error.missing == 2);
    CHECK(error.mean == doctest::Approx(0.25));
    CHECK(error.deviation == doctest::Approx(0.25));
    CHECK(error.largest == doctest::Approx(0.5));
    CHECK(error.mean_angle == doctest::Approx(0.05));
    CHECK(relation_error(path, {}).count == 0);
  }

  TEST_CASE("relations: poses without a time are as if they were not there") {
    std::vector<StampedPose2> path;
    for (int i = 0; i < 1000; ++i) {
      const double time = (i * 7919) % 1000;  // each once
      path.push_back({time, SE2(time, 0, 0)});
      if (i % 3 == 0) path.push_back({std::nan(""), SE2()});
    }
    std::vector<PoseRelation> relations;
    for (int i = 0; i + 1 < 1000; ++i) relations.push_back({i * 1.0, i + 1.0, SE2(1, 0, 0)});
    const RelationError error = relation_error(path, relations);
    CHECK(error.count == relations.size());
    CHECK(error.largest == 0);
    relations.push_back({std::nan(""), 1, SE2()});
    CHECK(relation_error(path, relations).missing == 1);
  }

  TEST_CASE("relations: poses that are not finite are refused by the relation that finds them") {
    const std::vector<PoseRelation> relations{{0, 1, SE2(1, 0, 0)}, {1, 2, SE2(1, 0, 0)}};
    std::vector<StampedPose2> path{{0, SE2()}, {1, SE2(1, 0, 0)}, {2, SE2(std::nan(""), 0, 0)}};
    CHECK_THROWS_WITH_AS((void)relation_error(path, relations), doctest::Contains("relation 1"),
                         cairn::Error);
    path[2].time = 3;  // of no relation
    CHECK(relation_error(path, relations).mean == 0);
  }

  TEST_CASE("relations: bad files are refused with the line") {
    const cairn_test::Folder folder;
    folder.put("short", "1 2 0 0 0 0 0\n");
    folder.put("nan", "# comment\n1 2 nan 0 0 0 0 0\n");
    folder.put("empty", "\n");
    const auto words = [&](const char* name) {
      return cairn_test::message_of([&] { static_cast<void>(read_relations(folder / name)); });
    };
    CHECK(words("short").find("short:1: expected 8 columns") != std::string::npos);
    CHECK(words("nan").find("nan:2: expected a finite number in column 3") != std::string::npos);
    CHECK(words("empty").find("expected relations") != std::string::npos);
    CHECK_FALSE(words("none").empty());
  }

  TEST_CASE("relations: odometry of the published logs errs by the published amounts") {
    const auto folder = cairn_test::real_data("laser_2d");
    if (!folder) return;
    struct Published {
      const char* name;
      std::size_t count;
      double mean, deviation, angle, angle_deviation;
    };
    for (const Published& p : {Published{"aces", 1279, 0.5493, 2.6744, 2.328, 6.503},
                               Published{"intel", 2984, 7.3702, 14.3491, 39.166, 53.791},
                               Published{"fr079", 1685, 6.5072, 13.6571, 30.292, 45.520}}) {
      const cairn_test::Folder unpacked;
      const std::string log = (unpacked / "log").string();
      const std::string command =
          "bzip2 -dc \"" + (*folder / (std::string(p.name) + ".clf.bz2")).string() + "\" >\"" + log + "\"";
      if (std::system(command.c_str()) != 0) {  // NOLINT(cert-env33-c): our own command
        MESSAGE("skipped: no bzip2");
        return;
      }
      std::vector<StampedPose2> path;
      for (const StampedScan& scan : read_carmen(log).scans) path.push_back({scan.time, scan.T_odom_laser});
      const RelationError error =
          relation_error(path, read_relations(*folder / (std::string(p.name) + ".relations")));
      constexpr double degrees = 180 / std::numbers::pi;
      CHECK(error.count == p.count);
      CHECK(error.missing == 0);
      CHECK(std::abs(error.mean - p.mean) < 6e-5);
      CHECK(std::abs(error.deviation - p.deviation) < 6e-5);
      CHECK(std::abs(error.mean_angle * degrees - p.angle) < 6e-4);
      CHECK(std::abs(error.angle_deviation * degrees - p.angle_deviation) < 6e-4);
    }
  }
}

}  // namespace relations_test
