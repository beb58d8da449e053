// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/robust_alignment.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"
#include "support/rigs.hpp"

namespace robust_alignment_test {
namespace {

using cairn::align_robustly;
using cairn::Matrix;
using cairn::PointMatch;
using cairn::RobustAlignment;
using cairn::RobustAlignmentStatus;
using cairn::SE3;
using cairn::Vector;

Vector<3> normal3(cairn::Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

/// Pairs with anisotropic noise in both frames, the first `outliers` of 100 wrong.
std::vector<PointMatch> pairs(const SE3& T, std::size_t outliers, cairn::Random& random,
                              std::size_t count = 100) {
  std::vector<PointMatch> result(count);
  for (std::size_t i = 0; i < count; ++i) {
    PointMatch& pair = result[i];
    const Vector<3> x = 3 * normal3(random);
    const Vector<3> a = 0.02 * normal3(random), b = 0.01 * normal3(random);
    pair.source_covariance = a * a.transpose() + 1e-4 * Matrix<3>::Identity();
    pair.target_covariance = b * b.transpose() + 4e-4 * Matrix<3>::Identity();
    pair.source = x + random.normal() * a + 0.01 * normal3(random);
    pair.target = T * x + random.normal() * b + 0.02 * normal3(random);
    if (i < outliers) pair.target = 3 * normal3(random);
  }
  return result;
}

}  // namespace

TEST_SUITE("robust_alignment") {
  TEST_CASE("align_robustly: the covariance passes the NEES test, clean and with 40 percent of wrong pairs") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const std::size_t outliers : {0U, 40U}) {
      constexpr int runs = 200;
      double nees = 0;
      for (int run = 0; run < runs; ++run) {
        const SE3 T = cairn_test::random_pose(random);
        const RobustAlignment a = align_robustly(pairs(T, outliers, random));
        REQUIRE(a.good());
        const Vector<6> error = cairn::local(T, a.T_target_source);
        nees += error.dot(a.information * error) / runs;
        CHECK(a.inlier_count >= 90 - outliers);
      }
      CAPTURE(nees);
      CHECK(cairn::chi_square_mean_band(6, runs, cairn_test::almost_sure).contains(nees));
    }
  }

