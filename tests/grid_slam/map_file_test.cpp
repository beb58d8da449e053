// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>

#include "floor_plan.hpp"
#include "mapper.hpp"
#include "outputs.hpp"
#include "support/folder.hpp"
#include "support/made_up_file.hpp"
#include "support/random.hpp"

namespace map_file_test {
namespace {

using namespace grid_slam;
using cairn::SE2;

struct MappedFloor {
  std::string bytes;
  std::vector<cairn::StampedPose2> path;  ///< a map is a little bent, and these are poses in it
};

/// A map of the whole corridor, once for all cases.
const MappedFloor& mapped_floor() {
  static const MappedFloor mapped = [] {
    const cairn_test::Folder folder;
    const Drive drive = simulated_drive({});
    Mapper mapper({.particles = 4});
    for (const auto& scan : drive.log.scans) mapper.add(scan);
    mapper.save(folder / "map");
    return MappedFloor{cairn::read_file(folder / "map"), mapper.rematched()};
  }();
  return mapped;
}

/// A drive through the same floor, along the same path with other noise, its odometry in a frame of its own.
Drive another_drive() {
  Drive drive = simulated_drive({.seed = 7});
  const SE2 elsewhere(30, -12, 2.1);
  for (auto& scan : drive.log.scans) {
    scan.T_odom_laser = elsewhere * scan.T_odom_laser;
    scan.T_odom_robot = elsewhere * scan.T_odom_robot;
  }
  return drive;
}

std::string numbers_of(const std::filesystem::path& map) {
  return cairn_test::held_by(cairn::read_file(map));
}
std::string map_of(const std::string& numbers) {
  return cairn_test::file_holding(numbers, "cairngrd", 6);
}

}  // namespace

TEST_SUITE("grid_slam/map_file") {
  TEST_CASE("map_file: particles of a loaded map share what they shared") {
    const cairn_test::Folder folder;
    const Drive drive = simulated_drive({.seed = 2});
    Mapper mapper({.particles = 6, .seed = 2});
    for (std::size_t i = 0; i < 300; ++i) mapper.add(drive.log.scans[i]);
    mapper.save(folder / "map");
    const Mapper again = Mapper::loaded(folder / "map");
    CHECK(map_bytes(again.belief()) == map_bytes(mapper.belief()));
    CHECK(again.belief().stored_poses() == mapper.belief().stored_poses());
    again.save(folder / "again");
    CHECK(cairn::read_file(folder / "map") == cairn::read_file(folder / "again"));
  }

  TEST_CASE("map_file: a robot set down anywhere on the floor finds itself, and the map stays as it is") {
    const cairn_test::Folder folder;
    folder.put("map", mapped_floor().bytes);
    const Drive drive = another_drive();
    for (const std::size_t first : {std::size_t{150}, std::size_t{420}, std::size_t{700}}) {
      CAPTURE(first);
      Mapper mapper =
          Mapper::localiser(folder / "map", {.particles = 10, .threads = 2}, PlaceWindow{-4, -4, 28, 20});
      const auto& before = mapper;
      for (std::size_t i = first; i < first + 120; ++i) mapper.add(drive.log.scans[i]);
      const auto path = before.trajectory(true);
      REQUIRE(path.size() == 120);
      for (std::size_t i = 0; i < path.size(); i += 10) {
        const SE2 expected = mapped_floor().path[first + i].pose;
        CHECK((path[i].pose.translation() - expected.translation()).norm() < 0.08);
        CHECK(std::abs(cairn::wrapped(path[i].pose.angle() - expected.angle())) < 0.02);
      }
      CHECK(mapper.belief()[0].map.grid.cells().tile({0, 0}) ==
            mapper.belief()[mapper.belief().best()].map.grid.cells().tile({0, 0}));
      CHECK(cairn_test::message_of([&] { mapper.save(folder / "again"); }).find("localised") !=
            std::string::npos);
    }
  }

  TEST_CASE("map_file: without a window localising begins where the map ended") {
    const cairn_test::Folder folder;
    const Drive drive = simulated_drive({.seed = 2});
    Mapper mapper({.particles = 6, .seed = 2});
    for (std::size_t i = 0; i < 300; ++i) mapper.add(drive.log.scans[i]);
    mapper.save(folder / "map");
    Mapper localiser = Mapper::localiser(folder / "map");
    for (std::size_t i = 300; i < 305; ++i) {
      localiser.add(drive.log.scans[i]);
      mapper.add(drive.log.scans[i]);
    }
    const SE2 expected = mapper.trajectory(true)[300].pose;
    CHECK((localiser.trajectory(true).front().pose.translation() - expected.translation()).norm() < 0.05);
  }

  TEST_CASE("map_file: made-up numbers under a right checksum are refused in words, or are a map") {
    const cairn_test::Folder folder;
    const Drive drive = simulated_drive({.seed = 2});
    Mapper mapper({.particles = 2});
    for (std::size_t i = 0; i < 60; ++i) mapper.add(drive.log.scans[i]);
    mapper.save(folder / "map");
    const std::string numbers = numbers_of(folder / "map");
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const double values[] = {NAN, INFINITY, 1e300, -1e300, -1, 1e-300, 0.5};
    int refused = 0;
    for (int round = 0; round < 150; ++round) {
      const std::size_t at = random.below(numbers.size() - 8) / 8 * 8 + (round % 2 == 0 ? 0 : 4);
      char bytes[8];
      std::memcpy(bytes, &values[round % 7], 8);
      std::string changed = numbers;
      changed.replace(at, 8, bytes, std::min<std::size_t>(8, numbers.size() - at));
      folder.put("changed", map_of(changed));
      const std::string words = cairn_test::message_of([&] {
        Mapper loaded = Mapper::loaded(folder / "changed");
        loaded.save(folder / "again");
        CHECK(Mapper::loaded(folder / "again").trajectory(true).size() == loaded.scans().size());
      });
      if (words.empty()) continue;
      ++refused;
      CHECK(words.find("changed: ") != std::string::npos);
    }
    CHECK(refused > 0);
  }

  TEST_CASE("map_file: poses too far away to be added up are refused in words") {
    const cairn_test::Folder folder;
    auto scan = simulated_drive({.seed = 2}).log.scans.front();
    const double x = 1234.5678;
    scan.T_odom_laser = SE2(x, 0, 0);
    Mapper mapper({.particles = 1});
    mapper.add(scan);
    mapper.save(folder / "map");
    const std::string numbers = numbers_of(folder / "map");
    const auto bytes = [](double number) {
      std::string text(8, 0);
      std::memcpy(text.data(), &number, 8);
      return text;
    };
    std::size_t places = 0;
    for (std::size_t at = 0; (at = numbers.find(bytes(x), at)) != std::string::npos; ++at) {
      ++places;
      for (const double far : {1e300, -2e9}) {
        std::string moved = numbers;
        moved.replace(at, 8, bytes(far));
        folder.put("changed", map_of(moved));
        const std::string words =
            cairn_test::message_of([&] { static_cast<void>(Mapper::loaded(folder / "changed")); });
        CHECK(words.find("more than 1e9 m away") != std::string::npos);
      }
    }
    CHECK(places >= 1);  // of the scan's odometry, and of what began there
  }

  TEST_CASE(
      "map_file: a localiser that began where the robot is not says that the map does not explain its "
      "scans") {
    const cairn_test::Folder folder;
    const Drive drive = simulated_drive({.seed = 2});
    Mapper mapper({.particles = 2, .seed = 2});
    for (std::size_t i = 0; i < 200; ++i) mapper.add(drive.log.scans[i]);
    CHECK_FALSE(mapper.explained().has_value());
    mapper.save(folder / "map");
    const auto explained_from = [&](std::size_t first) {  // it begins where the map ended
      Mapper localiser = Mapper::localiser(folder / "map", {.particles = 10});
      for (std::size_t i = first; i < first + 40; ++i) localiser.add(drive.log.scans[i]);
      return localiser.explained().value();
    };
    CHECK(explained_from(200 - 1) > 0.6);
    CHECK(explained_from(60) < 0.5);
  }

  TEST_CASE("map_file: shares of the delays that do not sum to one are refused in words") {
    const cairn_test::Folder folder;
    Mapper mapper({.particles = 1});
    mapper.add(simulated_drive({.seed = 2}).log.scans.front());
    mapper.save(folder / "map");
    std::string numbers = numbers_of(folder / "map");
    // They stand before two numbers on looks for loops, three on steps that odometry did not see and the pose
    // by odometry where the map begins.
    const std::size_t at = numbers.size() - 24 - 17 - 1 - 8 - 8 * ScanDelay::count;
    double share = 0, sum = 0;
    for (std::size_t k = 0; k < ScanDelay::count; ++k) {
      std::memcpy(&share, numbers.data() + at + 8 * k, 8);
      sum += std::exp(share);
    }
    REQUIRE(sum == doctest::Approx(1));
    const auto words = [&] {
      folder.put("map", map_of(numbers));
      return cairn_test::message_of([&] { static_cast<void>(Mapper::loaded(folder / "map")); });
    };
    CHECK(words().empty());
    const double one = 0;
    std::memcpy(numbers.data() + at + 8 * 5, &one, 8);
    CHECK(words().find("do not sum to one") != std::string::npos);
  }

  TEST_CASE("map_file: of a place that looks like another both are named, with their shares") {
    // A room of 6 m x 4 m: turned by half a turn about its middle it is the same.
    const auto seen_from = [](const SE2& pose) {
      cairn::StampedScan scan;
      scan.T_odom_laser = scan.T_odom_robot = pose;
      scan.scan = {.first_angle = -3, .angle_step = 0.033, .nearest = 0.05, .farthest = 40, .range = {}};
      for (int i = 0; i < 180; ++i) {
        const double angle = pose.angle() + scan.scan.first_angle + 0.033 * i;
        const double c = std::cos(angle), s = std::sin(angle);
        scan.scan.range.push_back(static_cast<float>(
            std::min(((c > 0 ? 3 : -3) - pose.x()) / c, ((s > 0 ? 2 : -2) - pose.y()) / s)));
      }
      return scan;
    };
    const cairn_test::Folder folder;
    Mapper mapper({.start = std::nullopt, .particles = 2});  // in the room's frame
    for (int i = 0; i <= 20; ++i) mapper.add(seen_from(SE2(-1 + 0.1 * i, 0.3, 0.05 * i)));
    mapper.save(folder / "map");
    const cairn::StampedScan first = seen_from(SE2(0.8, 0.5, 0.4));
    Mapper undecided = Mapper::localiser(folder / "map", {}, PlaceWindow{-3, -2, 3, 2});
    undecided.add(first);
    REQUIRE(undecided.places().size() >= 2);
    const SE2 one = undecided.places()[0].pose, other = undecided.places()[1].pose;
    CHECK((one.translation() + other.translation()).norm() < 0.1);
    CHECK(std::abs(cairn::wrapped(one.angle() - other.angle())) > 3);
    CHECK(undecided.places()[0].share < 0.9);
    CHECK(undecided.places()[1].share > 0.1);
    Mapper decided = Mapper::localiser(folder / "map", {}, PlaceWindow{0.1, -2, 3, 2});
    decided.add(first);
    REQUIRE(!decided.places().empty());
    CHECK((decided.places().front().pose.translation() - cairn::Vector<2>(0.8, 0.5)).norm() < 0.05);
  }

  TEST_CASE("map_file: a scan that no place explains is refused in words") {
    const cairn_test::Folder folder;
    folder.put("map", mapped_floor().bytes);
    Drive drive = another_drive();
    cairn::Random random(3);
    for (float& r : drive.log.scans[0].scan.range) r = static_cast<float>(random.uniform(0.3, 9));
    Mapper mapper = Mapper::localiser(folder / "map", {}, PlaceWindow{-4, -4, 28, 20});
    CHECK(cairn_test::message_of([&] { mapper.add(drive.log.scans[0]); }).find("no place in the window") !=
          std::string::npos);
  }
}

}  // namespace map_file_test
