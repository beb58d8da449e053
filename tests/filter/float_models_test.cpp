// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <type_traits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/models/linear.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "filter/every_form.hpp"
#include "support/random.hpp"

namespace float_models_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::Vector;
using cairn_test::as_gaussian;
using cairn_test::begin_with;

template <class S>
using Ride = cairn::ConstantVelocity<2, S>;
template <class S>
using Fix = cairn::PositionSensor<2, 4, S>;

/// Largest distance of a float mean from the double one, and of the deviations, in deviations.
template <class X, class Y>
double apart(const Gaussian<X>& found, const Gaussian<Y>& wanted, const Y& mean) {
  const auto step = cairn::local(wanted.mean, mean);
  double worst = 0;
  for (int i = 0; i < cairn::dof<Y>; ++i) {
    const double sigma = std::sqrt(wanted.covariance(i, i));
    worst = std::max(worst, std::abs(step(i)) / sigma);
    worst = std::max(worst, std::abs(std::sqrt(static_cast<double>(found.covariance(i, i))) / sigma - 1.0));
  }
  return worst;
}

TEST_SUITE("filter") {
  TEST_CASE("float: every form follows a ride as Kalman does in double") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn_test::each_form([&](const char* name, const auto& filter) {
      CAPTURE(name);
      cairn::Random random(seed);
      Gaussian<Vector<4>> exact{Vector<4>::Zero(), 9 * Matrix<4>::Identity()};
      using F = Vector<4, float>;
      auto belief = begin_with(filter, Gaussian<F>{F::Zero(), 9 * Matrix<4, 4, float>::Identity()});
      for (int step = 0; step < 30; ++step) {
        const Vector<2> z(0.3 * step + random.normal(), 5 - 0.1 * step + random.normal());
        REQUIRE(cairn::Kalman{}.predict(exact, Ride<double>{.density = 0.1}, 0.2) == cairn::Status::accepted);
        REQUIRE(cairn::Kalman{}.update(exact, Fix<double>{}, z).accepted());
        REQUIRE(filter.predict(belief, Ride<float>{.density = 0.1F}, 0.2) == cairn::Status::accepted);
        REQUIRE(filter.update(belief, Fix<float>{}, Vector<2, float>(z.cast<float>())).accepted());
      }
      const Gaussian<F> found = as_gaussian(belief);
      CHECK(apart(found, exact, Vector<4>(found.mean.cast<double>())) < 2e-3);
    });
  }

  TEST_CASE("float: every form that may steers a pose by float models as Extended does in double") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn_test::each_form([&](const char* name, const auto& filter) {
      using Filter = std::remove_cvref_t<decltype(filter)>;
      if constexpr (!std::is_same_v<Filter, cairn::Kalman>) {
        CAPTURE(name);
        cairn::Random random(seed);
        const cairn::Extended reference;
        Gaussian<cairn::SE2> exact{cairn::SE2(0, 0, 0), 1e-3 * Matrix<3>::Identity()};
        auto belief = begin_with(
            filter, Gaussian<cairn::SE2f>{cairn::SE2f(0, 0, 0), 1e-3F * Matrix<3, 3, float>::Identity()});
        cairn::SE2 truth(0, 0, 0);
        const auto both = [&](const auto& wide, const auto& narrow, const auto& z, const auto& zf) {
          REQUIRE(reference.update(exact, wide, z).accepted());
          REQUIRE(filter.update(belief, narrow, zf).accepted());
        };
        for (int step = 0; step < 20; ++step) {
          const Vector<2> u(1.0, 0.2);
          REQUIRE(reference.predict(exact, cairn::Unicycle{.speed_density = 1e-3, .turn_density = 1e-4}, 0.1,
                                    u) == cairn::Status::accepted);
          REQUIRE(filter.predict(belief, cairn::Unicyclef{.speed_density = 1e-3F, .turn_density = 1e-4F}, 0.1,
                                 Vector<2, float>(u.cast<float>())) == cairn::Status::accepted);
          truth = cairn::Unicycle{}.propagate(truth, u, 0.1);
          const cairn::RangeBearing beacon{.beacon = Vector<2>(4, 7)};
          const cairn::RangeBearingf beacon_f{.beacon = Vector<2, float>(4, 7)};
          const auto seen = beacon.predict(truth);
          const double range = seen.part<0>()(0) + 0.1 * random.normal();
          const double bearing = seen.part<1>().angle() + 0.02 * random.normal();
          both(beacon, beacon_f, beacon.measurement(range, bearing),
               beacon_f.measurement(static_cast<float>(range), static_cast<float>(bearing)));
          const cairn::SO2 heading(truth.angle() + 0.02 * random.normal());
          both(cairn::Compass{}, cairn::Compassf{}, heading, heading.cast<float>());
          const Vector<2> place = truth.translation() + Vector<2>(random.normal(), random.normal());
          both(cairn::PlanarPosition{}, cairn::PlanarPositionf{}, place,
               Vector<2, float>(place.cast<float>()));
        }
        const auto found = as_gaussian(belief);
        CHECK(apart(found, exact, found.mean.template cast<double>()) < 0.05);
      }
    });
  }

  TEST_CASE("float: the models say in float what they say in double") {
    const Vector<6> x(1, 2, 3, -1, 0.5, 0.25);
    const cairn::NoControl none;
    const cairn::ConstantAcceleration<2> wide{.density = 0.3};
    const cairn::ConstantAcceleration<2, float> narrow{.density = 0.3F};
    const Vector<6, float> xf = x.cast<float>();
    CHECK((narrow.propagate(xf, none, 0.7).cast<double>() - wide.propagate(x, none, 0.7)).norm() < 1e-6);
    CHECK(
        (narrow.jacobian(xf, none, 0.7).dense().cast<double>() - wide.jacobian(x, none, 0.7).dense()).norm() <
        1e-6);
    CHECK((narrow.noise(xf, none, 0.7).dense().cast<double>() - wide.noise(x, none, 0.7).dense()).norm() <
          1e-7);
    const cairn::LinearModel<2, float> still{Matrix<2, 2, float>::Identity(),
                                             Matrix<2, 2, float>::Identity()};
    Gaussian<Vector<2, float>> belief{Vector<2, float>(1, 2), Matrix<2, 2, float>::Identity()};
    REQUIRE(cairn::Kalman{}.predict(belief, still, 1) == cairn::Status::accepted);
    CHECK(belief.covariance(0, 0) == 2.0F);
  }
}

}  // namespace
}  // namespace float_models_test