  TEST_CASE("align_robustly: finds the motion among 80 percent of wrong pairs") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 20; ++run) {
      const SE3 T = cairn_test::random_pose(random);
      const RobustAlignment a = align_robustly(pairs(T, 80, random));
      REQUIRE(a.good());
      CHECK(cairn::local(T, a.T_target_source).norm() < 0.1);
    }
  }

  TEST_CASE("align_robustly: gives the same bits twice") {
    cairn::Random random(cairn_test::seed());
    const auto data = pairs(cairn_test::random_pose(random), 50, random);
    const RobustAlignment a = align_robustly(data), b = align_robustly(data);
    CHECK((a.T_target_source.matrix().array() == b.T_target_source.matrix().array()).all());
    CHECK(a.inliers == b.inliers);
  }

  TEST_CASE("align_robustly: says when there are too few, no consensus, or a line") {
    cairn::Random random(cairn_test::seed());
    CHECK(align_robustly({}).status == RobustAlignmentStatus::too_few_pairs);
    CHECK(align_robustly(pairs(SE3(), 0, random, 2)).status == RobustAlignmentStatus::too_few_pairs);
    CHECK(align_robustly(pairs(SE3(), 100, random)).status == RobustAlignmentStatus::no_consensus);
    auto mirrored = pairs(SE3(), 0, random);
    for (PointMatch& pair : mirrored) pair.target(0) = -pair.target(0);
    // Those about a plane agree with a turn about it, up to a tenth of them by chance.
    CHECK_FALSE(align_robustly(mirrored, {.min_share = 0.3}).good());
    std::vector<PointMatch> line(20);
    for (std::size_t i = 0; i < line.size(); ++i)
      line[i].source = line[i].target = Vector<3>::Constant(static_cast<double>(i));
    CHECK_FALSE(align_robustly(line).good());
    std::vector<PointMatch> place(20);
    CHECK_FALSE(align_robustly(place).good());
  }

  // The points themselves leave a turn about the line, or all turns, open; their noise does not know it.
  TEST_CASE("align_robustly: noise beside a line, or about a point, is no lever") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const double spread : {3.0, 0.0})
      for (int run = 0; run < 20; ++run) {
        const SE3 T = cairn_test::random_pose(random);
        const Vector<3> start = normal3(random), along = normal3(random);
        std::vector<PointMatch> data(30);
        for (PointMatch& pair : data) {
          const Vector<3> x = start + spread * random.normal() * along;
          pair.source = x + 0.01 * normal3(random);
          pair.target = T * x + 0.02 * normal3(random);
          pair.source_covariance = 1e-4 * Matrix<3>::Identity();
          pair.target_covariance = 4e-4 * Matrix<3>::Identity();
        }
        CHECK_FALSE(align_robustly(data).good());
      }
  }

  // A covariance that turns with the motion: its derivative is part of the gradient.
  TEST_CASE("align_robustly: long ellipsoids of two directions turn nothing") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    constexpr int runs = 50;
    double nees = 0;
    for (int run = 0; run < runs; ++run) {
      const SE3 T = cairn_test::random_pose(random);
      const Vector<3> a(0, 0, 3), b(2, 0, 2);
      std::vector<PointMatch> data(400);
      for (PointMatch& pair : data) {
        const Vector<3> x = 6 * normal3(random), c = T.rotation() * b;
        pair.source = x + random.normal() * a + normal3(random);
        pair.target = T * x + random.normal() * c + normal3(random);
        pair.source_covariance = a * a.transpose() + Matrix<3>::Identity();
        pair.target_covariance = c * c.transpose() + Matrix<3>::Identity();
      }
      const RobustAlignment result = align_robustly(data);
      REQUIRE(result.good());
      const Vector<6> error = cairn::local(result.T_target_source, T);
      nees += error.dot(result.information * error) / runs;
    }
    CAPTURE(nees);
    CHECK(nees > cairn::chi_square_quantile(1e-4, 6 * runs) / runs);
    CHECK(nees < cairn::chi_square_quantile(1 - 1e-4, 6 * runs) / runs);
  }

  TEST_CASE("align_robustly: coordinates a million metres from the origin cost no accuracy") {
    cairn::Random random(cairn_test::seed());
    const Vector<3> far(1e6, -2e6, 5e5);
    const SE3 T = cairn_test::random_pose(random);
    auto data = pairs(T, 30, random);
    const RobustAlignment near = align_robustly(data);
    for (PointMatch& pair : data) pair.target += far;
    const RobustAlignment moved = align_robustly(data);
    REQUIRE(near.good());
    REQUIRE(moved.good());
    CHECK((moved.T_target_source.translation() - near.T_target_source.translation() - far).norm() < 1e-6);
    CHECK(cairn::local(moved.T_target_source.rotation(), near.T_target_source.rotation()).norm() < 1e-7);
    CHECK(moved.inliers == near.inliers);
  }

  // The sources' distance is a lever: that of the pose's covariance, which is right where the points are.
  TEST_CASE(
      "align_robustly: sources ten million metres from the origin cost no accuracy, and one pair anywhere") {
    cairn::Random random(cairn_test::seed());
    for (const double scale : {1e5, 1e6, 1e7}) {
      CAPTURE(scale);
      const Vector<3> far = scale * Vector<3>(0.4, -0.8, 0.3);
      const SE3 T = cairn_test::random_pose(random), to_far(cairn::SO3(), far);
      auto data = pairs(T, 30, random);
      data[0].source = Vector<3>(1e12, 0, 0);
      const RobustAlignment near = align_robustly(data);
      for (PointMatch& pair : data) pair.source += far;
      const RobustAlignment moved = align_robustly(data);
      REQUIRE(near.good());
      REQUIRE(moved.good());
      const SE3 back = moved.T_target_source * to_far;
      const double rounding = 1e-15 * scale;  // of the coordinates, and of the motion's matrix at them
      CHECK((back.translation() - near.T_target_source.translation()).norm() < 20 * rounding);
      CHECK(cairn::local(back.rotation(), near.T_target_source.rotation()).norm() < 20 * rounding);
      CHECK(moved.inliers == near.inliers);
      const Matrix<6> at_points =
          to_far.inverse().adjoint() * moved.covariance * to_far.inverse().adjoint().transpose();
      CHECK((at_points - near.covariance).norm() < 1e-16 * scale * scale * near.covariance.norm());
      CHECK(cairn::Cholesky<6>(moved.covariance).good());
      CHECK(cairn::Cholesky<6>(moved.information).good());
    }
  }

  TEST_CASE("align_robustly: names the pair that is not finite, or whose covariance is none") {
    cairn::Random random(cairn_test::seed());
    const auto good = pairs(SE3(), 0, random);
    const auto refused = [&](const auto& spoil, const std::string& because) {
      auto data = good;
      spoil(data[41]);
      const std::string message = cairn_test::message_of([&] { (void)align_robustly(data); });
      CAPTURE(message);
      return message.find("pair 41: expected " + because) != std::string::npos;
    };
    CHECK(refused([](PointMatch& pair) { pair.source(1) = NAN; }, "finite points"));
    CHECK(refused([](PointMatch& pair) { pair.source_covariance(1, 1) = INFINITY; }, "covariances"));
    CHECK(refused([](PointMatch& pair) { pair.target_covariance = -Matrix<3>::Identity(); }, "covariances"));
    CHECK(refused([](PointMatch& pair) { pair.source_covariance(2, 0) += 1e-4; }, "covariances"));
    CHECK(refused(
        [](PointMatch& pair) {
          pair.target_covariance(0, 1) = pair.target_covariance(1, 0) = 2 * pair.target_covariance(0, 0);
        },
        "covariances"));
  }
}

}  // namespace robust_alignment_test
