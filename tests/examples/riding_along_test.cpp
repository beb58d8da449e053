// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "riding_along.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/geometry/stereo_rig.hpp>

namespace riding_along_test {
namespace {

using stereo_slam::Apparent;
using stereo_slam::RidingAlong;
using Pixels = std::vector<cairn::Vector<2>>;

constexpr int width = 640, height = 240;

cairn::StereoRig street_rig() {
  const cairn::PinholeCamera camera(
      {.fx = 400, .fy = 400, .cx = 320, .cy = 120, .width = width, .height = height});
  return {camera, camera, cairn::SE3(cairn::SO3(), {0.5, 0, 0})};
}

/// A part of the left image [pixels].
struct Box {
  double left, top, right, bottom;
};
constexpr Box whole{40, 5, 635, 235};

/// The matches of one frame of a rig that began at the origin.
class Frame {
public:
  Frame(const cairn::SE3& T_world_camera, std::uint64_t seed)
      : T_world_camera_(T_world_camera), random_(seed) {}

  /// Points of the world that were seen in that part of the image at first, and are in view now; returns
  /// their indices.
  std::vector<std::size_t> see(std::size_t count, const Box& box, double nearest = 6, double farthest = 30) {
    return add(count, box, nearest, farthest, T_world_camera_);
  }
  /// Points that ride along.
  std::vector<std::size_t> carry(std::size_t count, const Box& box, double nearest = 6, double farthest = 7) {
    return add(count, box, nearest, farthest, cairn::SE3());
  }
  /// Points of a body that has moved as though the rig had moved so.
  std::vector<std::size_t> pass(std::size_t count, const Box& box, const cairn::SE3& as_though,
                                double nearest = 6, double farthest = 7) {
    return add(count, box, nearest, farthest, as_though);
  }
  /// What a map that was loaded does not know.
  void forget_first() {
    for (Apparent& one : apparent_) one.first.setConstant(std::numeric_limits<double>::quiet_NaN());
  }

  [[nodiscard]] cairn::StereoPose pose() const { return estimate(matches_); }
  RidingAlong::Decision decide(RidingAlong& what) const { return decide(what, pose()); }
  RidingAlong::Decision decide(RidingAlong& what, const cairn::StereoPose& first) const {
    return what.decide(first, rig_.left, {matches_, apparent_}, estimate);
  }
  [[nodiscard]] bool is_here(const cairn::SE3& T_world_camera) const {
    return cairn::local(T_world_camera_, T_world_camera).norm() < 0.02;
  }
  [[nodiscard]] const Apparent& apparent(std::size_t i) const { return apparent_[i]; }

private:
  static cairn::StereoPose estimate(std::span<const cairn::StereoMatch> matches) {
    return cairn::estimate_stereo_pose(street_rig(), matches, {.min_inliers = 10});
  }

  std::vector<std::size_t> add(std::size_t count, const Box& box, double nearest, double farthest,
                               const cairn::SE3& T_world_camera) {
    std::vector<std::size_t> added;
    while (added.size() < count) {
      const double z = 1 / random_.uniform(1 / farthest, 1 / nearest);
      const double u = random_.uniform(box.left, box.right), v = random_.uniform(box.top, box.bottom);
      const cairn::Vector<3> point((u - 320) * z / 400, (v - 120) * z / 400, z);
      const auto first = rig_.project(point), now = rig_.project(T_world_camera.inverse() * point);
      const auto in_view = [](const cairn::Vector<2>& p) {
        return p(0) > 0 && p(0) < width && p(1) > 0 && p(1) < height;
      };
      if (!first || !now || !in_view(now->head<2>()) || !in_view(now->tail<2>())) continue;
      const cairn::Vector<4> seen =
          *now + cairn::Vector<4>::NullaryExpr([&](auto) { return random_.normal(0, 0.1); });
      added.push_back(matches_.size());
      apparent_.push_back({*first, seen});
      matches_.push_back(
          {point, 1e-6 * cairn::Matrix<3>::Identity(), seen.head<2>(), seen.tail<2>(), 0.35, 0.35});
    }
    return added;
  }

