// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What must hold whatever the numbers: no allocation, no NaN, no covariance that is none, no touched belief.
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/constraint.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/robust.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>

#include "filter/linear_problems.hpp"
#include "filter/no_malloc/eigen.hpp"
#include "support/random.hpp"

namespace reliability_test {
namespace {

using cairn::Form;
using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;
using cairn_test::LinearProblem;
using cairn_test::NoAllocation;

TEST_SUITE("reliability") {
  TEST_CASE("filters: predict and update never allocate for fixed sizes") {
    cairn::Random random(1);
    const LinearProblem<6, 3> p(random);
    const Vector<3> z = Vector<3>::Zero();
    auto belief = p.prior;
    auto ud = cairn::UDGaussian<Vector<6>>::from(p.prior);
    const NoAllocation guard;
    CHECK_THROWS_AS(Vector<cairn::dynamic>(3), std::logic_error);  // the guard does see allocations
    for (const Form form : {Form::standard, Form::joseph, Form::sequential}) {
      CHECK(Kalman{.form = form}.predict(belief, p.process, 1.0) == Status::accepted);
      CHECK(Kalman{.form = form}.update(belief, p.sensor, z).accepted());
    }
    CHECK(cairn::Extended{.iterations = 3}.update(belief, p.sensor, z).accepted());
    CHECK(cairn::Unscented{}.predict(belief, p.process, 1.0) == Status::accepted);
    CHECK(cairn::Unscented{}.update(belief, p.sensor, z).accepted());
    CHECK(cairn::UDFilter{}.predict(ud, p.process, 1.0) == Status::accepted);
    CHECK(cairn::UDFilter{}.update(ud, p.sensor, z).accepted());
  }

  // Random conditioning to 1e12 and beyond: accepted steps are symmetric, semi-definite and finite.
  template <int N, int M>
  void hammer(int steps, std::uint64_t seed) {
    cairn::Random random(seed);
    int accepted = 0;
    for (int run = 0; run < steps / 20; ++run) {
      LinearProblem<N, M> p(random);
      Vector<N> scale;
      for (int i = 0; i < N; ++i) scale(i) = std::pow(10.0, random.uniform(-6, 6));
      p.prior.covariance = scale.asDiagonal() * p.prior.covariance * scale.asDiagonal();
      p.process.covariance *= std::pow(10.0, random.uniform(-12, 6));
      p.sensor.covariance *= std::pow(10.0, random.uniform(-12, 6));
      auto belief = p.prior;
      const Kalman filter{.form = static_cast<Form>(run % 3)};
      for (int step = 0; step < 20; ++step) {
        const auto before = belief;
        const bool kept =
            step % 2 == 0
                ? filter.predict(belief, p.process, 1.0) == Status::accepted
                : filter.update(belief, p.sensor, cairn_test::random_matrix<M, 1>(random)).accepted();
        accepted += kept ? 1 : 0;
        bool sound = belief.mean.allFinite() && belief.covariance.allFinite();
        if (kept)
          sound = sound && belief.covariance == belief.covariance.transpose() &&
                  belief.covariance.diagonal().minCoeff() >= 0.0;
        else
          sound = sound && belief.mean == before.mean && belief.covariance == before.covariance;
        if (step % 2 == 1 && kept)
          sound = sound && cairn::detail::is_valid_covariance<N, double>(belief.covariance);
        if (!sound) FAIL_CHECK("an unsound belief, run " << run << " step " << step << " seed " << seed);
      }
    }
    CHECK(accepted > steps / 2);
  }
  TEST_CASE("kalman: half a million random steps of any conditioning end sound or refused") {
    const auto seed = cairn_test::seed();
    hammer<1, 1>(100000, seed);
    hammer<4, 2>(200000, seed + 1);
    hammer<9, 4>(200000, seed + 2);
  }

  TEST_CASE("kalman: bad numbers are refused by name and leave the belief") {
    cairn::Random random(2);
    const LinearProblem<3, 2> p(random);
    const double nan = std::nan(""), inf = INFINITY;
    auto belief = p.prior;
    for (const double bad : {nan, inf, -inf}) {
      CHECK(Kalman{}.update(belief, p.sensor, Vector<2>(0, bad)).status == Status::not_finite);
      auto noisy = p.sensor;
      noisy.covariance(1, 1) = bad;
      CHECK_FALSE(Kalman{}.update(belief, noisy, Vector<2>(0, 0)).accepted());
      auto driven = p.process;
      driven.covariance(2, 2) = bad;
      CHECK_FALSE(Kalman{}.predict(belief, driven, 1.0) == Status::accepted);
      CHECK(Kalman{}.predict(belief, p.process, bad) == Status::bad_time_step);
    }
    CHECK(Kalman{}.predict(belief, p.process, -1.0) == Status::bad_time_step);
    CHECK(Kalman{.fading = 0.5}.predict(belief, p.process, 1.0) == Status::bad_option);
    CHECK(Kalman{.gate = 0.0}.update(belief, p.sensor, Vector<2>(0, 0)).status == Status::bad_option);
    CHECK(Kalman{.gate = nan}.update(belief, p.sensor, Vector<2>(0, 0)).status == Status::bad_option);
    CHECK(Kalman{.gate = 1e-9}.update(belief, p.sensor, Vector<2>(9, 9)).status == Status::gated);
    CHECK(belief.mean == p.prior.mean);
    CHECK(belief.covariance == p.prior.covariance);
    // P = 0 and R = 0: S is singular
    Gaussian<Vector<1>> certain{Vector<1>(0), Matrix<1>(0)};
    const cairn::LinearSensor<1, 1> perfect{Matrix<1>(1), Matrix<1>(0)};
    CHECK(Kalman{}.update(certain, perfect, Vector<1>(1)).status == Status::not_positive_definite);
    CHECK(certain.mean(0) == 0.0);
    // a perfect sensor of an uncertain state: joseph takes it
    Gaussian<Vector<1>> vague{Vector<1>(0), Matrix<1>(4)};
    CHECK(Kalman{.form = Form::joseph}.update(vague, perfect, Vector<1>(1)).accepted());
    CHECK(vague.mean(0) == 1.0);
    // bad priors
    for (const double bad : {nan, inf, -1.0}) {
      auto broken = p.prior;
      broken.covariance(0, 0) = bad;
      CHECK_FALSE(Kalman{}.update(broken, p.sensor, Vector<2>(0, 0)).accepted());
      auto lost = p.prior;
      lost.mean(2) = bad == -1.0 ? nan : bad;
      CHECK_FALSE(Kalman{}.update(lost, p.sensor, Vector<2>(0, 0)).accepted());
    }
  }

  TEST_CASE("kalman: fading memory and stabilising noise do what they say") {
    cairn::Random random(3);
    const LinearProblem<3, 2> p(random);
    auto plain = p.prior, faded = p.prior, stabilised = p.prior;
    REQUIRE(Kalman{}.predict(plain, p.process, 1.0) == Status::accepted);
    REQUIRE(Kalman{.fading = 1.5}.predict(faded, p.process, 1.0) == Status::accepted);
    REQUIRE(Kalman{.stabilising_noise = 0.25}.predict(stabilised, p.process, 1.0) == Status::accepted);
    const Matrix<3> moved = plain.covariance - p.process.covariance;
    CHECK((faded.covariance - 1.5 * moved - p.process.covariance).norm() < 1e-14);
    CHECK((stabilised.covariance - plain.covariance - 0.25 * Matrix<3>::Identity()).norm() < 1e-15);
  }

  TEST_CASE("constrain: the belief fulfils the constraint and knows it") {
    cairn::Random random(4);
    const LinearProblem<3, 2> p(random);
    auto belief = p.prior;
    const Matrix<1, 3> d(1, 2, -1);
    const Vector<1> c = Vector<1>(0.5) - d * belief.mean;
    REQUIRE(cairn::constrain<Vector<3>, 1>(belief, d, c) == Status::accepted);
    CHECK(std::abs((d * belief.mean)(0) - 0.5) < 1e-14);
    CHECK((d * belief.covariance).norm() < 1e-14);
    Gaussian<Vector<3>> certain{Vector<3>::Zero(), Matrix<3>::Zero()};
    CHECK(cairn::constrain<Vector<3>, 1>(certain, d, c) == Status::contradiction);
  }

  TEST_CASE("robust: softens an outlier to its limit and leaves good data alone") {
    cairn::Random random(5);
    const LinearProblem<3, 2> p(random);
    const cairn::Robust<Kalman> robust{.limit = 6.0};
    auto plain = p.prior, soft = p.prior;
    const Vector<2> good = p.sensor.predict(p.prior.mean) + Vector<2>(0.1, 0.1);
    REQUIRE(Kalman{}.update(plain, p.sensor, good).accepted());
    REQUIRE(robust.update(soft, p.sensor, good).accepted());
    CHECK(soft.mean == plain.mean);
    const Vector<2> wild = p.sensor.predict(soft.mean) + Vector<2>(500, -300);
    const auto before = soft;
    const auto innovation = robust.update(soft, p.sensor, wild);
    REQUIRE(innovation.accepted());
    CHECK(innovation.nis == doctest::Approx(6.0).epsilon(1e-6));
    auto hard = before;
    REQUIRE(Kalman{}.update(hard, p.sensor, wild).accepted());
    CHECK((soft.mean - before.mean).norm() < 0.1 * (hard.mean - before.mean).norm());
    CHECK(cairn::Robust<Kalman>{.limit = 0}.update(soft, p.sensor, good).status == Status::bad_option);
  }

  TEST_CASE("adapted_noise: learns the variance of a sensor that was mistaken about it") {
    cairn::Random random(cairn_test::seed());
    const cairn::LinearModel<1> process{Matrix<1>(1.0), Matrix<1>(0.01)};
    cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(25.0)};
    Gaussian<Vector<1>> belief{Vector<1>(0.0), Matrix<1>(1.0)};
    double x = 0.0, sum = 0.0;
    for (int step = 0; step < 20000; ++step) {
      x += random.normal(0.0, 0.1);
      REQUIRE(Kalman{}.predict(belief, process, 1.0) == Status::accepted);
      const Vector<1> z(x + random.normal(0.0, 1.0));
      REQUIRE(Kalman{}.update(belief, sensor, z).accepted());
      sensor.covariance = cairn::adapted_noise(sensor.covariance, belief, sensor, z, 0.005);
      if (step >= 10000) sum += sensor.covariance(0) / 10000;
    }
    CHECK(sum == doctest::Approx(1.0).epsilon(0.1));
  }
}

}  // namespace
}  // namespace reliability_test
