// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/kalman.hpp>

#include "support/random.hpp"

namespace kalman_test {
namespace {

using cairn::Gaussian;
using cairn::Identity;
using cairn::Kalman;
using cairn::Matrix;
using cairn::NoControl;
using cairn::Status;
using cairn::Vector;

// A landmark that is seen directly: F = H = I.
struct Sighting {
  using State = Vector<3>;
  using Measurement = Vector<3>;
  static constexpr bool linear = true;
  Matrix<3> covariance;
  [[nodiscard]] Measurement predict(const State& x) const { return x; }
  [[nodiscard]] Identity<3> jacobian(const State&) const { return {}; }
  [[nodiscard]] const Matrix<3>& noise(const State&) const { return covariance; }
};

TEST_SUITE("kalman") {
  TEST_CASE("kalman: two sightings of a landmark are their information-weighted mean") {
    Matrix<3> p;
    p << 4, 1, 0, 1, 3, 0.5, 0, 0.5, 2;
    Matrix<3> r;
    r << 1, 0.2, 0, 0.2, 2, 0, 0, 0, 5;
    Gaussian<Vector<3>> belief{Vector<3>(1, 2, 3), p};
    const Vector<3> z(2, 0, 4);
    const auto innovation = Kalman{}.update(belief, Sighting{r}, z);
    REQUIRE(innovation.accepted());
    const Matrix<3> information = Eigen::LLT<Matrix<3>>(p).solve(Matrix<3>::Identity()) +
                                  Eigen::LLT<Matrix<3>>(r).solve(Matrix<3>::Identity());
    const Matrix<3> expected = Eigen::LLT<Matrix<3>>(information).solve(Matrix<3>::Identity());
    CHECK((belief.covariance - expected).norm() < 1e-14);
    const Vector<3> mean =
        expected * (Eigen::LLT<Matrix<3>>(p).solve(Vector<3>(1, 2, 3)) + Eigen::LLT<Matrix<3>>(r).solve(z));
    CHECK((belief.mean - mean).norm() < 1e-14);
    CHECK((innovation.covariance - (p + r)).norm() == 0.0);
    const Vector<3> d = z - Vector<3>(1, 2, 3);
    CHECK(innovation.nis == doctest::Approx(d.dot(Eigen::LLT<Matrix<3>>(p + r).solve(d))).epsilon(1e-14));
    const Matrix<3> s = p + r;
    const double determinant = s(0, 0) * (s(1, 1) * s(2, 2) - s(1, 2) * s(2, 1)) -
                               s(0, 1) * (s(1, 0) * s(2, 2) - s(1, 2) * s(2, 0)) +
                               s(0, 2) * (s(1, 0) * s(2, 1) - s(1, 1) * s(2, 0));
    CHECK(innovation.log_likelihood() ==
          doctest::Approx(-0.5 * (innovation.nis + std::log(determinant) + 3 * std::log(2 * M_PI))));
  }
}

}  // namespace
}  // namespace kalman_test
