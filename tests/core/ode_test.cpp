// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/core/ode.hpp>
#include <cairn/manifold/so3.hpp>

namespace ode_test {
namespace {

using cairn::DormandPrince;
using cairn::runge_kutta_4;
using cairn::Vector;

TEST_SUITE("core") {
  // y' = -2 t y, from 1: y = exp(-t^2).
  double bell(int parts) {
    double y = 1.0;
    for (int i = 0; i < parts; ++i)
      y = runge_kutta_4(y, i / static_cast<double>(parts), 1.0 / parts,
                        [](double t, double at) { return -2.0 * t * at; });
    return y - std::exp(-1.0);
  }

  TEST_CASE("ode: halving the step of the classical rule divides the error by sixteen") {
    for (int parts : {8, 16, 32, 64}) {
      CAPTURE(parts);
      CHECK(std::abs(bell(parts) / bell(2 * parts)) == doctest::Approx(16.0).epsilon(0.15));
    }
    CHECK(std::abs(bell(1024)) < 1e-13);
  }

  TEST_CASE("ode: the classical rule integrates polynomials of the time up to the third degree exactly") {
    for (int degree = 0; degree <= 4; ++degree) {
      const double y = runge_kutta_4(
          0.0, 0.0, 2.0, [degree](double t, double) { return (degree + 1) * std::pow(t, degree); });
      const double off = std::abs(y - std::pow(2.0, degree + 1));
      CAPTURE(degree);
      if (degree <= 3) CHECK(off < 1e-13);
      if (degree == 4) CHECK(off > 0.1);
    }
  }

  // A body that turns at (0.3, -0.5, 0.2) rad/s about its own axes, for 2 s.
  double turned(int parts) {
    const Vector<3> rate(0.3, -0.5, 0.2);
    cairn::SO3 r;
    const double h = 2.0 / parts;
    for (int i = 0; i < parts; ++i)
      r = runge_kutta_4(
          r, 0.0, h, [&](double, const cairn::SO3& at) { return Vector<3>(at.inverse() * rate); },
          [](const cairn::SO3& at, const Vector<3>& d) { return at * cairn::SO3::exp(d); });
    return (cairn::SO3::exp(Vector<3>(2 * rate)).inverse() * r).log().norm();
  }
  TEST_CASE("ode: what is no vector moves along its chart") {
    CHECK(turned(8) < 1e-12);  // a rate along one axis, which the turn leaves as it is
    Vector<2, float> y(1, 0);
    for (int i = 0; i < 100; ++i)
      y = runge_kutta_4(y, 0.0F, 0.01F,
                        [](float, const Vector<2, float>& at) { return Vector<2, float>(at(1), -at(0)); });
    CHECK(y(0) == doctest::Approx(std::cos(1.0)).epsilon(1e-6));
    CHECK(y(1) == doctest::Approx(-std::sin(1.0)).epsilon(1e-6));
  }

  template <class Y, class Slope>
  cairn::OdeResult go(double tolerance, Y& y, double from, double to, const Slope& slope) {
    return DormandPrince{.tolerance = tolerance}.integrate(y, from, to, slope);
  }
  void oscillate(double, const std::array<double, 2>& y, std::array<double, 2>& k) {
    k = {y[1], -y[0]};
  }

  TEST_CASE("ode: Dormand-Prince keeps the tolerance, and its steps grow as its fifth root") {
    int before = 0;
    for (double tolerance : {1e-5, 1e-7, 1e-9, 1e-11}) {
      std::array<double, 2> y{1, 0};
      const auto result = go(tolerance, y, 0, 20, oscillate);
      CAPTURE(tolerance);
      REQUIRE(result.arrived);
      CHECK(result.time == 20.0);
      const double off = std::hypot(y[0] - std::cos(20.0), y[1] + std::sin(20.0));
      CHECK(off < result.steps * tolerance);
      CHECK(off > 1e-4 * tolerance);
      if (before > 0) CHECK(result.steps / static_cast<double>(before) == doctest::Approx(2.51).epsilon(0.2));
      before = result.steps;
    }
  }

  TEST_CASE("ode: a step of Dormand-Prince is of order five") {
    const auto off = [](double h) {
      std::array<double, 1> y{1};
      const DormandPrince one{.tolerance = 1e300, .most_steps = 1, .first_step = 2 * h};
      const auto result = one.integrate(y, 0, h, [](double, const auto& at, auto& k) { k[0] = at[0]; });
      CHECK(result.arrived);
      return std::abs(y[0] - std::exp(h));
    };
    for (double h : {0.2, 0.1, 0.05}) CHECK(off(h) / off(h / 2) == doctest::Approx(64.0).epsilon(0.1));
  }

  // The restricted problem of three bodies: a path that closes after the period (Hairer, Norsett, Wanner,
  // "Solving Ordinary Differential Equations I", 1993, II.0, equation 0.2 and its figures).
  TEST_CASE("ode: Arenstorf's orbit closes after its published period") {
    const auto slope = [](double, const std::array<double, 4>& y, std::array<double, 4>& k) {
      constexpr double moon = 0.012277471, earth = 1.0 - moon;
      const double of_earth = std::pow((y[0] + moon) * (y[0] + moon) + y[1] * y[1], 1.5);
      const double of_moon = std::pow((y[0] - earth) * (y[0] - earth) + y[1] * y[1], 1.5);
      k = {y[2], y[3], y[0] + 2 * y[3] - earth * (y[0] + moon) / of_earth - moon * (y[0] - earth) / of_moon,
           y[1] - 2 * y[2] - earth * y[1] / of_earth - moon * y[1] / of_moon};
    };
    const std::array<double, 4> start{0.994, 0, 0, -2.00158510637908252240537862224};
    std::array<double, 4> y = start;
    const auto result = go(1e-13, y, 0, 17.0652165601579625588917206249, slope);
    REQUIRE(result.arrived);
    CHECK(std::hypot(y[0] - start[0], y[1] - start[1]) < 1e-6);
    CHECK(result.steps < 5000);
  }

  TEST_CASE("ode: backwards in time, and in numbers of run-time size") {
    std::array<double, 2> y{std::cos(3.0), -std::sin(3.0)};
    REQUIRE(go(1e-10, y, 3, 0, oscillate).arrived);
    CHECK(y[0] == doctest::Approx(1.0).epsilon(1e-8));
    CHECK(std::abs(y[1]) < 1e-8);
    std::vector<float> decaying{1, 2, 3};
    const auto result =
        go(1e-6, decaying, 0, 1, [](double, const std::vector<float>& at, std::vector<float>& k) {
          for (std::size_t i = 0; i < at.size(); ++i) k[i] = -at[i];
        });
    REQUIRE(result.arrived);
    for (std::size_t i = 0; i < 3; ++i)
      CHECK(decaying[i] == doctest::Approx((static_cast<double>(i) + 1) * std::exp(-1.0)).epsilon(1e-5));
    Vector<cairn::dynamic> none;
    CHECK(DormandPrince{}.integrate(none, 0, 1, [](double, const auto&, auto&) {}).arrived);
  }

  TEST_CASE("ode: says where it could not go on") {
    using Y = std::array<double, 1>;
    Y y{1};  // y' = y^2: 1 / (1 - t), which ends at 1
    const auto blown = go(1e-8, y, 0, 2, [](double, const Y& at, Y& k) { k[0] = at[0] * at[0]; });
    CHECK_FALSE(blown.arrived);
    CHECK(blown.time == doctest::Approx(1.0).epsilon(1e-6));
    y = {1};
    const auto ended = go(1e-8, y, 0, 2, [](double t, const Y&, Y& k) {
      k[0] = 1;
      return t <= 1.5;
    });
    CHECK_FALSE(ended.arrived);
    CHECK(ended.time <= 1.5);
    CHECK(ended.time > 1.49);
    CHECK(y[0] == doctest::Approx(1 + ended.time));
    y = {1};
    const DormandPrince few{.most_steps = 10};
    const auto stiff = few.integrate(y, 0, 1, [](double, const Y& at, Y& k) { k[0] = -1e6 * at[0]; });
    CHECK_FALSE(stiff.arrived);
    CHECK(stiff.steps == 10);
    y = {1};
    const auto slope = [](double, const Y&, Y& k) { k[0] = std::numeric_limits<double>::quiet_NaN(); };
    CHECK_FALSE(go(1e-8, y, 0, 1, slope).arrived);
    CHECK(y[0] == 1.0);
    CHECK_FALSE(go(0.0, y, 0, 1, slope).arrived);
    CHECK_FALSE(go(1e-8, y, 0, std::numeric_limits<double>::infinity(), slope).arrived);
    CHECK(go(1e-8, y, 1, 1, slope).arrived);
    CHECK(y[0] == 1.0);
  }
}

}  // namespace
}  // namespace ode_test
