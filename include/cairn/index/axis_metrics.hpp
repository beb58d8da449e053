// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Metrics whose axes differ: weights, and circles such as angles that wrap (SO(2)).
///
/// ```cpp
/// // planar poses x, y [m], heading [rad]; half a radian counts like a metre
/// using PoseDistance = cairn::Circular<cairn::WeightedL2<3>, 3>;
/// constexpr float turn = 2 * std::numbers::pi_v<float>;
/// const PoseDistance metric{.periods = {cairn::straight, cairn::straight, turn}, .base = {{1, 1, 2}}};
/// const cairn::KdTree<float, 3, PoseDistance> tree(poses, metric);
/// ```
///
/// Weights stand inside, circles outside. A tree refuses weights, periods and dimensions that cannot be.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/index/metric.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// The number type of a number, or of each of sixteen.
template <class Number>
struct LaneOf {
  using Type = Number;
};
template <class Number>
  requires requires(const Number& numbers) { numbers[0]; }
struct LaneOf<Number> {
  using Type = std::remove_cvref_t<decltype(std::declval<const Number&>()[0])>;
};

template <class M>
inline constexpr bool is_additive = !requires { requires !M::additive; };

inline void check_axes(const char* metric, std::size_t found, std::size_t expected) {
  if (found != expected)
    raise(std::string(metric) + ": a metric of " + std::to_string(expected) + " axes for points of " +
          std::to_string(found) + " coordinates");
}

}  // namespace detail

/// Each axis' difference times its weight, then the base metric. Weights are finite and not negative; 0
/// leaves an axis out. As for coordinates, squares of weighted differences must stay finite.
template <class Base, std::size_t Dim, std::floating_point Real = float>
struct Weighted {
  static_assert(!detail::HasPeriods<Base>,
                "write Circular<Weighted<...>>: weights apply to the shorter way round");
  std::array<Real, Dim> weight;
  [[no_unique_address]] Base base{};

  static constexpr bool additive = detail::is_additive<Base>;
  static constexpr bool homogeneous = detail::is_homogeneous<Base>;

  template <class Number>
  [[gnu::always_inline]] void accumulate(Number& sum, const Number& difference,
                                         std::size_t axis) const noexcept {
    using Lane = typename detail::LaneOf<Number>::Type;
    const Number scaled = difference * static_cast<Lane>(weight[axis]);
    base.accumulate(sum, scaled, axis);
  }
  template <std::floating_point R>
  [[nodiscard]] R restore(R reduced) const noexcept {
    return base.restore(reduced);
  }
  template <std::floating_point R>
  [[nodiscard]] R reduce(R distance) const noexcept {
    return base.reduce(distance);
  }
  /// Throws Error for weights that cannot be, and points of other than Dim coordinates.
  void check(std::size_t dim) const {
    detail::check_axes("Weighted", dim, Dim);
    for (std::size_t a = 0; a < Dim; ++a)
      if (!(weight[a] >= 0 && weight[a] < std::numeric_limits<Real>::infinity()))
        raise("Weighted: weight " + std::to_string(a) + " is " + std::to_string(weight[a]) +
              ", expected a finite number that is not negative");
    detail::check_metric(base, dim);
  }
};

/// Euclidean distance with a weight for each axis: sqrt(sum of (weight[a] * difference[a])^2).
template <std::size_t Dim, std::floating_point Real = float>
using WeightedL2 = Weighted<L2, Dim, Real>;

/// Period of an axis that is no circle.
inline constexpr float straight = std::numeric_limits<float>::infinity();

/// Axes with a period: the difference of two coordinates is the shorter way round. Coordinates may be any
/// representative; a tree keeps (and for_each() shows) the one nearest zero. Floating point coordinates only.
/// Outside of an index, coordinates must be within one period of each other.
template <class Base, std::size_t Dim, std::floating_point Real = float>
struct Circular {
  std::array<Real, Dim> periods;  ///< > 0, in the unit of the coordinate; `straight` for an ordinary axis
  [[no_unique_address]] Base base{};

  static constexpr bool additive = detail::is_additive<Base>;
  static constexpr bool homogeneous = detail::is_homogeneous<Base>;

  [[nodiscard]] Real period(std::size_t axis) const noexcept { return periods[axis]; }

  template <class Number>
  [[gnu::always_inline]] void accumulate(Number& sum, const Number& difference,
                                         std::size_t axis) const noexcept {
    using Lane = typename detail::LaneOf<Number>::Type;
    const Number one_way = difference < 0 ? -difference : difference;
    const Number other_way = static_cast<Lane>(periods[axis]) - one_way;
    const Number shorter = other_way < one_way ? other_way : one_way;
    base.accumulate(sum, shorter, axis);
  }
  template <std::floating_point R>
  [[nodiscard]] R restore(R reduced) const noexcept {
    return base.restore(reduced);
  }
  template <std::floating_point R>
  [[nodiscard]] R reduce(R distance) const noexcept {
    return base.reduce(distance);
  }
  /// Throws Error for periods that cannot be, and points of other than Dim coordinates.
  void check(std::size_t dim) const {
    detail::check_axes("Circular", dim, Dim);
    for (std::size_t a = 0; a < Dim; ++a)
      if (!(periods[a] > 0))
        raise("Circular: period " + std::to_string(a) + " is " + std::to_string(periods[a]) +
              ", expected a positive number, or cairn::straight");
    detail::check_metric(base, dim);
  }
};

}}  // namespace cairn::CAIRN_ABI
