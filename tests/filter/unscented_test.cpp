// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/so2.hpp>

#include "filter/linear_problems.hpp"
#include "support/elimination.hpp"
#include "support/random.hpp"

namespace unscented_test {
namespace {

using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::SigmaPoints;
using cairn::SO2;
using cairn::Unscented;
using cairn::Vector;
using cairn_test::largest_difference;
using cairn_test::LinearProblem;
using cairn_test::relative_error;

// 300 steps of both filters; `updates` measurements after each prediction, Q changing with time.
template <int N, int M, class S>
double distance_from_kalman(const SigmaPoints& points, int updates, std::uint64_t seed) {
  cairn::Random random(seed);
  LinearProblem<N, M, S> problem(random);
  auto kalman_belief = problem.prior;
  auto unscented_belief = problem.prior;
  const Unscented unscented{.points = points};
  double worst = 0.0;
  const auto q = problem.process.covariance;
  for (int step = 0; step < 300; ++step) {
    problem.process.covariance = q * static_cast<S>(1.0 + 0.5 * std::sin(0.1 * step));
    REQUIRE(Kalman{}.predict(kalman_belief, problem.process, 1.0) == cairn::Status::accepted);
    REQUIRE(unscented.predict(unscented_belief, problem.process, 1.0) == cairn::Status::accepted);
    for (int k = 0; k < updates; ++k) {
      const Vector<M, S> z = cairn_test::random_matrix<M, 1, S>(random);
      REQUIRE(Kalman{}.update(kalman_belief, problem.sensor, z).accepted());
      REQUIRE(unscented.update(unscented_belief, problem.sensor, z).accepted());
    }
    worst = std::max(worst, relative_error(unscented_belief.covariance, kalman_belief.covariance));
    // In units of the mean and its deviation: a mean alone may happen to be near zero.
    const auto& mean = kalman_belief.mean;
    const double size = static_cast<double>(mean.cwiseAbs().maxCoeff()) +
                        std::sqrt(static_cast<double>(kalman_belief.covariance.maxCoeff()));
    worst = std::max(worst, 0.1 * largest_difference(unscented_belief.mean, mean) / size);
  }
  return worst;
}

template <class S>
void battery(double alpha, double tolerance) {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  CAPTURE(alpha);
  for (const double kappa : {0.0, 2.0}) {
    const SigmaPoints points{.alpha = alpha, .beta = 2.0, .kappa = kappa};
    for (int updates = 1; updates <= 3; ++updates) {
      CAPTURE(updates);
      CHECK(distance_from_kalman<4, 2, S>(points, updates, seed) < tolerance);
      CHECK(distance_from_kalman<2, 3, S>(points, updates, seed + 1) < tolerance);
      CHECK(distance_from_kalman<1, 1, S>(points, updates, seed + 2) < tolerance);
      CHECK(distance_from_kalman<6, 1, S>(points, updates, seed + 3) < tolerance);
    }
  }
}

TEST_SUITE("unscented") {
  TEST_CASE("unscented: is the Kalman filter on linear models for every alpha, in double") {
    battery<double>(1.0, 1e-12);
    battery<double>(1e-1, 1e-11);
    battery<double>(1e-2, 1e-10);
    battery<double>(1e-3, 1e-9);
    battery<double>(1e-4, 1e-8);
  }

  TEST_CASE("unscented: is the Kalman filter on linear models for every alpha, in float") {
    battery<float>(1.0, 1e-4);
    battery<float>(1e-1, 2e-4);
    battery<float>(1e-2, 3e-3);
    battery<float>(1e-3, 1e-2);
    battery<float>(1e-4, 1e-2);
  }

  TEST_CASE("unscented: reproduces the EKF/UKF Toolbox of Hartikainen, Solin and Sarkka") {
    cairn::LinearModel<2> process{(Matrix<2>() << 1, 1, 0, 1).finished(), 2 * Matrix<2>::Identity()};
    cairn::LinearSensor<1, 2> sensor{Matrix<1, 2>(0.5, -0.3), Matrix<1>(0.5)};
    Gaussian<Vector<2>> belief{Vector<2>(1, 1), (Matrix<2>() << 1, 0.1, 0.1, 1).finished()};
    const Unscented unscented{.points = {.alpha = 1.0, .beta = 0.0, .kappa = 1.0}};
    const double means[3][2] = {{2.35637583900053, 0.92953020131845},
                                {4.39153258583784, 1.15148930114305},
                                {6.71906243764755, 1.52810614201467}};
    const double covariances[3][3] = {{2.09738255033564, 1.51577181208054, 2.91778523489934},
                                      {3.62532578216913, 3.14443733560803, 4.65898912348045},
                                      {4.3902465859811, 3.90194406652627, 5.40957304471697}};
    for (int k = 0; k < 3; ++k) {
      REQUIRE(unscented.predict(belief, process, 1.0) == cairn::Status::accepted);
      REQUIRE(unscented.update(belief, sensor, Vector<1>(k + 1.0)).accepted());
      CHECK(std::abs(belief.mean(0) - means[k][0]) < 2e-8);
      CHECK(std::abs(belief.mean(1) - means[k][1]) < 2e-8);
      CHECK(std::abs(belief.covariance(0, 0) - covariances[k][0]) < 2e-8);
      CHECK(std::abs(belief.covariance(0, 1) - covariances[k][1]) < 2e-8);
      CHECK(std::abs(belief.covariance(1, 1) - covariances[k][2]) < 2e-8);
    }
  }

  TEST_CASE("unscented_transform: polar to Cartesian as Julier and Uhlmann print it") {
    const double sigma = 15.0 * M_PI / 180.0;
    const Gaussian<Vector<2>> polar{Vector<2>(1.0, M_PI / 2), Vector<2>(4e-4, sigma * sigma).asDiagonal()};
    const auto f = [](const Vector<2>& p) { return Vector<2>(p(0) * std::cos(p(1)), p(0) * std::sin(p(1))); };
    const auto out = cairn::unscented_transform(polar, f, {.alpha = 1, .beta = 0, .kappa = 1});
    CHECK(out.mean(1) == doctest::Approx(0.96631372836).epsilon(1e-10));
    CHECK(std::abs(out.mean(0)) < 1e-15);
    CHECK(out.covariance(0, 0) == doctest::Approx(0.06396824859).epsilon(1e-9));
    CHECK(out.covariance(1, 1) == doctest::Approx(0.00266952979).epsilon(1e-8));
  }

  TEST_CASE("cubature: its points carry mean and covariance of 2n equal weights") {
    cairn::Random random(3);
    const Gaussian<Vector<3>> belief{cairn_test::random_matrix<3, 1>(random),
                                     cairn_test::random_covariance<3>(random)};
    const auto f = [](const Vector<3>& p) { return Vector<2>(p(0) * p(1), std::sin(p(2)) + p(0)); };
    const auto out = cairn::unscented_transform(belief, f, cairn::cubature().points);
    const Matrix<3> root = cairn_test::lower_root(belief.covariance);
    Vector<2> mean = Vector<2>::Zero();
    Matrix<2> square = Matrix<2>::Zero();
    for (int i = 0; i < 6; ++i) {
      const Vector<2> y = f(belief.mean + (i % 2 == 0 ? 1 : -1) * std::sqrt(3.0) * root.col(i / 2));
      mean += y / 6;
      square += y * y.transpose() / 6;
    }
    CHECK((out.mean - mean).norm() < 1e-14);
    CHECK((out.covariance - (square - mean * mean.transpose())).norm() < 1e-14);
  }

  TEST_CASE("unscented: averages angles across half a turn") {
    const Gaussian<SO2> heading{SO2(M_PI - 0.01), Matrix<1>(0.04)};
    for (const double alpha : {1.0, 1e-3}) {
      const auto out = cairn::unscented_transform(heading, [](const SO2& a) { return a * SO2(0.02); },
                                                  {.alpha = alpha, .beta = 2, .kappa = 0});
      CHECK(out.mean.angle() == doctest::Approx(-M_PI + 0.01).epsilon(1e-9));
      CHECK(out.covariance(0, 0) == doctest::Approx(0.04).epsilon(1e-9));
    }
  }

  TEST_CASE("unscented: refuses bad options and bad numbers and leaves the belief") {
    cairn::Random random(4);
    LinearProblem<3, 2> problem(random);
    auto belief = problem.prior;
    const double nan = std::nan("");
    const auto same = [&] {
      return belief.mean == problem.prior.mean && belief.covariance == problem.prior.covariance;
    };
    CHECK(Unscented{}.update(belief, problem.sensor, Vector<2>(nan, 0)).status == cairn::Status::not_finite);
    CHECK(Unscented{.gate = 1e-6}.update(belief, problem.sensor, Vector<2>(9, 9)).status ==
          cairn::Status::gated);
    CHECK(Unscented{.gate = 0}.update(belief, problem.sensor, Vector<2>(0, 0)).status ==
          cairn::Status::bad_option);
    CHECK(Unscented{.points = {.kappa = -3}}.update(belief, problem.sensor, Vector<2>(0, 0)).status ==
          cairn::Status::bad_option);
    CHECK(Unscented{.points = {.alpha = 0}}.predict(belief, problem.process, 1) == cairn::Status::bad_option);
    CHECK(Unscented{}.predict(belief, problem.process, -1) == cairn::Status::bad_time_step);
    CHECK(Unscented{}.predict(belief, problem.process, nan) == cairn::Status::bad_time_step);
    auto broken = problem.process;
    broken.covariance(0, 0) = nan;
    CHECK(Unscented{}.predict(belief, broken, 1) == cairn::Status::not_finite);
    broken.covariance = -100 * Matrix<3>::Identity();
    CHECK(Unscented{}.predict(belief, broken, 1) == cairn::Status::not_positive_definite);
    CHECK(same());
    belief.covariance(0, 0) = -1;
    CHECK(Unscented{}.predict(belief, problem.process, 1) == cairn::Status::not_positive_definite);
  }
}

}  // namespace
}  // namespace unscented_test
