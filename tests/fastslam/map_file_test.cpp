// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Saved maps of landmarks: going on from a file is going on.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>

#include "mapper.hpp"
#include "slam.hpp"
#include "support/folder.hpp"
#include "support/made_up_file.hpp"
#include "support/random.hpp"

namespace landmark_map_file_test {
namespace {

using namespace fastslam;

LandmarkLog first_of(LandmarkLog log, std::size_t frames) {
  log.keep_first(frames);
  return log;
}

std::string saved(const Mapper& mapper) {
  const cairn_test::Folder folder;
  mapper.save(folder / "map");
  return cairn::read_file(folder / "map");
}

/// A log's frames, all at once or with a file in between, after so many.
std::string mapped(const LandmarkLog& log, const SlamOptions& options, std::size_t until) {
  const cairn_test::Folder folder;
  const LandmarkLog part = first_of(log, until);
  Mapper first(part, options);
  while (first.has_next()) first.step();
  first.save(folder / "map");
  Mapper second = Mapper::loaded(folder / "map", log, 1);
  CHECK(second.steps().size() == until);
  while (second.has_next()) second.step();
  return saved(second);
}

bool same(const std::vector<cairn::StampedPose2>& a, const std::vector<cairn::StampedPose2>& b) {
  return std::ranges::equal(a, b, [](const auto& p, const auto& q) {
    return p.time == q.time && p.pose.x() == q.pose.x() && p.pose.y() == q.pose.y() &&
           p.pose.angle() == q.pose.angle();
  });
}

std::string map_of(const std::string& numbers) {
  return cairn_test::file_holding(numbers, "cairnlmk", 1);
}

}  // namespace

TEST_SUITE("fastslam/map_file") {
  TEST_CASE("fastslam: a run with a file in between is the run at once, to the bit") {
    const LandmarkLog named = simulated(loop_map(), 6, 240);
    LandmarkLog nameless = named;
    nameless.withhold_identities();
    struct Case {
      const LandmarkLog& log;
      SlamOptions options;
      bool redraws;
    };
    SlamOptions removing{.particles = 8, .seed = 3};
    removing.landmarks = {.pick = cairn::Pick::likeliest};
    for (const auto& [log, options, redraws] :
         {Case{named, {.particles = 12, .seed = 2}, true}, Case{nameless, {.particles = 12, .seed = 5}, true},
          Case{named, {.particles = 12, .proposal = ProposalKind::motion}, false},
          Case{nameless, removing, true}}) {
      Mapper whole(log, options);
      bool redrawn = false;
      while (whole.has_next()) {
        whole.step();
        redrawn = redrawn || whole.steps().back().redrawn.has_value();
      }
      CHECK(redrawn == redraws);
      const std::string once = saved(whole);
      for (const std::size_t until : {1U, 130U}) {
        CAPTURE(until);
        CHECK((mapped(log, options, until) == once));
      }
    }
  }

  TEST_CASE("fastslam: what a loaded map hands over is what a run at once does") {
    const cairn_test::Folder folder;
    LandmarkLog log = simulated(loop_map(), 9, 150);
    log.withhold_identities();
    const LandmarkLog part = first_of(log, 110);
    const SlamOptions options{.particles = 10, .seed = 4, .threads = 2};
    const Results whole = run(log, options);
    Mapper mapper(part, options);
    CHECK(run(mapper).steps.size() == 110);
    mapper.save(folder / "map");  // as it was before the paths were drawn for what it handed over
    CHECK(saved_options(folder / "map").seed == 4);
    Mapper loaded = Mapper::loaded(folder / "map", log, 3);
    std::size_t called = 0;
    const Results rest = run(loaded, [&]() -> std::optional<std::string> {
      ++called;
      return std::nullopt;
    });
    CHECK(called == 40);
    CHECK(rest.steps.size() == 150);
    CHECK(same(rest.mean, whole.mean));
    CHECK(same(rest.best, whole.best));
    CHECK(same(rest.odometry, whole.odometry));
    CHECK(rest.path_error == whole.path_error);
    CHECK(rest.landmark_error == whole.landmark_error);
    CHECK(rest.median_nees == whole.median_nees);
    CHECK(rest.threads == 3);
    REQUIRE(rest.landmarks.size() == whole.landmarks.size());
    for (std::size_t i = 0; i < rest.landmarks.size(); ++i) {
      CHECK(rest.landmarks[i].belief.mean == whole.landmarks[i].belief.mean);
      CHECK(rest.landmarks[i].log_odds == whole.landmarks[i].log_odds);
    }
  }

  TEST_CASE("fastslam: a map of another log, a damaged one and none at all are refused in words") {
    const cairn_test::Folder folder;
    const LandmarkLog log = simulated(loop_map(), 6, 40);
    Mapper empty(log, {.particles = 3});
    CHECK(cairn_test::message_of([&] { empty.save(folder / "map"); }).find("without a frame") !=
          std::string::npos);
    const LandmarkLog part = first_of(log, 30);
    Mapper mapper(part, {.particles = 3});
    while (mapper.has_next()) mapper.step();
    mapper.save(folder / "map");
    const auto words = [&](const std::string& file, const LandmarkLog& with) {
      return cairn_test::message_of([&] { static_cast<void>(Mapper::loaded(folder / file, with, 1)); });
    };
    CHECK(words("map", log).empty());
    CHECK(words("map", part).empty());
    CHECK(words("map", first_of(log, 20)).find("map: a map of 30 frames, and the log has 20") !=
          std::string::npos);
    LandmarkLog other = log;
    other.frames[17].seen[0].identity = 77;
    CHECK(words("map", other).find("frame 17 of the log is not that of the map") != std::string::npos);
    other = log;
    other.frames[29].moved.covariance(1, 1) *= 1 + 1e-15;
    CHECK(words("map", other).find("frame 29 of the log") != std::string::npos);
    other = log;
    other.frames[30].time += 1;  // what it has not seen yet
    CHECK(words("map", other).empty());
    other.sensor.bearing_sigma *= 2;
    CHECK(words("map", other).find("sensor is not the map's") != std::string::npos);
    const std::string bytes = cairn::read_file(folder / "map");
    folder.put("cut", bytes.substr(0, bytes.size() - 3));
    CHECK(words("cut", log).find("bytes after the head") != std::string::npos);
    std::string changed = bytes;
    changed[bytes.size() / 2] = static_cast<char>(changed[bytes.size() / 2] ^ 1);
    folder.put("changed", changed);
    CHECK(words("changed", log).find("damaged") != std::string::npos);
    folder.put("longer", map_of(cairn_test::held_by(bytes) + "x"));
    CHECK_FALSE(words("longer", log).empty());
    folder.put("none", "frames");
    CHECK(words("none", log).find("no file of the kind") != std::string::npos);
    CHECK(words("nowhere", log).find("expected a map of fastslam") != std::string::npos);
    CHECK(cairn_test::message_of([&] {
            static_cast<void>(saved_options(folder / "nowhere"));
          }).find("expected a map of fastslam") != std::string::npos);
  }

  TEST_CASE("fastslam: made-up numbers under a right checksum are refused in words, or are a map") {
    const cairn_test::Folder folder;
    LandmarkLog log = simulated(loop_map(), 6, 130);
    log.withhold_identities();
    const LandmarkLog part = first_of(log, 128);
    Mapper mapper(part, {.particles = 2});
    while (mapper.has_next()) mapper.step();
    mapper.save(folder / "map");
    const std::string numbers = cairn_test::held_by(cairn::read_file(folder / "map"));
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const double values[] = {NAN, INFINITY, 1e300, -1e300, -1, 1e-300, 0.5};
    int refused = 0, taken = 0;
    for (int round = 0; round < 300; ++round) {
      const std::size_t at = random.below(numbers.size() - 8);
      char bytes[8];
      std::memcpy(bytes, &values[round % 7], 8);
      std::string changed = numbers;
      if (round % 3 == 0)
        changed[at] = static_cast<char>(random.below(256));
      else
        changed.replace(at, 8, bytes, 8);
      folder.put("changed", map_of(changed));
      const std::string words = cairn_test::message_of([&] {
        Mapper loaded = Mapper::loaded(folder / "changed", log, 1);
        loaded.save(folder / "again");
        CHECK(Mapper::loaded(folder / "again", log, 1).steps().size() == loaded.steps().size());
        loaded.step();
        loaded.finish();
        ++taken;
      });
      if (words.empty()) continue;
      ++refused;
      CHECK((words.find("changed: ") != std::string::npos || words.find("frame 128") != std::string::npos));
    }
    CHECK(refused > 0);
    CHECK(taken > 0);
  }
}

}  // namespace landmark_map_file_test
