// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Reference numbers of the Nile were computed with R KFAS 1.6.0.
#include <cmath>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/filter/steady_state.hpp>
#include <cairn/models/linear.hpp>

#include "filter/linear_problems.hpp"
#include "filter/nile.hpp"
#include "support/elimination.hpp"
#include "support/random.hpp"

namespace smoother_test {
namespace {

using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::Recorder;
using cairn::Status;
using cairn::Vector;
using cairn_test::nile;

const cairn::LinearModel<1> level{Matrix<1>(1.0), Matrix<1>(1469.1)};
const cairn::LinearSensor<1, 1> flow{Matrix<1>(1.0), Matrix<1>(15099.0)};

// Filters the flows, year k only where seen(k); returns the recorder and sums the log-likelihood.
template <class Seen>
Recorder<Kalman, Vector<1>> filter_nile(const Gaussian<Vector<1>>& prior, double& likelihood,
                                        const Seen& seen) {
  Recorder<Kalman, Vector<1>> recorder(Kalman{}, prior);
  likelihood = 0.0;
  for (std::size_t k = 0; k < nile.size(); ++k) {
    if (seen(k)) {
      const auto innovation = recorder.update(flow, Vector<1>(nile[k]));
      REQUIRE(innovation.accepted());
      likelihood += innovation.log_likelihood();
    }
    REQUIRE(recorder.predict(level, 1.0) == Status::accepted);
  }
  return recorder;
}

// Whether the compiler may round a product and a sum once: last digits differ then.
#if defined(__FMA__) || defined(__aarch64__)
constexpr bool fused_products = true;
#else
constexpr bool fused_products = false;
#endif

// Relative agreement to about 12 digits.
void check_digits(double value, double expected, double tolerance = 1e-12) {
  CAPTURE(expected);
  CHECK(std::abs(value - expected) <= tolerance * std::abs(expected));
}

TEST_SUITE("smoother") {
  TEST_CASE("kalman: the Nile with a vague prior gives the log-likelihood and predictions of KFAS") {
    double likelihood = 0.0;
    const auto recorder =
        filter_nile({Vector<1>(0.0), Matrix<1>(1e7)}, likelihood, [](std::size_t) { return true; });
    check_digits(likelihood, -641.585578459415);
    const double means[] = {1118.31146152424, 1140.10843916351, 1072.31601848875};
    const double variances[] = {16545.3363906742, 9363.65753088294, 7248.5973780062};
    for (std::size_t k = 0; k < 3; ++k) {
      check_digits(recorder.steps()[k].predicted.mean(0), means[k]);
      check_digits(recorder.steps()[k].predicted.covariance(0), variances[k]);
    }
  }

  // An exactly diffuse start is the belief after the first flow: N(1120, 15099).
  TEST_CASE("smoother: the Nile from a diffuse start gives the smoothed levels of KFAS") {
    double likelihood = 0.0;
    const auto recorder = filter_nile({Vector<1>(nile[0]), Matrix<1>(15099.0)}, likelihood,
                                      [](std::size_t k) { return k != 0; });
    // the first flow, which fixes the diffuse level, contributes nothing to the diffuse likelihood
    check_digits(likelihood, -632.545625115673);
    check_digits(recorder.belief().mean(0), 798.370292608364);
    check_digits(recorder.belief().covariance(0), 5501.25794180848);
    const auto path = recorder.smoothed();
    const double levels[] = {1111.6683191268, 1110.85766462181, 1105.26556731239, 1113.51560159702,
                             1112.37791287392};
    for (std::size_t k = 0; k < 5; ++k) check_digits(path[k].mean(0), levels[k]);
    check_digits(path[49].mean(0), 834.763259103751);
    check_digits(path[49].covariance(0), 2326.75686981419);
    check_digits(path[99].mean(0), 798.370292608364);
    check_digits(path[0].covariance(0), 4032.15794180848);
    check_digits(path[99].covariance(0), 4032.15794180848);
  }

  TEST_CASE("smoother: the Nile with two gaps of twenty years") {
    double likelihood = 0.0;
    const auto seen = [](std::size_t k) { return k != 0 && !(k >= 20 && k < 40) && !(k >= 60 && k < 80); };
    const auto recorder = filter_nile({Vector<1>(nile[0]), Matrix<1>(15099.0)}, likelihood, seen);
    check_digits(likelihood, -380.587062775303);
    check_digits(recorder.steps()[19].predicted.mean(0), 1026.14155507098);
    check_digits(recorder.steps()[19].predicted.covariance(0), 5501.29616010727);
    check_digits(recorder.steps()[39].predicted.covariance(0), 34883.2961601073);
    const auto path = recorder.smoothed();
    check_digits(path[29].mean(0), 903.421102958105);
    check_digits(path[29].covariance(0), 9715.0059024614);
    check_digits(path[69].mean(0), 837.177323709788);
    check_digits(path[69].covariance(0), 9715.00554901136);
  }

  // The smoother's mean maximises the joint density of all states: one least-squares problem.
  TEST_CASE("smoother: equals batch least squares, and a fixed lag as long as the record") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn_test::LinearProblem<2, 1> p(random);
    constexpr int steps = 6;
    constexpr int size = 2 * (steps + 1);
    Matrix<cairn::dynamic> information = Matrix<cairn::dynamic>::Zero(size, size);
    Vector<cairn::dynamic> vector = Vector<cairn::dynamic>::Zero(size);
    const Matrix<2> inverse_q = cairn_test::inverse_of(p.process.covariance);
    const Matrix<2> inverse_p = cairn_test::inverse_of(p.prior.covariance);
    information.topLeftCorner<2, 2>() += inverse_p;
    vector.head<2>() += inverse_p * p.prior.mean;
    Recorder<Kalman, Vector<2>> recorder(Kalman{}, p.prior);
    Recorder<cairn::Unscented, Vector<2>> unscented(cairn::Unscented{}, p.prior);
    for (int k = 1; k <= steps; ++k) {
      const Vector<1> z(random.normal());
      REQUIRE(recorder.predict(p.process, 1.0) == Status::accepted);
      REQUIRE(recorder.update(p.sensor, z).accepted());
      REQUIRE(unscented.predict(p.process, 1.0) == Status::accepted);
      REQUIRE(unscented.update(p.sensor, z).accepted());
      Matrix<2, 4> link;
      link << -p.process.transition, Matrix<2>::Identity();
      information.block<4, 4>(2 * k - 2, 2 * k - 2) += link.transpose() * inverse_q * link;
      const double weight = 1.0 / p.sensor.covariance(0);
      information.block<2, 2>(2 * k, 2 * k) += weight * p.sensor.design.transpose() * p.sensor.design;
      vector.segment<2>(2 * k) += weight * z(0) * p.sensor.design.transpose();
    }
    const Vector<cairn::dynamic> batch = cairn_test::solved(information, vector);
    const Matrix<cairn::dynamic> covariance = cairn_test::inverse_of(information);
    const auto path = recorder.smoothed();
    const auto unscented_path = unscented.smoothed();
    for (int k = 0; k <= steps; ++k) {
      const auto i = static_cast<std::size_t>(k);
      CHECK((path[i].mean - batch.segment<2>(2 * k)).norm() < 1e-12);
      CHECK((path[i].covariance - covariance.block<2, 2>(2 * k, 2 * k)).norm() < 1e-12);
      CHECK((unscented_path[i].mean - path[i].mean).norm() < 1e-12);
      CHECK((unscented_path[i].covariance - path[i].covariance).norm() < 1e-12);
    }
    CHECK((recorder.lagged(steps)->mean - path[0].mean).norm() == 0.0);
    CHECK_FALSE(recorder.lagged(steps + 1).has_value());
    recorder.keep_last(2);
    CHECK((recorder.lagged(2)->mean - path[steps - 2].mean).norm() == 0.0);
  }

