// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/ensemble.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/models/linear.hpp>

#include "filter/linear_problems.hpp"
#include "support/random.hpp"

namespace ensemble_test {
namespace {

using cairn::Ensemble;
using cairn::EnsembleForm;
using cairn::EnsembleKalman;
using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::SO2;
using cairn::Status;
using cairn::Vector;
using cairn_test::LinearProblem;
using cairn_test::relative_error;

// A heading seen directly.
struct Needle {
  using State = SO2;
  using Measurement = SO2;
  [[nodiscard]] SO2 predict(const SO2& x) const { return x; }
  [[nodiscard]] Matrix<1> noise(const SO2&) const { return Matrix<1>(0.01); }
};

TEST_SUITE("ensemble") {
  TEST_CASE("ensemble: the square-root form is exactly the Kalman update of its mean and covariance") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const LinearProblem<4, 3> p(random);
    auto belief = Ensemble<Vector<4>>::draw(p.prior, 7, random);
    for (int step = 0; step < 10; ++step) {
      REQUIRE(EnsembleKalman{}.predict(belief, p.process, 1.0, random) == Status::accepted);
      auto exact = belief.gaussian();
      const double inflation = step % 2 == 0 ? 1.0 : 1.1;
      exact.covariance *= inflation * inflation;
      const Vector<3> z = cairn_test::random_matrix<3, 1>(random);
      const auto expected = Kalman{}.update(exact, p.sensor, z);
      const auto found = EnsembleKalman{.inflation = inflation}.update(belief, p.sensor, z, random);
      REQUIRE(expected.accepted());
      REQUIRE(found.accepted());
      CHECK(std::abs(found.nis - expected.nis) < 1e-10 * (1 + expected.nis));
      const auto updated = belief.gaussian();
      CHECK(relative_error(updated.mean, exact.mean) < 1e-11);
      CHECK(relative_error(updated.covariance, exact.covariance) < 1e-11);
    }
  }

  TEST_CASE(
      "ensemble: draws of the perturbed form do not move the mean, which is the Kalman update's exactly") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const EnsembleKalman filter{.form = EnsembleForm::perturbed};
    const LinearProblem<4, 1> p(random);
    auto belief = Ensemble<Vector<4>>::draw(p.prior, 7, random);
    for (int step = 0; step < 10; ++step) {
      REQUIRE(filter.predict(belief, p.process, 1.0, random) == Status::accepted);
      auto exact = belief.gaussian();
      const Vector<1> z(random.normal());
      REQUIRE(Kalman{}.update(exact, p.sensor, z).accepted());
      REQUIRE(filter.update(belief, p.sensor, z, random).accepted());
      CHECK(relative_error(belief.gaussian().mean, exact.mean) < 1e-11);
    }
  }

