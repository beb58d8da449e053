// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/alignment.hpp>

#include "support/elimination.hpp"
#include "support/random.hpp"
#include "support/rigs.hpp"

namespace alignment_test {
namespace {

using cairn::align_points;
using cairn::Alignment;
using cairn::AlignmentStatus;
using cairn::Matrix;
using cairn::SE3;
using cairn::Vector;
using Points = std::vector<Vector<3>>;

Points random_points(cairn::Random& random, std::size_t count) {
  Points points(count);
  for (Vector<3>& p : points) p = Vector<3>(random.normal(), random.normal(), random.normal());
  return points;
}

Points moved(const Points& points, const SE3& motion, double scale = 1) {
  Points result;
  for (const Vector<3>& p : points) result.push_back(motion * Vector<3>(scale * p));
  return result;
}

double distance(const SE3& a, const SE3& b) {
  return cairn::local(a, b).norm();
}

}  // namespace

TEST_SUITE("alignment") {
  TEST_CASE("align_points: a turn about the line that points are near to costs what turn_cost says") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    Points source = random_points(random, 50), target = source;
    for (std::size_t i = 0; i < source.size(); ++i) {
      source[i](0) *= 100;
      target[i] = source[i] + 0.3 * Vector<3>(random.normal(), random.normal(), random.normal());
    }
    for (const bool with_scale : {false, true}) {
      const Alignment best = align_points(source, target, {}, {.with_scale = with_scale});
      const auto squares = [&](const SE3& turn) {
        Vector<3> centre = Vector<3>::Zero();
        for (const Vector<3>& p : target) centre += p / 50.0;
        double sum = 0;
        for (std::size_t i = 0; i < source.size(); ++i) {
          const Vector<3> p = best.T_target_source * Vector<3>(best.scale * source[i]);
          sum += (turn * Vector<3>(p - centre) + centre - target[i]).squaredNorm();
        }
        return sum;
      };
      // The cheapest axis of all is near x; none is cheaper than the cost says.
      double cheapest = 1e300;
      for (int k = 0; k < 2000; ++k) {
        const Vector<3> axis = Vector<3>(1, 0.02 * random.normal(), 0.02 * random.normal()).normalized();
        const double grown = squares(SE3(cairn::SO3::exp(0.5 * axis), Vector<3>::Zero())) - squares(SE3());
        cheapest = std::min(cheapest, grown);
      }
      const double said = 2 * best.scale * best.turn_cost * (1 - std::cos(0.5));
      CHECK(cheapest >= said * (1 - 1e-9));
      CHECK(cheapest < said * 1.05);
    }
    for (Vector<3>& p : source) p = Vector<3>(p(0), 0, 0);
    CHECK(align_points(source, source).turn_cost < 1e-9 * 50 * 100 * 100);
  }