  // What was never seen is not better known afterwards, however the motion mixes large with small numbers.
  TEST_CASE("smoother: a record without sightings is smoothed to what was predicted, scales 1e-6 to 1e6") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto covariance = [&](int rank) {
      Matrix<3> root = Matrix<3>::Zero();
      for (int i = 0; i < 3; ++i) {
        const double sigma = std::pow(10.0, 12.0 * random.uniform() - 6.0);
        for (int j = 0; j < rank; ++j) root(i, j) = sigma * random.normal();
      }
      return cairn::symmetrised(Matrix<3>(root * root.transpose()));
    };
    constexpr int records = 500;
    int off = 0;
    for (int record = 0; record < records; ++record) {
      std::vector<Matrix<3>> known{covariance(record % 4 == 0 ? 2 : 3)};
      Recorder<Kalman, Vector<3>> recorder(Kalman{}, {Vector<3>::Zero(), known[0]});
      for (int k = 0; k < 4; ++k) {
        cairn::LinearModel<3> process{Matrix<3>::Zero(), covariance((record + k) % 4)};
        for (int i = 0; i < 9; ++i) process.transition(i) = random.normal();
        REQUIRE(recorder.predict(process, 1.0) == Status::accepted);
        known.push_back(recorder.belief().covariance);
      }
      const auto path = recorder.smoothed();
      bool wrong = false;
      for (std::size_t k = 0; k < known.size(); ++k)
        for (int i = 0; i < 3; ++i)
          wrong = wrong || std::abs(path[k].covariance(i, i) - known[k](i, i)) > 1e-3 * known[k](i, i);
      off += wrong ? 1 : 0;
    }
    CHECK(off <= 20);  // 6 usually, where directions have just so many digits that they count; 50 if all did
  }

