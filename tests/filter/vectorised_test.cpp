// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/filter/vectorised.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/so2.hpp>

#include "filter/linear_problems.hpp"

namespace vectorised_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;

// N numbers, each driven by the sine of its neighbour; how many fit a register differs with N.
template <int N, class S = double>
struct Ring {
  using State = Vector<N, S>;
  using Control = cairn::NoControl;
  template <class T>
  [[nodiscard]] Vector<N, T> propagate(const Vector<N, T>& x, const Control&, double dt) const {
    using std::sin;
    Vector<N, T> next = x;
    for (int i = 0; i < N; ++i) next(i) += static_cast<S>(dt) * sin(x((i + 1) % N));
    return next;
  }
  [[nodiscard]] Matrix<N, N, S> noise(const State&, const Control&, double) const {
    return S(0.01) * Matrix<N, N, S>::Identity();
  }
};
// Range and bearing to the point (3, -2).
template <int N, class S = double>
struct RangeAndBearing {
  using State = Vector<N, S>;
  using Measurement = cairn::Product<Vector<1, S>, cairn::BasicSO2<S>>;
  template <class T>
  [[nodiscard]] cairn::Product<Vector<1, T>, cairn::BasicSO2<T>> predict(const Vector<N, T>& x) const {
    using std::atan2;
    using std::sqrt;
    const T dx = S(3) - x(0), dy = S(-2) - x(1);
    return cairn::Product(Vector<1, T>(sqrt(dx * dx + dy * dy)), cairn::BasicSO2<T>(T(atan2(dy, dx))));
  }
  [[nodiscard]] Matrix<2, 2, S> noise(const State&) const { return S(0.1) * Matrix<2, 2, S>::Identity(); }
};

template <int N, class S>
void compare(double alpha, double tolerance) {
  cairn::Random random(11);
  const cairn::Unscented filter{.points = {.alpha = alpha, .beta = 2.0, .kappa = 0.0}};
  const Matrix<N, N, S> prior = cairn_test::random_covariance<N, S>(random, 0.1);
  Gaussian<Vector<N, S>> one_by_one{cairn_test::random_matrix<N, 1, S>(random), prior};
  Gaussian<Vector<N, S>> together = one_by_one;
  for (int k = 0; k < 30; ++k) {
    REQUIRE(filter.predict(one_by_one, Ring<N, S>{}, 0.1) == Status::accepted);
    REQUIRE(filter.predict(together, cairn::vectorised(Ring<N, S>{}), 0.1) == Status::accepted);
    const auto error = cairn_test::random_matrix<2, 1, S>(random, 0.3);
    const auto z = cairn::retract(RangeAndBearing<N, S>{}.predict(one_by_one.mean), error);
    REQUIRE(filter.update(one_by_one, RangeAndBearing<N, S>{}, z).accepted());
    REQUIRE(filter.update(together, cairn::vectorised(RangeAndBearing<N, S>{}), z).accepted());
    REQUIRE(cairn_test::largest_difference(together.covariance, together.covariance.transpose()) == 0.0);
  }
  CHECK((one_by_one.mean - together.mean).norm() < tolerance);
  CHECK((one_by_one.covariance - together.covariance).norm() < tolerance);
}

TEST_SUITE("vectorised") {
  TEST_CASE("points side by side give what points one by one give") {
    compare<2, double>(1.0, 1e-12);
    compare<3, double>(1.0, 1e-12);
    compare<4, double>(0.5, 1e-12);  // exactly one register with AVX: the centre goes by itself
    compare<8, double>(0.5, 1e-12);  // and with AVX-512
    compare<9, double>(1.0, 1e-12);
    compare<5, float>(1.0, 1e-4);
  }
  TEST_CASE("a tiny alpha does not blow up the difference between two ways to compute a sine") {
    compare<5, double>(1e-3, 1e-8);
  }
  TEST_CASE("a refused step leaves the belief as it was") {
    Gaussian<Vector<5>> belief{Vector<5>::Ones(), Matrix<5>::Identity()};
    belief.mean(2) = std::nan("");
    const Gaussian<Vector<5>> before = belief;
    CHECK(cairn::Unscented{}.predict(belief, cairn::vectorised(Ring<5>{}), 0.1) == Status::not_finite);
    CHECK(belief.covariance == before.covariance);
    CHECK(belief.mean(0) == before.mean(0));
  }
}

}  // namespace
}  // namespace vectorised_test
