// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Sensors and processes over several blocks of a growing state: a robot in the plane, landmarks, biases.
#pragma once

#include <cmath>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/models/sensor.hpp>

namespace cairn_test {

using cairn::Matrix;
using cairn::Product;
using cairn::SE2;
using cairn::SO2;
using cairn::Vector;

/// Range and bearing of a landmark from a pose.
struct Sighting {
  using State = Product<SE2, Vector<2>>;
  using Measurement = Product<Vector<1>, SO2>;
  double range_sigma = 0.1;
  double bearing_sigma = 0.02;

  [[nodiscard]] static Measurement measurement(double range, double bearing) {
    return cairn::RangeBearing::measurement(range, bearing);
  }
  [[nodiscard]] Measurement predict(const State& x) const {
    return cairn::RangeBearing{.beacon = x.part<1>()}.predict(x.part<0>());
  }
  [[nodiscard]] Matrix<2, 5> jacobian(const State& x) const {
    const Matrix<2, 3> by_pose = cairn::RangeBearing{.beacon = x.part<1>()}.jacobian(x.part<0>());
    const Matrix<2> to_body = x.part<0>().rotation().inverse().matrix();
    Matrix<2, 5> h;
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 3; ++j) h(i, j) = by_pose(i, j);
      for (int j = 0; j < 2; ++j)
        h(i, 3 + j) = -(by_pose(i, 0) * to_body(0, j) + by_pose(i, 1) * to_body(1, j));
    }
    return h;
  }
  [[nodiscard]] Matrix<2> noise(const State&) const {
    return Vector<2>(range_sigma * range_sigma, bearing_sigma * bearing_sigma).asDiagonal();
  }
  [[nodiscard]] Vector<2> initialise(const SE2& pose, const Measurement& z) const {
    const double range = z.part<0>()(0), bearing = z.part<1>().angle();
    return pose * Vector<2>(range * std::cos(bearing), range * std::sin(bearing));
  }
};

/// The way from one pose to another.
struct Passage {
  using State = Product<SE2, SE2>;
  using Measurement = SE2;
  Matrix<3> covariance = 1e-4 * Matrix<3>::Identity();

  [[nodiscard]] SE2 predict(const State& x) const { return x.part<0>().inverse() * x.part<1>(); }
  [[nodiscard]] Matrix<3, 6> jacobian(const State& x) const {
    Matrix<3, 6> h;
    h.leftCols<3>() = -(x.part<1>().inverse() * x.part<0>()).adjoint();
    h.rightCols<3>().setIdentity();
    return h;
  }
  [[nodiscard]] const Matrix<3>& noise(const State&) const { return covariance; }
};

/// A landmark's x seen by an instrument with a bias.
struct Biased {
  using State = Product<Vector<2>, Vector<1>>;
  using Measurement = Vector<1>;
  static constexpr bool linear = true;
  [[nodiscard]] Vector<1> predict(const State& x) const { return Vector<1>(x.part<0>()(0) + x.part<1>()(0)); }
  [[nodiscard]] cairn::Structured<"1.1"> jacobian(const State&) const { return {}; }
  [[nodiscard]] Matrix<1> noise(const State&) const { return Matrix<1>(0.04); }
};

/// One landmark and twice another, which may be the same.
struct Blend {
  using State = Product<Vector<2>, Vector<2>>;
  using Measurement = Vector<2>;
  static constexpr bool linear = true;
  [[nodiscard]] Vector<2> predict(const State& x) const { return x.part<0>() + 2 * x.part<1>(); }
  [[nodiscard]] Matrix<2, 4> jacobian(const State&) const {
    return (Matrix<2, 4>() << 1, 0, 2, 0, 0, 1, 0, 2).finished();
  }
  [[nodiscard]] Matrix<2> noise(const State&) const { return (Matrix<2>() << 0.3, 0.1, 0.1, 0.2).finished(); }
};

/// A bias that wanders.
struct Wander {
  using State = Vector<1>;
  using Control = cairn::NoControl;
  static constexpr bool linear = true;
  [[nodiscard]] State propagate(const State& x, const Control&, double) const { return 0.9 * x; }
  [[nodiscard]] Matrix<1> jacobian(const State&, const Control&, double) const { return Matrix<1>(0.9); }
  [[nodiscard]] Matrix<1> noise(const State&, const Control&, double dt) const {
    return Matrix<1>(0.01 * dt);
  }
};

/// A robot whose speed is off by a factor 1 + s.
struct ScaledDrive {
  using State = Product<SE2, Vector<1>>;
  using Control = Vector<2>;
  [[nodiscard]] State propagate(const State& x, const Control& u, double dt) const {
    const double speed = u(0) * (1 + x.part<1>()(0));
    return State(x.part<0>() * SE2::exp(Vector<3>(speed * dt, 0, u(1) * dt)), x.part<1>());
  }
  [[nodiscard]] Matrix<4> jacobian(const State& x, const Control& u, double dt) const {
    return cairn::numeric_jacobian([&](const State& s) { return propagate(s, u, dt); }, x);
  }
  [[nodiscard]] Matrix<4> noise(const State&, const Control&, double dt) const {
    return Vector<4>(0.01 * dt, 1e-4 * dt, 1e-3 * dt, 0).asDiagonal();
  }
};

/// A landmark that stands where a pose points to from another landmark.
struct Beside {
  using State = Product<Vector<2>, SE2>;
  using Measurement = Vector<2>;
  using New = Vector<2>;
  [[nodiscard]] Vector<2> initialise(const State& x, const Measurement& z) const {
    return x.part<0>() + x.part<1>().rotation() * z;
  }
  [[nodiscard]] Matrix<2, 5> jacobian(const State& x, const Measurement& z) const {
    const Vector<2> turned = x.part<1>().rotation() * z;
    Matrix<2, 5> g = Matrix<2, 5>::Zero();
    g(0, 0) = g(1, 1) = 1;
    g(0, 4) = -turned(1);
    g(1, 4) = turned(0);
    return g;
  }
  [[nodiscard]] Matrix<2> noise(const State&, const Measurement&) const {
    return 0.01 * Matrix<2>::Identity();
  }
};

}  // namespace cairn_test
