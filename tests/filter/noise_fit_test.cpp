// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/noise_fit.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/models/linear.hpp>

#include "filter/linear_problems.hpp"
#include "filter/nile.hpp"
#include "support/random.hpp"
#ifdef EXAMPLES_HAVE_ZLIB
#include "support/data.hpp"
#include "support/mat_file.hpp"
#endif

namespace noise_fit_test {
namespace {

using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::NoControl;
using cairn::Status;
using cairn::Vector;
using Model1 = cairn::LinearModel<1>;
using Sensor1 = cairn::LinearSensor<1, 1>;

TEST_SUITE("noise_fit") {
  // Durbin and Koopman, "Time Series Analysis by State Space Methods", 2.10: 15099 and 1469.1; with more
  // digits 15098.53 and 1469.17 (KFAS), at the log-likelihood -632.545625 of the exactly diffuse start.
  TEST_CASE("fit_noise: the Nile's published maximum of the likelihood") {
    const Model1 level{Matrix<1>(1.0), Matrix<1>(5000.0)};
    const Sensor1 flow{Matrix<1>(1.0), Matrix<1>(5000.0)};
    cairn::NoiseRecord<Model1, Sensor1> record{
        {Vector<1>(0.0), Matrix<1>(1e12)}, Vector<1>(cairn_test::nile[0]), {}};
    for (std::size_t k = 1; k < cairn_test::nile.size(); ++k)
      record.steps.push_back({NoControl{}, 1.0, Vector<1>(cairn_test::nile[k])});
    const auto fit = cairn::fit_noise(record, level, flow, {.rounds = 3000, .tolerance = 1e-14});
    CHECK((fit.status == Status::accepted || fit.status == Status::not_converged));
    CHECK(fit.sensor(0) == doctest::Approx(15098.53).epsilon(1e-4));
    CHECK(fit.process(0) == doctest::Approx(1469.17).epsilon(1e-3));
    // the vague first year contributes -log(2 pi 1e12) / 2 and nothing else
    const double first = -0.5 * std::log(2 * M_PI * 1e12);
    CHECK(fit.log_likelihoods.back() - first == doctest::Approx(-632.545625).epsilon(1e-8));
    for (std::size_t k = 1; k < fit.log_likelihoods.size(); ++k)
      CHECK(fit.log_likelihoods[k] >= fit.log_likelihoods[k - 1] - 1e-9);
  }

  TEST_CASE("fit_noise: the likelihood never falls and ends at the noise that made the data") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto p = cairn_test::LinearProblem<2, 2>::lasting(random);
    cairn::NoiseRecord<cairn::LinearModel<2>, cairn::LinearSensor<2, 2>> record{p.prior, std::nullopt, {}};
    Vector<2> x = cairn::sample(p.prior, random);
    for (int k = 0; k < 2000; ++k) {
      x = cairn::sample(Gaussian<Vector<2>>{p.process.propagate(x, {}, 1.0), p.process.covariance}, random);
      const Gaussian<Vector<2>> seen{p.sensor.predict(x), p.sensor.covariance};
      record.steps.push_back({NoControl{}, 1.0, cairn::sample(seen, random)});
      if (k % 7 == 0) record.steps.back().z.reset();
    }
    auto sensor = p.sensor;
    sensor.covariance = Matrix<2>::Identity();
    const auto fit = cairn::fit_noise(record, p.process, sensor, {.rounds = 100, .process = false});
    REQUIRE_FALSE(fit.log_likelihoods.empty());
    for (std::size_t k = 1; k < fit.log_likelihoods.size(); ++k)
      CHECK(fit.log_likelihoods[k] >= fit.log_likelihoods[k - 1] - 1e-8);
    CHECK(fit.process == p.process.covariance);
    // the noise that made the data explains them no better than the one that was fitted to them
    const auto both = cairn::fit_noise(record, p.process, p.sensor, {.rounds = 60});
    CHECK(fit.log_likelihoods.back() > both.log_likelihoods.front() - 1.0);
    CHECK(fit.log_likelihoods.back() > fit.log_likelihoods.front());
    for (std::size_t k = 1; k < both.log_likelihoods.size(); ++k)
      CHECK(both.log_likelihoods[k] >= both.log_likelihoods[k - 1] - 1e-8);
  }