  TEST_CASE("ensemble: many members tend to the Kalman filter in both forms") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    for (const auto form : {EnsembleForm::perturbed, EnsembleForm::square_root}) {
      cairn::Random random(seed);
      const LinearProblem<2, 1> p(random);
      auto exact = p.prior;
      auto belief = Ensemble<Vector<2>>::draw(p.prior, 20000, random);
      for (int step = 0; step < 5; ++step) {
        REQUIRE(EnsembleKalman{.form = form}.predict(belief, p.process, 1.0, random) == Status::accepted);
        REQUIRE(Kalman{}.predict(exact, p.process, 1.0) == Status::accepted);
        const Vector<1> z(random.normal());
        REQUIRE(EnsembleKalman{.form = form}.update(belief, p.sensor, z, random).accepted());
        REQUIRE(Kalman{}.update(exact, p.sensor, z).accepted());
      }
      CHECK(relative_error(belief.gaussian().covariance, exact.covariance) < 0.06);
      CHECK(std::sqrt(cairn::nees(exact, belief.gaussian().mean)) < 0.06);  // standard deviations
    }
  }

  TEST_CASE("ensemble: headings across half a turn") {
    cairn::Random random(cairn_test::seed());
    auto belief = Ensemble<SO2>::draw({SO2(M_PI - 0.05), Matrix<1>(0.04)}, 200, random);
    REQUIRE(EnsembleKalman{}.update(belief, Needle{}, SO2(-M_PI + 0.1), random).accepted());
    const auto result = belief.gaussian();
    CHECK(std::abs(cairn::local(SO2(-M_PI + 0.07), result.mean)(0)) < 0.03);
    CHECK(result.covariance(0) == doctest::Approx(0.008).epsilon(0.1).scale(0));
  }

  TEST_CASE("ensemble: refuses bad numbers and keeps the members") {
    cairn::Random random(2);
    const LinearProblem<4, 3> p(random);
    auto belief = Ensemble<Vector<4>>::draw(p.prior, 10, random);
    const auto before = belief.members;
    const Vector<3> z(0, 0, 0);
    const double nan = std::nan("");
    const EnsembleKalman filter{};
    auto broken = p;
    CHECK(filter.predict(belief, p.process, -1.0, random) == Status::bad_time_step);
    CHECK(filter.update(belief, p.sensor, Vector<3>(nan, 0, 0), random).status == Status::not_finite);
    CHECK(EnsembleKalman{.gate = 0}.update(belief, p.sensor, z, random).status == Status::bad_option);
    CHECK(EnsembleKalman{.inflation = 0.9}.update(belief, p.sensor, z, random).status == Status::bad_option);
    CHECK(EnsembleKalman{.gate = 1e-9}.update(belief, p.sensor, Vector<3>(9, 9, 9), random).status ==
          Status::gated);
    broken.sensor.covariance(0, 0) = nan;
    CHECK(filter.update(belief, broken.sensor, z, random).status == Status::not_finite);
    broken.sensor.covariance.setZero();
    CHECK(filter.update(belief, broken.sensor, z, random).status == Status::not_positive_definite);
    broken.process.covariance = -Matrix<4>::Identity();
    CHECK(filter.predict(belief, broken.process, 1.0, random) == Status::not_positive_definite);
    broken.process.covariance(0, 0) = nan;
    CHECK(filter.predict(belief, broken.process, 1.0, random) == Status::not_finite);
    CHECK(belief.members == before);
    Ensemble<Vector<4>> none;
    CHECK(filter.predict(none, p.process, 1.0, random) == Status::depleted);
    CHECK(filter.update(none, p.sensor, z, random).status == Status::depleted);
    belief.members[4](1) = nan;
    CHECK(filter.update(belief, p.sensor, z, random).status == Status::not_finite);
  }
}

