// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "saved_map.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/io/binary_file.hpp>
#include <cairn/io/file.hpp>
#include <cairn/manifold/se3.hpp>

#include "slam/simulated_arena.hpp"
#include "support/folder.hpp"

namespace saved_map_test {
namespace {

using stereo_slam::SavedMap;

SavedMap map_of_a_frame() {
  cairn::KeyframeMap map(cairn_test::arena_rig());
  map.begin(cairn::SE3());
  SavedMap saved{stereo_slam::FeatureKind::surf, true, 5, map, {}, std::nullopt};
  const auto frames = cairn_test::arena_frames({.frames = 1});
  for (const cairn::StereoSighting& s : frames[0].sightings) {
    if (!saved.map.add_landmark(s)) continue;
    stereo_slam::Landmark landmark;
    landmark.id = s.landmark;
    landmark.descriptor.assign(64, static_cast<float>(s.landmark));
    landmark.sign = -1;
    landmark.grey = 200;
    landmark.first_seen = 3;
    landmark.last_seen = 4;
    landmark.sightings = 2;
    if (s.landmark % 2 == 0) {
      stereo_slam::SurfacePatch patch{s.left, {0.01, -0.02}, 0, {}};
      patch.grey.fill(static_cast<std::uint8_t>(s.landmark));
      patch.grey[3] = 7;
      landmark.patch = std::make_shared<const stereo_slam::SurfacePatch>(patch);
    }
    saved.landmarks.push_back(landmark);
  }
  return saved;
}

}  // namespace

TEST_SUITE("saved_map") {
  TEST_CASE("saved_map: the fuzz target begins with maps of this version") {
    const cairn_test::Folder folder;
    const auto corpus = std::filesystem::path(__FILE__).parent_path().parent_path() / "fuzz/corpus/drive_map";
    for (const char* name : {"plain_1", "rig_1"}) {
      CAPTURE(name);
      cairn::BinaryWriter numbers;
      for (const char c : cairn::read_file(corpus / name)) numbers.put(c);
      cairn::write_file_atomically(folder / "map", numbers.file("cairnmap", stereo_slam::saved_map_version));
      const SavedMap map = stereo_slam::load_map(folder / "map");
      CHECK(map.landmarks.size() == 6);
      CHECK(static_cast<bool>(map.landmarks.front().patch));
      CHECK(map.map.rig_correction().has_value() == (name == std::string("rig_1")));
      CHECK(map.truth.has_value() == (name == std::string("rig_1")));
    }
  }

  TEST_CASE("saved_map: everything is there again, landmarks numbered in their order") {
    const cairn_test::Folder folder;
    SavedMap saved = map_of_a_frame();
    REQUIRE(saved.landmarks.size() > 100);
    stereo_slam::save_map(folder / "map", saved);
    CHECK_FALSE(stereo_slam::load_map(folder / "map").truth);
    saved.truth = {"a world", cairn::SE3::exp((cairn::Vector<6>() << 1, -2, 3, 0.1, 0.2, -0.3).finished())};
    stereo_slam::save_map(folder / "map", saved);
    const SavedMap loaded = stereo_slam::load_map(folder / "map");
    REQUIRE(loaded.truth);
    CHECK(loaded.truth->name == "a world");
    CHECK(cairn::local(loaded.truth->T_truth_map, saved.truth->T_truth_map).norm() < 1e-12);
    CHECK(loaded.features == saved.features);
    CHECK(loaded.oriented);
    CHECK(loaded.steps == 5);
    CHECK(loaded.map.landmark_count() == saved.landmarks.size());
    REQUIRE(loaded.landmarks.size() == saved.landmarks.size());
    for (std::size_t i = 0; i < loaded.landmarks.size(); ++i) {
      const stereo_slam::Landmark &was = saved.landmarks[i], &is = loaded.landmarks[i];
      CHECK(is.id == i);
      CHECK(is.descriptor == was.descriptor);
      CHECK(is.sign == was.sign);
      CHECK(is.grey == was.grey);
      REQUIRE(static_cast<bool>(is.patch) == static_cast<bool>(was.patch));
      if (was.patch) {
        CHECK(is.patch->pixel == was.patch->pixel);
        CHECK(is.patch->slope == was.patch->slope);
        CHECK(is.patch->grey == was.patch->grey);
        CHECK(is.patch->keyframe == 0);
      }
      CHECK(is.first_seen == was.first_seen);
      CHECK(is.last_seen == was.last_seen);
      CHECK(is.sightings == was.sightings);
    }
  }

  TEST_CASE("saved_map: what is missing, cut, damaged or no map is named") {
    const cairn_test::Folder folder;
    stereo_slam::save_map(folder / "map", map_of_a_frame());
    const std::string bytes = cairn::read_file(folder / "map");
    folder.put("cut", bytes.substr(0, bytes.size() - 1));
    folder.put("text", "not a map at all, but a text of some length");
    std::string damaged = bytes;
    damaged[bytes.size() / 2] = static_cast<char>(damaged[bytes.size() / 2] ^ 1);
    folder.put("damaged", damaged);
    for (const char* name : {"none", "cut", "text", "damaged"}) {
      CAPTURE(name);
      CHECK_THROWS_WITH_AS(stereo_slam::load_map(folder / name), doctest::Contains((folder / name).c_str()),
                           cairn::Error);
    }
  }
}

}  // namespace saved_map_test
