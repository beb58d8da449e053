// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Maps of keyframes, the file's head and checksum made to fit: what is loaded is a map that answers in finite
// numbers, and is the same map when saved and loaded again.
#include <cstddef>
#include <cstdint>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/slam/keyframe_map_file.hpp>

#include "fuzz/scratch.hpp"
#include "support/made_up_file.hpp"

namespace {

cairn::KeyframeMap loaded(const std::string& bytes) {
  cairn::BinaryReader in(bytes, "fuzzing ", 1, "a");
  cairn::KeyframeMap map = cairn::load_keyframe_map(in);
  in.expect_end();
  return map;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    cairn::KeyframeMap map = loaded(cairn_test::file_holding(cairn_fuzz::text_of(data, size), "fuzzing ", 1));
    cairn::BinaryWriter again;
    cairn::save_keyframe_map(again, map);
    cairn_fuzz::expect(loaded(again.file("fuzzing ", 1)).landmark_count() == map.landmark_count(),
                       "a map that was loaded can be saved");
    for (const std::uint32_t id : map.landmark_ids())
      for (const auto& landmark : {map.landmark(id), map.landmark_in_world(id)})
        cairn_fuzz::expect(
            !landmark || (cairn::all_finite(landmark->mean) && cairn::all_finite(landmark->covariance)),
            "landmarks are finite");
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
