// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The models of correlation navigation: how the vehicle moves and where its sensor's frame lies.
///
///   along track   X = [x, V, L_x, L_y, psi]              the founding document's state: flight along x
///   in the plane  X = [x, y, v_x, v_y, L_x, L_y, psi]    any flight; (v_x, v_y) is what dead reckoning
///   misses
///
/// L_x, L_y are the true distances between samples, unknown because height and attitude are not exact; psi
/// is the error of the heading. A placement maps a state to a PatchPlacement and gives its derivative:
///   d(x, y, along_x, along_y, across_x, across_y) / dX, a 6 x n matrix J.
/// With w = (f_x, f_y, a f_x, a f_y, b f_x, b f_y) of sample (a, b) the row of the measurement's Jacobian is
/// w J: whatever the state, a frame is linearised by the same six numbers a sample.
///
/// One placement serves every filter: PatchFilter directly, and through PatchSensor the filters of filter/.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// Stands for a matrix of 6 x N whose sizes are fixed.
template <class A, int N>
concept PlacementJacobian = MatrixOf<A, 6, N> && ShapeOf<std::remove_cvref_t<A>>::rows == 6 &&
                            ShapeOf<std::remove_cvref_t<A>>::columns == N;

}  // namespace detail

/// A state (a vector of fixed size) that says where the frame lies, and how that changes with the state.
template <class P>
concept FramePlacement = requires(const P& p, const typename P::State& x) {
  { p.placement(x) } -> std::convertible_to<PatchPlacement>;
  { p.jacobian(x) } -> detail::PlacementJacobian<P::State::RowsAtCompileTime>;
};

namespace detail {

template <class A, class B>
inline constexpr bool same_fixed_size = false;
template <int R, int C, class S>
inline constexpr bool same_fixed_size<Expected<R, C, S>, Found<R, C, S>> = true;

template <class Expected, class Found>
struct JacobianOfPlacementHas {
  static_assert(
      same_fixed_size<Expected, Found>,
      "cairn: jacobian(x) of a placement maps steps of its State to the six numbers of a placement, "
      "its sizes fixed; Expected<rows, columns, number type> and Found<...> say what it has to be "
      "and what it is");
};

/// False, for a FramePlacement that is; or the sentence about the size that is wrong.
template <class P>
inline constexpr bool explain_placement = [] {
  if constexpr (requires(const P& p, const typename P::State& x) { p.jacobian(x); }) {
    using A = std::remove_cvref_t<decltype(std::declval<const P&>().jacobian(
        std::declval<const typename P::State&>()))>;
    if constexpr (requires { typename FoundIn<A>; })
      if constexpr (!PlacementJacobian<A, P::State::RowsAtCompileTime>)
        static_cast<void>(
            sizeof(JacobianOfPlacementHas<Expected<6, P::State::RowsAtCompileTime, double>, FoundIn<A>>));
  }
  return false;
}();

}  // namespace detail

/// Spectral densities of the white noises that drive the states; zero for constants.
struct TrackNoise {
  double velocity = 0;  ///< [m^2/s^3]
  double scale = 0;     ///< [m^2/s]
  double heading = 0;   ///< [rad^2/s]
};

/// x' = V; V, L_x, L_y, psi constant but for their noise.
struct AlongTrackMotion {
  using State = Vector<5>;
  using Control = NoControl;
  static constexpr bool linear = true;
  TrackNoise density{};

  // In continuous time (ContinuousProcess of filter/kalman_bucy.hpp).
  [[nodiscard]] State rate(const State& x, const Control&) const {
    State result = State::Zero();
    result(0) = x(1);
    return result;
  }
  [[nodiscard]] Matrix<5> rate_jacobian(const State&, const Control&) const {
    Matrix<5> F = Matrix<5>::Zero();
    F(0, 1) = 1.0;
    return F;
  }
  [[nodiscard]] Matrix<5> spectral_density(const State&, const Control&) const {
    Matrix<5> Q = Matrix<5>::Zero();
    Q(1, 1) = density.velocity;
    Q(2, 2) = Q(3, 3) = density.scale;
    Q(4, 4) = density.heading;
    return Q;
  }

  [[nodiscard]] State propagate(const State& x, const Control&, double dt) const {
    State next = x;
    next(0) += x(1) * dt;
    return next;
  }
  [[nodiscard]] Matrix<5> jacobian(const State&, const Control&, double dt) const {
    Matrix<5> F = Matrix<5>::Identity();
    F(0, 1) = dt;
    return F;
  }
  [[nodiscard]] Matrix<5> noise(const State&, const Control&, double dt) const {
    Matrix<5> Q = Matrix<5>::Zero();
    Q(0, 0) = density.velocity * dt * dt * dt / 3.0;
    Q(0, 1) = Q(1, 0) = density.velocity * dt * dt / 2.0;
    Q(1, 1) = density.velocity * dt;
    Q(2, 2) = Q(3, 3) = density.scale * dt;
    Q(4, 4) = density.heading * dt;
    return Q;
  }
};

/// (x, y)' = u + (v_x, v_y) with the dead-reckoned ground velocity u as control.
struct PlanarMotion {
  using State = Vector<7>;
  using Control = Vector<2>;
  static constexpr bool linear = true;
  TrackNoise density{};

  // In continuous time.
  [[nodiscard]] State rate(const State& x, const Control& u) const {
    State result = State::Zero();
    for (int i = 0; i < 2; ++i) result(i) = u(i) + x(i + 2);
    return result;
  }
  [[nodiscard]] Matrix<7> rate_jacobian(const State&, const Control&) const {
    Matrix<7> F = Matrix<7>::Zero();
    F(0, 2) = F(1, 3) = 1.0;
    return F;
  }
  [[nodiscard]] Matrix<7> spectral_density(const State&, const Control&) const {
    Matrix<7> Q = Matrix<7>::Zero();
    Q(2, 2) = Q(3, 3) = density.velocity;
    Q(4, 4) = Q(5, 5) = density.scale;
    Q(6, 6) = density.heading;
    return Q;
  }

