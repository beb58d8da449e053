// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <stdexcept>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/robust.hpp>
#include <cairn/models/linear.hpp>

#include "filter/linear_problems.hpp"
#include "support/elimination.hpp"
#include "support/random.hpp"

namespace robust_test {
namespace {

using cairn::Gaussian;
using cairn::Huber;
using cairn::Kalman;
using cairn::Matrix;
using cairn::Status;
using cairn::StudentT;
using cairn::Vector;
using cairn_test::LinearProblem;

// The x that minimises cost() between low and high by ternary search.
template <class Cost>
double lowest(const Cost& cost, double low, double high) {
  for (int step = 0; step < 200; ++step) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (cost(a) < cost(b) ? high : low) = cost(a) < cost(b) ? b : a;
  }
  return 0.5 * (low + high);
}

const cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(0.25)};
const Gaussian<Vector<1>> prior{Vector<1>(1.0), Matrix<1>(0.5)};

TEST_SUITE("robust") {
  TEST_CASE("huber: ends at the maximum of the posterior, and an outlier pulls by a bounded step") {
    const Huber<Kalman> filter{.threshold = 1.5};
    for (const double z : {1.2, 2.0, 4.0, -30.0, 1e6}) {
      CAPTURE(z);
      auto belief = prior;
      REQUIRE(filter.update(belief, sensor, Vector<1>(z)).accepted());
      const auto cost = [&](double x) {
        const double t = std::abs(z - x) / 0.5;
        const double loss = t < 1.5 ? 0.5 * t * t : 1.5 * t - 0.5 * 1.5 * 1.5;
        return 0.5 * (x - 1.0) * (x - 1.0) / 0.5 + loss;
      };
      if (std::abs(z) < 100) CHECK(std::abs(belief.mean(0) - lowest(cost, -5.0, 5.0)) < 1e-7);
      if (std::abs(z) > 20)  // P threshold / sigma, by the zero of the cost's slope
        CHECK(std::abs(std::abs(belief.mean(0) - 1.0) - 0.5 * 1.5 / 0.5) < 1e-6);
    }
    // good data: the plain filter
    auto soft = prior, plain = prior;
    REQUIRE(filter.update(soft, sensor, Vector<1>(1.1)).accepted());
    REQUIRE(Kalman{}.update(plain, sensor, Vector<1>(1.1)).accepted());
    CHECK(std::abs(soft.mean(0) - plain.mean(0)) < 1e-15);
    CHECK(std::abs(soft.covariance(0) - plain.covariance(0)) < 1e-15);
  }

  TEST_CASE("student: ends at a maximum of the posterior, and lets go of what is impossible") {
    const StudentT<Kalman> filter{.degrees = 3.0};
    for (const double z : {1.2, 2.0, 3.0, -200.0, 1e6}) {
      CAPTURE(z);
      auto belief = prior;
      REQUIRE(filter.update(belief, sensor, Vector<1>(z)).accepted());
      const auto cost = [&](double x) {
        const double t = (z - x) / 0.5;
        return 0.5 * (x - 1.0) * (x - 1.0) / 0.5 + 2.0 * std::log(1.0 + t * t / 3.0);
      };
      const double x = belief.mean(0);
      CHECK(cost(x + 1e-3) > cost(x));
      CHECK(cost(x - 1e-3) > cost(x));
      if (std::abs(z) > 100) {
        CHECK(std::abs(x - 1.0) < 0.05);
        CHECK(belief.covariance(0) == doctest::Approx(0.5).epsilon(1e-2));
      }
    }
  }

  TEST_CASE("student: of two numbers at once it ends where their posterior is level") {
    const cairn::LinearSensor<2, 1> both{Matrix<2, 1>(1.0, 0.5), Vector<2>(0.25, 1.0).asDiagonal()};
    const StudentT<Kalman> filter{.degrees = 3.0};
    for (const double z : {1.2, 2.5, -1.5}) {
      CAPTURE(z);
      auto belief = prior;
      REQUIRE(filter.update(belief, both, Vector<2>(z, 0.3)).accepted());
      // Student's density of m numbers goes with the power -(degrees + m) / 2.
      const auto cost = [&](double x) {
        const double squared = (z - x) * (z - x) / 0.25 + (0.3 - 0.5 * x) * (0.3 - 0.5 * x);
        return 0.5 * (x - 1.0) * (x - 1.0) / 0.5 + 2.5 * std::log(1.0 + squared / 3.0);
      };
      const double x = belief.mean(0), h = 1e-4;
      CHECK(std::abs(cost(x + h) - cost(x - h)) / (2 * h) < 1e-6);
      CHECK(cost(x + 0.01) > cost(x));
      CHECK(cost(x - 0.01) > cost(x));
    }
  }

  TEST_CASE("adapted_noise: the old noise and what was seen, in their shares") {
    const cairn::LinearSensor<1, 2> slope{Matrix<1, 2>(2.0, -1.0), Matrix<1>(1.0)};
    Matrix<2> p;
    p << 0.5, 0.1, 0.1, 0.3;
    const Gaussian<Vector<2>> belief{Vector<2>(1.0, 3.0), p};
    // z is 4 from h(x) = -1, and H P H^T = 4 * 0.5 - 4 * 0.1 + 0.3.
    const auto r = cairn::adapted_noise(Matrix<1>(1.5), belief, slope, Vector<1>(3.0), 0.25);
    CHECK(r(0, 0) == doctest::Approx(0.75 * 1.5 + 0.25 * (16 + 1.9)).epsilon(1e-14));
  }

  // A tenth of the errors ten times as large: the robust filters lose little, the plain one much.
  TEST_CASE("huber and student: track through outliers better than the plain filter") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::LinearModel<1> process{Matrix<1>(1.0), Matrix<1>(0.01)};
    Gaussian<Vector<1>> plain = prior, huber = prior, student = prior;
    double x = 1.0, by_plain = 0, by_huber = 0, by_student = 0;
    const auto step = [&](const auto& filter, Gaussian<Vector<1>>& belief, const Vector<1>& z, double& sum) {
      REQUIRE(Kalman{}.predict(belief, process, 1.0) == Status::accepted);
      REQUIRE(filter.update(belief, sensor, z).accepted());
      sum += (belief.mean(0) - x) * (belief.mean(0) - x);
    };
    for (int k = 0; k < 3000; ++k) {
      x += random.normal(0.0, 0.1);
      const double sigma = random.uniform() < 0.1 ? 5.0 : 0.5;
      const Vector<1> z(x + random.normal(0.0, sigma));
      step(Kalman{}, plain, z, by_plain);
      step(Huber<Kalman>{}, huber, z, by_huber);
      step(StudentT<Kalman>{}, student, z, by_student);
    }
    CHECK(by_huber < 0.6 * by_plain);
    CHECK(by_student < 0.6 * by_plain);
  }

  TEST_CASE("innovated_noise: learns a correlated R from the innovations alone") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto p = LinearProblem<2, 2>::lasting(random);
    const Matrix<2> truth = (Matrix<2>() << 1.0, 0.4, 0.4, 0.5).finished();
    const Matrix<2> root = cairn_test::lower_root(truth);
    auto learner = p.sensor;
    learner.covariance = 9.0 * Matrix<2>::Identity();
    auto belief = p.prior;
    Vector<2> x = cairn::sample(p.prior, random);
    Matrix<2> mean = Matrix<2>::Zero();
    constexpr int count = 40000;
    for (int step = 0; step < count; ++step) {
      x = cairn::sample(Gaussian<Vector<2>>{p.process.propagate(x, {}, 1.0), p.process.covariance}, random);
      const Vector<2> z = p.sensor.predict(x) + root * cairn_test::random_matrix<2, 1>(random);
      REQUIRE(Kalman{}.predict(belief, p.process, 1.0) == Status::accepted);
      const auto innovation = Kalman{}.update(belief, learner, z);
      REQUIRE(innovation.accepted());
      learner.covariance = cairn::innovated_noise(learner.covariance, innovation, 0.003);
      if (step >= count / 2) mean += learner.covariance / (count / 2);
    }
    CHECK((mean - truth).norm() < 0.15 * truth.norm());
    // a step that would take too much is shortened
    cairn::Innovation<2> wild;
    wild.covariance = 100.0 * Matrix<2>::Identity();
    const Matrix<2> kept = cairn::innovated_noise<2, double>(truth, wild, 0.5);
    CHECK(cairn::detail::is_valid_covariance<2, double>(Matrix<2>(kept - 0.4999 * truth)));
    wild.residual(0) = std::nan("");
    CHECK(cairn::innovated_noise<2, double>(truth, wild, 0.5) == truth);
  }

  TEST_CASE("robust, huber and student: what a sensor throws comes through and leaves the belief") {
    struct Failing : cairn::LinearSensor<1, 1> {
      int* left;  // calls before it fails
      void tick() const {
        if ((*left)-- == 0) throw std::runtime_error("no more");
      }
      [[nodiscard]] Vector<1> predict(const Vector<1>& x) const {
        tick();
        return cairn::LinearSensor<1, 1>::predict(x);
      }
      [[nodiscard]] Matrix<1> noise(const Vector<1>& x) const {
        tick();
        return cairn::LinearSensor<1, 1>::noise(x);
      }
    };
    const auto try_all = [](const auto& filter) {
      for (int calls = 0;; ++calls) {
        int left = calls;
        auto belief = prior;
        try {
          const auto in = filter.update(belief, Failing{sensor, &left}, Vector<1>(30));
          REQUIRE(in.accepted());
          CHECK(belief.mean(0) != prior.mean(0));
          return calls;
        } catch (const std::runtime_error&) {
          REQUIRE(belief.mean == prior.mean);
          REQUIRE(belief.covariance == prior.covariance);
        }
      }
    };
    CHECK(try_all(cairn::Robust<Kalman>{}) > 4);
    CHECK(try_all(Huber<Kalman>{}) > 4);
    CHECK(try_all(StudentT<Kalman>{}) > 4);
  }

  TEST_CASE("huber and student: refuse bad options and numbers and keep the belief") {
    auto belief = prior;
    const Vector<1> nan(std::nan(""));
    CHECK(Huber<Kalman>{.threshold = 0}.update(belief, sensor, Vector<1>(1)).status == Status::bad_option);
    CHECK(StudentT<Kalman>{.degrees = -1}.update(belief, sensor, Vector<1>(1)).status == Status::bad_option);
    CHECK(Huber<Kalman>{}.update(belief, sensor, nan).status == Status::not_finite);
    CHECK(StudentT<Kalman>{}.update(belief, sensor, nan).status == Status::not_finite);
    CHECK(Huber<Kalman>{.filter = {.gate = 1e-3}}.update(belief, sensor, Vector<1>(9)).status ==
          Status::gated);
    CHECK(belief.mean == prior.mean);
    CHECK(belief.covariance == prior.covariance);
  }
}

}  // namespace
}  // namespace robust_test
