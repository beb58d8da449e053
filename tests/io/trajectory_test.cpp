// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/io/trajectory.hpp>

#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"

using cairn::SE3;
using cairn::SO3;
using cairn::Trajectory;
using cairn::Vector;
using cairn_test::Folder;
using cairn_test::message_of;

namespace trajectory_test {
namespace {

Trajectory random_trajectory(cairn::Random& random, std::size_t count) {
  Trajectory trajectory;
  for (std::size_t i = 0; i < count; ++i) {
    const Vector<3> position(random.normal() * 1e3, random.normal(), random.normal() * 1e-6);
    trajectory.push_back(
        {1403715524.5 + 0.1 * static_cast<double>(i) + 0.05 * random.uniform(),
         SE3(SO3::from_quaternion(random.normal(), random.normal(), random.normal(), random.normal()),
             position)});
  }
  return trajectory;
}

double difference(const SE3& a, const SE3& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

}  // namespace

TEST_SUITE("trajectory") {
  TEST_CASE("trajectory: TUM, KITTI and EuRoC files read back what was written") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const Trajectory written = random_trajectory(random, 200);
    const Folder folder;
    cairn::write_tum(folder / "a.tum", written);
    cairn::write_kitti(folder / "a.kitti", written);
    cairn::write_euroc(folder / "a.csv", written);
    const Trajectory tum = cairn::read_tum(folder / "a.tum");
    const Trajectory kitti = cairn::read_kitti(folder / "a.kitti");
    const Trajectory euroc = cairn::read_euroc(folder / "a.csv");
    REQUIRE(tum.size() == written.size());
    REQUIRE(kitti.size() == written.size());
    REQUIRE(euroc.size() == written.size());
    for (std::size_t i = 0; i < written.size(); ++i) {
      CHECK(tum[i].time == written[i].time);  // to the bit
      CHECK((tum[i].T_world_body.translation() == written[i].T_world_body.translation()));
      CHECK(kitti[i].time == static_cast<double>(i));
      CHECK((kitti[i].T_world_body.translation() == written[i].T_world_body.translation()));
      CHECK(std::abs(euroc[i].time - written[i].time) < 3e-7);
      for (const Trajectory* read : {&tum, &kitti, &euroc})
        CHECK(difference((*read)[i].T_world_body, written[i].T_world_body) < 1e-14);
    }
  }

  TEST_CASE("trajectory: the same poses give the same bytes, whatever the locale") {
    cairn::Random random(3);
    const Trajectory trajectory = random_trajectory(random, 20);
    const Folder folder;
    cairn::write_tum(folder / "a", trajectory);
    const bool other = std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr;
    cairn::write_tum(folder / "b", trajectory);
    const Trajectory back = cairn::read_tum(folder / "a");
    if (other) std::setlocale(LC_ALL, "C");
    CHECK(cairn::read_file(folder / "a") == cairn::read_file(folder / "b"));
    CHECK(back.size() == trajectory.size());
    const auto entries = std::filesystem::directory_iterator(folder.path());
    CHECK(std::distance(begin(entries), end(entries)) == 2);  // no temporary is left
  }

  TEST_CASE("trajectory: comments, blank lines, CR LF, tabs and a missing last line end are accepted") {
    const Folder folder;
    folder.put("a", "# a comment\r\n\r\n1 1 2 3\t0 0  0 1\r\n  2 +4 5e0 6 0 0 0 -1");
    const Trajectory trajectory = cairn::read_tum(folder / "a");
    REQUIRE(trajectory.size() == 2);
    CHECK((trajectory[1].T_world_body.translation() == Vector<3>(4, 5, 6)));
    CHECK(difference(trajectory[1].T_world_body, SE3(SO3(), Vector<3>(4, 5, 6))) == 0);
  }

