// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The problems of the filter scoreboard, written once as models of cairn; rivals take their matrices.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "rivals.hpp"

namespace cairn_bench {

inline constexpr double time_step = 0.1;

/// Measurements to cycle through: N(0, sigma).
template <int M>
std::vector<cairn::Vector<M>> noise(std::size_t count, double sigma) {
  cairn::Random random(7);
  std::vector<cairn::Vector<M>> z(count);
  for (auto& v : z)
    for (int i = 0; i < M; ++i) v(i) = sigma * random.normal();
  return z;
}

/// Landmark: stands still, is seen directly.
struct Still {
  using State = cairn::Vector<3>;
  using Control = cairn::NoControl;
  static constexpr bool linear = true;
  cairn::Matrix<3> q = 1e-3 * cairn::Matrix<3>::Identity();
  [[nodiscard]] const State& propagate(const State& x, const Control&, double) const { return x; }
  [[nodiscard]] cairn::Identity<3> jacobian(const State&, const Control&, double) const { return {}; }
  [[nodiscard]] const cairn::Matrix<3>& noise(const State&, const Control&, double) const { return q; }
};

/// A library of linear filters whose matrices are given at run time. Solver::run<N, M>(F, Q, steps) sees the
/// first M numbers of the state with unit noise, starts from unit covariance, and returns the last trace.
template <class Solver>
Rival linear_rival(const std::string& name) {
  Rival rival{name};
  rival.kalman_6_3 = [](int steps) {
    const cairn::ConstantVelocity<3> process;
    return Solver::template run<6, 3>(process.jacobian({}, {}, time_step), process.noise({}, {}, time_step),
                                      steps);
  };
  rival.landmark_3_3 = [](int steps) {
    return Solver::template run<3, 3>(cairn::Matrix<3>::Identity(), Still{}.q, steps);
  };
  return rival;
}

/// Where the vehicle starts.
inline cairn::Vector<5> vehicle_start() {
  return (cairn::Vector<5>() << 0, 0, 0, 1, 0.1).finished();
}

/// (x, y, heading, speed, turn rate) along the tangent, and a beacon at (10, 5).
struct Vehicle {
  using State = cairn::Vector<5>;
  using Control = cairn::NoControl;
  template <class T>
  [[nodiscard]] cairn::Vector<5, T> propagate(const cairn::Vector<5, T>& x, const Control&, double dt) const {
    using std::cos;
    using std::sin;
    cairn::Vector<5, T> next = x;
    next(0) += dt * x(3) * cos(x(2));
    next(1) += dt * x(3) * sin(x(2));
    next(2) += dt * x(4);
    return next;
  }
  [[nodiscard]] cairn::Structured<"1.**. .1**. ..1.* ...1. ....1"> jacobian(const State& x, const Control&,
                                                                            double dt) const {
    const double c = std::cos(x(2)), s = std::sin(x(2));
    return {{-dt * x(3) * s, dt * c, dt * x(3) * c, dt * s, dt}};
  }
  [[nodiscard]] cairn::Diagonal<5> noise(const State&, const Control&, double) const {
    return {{1e-4, 1e-4, 1e-5, 1e-2, 1e-3}};
  }
};
struct Beacon {
  using State = cairn::Vector<5>;
  using Measurement = cairn::Product<cairn::Vector<1>, cairn::SO2>;
  template <class T>
  [[nodiscard]] cairn::Product<cairn::Vector<1, T>, cairn::BasicSO2<T>> predict(
      const cairn::Vector<5, T>& x) const {
    using std::atan2;
    using std::sqrt;
    const T dx = 10.0 - x(0), dy = 5.0 - x(1);
    return cairn::Product(cairn::Vector<1, T>(sqrt(dx * dx + dy * dy)),
                          cairn::BasicSO2<T>(T(atan2(dy, dx) - x(2))));
  }
  [[nodiscard]] cairn::Structured<"**... ***.."> jacobian(const State& x) const {
    const double dx = 10.0 - x(0), dy = 5.0 - x(1);
    const double squared = dx * dx + dy * dy, range = std::sqrt(squared);
    return {{-dx / range, -dy / range, dy / squared, -dx / squared, -1.0}};
  }
  [[nodiscard]] cairn::Diagonal<2> noise(const State&) const { return {{0.01, 1e-3}}; }
};

/// Nine states, three of them driven by sines of the others; three squared distances seen.
struct Coupled {
  using State = cairn::Vector<9>;
  using Control = cairn::NoControl;
  template <class T>
  [[nodiscard]] cairn::Vector<9, T> propagate(const cairn::Vector<9, T>& x, const Control&, double dt) const {
    using std::sin;
    cairn::Vector<9, T> next = x;
    for (int i = 0; i < 3; ++i) {
      next(i) += dt * x(3 + i);
      next(3 + i) += dt * x(6 + i);
      next(6 + i) -= dt * sin(x(i));
    }
    return next;
  }
  [[nodiscard]] cairn::Diagonal<9> noise(const State&, const Control&, double) const {
    cairn::Diagonal<9> q;
    q.values.fill(1e-3);
    return q;
  }
};
struct CoupledSensor {
  using State = cairn::Vector<9>;
  using Measurement = cairn::Vector<3>;
  template <class T>
  [[nodiscard]] cairn::Vector<3, T> predict(const cairn::Vector<9, T>& x) const {
    return {x(0) + 0.1 * x(1) * x(1), x(1) + 0.1 * x(2) * x(2), x(2) + 0.1 * x(0) * x(0)};
  }
  [[nodiscard]] cairn::Diagonal<3> noise(const State&) const { return {{0.1, 0.1, 0.1}}; }
};

/// Inertial error state: position, velocity, attitude, accelerometer and gyroscope bias; position and
/// velocity are seen. The attitude turns the biases.
struct Inertial {
  using State = cairn::Vector<15>;
  using Control = cairn::NoControl;
  using Jacobian = cairn::Structured<
      "1..*........... .1..*.......... ..1..*......... ...1...*****... ....1.*.****... .....1**.***... "
      "......1.....*** .......1....*** ........1...*** .........1..... ..........1.... ...........1... "
      "............1.. .............1. ..............1">;
  [[nodiscard]] State propagate(const State& x, const Control& u, double dt) const {
    return jacobian(x, u, dt) * x;
  }
  [[nodiscard]] Jacobian jacobian(const State& x, const Control&, double dt) const {
    const double c = std::cos(x(8)), s = std::sin(x(8)), g = 9.81 * dt;
    const double r[3][3] = {{c, -s, 0}, {s, c, 0}, {0, 0, 1}};
    Jacobian f;
    std::size_t k = 0;
    for (int i = 0; i < 3; ++i) f.values[k++] = dt;
    for (int i = 0; i < 3; ++i) {
      f.values[k++] = i == 1 ? g : -g;  // the lever of gravity on attitude
      f.values[k++] = 0.1 * g;
      for (int j = 0; j < 3; ++j) f.values[k++] = -r[i][j] * dt;
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) f.values[k++] = -r[i][j] * dt;
    return f;
  }
  [[nodiscard]] cairn::Diagonal<15> noise(const State&, const Control&, double) const {
    cairn::Diagonal<15> q;
    q.values.fill(1e-4);
    return q;
  }
};

}  // namespace cairn_bench
