// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "scan_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <numbers>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/io/carmen.hpp>

#include "floor_plan.hpp"
#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"

namespace scan_checks_test {
namespace {

using cairn::BeamKind;
using grid_slam::check_scans;

/// A rendered drive, every reading changed.
template <class Change>
cairn::CarmenLog drive_with(Change change) {
  cairn::CarmenLog log = grid_slam::simulated_drive({.seed = 3}).log;
  for (cairn::StampedScan& each : log.scans)
    for (float& r : each.scan.range) r = change(r);
  return log;
}

bool has_hit_from(const cairn::CarmenLog& log, double range) {
  return std::ranges::any_of(log.scans, [&](const cairn::StampedScan& each) {
    for (std::size_t i = 0; i < each.scan.size(); ++i)
      if (each.scan.kind(i) == BeamKind::hit && static_cast<double>(each.scan.range[i]) >= range) return true;
    return false;
  });
}

}  // namespace

TEST_SUITE("grid_slam/scan_checks") {
  TEST_CASE("grid_slam: a largest reading that is met all along the way is no wall") {
    cairn::CarmenLog log = drive_with([](float r) { return std::min(r, 4.0F); });
    REQUIRE(has_hit_from(log, 4));
    const std::vector<std::string> notes = check_scans(log, "log");
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].find("readings of 4 m and more") == 0);
    CHECK_FALSE(has_hit_from(log, 4));
    CHECK(has_hit_from(log, 3.9));
    // Several readings that say what went wrong, close together.
    cairn::CarmenLog codes = drive_with([n = 0](float r) mutable {
      return r < 4 ? r : ++n % 3 == 0 ? 4.19F : n % 3 == 1 ? 4.187F : 4.183F;
    });
    CHECK(check_scans(codes, "log").size() == 1);
    CHECK_FALSE(has_hit_from(codes, 4));
  }

  TEST_CASE("grid_slam: readings that are all 0 are invalid, not no return") {
    cairn::CarmenLog log = drive_with([](float) { return 0.0F; });
    const double farthest = log.scans[0].scan.farthest;
    const std::vector<std::string> notes = check_scans(log, "log");
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].find("no reading is as much as 0.05 m: all are invalid") == 0);
    CHECK(log.scans[0].scan.farthest == farthest);
  }

  TEST_CASE("grid_slam: scans of a scanner that sees far enough stay what they are") {
    cairn::CarmenLog log = drive_with([](float r) { return r; });
    const double farthest = log.scans[0].scan.farthest;
    CHECK(check_scans(log, "log").empty());
    CHECK(log.scans[0].scan.farthest == farthest);
    // A robot that stands sees the same wall for ever.
    cairn::CarmenLog standing = log;
    standing.scans.resize(400, standing.scans[0]);
    std::ranges::fill(standing.scans, standing.scans[0]);
    CHECK(check_scans(standing, "log").empty());
    const auto data = cairn_test::real_data("laser_2d");
    if (!data) return;
    const cairn_test::Folder folder;
    for (const std::string name : {"aces", "intel", "fr079"}) {
      CAPTURE(name);
      const std::string unpack = "bzip2 -dc \"" + (*data / (name + ".clf.bz2")).string() + "\" >\"" +
                                 (folder / "log").string() + "\"";
      if (std::system(unpack.c_str()) != 0) {  // NOLINT(cert-env33-c): our own command
        MESSAGE("skipped: no bzip2");
        return;
      }
      cairn::CarmenLog real = cairn::read_carmen(folder / "log");
      CHECK(check_scans(real, name).empty());
    }
  }

  TEST_CASE("grid_slam: scans that turn against odometry are refused, ranges that are no metres are said") {
    cairn::CarmenLog mirrored = drive_with([](float r) { return r; });
    for (cairn::StampedScan& each : mirrored.scans) std::ranges::reverse(each.scan.range);
    const std::string refusal =
        cairn_test::message_of([&] { static_cast<void>(check_scans(mirrored, "log")); });
    CHECK(refusal.find("log: expected beams that run counter-clockwise") == 0);
    cairn::CarmenLog centimetres = drive_with([](float r) { return 100 * r; });
    centimetres.scans[0].scan.range[0] = 1;
    const std::vector<std::string> notes = check_scans(centimetres, "log");
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].find("are the ranges metres?") != std::string::npos);
  }

  TEST_CASE("grid_slam: headings in degrees are refused, with what to do") {
    cairn::CarmenLog log = drive_with([](float r) { return r; });
    for (cairn::StampedScan& each : log.scans) {
      const cairn::SE2& pose = each.T_odom_laser;
      each.T_odom_laser = cairn::SE2(pose.x(), pose.y(), pose.angle() * 180 / std::numbers::pi);
    }
    const std::string refusal = cairn_test::message_of([&] { static_cast<void>(check_scans(log, "log")); });
    CHECK(refusal.find("log: expected headings in radians") == 0);
    CHECK(refusal.find("pi / 180") != std::string::npos);
  }

  TEST_CASE("grid_slam: beams that see more than half a turn are put where scans turn as odometry does") {
    const grid_slam::Drive drive = grid_slam::simulated_drive({.seed = 3});
    for (const double degrees : {180, 240, 270, 360}) {
      CAPTURE(degrees);
      const double view = degrees * std::numbers::pi / 180;
      constexpr std::size_t beams = 361;
      cairn::CarmenLog log = drive.log;
      for (std::size_t k = 0; k < log.scans.size(); ++k) {
        std::vector<float>& range = log.scans[k].scan.range;
        range.clear();
        for (std::size_t i = 0; i < beams; ++i) {
          const double angle = view * (static_cast<double>(i) / (beams - 1) - 0.5);
          const cairn::SE2& at = drive.truth[k];
          range.push_back(
              static_cast<float>(grid_slam::range_to_wall(drive.walls, at.x(), at.y(), at.angle() + angle)));
        }
        log.scans[k].scan.angle_step = std::numbers::pi / (beams - 1);  // as a line FLASER is read
      }
      const std::vector<std::string> notes = check_scans(log, "log");
      CHECK(notes.size() == (degrees > 180 ? 1 : 0));
      CHECK(log.scans[0].scan.first_angle == doctest::Approx(-view / 2));
      CHECK(log.scans[0].scan.angle(beams - 1) == doctest::Approx(view / 2));
    }
  }

  TEST_CASE("grid_slam: readings that nothing confirms are left out where there are many, and no others") {
    cairn::Random random(cairn_test::seed());
    std::vector<bool> wrong;
    cairn::CarmenLog log = drive_with([&](float r) {
      wrong.push_back(random.uniform() < 0.1);
      return wrong.back() ? static_cast<float>(r * random.uniform(0.1, 1)) : r;
    });
    const std::vector<std::string> notes = check_scans(log, "log");
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].find("they are left out") != std::string::npos);
    double spoilt = 0, found = 0, right = 0, lost = 0;
    std::size_t next = 0;
    for (const cairn::StampedScan& each : log.scans)
      for (std::size_t i = 0; i < each.scan.size(); ++i) {
        const double out = each.scan.kind(i) == BeamKind::invalid ? 1 : 0;
        (wrong[next] ? spoilt : right) += 1;
        (wrong[next++] ? found : lost) += out;
      }
    CHECK(found > 0.6 * spoilt);  // the others end near a wall
    CHECK(lost < 0.01 * right);
  }
}

}  // namespace scan_checks_test