  TEST_CASE(
      "smoother: a prediction that rounding has left no covariance is made one, and bad priors refused") {
    int mended = 0;
    for (int k = 1; k < 20; ++k) {
      const double small = 1e-7 * k;
      const cairn::LinearModel<2> process{Matrix<2>{{1, small - 1}, {0.7, 0.1}}, Matrix<2>::Zero()};
      const Gaussian<Vector<2>> prior{Vector<2>::Zero(), Matrix<2>::Ones()};
      Gaussian<Vector<2>> plain = prior;
      REQUIRE(Kalman{}.predict(plain, process, 1.0) == Status::accepted);
      Recorder<Kalman, Vector<2>> recorder(Kalman{}, prior);
      REQUIRE(recorder.predict(process, 1.0) == Status::accepted);
      if (plain.covariance.determinant() < -1e-12 * plain.covariance.diagonal().prod()) ++mended;
      CHECK(recorder.belief().covariance(0, 0) == doctest::Approx(small * small).epsilon(0.02).scale(0));
      const auto path = recorder.smoothed();
      CHECK((path[0].covariance - Matrix<2>::Ones()).norm() < 1e-6);
    }
    if (!fused_products) CHECK(mended > 3);  // fused ones are exact here: nothing to mend

    Matrix<2> indefinite{{1, 2}, {2, 1}};
    Recorder<Kalman, Vector<2>> recorder(Kalman{}, {Vector<2>::Ones(), indefinite});
    const cairn::LinearModel<2> waiting{Matrix<2>::Identity(), 9 * Matrix<2>::Identity()};
    CHECK(recorder.predict(waiting, 1.0) == Status::not_positive_definite);
    CHECK(recorder.belief().covariance == indefinite);
    CHECK(recorder.steps().empty());
  }
}

