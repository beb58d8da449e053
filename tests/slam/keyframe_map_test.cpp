// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/slam/keyframe_map.hpp>

#include "simulated_arena.hpp"
#include "support/elimination.hpp"
#include "support/random.hpp"
#include "support/violation.hpp"

namespace keyframe_map_test {
namespace {

using cairn::dynamic;
using cairn::KeyframeMap;
using cairn::KeyframeMapOptions;
using cairn::Matrix;
using cairn::SE3;
using cairn::StereoSighting;
using cairn::Vector;
using cairn_test::ArenaFrame;

constexpr double sigma = 0.5;

/// Keyframes side by side that look at the same points, and where each sees them. The first sees pairs that
/// make points: one pair in 400 has a gap of more than three deviations between its rays, and is no landmark.
struct Scene {
  std::vector<SE3> poses;
  std::vector<Vector<3>> points;
  std::vector<std::vector<StereoSighting>> seen;  // by pose, of all points in order
};

Scene scene(std::uint64_t seed, int poses, int points, double noise = sigma) {
  cairn::Random random(seed);
  const cairn::StereoRig rig = cairn_test::arena_rig();
  const cairn::Triangulator triangulate(rig);
  Scene result;
  for (int k = 0; k < poses; ++k)
    result.poses.push_back(SE3(cairn::SO3::exp(Vector<3>(0.01 * k, 0.03 * k, -0.02 * k)),
                               Vector<3>(-0.12 * k, 0.03 * k, 0.2 * k)));
  for (int i = 0; i < points; ++i) {
    const double z = random.uniform(3, 7);
    result.points.push_back({random.uniform(-0.22, 0.22) * z, random.uniform(-0.18, 0.18) * z, z});
  }
  for (const SE3& pose : result.poses) {
    result.seen.emplace_back();
    for (std::size_t i = 0; i < result.points.size(); ++i) {
      const Vector<4> pixels = rig.project(pose.inverse() * result.points[i]).value();
      StereoSighting s;
      s.landmark = static_cast<std::uint32_t>(i);
      s.sigma = sigma;
      do {
        for (int c = 0; c < 2; ++c) {
          s.left(c) = pixels(c) + noise * random.normal();
          s.right(c) = pixels(2 + c) + noise * random.normal();
        }
      } while (result.seen.size() == 1 && !triangulate(s.left, s.right, sigma, sigma).good());
      result.seen.back().push_back(s);
    }
  }
  return result;
}

/// Nothing but least squares: no gate, no loss, no caps.
KeyframeMapOptions plain() {
  KeyframeMapOptions options;
  options.sightings_a_visit = options.sightings = 6;
  options.gate_probability = 1 - 1e-12;
  options.loss = cairn::RobustLoss::none;
  options.first_sigma = 1e-4;
  options.contradiction = 1 - 1e-12;
  options.much_vaguer = 1e9;
  return options;
}

/// Keyframes at all poses of a scene, all points from the first.
KeyframeMap mapped(const Scene& s, const KeyframeMapOptions& options) {
  KeyframeMap map(cairn_test::arena_rig(), options);
  map.begin(s.poses[0]);
  for (const StereoSighting& one : s.seen[0]) REQUIRE(map.add_landmark(one));
  for (std::size_t k = 1; k < s.poses.size(); ++k) {
    const auto here = map.locate(s.poses[k], s.seen[k]);
    REQUIRE(here.good());
    REQUIRE(map.add_keyframe(here, s.seen[k]));
  }
  return map;
}

const cairn::RigSigmas loose_rig{.rotation = 1e-3,
                                 .direction = 1e-3,
                                 .length = 1e-3,
                                 .focal = 2e-3,
                                 .focal_ratio = 2e-3,
                                 .centre = 2e-3,
                                 .right_centre = 2e-3};
/// A rig whose pairs still pass the gates before anything is learned: off by half a pixel at the rim.
const cairn::RigSigmas nearly_right{.rotation = 2e-4,
                                    .direction = 1e-3,
                                    .length = 1e-3,
                                    .focal = 2e-3,
                                    .focal_ratio = 7e-4,
                                    .centre = 1e-3,
                                    .right_centre = 2e-4};

/// The inverse of the full information matrix of poses, the rig (where it is not known) and points, by
/// differences of the projection, at the truth. Steps in the world.
Matrix<dynamic> full_covariance(const Scene& s, double first_sigma, const cairn::RigSigmas& rig_sigma = {}) {
  constexpr int of_rig = cairn::rig_numbers, of_point = 6 + of_rig, each = of_point + 3;
  const cairn::StereoRig rig = cairn_test::arena_rig();
  const cairn::RigCorrection correction(rig);
  const Eigen::Index rig_size = rig_sigma.known() ? 0 : of_rig,
                     poses = 6 * static_cast<Eigen::Index>(s.poses.size()), n = poses + rig_size,
                     all = n + 3 * static_cast<Eigen::Index>(s.points.size());
  Matrix<dynamic> information = Matrix<dynamic>::Zero(all, all);
  information.topLeftCorner(6, 6).diagonal().setConstant(1 / (first_sigma * first_sigma));
  for (Eigen::Index i = 0; i < rig_size; ++i)
    information(poses + i, poses + i) = 1 / rig_sigma.covariance()(i, i);
  for (std::size_t k = 0; k < s.poses.size(); ++k)
    for (std::size_t i = 0; i < s.points.size(); ++i) {
      std::vector<Eigen::Index> columns;  // of the pose, of the rig, of the point
      for (int c = 0; c < 6; ++c) columns.push_back(6 * static_cast<Eigen::Index>(k) + c);
      for (int c = 0; c < of_rig; ++c) columns.push_back(rig_size > 0 ? poses + c : -1);
      for (int c = 0; c < 3; ++c) columns.push_back(n + 3 * static_cast<Eigen::Index>(i) + c);
      Matrix<4, each> J;
      constexpr double h = 1e-6;
      for (int c = 0; c < each; ++c) {
        const auto pixels = [&](double step) {
          Vector<6> xi = Vector<6>::Zero();
          cairn::RigState numbers = cairn::RigState::Zero();
          Vector<3> x = s.points[i];
          (c < 6 ? xi(c) : c < of_point ? numbers(c - 6) : x(c - of_point)) += step;
          return correction.rig(numbers).project((SE3::exp(xi) * s.poses[k]).inverse() * x).value();
        };
        J.col(c) = (pixels(h) - pixels(-h)) / (2 * h * sigma);
      }
      for (int a = 0; a < each; ++a)
        for (int b = 0; b < each; ++b) {
          const Eigen::Index row = columns[static_cast<std::size_t>(a)],
                             column = columns[static_cast<std::size_t>(b)];
          if (row >= 0 && column >= 0) information(row, column) += J.col(a).dot(J.col(b));
        }
    }
  return cairn_test::inverse_of(information);
}

/// By how much a covariance differs from the one that is expected, in the direction where it does most; 0.05
/// is five per cent.
double most_off(const Matrix<dynamic>& found, const Matrix<dynamic>& expected) {
  const Matrix<dynamic> factor = cairn_test::lower_root(expected);
  const Matrix<dynamic> half = cairn_test::solved(factor, found);
  const Matrix<dynamic> ratio = cairn_test::solved(factor, half.transpose());
  return (ratio - Matrix<dynamic>::Identity(found.rows(), found.cols())).cwiseAbs().maxCoeff();
}

/// What the mean NEES of so many runs stays below, once in 20,000 not. The poses of a run share the errors of
/// a few keyframes, so that its mean scatters like a single one: over 38 arenas by 3, a single one by
/// sqrt(12).
double most_nees(int runs = 1) {
  return cairn::chi_square_mean_band(6, runs, 0.9999).high;
}

cairn_test::ArenaRun drive(const cairn_test::ArenaOptions& arena, const KeyframeMapOptions& options = {}) {
  KeyframeMap map(cairn_test::arena_rig(), options);
  return cairn_test::run_arena(cairn_test::arena_frames(arena), map);
}

}  // namespace

TEST_SUITE("keyframe_map") {
  TEST_CASE("keyframe_map: a landmark follows its keyframes to first order, and the world as a whole") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const Scene s = scene(seed, 4, 20);
    const cairn::StereoRig rig = cairn_test::arena_rig();
    cairn::Random random(seed, 7);
    for (std::size_t i = 0; i < s.points.size(); ++i) {
      cairn::detail::KeyframeLandmark landmark;
      landmark.x = s.points[i];
      landmark.count = s.poses.size();
      for (std::uint32_t k = 0; k < s.poses.size(); ++k) {
        const StereoSighting& one = s.seen[k][i];
        landmark.sightings[k] = {
            k, sigma, one.left, one.right,
            cairn::detail::WhitenedSighting::of(rig, one.left, one.right, sigma).value()};
      }
      std::vector<SE3> poses = s.poses;
      const auto view = [&](std::uint32_t k) { return cairn::detail::RigView(poses[k], rig); };
      REQUIRE(landmark.solve(view));
      Matrix<3> sum = Matrix<3>::Zero();
      for (std::size_t k = 0; k < landmark.count; ++k) sum += landmark.F[k];
      CHECK((sum - Matrix<3>::Identity()).norm() < 1e-9);
      auto moved = landmark;
      Vector<3> expected = Vector<3>::Zero();
      double each = 0;  // they may cancel, what is left of them does not
      for (std::size_t k = 0; k < poses.size(); ++k) {
        Vector<6> xi;
        for (int c = 0; c < 6; ++c) xi(c) = 1e-5 * random.normal();
        poses[k] = SE3::exp(xi) * poses[k];
        const Vector<3> part = landmark.F[k] * cairn::moved_with_world(landmark.x, xi.data());
        expected += part;
        each += part.norm();
      }
      REQUIRE(moved.solve(view));
      // What is left is second order: of the step, and of the residuals times it.
      CHECK((moved.x - landmark.x - expected).norm() < 0.12 * each + 1e-7);
    }
  }