  TEST_CASE("fit_noise: says what it cannot use") {
    const Model1 level{Matrix<1>(1.0), Matrix<1>(1.0)};
    const Sensor1 flow{Matrix<1>(1.0), Matrix<1>(1.0)};
    cairn::NoiseRecord<Model1, Sensor1> record{{Vector<1>(0.0), Matrix<1>(1.0)}, std::nullopt, {}};
    CHECK(cairn::fit_noise(record, level, flow).status == Status::depleted);
    record.steps.push_back({NoControl{}, 1.0, std::nullopt});
    CHECK(cairn::fit_noise(record, level, flow).status == Status::depleted);
    record.steps.push_back({NoControl{}, 1.0, Vector<1>(std::nan(""))});
    CHECK(cairn::fit_noise(record, level, flow).status == Status::not_finite);
    record.steps.back() = {NoControl{}, -1.0, Vector<1>(1.0)};
    CHECK(cairn::fit_noise(record, level, flow).status == Status::bad_time_step);
    record.steps.back().dt = 1.0;
    CHECK(cairn::fit_noise(record, level, flow, {.rounds = -1}).status == Status::bad_option);
    CHECK(cairn::fit_noise(record, level, flow, {.tolerance = -1}).status == Status::bad_option);
    CHECK(cairn::fit_noise(record, level, flow, {.rounds = 0}).status == Status::not_converged);
    record.prior.covariance(0) = -0.5;  // the first prediction makes a covariance of it, smoothing cannot
    CHECK(cairn::fit_noise(record, level, flow, {.tolerance = 1e-3, .process = false}).status ==
          Status::not_positive_definite);
    // its belief would throw
    CHECK(cairn::fit_noise<cairn::SquareRoot>(record, level, flow).status == Status::not_positive_definite);
    record.prior.covariance(0) = std::nan("");
    CHECK(cairn::fit_noise(record, level, flow).status == Status::not_finite);
  }

#ifdef EXAMPLES_HAVE_ZLIB
  template <int R, int C>
  Matrix<R, C> matrix(const example::MatArray& a, std::size_t first = 0) {
    Matrix<R, C> m;
    for (int j = 0; j < C; ++j)
      for (int i = 0; i < R; ++i) m(i, j) = a.numbers.at(first + static_cast<std::size_t>(j * R + i));
    return m;
  }

  // P. Abbeel's robot (Berkeley CS 287, 2011) with the results of a MATLAB filter, smoother and EM.
  TEST_CASE("kalman, smoother and fit_noise: MATLAB's answers for Abbeel's robot") {
    const auto path = cairn_test::real_data("filter_reference/pykalman_robot/robot.mat");
    if (!path) return;
    const example::MatFile mat(*path);
    using Model = cairn::ControlledLinearModel<5, 5>;
    using Sensor = cairn::LinearSensor<2, 5>;
    Model process{matrix<5, 5>(mat["A"]), Matrix<5>::Identity(), matrix<5, 5>(mat["Q"])};
    Sensor sensor{matrix<2, 5>(mat["C"]), matrix<2, 2>(mat["R"]), matrix<2, 1>(mat["d"])};
    const Gaussian<Vector<5>> prior{matrix<5, 1>(mat["x0"]), matrix<5, 5>(mat["P_0"])};
    cairn::NoiseRecord<Model, Sensor> record{prior, std::nullopt, {}};
    cairn::Recorder<Kalman, Vector<5>> recorder(Kalman{}, prior);
    double worst = 0.0;
    for (std::size_t k = 0; k < 500; ++k) {
      const Vector<5> offset = matrix<5, 1>(mat["b"], 5 * k);
      const Vector<2> z = matrix<2, 1>(mat["y"], 2 * k);
      record.steps.push_back({offset, 1.0, z});
      REQUIRE(recorder.predict(process, 1.0, offset) == Status::accepted);
      REQUIRE(recorder.update(sensor, z).accepted());
      worst = std::max(worst, (recorder.belief().mean - matrix<5, 1>(mat["xfilt"], 5 * k + 5)).norm());
      worst =
          std::max(worst, (recorder.belief().covariance - matrix<5, 5>(mat["Vfilt"], 25 * k + 25)).norm());
    }
    const auto path_of_states = recorder.smoothed();
    for (std::size_t k = 0; k <= 500; ++k) {
      worst = std::max(worst, (path_of_states[k].mean - matrix<5, 1>(mat["xsmooth"], 5 * k)).norm());
      worst = std::max(worst, (path_of_states[k].covariance - matrix<5, 5>(mat["Vsmooth"], 25 * k)).norm());
    }
    CHECK(worst < 1e-7);
    process.covariance = 10.0 * Matrix<5>::Identity();
    sensor.covariance = 10.0 * Matrix<2>::Identity();
    const auto fit = cairn::fit_noise(record, process, sensor, {.rounds = 50, .tolerance = 0.0});
    REQUIRE(fit.log_likelihoods.size() == 51);
    for (std::size_t k = 0; k < 50; ++k) {
      CAPTURE(k);
      CHECK(std::abs(fit.log_likelihoods[k] - mat["ll"].numbers[k]) < 1e-7);
    }
    CHECK((fit.process - matrix<5, 5>(mat["Q"])).norm() < 1e-7);
    CHECK((fit.sensor - matrix<2, 2>(mat["R"])).norm() < 1e-7);
  }
#endif
}

}  // namespace
}  // namespace noise_fit_test