  [[nodiscard]] State propagate(const State& x, const Control& u, double dt) const {
    State next = x;
    for (int i = 0; i < 2; ++i) next(i) += (u(i) + x(i + 2)) * dt;
    return next;
  }
  [[nodiscard]] Matrix<7> jacobian(const State&, const Control&, double dt) const {
    Matrix<7> F = Matrix<7>::Identity();
    F(0, 2) = F(1, 3) = dt;
    return F;
  }
  [[nodiscard]] Matrix<7> noise(const State&, const Control&, double dt) const {
    Matrix<7> Q = Matrix<7>::Zero();
    for (int i = 0; i < 2; ++i) {
      Q(i, i) = density.velocity * dt * dt * dt / 3.0;
      Q(i, i + 2) = Q(i + 2, i) = density.velocity * dt * dt / 2.0;
      Q(i + 2, i + 2) = density.velocity * dt;
    }
    Q(4, 4) = Q(5, 5) = density.scale * dt;
    Q(6, 6) = density.heading * dt;
    return Q;
  }
};

/// The document's placement, for small psi: sample (a, b) lies at (x + a L_x - b L_y psi, y + a L_x psi +
/// b L_y), on a flight along x at a known y.
struct AlongTrackPlacement {
  using State = Vector<5>;
  double y = 0;  ///< [m]

  [[nodiscard]] PatchPlacement placement(const State& x) const {
    return {x(0), y, x(2), x(2) * x(4), -x(3) * x(4), x(3)};
  }
  [[nodiscard]] Matrix<6, 5> jacobian(const State& x) const {
    Matrix<6, 5> J = Matrix<6, 5>::Zero();
    J(0, 0) = 1.0;
    J(2, 2) = 1.0;
    J(3, 2) = x(4);
    J(3, 4) = x(2);
    J(4, 3) = -x(4);
    J(4, 4) = -x(3);
    J(5, 3) = 1.0;
    return J;
  }
};

/// Any flight: the frame is turned by the heading that the vehicle believes in plus the error psi.
struct PlanarPlacement {
  using State = Vector<7>;
  double heading = 0;  ///< believed, from the x axis [rad]

  [[nodiscard]] PatchPlacement placement(const State& x) const {
    return PatchPlacement::of(x(0), x(1), x(4), x(5), heading + x(6));
  }
  [[nodiscard]] Matrix<6, 7> jacobian(const State& x) const {
    const double c = std::cos(heading + x(6)), s = std::sin(heading + x(6));
    Matrix<6, 7> J = Matrix<6, 7>::Zero();
    J(0, 0) = J(1, 1) = 1.0;
    J(2, 4) = c;
    J(3, 4) = s;
    J(4, 5) = -s;
    J(5, 5) = c;
    J(2, 6) = -x(4) * s;
    J(3, 6) = x(4) * c;
    J(4, 6) = -x(5) * c;
    J(5, 6) = -x(5) * s;
    return J;
  }
};

/// A frame as a measurement of filter/: one number a sample, white noise. A sample outside the map predicts
/// NaN, which those filters refuse (Status::not_finite) without touching the belief; PatchFilter drops such
/// samples instead. Their update costs O(q^3) for q samples: for small frames and for comparison.
template <class Placement, FieldInterpolant Map>
  requires(FramePlacement<Placement> || detail::explain_placement<Placement>)
struct PatchSensor {
  using State = typename Placement::State;
  using Measurement = Vector<dynamic>;
  Placement where;
  const Map* map;
  PatchShape shape;
  double variance;  ///< of each sample's noise

  [[nodiscard]] Measurement predict(const State& x) const {
    PatchSamples f;
    sample_patch(*map, shape, where.placement(x), f);
    Measurement z(static_cast<Eigen::Index>(shape.size()));
    for (std::size_t i = 0; i < shape.size(); ++i)
      z(static_cast<Eigen::Index>(i)) =
          f.inside[i] != 0 ? f.value[i] : std::numeric_limits<double>::quiet_NaN();
    return z;
  }
  [[nodiscard]] Matrix<dynamic, State::RowsAtCompileTime> jacobian(const State& x) const {
    PatchSamples f;
    sample_patch(*map, shape, where.placement(x), f);
    constexpr int n = State::RowsAtCompileTime;
    const Matrix<6, n> J = detail::plain_copy<6, n, double>(where.jacobian(x));
    Matrix<dynamic, n> H(static_cast<Eigen::Index>(shape.size()), n);
    for (std::size_t i = 0; i < shape.size(); ++i) {
      const double a = shape.a(i), b = shape.b(i), fx = f.dx[i], fy = f.dy[i];
      for (int j = 0; j < n; ++j)
        H(static_cast<Eigen::Index>(i), j) =
            fx * (J(0, j) + a * J(2, j) + b * J(4, j)) + fy * (J(1, j) + a * J(3, j) + b * J(5, j));
    }
    return H;
  }
  [[nodiscard]] Matrix<dynamic> noise(const State&) const {
    const auto q = static_cast<Eigen::Index>(shape.size());
    Matrix<dynamic> R = Matrix<dynamic>::Zero(q, q);
    for (Eigen::Index i = 0; i < q; ++i) R(i, i) = variance;
    return R;
  }
};

}}  // namespace cairn::CAIRN_ABI