  TEST_CASE("align_points: exact data give the motion and the scale back to rounding") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const std::size_t count : {3U, 4U, 10U, 500U}) {
      const SE3 T = cairn_test::random_pose(random);
      const Points source = random_points(random, count);
      const Alignment rigid = align_points(source, moved(source, T));
      CHECK(rigid.good());
      CHECK(rigid.rank == (count == 3 ? 2 : 3));
      CHECK(distance(rigid.T_target_source, T) < 1e-12);
      const Alignment similar = align_points(source, moved(source, T, 2.5), {}, {.with_scale = true});
      CHECK(similar.good());
      CHECK(similar.scale == doctest::Approx(2.5).epsilon(1e-13));
      CHECK(distance(similar.T_target_source, T) < 1e-12);
    }
  }

  TEST_CASE("align_points: agrees with Umeyama's SVD on noisy data") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 50; ++run) {
      const Points source = random_points(random, 20);
      Points target = moved(source, cairn_test::random_pose(random), 0.7);
      for (Vector<3>& p : target) p += 0.1 * Vector<3>(random.normal(), random.normal(), random.normal());
      Matrix<3, cairn::dynamic> x(3, 20), y(3, 20);
      for (int i = 0; i < 20; ++i) {
        x.col(i) = source[static_cast<std::size_t>(i)];
        y.col(i) = target[static_cast<std::size_t>(i)];
      }
      for (const bool with_scale : {false, true}) {
        const Matrix<4> expected = Eigen::umeyama(x, y, with_scale);
        const Alignment ours = align_points(source, target, {}, {.with_scale = with_scale});
        Matrix<4> found = ours.T_target_source.matrix();
        found.topLeftCorner<3, 3>() *= ours.scale;
        CHECK((found - expected).norm() < 1e-13);
      }
    }
  }

  TEST_CASE("align_points: the variance is what is left over the numbers beyond those that were fitted") {
    cairn::Random random(cairn_test::seed());
    for (const std::size_t count : {4U, 5U, 9U}) {
      const Points source = random_points(random, count), target = random_points(random, count);
      std::vector<double> weights(count);
      for (double& weight : weights) weight = random.uniform(0.5, 2.0);
      for (const bool with_scale : {false, true}) {
        const Alignment a = align_points(source, target, weights, {.with_scale = with_scale});
        double left = 0, sum = 0;
        for (std::size_t i = 0; i < count; ++i) {
          const Vector<3> apart = target[i] - a.T_target_source * Vector<3>(a.scale * source[i]);
          left += weights[i] * apart.dot(apart);
          sum += weights[i];
        }
        const double fitted = with_scale ? 7 : 6;
        CHECK(a.variance ==
              doctest::Approx(left / (3.0 * static_cast<double>(count) - fitted)).epsilon(1e-12));
        CHECK(a.rms == doctest::Approx(std::sqrt(left / sum)).epsilon(1e-12));
      }
    }
  }

  TEST_CASE("align_points: weights count like repeated points, weight zero like none") {
    cairn::Random random(cairn_test::seed());
    Points source = random_points(random, 5), target = random_points(random, 5);
    std::vector<double> weights{1, 2, 1, 0, 3};
    Points repeated_source, repeated_target;
    for (std::size_t i = 0; i < 5; ++i)
      for (int k = 0; k < static_cast<int>(weights[i]); ++k) {
        repeated_source.push_back(source[i]);
        repeated_target.push_back(target[i]);
      }
    const Alignment a = align_points(source, target, weights),
                    b = align_points(repeated_source, repeated_target);
    CHECK(distance(a.T_target_source, b.T_target_source) < 1e-13);
    CHECK((a.information - b.information).norm() < 1e-12);
    CHECK(a.rms == doctest::Approx(b.rms).epsilon(1e-13));
  }

  TEST_CASE(
      "align_points: points in a plane are enough; on a line or in one place the rotation is ambiguous") {
    cairn::Random random(cairn_test::seed());
    const SE3 T = cairn_test::random_pose(random);
    const Points plane{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 3, 0}};
    const Alignment flat = align_points(plane, moved(plane, T));
    CHECK(flat.good());
    CHECK(flat.rank == 2);
    CHECK(distance(flat.T_target_source, T) < 1e-12);

    const Points line{{1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {5, 5, 5}};
    const Alignment thin = align_points(line, moved(line, T));
    CHECK(thin.status == AlignmentStatus::ambiguous);
    CHECK(thin.rank == 1);
    CHECK_FALSE(thin.covariance.has_value());
    for (const Vector<3>& p : line) CHECK((thin.T_target_source * p - T * p).norm() < 1e-9);  // still fits

    const Points two{{0, 0, 0}, {1, 2, 3}};
    CHECK(align_points(two, moved(two, T)).status == AlignmentStatus::ambiguous);
    const Points place{{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
    const Alignment one = align_points(place, moved(place, T));
    CHECK(one.rank == 0);
    CHECK(one.status == AlignmentStatus::ambiguous);
    CHECK((one.T_target_source * place[0] - T * place[0]).norm() < 1e-12);
    CHECK(align_points(Points{}, Points{}).status == AlignmentStatus::ambiguous);
    const std::vector<double> nothing{0, 0, 0, 0};
    CHECK(align_points(line, line, nothing).status == AlignmentStatus::ambiguous);
    for (const Alignment& a : {flat, thin, one}) CHECK(a.T_target_source.matrix().allFinite());
  }

  TEST_CASE("align_points: a mirrored set is called so and gets a rotation, not a reflection") {
    cairn::Random random(cairn_test::seed());
    const Points source = random_points(random, 30);
    Points mirrored = source;
    for (Vector<3>& p : mirrored) p(0) = -p(0);
    const Alignment a = align_points(source, mirrored);
    CHECK(a.status == AlignmentStatus::mirrored);
    const Matrix<3> R = a.T_target_source.rotation().matrix();
    CHECK(R.col(0).cross(R.col(1)).dot(R.col(2)) == doctest::Approx(1));
    // noise on a planar set makes the best orthogonal matrix a reflection half of the time: that is no mirror
    for (int run = 0; run < 50; ++run) {
      Points plane = random_points(random, 10);
      for (Vector<3>& p : plane) p(2) = 0;
      Points noisy = plane;
      for (Vector<3>& p : noisy) p += 0.01 * Vector<3>(random.normal(), random.normal(), random.normal());
      CHECK(align_points(plane, noisy).good());
    }
  }

  TEST_CASE("align_points: coordinates a million metres from the origin lose six digits, not all") {
    cairn::Random random(cairn_test::seed());
    Points source = random_points(random, 20);
    for (Vector<3>& p : source) p += Vector<3>(1e6, -1e6, 1e6);
    const SE3 T = cairn_test::random_pose(random);
    const Points target = moved(source, T);
    const Alignment a = align_points(source, target);
    CHECK(a.good());
    // What is left is a difference of sums of squares about the means, which round.
    Vector<3> mean = Vector<3>::Zero();
    double squares = 0;
    for (const Vector<3>& p : source) mean += p / static_cast<double>(source.size());
    for (const Vector<3>& p : source)
      squares += (p - mean).squaredNorm() / static_cast<double>(source.size());
    CHECK(a.rms < std::sqrt(16 * std::numeric_limits<double>::epsilon() * squares));
    CHECK((a.T_target_source.rotation().inverse() * T.rotation()).angle() < 1e-8);
  }

  TEST_CASE("align_points: the covariance passes the Monte Carlo test, with and without scale") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    constexpr int runs = 500;
    double nees = 0, variance = 0;
    const double sigma = 0.02;
    for (int run = 0; run < runs; ++run) {
      Points source = random_points(random, 12);
      for (Vector<3>& p : source) p += Vector<3>(5, 0, -3);
      const SE3 T = cairn_test::random_pose(random);
      Points target = moved(source, T);
      std::vector<double> weights;
      for (Vector<3>& p : target) {
        const double own = sigma * random.uniform(0.5, 2);
        p += own * Vector<3>(random.normal(), random.normal(), random.normal());
        weights.push_back(1 / (own * own));
      }
      const Alignment a = align_points(source, target, weights);
      REQUIRE(a.covariance.has_value());
      const Vector<6> error = cairn::local(T, a.T_target_source);
      nees += cairn_test::normalised_square(*a.covariance, error) / runs;
      variance += a.variance / runs;
      CHECK((*a.covariance * a.information - Matrix<6>::Identity()).norm() < 1e-6);
    }
    CHECK(cairn::chi_square_mean_band(6, runs, cairn_test::almost_sure).contains(nees));
    CHECK(variance == doctest::Approx(1).epsilon(0.05));
  }

  TEST_CASE("align_points: names the pair that is not finite, and refuses numbers whose squares overflow") {
    cairn::Random random(cairn_test::seed());
    const Points good = random_points(random, 5);
    const auto message = [&](const Points& source, const Points& target, const std::vector<double>& weights) {
      try {
        (void)align_points(source, target, weights);
      } catch (const cairn::Error& error) {
        return std::string(error.what());
      }
      return std::string("nothing thrown");
    };
    Points bad = good;
    bad[3](1) = NAN;
    CHECK(message(bad, good, {}).find("pair 3") != std::string::npos);
    CHECK(message(good, bad, {}).find("pair 3") != std::string::npos);
    bad[3](1) = INFINITY;
    CHECK(message(bad, good, {}).find("pair 3") != std::string::npos);
    CHECK(message(good, good, {1, 1, -1, 1, 1}).find("pair 2") != std::string::npos);
    CHECK(message(good, good, {1, 1, 1, NAN, 1}).find("pair 3") != std::string::npos);
    bad[3](1) = 1e200;
    CHECK(message(bad, good, {}).find("overflow") != std::string::npos);
  }
}

}  // namespace alignment_test
