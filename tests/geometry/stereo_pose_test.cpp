// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/detail/stereo_pose_problem.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/manifold/derivatives.hpp>

#include "support/folder.hpp"
#include "support/processors.hpp"
#include "support/random.hpp"
#include "support/rigs.hpp"

namespace stereo_pose_test {
namespace {

using cairn::estimate_stereo_pose;
using cairn::Matrix;
using cairn::PosePrior;
using cairn::SE3;
using cairn::StereoMatch;
using cairn::StereoPose;
using cairn::StereoPoseOptions;
using cairn::StereoPoseStatus;
using cairn::StereoRig;
using cairn::Vector;
using cairn_test::random_matches;
using cairn_test::random_pose;
using cairn_test::Scene;

constexpr double degree = M_PI / 180;

/// Root mean square errors, and the mean NEES, of many runs.
struct Accuracy {
  double metres = 0, degrees = 0, nees = 0;
  int lost = 0;
};

Accuracy measure(const StereoRig& rig, const Scene& scene, const StereoPoseOptions& options, int runs,
                 cairn::Random& random) {
  Accuracy result;
  for (int run = 0; run < runs; ++run) {
    const SE3 T = random_pose(random);
    const StereoPose pose = estimate_stereo_pose(rig, random_matches(rig, T, scene, random), options);
    if (!pose.good()) {
      ++result.lost;
      continue;
    }
    const Vector<6> error = cairn::local(T, pose.T_world_camera);
    result.metres += error.head<3>().squaredNorm();
    result.degrees += error.tail<3>().squaredNorm();
    result.nees += error.dot(pose.information * error);
  }
  const int good = std::max(1, runs - result.lost);
  result.metres = std::sqrt(result.metres / good);
  result.degrees = std::sqrt(result.degrees / good) / degree;
  result.nees /= good;
  return result;
}

/// Nothing that is not finite, whatever the verdict; a covariance where it is good.
void check_sound(const StereoPose& pose, std::size_t matches) {
  CHECK(pose.T_world_camera.matrix().allFinite());
  CHECK(pose.covariance.allFinite());
  CHECK(pose.information.allFinite());
  CHECK(pose.inliers.size() == matches);
}

}  // namespace

TEST_SUITE("stereo_pose") {
  TEST_CASE("estimate_stereo_pose: exact observations give the pose to rounding, distorted rig or not") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const StereoRig& rig : {cairn_test::rectified_rig(), cairn_test::unrectified_rig()})
      for (const double outliers : {0.0, 0.4}) {
        const SE3 T = random_pose(random);
        const auto matches = random_matches(rig, T, {.pixel_sigma = 0, .outliers = outliers}, random);
        const StereoPose pose = estimate_stereo_pose(rig, matches);
        REQUIRE(pose.good());
        CHECK(cairn::local(T, pose.T_world_camera).norm() < 1e-11);
        CHECK(pose.inlier_count >= (outliers == 0 ? 150 : 70));
        CHECK((pose.covariance * pose.information - Matrix<6>::Identity()).norm() < 1e-6);
      }
  }

  TEST_CASE(
      "estimate_stereo_pose: simulated room, 768 x 576 pixels: 1 mm, 0.02 degrees, and 4 mm among outliers") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    const Accuracy clean = measure(rig, {}, {}, 200, random);
    CHECK(clean.lost == 0);
    CHECK(clean.metres < 0.001);
    CHECK(clean.degrees < 0.02);
    const Accuracy wrong = measure(rig, {.outliers = 0.3}, {}, 200, random);
    CHECK(wrong.lost == 0);
    CHECK(wrong.metres < 0.004);
  }

  TEST_CASE("estimate_stereo_pose: the covariance passes the NEES test for every loss, map error and rig") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    constexpr int runs = 300;
    const auto band = cairn::chi_square_mean_band(6, runs, cairn_test::almost_sure);
    for (const StereoRig& rig : {cairn_test::rectified_rig(), cairn_test::unrectified_rig()})
      for (const cairn::RobustLoss loss :
           {cairn::RobustLoss::none, cairn::RobustLoss::huber, cairn::RobustLoss::cauchy})
        for (const double map_error : {0.0, 0.01}) {
          CAPTURE(static_cast<int>(loss));
          CAPTURE(map_error);
          const Accuracy a = measure(rig, {.landmark_sigma = map_error, .outliers = 0.2},
                                     {.loss = loss, .loss_scale = 2}, runs, random);
          CHECK(a.lost == 0);
          CAPTURE(a.nees);
          CHECK(band.contains(a.nees));
        }
  }

  TEST_CASE("estimate_stereo_pose: survives 60 percent of wrong matches, in either order") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const Scene scene{.matches = 200, .landmark_sigma = 0.005, .outliers = 0.6};
    for (const auto order : {cairn::SamplingOrder::uniform, cairn::SamplingOrder::progressive}) {
      StereoPoseOptions options;
      options.ransac.order = order;
      const Accuracy a = measure(cairn_test::rectified_rig(), scene, options, 100, random);
      CHECK(a.lost == 0);
      CHECK(a.metres < 0.01);
    }
  }

  TEST_CASE("estimate_stereo_pose: landmarks with large covariance count less than those without") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::rectified_rig();
    double weighted = 0, ignorant = 0;
    for (int run = 0; run < 50; ++run) {
      const SE3 T = random_pose(random);
      auto matches = random_matches(rig, T, {.matches = 60}, random);
      for (std::size_t i = 0; i < 40; ++i) {  // most landmarks are 3 cm off along one axis, and say so
        const Vector<3> axis(0.6, 0, 0.8);
        matches[i].landmark += random.normal(0, 0.03) * axis;
        matches[i].covariance = 9e-4 * axis * axis.transpose();
      }
      weighted += cairn::local(T, estimate_stereo_pose(rig, matches).T_world_camera).squaredNorm();
      for (auto& match : matches) match.covariance = Matrix<3>::Identity() * 3e-4;
      ignorant += cairn::local(T, estimate_stereo_pose(rig, matches).T_world_camera).squaredNorm();
    }
    CHECK(weighted < 0.7 * ignorant);
  }

  TEST_CASE("estimate_stereo_pose: the same seed gives the same bits, with AVX2 and without") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::unrectified_rig();
    const auto matches = random_matches(rig, random_pose(random), {.outliers = 0.5}, random);
    const StereoPose a = estimate_stereo_pose(rig, matches);
    cairn_test::for_each_processor([&] {
      const StereoPose b = estimate_stereo_pose(rig, matches);
      CHECK((a.T_world_camera.matrix().array() == b.T_world_camera.matrix().array()).all());
      CHECK((a.covariance.array() == b.covariance.array()).all());
      CHECK(a.inliers == b.inliers);
      CHECK(a.iterations == b.iterations);
    });
  }

  TEST_CASE("estimate_stereo_pose: a prior with information shifts the estimate as Bayes says") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    constexpr int runs = 300;
    const double spread = 0.002;
    double nees = 0, with = 0, without = 0;
    for (int run = 0; run < runs; ++run) {
      const SE3 T = random_pose(random);
      const auto matches = random_matches(rig, T, {.matches = 20}, random);
      Vector<6> error;
      for (int i = 0; i < 6; ++i) error(i) = random.normal(0, spread);
      const PosePrior prior{cairn::retract(T, Vector<6>(-error)), Matrix<6>::Identity() / (spread * spread)};
      const StereoPose pose = estimate_stereo_pose(rig, matches, {}, prior);
      REQUIRE(pose.good());
      const Vector<6> left = cairn::local(T, pose.T_world_camera);
      nees += left.dot(pose.information * left) / runs;
      with += left.squaredNorm();
      without += cairn::local(T, estimate_stereo_pose(rig, matches).T_world_camera).squaredNorm();
    }
    CHECK(cairn::chi_square_mean_band(6, runs, cairn_test::almost_sure).contains(nees));
    CHECK(with < without);
  }

  TEST_CASE("estimate_stereo_pose: a prior without information is one more hypothesis and biases nothing") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::rectified_rig();
    const SE3 T = random_pose(random);
    const auto matches = random_matches(rig, T, {.outliers = 0.3}, random);
    const StereoPose plain = estimate_stereo_pose(rig, matches);
    const PosePrior wrong{random_pose(random, 3), Matrix<6>::Zero()};
    const StereoPose guided = estimate_stereo_pose(rig, matches, {}, wrong);
    // A match at the gate may belong to the one and not to the other, which moves the pose by less than it is
    // known to.
    const auto same = [&](const StereoPose& other) {
      const Vector<6> d = cairn::local(plain.T_world_camera, other.T_world_camera);
      CAPTURE(d.dot(plain.information * d));
      if (other.inliers == plain.inliers)
        CHECK(d.norm() < 1e-5);
      else
        CHECK(d.dot(plain.information * d) < 1);
    };
    same(guided);
    // and with a near guess no sample is needed
    StereoPoseOptions no_samples;
    no_samples.ransac.max_iterations = 0;
    const PosePrior near{cairn::retract(T, Vector<6>(Vector<6>::Constant(0.02))), Matrix<6>::Zero()};
    const StereoPose direct = estimate_stereo_pose(rig, matches, no_samples, near);
    REQUIRE(direct.good());
    same(direct);
  }

  TEST_CASE("refine_stereo_pose: gets to the same optimum from a pose nearby") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::unrectified_rig();
    const SE3 T = random_pose(random);
    const auto matches = random_matches(rig, T, {.landmark_sigma = 0.01, .outliers = 0.2}, random);
    const StereoPose full = estimate_stereo_pose(rig, matches);
    const StereoPose refined =
        cairn::refine_stereo_pose(rig, matches, cairn::retract(T, Vector<6>(Vector<6>::Constant(0.003))));
    REQUIRE(refined.good());
    CHECK(cairn::local(full.T_world_camera, refined.T_world_camera).norm() < 1e-5);
    CHECK(refined.inliers == full.inliers);
  }

  TEST_CASE("estimate_stereo_pose: landmarks a million metres from the origin cost no accuracy") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::rectified_rig();
    const SE3 far(cairn::SO3::exp(Vector<3>(0.1, 0.2, 0.3)), Vector<3>(1e6, -1e6, 1e6));
    const auto matches = random_matches(rig, far, {.outliers = 0.3}, random);
    const StereoPose pose = estimate_stereo_pose(rig, matches);
    REQUIRE(pose.good());
    CHECK(cairn::local(far, pose.T_world_camera).head<3>().norm() < 0.004);
  }

  TEST_CASE("estimate_stereo_pose: a right row that repeats the left one is not counted twice") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::rectified_rig();
    constexpr int runs = 300;
    StereoPoseOptions tracked;
    tracked.right_rows = false;
    double nees = 0;
    for (int run = 0; run < runs; ++run) {
      const SE3 T = random_pose(random);
      auto matches = random_matches(rig, T, {}, random);
      for (StereoMatch& match : matches) match.right(1) = match.left(1);
      const StereoPose pose = estimate_stereo_pose(rig, matches, tracked);
      REQUIRE(pose.good());
      const Vector<6> error = cairn::local(T, pose.T_world_camera);
      nees += error.dot(pose.information * error) / runs;
    }
    CHECK(cairn::chi_square_mean_band(6, runs, cairn_test::almost_sure).contains(nees));
  }

  TEST_CASE("stereo residual: gradient and information are the derivatives of chi squared") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::unrectified_rig();
    const SE3 T = random_pose(random);
    for (const double map_error : {0.0, 0.02}) {
      const auto matches = random_matches(rig, T, {.matches = 40, .landmark_sigma = map_error}, random);
      StereoPoseOptions options;
      options.loss = cairn::RobustLoss::none;
      options.gate_probability = 0.999999;
      const cairn::detail::StereoPoseProblem problem(rig, matches, options, std::nullopt);
      // at the optimum of the sum of chi^2, a step raises it by d^T information d, to second order
      const StereoPose pose = cairn::refine_stereo_pose(rig, matches, T, options);
      REQUIRE(pose.good());
      const double least = problem.score(pose.T_world_camera, 1e300).cost;
      for (int i = 0; i < 6; ++i) {
        Vector<6> d = Vector<6>::Zero();
        d(i) = 0.5 / std::sqrt(pose.information(i, i));
        const double up = problem.score(cairn::retract(pose.T_world_camera, d), 1e300).cost;
        const double down = problem.score(cairn::retract(pose.T_world_camera, Vector<6>(-d)), 1e300).cost;
        CHECK(0.5 * (up + down) - least == doctest::Approx(0.25).epsilon(0.1).scale(0));
        // with a map error the residuals' covariance moves with the pose, which a likelihood must not exploit
        if (map_error == 0) CHECK(std::abs(up - down) < 0.01);
      }
    }
  }

  TEST_CASE("stereo pose score: stops early only with a cost above the limit, for every number of matches") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::rectified_rig();
    for (std::size_t count = 20; count < 30; ++count) {
      const SE3 T = random_pose(random);
      const auto matches = random_matches(rig, T, {.matches = count, .outliers = 0.5}, random);
      const cairn::detail::StereoPoseProblem problem(rig, matches, {}, std::nullopt);
      const double cost = problem.score(T, 1e300).cost;
      std::vector<std::uint8_t> mask(count);
      problem.inliers(T, mask);
      CHECK(problem.score(T, 1e300).inliers ==
            static_cast<std::size_t>(std::count(mask.begin(), mask.end(), std::uint8_t{1})));
      for (double limit = 0; limit < 1.2 * cost; limit += 3) {
        const double found = problem.score(T, limit).cost;
        if (cost > limit) CHECK(found > limit);
        if (cost <= limit) CHECK(found == cost);
      }
    }
  }

  TEST_CASE("estimate_stereo_pose: too few, wrong, coincident or collinear matches get a verdict") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    const SE3 T = random_pose(random);
    for (const std::size_t count : {0U, 1U, 2U, 3U, 7U}) {
      const StereoPose pose = estimate_stereo_pose(rig, random_matches(rig, T, {.matches = count}, random));
      CHECK(pose.status == StereoPoseStatus::too_few_matches);
      check_sound(pose, count);
    }
    const auto place = [&](const auto& landmark) {
      std::vector<StereoMatch> matches(50);
      for (std::size_t i = 0; i < matches.size(); ++i) {
        const Vector<3> p = landmark(static_cast<double>(i));
        matches[i].landmark = T * p;
        const Vector<4> pixels = *rig.project(p);
        matches[i].left = pixels.head<2>();
        matches[i].right = pixels.tail<2>();
      }
      const StereoPose pose = estimate_stereo_pose(rig, matches);
      check_sound(pose, matches.size());
      CHECK_FALSE(pose.good());
    };
    place([](double) { return Vector<3>(0.1, 0.2, 4); });
    place([](double i) { return Vector<3>(0.1 + 0.01 * i, 0.2, 4 + 0.03 * i); });
  }

  // Exactly known landmarks on a line are refused because samples of them are; these pass for triangles.
  TEST_CASE("estimate_stereo_pose: the landmarks' own noise beside a line is no lever, and a prior is one") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    for (const double sigma : {0.02, 0.3})
      for (int run = 0; run < 10; ++run) {
        const SE3 T = random_pose(random);
        const Vector<3> start(0.4 * random.uniform() - 0.2, 0.4 * random.uniform() - 0.2, 5);
        const Vector<3> along = Vector<3>(random.uniform() - 0.5, random.uniform() - 0.5, 1).normalized();
        std::vector<StereoMatch> matches(150);
        for (StereoMatch& m : matches) {
          const Vector<3> p = start + 3 * (random.uniform() - 0.5) * along;
          const Vector<4> pixels = *rig.project(p);
          m.landmark = T * p + sigma * Vector<3>(random.normal(), random.normal(), random.normal());
          m.covariance = sigma * sigma * Matrix<3>::Identity();
          m.left = pixels.head<2>() + 0.5 * Vector<2>(random.normal(), random.normal());
          m.right = pixels.tail<2>() + 0.5 * Vector<2>(random.normal(), random.normal());
        }
        CHECK_FALSE(estimate_stereo_pose(rig, matches).good());
        CHECK_FALSE(cairn::refine_stereo_pose(rig, matches, T).good());
        const StereoPose known = cairn::refine_stereo_pose(
            rig, matches, T, {}, PosePrior{T, 1e6 * Matrix<6>::Identity()});  // a milliradian
        CHECK(known.good());
        const Vector<6> error = cairn::local(T, known.T_world_camera);
        CHECK(error.dot(known.information * error) < cairn::chi_square_quantile(1 - 1e-6, 6));
      }
  }

  TEST_CASE(
      "estimate_stereo_pose: few blurred landmarks from one look before are no line, and the covariance "
      "holds") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    const cairn::Triangulator triangulator(rig, {.max_gap = 5});
    constexpr double sigma = 6, runs = 200;
    const auto noisy = [&](const Vector<4>& pixels) {
      return Vector<4>(pixels +
                       sigma * Vector<4>(random.normal(), random.normal(), random.normal(), random.normal()));
    };
    double nees = 0, good = 0;
    for (int run = 0; run < static_cast<int>(runs); ++run) {
      const SE3 T = SE3::exp(0.05 * Vector<6>(random.normal(), random.normal(), random.normal(),
                                              random.normal(), random.normal(), random.normal()));
      std::vector<StereoMatch> matches;
      while (matches.size() < 12) {
        const Vector<3> p(2 * random.uniform() - 1, 2 * random.uniform() - 1, 3 + 5 * random.uniform());
        const auto before = rig.project(p), now = rig.project(T.inverse() * p);
        if (!before || !now) continue;
        StereoMatch m;
        const Vector<4> first = noisy(*before), second = noisy(*now);
        const cairn::Triangulation seen = triangulator(first.head<2>(), first.tail<2>(), sigma, sigma);
        if (!seen.good()) continue;
        m.landmark = seen.point;
        m.covariance = seen.covariance;
        m.left = second.head<2>();
        m.right = second.tail<2>();
        m.sigma_left = m.sigma_right = sigma;
        matches.push_back(m);
      }
      const StereoPose pose = estimate_stereo_pose(rig, matches, {}, PosePrior{SE3()});
      if (!pose.good()) continue;
      ++good;
      CHECK((pose.covariance * pose.information - Matrix<6>::Identity()).norm() < 1e-6);
      const Vector<6> error = cairn::local(pose.T_world_camera, T);
      nees += error.dot(pose.information * error);
    }
    CAPTURE(nees / good);
    CHECK(good >= 0.9 * runs);
    CHECK(nees / good < 1.3 * cairn::chi_square_mean_band(6, good, cairn_test::almost_sure).high);
  }

  // Against differences of the pixels' own derivatives.
  TEST_CASE("pose_equations: what a landmark's noise adds to the information of the pose") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    const auto spd = [&]<int N>(std::integral_constant<int, N>) {
      Matrix<N> A;
      for (double& a : A.reshaped()) a = random.normal();
      return Matrix<N>(A * A.transpose() + 0.1 * Matrix<N>::Identity());
    };
    for (int trial = 0; trial < 20; ++trial) {
      const Matrix<3> C = spd(std::integral_constant<int, 3>{}), R = random_pose(random).rotation().matrix();
      const Matrix<4> weight = spd(std::integral_constant<int, 4>{});
      const Vector<3> p(random.normal(), random.normal(), 4 + 3 * random.uniform());
      const auto jacobian = [&](const Vector<3>& at) {  // of the pixels by a right step
        const auto pixels = [&](const Vector<3>& q) { return *rig.project(q); };
        const Eigen::Matrix<double, 4, 3> H = cairn::numeric_jacobian(pixels, at);
        Eigen::Matrix<double, 4, 6> J;
        J << -H, H * cairn::skew(at);
        return J;
      };
      Eigen::Matrix<double, 4, 6> change[3];
      for (int i = 0; i < 3; ++i) {
        constexpr double step = 1e-3;
        change[i] =
            (jacobian(p + step * Vector<3>::Unit(i)) - jacobian(p - step * Vector<3>::Unit(i))) / (2 * step);
      }
      Matrix<6> expected = Matrix<6>::Zero();
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) expected += C(i, j) * change[i].transpose() * weight * change[j];

      const Eigen::Matrix<double, 4, 3> H = -jacobian(p).leftCols<3>();
      const Matrix<3> W = R * H.transpose() * weight * H * R.transpose(), C_world = R * C * R.transpose();
      const Vector<3> y = R * p, z = R.col(2);
      cairn::detail::StereoStatistics s{};
      cairn::detail::MatchLane covariance[6] = {}, axis[3] = {}, one = {1, 0, 0, 0};
      for (int i = 0, k = 0; i < 3; ++i) {
        s.y[i] = y(i) + cairn::detail::MatchLane{};
        axis[i] = z(i) + cairn::detail::MatchLane{};
        for (int j = i; j < 3; ++j, ++k) {
          s.information[k][0] = W(i, j);
          covariance[k][0] = C_world(i, j);
        }
      }
      cairn::detail::PoseEquations equations;
      equations.add_noise(s, covariance, axis, one);
      CHECK((equations.noise(R) - expected).norm() < 1e-4 * expected.norm());
    }
  }

  TEST_CASE("estimate_stereo_pose: matches that are all wrong give no consensus") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    for (const std::size_t count : {20U, 100U, 500U})
      for (int run = 0; run < 10; ++run) {
        const auto matches =
            random_matches(rig, random_pose(random), {.matches = count, .outliers = 1}, random);
        const StereoPose pose = estimate_stereo_pose(rig, matches);
        CHECK_FALSE(pose.good());
        check_sound(pose, count);
      }
  }

  TEST_CASE("estimate_stereo_pose: wrong landmarks beside the camera, vague along the view, have no say") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    const SE3 T = random_pose(random);
    auto matches = random_matches(rig, T, {.matches = 200, .landmark_sigma = 0.005}, random);
    for (std::size_t i = 0; i < 60; ++i) {  // in front by a hand, aside by a street; sure but for the depth
      const Vector<3> p(random.uniform(-40, 40), random.uniform(-5, 5), random.uniform(0.02, 0.3));
      const Vector<3> view = T.rotation() * p.normalized();
      matches[3 * i].landmark = T * p;
      matches[3 * i].covariance = 6 * view * view.transpose() + 1e-5 * Matrix<3>::Identity();
    }
    const StereoPose pose = estimate_stereo_pose(rig, matches);
    REQUIRE(pose.good());
    check_sound(pose, matches.size());
    CHECK(pose.inlier_count > 120);
    CHECK(cairn::local(T, pose.T_world_camera).head<3>().norm() < 0.01);
    for (std::size_t i = 0; i < 60; ++i) CHECK(pose.inliers[3 * i] == 0);
  }

  TEST_CASE("estimate_stereo_pose: a mirrored map is not accepted") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::rectified_rig();
    auto matches = random_matches(rig, SE3(), {}, random);
    for (StereoMatch& match : matches) match.landmark(0) = -match.landmark(0);
    const StereoPose pose = estimate_stereo_pose(rig, matches);
    CHECK_FALSE(pose.good());
    check_sound(pose, matches.size());
  }

  TEST_CASE("estimate_stereo_pose: refuses numbers that are not finite and names the match") {
    cairn::Random random(cairn_test::seed());
    const StereoRig rig = cairn_test::rectified_rig();
    const auto good = random_matches(rig, SE3(), {.matches = 20}, random);
    const auto message = [&](auto&& spoil) {
      auto matches = good;
      spoil(matches[13]);
      try {
        (void)estimate_stereo_pose(rig, matches);
      } catch (const cairn::Error& error) {
        return std::string(error.what());
      }
      return std::string();
    };
    CHECK(message([](StereoMatch& m) { m.landmark(2) = NAN; }).find("match 13") != std::string::npos);
    CHECK(message([](StereoMatch& m) { m.left(0) = INFINITY; }).find("match 13") != std::string::npos);
    CHECK(message([](StereoMatch& m) { m.right(1) = NAN; }).find("match 13") != std::string::npos);
    CHECK(message([](StereoMatch& m) { m.covariance(0, 1) = NAN; }).find("match 13") != std::string::npos);
    CHECK(message([](StereoMatch& m) { m.covariance(0, 0) = -1; }).find("match 13") != std::string::npos);
    CHECK(message([](StereoMatch& m) { m.sigma_left = 0; }).find("match 13") != std::string::npos);
    const auto correlated = [&](double xy, double xz, double yz) {
      return message([&](StereoMatch& m) { m.covariance << 4, xy, xz, xy, 1, yz, xz, yz, 1; });
    };
    CHECK(correlated(2, 2, 1).empty());  // all one: a covariance, though a singular one
    CHECK(correlated(1.8, 1.8, 0.9).empty());
    CHECK(correlated(2.1, 0, 0).find("match 13: expected a landmark covariance") != std::string::npos);
    CHECK(correlated(1.8, 1.8, -0.9).find("match 13: expected a landmark covariance") != std::string::npos);
    CHECK(message([](StereoMatch& m) { m.covariance << 4, 1, 0, 0, 1, 0, 0, 0, 1; }).find("match 13") !=
          std::string::npos);  // not symmetric, though the mean of both triangles is a covariance
    const SE3 nowhere(cairn::SO3(), Vector<3>(0, NAN, 0));
    cairn::PosePrior vague;
    vague.information(2, 3) = INFINITY;
    CHECK_THROWS_AS((void)estimate_stereo_pose(rig, good, {}, cairn::PosePrior{nowhere}), cairn::Error);
    CHECK_THROWS_AS((void)estimate_stereo_pose(rig, good, {}, vague), cairn::Error);
    CHECK_THROWS_AS((void)cairn::refine_stereo_pose(rig, good, nowhere), cairn::Error);
    const auto prior = [&](const Matrix<6>& information) {
      return cairn_test::message_of(
          [&] { (void)estimate_stereo_pose(rig, good, {}, cairn::PosePrior{SE3(), information}); });
    };
    Matrix<6> information = Matrix<6>::Identity();
    CHECK(prior(information).empty());
    information(4, 4) = 0;
    CHECK(prior(information).empty());  // of five directions
    information(0, 1) = information(1, 0) = 1 + 1e-9;
    CHECK(prior(information).empty());
    information(0, 1) = 0;
    CHECK(prior(information).find("symmetric") != std::string::npos);
    CHECK(prior(-Matrix<6>::Identity()).find("semi-definite") != std::string::npos);
  }

  // The least eigenvalue at a diagonal of 1 is the measure, whatever the units.
  TEST_CASE_TEMPLATE("nearly_semi_definite: forgives a thousandth, and no more", Size,
                     std::integral_constant<int, 3>, std::integral_constant<int, 6>) {
    constexpr int N = Size::value;
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto scaled = [&](const Matrix<N>& a, double units) {
      Matrix<N> result;
      Vector<N> unit;
      for (double& u : unit) u = std::pow(10, random.uniform(-units, units));
      for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) result(i, j) = unit(i) * a(i, j) * unit(j);
      return result;
    };
    for (int trial = 0; trial < 200; ++trial) {
      // All correlations alike, up to signs: the least eigenvalue is 1 + (N - 1) correlation.
      const double least = random.uniform(-2e-3, 1e-3);
      Vector<N> sign;
      for (double& one : sign) one = random.uniform() < 0.5 ? -1 : 1;
      Matrix<N> alike = (least - 1) / (N - 1) * sign * sign.transpose();
      alike.diagonal().setOnes();
      CAPTURE(least);
      CHECK(cairn::detail::nearly_semi_definite(scaled(alike, 3)) == (least > -1e-3));

      Matrix<N> crooked = Matrix<N>::Identity();
      crooked(N - 1, 0) = random.uniform(-2e-3, 2e-3);
      const bool straight = std::abs(crooked(N - 1, 0)) < 1e-3;
      CHECK(cairn::detail::nearly_semi_definite(scaled(crooked, 3)) == straight);

      Matrix<N> root = Matrix<N>::Zero();  // singular, with rows of zeros, rounded to floats
      for (int i = 0; i < N - 1; ++i)
        for (int j = 0; j < 1 + trial % (N - 1); ++j) root(i, j) = random.normal();
      const Matrix<N> singular = scaled(root * root.transpose(), 0);
      CHECK(cairn::detail::nearly_semi_definite(singular));
      CHECK(cairn::detail::nearly_semi_definite(
          Matrix<N>(singular.template cast<float>().template cast<double>())));
      Matrix<N> none = singular;
      none(N - 1, 0) = none(0, N - 1) = 1e-3;  // a covariance with what does not vary
      CHECK_FALSE(cairn::detail::nearly_semi_definite(none));
      none = singular;
      none(trial % N, trial / 7 % N) = trial % 2 == 0 ? NAN : INFINITY;
      CHECK_FALSE(cairn::detail::nearly_semi_definite(none));
    }
    CHECK(cairn::detail::nearly_semi_definite(Matrix<N>(Matrix<N>::Zero())));
  }

  TEST_CASE("estimate_stereo_pose: finite numbers of any size never give anything but finite numbers") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::unrectified_rig();
    for (int run = 0; run < 100; ++run) {
      std::vector<StereoMatch> matches(30);
      for (StereoMatch& m : matches) {
        const double size = std::pow(10, random.uniform(-3, 6));
        for (int i = 0; i < 3; ++i) m.landmark(i) = size * random.normal();
        for (int i = 0; i < 2; ++i) {
          m.left(i) = 1000 * random.normal();
          m.right(i) = 1000 * random.normal();
        }
        m.covariance = Matrix<3>::Identity() * std::pow(10, random.uniform(-12, 12));
      }
      StereoPoseOptions options;
      options.ransac.max_iterations = 100;
      check_sound(estimate_stereo_pose(rig, matches, options), matches.size());
    }
  }
}

}  // namespace stereo_pose_test
