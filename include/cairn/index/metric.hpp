// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How far two points are: a sum (or maximum) over the coordinates, and a last step that makes it a distance.
///
///   distance(p, q) = restore( accumulate over axes of |p[a] - q[a]| )
///
/// What is accumulated is the *reduced* distance (for L2 the squared one); searches compare reduced
/// distances, callers only ever see true ones. Laws, for every metric: restore(reduce(d)) = d for d >= 0,
/// both grow with their argument, accumulating grows with |difference|, and true distances obey the triangle
/// inequality.
///
/// A metric whose sum is not a sum but a maximum says so: static constexpr bool additive = false. One of
/// which reduce(a b) = reduce(a) reduce(b) does not hold says homogeneous = false: it has no ratio test. One
/// whose axes may be circles has period(axis), infinite for a straight axis; one that can be set up wrongly
/// has check(dimension), which throws. Both are found in axis_metrics.hpp.
///
/// Squares of L2 and Angular are kept in the number type of distances: distances below 1e-19 (1e-154 in
/// double) lose digits to the range of that type, and below 3e-23 (2e-162) they are 0. Points that are so
/// near each other in the units of their coordinates need other units.
///
/// accumulate() is a template over the number type so that one line serves single numbers and sixteen lanes
/// alike: write it with +, *, comparisons and ?:.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What a search needs to know of a distance. `difference` is a coordinate of the query minus that of a
/// point, `axis` its number.
template <class M, class Number = float>
concept Metric = std::copy_constructible<M> &&
                 requires(const M& metric, Number sum, const Number difference, std::size_t axis) {
                   metric.accumulate(sum, difference, axis);
                   { metric.restore(sum) } noexcept -> std::convertible_to<Number>;
                   { metric.reduce(sum) } noexcept -> std::convertible_to<Number>;
                 };

/// Euclidean distance, in the units of the coordinates; reduced: its square.
struct L2 {
  template <class Number>
  [[gnu::always_inline]] static void accumulate(Number& sum, const Number& difference, std::size_t) noexcept {
    sum = sum + difference * difference;
  }
  template <std::floating_point Real>
  [[nodiscard]] static Real restore(Real reduced) noexcept {
    return std::sqrt(reduced);
  }
  template <std::floating_point Real>
  [[nodiscard]] static Real reduce(Real distance) noexcept {
    return distance * distance;
  }
};

/// Sum of the absolute differences.
struct L1 {
  template <class Number>
  [[gnu::always_inline]] static void accumulate(Number& sum, const Number& difference, std::size_t) noexcept {
    sum = sum + (difference < 0 ? -difference : difference);
  }
  template <std::floating_point Real>
  [[nodiscard]] static Real restore(Real reduced) noexcept {
    return reduced;
  }
  template <std::floating_point Real>
  [[nodiscard]] static Real reduce(Real distance) noexcept {
    return distance;
  }
};

/// Largest absolute difference.
struct LInfinity {
  static constexpr bool additive = false;

  template <class Number>
  [[gnu::always_inline]] static void accumulate(Number& sum, const Number& difference, std::size_t) noexcept {
    const Number size = difference < 0 ? -difference : difference;
    sum = sum < size ? size : sum;
  }
  template <std::floating_point Real>
  [[nodiscard]] static Real restore(Real reduced) noexcept {
    return reduced;
  }
  template <std::floating_point Real>
  [[nodiscard]] static Real reduce(Real distance) noexcept {
    return distance;
  }
};

/// Angle [rad] between unit vectors; reduced: the squared chord, (2 sin(angle / 2))^2. The points and queries
/// must have length one: the metric does not normalise them.
struct Angular {
  static constexpr bool homogeneous = false;

  template <class Number>
  [[gnu::always_inline]] static void accumulate(Number& sum, const Number& difference, std::size_t) noexcept {
    sum = sum + difference * difference;
  }
  template <std::floating_point Real>
  [[nodiscard]] static Real restore(Real reduced) noexcept {
    const Real half_chord = std::sqrt(reduced) / 2;
    return 2 * std::asin(half_chord < 1 ? half_chord : Real{1});
  }
  template <std::floating_point Real>
  [[nodiscard]] static Real reduce(Real angle) noexcept {
    const Real half = angle / 2;
    if (half >= std::asin(Real{1})) return std::numeric_limits<Real>::max();  // every direction is that near
    const Real chord = 2 * std::sin(half);
    return chord * chord;
  }
};

