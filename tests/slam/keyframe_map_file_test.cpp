// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/io/binary_file.hpp>
#include <cairn/slam/keyframe_map_file.hpp>

#include "simulated_arena.hpp"
#include "support/made_up_file.hpp"
#include "support/random.hpp"

namespace keyframe_map_file_test {
namespace {

using cairn::BinaryReader;
using cairn::BinaryWriter;
using cairn::KeyframeMap;
using cairn::KeyframeMapOptions;
using cairn::SE3;
using cairn::StereoSighting;
using cairn_test::ArenaFrame;

std::string file_of(const KeyframeMap& map) {
  BinaryWriter out;
  cairn::save_keyframe_map(out, map);
  return out.file("testing ", 1);
}

KeyframeMap map_of(const std::string& bytes) {
  BinaryReader in(bytes, "testing ", 1, "test");
  KeyframeMap map = cairn::load_keyframe_map(in);
  in.expect_end();
  return map;
}

/// The file with other numbers and a checksum that fits.
std::string sealed(std::string_view bytes) {
  return cairn_test::file_holding(cairn_test::held_by(bytes), "testing ", 1);
}

KeyframeMap arena_map(const std::vector<ArenaFrame>& frames, const KeyframeMapOptions& options = {}) {
  KeyframeMap map(cairn_test::arena_rig(), options);
  static_cast<void>(cairn_test::run_arena(frames, map));
  return map;
}

/// Places of frames that the map sees next, each a keyframe afterwards; landmarks go by `number` of their id.
template <class Number>
std::vector<SE3> go_on(KeyframeMap& map, std::span<const ArenaFrame> frames, const Number& number) {
  std::vector<SE3> places;
  for (const ArenaFrame& frame : frames) {
    std::vector<StereoSighting> known, unknown;
    for (StereoSighting s : frame.sightings) {
      s.landmark = number(s.landmark);
      (map.contains(s.landmark) ? known : unknown).push_back(s);
    }
    std::vector<cairn::StereoMatch> matches;
    for (const StereoSighting& s : known)
      if (const auto landmark = map.landmark(s.landmark))
        matches.push_back({landmark->mean, landmark->covariance, s.left, s.right, s.sigma, s.sigma});
    const cairn::StereoPose start = cairn::refine_stereo_pose(map.rig(), matches, frame.T_world_camera);
    const cairn::MapLocation here = map.locate(start.T_world_camera, known);
    REQUIRE(here.good());
    places.push_back(here.T_world_camera);
    REQUIRE(map.add_keyframe(here, known));
    for (const StereoSighting& s : unknown) static_cast<void>(map.add_landmark(s));
  }
  return places;
}

}  // namespace

TEST_SUITE("keyframe_map_file") {
  // Else it meets nothing but the refusals at the beginning of a map.
  TEST_CASE("keyframe_map_file: the fuzz target begins with maps that are read") {
    const auto corpus =
        std::filesystem::path(__FILE__).parent_path().parent_path() / "fuzz/corpus/keyframe_map";
    for (const char* name : {"plain_1", "plain_10", "rig_1", "rig_10"}) {
      CAPTURE(name);
      std::ifstream in(corpus / name, std::ios::binary);
      BinaryWriter out;
      for (char c = 0; in.get(c);) out.put(c);
      const KeyframeMap map = map_of(out.file("testing ", 1));
      CHECK(map.landmark_count() >= 8);
      CHECK(map.rig_correction().has_value() == (name[0] == 'r'));
    }
  }

  TEST_CASE("keyframe_map_file: what is loaded is the map that was saved, and goes on as it would have") {
    for (const double rig_sigma : {0.0, 5e-4}) {
      CAPTURE(rig_sigma);
      const auto frames = cairn_test::arena_frames({.frames = 70});
      KeyframeMapOptions options;
      options.rig = {.rotation = rig_sigma, .direction = rig_sigma, .focal_ratio = rig_sigma};
      if (rig_sigma == 0) options.max_keyframes = 6;  // so that some have left
      KeyframeMap map = arena_map({frames.begin(), frames.begin() + 60}, options);
      map.set_variance_factors(1.25, 1.5);
      const std::vector<std::uint32_t> ids = map.landmark_ids();
      KeyframeMap loaded = map_of(file_of(map));
      CHECK(loaded.keyframe_count() == map.keyframe_count());
      CHECK((map.keyframes_added() > map.keyframe_count()) == (rig_sigma == 0));
      CHECK(loaded.pose_factor() == 1.5);
      CHECK(loaded.covariance() == map.covariance());
      CHECK(loaded.rig_correction().has_value() == (rig_sigma > 0));
      CHECK(loaded.rig().T_left_right.translation() == map.rig().T_left_right.translation());
      REQUIRE(loaded.landmark_ids().size() == ids.size());
      double largest = 0;
      for (std::uint32_t i = 0; i < ids.size(); ++i) {
        const auto was = map.landmark(ids[i]), is = loaded.landmark(i);
        REQUIRE(was.has_value() == is.has_value());
        if (was) largest = std::max(largest, (was->mean - is->mean).norm());
      }
      CHECK(largest < 1e-6);  // computed again from the list: to within what its iteration leaves

      const auto same = [](std::uint32_t id) { return id; };
      const auto renumbered = [&](std::uint32_t id) {
        const auto found = std::ranges::lower_bound(ids, id);
        return found != ids.end() && *found == id ? static_cast<std::uint32_t>(found - ids.begin())
                                                  : id + 1000000;
      };
      const auto next = std::span(frames).subspan(60);
      const std::vector<SE3> one = go_on(map, next, same), other = go_on(loaded, next, renumbered);
      for (std::size_t i = 0; i < one.size(); ++i) CHECK(cairn::local(one[i], other[i]).norm() < 1e-6);
      CHECK(loaded.keyframe_count() == map.keyframe_count());
      CHECK(file_of(map_of(file_of(loaded))).size() == file_of(loaded).size());
    }
  }

  TEST_CASE("keyframe_map: renumbered it is the map that its file is, with the keyframes that left") {
    const auto frames = cairn_test::arena_frames({.frames = 60});
    KeyframeMapOptions options;
    options.max_keyframes = 6;
    KeyframeMap map = arena_map(frames, options);
    map.forget(map.landmark_ids()[3]);
    const std::vector<std::uint32_t> ids = map.landmark_ids();
    const std::string file = file_of(map);
    KeyframeMap renumbered = map;
    renumbered.renumber();
    CHECK(file_of(renumbered) == file);
    CHECK(renumbered.keyframes_added() == map.keyframes_added());
    REQUIRE(renumbered.landmark_ids().size() == ids.size());
    CHECK(renumbered.landmark_ids().back() + 1 == ids.size());
    std::vector<std::uint32_t> beside = map.seen_with(std::span(ids).first(1));
    for (std::uint32_t& id : beside)
      id = static_cast<std::uint32_t>(std::ranges::lower_bound(ids, id) - ids.begin());
    CHECK(renumbered.seen_with(std::vector<std::uint32_t>{0}) == beside);
    for (std::uint32_t i = 0; i < ids.size(); ++i) {
      const auto was = map.sightings_of(ids[i]), is = renumbered.sightings_of(i);
      REQUIRE(is.size() == was.size());
      CHECK(is.front().keyframe == was.front().keyframe);
      CHECK(is.front().sighting.left == was.front().sighting.left);
    }
  }

  TEST_CASE("keyframe_map_file: an empty map, and one that has only begun") {
    KeyframeMap map(cairn_test::arena_rig());
    CHECK(map_of(file_of(map)).empty());
    map.begin(SE3());
    CHECK(map_of(file_of(map)).keyframe_count() == 1);
    CHECK(map_of(file_of(map)).landmark_count() == 0);
  }

  TEST_CASE("keyframe_map_file: a file that is cut, damaged, longer, newer or of another kind is refused") {
    const std::string bytes = file_of(arena_map(cairn_test::arena_frames({.frames = 12, .points = 300})));
    for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 16) {
      CAPTURE(size);
      CHECK_THROWS_AS(map_of(bytes.substr(0, size)), cairn::Error);
    }
    for (std::size_t i = 0; i < bytes.size(); i += 1 + i / 64) {
      CAPTURE(i);
      std::string damaged = bytes;
      damaged[i] = static_cast<char>(damaged[i] ^ 4);
      CHECK_THROWS_AS(map_of(damaged), cairn::Error);
    }
    CHECK_THROWS_WITH_AS(map_of(bytes + "x"), doctest::Contains("bytes after the head, expected"),
                         cairn::Error);
    BinaryWriter newer;
    cairn::save_keyframe_map(newer, KeyframeMap(cairn_test::arena_rig()));
    CHECK_THROWS_WITH_AS(map_of(newer.file("testing ", 2)), "test: version 2 of the format, expected 1",
                         cairn::Error);
    CHECK_THROWS_WITH_AS(map_of(newer.file("another ", 1)), "test: no file of the kind 'testing '",
                         cairn::Error);
  }

