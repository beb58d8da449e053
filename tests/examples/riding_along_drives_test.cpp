// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>

#include "arena_dataset.hpp"
#include "dataset.hpp"
#include "pipeline.hpp"
#include "support/data.hpp"

namespace riding_along_drives_test {
namespace {

using stereo_slam::PipelineOptions;
using stereo_slam::RunRecord;
using stereo_slam::StereoFrame;

/// Blobs of two to four pixels, as speckled paint has them.
cairn::Image texture(int width, int height, std::uint64_t seed) {
  cairn::Random random(seed);
  std::vector<double> values(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 120);
  for (int blob = 0; blob < width * height / 25; ++blob) {
    const double x = random.uniform(0, width), y = random.uniform(0, height), r = random.uniform(1, 2.5);
    const double bright = random.uniform(-90, 90);
    for (int v = std::max(0, int(y - 3 * r)); v < std::min(height, int(y + 3 * r)); ++v)
      for (int u = std::max(0, int(x - 3 * r)); u < std::min(width, int(x + 3 * r)); ++u)
        values[static_cast<std::size_t>(v * width + u)] +=
            bright * std::exp(-((u - x) * (u - x) + (v - y) * (v - y)) / (2 * r * r));
  }
  cairn::Image image(width, height);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      image(u, v) =
          static_cast<std::uint8_t>(std::clamp(values[static_cast<std::size_t>(v * width + u)], 0.0, 255.0));
  return image;
}

/// `patch` with its left upper corner at (x, y) of the left image and `disparity` more to the left in the
/// right one.
void paste(StereoFrame& frame, const cairn::Image& patch, int x, int y, int disparity) {
  const auto into = [&](cairn::Image& image, int column) {
    for (int v = 0; v < patch.height() && y + v < image.height(); ++v)
      for (int u = 0; u < patch.width(); ++u)
        if (column + u >= 0 && column + u < image.width()) image(column + u, y + v) = patch(u, v);
  };
  into(frame.left, x);
  into(frame.right, x - disparity);
}

/// What sensors add: no two images are alike to the last bit.
void add_noise(StereoFrame& frame, std::uint64_t seed) {
  cairn::Random random(seed);
  for (cairn::Image* image : {&frame.left, &frame.right})
    for (int v = 0; v < image->height(); ++v)
      for (int u = 0; u < image->width(); ++u)
        (*image)(u, v) = static_cast<std::uint8_t>(std::clamp((*image)(u, v) + random.normal(), 0.0, 255.0));
}

/// A sixth of the image, at its lower rim.
void add_body(StereoFrame& frame, std::size_t i, int disparity) {
  const int width = frame.left.width() / 2, height = frame.left.height() / 3;
  paste(frame, texture(width, height, 7), width / 2, frame.left.height() - height, disparity);
  add_noise(frame, 100 + i);
}

const stereo_slam::Dataset& arena() {
  static const auto data = [] {
    stereo_slam::ArenaOptions options;
    options.script = "loop";
    options.width = 384;
    options.height = 288;
    options.cache = false;
    return stereo_slam::open_arena(options, 24, 2);
  }();
  return *data;
}

std::vector<StereoFrame> frames_of(const stereo_slam::Dataset& data, std::size_t count) {
  std::vector<StereoFrame> frames;
  for (std::size_t i = 0; i < count; ++i) frames.push_back(data.frame(i));
  return frames;
}

RunRecord run(const cairn::StereoRig& rig, const std::vector<StereoFrame>& frames, int points,
              unsigned threads = 2) {
  PipelineOptions options;
  options.points = points;
  options.threads = threads;
  stereo_slam::Pipeline pipeline(rig, options);
  for (const StereoFrame& frame : frames) pipeline.step(frame);
  return pipeline.record();
}

bool all_tracked(const RunRecord& record) {
  return std::ranges::all_of(record.frames, [](const auto& frame) { return frame.tracked; });
}

/// Largest of the position [m].
double worst_error(const RunRecord& record) {
  double worst = 0;
  for (const auto& frame : record.frames)
    worst = std::max(worst, cairn::local(*frame.truth, frame.T_world_camera).head<3>().norm());
  return worst;
}

}  // namespace

TEST_SUITE("riding along on drives") {
  TEST_CASE(
      "riding along on drives: a rig that sees its own body drives as well as without, and says so, to the "
      "same bits") {
    const std::size_t count = arena().size();
    std::vector<StereoFrame> frames = frames_of(arena(), count);
    const RunRecord clean = run(arena().rig(), frames, 700);
    CHECK_FALSE(clean.riding_along.since);
    for (std::size_t i = 0; i < count; ++i) add_body(frames[i], i, 30);
    const RunRecord record = run(arena().rig(), frames, 700);
    CAPTURE(worst_error(clean));
    CHECK(all_tracked(record));
    CHECK(worst_error(record) < worst_error(clean) + 0.004);
    REQUIRE(record.riding_along.since);
    CHECK(record.riding_along.share > 0.08);
    CHECK(record.riding_along.largest_share < 0.25);
    REQUIRE(record.notes.size() == 1);
    CHECK(record.notes[0].find("stands still while the camera moves") != std::string::npos);
    const RunRecord again = run(arena().rig(), frames, 700, 3);
    for (std::size_t i = 0; i < count; ++i)
      CHECK(again.frames[i].T_world_camera.matrix() == record.frames[i].T_world_camera.matrix());
  }

  TEST_CASE("riding along on drives: dirt that comes on a drive is left out, and is not held for the world") {
    const std::size_t count = arena().size();
    std::vector<StereoFrame> frames = frames_of(arena(), count);
    for (std::size_t i = 8; i < count; ++i) add_body(frames[i], i, 30);
    const RunRecord record = run(arena().rig(), frames, 700);
    CHECK(all_tracked(record));
    CHECK(worst_error(record) < 0.02);
  }

  TEST_CASE(
      "riding along on drives: a rig that stands while something large passes stands, and nothing is left "
      "out") {
    for (const bool from_the_start : {true, false}) {
      CAPTURE(from_the_start);
      std::vector<StereoFrame> frames;
      const cairn::Image lorry = texture(150, 150, 9);
      for (int i = 0; i < 14; ++i) {
        frames.push_back(arena().frame(0));
        if (from_the_start || i > 4) paste(frames.back(), lorry, 10 + 9 * i, 60, 30);
        add_noise(frames.back(), static_cast<std::uint64_t>(i));
      }
      const RunRecord record = run(arena().rig(), frames, 700);
      CHECK(all_tracked(record));
      CHECK(worst_error(record) < 0.01);
      CHECK(record.riding_along.largest_share == 0);
      CHECK(record.notes.empty());
    }
  }

  TEST_CASE("riding along on drives: a body in a recorded drive is left out") {
    const auto folder = cairn_test::real_data("kitti_odometry_a");
    if (!folder) return;
    stereo_slam::DatasetOptions options;
    options.kind = "kitti_odometry";
    options.folder = *folder;
    const auto data = stereo_slam::open_dataset(options);
    std::vector<StereoFrame> frames;
    for (std::size_t i = 0; i < 12; ++i) frames.push_back(data->frame(20 + i));
    for (std::size_t i = 0; i < frames.size(); ++i) add_body(frames[i], i, 30);
    const RunRecord record = run(data->rig(), frames, 2000);
    CHECK(all_tracked(record));
    REQUIRE(record.riding_along.since);
    CHECK(worst_error(record) < 0.2);  // of 13 m
  }
}

}  // namespace riding_along_drives_test
