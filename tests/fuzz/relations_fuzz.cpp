// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Relations between poses: what is read is finite, and measures any path.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/eval/relations.hpp>

#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  try {
    const auto relations = cairn::read_relations(scratch.put("a", cairn_fuzz::text_of(data, size)));
    cairn_fuzz::expect(!relations.empty(), "there are relations");
    std::vector<cairn::StampedPose2> path;
    for (const cairn::PoseRelation& r : relations) {
      cairn_fuzz::expect(std::isfinite(r.first_time) && std::isfinite(r.second_time) &&
                             std::isfinite(r.T_first_second.angle()),
                         "numbers are finite");
      path.push_back({r.first_time, cairn::SE2(static_cast<double>(path.size()), 0, 0)});
    }
    const cairn::RelationError error = cairn::relation_error(path, relations);
    cairn_fuzz::expect(error.count + error.missing == relations.size(),
                       "every relation is measured or missing");
    for (const double length : error.lengths) cairn_fuzz::expect(!std::isnan(length), "errors are numbers");
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