  TEST_CASE("keyframe_map_file: numbers made up are refused in words, or are those of a map that works") {
    const auto frames = cairn_test::arena_frames({.frames = 12, .points = 300});
    const std::string bytes = file_of(arena_map(frames));
    cairn::Random random(cairn_test::seed());
    int refused = 0, works = 0;
    for (int i = 0; i < 400; ++i) {
      std::string other = bytes;
      const std::size_t from = cairn::detail::binary_header_bytes;
      for (std::uint64_t n = 1 + random.below(4); n > 0; --n)
        other[from + random.below(other.size() - from)] = static_cast<char>(random.below(256));
      other = sealed(other);
      try {
        KeyframeMap map = map_of(other);
        for (const std::uint32_t id : map.landmark_ids()) {
          for (const auto& landmark : {map.landmark(id), map.landmark_in_world(id)})
            REQUIRE((!landmark ||
                     (cairn::all_finite(landmark->mean) && cairn::all_finite(landmark->covariance))));
        }
        static_cast<void>(map.locate(frames[11].T_world_camera, frames[11].sightings));
        ++works;
      } catch (const cairn::Error& error) {
        CHECK(std::string(error.what()).size() > 10);
        ++refused;
      }
    }
    CHECK(refused > 50);
    CHECK(works > 50);
  }
}

}  // namespace keyframe_map_file_test