TEST_SUITE("steady_state") {
  TEST_CASE("steady_state: the gain of MATLAB's Kalman Filter Design example") {
    Matrix<3> a;
    a << 1.1269, -0.4940, 0.1129, 1, 0, 0, 0, 1, 0;
    const Vector<3> b(-0.3832, 0.5919, 0.5191);
    const Matrix<1, 3> c(1, 0, 0);
    const auto s = cairn::steady_state<3, 1, double>(a, c, 2.3 * b * b.transpose(), Matrix<1>(1.0));
    REQUIRE(s.accepted());
    CHECK((s.gain - Vector<3>(0.534537544168, 0.010133193285, -0.477567888178)).norm() < 1e-11);
    const Vector<3> updated = s.updated.diagonal();
    CHECK((updated - Vector<3>(0.534537544168, 1.340111845904, 1.469892758493)).norm() < 1e-11);
    const auto old = cairn::steady_state<3, 1, double>(a, c, b * b.transpose(), Matrix<1>(1.0));
    CHECK((old.gain - Vector<3>(0.379797333231, 0.081731727044, -0.257039616493)).norm() < 1e-11);
  }

  TEST_CASE("steady_state: closed forms of the random walk and of the alpha-beta filter") {
    const Matrix<1> one(1.0);
    const auto golden = cairn::steady_state<1, 1, double>(one, one, one, one);
    CHECK(std::abs(golden.gain(0) - (std::sqrt(5.0) - 1) / 2) < 1e-15);
    // Kalata: T = 1, sigma_w = 0.5 (acceleration), sigma_v = 2
    Matrix<2> f;
    f << 1, 1, 0, 1;
    const Vector<2> g(0.5, 1.0);
    const auto tracker =
        cairn::steady_state<2, 1, double>(f, Matrix<1, 2>(1, 0), 0.25 * g * g.transpose(), Matrix<1>(4.0));
    CHECK((tracker.gain - Vector<2>(0.505137226493, 0.175866208648)).norm() < 1e-11);
  }

  // What the equation says above P is 1e-15 of it here, while P is 4 % wrong. Doubling with 128-bit numbers.
  TEST_CASE("steady_state: two states that forget in 1e8 steps and are seen as a sum") {
    const double entries[][3] = {{4283620.58584, -4283619.13706, 4283619.88392},
                                 {8312233.93351, 8312232.97984, 8312233.01700}};
    for (const int k : {0, 1}) {
      CAPTURE(k);
      Matrix<2> q;
      q << 1, 0.3, 0.3, 0.5;
      const auto s = cairn::steady_state<2, 1, double>(Vector<2>(1 - 1e-8, 1 - 3e-8).asDiagonal(),
                                                       Matrix<1, 2>(1, k == 0 ? 1 : -1), q, Matrix<1>(0.1));
      REQUIRE(s.accepted());
      check_digits(s.predicted(0, 0), entries[k][0], 1e-6);
      check_digits(s.predicted(0, 1), entries[k][1], 1e-6);
      check_digits(s.predicted(1, 1), entries[k][2], 1e-6);
    }
  }

  TEST_CASE("steady_state: what rounding decides is refused, and nothing beside it") {
    const Matrix<3> f = Vector<3>(0.99994, 0.99944, 1 - 1.5e-8).asDiagonal();
    const Vector<3> g(3.634, 7.948, -11079.4);
    Matrix<2, 3> h = Matrix<2, 3>::Zero();
    h.col(0).setConstant(0.0746);
    Matrix<2> r;
    r << 1.4e-9, 0.8e-9, 0.8e-9, 0.6e-9;
    const auto settled = [&](double noise) {
      return cairn::steady_state<3, 2, double>(f, h, g * g.transpose(), Matrix<2>(noise * r));
    };
    // Exactly, in 113 bits, updated(2, 2) is 0.741008; of the doubles' P of 1.2e8 came 0.916.
    CHECK(settled(1).status == Status::not_converged);
    const auto noisy = settled(1e4);
    REQUIRE(noisy.accepted());
    check_digits(noisy.updated(0, 0), 0.000898385649113, fused_products ? 1e-8 : 1e-9);
    check_digits(noisy.updated(1, 1), 0.00429838795934, fused_products ? 1e-8 : 1e-9);
    check_digits(noisy.updated(2, 2), 9352.21211484, 1e-3);
  }

  TEST_CASE("steady_state: says so where there is none") {
    const Matrix<1> one(1.0);
    CHECK(cairn::steady_state<1, 1, double>(2 * one, 0 * one, one, one).status == Status::not_converged);
    CHECK(cairn::steady_state<1, 1, double>(one, one, one, -one).status == Status::not_positive_definite);
  }
}

}  // namespace
}  // namespace smoother_test
