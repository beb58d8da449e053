// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/manifold/derivatives.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/manifold/so3.hpp>

#include "support/random.hpp"

namespace derivatives_test {
namespace {

using cairn::Matrix;
using cairn::Product;
using cairn::SE2;
using cairn::SE3;
using cairn::SO2;
using cairn::SO3;
using cairn::Vector;

template <class X>
cairn::Tangent<X> random_step(cairn::Random& random, double scale) {
  cairn::Tangent<X> d;
  for (int i = 0; i < d.size(); ++i) d(i) = random.uniform(-scale, scale);
  return d;
}

TEST_SUITE("derivatives") {
  TEST_CASE_TEMPLATE("manifold: retract and local undo each other", X, Vector<4>, SO2, SO3, SE2, SE3,
                     Product<SE2, Vector<2>>, Product<Vector<1>, SO2>,
                     Product<SO3, Product<SE3, Vector<1>>>) {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    X x = cairn::detail::origin<X>();
    for (int run = 0; run < 200; ++run) {
      const auto d = random_step<X>(random, run % 2 == 0 ? 1.5 : 1e-5);
      const X y = cairn::retract(x, d);
      CHECK((cairn::local(x, y) - d).norm() < 1e-13);
      CHECK(cairn::local(y, cairn::retract(x, cairn::local(x, y))).norm() < 1e-13);
      CHECK(cairn::local(x, cairn::retract(x, cairn::Tangent<X>(0.0 * d))).norm() < 1e-13);
      x = y;
      if constexpr (std::is_same_v<X, Vector<4>>) x *= 0.5;
    }
  }

  TEST_CASE("SO2: wraps at half a turn and keeps small angles exact") {
    CHECK(cairn::wrapped(3.0) == 3.0);
    CHECK(cairn::wrapped(-M_PI - 0.1) == doctest::Approx(M_PI - 0.1));
    CHECK(std::abs(cairn::wrapped(1e4 * M_PI + 0.25) - 0.25) < 1e-11);
    for (const double far : {-5.234605904457936e16, 1e17, -3e200, 1.7e308})  // an angle all the same
      CHECK(std::abs(cairn::wrapped(far)) <= M_PI);
    CHECK(std::abs(cairn::wrapped(3e30F)) <= static_cast<float>(M_PI));
    CHECK(cairn::local(SO2(3.1), SO2(-3.1))(0) == doctest::Approx(2 * M_PI - 6.2));
    CHECK((SO2(0.3) * Vector<2>(1, 0) - Vector<2>(std::cos(0.3), std::sin(0.3))).norm() < 1e-16);
  }

  TEST_CASE("SE2: exp follows the arc of a constant twist") {
    const Vector<3> twist(1.0, 0.2, 0.7);
    SE2 small;
    for (int i = 0; i < 1000; ++i) small = small * SE2::exp(twist / 1000);
    CHECK(cairn::local(SE2::exp(twist), small).norm() < 1e-12);
    const SE2 t(1, 2, 0.5);
    const Vector<3> d(0.3, -0.2, 0.1);
    const SE2 left = t * SE2::exp(d);
    const SE2 right = SE2::exp(t.adjoint() * d) * t;
    CHECK(cairn::local(left, right).norm() < 1e-14);
    CHECK(((t.inverse() * t) * Vector<2>(3, 4) - Vector<2>(3, 4)).norm() < 1e-15);
  }

  // Every function that the duals know, at once.
  template <class T>
  Vector<2, T> bench(const Vector<3, T>& x) {
    using std::abs, std::acos, std::asin, std::atan, std::atan2, std::cos, std::exp, std::hypot, std::log,
        std::pow, std::sin, std::sqrt, std::tan, std::tanh;
    return {
        sqrt(x(0)) * sin(x(1)) / cos(x(2)) + tan(x(1)) - asin(x(1) / T(2)) * acos(x(2) / T(3)) + abs(-x(0)),
        atan(x(0)) * atan2(x(1), x(2)) + hypot(x(0), x(1)) + exp(x(2)) * log(x(0)) + pow(x(0), 1.5) +
            tanh(x(2))};
  }

  TEST_CASE("automatic_jacobian: agrees with central differences in every elementary function") {
    const Vector<3> x(1.3, 0.4, -0.7);
    const auto f = [](const auto& v) { return bench(v.eval()); };
    const Matrix<2, 3> numeric = cairn::numeric_jacobian(f, x);
    const Matrix<2, 3> automatic = cairn::automatic_jacobian(f, x);
    CHECK((numeric - automatic).norm() < 1e-9);
    CHECK(automatic.norm() > 1.0);
  }

  TEST_CASE("automatic_jacobian: of a rigid motion acting on a point is the closed form") {
    const SE3 pose = SE3::exp((Vector<6>() << 1, 2, 3, 0.3, -0.4, 0.5).finished());
    const Vector<3> p(0.5, -1, 2);
    const auto f = [&]<class T>(const cairn::BasicSE3<T>& T_world_body) -> Vector<3, T> {
      const Vector<3, T> point = p.template cast<T>();
      return T_world_body * point;
    };
    Matrix<3, 6> expected;
    expected << pose.rotation().matrix(), -pose.rotation().matrix() * cairn::skew(p);
    CHECK((cairn::automatic_jacobian(f, pose) - expected).norm() < 1e-13);
    CHECK((cairn::numeric_jacobian(f, pose) - expected).norm() < 1e-8);
  }

  TEST_CASE("automatic_jacobian: goes through products and planar poses") {
    using X = Product<SE2, Vector<1>>;
    const X x(SE2(1, 2, 3), Vector<1>(0.5));
    const auto f = [](const auto& state) {
      using State = std::decay_t<decltype(state)>;
      using T = cairn::ScalarOf<State>;
      const auto& pose = state.template part<0>();
      const T speed = state.template part<1>()(0);
      return State(pose * cairn::BasicSE2<T>::exp(Vector<3, T>(speed, T(0), T(0.2))),
                   Vector<1, T>(speed * speed));
    };
    CHECK((cairn::automatic_jacobian(f, x) - cairn::numeric_jacobian(f, x)).norm() < 1e-9);
  }
}

}  // namespace
}  // namespace derivatives_test
