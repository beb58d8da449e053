// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// One filter of each kind on each ready-made model; the whole table is printed by benchmarks'
// filter_consistency.
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/ensemble.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/square_root_information.hpp>

#include "filter/consistency_study.hpp"
#include "support/random.hpp"

namespace consistency_test {
namespace {

constexpr int runs = 500;

template <class Scenario, class Filter, class Begin>
void check(const Scenario& scenario, const Filter& filter, const Begin& begin) {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  CAPTURE(Scenario::name);
  const auto found = cairn_test::study(scenario, filter, begin, runs, 20, seed);
  CHECK(cairn::chi_square_mean_band(found.dof, runs, 0.9999).contains(found.nees));
  if (found.nis >= 0.0) CHECK(cairn::chi_square_mean_band(found.measured, runs, 0.9999).contains(found.nis));
  CHECK(found.refused == 0);
}

struct Trusting {
  cairn::Extended filter{};
  template <class F>
  cairn::Status predict(cairn::Gaussian<cairn::SE2>& belief, const F& process, double dt,
                        const cairn::Vector<2>& u) const {
    return filter.predict(belief, process, dt, u);
  }
  auto update(cairn::Gaussian<cairn::SE2>& belief, cairn::RangeBearing sensor,
              const cairn::RangeBearing::Measurement& z) const {
    sensor.range_sigma *= 0.5;
    sensor.bearing_sigma *= 0.5;
    return filter.update(belief, sensor, z);
  }
};

TEST_SUITE("consistency") {
  TEST_CASE("filters: average NEES and NIS over 500 runs lie in their chi-square bands") {
    check(cairn_test::FlyingPoint{}, cairn::SquareRootInformationFilter{}, [](const auto& p, cairn::Random&) {
      return cairn::SquareRootInformation<cairn::Vector<4>>::from(p).value();
    });
    check(cairn_test::Rocket{}, cairn::EnsembleKalman{}, [](const auto& p, cairn::Random& random) {
      return cairn::Ensemble<cairn::Vector<3>>::draw(p, 300, random);
    });
    check(cairn_test::CirclingVehicle{}, cairn::SquareRootUnscented{},
          [](const auto& p, cairn::Random&) { return cairn::SquareRootGaussian<cairn::SE2>::from(p); });
    check(cairn_test::CompassVehicle{}, cairn::Extended{}, cairn_test::as_prior);
  }

  TEST_CASE("filters: one that believes its sensor twice as good does not pass") {
    const auto found = cairn_test::study(cairn_test::CirclingVehicle{}, Trusting{}, cairn_test::as_prior,
                                         runs, 20, cairn_test::seed());
    CHECK(found.nees > cairn::chi_square_mean_band(3, runs, 0.9999).high);
    CHECK(found.nis > cairn::chi_square_mean_band(2, runs, 0.9999).high);
  }
}

}  // namespace
}  // namespace consistency_test
