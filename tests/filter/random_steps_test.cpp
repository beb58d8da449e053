// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Random problems of 1 to 15 states with conditioning to 1e12: every step ends in a covariance or in a
// status. CAIRN_LONG=1 takes a million steps; without it a share.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/models/linear.hpp>

#include "support/random.hpp"

namespace random_steps_test {
namespace {

constexpr int d = cairn::dynamic;
using cairn::Form;
using cairn::Gaussian;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;

Matrix<d> random_matrix(cairn::Random& random, int rows, int columns) {
  Matrix<d> a(rows, columns);
  for (int j = 0; j < columns; ++j)
    for (int i = 0; i < rows; ++i) a(i, j) = random.normal();
  return a;
}

// Standard deviations between 1e-6 and 1, correlated; in one of eight of lower rank.
Matrix<d> random_covariance(cairn::Random& random, int n) {
  const int rank =
      random.below(8) == 0 ? 1 + static_cast<int>(random.below(static_cast<std::uint64_t>(n))) : n;
  Matrix<d> root = random_matrix(random, n, rank);
  for (int i = 0; i < n; ++i) root.row(i) *= std::pow(10.0, random.uniform(-6.0, 0.0));
  const Matrix<d> p = root * root.transpose();
  return cairn::symmetrised(p);
}

// e^T P e for random directions, relative to the diagonal: what a covariance has and rounding may not take.
bool is_covariance(cairn::Random& random, const Matrix<d>& p, double slack) {
  if (!p.allFinite() || p != p.transpose() || p.diagonal().minCoeff() < 0.0) return false;
  const Vector<d> sigma = p.diagonal().cwiseSqrt();
  for (int k = 0; k < 3; ++k) {
    Vector<d> e = random_matrix(random, static_cast<int>(p.rows()), 1);
    for (int i = 0; i < e.size(); ++i) e(i) = sigma(i) > 0.0 ? e(i) / sigma(i) : 0.0;
    if (e.dot(p * e) < -slack * static_cast<double>(p.rows())) return false;
  }
  return cairn::detail::is_valid_covariance<d, double>(p) || slack > 0.0;
}

struct Tally {
  int steps = 0, accepted = 0, unsound = 0, touched = 0;
};

template <class Filter, class Belief>
void run(cairn::Random& random, const Filter& filter, Belief belief, int n, Tally& tally) {
  const int m = 1 + static_cast<int>(random.below(static_cast<std::uint64_t>(std::min(n, 6))));
  const cairn::LinearModel<d> process{random_matrix(random, n, n) / std::sqrt(double(n)),
                                      random_covariance(random, n)};
  const cairn::LinearSensor<d, d> sensor{
      random_matrix(random, m, n),
      Matrix<d>(random_covariance(random, m) +
                std::pow(10.0, random.uniform(-14.0, 0.0)) * Matrix<d>::Identity(m, m))};
  for (int step = 0; step < 10; ++step, ++tally.steps) {
    const Belief before = belief;
    const bool updates = step % 2 == 1;
    const bool kept = updates ? filter.update(belief, sensor, random_matrix(random, m, 1)).accepted()
                              : filter.predict(belief, process, 1.0) == Status::accepted;
    const auto covariance = [](const Belief& b) -> Matrix<d> {
      if constexpr (requires { b.root; })
        return cairn::symmetrised(b.covariance());
      else
        return b.covariance;
    };
    const Matrix<d> p = covariance(belief);
    tally.accepted += kept ? 1 : 0;
    if (!belief.mean.allFinite() || !is_covariance(random, p, 1e-12)) ++tally.unsound;
    if (!kept && (belief.mean != before.mean || p != covariance(before))) ++tally.touched;
  }
}

TEST_SUITE("random steps") {
  TEST_CASE("filters: random steps of 1 to 15 states of any conditioning end sound or refused") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const int steps = std::getenv("CAIRN_LONG") != nullptr ? 1000000 : 30000;
    Tally plain, joseph, unscented, root;
    while (plain.steps + joseph.steps + unscented.steps + root.steps < steps) {
      const int n = 1 + static_cast<int>(random.below(15));
      Gaussian<Vector<d>> prior{random_matrix(random, n, 1), random_covariance(random, n)};
      run(random, cairn::Kalman{}, prior, n, plain);
      run(random, cairn::Kalman{.form = Form::joseph}, prior, n, joseph);
      run(random, cairn::Unscented{}, prior, n, unscented);
      run(random, cairn::SquareRoot{}, cairn::SquareRootGaussian<Vector<d>>::from(prior), n, root);
    }
    const auto check = [](const std::string& name, const Tally& tally) {
      CAPTURE(name);
      MESSAGE(name, ": ", tally.accepted, " of ", tally.steps, " accepted");
      CHECK(tally.unsound == 0);
      CHECK(tally.touched == 0);
      CHECK(tally.accepted > tally.steps / 2);
    };
    check("standard", plain);
    check("joseph", joseph);
    check("unscented", unscented);
    check("square root", root);
  }
}

}  // namespace
}  // namespace random_steps_test
