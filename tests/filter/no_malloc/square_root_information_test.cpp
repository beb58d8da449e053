// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/square_root_information.hpp>

#include "filter/linear_problems.hpp"
#include "filter/no_malloc/eigen.hpp"
#include "support/random.hpp"

namespace square_root_information_test {
namespace {

using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::SquareRootInformationFilter;
using cairn::Status;
using cairn::Vector;
using cairn_test::LinearProblem;
using cairn_test::relative_error;
template <int N, class S = double>
using Belief = cairn::SquareRootInformation<Vector<N, S>>;

template <int N, int M, class S>
double distance_from_kalman(double fading, double stabilising) {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  const LinearProblem<N, M, S> p(random);
  auto exact = p.prior;
  auto belief = Belief<N, S>::from(p.prior).value();
  const SquareRootInformationFilter filter{.fading = fading, .stabilising_noise = stabilising};
  const Kalman kalman{.fading = fading, .stabilising_noise = stabilising};
  double worst = 0.0;
  for (int step = 0; step < 60; ++step) {
    if (step % 3 != 1) {
      REQUIRE(kalman.predict(exact, p.process, 1.0) == Status::accepted);
      REQUIRE(filter.predict(belief, p.process, 1.0) == Status::accepted);
    }
    const Vector<M, S> z = cairn_test::random_matrix<M, 1, S>(random);
    REQUIRE(kalman.update(exact, p.sensor, z).accepted());
    REQUIRE(filter.update(belief, p.sensor, z) == Status::accepted);
    const auto plain = belief.gaussian().value();
    worst = std::max(worst, relative_error(plain.covariance, exact.covariance));
    worst = std::max(worst, 0.1 * relative_error(plain.mean, exact.mean));
  }
  return worst;
}

// H = [1 1 1; 1 1 1+d], R = d^2 I, P = I: the posterior d^2 (d^2 I + H^T H)^-1 by cofactors, d^4 cancelled.
Matrix<3> exact_posterior(double d) {
  const double r = d * d;
  Matrix<3> p;
  p << 5 + 2 * d + 2 * r, -3, -2 - d, -3, 5 + 2 * d + 2 * r, -2 - d, -2 - d, -2 - d, 4 + r;
  return p / (2 * (4 + d + r));
}

TEST_SUITE("square_root_information") {
  TEST_CASE("square_root_information: is the Kalman filter, with fading memory and stabilising noise") {
    CHECK(distance_from_kalman<4, 2, double>(1.0, 0.0) < 1e-10);
    CHECK(distance_from_kalman<4, 2, double>(1.2, 0.3) < 1e-10);
    CHECK(distance_from_kalman<2, 3, float>(1.0, 0.0) < 1e-3);
  }

  TEST_CASE("square_root_information: starts from nothing and ends where least squares does") {
    auto belief = Belief<2>::ignorant(Vector<2>(5, -5));
    CHECK_FALSE(belief.gaussian().has_value());
    const cairn_test::LineFit line;
    for (int i = 0; i < line.points; ++i) {
      REQUIRE(SquareRootInformationFilter{}.update(belief, line.sensor(i), line.height(i)) ==
              Status::accepted);
      CHECK(belief.gaussian().has_value() == (i > 0));
    }
    const auto found = belief.gaussian().value();
    CHECK((found.mean - line.solution).norm() < 1e-13);
    const Matrix<2> normal = 4.0 * line.design.transpose() * line.design;
    CHECK((found.covariance * normal - Matrix<2>::Identity()).norm() < 1e-13);
    // a prediction keeps the ignorance of what nobody saw
    auto half = Belief<2>::ignorant(Vector<2>(0, 0));
    const cairn::LinearSensor<1, 2> first{Matrix<1, 2>(1, 0), Matrix<1>(0.25)};
    REQUIRE(SquareRootInformationFilter{}.update(half, first, Vector<1>(1.0)) == Status::accepted);
    const cairn::LinearModel<2> still{Matrix<2>::Identity(), Matrix<2>::Identity()};
    REQUIRE(SquareRootInformationFilter{}.predict(half, still, 1.0) == Status::accepted);
    const Matrix<2> information = half.root.transpose() * half.root;
    CHECK(std::abs(information(0, 0) - 1.0 / 1.25) < 1e-14);
    CHECK(std::abs(information(1, 1)) < 1e-30);
  }

  // Grewal and Andrews' example: the plain information form is wrong by 100 % from d = 1e-4 on.
  TEST_CASE("square_root_information: keeps digits where R is tiny") {
    for (const double d : {1e-2, 1e-4, 1e-6, 1e-8}) {
      CAPTURE(d);
      Matrix<2, 3> h;
      h << 1, 1, 1, 1, 1, 1 + d;
      const double exact_d = h(1, 2) - 1.0;  // what 1 + d rounds to
      auto belief = Belief<3>::from({Vector<3>::Zero(), Matrix<3>::Identity()}).value();
      const cairn::LinearSensor<2, 3> sensor{h, exact_d * exact_d * Matrix<2>::Identity()};
      REQUIRE(SquareRootInformationFilter{}.update(belief, sensor, Vector<2>::Zero()) == Status::accepted);
      const Matrix<3> expected = exact_posterior(exact_d);
      CHECK(relative_error(belief.gaussian().value().covariance, expected) < 1e-14 / d);
    }
  }

  TEST_CASE("square_root_information: refuses bad numbers, keeps the belief, and never allocates") {
    cairn::Random random(3);
    const LinearProblem<4, 2> p(random);
    auto belief = Belief<4>::from(p.prior).value();
    const auto before = belief;
    const SquareRootInformationFilter filter{};
    const double nan = std::nan("");
    auto broken = p;
    CHECK(filter.predict(belief, p.process, -1.0) == Status::bad_time_step);
    CHECK(filter.predict(belief, p.process, nan) == Status::bad_time_step);
    CHECK(SquareRootInformationFilter{.fading = 0.5}.predict(belief, p.process, 1) == Status::bad_option);
    CHECK(SquareRootInformationFilter{.stabilising_noise = -1}.predict(belief, p.process, 1) ==
          Status::bad_option);
    CHECK(filter.update(belief, p.sensor, Vector<2>(nan, 0)) == Status::not_finite);
    broken.sensor.covariance(0, 0) = INFINITY;
    CHECK(filter.update(belief, broken.sensor, Vector<2>(0, 0)) == Status::not_finite);
    broken.sensor.covariance = -Matrix<2>::Identity();
    CHECK(filter.update(belief, broken.sensor, Vector<2>(0, 0)) == Status::not_positive_definite);
    broken.process.covariance = -Matrix<4>::Identity();
    CHECK(filter.predict(belief, broken.process, 1) == Status::not_positive_definite);
    broken.process.covariance(0, 0) = nan;
    CHECK(filter.predict(belief, broken.process, 1) == Status::not_finite);
    broken.process = p.process;
    broken.process.transition.setZero();
    CHECK(filter.predict(belief, broken.process, 1) == Status::not_positive_definite);
    CHECK(belief.root == before.root);
    CHECK(belief.vector == before.vector);
    CHECK_FALSE(Belief<3>::from({Vector<3>::Zero(), Matrix<3>::Zero()}).has_value());
    const cairn_test::NoAllocation guard;
    CHECK(filter.predict(belief, p.process, 1.0) == Status::accepted);
    CHECK(filter.update(belief, p.sensor, Vector<2>(1, 2)) == Status::accepted);
  }
}

}  // namespace
}  // namespace square_root_information_test