TEST_SUITE("particle") {
  TEST_CASE("resample_by_kld: takes as many particles as the bins ask for, in proportion to the weights") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto bin = [](const Vector<1>& x) { return std::floor(x(0) * 10.0); };
    const cairn::KldSampling options{.least = 50, .most = 50000};
    std::size_t last = 0;
    for (const double sigma : {0.02, 0.3, 3.0}) {
      auto belief =
          cairn::draw_particles(Gaussian<Vector<1>>{Vector<1>(1.0), Matrix<1>(sigma * sigma)}, 20000, random);
      REQUIRE(cairn::resample_by_kld(belief, options, bin, random) == Status::accepted);
      std::vector<double> bins;
      for (const auto& x : belief.states) bins.push_back(bin(x));
      std::sort(bins.begin(), bins.end());
      bins.erase(std::unique(bins.begin(), bins.end()), bins.end());
      CHECK(belief.size() >= cairn::kld_particle_count(bins.size(), options.epsilon));
      CHECK(belief.size() > last);
      last = belief.size();
      const auto moments = cairn::moments(belief);
      const double error = sigma / std::sqrt(static_cast<double>(belief.size()));
      CHECK(std::abs(moments.mean(0) - 1.0) < 5 * error);
    }
    // three bins of unequal weight
    cairn::Particles<Vector<1>> uneven{{Vector<1>(0.0), Vector<1>(1.0), Vector<1>(2.0)},
                                       {std::log(0.7), std::log(0.3), -INFINITY}};
    REQUIRE(cairn::resample_by_kld(uneven, {.least = 20000, .most = 20000}, bin, random) == Status::accepted);
    CHECK(uneven.size() == 20000);
    CHECK(std::abs(cairn::moments(uneven).mean(0) - 0.3) < 5 * std::sqrt(0.21 / 20000));
  }

  // z twice of x: the sum has variance 2 v + r, the difference r, which S = v + r, v as it is written has
  // lost
  TEST_CASE("ensemble: what two numbers differ by is judged where their spread hides it") {
    const double v = 1e12, r = 1e-6, far = std::sqrt(1.5 * v);
    const cairn::LinearSensor<2, 1> twice{Matrix<2, 1>(1, 1), r * Matrix<2>::Identity()};
    cairn::Random random(1);
    for (const auto form : {EnsembleForm::square_root, EnsembleForm::perturbed})
      for (const double apart : {0.003, 0.03}) {  // nis 4.5 and 450
        CAPTURE(apart);
        Ensemble<Vector<1>> belief{{Vector<1>(-far), Vector<1>(0.0), Vector<1>(0.0), Vector<1>(far)}};
        const double variance = 2 * far * far / 3;
        const auto in = EnsembleKalman{.form = form, .gate = 20}.update(belief, twice,
                                                                        Vector<2>(2e6, 2e6 + apart), random);
        const double nis = apart * apart / (2 * r) + 0.5 * 4e6 * 4e6 / (2 * variance + r);
        CHECK(in.status == (nis < 20 ? Status::accepted : Status::gated));
        CHECK(in.nis == doctest::Approx(nis).epsilon(1e-5));
        const double expected = -0.5 * (nis + std::log(r) + std::log(2 * variance + r)) - 1.8378770664093453;
        CHECK(in.log_likelihood() == doctest::Approx(expected).epsilon(1e-5));
      }
  }

  TEST_CASE("ensemble: an update that would leave what numbers hold is refused") {
    const Ensemble<Vector<1>> before{{Vector<1>(1e308), Vector<1>(1e308 - 1e293), Vector<1>(1e308 + 1e293)}};
    auto belief = before;
    const cairn::LinearSensor<1, 1> weak{Matrix<1>(1e-293), Matrix<1>(1.0)};
    cairn::Random random(1);
    const auto in = EnsembleKalman{}.update(belief, weak, Vector<1>(4e15), random);
    CHECK(in.status == Status::not_finite);
    for (std::size_t i = 0; i < 3; ++i) CHECK(belief.members[i] == before.members[i]);
  }

  TEST_CASE("resample_by_kld: refuses what it cannot draw from") {
    cairn::Random random(1);
    const auto bin = [](const Vector<1>& x) { return x(0); };
    cairn::Particles<Vector<1>> none;
    CHECK(cairn::resample_by_kld(none, {}, bin, random) == Status::depleted);
    cairn::Particles<Vector<1>> weightless{{Vector<1>(0.0)}, {-INFINITY}};
    CHECK(cairn::resample_by_kld(weightless, {}, bin, random) == Status::depleted);
    auto one = cairn::Particles<Vector<1>>::equal({Vector<1>(0.0)});
    CHECK(cairn::resample_by_kld(one, {.epsilon = 0.0}, bin, random) == Status::bad_option);
    CHECK(cairn::resample_by_kld(one, {.z = std::nan("")}, bin, random) == Status::bad_option);
    CHECK(cairn::resample_by_kld(one, {.least = 5, .most = 4}, bin, random) == Status::bad_option);
    CHECK(cairn::resample_by_kld(one, {.least = 0}, bin, random) ==
          Status::bad_option);  // none would be left
    CHECK(one.size() == 1);
  }
}

}  // namespace
}  // namespace ensemble_test