  cairn::SE3 T_world_camera_;
  cairn::Random random_;
  cairn::StereoRig rig_ = street_rig();
  std::vector<cairn::StereoMatch> matches_;
  std::vector<Apparent> apparent_;
};

cairn::SE3 ahead(double metres) {
  return {cairn::SO3(), {0, 0, metres}};
}

RidingAlong nothing_known() {
  const cairn::Image image(width, height);
  return {image, image};
}

}  // namespace

TEST_SUITE("riding along") {
  TEST_CASE("riding along: a body with most of the matches is not the world, and the motion is of what is") {
    RidingAlong what = nothing_known();
    Frame frame(ahead(1), 1);
    const auto body = frame.carry(300, {200, 160, 440, 235});
    const auto scene = frame.see(60, whole);
    const cairn::StereoPose outvoted = frame.pose();
    REQUIRE(outvoted.good());
    REQUIRE_FALSE(frame.is_here(outvoted.T_world_camera));
    const RidingAlong::Decision decision = frame.decide(what);
    CHECK(frame.is_here(decision.pose.T_world_camera));
    CHECK(decision.riding == body);
    REQUIRE(decision.pose.inliers.size() == 360);
    CHECK(std::ranges::count_if(scene, [&](std::size_t i) { return decision.pose.inliers[i] != 0; }) > 50);
    CHECK(std::ranges::none_of(body, [&](std::size_t i) { return decision.pose.inliers[i] != 0; }));
  }

  TEST_CASE("riding along: where no pose agrees with all matches the scene's is found beside the body") {
    RidingAlong what = nothing_known();
    Frame frame(ahead(1), 2);
    frame.see(60, whole);
    const auto body = frame.carry(300, {200, 160, 440, 235});
    cairn::StereoPose none;
    none.inliers.assign(360, 0);
    const RidingAlong::Decision decision = frame.decide(what, none);
    REQUIRE(decision.pose.good());
    CHECK(frame.is_here(decision.pose.T_world_camera));
    CHECK(decision.riding == body);
  }

  TEST_CASE("riding along: what passes a rig that stands is not the world, whichever has more matches") {
    for (const std::size_t lorry : {std::size_t{100}, std::size_t{300}}) {
      CAPTURE(lorry);
      RidingAlong what = nothing_known();
      for (int i = 0; i < 5; ++i) {
        Frame frame(cairn::SE3(), static_cast<std::uint64_t>(i));
        frame.see(180, whole);
        frame.pass(lorry, {100, 60, 300, 180}, cairn::SE3(cairn::SO3(), {0.3, 0, 0}));
        const RidingAlong::Decision decision = frame.decide(what);
        CHECK(frame.is_here(decision.pose.T_world_camera));
        CHECK(decision.riding.empty());
        CHECK_FALSE(what.close_frame(static_cast<std::size_t>(i)));
      }
      CHECK(what.sureness() != RidingAlong::known);
      CHECK(what.record().largest_share == 0);
    }
  }

  TEST_CASE(
      "riding along: of a rig that drives what stands still has to reach twice as far to be the world") {
    RidingAlong what = nothing_known();
    Frame frame(ahead(1), 3);
    frame.see(300, {100, 20, 540, 170});
    frame.carry(60, whole, 8, 12);
    const RidingAlong::Decision decision = frame.decide(what);
    CHECK(frame.is_here(decision.pose.T_world_camera));
    CHECK(decision.riding.size() > 40);
  }

  TEST_CASE(
      "riding along: what a motion was told by is suspected in the next frame, however far it reaches") {
    const auto next = [](RidingAlong& what) {
      Frame frame(ahead(2), 5);
      frame.see(60, {200, 5, 440, 100}, 6, 7);
      frame.carry(300, {60, 160, 620, 235});
      return frame.is_here(frame.decide(what).pose.T_world_camera);
    };
    RidingAlong unknowing = nothing_known();
    REQUIRE_FALSE(next(unknowing));
    RidingAlong what = nothing_known();
    Frame frame(ahead(1), 4);
    frame.see(240, {40, 5, 635, 155});
    frame.carry(1500, {60, 160, 620, 235});
    static_cast<void>(frame.decide(what));
    CHECK(next(what));
  }

  TEST_CASE(
      "riding along: once something is known to ride along, more that stands still does not stop the rig") {
    const auto next = [](RidingAlong& what) {
      Frame frame(ahead(4), 9);
      frame.see(90, {250, 90, 390, 150}, 15);
      frame.carry(60, whole);
      return frame.is_here(frame.decide(what).pose.T_world_camera);
    };
    RidingAlong unknowing = nothing_known();
    REQUIRE_FALSE(next(unknowing));
    RidingAlong what = nothing_known();
    for (int i = 1; i <= 3; ++i) {
      Frame frame(ahead(i), static_cast<std::uint64_t>(i));
      frame.see(100, whole);
      frame.carry(100, {300, 200, 380, 235});
      static_cast<void>(frame.decide(what));
    }
    CHECK(next(what));
  }

  TEST_CASE(
      "riding along: of two motions that reach about as far the one that is nearer is no part of the world") {
    // The same halves of the image: what stands there is a near body, or a street beside a near lorry.
    const Box left_half{80, 5, 340, 235};
    const cairn::SE3 sideways(cairn::SO3(), {0.4, 0, 0});
    {
      RidingAlong what = nothing_known();
      Frame frame(sideways, 21);
      const auto body = frame.carry(300, left_half, 3, 3.5);
      frame.see(80, {360, 40, 600, 200}, 15);
      const RidingAlong::Decision decision = frame.decide(what);
      CHECK(frame.is_here(decision.pose.T_world_camera));
      CHECK(decision.riding == body);
    }
    {
      RidingAlong what = nothing_known();
      Frame frame(cairn::SE3(), 22);
      frame.see(80, {360, 40, 600, 200}, 15);
      frame.pass(300, left_half, sideways, 3, 3.5);
      const RidingAlong::Decision decision = frame.decide(what);
      CHECK(frame.is_here(decision.pose.T_world_camera));
      CHECK(decision.riding.empty());
    }
  }

  TEST_CASE(
      "riding along: a rig that stood while something moved stands on, where that covers most of the image") {
    const auto covered = [](RidingAlong& what) {
      Frame frame(cairn::SE3(), 31);
      frame.see(100, {400, 40, 620, 200}, 8, 12);
      frame.pass(400, {40, 5, 390, 235}, cairn::SE3(cairn::SO3(), {0.4, 0, 0}));
      return frame.is_here(frame.decide(what).pose.T_world_camera);
    };
    RidingAlong unknowing = nothing_known();
    REQUIRE_FALSE(covered(unknowing));
    RidingAlong what = nothing_known();
    Frame frame(cairn::SE3(), 30);
    frame.see(200, whole, 8, 12);
    frame.pass(100, {40, 40, 120, 200}, cairn::SE3(cairn::SO3(), {0.4, 0, 0}));
    REQUIRE(frame.is_here(frame.decide(what).pose.T_world_camera));
    CHECK(covered(what));
  }

  TEST_CASE(
      "riding along: where too few moved to say so points are looked for everywhere, for eight frames more") {
    RidingAlong what = nothing_known();
    CHECK(what.sureness() == RidingAlong::unsuspected);
    Frame frame(ahead(1), 41);
    frame.see(18, whole);
    frame.carry(300, {60, 160, 620, 235});
    CHECK_FALSE(frame.is_here(frame.decide(what).pose.T_world_camera));
    CHECK_FALSE(what.close_frame(0));
    REQUIRE(what.sureness() == RidingAlong::suspected);
    CHECK(what.left_alone()->evenly);
    const auto everywhere = what.left_alone();
    for (std::size_t i = 1; i <= 8; ++i) {
      CHECK(what.left_alone() == everywhere);
      Frame quiet(cairn::SE3(), i);
      quiet.see(100, whole);
      static_cast<void>(quiet.decide(what));
      CHECK_FALSE(what.close_frame(i));
    }
    CHECK(what.sureness() == RidingAlong::unsuspected);
    for (std::size_t i = 1; i <= 3; ++i) {
      Frame clear(ahead(1), 50 + i);
      clear.see(150, whole);
      clear.carry(300, {200, 160, 440, 235});
      static_cast<void>(clear.decide(what));
      static_cast<void>(what.close_frame(8 + i));
    }
    CHECK(what.sureness() == RidingAlong::known);
  }

  TEST_CASE("riding along: far points that stand still because they are far are part of the world") {
    RidingAlong what = nothing_known();
    Frame frame(ahead(1), 6);
    frame.see(100, whole);
    const auto far = frame.see(100, {280, 80, 360, 160}, 400, 900);
    const RidingAlong::Decision decision = frame.decide(what);
    CHECK(frame.is_here(decision.pose.T_world_camera));
    CHECK(decision.riding.empty());
    CHECK(std::ranges::count_if(far, [&](std::size_t i) { return decision.pose.inliers[i] != 0; }) > 80);
  }

  TEST_CASE("riding along: a few matches that stand still are left to the pose, and no cell learns of them") {
    RidingAlong what = nothing_known();
    for (int i = 1; i <= 4; ++i) {
      Frame frame(ahead(i), 7);
      frame.see(100, whole);
      frame.carry(9, {300, 200, 380, 235});
      CHECK(frame.decide(what).riding.empty());
    }
    CHECK_FALSE(what.close_frame(3));
    CHECK_FALSE(what.left_alone());
  }

  TEST_CASE("riding along: of a map that was loaded nothing is known to stand still") {
    RidingAlong what = nothing_known();
    Frame frame(ahead(1), 8);
    frame.see(100, whole);
    frame.carry(60, {200, 160, 440, 235});
    frame.forget_first();
    const RidingAlong::Decision decision = frame.decide(what);
    CHECK(frame.is_here(decision.pose.T_world_camera));
    CHECK(decision.riding.empty());
  }

  TEST_CASE(
      "riding along: after three frames both images' cells are left out, it is said once, and not "
      "every cell is told of") {
    RidingAlong what = nothing_known();
    const Box box{200, 160, 440, 235};
    for (std::size_t i = 1; i <= 6; ++i) {
      Frame frame(ahead(static_cast<double>(i)), i);
      frame.see(100, whole);
      frame.carry(600, box);
      static_cast<void>(frame.decide(what));
      const std::optional<std::string> note = what.close_frame(40 + i);
      CHECK(note.has_value() == (i == 3));
      if (note) CHECK(note->find("from frame 43 on") == 0);
      CHECK((what.left_alone() != nullptr) == (i >= 3));
    }
    CHECK(what.record().since == 43);
    CHECK(what.record().share > 0.09);
    CHECK(what.record().share < 0.25);
    const auto alone = what.left_alone();
    const double before = what.record().share;
    for (std::size_t i = 7; i <= 13; ++i) {  // the scene was seen to move there
      Frame frame(ahead(static_cast<double>(i)), i);
      frame.see(100, {40, 5, 635, 150});
      frame.carry(12, {500, 202, 518, 218});
      static_cast<void>(frame.decide(what));
      CHECK_FALSE(what.close_frame(40 + i));
    }
    CHECK(what.record().share > before);
    CHECK(what.left_alone() == alone);
    const double disparity = 400 * 0.5 / 6.5;
    const cairn::Vector<2> inside(320, 180), outside(320, 40);
    const cairn::Vector<2> right_inside(320 - disparity, 180);
    CHECK(what.hides(inside, outside));
    CHECK(what.hides(outside, right_inside));
    CHECK_FALSE(what.hides(outside, outside));
    const cairn::Vector<2> beside_left(175, 180), beside_right(435, 180);  // each the other's inside
    CHECK_FALSE(what.hides(beside_left, outside));
    CHECK(what.hides(outside, beside_left));
    CHECK_FALSE(what.hides(outside, beside_right));
  }

  TEST_CASE(
      "riding along: how far points reach does not hang on how many they are, nor on one that is wrong") {
    Pixels points;
    for (int i = 0; i <= 100; ++i) points.push_back({10.0 * i, 2.0 * i});
    const double few = stereo_slam::reach(points);
    CHECK(few == doctest::Approx(900 * 180));
    points.push_back({1e6, 1e6});
    CHECK(stereo_slam::reach(points) < 1.05 * few);
  }
}

}  // namespace riding_along_test