  TEST_CASE("keyframe_map: no match sees a step that all poses make together") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    cairn::detail::KeyframeEquations equations;
    equations.open(5);
    const auto symmetric = [&] {
      Matrix<3> root;
      for (int c = 0; c < 9; ++c) root(c / 3, c % 3) = random.normal();
      return Matrix<3>(root * root.transpose());
    };
    for (int i = 0; i < 50; ++i) {
      cairn::detail::KeyframeLandmark landmark;
      landmark.x = Vector<3>(3 * random.normal(), random.normal(), 5 * random.normal());
      landmark.count = 3;
      std::array<Matrix<3>, 3> A{symmetric(), symmetric(), symmetric()};
      const Matrix<3> S = cairn::Cholesky<3>(Matrix<3>(A[0] + A[1] + A[2])).inverse();
      for (std::size_t k = 0; k < 3; ++k) landmark.F[k] = S * A[k];
      std::array<std::uint32_t, 3> place{static_cast<std::uint32_t>(i % 5),
                                         static_cast<std::uint32_t>((i + 3) % 5),
                                         static_cast<std::uint32_t>((i + 1) % 5)};
      equations.add(landmark, place, symmetric(), Vector<3>::Random(), 1.5);
    }
    const Matrix<dynamic> Q = equations.information();
    CHECK((Q - Q.transpose()).norm() < 1e-9 * Q.norm());
    Vector<6> xi;
    for (int c = 0; c < 6; ++c) xi(c) = random.normal();
    const Vector<dynamic> common = xi.replicate<6, 1>();
    CHECK((Q * common).norm() < 1e-9 * Q.norm() * xi.norm());
    CHECK(std::abs(equations.gradient().dot(common)) < 1e-9 * equations.gradient().norm() * xi.norm());
  }

  TEST_CASE("keyframe_map: keyframes solved under their prior are the dense information form's") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const Scene s = scene(seed, 3, 30);
    cairn::detail::KeyframeEquations equations;
    equations.open(2);
    for (int i = 0; i < 30; ++i) {
      cairn::detail::KeyframeLandmark landmark;
      landmark.x = s.points[static_cast<std::size_t>(i)];
      landmark.count = 2;
      landmark.F[0] = Matrix<3>::Identity() * 0.4;
      landmark.F[1] = Matrix<3>::Identity() * 0.6;
      const std::array<std::uint32_t, 2> place{0, 1};
      equations.add(landmark, place, Matrix<3>::Identity() * (1 + i), Vector<3>::Random(), 1);
    }
    Matrix<dynamic> root(12, 12);
    for (Eigen::Index j = 0; j < 12; ++j)
      for (Eigen::Index i = 0; i < 12; ++i) root(i, j) = 0.1 * random.normal();
    const Matrix<dynamic> P = root * root.transpose() + 1e-4 * Matrix<dynamic>::Identity(12, 12);
    cairn::detail::KeyframeSolution solution;
    REQUIRE(equations.solve(P, Vector<3>::Zero(), solution));
    Matrix<dynamic> M = equations.information();
    M.topLeftCorner(12, 12) += cairn_test::inverse_of(P);
    const Matrix<dynamic> inverse = cairn_test::inverse_of(M);
    CHECK((solution.covariance - inverse).norm() < 1e-7 * inverse.norm());
    CHECK((solution.step - inverse * equations.gradient()).norm() < 1e-7 * solution.step.norm());
  }

  TEST_CASE("keyframe_map: the keyframes' covariance is that of the full problem, nothing is counted twice") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const Scene s = scene(seed, 4, 50, 0.02);
    const KeyframeMapOptions options = plain();
    const Matrix<dynamic> all = full_covariance(s, options.first_sigma);
    KeyframeMap map = mapped(s, options);
    REQUIRE(map.covariance().rows() == 24);
    CHECK(most_off(map.covariance(), all.topLeftCorner(24, 24)) < 0.05);
    // And that of the landmarks, which share the keyframes' errors.
    std::vector<std::uint32_t> ids(50);
    std::iota(ids.begin(), ids.end(), 0U);
    const auto landmarks = map.landmarks_in_world(ids);
    REQUIRE(landmarks);
    CHECK(most_off(landmarks->covariance, all.bottomRightCorner(150, 150)) < 0.05);
  }

  TEST_CASE(
      "keyframe_map: with a rig that may be off, too, and the rig's numbers are those of the full problem") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    // Hardly any noise: a common focal length is seen so weakly that linearising elsewhere would show.
    const Scene s = scene(seed, 4, 50, 0.002);
    KeyframeMapOptions options = plain();
    options.rig = loose_rig;
    const Matrix<dynamic> all = full_covariance(s, options.first_sigma, options.rig);
    KeyframeMap map = mapped(s, options);
    constexpr int n = cairn::rig_numbers;
    REQUIRE(all.rows() == 24 + n + 150);
    const Matrix<dynamic> expected = all.topLeftCorner(24 + n, 24 + n);
    const auto rig = map.rig_correction();
    REQUIRE(rig);
    const Matrix<n> of_rig = expected.bottomRightCorner<n, n>();
    for (int k = 0; k < n; ++k) {
      CAPTURE(k);
      CHECK(rig->covariance(k, k) == doctest::Approx(of_rig(k, k)).epsilon(0.2).scale(0));
    }
    CHECK(of_rig(2, 2) < 0.5 * 1e-6);  // the right camera's roll is seen
    CHECK(of_rig(7, 7) < 0.1 * 4e-6);  // and the ratio of the focal lengths
    CHECK(of_rig(5, 5) == doctest::Approx(1e-6).epsilon(1e-3).scale(0));  // the size of the world is not
    CHECK(most_off(map.covariance(), expected.topLeftCorner(24, 24)) < 0.08);
    // The landmarks are as uncertain as the rig makes them, singly and together.
    const std::vector<std::uint32_t> ids{3, 40, 17, 8};
    const auto landmarks = map.landmarks_in_world(ids);
    REQUIRE(landmarks);
    Matrix<dynamic> of_points(12, 12);
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b)
        of_points.block<3, 3>(3 * a, 3 * b) =
            all.block<3, 3>(24 + n + 3 * static_cast<Eigen::Index>(ids[static_cast<std::size_t>(a)]),
                            24 + n + 3 * static_cast<Eigen::Index>(ids[static_cast<std::size_t>(b)]));
    CHECK(most_off(landmarks->covariance, of_points) < 0.08);
    const auto one = map.landmark_in_world(17);
    REQUIRE(one);
    CHECK(one->mean == landmarks->mean.segment<3>(6));
    CHECK((one->covariance - landmarks->covariance.block<3, 3>(6, 6)).norm() < 1e-9 * one->covariance.norm());
  }

  TEST_CASE(
      "keyframe_map: a number that is given again was not seen by the keyframes of the landmark before") {
    const Scene s = scene(cairn_test::seed(), 2, 40, 0.1);
    KeyframeMap map(cairn_test::arena_rig(), plain());
    map.begin(s.poses[0]);
    for (const StereoSighting& one : s.seen[0]) REQUIRE(map.add_landmark(one));
    // The last two are seen by the first keyframe alone; number 39 is then another's, which the second sees.
    const auto here = map.locate(s.poses[1], std::span(s.seen[1]).first(38));
    REQUIRE(here.good());
    REQUIRE(map.add_keyframe(here, std::span(s.seen[1]).first(38)));
    const std::vector<std::uint32_t> of_first{38};
    CHECK(map.seen_with(of_first).size() == 40);
    REQUIRE(map.forget(39));
    REQUIRE(map.add_landmark(s.seen[1][39]));
    const auto with = map.seen_with(of_first);
    CHECK(with.size() == 39);
    CHECK(std::ranges::find(with, 39U) == with.end());
  }

  TEST_CASE("keyframe_map: a world whose origin is far away locates and learns as one that begins here") {
    const Scene s = scene(cairn_test::seed(), 4, 60);
    for (const double scale : {1e5, 1e6}) {
      CAPTURE(scale);
      KeyframeMap near(cairn_test::arena_rig()), moved(cairn_test::arena_rig());
      const SE3 far(cairn::SO3::exp(Vector<3>(0.3, -0.2, 1)), scale * Vector<3>(0.9, -0.4, 0.1));
      near.begin(s.poses[0]);
      moved.begin(far * s.poses[0]);
      for (const StereoSighting& one : s.seen[0]) {
        REQUIRE(near.add_landmark(one));
        REQUIRE(moved.add_landmark(one));
      }
      for (std::size_t k = 1; k < s.poses.size(); ++k) {
        const auto here = near.locate(s.poses[k], s.seen[k]),
                   there = moved.locate(far * s.poses[k], s.seen[k]);
        REQUIRE(here.good());
        REQUIRE(there.good());
        CHECK(cairn::local(far * here.T_world_camera, there.T_world_camera).norm() < 1e-3);  // of 0.01
        CHECK(there.inlier_count + 3 >= here.inlier_count);
        CHECK(near.add_keyframe(here, s.seen[k]));
        CHECK(moved.add_keyframe(there, s.seen[k]));
      }
      CHECK(moved.keyframe_count() == 4);
    }
  }

  TEST_CASE("keyframe_map: sigmas whose squares are no numbers are refused") {
    const cairn::StereoRig rig = cairn_test::arena_rig();
    KeyframeMapOptions options;
    for (const double sigma : {1e200, 1e-200, 0.0, std::nan("")}) {
      options.first_sigma = sigma;
      CHECK_FALSE(cairn_test::violation_of([&] { KeyframeMap(rig, options); }).empty());
    }
    options = {};
    for (const double sigma : {1e200, -1.0, std::nan("")}) {
      options.rig.rotation = sigma;
      CHECK_FALSE(cairn_test::violation_of([&] { KeyframeMap(rig, options); }).empty());
    }
  }

  TEST_CASE("keyframe_map: landmarks together: none, one that is not there, one named twice") {
    const Scene s = scene(cairn_test::seed(), 2, 40, 0.1);
    KeyframeMap map = mapped(s, {});
    const auto none = map.landmarks_in_world({});
    REQUIRE(none);
    CHECK(none->mean.size() == 0);
    CHECK_FALSE(map.landmarks_in_world(std::vector<std::uint32_t>{1, 77}));
    CHECK_FALSE(KeyframeMap(cairn_test::arena_rig()).landmark_in_world(0));
    const auto twice = map.landmarks_in_world(std::vector<std::uint32_t>{5, 5});
    const auto once = map.landmark_in_world(5);
    REQUIRE(twice);
    REQUIRE(once);
    for (int a = 0; a < 2; ++a)
      for (int b = 0; b < 2; ++b)
        CHECK((twice->covariance.block<3, 3>(3 * a, 3 * b) - once->covariance).norm() <
              1e-9 * once->covariance.norm());
  }

  TEST_CASE("keyframe_map: a right camera that is turned is found, and the map is as large as the world") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const auto frames = cairn_test::arena_frames({.seed = seed, .frames = 100});
    cairn::StereoRig off = cairn_test::arena_rig();
    off.T_left_right = SE3(cairn::SO3::exp(Vector<3>(0, -5e-4, 0)), off.T_left_right.translation());
    KeyframeMapOptions options;
    const auto trusting = [&] {
      KeyframeMap map(off, options);
      return cairn_test::run_arena(frames, map);
    }();
    options.rig.rotation = options.rig.direction = 1e-3;
    KeyframeMap map(off, options);
    const auto learning = cairn_test::run_arena(frames, map);
    const auto rig = map.rig_correction();
    REQUIRE(rig);
    CHECK(std::abs(rig->mean(1) - 5e-4) < 4 * std::sqrt(rig->covariance(1, 1)));
    CHECK(std::sqrt(rig->covariance(1, 1)) < 1e-4);
    CHECK(learning.lost == 0);
    CHECK(learning.rms_position < 0.5 * trusting.rms_position);
    CHECK(learning.mean_nees() < most_nees());
  }

  TEST_CASE(
      "keyframe_map: a street whose points are first seen from afar is neither too long nor too short") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    for (const bool with_rig : {false, true}) {
      CAPTURE(with_rig);
      KeyframeMapOptions options;
      if (with_rig) options.rig.rotation = options.rig.direction = 5e-4;
      constexpr int streets = 5;
      double along = 0, nees = 0, yaw = 0;  // in standard deviations
      for (std::uint64_t i = 0; i < streets; ++i) {
        KeyframeMap map(cairn_test::car_rig(), options);
        const auto run = cairn_test::run_arena(cairn_test::street_frames(seed + 10 * i, 70), map,
                                               {.unknown = 0.3, .apart = 3});
        CHECK(run.lost <= 3);  // of 70: at the far end a few points are all there is
        along += run.last_error(2) / std::sqrt(run.last_covariance(2, 2)) / streets;
        nees += run.mean_nees() / streets;
        if (const auto rig = map.rig_correction())
          yaw += rig->mean(1) / std::sqrt(rig->covariance(1, 1)) / streets;
      }
      CHECK(std::abs(along) < 4 / std::sqrt(1.0 * streets));
      CHECK(std::abs(yaw) < 4 / std::sqrt(1.0 * streets));
      CHECK(nees > 2.5);
      CHECK(nees < 12);
    }
  }

  TEST_CASE("keyframe_map: rigs that are off by what their sigmas say are found, as well as it says") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const cairn::StereoRig nominal = cairn_test::arena_rig();
    const cairn::RigCorrection correction(nominal);
    KeyframeMapOptions options;
    options.rig = nearly_right;
    cairn::Random random(seed, 7);
    constexpr int rigs = 8;
    double of_rig = 0, of_poses = 0;
    cairn::RigState shrunk = cairn::RigState::Zero();
    for (int i = 0; i < rigs; ++i) {
      cairn::RigState truth;
      for (int k = 0; k < cairn::rig_numbers; ++k) truth(k) = options.rig.each()(k) * random.normal();
      cairn_test::ArenaOptions arena{.seed = seed + static_cast<std::uint64_t>(i), .frames = 80};
      arena.rig = correction.rig(truth);
      KeyframeMap map(nominal, options);
      const auto run = cairn_test::run_arena(cairn_test::arena_frames(arena), map);
      CHECK(run.lost == 0);
      const auto rig = map.rig_correction();
      REQUIRE(rig);
      of_rig += cairn::normalised_squared(cairn::RigState(rig->mean - truth), rig->covariance).value() / rigs;
      of_poses += run.mean_nees() / rigs;
      shrunk += rig->covariance.diagonal().cwiseSqrt().cwiseQuotient(options.rig.each()) / rigs;
    }
    // Of 12 and of 6; chi^2 of 96 degrees of freedom over 8 lies in 6.9 to 18 with 99.99 %. Poses share the
    // rig's error, which makes means over a run scatter more.
    CHECK(of_rig > 6);
    CHECK(of_rig < 19);
    CHECK(of_poses > 2.5);
    CHECK(of_poses < 13);
    CHECK(shrunk(2) < 0.5);
    CHECK(shrunk(7) < 0.5);
    CHECK(shrunk(5) > 0.98);  // no image shows the baseline's length
  }

  TEST_CASE("keyframe_map: a rig that is known loses little by being estimated") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const auto frames = cairn_test::arena_frames({.seed = seed, .frames = 200});
    KeyframeMapOptions options;
    KeyframeMap exact(cairn_test::arena_rig(), options);
    options.rig = nearly_right;
    KeyframeMap learning(cairn_test::arena_rig(), options);
    const auto known = cairn_test::run_arena(frames, exact),
               learned = cairn_test::run_arena(frames, learning);
    CHECK(learned.lost == 0);
    CHECK(learned.rms_sigma < known.rms_sigma + 0.01);  // 1 cm, and the errors are what it says
    CHECK(learned.mean_nees() < most_nees());
  }

  TEST_CASE("keyframe_map: a landmark's covariance in the world holds the errors of its keyframes") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const Scene s = scene(seed, 1, 40, 0.1);
    KeyframeMapOptions options = plain();
    options.first_sigma = 0.01;
    KeyframeMap map = mapped(s, options);
    for (std::uint32_t i = 0; i < 40; ++i) {
      const auto given = map.landmark(i), world = map.landmark_in_world(i);
      REQUIRE(given);
      REQUIRE(world);
      Matrix<3, 6> G;
      G << Matrix<3>::Identity(), -cairn::skew(given->mean);
      const Matrix<3> expected = given->covariance + 1e-4 * G * G.transpose();
      CHECK((world->covariance - expected).norm() < 1e-9 * expected.norm());
    }
  }

  TEST_CASE("keyframe_map: knows how wrong it is on two laps of an arena") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    double sum = 0;
    for (std::uint64_t run = 0; run < 3; ++run) {
      const auto result = drive({.seed = seed + run});
      CAPTURE(run);
      CHECK(result.lost == 0);
      CHECK(result.mean_nees() > 2.5);
      CHECK(result.mean_nees() < most_nees());
      CHECK(result.rms_position < 0.01);
      CHECK(result.keyframes[210] == result.keyframes.back());  // the second lap meets the first
      sum += result.mean_nees() / 3;
    }
    CHECK(sum > 3.5);
    CHECK(sum < most_nees(3));
  }

  TEST_CASE("keyframe_map: noise that stays while a landmark is in view does not fool it") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const auto result = drive({.seed = seed, .bias_share = 0.5});
    CHECK(result.mean_nees() > 2);
    CHECK(result.mean_nees() < most_nees());
  }

  TEST_CASE("keyframe_map: stays true where every frame becomes a keyframe") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    KeyframeMap map(cairn_test::arena_rig());
    const auto result =
        cairn_test::run_arena(cairn_test::arena_frames({.seed = seed, .frames = 90}), map, {0, 1});
    CHECK(map.keyframe_count() > 60);
    CHECK(result.mean_nees() < 13);
  }

  TEST_CASE("keyframe_map: a cap on keyframes holds, and costs little") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    KeyframeMapOptions options;
    options.max_keyframes = 12;
    const auto result = drive({.seed = seed, .frames = 260}, options);
    CHECK(*std::ranges::max_element(result.keyframes) <= 12);
    CHECK(result.lost == 0);
    CHECK(result.rms_position < 0.02);
    CHECK(result.mean_nees() < 20);
  }

  TEST_CASE("keyframe_map: a third of wrong matches is told apart") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed, 3);
    auto frames = cairn_test::arena_frames({.seed = seed, .frames = 60});
    for (std::size_t f = 1; f < frames.size(); ++f)
      for (StereoSighting& s : frames[f].sightings)
        if (random.uniform() < 0.33)
          for (int c = 0; c < 2; ++c) {
            s.left(c) += random.uniform(-60, 60);
            s.right(c) = s.left(c) - random.uniform(10, 80) * (c == 0);
          }
    KeyframeMap map(cairn_test::arena_rig());
    const auto result = cairn_test::run_arena(frames, map);
    CHECK(result.lost == 0);
    CHECK(result.rms_position < 0.01);
    CHECK(result.mean_nees() < 15);
  }

  TEST_CASE("keyframe_map: locating leaves no trace, and is the same again") {
    const Scene s = scene(cairn_test::seed(), 3, 40);
    KeyframeMap map = mapped(s, {});
    const Matrix<dynamic> before = map.covariance();
    const auto one = map.locate(s.poses[1], s.seen[1]), two = map.locate(s.poses[1], s.seen[1]);
    CHECK(one.T_world_camera.matrix() == two.T_world_camera.matrix());
    CHECK(one.covariance == two.covariance);
    CHECK(map.covariance() == before);
    CHECK(one.viewpoint_change > 0);
    CHECK(one.viewpoint_change < 0.2);
    CHECK(one.inlier_count > 30);
  }

  TEST_CASE("keyframe_map: a list takes three sightings a visit and six in all") {
    const Scene s = scene(cairn_test::seed(), 1, 40);
    KeyframeMapOptions options;
    options.visit_gap = 3;
    KeyframeMap map(cairn_test::arena_rig(), options);
    map.begin(s.poses[0]);
    for (const StereoSighting& one : s.seen[0]) map.add_landmark(one);
    std::size_t made = 1;
    for (int i = 0; i < 4; ++i) {
      const auto here = map.locate(s.poses[0], s.seen[0]);
      REQUIRE(here.good());
      if (i < 2) made += map.add_keyframe(here, s.seen[0]) ? 1 : 0;
    }
    CHECK(made == 3);
    CHECK(map.landmark_count() == 40);
    // Lists that may not grow in this visit: all matches are used, and recorded while there is room.
    REQUIRE(map.add_keyframe(map.locate(s.poses[0], s.seen[0]), s.seen[0]));
    REQUIRE(map.add_keyframe(map.locate(s.poses[0], s.seen[0]), s.seen[0]));
    REQUIRE(map.add_keyframe(map.locate(s.poses[0], s.seen[0]), s.seen[0]));
    CHECK(map.landmark_count() == 40);
    const auto list = map.sightings_of(7);
    REQUIRE(list.size() == 6);
    for (std::size_t k = 0; k < 6; ++k) {
      CHECK(list[k].keyframe == k);
      CHECK(list[k].sighting.landmark == 7);
      CHECK(list[k].sighting.left == s.seen[0][7].left);
      CHECK(list[k].sighting.right == s.seen[0][7].right);
    }
    CHECK(list[0].sighting.sigma == s.seen[0][7].sigma);
    CHECK(map.sightings_of(40).empty());
    // Then they are spent.
    const auto here = map.locate(s.poses[0], s.seen[0]);
    REQUIRE(map.add_keyframe(here, s.seen[0]));
    CHECK(map.landmark_count() == 40 - here.inlier_count);
    CHECK(map.take_dropped().size() == here.inlier_count);
    CHECK(map.take_dropped().empty());
  }

  TEST_CASE("keyframe_map: a landmark that is matched twice in a frame counts once") {
    const Scene s = scene(5, 6, 40);
    const auto twice = [](std::vector<StereoSighting> seen) {
      const std::vector<StereoSighting> again = seen;
      seen.insert(seen.end(), again.begin(), again.end());
      return seen;
    };
    KeyframeMapOptions options = plain();
    options.max_keyframes = 4;  // entries of lists are struck
    KeyframeMap once(cairn_test::arena_rig(), options), doubled = once;
    for (KeyframeMap* map : {&once, &doubled}) {
      map->begin(s.poses[0]);
      for (const StereoSighting& one : s.seen[0]) REQUIRE(map->add_landmark(one));
    }
    for (std::size_t k = 1; k < s.poses.size(); ++k) {
      CAPTURE(k);
      const auto both = twice(s.seen[k]);
      const auto here = once.locate(s.poses[k], s.seen[k]), there = doubled.locate(s.poses[k], both);
      REQUIRE(here.good());
      REQUIRE(there.good());
      CHECK(there.inlier_count == here.inlier_count);
      CHECK(there.covariance == here.covariance);
      for (std::size_t i = s.seen[k].size(); i < both.size(); ++i) CHECK(there.inliers[i] == 0);
      REQUIRE(once.add_keyframe(here, s.seen[k]));
      REQUIRE(doubled.add_keyframe(there, both));
      REQUIRE(doubled.covariance() == once.covariance());
      for (const std::uint32_t id : doubled.landmark_ids()) {
        const auto list = doubled.sightings_of(id);
        for (std::size_t i = 1; i < list.size(); ++i) CHECK(list[i].keyframe > list[i - 1].keyframe);
        CHECK(doubled.landmark(id).has_value() == once.landmark(id).has_value());
      }
    }
  }

  TEST_CASE("keyframe_map: keyframes that no landmark rests on leave") {
    const Scene s = scene(cairn_test::seed(), 3, 40);
    KeyframeMap map = mapped(s, {});
    for (std::uint32_t i = 0; i < 40; ++i) CHECK(map.forget(i));
    CHECK_FALSE(map.forget(3));
    CHECK(map.landmark_count() == 0);
    CHECK(map.seen_with(std::vector<std::uint32_t>{1, 2}).empty());
    for (const StereoSighting& one : s.seen[2]) map.add_landmark(one);
    REQUIRE(map.add_keyframe(map.locate(s.poses[2], s.seen[2]), s.seen[2]));
    CHECK(map.keyframe_count() == 2);
  }

  TEST_CASE("keyframe_map: another rig puts the landmarks where their pixels say under it") {
    const Scene s = scene(cairn_test::seed(), 1, 40);
    KeyframeMap map = mapped(s, {});
    cairn::StereoRig wider = cairn_test::arena_rig();
    wider.T_left_right = SE3(cairn::SO3(), Vector<3>(0.22, 0, 0));
    const Vector<3> before = map.landmark(5)->mean;
    map.set_rig(wider);
    CHECK((map.landmark(5)->mean - 1.1 * before).norm() < 1e-6 * before.norm());
    CHECK(map.landmark_count() == 40);
  }

  TEST_CASE("keyframe_map: scores show how large the noise is, and what neighbours have in common") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const auto mean_score = [&](double noise, double shared) {
      double sum = 0;
      constexpr std::uint64_t runs = 40;
      for (std::uint64_t run = 0; run < runs; ++run) {
        Scene s = scene(seed + 100 * run, 1, 300, 0);
        KeyframeMap map = mapped(s, plain());
        cairn::Random random(seed + run, 5);
        double common[4][3];
        for (auto& column : common)
          for (double& cell : column) cell = shared * random.normal();
        for (StereoSighting& one : s.seen[0]) {
          const double cell = common[std::clamp(static_cast<int>(one.left(0) / 192), 0, 3)]
                                    [std::clamp(static_cast<int>(one.left(1) / 192), 0, 2)];
          for (int c = 0; c < 2; ++c) {
            one.left(c) += noise * random.normal() + cell;
            one.right(c) += noise * random.normal() + cell;
          }
        }
        // The landmarks' own sighting is without noise, but counts as noisy: half of the variance is there.
        sum += map.locate(s.poses[0], s.seen[0]).score_variance / runs;
      }
      return 2 * sum;
    };
    CHECK(mean_score(sigma, 0) > 0.8);
    CHECK(mean_score(sigma, 0) < 1.25);
    CHECK(mean_score(2 * sigma, 0) > 3.2);
    CHECK(mean_score(2 * sigma, 0) < 5);
    CHECK(mean_score(sigma, 0.5 * sigma) > 3);
  }

  TEST_CASE("keyframe_map: variance factors scale what is reported, and open the gates") {
    const Scene first = scene(cairn_test::seed(), 1, 60), s = scene(cairn_test::seed(), 2, 60, 2.5 * sigma);
    KeyframeMap map = mapped(first, {});
    const auto narrow = map.locate(s.poses[1], s.seen[1]);
    map.set_variance_factors(6.25, 6.25);
    const auto wide = map.locate(s.poses[1], s.seen[1]);
    REQUIRE(wide.good());
    CHECK(narrow.inlier_count < 45);
    CHECK(wide.inlier_count > 50);
    map.set_variance_factors(6.25, 12.5);
    const auto wider = map.locate(s.poses[1], s.seen[1]);
    CHECK((wider.covariance - 2 * wide.covariance).norm() < 0.2 * wide.covariance.norm());
  }

  TEST_CASE("keyframe_map: a landmark whose sightings contradict each other is forgotten") {
    Scene s = scene(cairn_test::seed(), 3, 40, 0.1);  // noise does not decide it
    KeyframeMapOptions options = plain();
    options.contradiction = 0.999;
    s.seen[1][7].left(1) += 3.3;  // no gate: it is recorded
    s.seen[1][7].right(1) += 3.3;
    KeyframeMap map = mapped(s, options);
    CHECK_FALSE(map.landmark(7));
    CHECK_FALSE(map.contains(7));
    const auto dropped = map.take_dropped();
    CHECK(std::ranges::find(dropped, 7U) != dropped.end());
  }

  TEST_CASE("keyframe_map: says why there is no pose") {
    const Scene s = scene(cairn_test::seed(), 1, 40);
    KeyframeMap map = mapped(s, {});
    const auto few = map.locate(s.poses[0], std::span(s.seen[0]).first(5));
    CHECK(few.status == cairn::MapLocationStatus::too_few_matches);
    CHECK(few.covariance.isZero(0));
    const auto none = map.locate(s.poses[0], {});
    CHECK_FALSE(none.good());
    const std::vector<StereoSighting> one(30, s.seen[0][4]);
    CHECK_FALSE(map.locate(s.poses[0], one).good());
    CHECK(std::string(explain(few.status)).find("few") != std::string::npos);
  }

  TEST_CASE("keyframe_map: bad numbers are refused in words") {
    const Scene s = scene(cairn_test::seed(), 1, 40);
    KeyframeMap map = mapped(s, {});
    const double nan = std::numeric_limits<double>::quiet_NaN();
    StereoSighting bad = s.seen[0][0];
    bad.landmark = 900;
    bad.left(0) = nan;
    CHECK_THROWS_WITH_AS(map.add_landmark(bad), doctest::Contains("landmark 900"), cairn::Error);
    bad = s.seen[0][0];
    bad.sigma = 0;
    const std::vector<StereoSighting> matches{bad};
    CHECK_THROWS_WITH_AS(static_cast<void>(map.locate(s.poses[0], matches)), doctest::Contains("sigma"),
                         cairn::Error);
    CHECK_THROWS_AS(static_cast<void>(map.locate(SE3(cairn::SO3(), Vector<3>(nan, 0, 0)), s.seen[0])),
                    cairn::Error);
    bad = s.seen[0][0];
    bad.landmark = 901;
    bad.right(0) = bad.left(0) + 5;  // behind the cameras
    CHECK_FALSE(map.add_landmark(bad));
    CHECK_FALSE(map.add_landmark(s.seen[0][3]));  // there already
    CHECK(map.landmark_count() == 40);
  }
}

}  // namespace keyframe_map_test
