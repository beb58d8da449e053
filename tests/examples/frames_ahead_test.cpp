// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "frames_ahead.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>

#include "arena_dataset.hpp"
#include "pipeline.hpp"

namespace frames_ahead_test {
namespace {

using stereo_slam::FrameAhead;
using stereo_slam::FramesAhead;
using stereo_slam::StereoFrame;

/// Frames of a small arena in memory, of which one may be torn.
class Kept : public stereo_slam::Dataset {
public:
  explicit Kept(std::size_t torn = 1000) : torn_(torn) {
    stereo_slam::ArenaOptions arena;
    arena.width = 320;
    arena.height = 240;
    arena.cache = false;
    const auto rendered = stereo_slam::open_arena(arena, 7, 2);
    rig_ = rendered->rig();
    for (std::size_t i = 0; i < rendered->size(); ++i) frames_.push_back(rendered->frame(i));
  }

  [[nodiscard]] std::string name() const override { return "kept"; }
  [[nodiscard]] std::size_t size() const override { return frames_.size(); }
  [[nodiscard]] const cairn::StereoRig& rig() const override { return rig_; }
  [[nodiscard]] std::vector<std::string> notes() const override { return {}; }
  [[nodiscard]] StereoFrame frame(std::size_t i) const override {
    if (i == torn_) cairn::raise("frame " + std::to_string(i) + " is torn");
    return frames_[i];
  }

private:
  std::size_t torn_;
  cairn::StereoRig rig_;
  std::vector<StereoFrame> frames_;
};

const stereo_slam::FeatureOptions few{.points = 300};

bool same_pairs(const std::vector<stereo_slam::PointPair>& a, const std::vector<stereo_slam::PointPair>& b) {
  bool same = a.size() == b.size();
  for (std::size_t i = 0; same && i < a.size(); ++i)
    same = a[i].left == b[i].left && a[i].right == b[i].right && a[i].right_pixel == b[i].right_pixel;
  return same;
}

}  // namespace

TEST_SUITE_BEGIN("examples/frames_ahead");

TEST_CASE("frames_ahead: points and pairs are those of the frame taken alone, for any number of threads") {
  const Kept data;
  const auto matcher =
      std::make_shared<const stereo_slam::StereoMatcher>(data.rig(), stereo_slam::StereoMatcherOptions());
  stereo_slam::FrontEnd alone(few, 1);
  for (const unsigned threads : {1U, 2U, 3U, 1024U}) {
    CAPTURE(threads);
    FramesAhead ahead(data, few, threads);
    ahead.match_by(matcher);
    for (std::size_t i = 0; i < data.size(); ++i) {
      CAPTURE(i);
      const FrameAhead one = ahead.take();
      const stereo_slam::FramePoints points = alone(data.frame(i), matcher);
      REQUIRE(points.left.size() > 100);
      REQUIRE(points.pairs.size() > 50);
      CHECK(one.frame.index == i);
      CHECK(one.points.left.keypoints == points.left.keypoints);
      CHECK(one.points.left.descriptors == points.left.descriptors);
      CHECK(one.points.right.keypoints == points.right.keypoints);
      CHECK(one.points.right.descriptors == points.right.descriptors);
      // Begun before the matcher was known, a frame has no pairs yet.
      CHECK((one.points.matched_by == nullptr || one.points.matched_by == matcher));
      if (one.points.matched_by) CHECK(same_pairs(one.points.pairs, points.pairs));
      if (threads == 1) CHECK(one.points.matched_by == matcher);
    }
  }
}

TEST_CASE("frames_ahead: a frame that cannot be read is heard of after all frames before it") {
  const Kept data(4);
  for (const unsigned threads : {1U, 2U, 8U}) {
    CAPTURE(threads);
    FramesAhead ahead(data, few, threads);
    for (std::size_t i = 0; i < 4; ++i) CHECK(ahead.take().frame.index == i);
    CHECK_THROWS_WITH_AS(static_cast<void>(ahead.take()), doctest::Contains("frame 4 is torn"), cairn::Error);
  }
}

TEST_CASE("frames_ahead: a pipeline does not look at pairs of another rig than its own") {
  const Kept data;
  cairn::StereoRig other = data.rig();
  other.T_left_right = {other.T_left_right.rotation() * cairn::SO3::exp({0.02, 0, 0}),
                        other.T_left_right.translation()};
  const auto stranger =
      std::make_shared<const stereo_slam::StereoMatcher>(other, stereo_slam::StereoMatcherOptions());
  stereo_slam::PipelineOptions options;
  options.points = few.points;
  options.calibrate = stereo_slam::Calibration::off;
  stereo_slam::FrontEnd front_end(stereo_slam::feature_options(options), 1);
  stereo_slam::Pipeline alone(data.rig(), options), fed(data.rig(), options), misled(data.rig(), options);
  for (std::size_t i = 0; i < data.size(); ++i) {
    const StereoFrame frame = data.frame(i);
    const auto& expected = alone.step(frame);
    CHECK(fed.step(frame, front_end(frame, fed.settled_matcher())).T_world_camera.matrix() ==
          expected.T_world_camera.matrix());
    const auto points = front_end(frame, stranger);
    CHECK(misled.step(frame, points).T_world_camera.matrix() == expected.T_world_camera.matrix());
    CHECK(points.pairs.size() < static_cast<std::size_t>(expected.stereo_matches));  // they would mislead
  }
}

TEST_CASE("frames_ahead: the rig is settled where it is not corrected, and as soon as that is known") {
  const Kept data;
  using stereo_slam::Calibration;
  const auto settled = [&](Calibration calibrate, std::size_t frames) {
    stereo_slam::PipelineOptions options;
    options.points = few.points;
    options.calibrate = calibrate;
    stereo_slam::Pipeline pipeline(data.rig(), options);
    for (std::size_t i = 0; i < frames; ++i) pipeline.step(data.frame(i));
    return pipeline.settled_matcher() != nullptr;
  };
  CHECK(settled(Calibration::off, 0));
  CHECK(settled(Calibration::off, 1));
  CHECK_FALSE(settled(Calibration::automatic, 0));
  CHECK(settled(Calibration::automatic, 1));  // the arena's rig is what it says
  CHECK_FALSE(settled(Calibration::on, 0));
  CHECK_FALSE(settled(Calibration::on, 1));
  CHECK_FALSE(settled(Calibration::drifting, 1));
}

TEST_SUITE_END();

}  // namespace frames_ahead_test
