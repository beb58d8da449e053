// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What may be put into an index: anything with size() and [i] that gives something with [axis].
///
/// std::vector<std::array<float, 3>>, C arrays, std::vector<Eigen::Vector3d>, spans and foreign point types
/// with operator[] all qualify as they are. Rows views flat memory as points, so also the columns of an Eigen
/// matrix; Through views points that have no operator[]. None of them copies.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>

namespace cairn::inline CAIRN_ABI {

/// Dimension that is known at run time only.
inline constexpr std::size_t dynamic_dim = 0;

/// Something with numbered coordinates.
template <class P>
concept Point = requires(const P& point, int axis) {
  { point[axis] } -> std::convertible_to<double>;
};

/// A numbered set of points. Indices must stay valid while the set is read.
template <class S>
concept PointSet = requires(const S& set, std::size_t i) {
  { set.size() } -> std::convertible_to<std::size_t>;
  { set[i] };
  requires Point<std::remove_cvref_t<decltype(set[i])>>;
};

/// Flat memory seen as points: `dim` numbers each, one after the other.
template <class Scalar>
class Rows {
public:
  /// Throws Error unless `dim` > 0 divides the count of numbers.
  Rows(std::span<const Scalar> numbers, std::size_t dim) : numbers_(numbers), dim_(dim) {
    if (dim == 0) raise("Rows: a point needs at least one coordinate, got dimension 0");
    if (numbers.size() % dim != 0)
      raise("Rows: " + std::to_string(numbers.size()) + " numbers are not a whole number of points of " +
            std::to_string(dim));
  }

  [[nodiscard]] std::size_t size() const noexcept { return numbers_.size() / dim_; }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  [[nodiscard]] std::span<const Scalar> operator[](std::size_t i) const noexcept {
    return numbers_.subspan(i * dim_, dim_);
  }

private:
  std::span<const Scalar> numbers_;
  std::size_t dim_;
};

/// A set of points seen through a function that gives their coordinates:
///
/// ```cpp
/// const auto coordinate = [](const Foreign& p, std::size_t axis) {
///   return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
/// };
/// const cairn::Through points(cloud, 3, coordinate);
/// ```
///
/// Refers to the set, which must live as long.
template <class Set, class Coordinate>
class Through {
public:
  /// One point, seen so; valid as long as the set's point is.
  class View {
  public:
    using size_type = std::size_t;
    [[nodiscard]] auto operator[](std::size_t axis) const { return (*coordinate_)((*set_)[i_], axis); }

  private:
    friend class Through;
    View(const Set* set, std::size_t i, const Coordinate* coordinate)
        : set_(set), i_(i), coordinate_(coordinate) {}
    const Set* set_;
    std::size_t i_;
    const Coordinate* coordinate_;
  };

  /// `coordinate(point, axis)` for axis < `dim`. Throws Error for dimension 0.
  Through(const Set& set, std::size_t dim, Coordinate coordinate)
      : set_(&set), dim_(dim), coordinate_(std::move(coordinate)) {
    if (dim == 0) raise("Through: a point needs at least one coordinate, got dimension 0");
  }

  [[nodiscard]] std::size_t size() const noexcept { return static_cast<std::size_t>(set_->size()); }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  [[nodiscard]] View operator[](std::size_t i) const { return View(set_, i, &coordinate_); }

private:
  const Set* set_;
  std::size_t dim_;
  Coordinate coordinate_;
};

namespace detail {

/// Coordinates of any Point type; the index type is chosen so that no container warns.
template <class Scalar, Point P>
[[gnu::always_inline]] inline Scalar coordinate(const P& point, std::size_t axis) {
  if constexpr (requires { requires std::unsigned_integral<typename P::size_type>; })
    return static_cast<Scalar>(point[static_cast<typename P::size_type>(axis)]);
  else if constexpr (std::is_pointer_v<P> || std::is_array_v<P>)
    return static_cast<Scalar>(point[axis]);
  else
    return static_cast<Scalar>(point[static_cast<int>(axis)]);
}

/// Number of coordinates of a point that knows it; `otherwise` for pointers and such.
template <Point P>
[[nodiscard]] std::size_t size_of_point(const P& point, std::size_t otherwise) {
  if constexpr (requires { point.size(); })
    return static_cast<std::size_t>(point.size());
  else if constexpr (std::is_array_v<P>)
    return std::extent_v<P>;
  else
    return otherwise;
}

/// Largest size of a coordinate whose reduced distances surely stay finite: differences of two such numbers,
/// squared and summed over up to 2^16 axes.
template <class Real>
[[nodiscard]] constexpr Real largest_coordinate() noexcept {
  return sizeof(Real) == 4 ? static_cast<Real>(3e16) : static_cast<Real>(1e150);
}

/// Where a point entered, for the message of a refusal.
struct PointPlace {
  const char* what;  ///< such as "KdTree: point"
  std::size_t index;
};

/// Copies the coordinates of `point` to `row`; throws Error, naming point and axis, where one is not a finite
/// number of usable size or the count is not `dim`.
template <class Scalar, Point P>
void copy_point(const P& point, std::size_t dim, Scalar* row, const PointPlace& entry) {
  const auto where = [&] { return std::string(entry.what) + " " + std::to_string(entry.index); };
  if (const std::size_t size = size_of_point(point, dim); size != dim) [[unlikely]]
    raise(where() + " has " + std::to_string(size) + " coordinates, expected " + std::to_string(dim));
  bool usable = true;
  for (std::size_t axis = 0; axis < dim; ++axis) {
    row[axis] = coordinate<Scalar>(point, axis);
    if constexpr (std::floating_point<Scalar>)
      usable &= std::abs(row[axis]) <= largest_coordinate<Scalar>();  // false for NaN
  }
  if (usable) [[likely]]
    return;
  for (std::size_t axis = 0; axis < dim; ++axis)
    if (!(std::abs(static_cast<double>(row[axis])) <= static_cast<double>(largest_coordinate<Scalar>())))
      raise(where() + ", coordinate " + std::to_string(axis) + " is " +
            std::to_string(static_cast<double>(row[axis])) +
            ", expected a finite number whose squared differences stay finite");
}

/// Dimension of a point set: Dim where fixed, otherwise the size of its first point.
template <std::size_t Dim, PointSet Points>
[[nodiscard]] std::size_t dimension_of(const Points& points) {
  if constexpr (Dim != dynamic_dim) return Dim;
  if constexpr (requires { points.dimension(); }) return static_cast<std::size_t>(points.dimension());
  return points.size() == 0 ? 0 : size_of_point(points[0], 0);
}

/// Throws Error where there are more points than ids.
inline void check_count(std::size_t count, const char* what) {
  if (count >= 0xffffffffULL)
    raise(std::string(what) + ": at most 2^32 - 2 points can be numbered, got " + std::to_string(count));
}

/// All points as rows of `dim` numbers, checked.
template <class Scalar, PointSet Points>
[[nodiscard]] std::vector<Scalar> copy_points(const Points& points, std::size_t dim, const char* what) {
  const auto count = static_cast<std::size_t>(points.size());
  check_count(count, what);
  if (count > 0 && dim == 0) raise(std::string(what) + ": a point needs at least one coordinate");
  std::vector<Scalar> rows(count * dim);
  for (std::size_t i = 0; i < count; ++i)
    copy_point<Scalar>(points[i], dim, rows.data() + i * dim, PointPlace{what, i});
  return rows;
}

}  // namespace detail

}  // namespace cairn::inline CAIRN_ABI