namespace detail {

/// Whether axes of a metric may be circles.
template <class M>
concept HasPeriods = requires(const M& metric, std::size_t axis) {
  { metric.period(axis) } -> std::convertible_to<double>;
};

/// Whether ratios of distances are ratios of reduced ones, reduced themselves.
template <class M>
inline constexpr bool is_homogeneous = !requires { requires !M::homogeneous; };

/// The numbers next to one that is not negative: floating point numbers are ordered as their bits are.
template <class Real>
[[nodiscard]] constexpr Real next_above(Real number) noexcept {
  using Bits = std::conditional_t<sizeof(Real) == 4, std::uint32_t, std::uint64_t>;
  return std::bit_cast<Real>(std::bit_cast<Bits>(number) + 1);
}
template <class Real>
[[nodiscard]] constexpr Real next_below(Real number) noexcept {
  using Bits = std::conditional_t<sizeof(Real) == 4, std::uint32_t, std::uint64_t>;
  return std::bit_cast<Real>(std::bit_cast<Bits>(number) - 1);
}

/// The largest reduced distance whose true distance is at most `distance` >= 0: what is compared with it is
/// within, to the last bit of what a search reports. reduce() alone may be a few steps off on either side.
template <class M, class Real>
[[nodiscard]] Real largest_reduced(const M& metric, Real distance) noexcept {
  constexpr Real infinity = std::numeric_limits<Real>::infinity();
  Real reduced = std::abs(static_cast<Real>(metric.reduce(distance)));  // not -0
  for (int step = 0; step < 8 && reduced > 0 && metric.restore(reduced) > distance; ++step)
    reduced = next_below(reduced);
  for (int step = 0; step < 8 && reduced < infinity; ++step) {
    const Real next = next_above(reduced);
    if (!(metric.restore(next) <= distance)) break;
    reduced = next;
  }
  return reduced;
}

/// Throws Error where the metric cannot serve points of `dim` coordinates.
template <class M>
void check_metric(const M& metric, std::size_t dim) {
  if constexpr (requires { metric.check(dim); }) metric.check(dim);
}

/// The representative in [-period / 2, period / 2) of a coordinate on a circle, exact.
template <class Real>
[[nodiscard]] Real wrap(Real coordinate, Real period) noexcept {
  const Real wrapped = std::remainder(coordinate, period);
  return 2 * wrapped == period ? -wrapped : wrapped;
}

/// Does so for the circles among the axes of a point.
template <class Real, class M>
void wrap_row(const M& metric, std::size_t dim, Real* row) noexcept {
  if constexpr (HasPeriods<M>)
    for (std::size_t a = 0; a < dim; ++a)
      if (const auto period = static_cast<Real>(metric.period(a));
          period < std::numeric_limits<Real>::infinity())
        row[a] = wrap(row[a], period);
}

template <class Scalar, class M>
[[nodiscard]] std::vector<Scalar> wrapped_rows(const M& metric, std::size_t dim, std::vector<Scalar> rows) {
  for (std::size_t i = 0; i < rows.size(); i += dim) wrap_row(metric, dim, rows.data() + i);
  return rows;
}

/// How far a query is from the side of a split on which it is not. On a circle that side also reaches the
/// seam; a few ulps are taken off, since sums there are rounded differently than distances to points.
template <class M, class Real>
[[nodiscard]] Real offset_across(const M& metric, Real query, Real value, std::size_t axis) noexcept {
  const Real direct = query - value;
  if constexpr (HasPeriods<M>) {
    const auto half = static_cast<Real>(metric.period(axis)) / 2;
    const Real slack =
        half < std::numeric_limits<Real>::infinity() ? 8 * std::numeric_limits<Real>::epsilon() * half : 0;
    const Real seam = std::max((direct < 0 ? query + half : half - query) - slack, Real{0});
    return std::min(std::abs(direct), seam);
  } else {
    return direct;
  }
}

/// Lower bound of the distance to a cell after its nearest side on one axis moved from `old` to `offset`
/// away from the query (both as differences, |offset| >= |old|). Lowered by more than the sum is rounded: a
/// point at a corner of its cell may be as near as the cell, and its distance is rounded in another order.
template <class M, class Real>
[[nodiscard]] Real moved_bound(const M& metric, Real bound, Real old, Real offset,
                               std::size_t axis) noexcept {
  Real after = 0;
  metric.accumulate(after, offset, axis);
  if constexpr (requires { requires !M::additive; }) {
    return bound < after ? after : bound;
  } else {
    Real before = 0;
    metric.accumulate(before, old, axis);
    return (bound + (after - before)) * (1 - 4 * std::numeric_limits<Real>::epsilon());
  }
}

}  // namespace detail

}}  // namespace cairn::CAIRN_ABI
