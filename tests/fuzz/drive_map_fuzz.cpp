// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Saved maps of stereo_slam, the file's head and checksum made to fit: what is loaded is saved and loaded as
// the same map.
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>

#include "fuzz/scratch.hpp"
#include "saved_map.hpp"
#include "support/made_up_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  const auto path = scratch.put("map", cairn_test::file_holding(cairn_fuzz::text_of(data, size), "cairnmap",
                                                                stereo_slam::saved_map_version));
  try {
    const stereo_slam::SavedMap saved = stereo_slam::load_map(path);
    cairn_fuzz::expect(saved.landmarks.size() == saved.map.landmark_count(), "every landmark is described");
    for (const stereo_slam::Landmark& landmark : saved.landmarks)
      for (const float number : landmark.descriptor)
        cairn_fuzz::expect(std::isfinite(number), "descriptors are finite");
    stereo_slam::save_map(scratch / "again", saved);
    // Rotations are made so again by loading: their last bits may differ.
    const stereo_slam::SavedMap again = stereo_slam::load_map(scratch / "again");
    cairn_fuzz::expect(again.landmarks.size() == saved.landmarks.size() && again.steps == saved.steps,
                       "a map that was loaded can be saved");
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