  TEST_CASE("trajectory: a byte-order mark of UTF-8 at the start is skipped, and nowhere else") {
    const Folder folder;
    const std::string mark = "\xEF\xBB\xBF", row = "1 0 0 0 0 1 0 0 0 0 1 0\n";
    folder.put("a.tum", mark + "0 1 2 3 0 0 0 1\n");
    CHECK(cairn::read_tum(folder / "a.tum").size() == 1);
    folder.put("comment.tum", mark + "# said\n0 1 2 3 0 0 0 1\n");
    CHECK(cairn::read_tum(folder / "comment.tum").size() == 1);
    folder.put("a.kitti", mark + row);
    folder.put("times.txt", mark + "7\n");
    CHECK(cairn::read_kitti(folder / "a.kitti", folder / "times.txt")[0].time == 7);
    folder.put("a.csv", mark + "#t\r\n1,0,0,0,1,0,0,0\r\n");
    CHECK(cairn::read_euroc(folder / "a.csv").size() == 1);
    for (const std::string& text : {row + mark + row, mark + mark + row, mark}) {
      folder.put("bad.kitti", text);
      CHECK_THROWS_AS(static_cast<void>(cairn::read_kitti(folder / "bad.kitti")), cairn::Error);
    }
  }

  TEST_CASE("trajectory: bad TUM files are refused with file, line and what was expected") {
    const Folder folder;
    const auto refusal = [&](const std::string& text) {
      folder.put("bad.tum", text);
      return message_of([&] { static_cast<void>(cairn::read_tum(folder / "bad.tum")); });
    };
    const std::string good = "1 0 0 0 0 0 0 1\n";
    CHECK(refusal(good + "2 0 0 0 0 0 0\n").find("bad.tum:2: expected 8 numbers") != std::string::npos);
    CHECK(refusal(good + "2 0 0 0 0 0 0 1 9\n").find("bad.tum:2: expected 8 numbers") != std::string::npos);
    CHECK(refusal(good + "2 nan 0 0 0 0 0 1\n").find(":2: expected a finite number in column 2 ('nan'") !=
          std::string::npos);
    CHECK(refusal(good + "2 inf 0 0 0 0 0 1\n").find("column 2") != std::string::npos);
    CHECK(refusal(good + "2 1e999 0 0 0 0 0 1\n").find("column 2") != std::string::npos);
    CHECK(refusal(good + "2 1,5 0 0 0 0 0 1\n").find("('1,5' is none)") != std::string::npos);
    CHECK(refusal(good + "2 0 0 0 0.7 0.7 0.7 0.7\n").find("a quaternion of length 1, not 1.4") !=
          std::string::npos);
    CHECK(refusal(good + "2 0 0 0 1e150 0 0 0\n").find("not 1e+150, found") != std::string::npos);
    CHECK(refusal(good + "2 0 0 0 0 0 0 0\n").find("a quaternion of length 1") != std::string::npos);
    CHECK(refusal(good + "0.5 0 0 0 0 0 0 1\n").find("times that do not run backwards") != std::string::npos);
    CHECK(refusal("").find("found the end of the file") != std::string::npos);
    CHECK(refusal("# only a comment\n").find("at least one line") != std::string::npos);
    CHECK(message_of([&] {
            static_cast<void>(cairn::read_tum(folder / "absent"));
          }).find("absent: no such file") != std::string::npos);
    CHECK(message_of([&] { static_cast<void>(cairn::read_tum(folder.path())); }).find("is a folder") !=
          std::string::npos);
  }

  TEST_CASE("trajectory: bad KITTI and EuRoC files are refused with file, line and what was expected") {
    const Folder folder;
    const auto kitti = [&](const std::string& text) {
      folder.put("bad", text);
      return message_of([&] { static_cast<void>(cairn::read_kitti(folder / "bad")); });
    };
    CHECK(kitti("1 0 0 0 0 1 0 0 0 0 1\n").find("bad:1: expected 12 numbers") != std::string::npos);
    CHECK(kitti("1 0 0 0 0 1 0 0 0 0 2 0\n").find("bad:1: expected a rotation") != std::string::npos);
    CHECK(kitti("1 0 0 0 0 1 0 0 0 0 -1 0\n").find("reflection") != std::string::npos);
    CHECK(kitti("# no comments here\n").find("column 1") != std::string::npos);
    CHECK(kitti("\n").find("at least one line") != std::string::npos);
    const auto euroc = [&](const std::string& text) {
      folder.put("bad", text);
      return message_of([&] { static_cast<void>(cairn::read_euroc(folder / "bad")); });
    };
    CHECK(euroc("#h\n1000,0,0,0,1,0,0\n").find("bad:2: expected at least 8 numbers") != std::string::npos);
    CHECK(euroc("1000,0,0,0,1,0,0,0,7\n2000,0,0,0,1,0,0,0\n").find("bad:2: expected 9 columns") !=
          std::string::npos);
    CHECK(euroc("1000,0,0,0,1,0,,0\n").find("column 7 ('' is none)") != std::string::npos);
    CHECK(euroc("2000,0,0,0,1,0,0,0\n1000,0,0,0,1,0,0,0\n").find("backwards") != std::string::npos);
  }

