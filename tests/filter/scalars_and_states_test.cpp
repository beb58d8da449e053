// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The filters over any number type, and over state types that are the user's own.
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/manifold/dual.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/so2.hpp>

#include "filter/linear_problems.hpp"
#include "support/random.hpp"

namespace cairn_test {

// A user's struct that has never heard of cairn: a pendulum's angle, kept in degrees, and its rate.
template <class S>
struct Pendulum {
  S degrees{};
  S rate{};  // rad/s
  template <class T>
  [[nodiscard]] Pendulum<T> cast() const {
    return {T(degrees), T(rate)};
  }
};

}  // namespace cairn_test

// Teaches it to cairn: steps in radians, the angle wraps.
template <class S>
struct cairn::manifold_traits<cairn_test::Pendulum<S>> {
  using Scalar = S;
  using Tangent = cairn::Vector<2, S>;
  using State = cairn_test::Pendulum<S>;
  static constexpr int dof = 2;
  static State retract(const State& x, const Tangent& d) {
    return {x.degrees + d(0) * S(180.0 / M_PI), x.rate + d(1)};
  }
  static Tangent local(const State& x, const State& y) {
    const S turn = (y.degrees - x.degrees) * S(M_PI / 180.0);
    using std::atan2;
    using std::cos;
    using std::sin;
    return Tangent(atan2(S(sin(turn)), S(cos(turn))), y.rate - x.rate);
  }
};

