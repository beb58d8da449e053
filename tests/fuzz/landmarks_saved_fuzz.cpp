// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Saved maps of fastslam, the file's head and checksum made to fit: what is loaded is saved as the same
// bytes, and goes on with the next frame and is finished, or says why it cannot.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/models/sensor.hpp>

#include "fuzz/scratch.hpp"
#include "mapper.hpp"
#include "support/made_up_file.hpp"

namespace {

/// A drive along a wall of posts without names; of numbers that are the same on every machine.
fastslam::LandmarkLog drive() {
  fastslam::LandmarkLog log{.name = "posts", .sensor = {.range_sigma = 0.125, .bearing_sigma = 0.0625}};
  for (int k = 0; k < 6; ++k) {
    fastslam::Frame frame{0.5 * k, {cairn::SE2(0.5, 0, 0), cairn::Matrix<3>::Identity() * 0.015625}, {}};
    for (int post = 0; post < 2; ++post)
      frame.seen.push_back({cairn::RangeBearing::measurement(4.0 + post - 0.25 * k, 0.25 * post), {}});
    log.frames.push_back(frame);
  }
  return log;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  static const fastslam::LandmarkLog log = drive();
  const auto path =
      scratch.put("map", cairn_test::file_holding(cairn_fuzz::text_of(data, size), "cairnlmk", 1));
  try {
    fastslam::Mapper mapper = fastslam::Mapper::loaded(path, log, 1);
    mapper.save(scratch / "again");
    const std::string once = cairn::read_file(scratch / "again");
    fastslam::Mapper::loaded(scratch / "again", log, 1).save(scratch / "twice");
    cairn_fuzz::expect(once == cairn::read_file(scratch / "twice"), "a map that was loaded can be saved");
    if (mapper.options().particles > 4) return 0;
    if (mapper.has_next()) mapper.step();
    mapper.finish();
    cairn_fuzz::expect(mapper.belief().steps() == mapper.steps().size(), "every frame has a step");
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
