// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <numbers>
#include <string>

#include <doctest/doctest.h>

#include <cairn/io/carmen.hpp>

#include "support/folder.hpp"

namespace carmen_test {
namespace {

using namespace cairn;

constexpr const char* front = "FLASER 4 1.5 2 50 0.01 1 2 0.5 1.1 2.1 0.6 10.5 host 0.1\n";
constexpr const char* robot =
    "ROBOTLASER1 0 -1 2 0.5 30 0.01 0 3 1 2 40 1 9 1 2 0.5 1.1 2.1 0.6 0 0 0 0 0 11.5 host 0.2\n";
constexpr const char* wheels = "ODOM 1 2 0.5 0 0 0 9.5 host 0.1\n";

std::string words_of(const std::string& text) {
  const cairn_test::Folder folder;
  folder.put("log", text);
  return cairn_test::message_of([&] { static_cast<void>(read_carmen(folder / "log")); });
}

CarmenLog read(const std::string& text) {
  const cairn_test::Folder folder;
  folder.put("log", text);
  return read_carmen(folder / "log");
}

}  // namespace

TEST_SUITE("io/carmen") {
  TEST_CASE("carmen: FLASER, ROBOTLASER1 and ODOM say what their fields say") {
    const CarmenLog log = read(std::string("# a comment\nPARAM a b c\n") + front + robot + wheels);
    REQUIRE(log.scans.size() == 2);
    REQUIRE(log.odometry.size() == 1);
    const StampedScan& a = log.scans[0];
    CHECK(a.time == 10.5);
    CHECK(a.line == 3);
    CHECK(log.scans[1].line == 4);
    CHECK(a.T_odom_laser.x() == 1);
    CHECK(a.T_odom_robot.angle() == 0.6);
    CHECK(a.scan.angle(0) == doctest::Approx(-std::numbers::pi / 2));
    CHECK(a.scan.angle(3) ==
          doctest::Approx(std::numbers::pi / 4));  // the last of an even number is left out
    CHECK(a.scan.kind(0) == BeamKind::hit);
    CHECK(a.scan.kind(2) == BeamKind::no_return);
    CHECK(a.scan.kind(3) == BeamKind::invalid);
    const StampedScan& b = log.scans[1];
    CHECK(b.time == 11.5);
    CHECK(b.scan.first_angle == -1);
    CHECK(b.scan.angle_step == 0.5);
    CHECK(b.scan.farthest == 30);
    CHECK(b.scan.size() == 3);
    CHECK(log.odometry[0].time == 9.5);
    CHECK(log.odometry[0].T_odom_robot.y() == 2);
    // Without a step the field of view says it: 2 rad over three beams.
    const std::string no_step =
        "ROBOTLASER1 0 -1 2 0 30 0.01 0 3 1 2 40 0 1 2 0.5 1.1 2.1 0.6 0 0 0 0 0 11.5 host 0.2\n";
    CHECK(read(no_step).scans[0].scan.angle_step == 1);
  }

  TEST_CASE("carmen: DP-SLAM's log is steps of odometry and laser, and its readings end at 8 m") {
    const CarmenLog log =
        read("Odometry 1 2 0.5 \nLaser 3 1.5 8.183 0.5 \nOdometry 2 2 0.5\nLaser 3 1 2 3\n");
    REQUIRE(log.scans.size() == 2);
    const StampedScan& a = log.scans[0];
    CHECK(a.time == 0);
    CHECK(log.scans[1].time == 1);
    CHECK(log.scans[1].line == 4);
    CHECK(a.T_odom_laser.x() == 1);
    CHECK(a.T_odom_robot.angle() == 0.5);
    CHECK(a.scan.kind(0) == BeamKind::hit);
    CHECK(a.scan.kind(1) == BeamKind::no_return);
    CHECK(a.scan.angle(2) == doctest::Approx(std::numbers::pi / 2));
    CHECK(words_of("Laser 1 1\n").find("expected a line Odometry before") != std::string::npos);
    CHECK(words_of("Odometry 1 2 3\nLaser 1 1\nLaser 1 1\n").find("log:3: ") != std::string::npos);
    CHECK(words_of("Odometry 1 2\n").find("the odometry: a finite number") != std::string::npos);
  }

  TEST_CASE("carmen: the order is the file's, also where times run back") {
    const std::string early = "FLASER 1 1 0 0 0 0 0 0 5 host 0\n", late = "FLASER 1 1 0 0 0 0 0 0 6 host 0\n";
    const CarmenLog log = read(late + early + late);
    REQUIRE(log.scans.size() == 3);
    CHECK(log.scans[1].time == 5);
  }

  TEST_CASE("carmen: bad lines are refused with the line and what was expected") {
    CHECK(words_of("").find("none") != std::string::npos);
    CHECK(words_of(wheels).find("expected lines FLASER, ROBOTLASER1, RAWLASER1 or Laser, found none") !=
          std::string::npos);
    CHECK(words_of("FLASER 3 1 2\n").find("log:1: expected a range: a finite number (the line ends") !=
          std::string::npos);
    CHECK(words_of(std::string(front) + "FLASER 2 1 nan 0 0 0 0 0 0 1 h 0\n").find("log:2: ") !=
          std::string::npos);
    CHECK(words_of("FLASER -2 1 2\n").find("whole number") != std::string::npos);
    CHECK(words_of("FLASER 1000000000 1 2\n").find("100000") != std::string::npos);
    CHECK(words_of("FLASER 1 1 0 0 0 0 0 x 1 h 0\n").find("the robot's pose") != std::string::npos);
    CHECK(words_of("ROBOTLASER1 0 0 0 0 30 0 0 1 1 0 0 0 0 0 0 0 0 0 0 0 x\n").find("turning axis") !=
          std::string::npos);
    for (const char* farthest : {"0", "-5"}) {  // every beam would be none, or go backwards
      const std::string line =
          "ROBOTLASER1 0 -1 2 0.5 " + std::string(farthest) + " 0 0 1 1 0 0 0 0 0 0 0 0 0 0 0 0 1 h 1\n";
      CHECK(words_of(line).find("the largest range: a number above zero ('" + std::string(farthest) + "'") !=
            std::string::npos);
    }
    CHECK(words_of("FLASER 1 1 0 1e300 0 0 0 0 1 h 0\n")
              .find("the laser's pose: metres within 1e9 ('1e300' is none)") != std::string::npos);
    CHECK(words_of("FLASER\n").find("number of ranges") != std::string::npos);
    // A count that is not the line's: what is left over were ranges.
    CHECK(words_of("FLASER 1 1 2 3 0 0 0 0 0 0 1 h 0\n").find("log:1: expected after the time") !=
          std::string::npos);
    CHECK(words_of("FLASER 0 1 2 3 0 0 0 0 0 0 1 h 0\n").find("log:1: ") != std::string::npos);
    CHECK(words_of("ODOM 0 0 0 0 0 0 1 h 0 9\n").find("log:1: ") != std::string::npos);
    CHECK(words_of("\x1F\x8B\x08 and so on")
              .find("expected a CARMEN log, found a file packed by gzip (gunzip") != std::string::npos);
    CHECK(words_of("BZh91AY&SY").find("bunzip2") != std::string::npos);
    const cairn_test::Folder folder;
    CHECK_FALSE(cairn_test::message_of([&] { static_cast<void>(read_carmen(folder / "none")); }).empty());
  }

  TEST_CASE("carmen: scans that all carry one pose get theirs from the odometry between its neighbours") {
    const std::string scan = "FLASER 1 1 0.1 0 0 0 0 0 ";
    const auto odometry = [](double x, double t) {
      return "ODOM " + shortest(x) + " 0 0 0 0 0 " + shortest(t) + " h 0\n";
    };
    CarmenLog log =
        read(odometry(0, 1) + odometry(2, 2) + scan + "0.5 h 0\n" + scan + "1.25 h 0\n" + scan + "3 h 0\n");
    place_by_odometry(log, "log");
    CHECK(log.scans[0].T_odom_robot.x() == doctest::Approx(0));
    CHECK(log.scans[1].T_odom_robot.x() == doctest::Approx(0.5));
    CHECK(log.scans[1].T_odom_laser.x() == doctest::Approx(0.6));  // 0.1 m ahead of the robot
    CHECK(log.scans[2].T_odom_robot.x() == doctest::Approx(2));

    // Times of the odometry that run back, as those of the Intel log do, are put in their order first.
    std::string wheels_of_two;
    for (const int t : {0, 1, 2, 3, 100, 4, 5, 6}) wheels_of_two += odometry(t == 100 ? 7 : t, t);
    CarmenLog back = read(wheels_of_two + scan + "1.5 h 0\n" + scan + "3.5 h 0\n" + scan + "4.5 h 0\n");
    place_by_odometry(back, "log");
    CHECK(back.scans[0].T_odom_robot.x() == doctest::Approx(1.5));
    CHECK(back.scans[1].T_odom_robot.x() == doctest::Approx(3.5));
    CHECK(back.scans[2].T_odom_robot.x() == doctest::Approx(4.5));
    CHECK(back.odometry[4].time == 100);  // which stay as they were

    // Raw scans know of no odometry; the scanner is where the parameter says.
    const std::string raw = "RAWLASER1 0 -1 2 0.5 30 0.01 0 3 1 2 40 1 9 ";
    CarmenLog unplaced = read("PARAM robot_frontlaser_offset 0.2 nohost 0\nPARAM a b nohost 0\n" +
                              odometry(0, 1) + odometry(2, 2) + raw + "1.25 h 0\n" + raw + "1.5 h 0\n");
    place_by_odometry(unplaced, "log");
    REQUIRE(unplaced.scans.size() == 2);
    CarmenLog alone = read(odometry(0, 1) + raw + "1.5 h 0\n" + odometry(2, 2));  // one scan moves as well
    place_by_odometry(alone, "log");
    CHECK(alone.scans[0].T_odom_robot.x() == doctest::Approx(1));
    CarmenLog at_home = read(raw + "1.5 h 0\n");
    place_by_odometry(at_home, "log");
    CHECK(at_home.scans[0].T_odom_robot.x() == 0);
    CHECK(unplaced.scans[0].scan.first_angle == -1);
    CHECK(unplaced.scans[0].scan.kind(2) == BeamKind::no_return);
    CHECK(unplaced.scans[1].T_odom_robot.x() == doctest::Approx(1));
    CHECK(unplaced.scans[1].T_odom_laser.x() == doctest::Approx(1.2));
    // Beside scans that have a pose they are the same scans once more.
    CHECK(read(raw + "1 h 0\n" + robot + raw + "2 h 0\n").scans.size() == 1);
    CHECK(words_of(raw + "\n").find("the time: a finite number") != std::string::npos);
    CHECK(words_of("PARAM robot_frontlaser_offset x\n").find("the laser's offset") != std::string::npos);

    CarmenLog none = read(scan + "1 h 0\n" + scan + "2 h 0\n");
    CHECK(cairn_test::message_of([&] { place_by_odometry(none, "log"); }).find("no ODOM line") !=
          std::string::npos);
    CarmenLog own = read(std::string(front) + "FLASER 1 1 9 0 0 9 0 0 1 h 0\n" + wheels);
    place_by_odometry(own, "log");
    CHECK(own.scans[1].T_odom_laser.x() == 9);
  }
}

}  // namespace carmen_test