namespace scalars_and_states_test {
namespace {

using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::NoControl;
using cairn::SO2;
using cairn::Status;
using cairn::Vector;
using cairn_test::Pendulum;

struct Swinging {
  using State = Pendulum<double>;
  using Control = NoControl;
  template <class T>
  [[nodiscard]] Pendulum<T> propagate(const Pendulum<T>& x, const Control&, double dt) const {
    using std::sin;
    return {x.degrees + x.rate * T(dt * 180.0 / M_PI),
            x.rate - T(9.81 * dt) * sin(x.degrees * T(M_PI / 180.0))};
  }
  [[nodiscard]] Matrix<2> noise(const State&, const Control&, double dt) const {
    return Vector<2>(1e-4 * dt, 0.01 * dt).asDiagonal();
  }
  [[nodiscard]] Matrix<2> jacobian(const State& x, const Control&, double dt) const {
    return (Matrix<2>() << 1, dt, -9.81 * dt * std::cos(x.degrees * M_PI / 180.0), 1).finished();
  }
};
struct Protractor {
  using State = Pendulum<double>;
  using Measurement = Vector<1>;
  template <class T>
  [[nodiscard]] Vector<1, T> predict(const Pendulum<T>& x) const {
    using std::sin;
    return Vector<1, T>(sin(x.degrees * T(M_PI / 180.0)));
  }
  [[nodiscard]] Matrix<1> noise(const State&) const { return Matrix<1>(0.01); }
  [[nodiscard]] Matrix<1, 2> jacobian(const State& x) const {
    return Matrix<1, 2>(std::cos(x.degrees * M_PI / 180.0), 0.0);
  }
};

// The same physics over the library's own types.
using Product = cairn::Product<SO2, Vector<1>>;
struct SwingingProduct {
  using State = Product;
  using Control = NoControl;
  [[nodiscard]] State propagate(const State& x, const Control&, double dt) const {
    const double rate = x.part<1>()(0);
    return State(x.part<0>() * SO2(rate * dt), Vector<1>(rate - 9.81 * dt * std::sin(x.part<0>().angle())));
  }
  [[nodiscard]] Matrix<2> noise(const State&, const Control&, double dt) const {
    return Swinging{}.noise({}, {}, dt);
  }
};
struct ProtractorProduct {
  using State = Product;
  using Measurement = Vector<1>;
  [[nodiscard]] Vector<1> predict(const State& x) const { return Vector<1>(std::sin(x.part<0>().angle())); }
  [[nodiscard]] Matrix<1> noise(const State&) const { return Matrix<1>(0.01); }
};

template <class Filter, class F, class H, class F2, class H2>
void check_foreign(const Filter& filter, const F& f, const H& h, const F2& f2, const H2& h2) {
  const Matrix<2> covariance = Vector<2>(0.04, 0.25).asDiagonal();
  Gaussian<Pendulum<double>> foreign{{179.0, 0.5}, covariance};
  Gaussian<Product> own{Product(SO2(179.0 * M_PI / 180.0), Vector<1>(0.5)), covariance};
  for (int step = 0; step < 40; ++step) {
    REQUIRE(filter.predict(foreign, f, 0.05) == Status::accepted);
    REQUIRE(filter.predict(own, f2, 0.05) == Status::accepted);
    const Vector<1> z(0.3 * std::sin(0.2 * step));
    REQUIRE(filter.update(foreign, h, z).accepted());
    REQUIRE(filter.update(own, h2, z).accepted());
    const SO2 angle(foreign.mean.degrees * M_PI / 180.0);
    CHECK(std::abs(cairn::local(angle, own.mean.part<0>())(0)) < 1e-6);
    CHECK(std::abs(foreign.mean.rate - own.mean.part<1>()(0)) < 1e-6);
    CHECK((foreign.covariance - own.covariance).norm() < 1e-6);
  }
}

TEST_SUITE("states") {
  TEST_CASE("foreign states: a plain struct with a trait filters as the library's own types do") {
    check_foreign(cairn::Unscented{}, Swinging{}, Protractor{}, SwingingProduct{}, ProtractorProduct{});
    check_foreign(cairn::Extended{}, cairn::automatic(Swinging{}), cairn::automatic(Protractor{}),
                  cairn::numeric(SwingingProduct{}), cairn::numeric(ProtractorProduct{}));
    Gaussian<Pendulum<double>> belief{{0.0, 0.0}, Matrix<2>::Identity()};
    belief.mean.rate = std::nan("");
    CHECK(cairn::Extended{}.predict(belief, Swinging{}, 0.1) == Status::not_finite);
  }

  TEST_CASE("check_jacobians: given, automatic and numeric agree, and the one that is wrong is named") {
    const Pendulum<double> x{37.0, -0.4};
    CHECK(cairn::check_jacobians(Swinging{}, x, NoControl{}, 0.1).agree());
    CHECK(cairn::check_jacobians(Protractor{}, x).agree());
    struct Wrong : Protractor {
      [[nodiscard]] Matrix<1, 2> jacobian(const Pendulum<double>&) const { return Matrix<1, 2>(0.0, 0.0); }
    };
    const auto check = cairn::check_jacobians(Wrong{}, x);
    CHECK_FALSE(check.agree());
    CHECK_FALSE(check.given_automatic.agrees());
    CHECK_FALSE(check.given_numeric.agrees());
    CHECK(check.automatic_numeric.agrees());
    CHECK(check.given_numeric.column == 0);
  }
}

// Twenty steps in S and in long double.
template <class S, class Filter, class Make>
double distance_from_long_double(const Filter& filter, const Make& make) {
  cairn::Random random(cairn_test::seed());
  const cairn_test::LinearProblem<3, 2, S> p(random);
  using L = long double;
  const cairn::LinearModel<3, L> process{p.process.transition.template cast<L>(),
                                         p.process.covariance.template cast<L>()};
  const cairn::LinearSensor<2, 3, L> sensor{p.sensor.design.template cast<L>(),
                                            p.sensor.covariance.template cast<L>()};
  Gaussian<Vector<3, L>> exact{p.prior.mean.template cast<L>(), p.prior.covariance.template cast<L>()};
  auto belief = make(p.prior);
  for (int step = 0; step < 20; ++step) {
    const Vector<2, S> z = cairn_test::random_matrix<2, 1, S>(random);
    REQUIRE(Kalman{}.predict(exact, process, 1.0) == Status::accepted);
    REQUIRE(Kalman{}.update(exact, sensor, z.template cast<L>()).accepted());
    REQUIRE(filter.predict(belief, p.process, 1.0) == Status::accepted);
    REQUIRE(filter.update(belief, p.sensor, z).accepted());
  }
  const Gaussian<Vector<3, S>> plain = belief.gaussian();
  return cairn_test::relative_error(plain.covariance.template cast<L>(), exact.covariance) +
         cairn_test::relative_error(plain.mean.template cast<L>(), exact.mean);
}

TEST_SUITE("scalars") {
  TEST_CASE_TEMPLATE("filters: float, double and long double differ by their rounding only", S, float, double,
                     long double) {
    const double tolerance = 2e3 * static_cast<double>(std::numeric_limits<S>::epsilon());
    const auto same = [](const auto& prior) { return prior; };
    const auto root = [](const auto& prior) { return cairn::SquareRootGaussian<Vector<3, S>>::from(prior); };
    CHECK(distance_from_long_double<S>(Kalman{}, same) < tolerance);
    CHECK(distance_from_long_double<S>(Kalman{.form = cairn::Form::joseph}, same) < tolerance);
    CHECK(distance_from_long_double<S>(cairn::Unscented{}, same) < tolerance);
    CHECK(distance_from_long_double<S>(cairn::SquareRoot{}, root) < tolerance);
  }

  // Dual numbers as the user's scalar: the filter differentiates itself.
  TEST_CASE("filters: a user's scalar goes through, and brings the derivative of the likelihood by Q") {
    using D = cairn::Dual<double, 1>;
    const auto likelihood = [](auto q, const auto& filter) {
      using T = decltype(q);
      const cairn::LinearModel<1, T> process{Matrix<1, 1, T>(T(0.9)), Matrix<1, 1, T>(q)};
      const cairn::LinearSensor<1, 1, T> sensor{Matrix<1, 1, T>(T(1.5)), Matrix<1, 1, T>(T(0.3))};
      Gaussian<Vector<1, T>> belief{Vector<1, T>(T(0.2)), Matrix<1, 1, T>(T(2.0))};
      T sum(0);
      for (int step = 0; step < 10; ++step) {
        REQUIRE(filter.predict(belief, process, 1.0) == Status::accepted);
        const auto innovation = filter.update(belief, sensor, Vector<1, T>(T(std::sin(step))));
        REQUIRE(innovation.accepted());
        sum += innovation.log_likelihood();
      }
      return sum;
    };
    const auto check = [&](const auto& filter) {
      const D found = likelihood(D::variable(0.4, 0), filter);
      const double up = likelihood(0.4 + 1e-5, filter), down = likelihood(0.4 - 1e-5, filter);
      CHECK(std::abs(found.value - likelihood(0.4, filter)) < 1e-13);
      CHECK(std::abs(found.slope[0] - (up - down) / 2e-5) < 1e-8);
    };
    check(Kalman{});
    check(Kalman{.form = cairn::Form::sequential});
  }
}

}  // namespace
}  // namespace scalars_and_states_test
