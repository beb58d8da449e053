// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Monte-Carlo runs of any filter over a scenario: does its covariance speak the truth?
///
/// Truth starts at a draw of the prior and moves with draws of the noise; NEES and NIS are those of the last
/// step, so that runs are independent and their means lie in the chi-square band of a consistent filter.
#pragma once

#include <cstdint>
#include <type_traits>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

namespace cairn_test {

/// Means over the runs, and how many steps were refused. nis is negative where the filter gives none.
struct Consistency {
  double nees = 0.0, nis = -1.0;
  int dof = 0, measured = 0, refused = 0;
};

/// A point that flies with nearly constant velocity and is seen.
struct FlyingPoint {
  static constexpr const char* name = "constant velocity, position";
  static constexpr bool linear = true;
  using State = cairn::Vector<4>;
  cairn::ConstantVelocity<2> process{.density = 0.3};
  cairn::Gaussian<State> prior{State(0, 0, 1, 2), State(1, 1, 4, 4).asDiagonal()};
  cairn::NoControl control{};
  double dt = 0.5;
  template <class F>
  void sense(int, const F& f) const {
    f(cairn::PositionSensor<2, 4>{0.25 * cairn::Matrix<2>::Identity()});
  }
};

/// The same with acceleration, on a line.
struct Rocket {
  static constexpr const char* name = "constant acceleration, position";
  static constexpr bool linear = true;
  using State = cairn::Vector<3>;
  cairn::ConstantAcceleration<1> process{.density = 2.0};
  cairn::Gaussian<State> prior{State(0, 1, 0), State(1, 1, 0.5).asDiagonal()};
  cairn::NoControl control{};
  double dt = 0.5;
  template <class F>
  void sense(int, const F& f) const {
    f(cairn::PositionSensor<1, 3>{cairn::Matrix<1>(1.0)});
  }
};

/// A vehicle that drives a circle between two beacons, seen in turn.
struct CirclingVehicle {
  static constexpr const char* name = "unicycle, range and bearing";
  static constexpr bool linear = false;
  using State = cairn::SE2;
  cairn::Unicycle process{.speed_density = 0.01, .slip_density = 0.001, .turn_density = 0.002};
  cairn::Gaussian<State> prior{cairn::SE2(0, 0, 3.0), cairn::Vector<3>(0.04, 0.04, 0.01).asDiagonal()};
  cairn::Vector<2> control{1.0, 0.3};
  double dt = 0.5;
  template <class F>
  void sense(int step, const F& f) const {
    f(cairn::RangeBearing{.beacon = cairn::Vector<2>(step % 2 == 0 ? 10 : -10, 8)});
  }
};

/// A vehicle with a compass and, every other step, a position.
struct CompassVehicle {
  static constexpr const char* name = "unicycle, compass and position";
  static constexpr bool linear = false;
  using State = cairn::SE2;
  cairn::Unicycle process{.speed_density = 0.02, .slip_density = 0.002, .turn_density = 0.004};
  cairn::Gaussian<State> prior{cairn::SE2(1, 2, -3.1), cairn::Vector<3>(0.3, 0.3, 0.04).asDiagonal()};
  cairn::Vector<2> control{1.5, -0.4};
  double dt = 0.3;
  template <class F>
  void sense(int step, const F& f) const {
    if (step % 2 == 0)
      f(cairn::Compass{.sigma = 0.05});
    else
      f(cairn::PlanarPosition{.sigma = 0.3});
  }
};

/// `value` as a Gaussian, whatever form the filter keeps.
template <class X, class Belief>
cairn::Gaussian<X> plain_gaussian(const Belief& belief) {
  if constexpr (std::is_same_v<Belief, cairn::Gaussian<X>>)
    return belief;
  else if constexpr (requires { belief.gaussian().value(); })
    return belief.gaussian().value();
  else if constexpr (requires { belief.gaussian(); })
    return belief.gaussian();
  else
    return moments(belief);
}

/// Runs `filter` `runs` times for `steps` steps; begin(prior, random) makes its belief.
template <class Scenario, class Filter, class Begin>
Consistency study(const Scenario& scenario, const Filter& filter, const Begin& begin, int runs, int steps,
                  std::uint64_t seed) {
  using X = typename Scenario::State;
  cairn::Random random(seed), filter_random(seed, 1);
  cairn::RunningMoments nees, nis;
  Consistency result;
  result.dof = cairn::dof<X>;
  for (int run = 0; run < runs; ++run) {
    auto belief = begin(scenario.prior, filter_random);
    X truth = cairn::sample(scenario.prior, random);
    for (int step = 0; step < steps; ++step) {
      cairn::Status moved;
      if constexpr (requires {
                      filter.predict(belief, scenario.process, 1.0, filter_random, scenario.control);
                    })
        moved = filter.predict(belief, scenario.process, scenario.dt, filter_random, scenario.control);
      else
        moved = filter.predict(belief, scenario.process, scenario.dt, scenario.control);
      truth =
          cairn::sample(cairn::Gaussian<X>{scenario.process.propagate(truth, scenario.control, scenario.dt),
                                           scenario.process.noise(truth, scenario.control, scenario.dt)},
                        random);
      scenario.sense(step, [&](const auto& sensor) {
        using Z = typename std::decay_t<decltype(sensor)>::Measurement;
        const Z z = cairn::sample(cairn::Gaussian<Z>{sensor.predict(truth), sensor.noise(truth)}, random);
        const auto found = [&] {
          if constexpr (requires { filter.update(belief, sensor, z, filter_random); })
            return filter.update(belief, sensor, z, filter_random);
          else
            return filter.update(belief, sensor, z);
        }();
        bool taken = false;
        if constexpr (requires { found.nis; }) {
          taken = found.accepted();
          if (step == steps - 1) nis.add(static_cast<double>(found.nis));
        } else {
          taken = found == cairn::Status::accepted;
        }
        result.measured = cairn::dof<Z>;
        if (!taken || moved != cairn::Status::accepted) ++result.refused;
      });
    }
    nees.add(cairn::nees(plain_gaussian<X>(belief), truth));
  }
  result.nees = nees.mean();
  if (nis.count() > 0) result.nis = nis.mean();
  return result;
}

/// Begins with the prior as it is.
inline constexpr auto as_prior = [](const auto& prior, cairn::Random&) { return prior; };

}  // namespace cairn_test
