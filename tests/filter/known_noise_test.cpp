// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/models/linear.hpp>

#include "support/random.hpp"

namespace known_noise_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;

/// Q is looked at anew wherever one of its numbers is another than in the step before.
template <int N, class S>
void look_at_every_number(cairn::Random& random) {
  CAPTURE(N);
  Matrix<N, N, S> g;
  for (int j = 0; j < N; ++j)
    for (int i = 0; i < N; ++i) g(i, j) = static_cast<S>(random.uniform(-1, 1));
  const Matrix<N, N, S> good = g * g.transpose() + Matrix<N, N, S>::Identity();
  const auto predicted = [](const Matrix<N, N, S>& q) {
    Gaussian<Vector<N, S>> belief{Vector<N, S>::Zero(), S(100) * Matrix<N, N, S>::Identity()};
    const cairn::LinearModel<N, S> still{Matrix<N, N, S>::Identity(), q};
    const Status status = cairn::Kalman{}.predict(belief, still, 1);
    const bool moved = belief.covariance(0, 0) != S(100);
    CHECK(moved == (status == Status::accepted));
    return status;
  };
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j) {
      CAPTURE(i);
      CAPTURE(j);
      Matrix<N, N, S> bad = good;
      if (i == j)
        bad(i, i) = -bad(i, i);
      else
        bad(i, j) = bad(j, i) = S(2) * std::sqrt(good(i, i) * good(j, j));
      REQUIRE(predicted(good) == Status::accepted);
      REQUIRE(predicted(good) == Status::accepted);
      CHECK(predicted(bad) == Status::not_positive_definite);
      CHECK(predicted(bad) == Status::not_positive_definite);
      bad(i, j) = bad(j, i) = std::numeric_limits<S>::quiet_NaN();
      CHECK(predicted(bad) == Status::not_finite);
      CHECK(predicted(bad) == Status::not_finite);
    }
  CHECK(predicted(good) == Status::accepted);
}

TEST_SUITE("filter") {
  TEST_CASE("predict: a noise is known again by all of its numbers, and never one that was refused") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    look_at_every_number<1, double>(random);
    look_at_every_number<2, double>(random);
    look_at_every_number<3, double>(random);
    look_at_every_number<5, double>(random);
    look_at_every_number<9, double>(random);
    look_at_every_number<3, float>(random);
    look_at_every_number<5, float>(random);
  }
}

}  // namespace
}  // namespace known_noise_test