  TEST_CASE("trajectory: KITTI times must be one a pose") {
    const Folder folder;
    folder.put("poses", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n");
    const auto refusal = [&](const std::string& times) {
      folder.put("times", times);
      return message_of([&] { static_cast<void>(cairn::read_kitti(folder / "poses", folder / "times")); });
    };
    CHECK(refusal("0.0\n0.1\n").empty());
    CHECK(cairn::read_kitti(folder / "poses", folder / "times")[1].time == 0.1);
    CHECK(refusal("0.0\n").find("times:1: expected one time for each of the 2 poses") != std::string::npos);
    CHECK(refusal("0.0\n0.1\n0.2\n").find("times:3: expected no more than 2 times") != std::string::npos);
    CHECK(refusal("0.1\n0.0\n").find("backwards") != std::string::npos);
    CHECK(refusal("0.1\nnan\n").find("times:2: expected a finite number") != std::string::npos);
    CHECK(refusal("0.1\n0.1\n").empty());
  }

  TEST_CASE("trajectory: a write that fails says so and leaves nothing") {
    const Folder folder;
    CHECK(message_of([&] {
            cairn::write_tum(folder / "none" / "a.tum", {{0, SE3()}});
          }).find("cannot write") != std::string::npos);
    std::filesystem::create_directory(folder / "taken");
    CHECK(message_of([&] { cairn::write_tum(folder / "taken", {{0, SE3()}}); }).find("cannot write") !=
          std::string::npos);
    const auto entries = std::filesystem::directory_iterator(folder.path());
    CHECK(std::distance(begin(entries), end(entries)) == 1);
  }

  TEST_CASE("trajectory: what readers would refuse is refused by writers, before anything is written") {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double inf = std::numeric_limits<double>::infinity();
    const SE3 here(SO3(), Vector<3>(1, 2, 3));
    const std::vector<std::pair<Trajectory, std::string>> refused{
        {{{0, here}, {nan, here}}, "pose 1 of 2 has a time that is not finite"},
        {{{-inf, here}, {0, here}}, "pose 0 of 2 has a time that is not finite"},
        {{{0, here}, {1, SE3(SO3(), Vector<3>(0, nan, 0))}}, "pose 1 of 2 has a number that is not finite"},
        {{{0, SE3(SO3(), Vector<3>(0, 0, inf))}}, "pose 0 of 1 has a number that is not finite"},
        {{{5, here}, {3, here}, {3, here}, {-1, here}}, "pose 1 of 4 has an earlier time"},
        {{{5, here}, {5, here}, {std::nextafter(5.0, 0.0), here}}, "pose 2 of 3 has an earlier time"}};
    const Folder folder;
    folder.put("old", "the results of yesterday");
    for (const auto& [trajectory, why] : refused) {
      CAPTURE(why);
      for (const auto write : {&cairn::write_tum, &cairn::write_kitti, &cairn::write_euroc}) {
        const std::string message = message_of([&] { write(folder / "old", trajectory); });
        CHECK(message.find("old: not written, " + why) != std::string::npos);
        CHECK_FALSE(message_of([&] { write(folder / "new", trajectory); }).empty());
      }
    }
    CHECK(cairn::read_file(folder / "old") == "the results of yesterday");
    const auto entries = std::filesystem::directory_iterator(folder.path());
    CHECK(std::distance(begin(entries), end(entries)) == 1);
    const Trajectory standing{{5, here}, {5, here}, {6, here}};  // equal times are written as they are read
    cairn::write_tum(folder / "a", standing);
    cairn::write_euroc(folder / "b", standing);
    CHECK(cairn::read_tum(folder / "a").size() == 3);
    CHECK(cairn::read_euroc(folder / "b").size() == 3);
  }

  TEST_CASE("trajectory: EuRoC times are the nearest nanosecond, in the file and read back") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    std::vector<std::int64_t> stamps{0, 1, 289'999'999, 290'000'000, 999'999'999, 1'000'000'001};
    for (int i = 0; i < 2000; ++i)  // what a double of seconds holds to a fraction of a nanosecond
      stamps.push_back(static_cast<std::int64_t>(random.below(1'000'000'000'000'000)));
    std::ranges::sort(stamps);
    Trajectory trajectory;
    std::string expected;
    for (const std::int64_t ns : stamps) {
      trajectory.push_back({static_cast<double>(ns) / 1e9, SE3()});
      expected += std::to_string(ns) + ",0,0,0,1,0,0,0\n";
    }
    const Folder folder;
    cairn::write_euroc(folder / "a", trajectory);
    const std::string text = cairn::read_file(folder / "a");
    CHECK(text.substr(text.find('\n') + 1) == expected);
    const Trajectory back = cairn::read_euroc(folder / "a");
    REQUIRE(back.size() == trajectory.size());
    for (std::size_t i = 0; i < back.size(); ++i) CHECK(back[i].time == trajectory[i].time);
    cairn::write_euroc(folder / "b", {{-2.6e-9, SE3()}, {-0.4e-9, SE3()}, {0.6e-9, SE3()}, {2.5e-9, SE3()}});
    CHECK(cairn::read_file(folder / "b").find("\n-3,0,0,0,1,0,0,0\n0,0,0,0,1,0,0,0\n1,0") !=
          std::string::npos);
    for (const double far : {9.3e9, -9.3e9, 1e300})
      CHECK(message_of([&] { cairn::write_euroc(folder / "c", {{far, SE3()}}); }).find("nanoseconds") !=
            std::string::npos);
    CHECK_FALSE(std::filesystem::exists(folder / "c"));
  }

  TEST_CASE("trajectory: moved_frame multiplies the body-to-sensor motion on the right") {
    const SE3 T_world_body(SO3::exp(Vector<3>(0, 0, 1.0)), Vector<3>(1, 2, 3));
    const SE3 T_body_sensor(SO3::exp(Vector<3>(0.3, 0, 0)), Vector<3>(0.5, 0, 0));
    const Trajectory moved = cairn::moved_frame({{4.0, T_world_body}}, T_body_sensor);
    const Vector<3> point(0.1, -0.2, 0.7);
    CHECK((moved[0].T_world_body * point - T_world_body * (T_body_sensor * point)).norm() < 1e-15);
    CHECK(moved[0].time == 4.0);
  }

  TEST_CASE("trajectory: reads every published trajectory of the data folder") {
    const auto data = cairn_test::real_data("trajectories");
    if (!data) return;
    CHECK(cairn::read_kitti(*data / "KITTI_00_gt.txt").size() == 4541);
    CHECK(cairn::read_kitti(*data / "KITTI_00_ORB.txt").size() == 4541);
    CHECK(cairn::read_kitti(*data / "KITTI_00_SPTAM.txt").size() == 4541);
    CHECK(cairn::read_tum(*data / "fr2_desk_ORB.txt").size() == 2893);
    CHECK(cairn::read_tum(*data / "fr2_desk_groundtruth.txt").size() == 20957);
    CHECK(cairn::read_tum(*data / "V102.txt").size() == 807);
    const Trajectory euroc = cairn::read_euroc(*data / "V102_groundtruth.csv");
    CHECK(euroc.size() == 16702);
    CHECK(std::abs(euroc[0].time - 1403715524.907143168) < 3e-7);
  }
}

}  // namespace trajectory_test
