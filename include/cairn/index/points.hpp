// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What may be put into an index: anything with size() and [i] that gives something with [axis].
///
/// std::vector<std::array<float, 3>>, C arrays, std::vector<Eigen::Vector3d>, spans and foreign point types
/// with operator[] all qualify as they are. Rows views flat memory as points, one after the other; rows_of()
/// and columns_of() view a matrix, Strided any memory with even steps, Through points that have no
/// operator[]. None of them copies, so what they view must outlive them.
///
/// An index keeps coordinates as float, as double, or as whole numbers of up to four bytes, and rounds what
/// it is given to the nearest float or double; a whole number must be given as one. A query is never rounded
/// to the coordinate type, only to that of distances (float for float and for whole numbers of up to two
/// bytes, otherwise double): among bytes a query may be 300.7 or -5.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/sizes.hpp>

namespace cairn { inline namespace CAIRN_ABI {

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

namespace detail {

/// Ends in the sentence, which names the type of the points.
template <class P>
struct PointHasBrackets {
  static_assert(
      Point<P>,
      "cairn: a point needs [axis] that gives a number; cairn::Through sees a set of points without "
      "it: Through(points, 3, [](const P& p, std::size_t axis) { return axis == 0 ? p.x : ...; })");
};

/// The same of numbers.
template <class P>
struct PointIsNoNumber {
  static_assert(
      !std::is_arithmetic_v<P>,
      "cairn: a set of points is asked for, and [i] of this is a number. Of a matrix, rows_of(m) or "
      "columns_of(m) says which are the points; of flat memory, Rows(numbers, 3); one point alone "
      "is std::array{point}");
};

/// Ends in the sentence, which names the type of the query.
template <class Q>
struct QueryHasBrackets {
  static_assert(
      Point<Q>,
      "cairn: a query needs [axis] that gives a number, as std::array{q.x, q.y} has; cairn::Through "
      "sees a set of points without it");
};

/// False, after the sentence: of what is asked for and is no point.
template <class Q>
inline constexpr bool explain_query = (static_cast<void>(sizeof(QueryHasBrackets<Q>)), false);

/// False; or, of a container of what is no point, the sentence. Stands where a set is asked for:
/// `PointSet<S> || detail::explain_points<S>`.
template <class S>
inline constexpr bool explain_points = [] {
  if constexpr (requires(const S& set, std::size_t i) {
                  { set.size() } -> std::convertible_to<std::size_t>;
                  set[i];
                }) {
    using P = std::remove_cvref_t<decltype(std::declval<const S&>()[0])>;
    if constexpr (std::is_arithmetic_v<P>)
      static_cast<void>(sizeof(PointIsNoNumber<P>));
    else
      static_cast<void>(sizeof(PointHasBrackets<P>));
  }
  return false;
}();

/// A matrix in memory: an Eigen matrix, map, block or transpose, or whatever else has these members.
template <class Matrix>
concept MatrixInMemory = requires(const Matrix& matrix) {
  { *matrix.data() } -> std::convertible_to<double>;
  { matrix.rows() } -> std::convertible_to<std::ptrdiff_t>;
  { matrix.cols() } -> std::convertible_to<std::ptrdiff_t>;
  { matrix.rowStride() } -> std::convertible_to<std::ptrdiff_t>;
  { matrix.colStride() } -> std::convertible_to<std::ptrdiff_t>;
};

/// Whether the numbers go when it goes: Eigen's maps, blocks and transposes hold somebody else's.
template <class Matrix>
inline constexpr bool owns_memory = true;
template <class Matrix>
  requires requires { typename Matrix::PlainObject; }
inline constexpr bool owns_memory<Matrix> = std::is_same_v<Matrix, typename Matrix::PlainObject>;

template <class Matrix>
concept MatrixThatStays = MatrixInMemory<std::remove_cvref_t<Matrix>> &&
                          (std::is_lvalue_reference_v<Matrix> || !owns_memory<std::remove_cvref_t<Matrix>>);
/// A temporary that owns its numbers, or an expression of Eigen's that has none.
template <class Matrix>
concept MatrixThatGoes =
    !MatrixThatStays<Matrix> && requires { typename std::remove_cvref_t<Matrix>::PlainObject; };

}  // namespace detail

/// What is asked for: a point. Of anything else the sentence ends the compilation, so that this is for the
/// functions of an index, not for asking whether a type is a point.
template <class Q>
concept QueryPoint = Point<Q> || detail::explain_query<Q>;
/// The same of a set of them.
template <class S>
concept QueryPoints = PointSet<S> || detail::explain_points<S>;

/// Flat memory seen as points: `dim` numbers each, one after the other. A temporary that owns its numbers is
/// refused. The rows or the columns of a matrix
/// lie so in one of its two layouts only: rows_of() and columns_of() see them in both.
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
  template <detail::MatrixInMemory Matrix>
  Rows(const Matrix&,
       std::size_t) = delete;  ///< rows_of(matrix) or columns_of(matrix) says which are the points
  template <detail::MatrixInMemory Matrix>
  explicit Rows(const Matrix&) = delete;  ///< the same
  template <class Owner>
    requires(!std::is_lvalue_reference_v<Owner> && !detail::MatrixInMemory<Owner> &&
             std::convertible_to<Owner, std::span<const Scalar>> &&
             !std::ranges::enable_borrowed_range<std::remove_cv_t<Owner>>)
  Rows(Owner&&, std::size_t) = delete;  ///< a temporary: gone before it is read, give it a name

  [[nodiscard]] std::size_t size() const noexcept { return numbers_.size() / dim_; }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  [[nodiscard]] std::span<const Scalar> operator[](std::size_t i) const noexcept {
    return numbers_.subspan(i * dim_, dim_);
  }

private:
  std::span<const Scalar> numbers_;
  std::size_t dim_;
};
/// Of a vector, an array, a span: the scalar is that of its numbers.
template <std::ranges::contiguous_range Numbers>
  requires(!detail::MatrixInMemory<std::remove_cvref_t<Numbers>> &&
           std::is_arithmetic_v<std::ranges::range_value_t<Numbers>>)
Rows(Numbers&&, std::size_t) -> Rows<std::ranges::range_value_t<Numbers>>;

/// Memory seen as points that lie at even steps: coordinate a of point i is first[i point_step + a
/// axis_step].
template <class Scalar>
class Strided {
public:
  /// One point.
  class View {
  public:
    using size_type = std::size_t;
    [[nodiscard]] std::size_t size() const noexcept { return dim_; }
    [[nodiscard]] const Scalar& operator[](std::size_t axis) const noexcept {
      return first_[static_cast<std::ptrdiff_t>(axis) * step_];
    }

  private:
    friend class Strided;
    View(const Scalar* first, std::size_t dim, std::ptrdiff_t step) : first_(first), dim_(dim), step_(step) {}
    const Scalar* first_;
    std::size_t dim_;
    std::ptrdiff_t step_;
  };

  /// `count` points of `dim` numbers; steps are counted in numbers and may be negative. Throws Error for
  /// dimension 0.
  Strided(const Scalar* first, std::size_t count, std::size_t dim, std::ptrdiff_t point_step,
          std::ptrdiff_t axis_step)
      : first_(first), count_(count), dim_(dim), point_step_(point_step), axis_step_(axis_step) {
    if (dim == 0) raise("Strided: a point needs at least one coordinate, got dimension 0");
  }

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  [[nodiscard]] View operator[](std::size_t i) const noexcept {
    return View(first_ + static_cast<std::ptrdiff_t>(i) * point_step_, dim_, axis_step_);
  }

private:
  const Scalar* first_;
  std::size_t count_;
  std::size_t dim_;
  std::ptrdiff_t point_step_;
  std::ptrdiff_t axis_step_;
};

/// The rows of a matrix as points, whichever way it lies in memory: an N x 3 Eigen matrix is N points of
/// three numbers. Refers to the numbers of the matrix; a temporary that owns them is refused. Throws Error
/// where it has no columns.
template <detail::MatrixThatStays Matrix>
[[nodiscard]] auto rows_of(Matrix&& matrix) {
  return Strided(matrix.data(), static_cast<std::size_t>(matrix.rows()),
                 static_cast<std::size_t>(matrix.cols()), std::ptrdiff_t{matrix.rowStride()},
                 std::ptrdiff_t{matrix.colStride()});
}

template <detail::MatrixThatGoes Matrix>
void rows_of(Matrix&&) = delete;  ///< a temporary or an expression: no numbers that stay; give it a name
template <detail::MatrixThatGoes Matrix>
void columns_of(Matrix&&) = delete;  ///< a temporary or an expression: no numbers that stay; give it a name

/// The columns of a matrix as points: a 3 x N Eigen matrix is N points of three numbers. Otherwise as
/// rows_of().
template <detail::MatrixThatStays Matrix>
[[nodiscard]] auto columns_of(Matrix&& matrix) {
  return Strided(matrix.data(), static_cast<std::size_t>(matrix.cols()),
                 static_cast<std::size_t>(matrix.rows()), std::ptrdiff_t{matrix.colStride()},
                 std::ptrdiff_t{matrix.rowStride()});
}

/// A set of points seen through a function that gives their coordinates:
///
/// ```cpp
/// const auto coordinate = [](const Foreign& p, std::size_t axis) {
///   return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
/// };
/// const cairn::Through points(cloud, 3, coordinate);
/// ```
///
/// Refers to the set, which must live as long: a temporary is refused.
template <class Set, class Coordinate>
class Through {
public:
  /// One point, seen so; valid as long as the set's point is.
  class View {
  public:
    using size_type = std::size_t;
    [[nodiscard]] std::size_t size() const noexcept { return dim_; }
    [[nodiscard]] auto operator[](std::size_t axis) const { return (*coordinate_)((*set_)[i_], axis); }

  private:
    friend class Through;
    View(const Set* set, std::size_t i, std::size_t dim, const Coordinate* coordinate)
        : set_(set), i_(i), dim_(dim), coordinate_(coordinate) {}
    const Set* set_;
    std::size_t i_;
    std::size_t dim_;
    const Coordinate* coordinate_;
  };

  /// `coordinate(point, axis)` for axis < `dim`. Throws Error for dimension 0.
  Through(const Set& set, std::size_t dim, Coordinate coordinate)
      : set_(&set), dim_(dim), coordinate_(std::move(coordinate)) {
    if (dim == 0) raise("Through: a point needs at least one coordinate, got dimension 0");
  }
  Through(const Set&&, std::size_t, Coordinate) = delete;  ///< would be gone

  [[nodiscard]] std::size_t size() const noexcept { return static_cast<std::size_t>(set_->size()); }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  [[nodiscard]] View operator[](std::size_t i) const& { return View(set_, i, dim_, &coordinate_); }
  View operator[](std::size_t) const&& = delete;  ///< the view would refer to what is gone

private:
  const Set* set_;
  std::size_t dim_;
  Coordinate coordinate_;
};

namespace detail {

/// What stands at an axis of any Point type; the index type is chosen so that no container warns.
template <Point P>
[[gnu::always_inline]] inline auto number_at(const P& point, std::size_t axis) {
  if constexpr (requires { requires std::unsigned_integral<typename P::size_type>; })
    return point[static_cast<typename P::size_type>(axis)];
  else if constexpr (std::is_pointer_v<P> || std::is_array_v<P>)
    return point[axis];
  else
    return point[static_cast<int>(axis)];
}

/// The same as a Scalar.
template <std::floating_point Scalar, Point P>
[[gnu::always_inline]] inline Scalar coordinate(const P& point, std::size_t axis) {
  return static_cast<Scalar>(number_at(point, axis));
}

/// The types that an index can keep coordinates in.
template <class Scalar>
inline constexpr bool is_coordinate =
    std::is_same_v<Scalar, float> || std::is_same_v<Scalar, double> ||
    (std::is_integral_v<Scalar> && !std::is_same_v<Scalar, bool> && sizeof(Scalar) <= 4);

/// The one that holds what a set's points give: theirs, or double where none is as wide.
template <class Number>
using CoordinateFor = std::conditional_t<is_coordinate<Number>, Number, double>;
template <PointSet Points>
using CoordinateOf =
    CoordinateFor<std::remove_cvref_t<decltype(number_at(std::declval<const Points&>()[0], 0))>>;

/// Whether a number of any type is one of those of a Scalar.
template <std::integral Scalar, class Number>
[[nodiscard]] constexpr bool is_whole(const Number& number) noexcept {
  constexpr Scalar lowest = std::numeric_limits<Scalar>::min();
  constexpr Scalar highest = std::numeric_limits<Scalar>::max();
  if constexpr (std::is_unsigned_v<Number>) {
    return number <= static_cast<std::make_unsigned_t<Scalar>>(highest);
  } else if constexpr (std::is_integral_v<Number>) {
    return static_cast<long long>(number) >= static_cast<long long>(lowest) &&
           static_cast<long long>(number) <= static_cast<long long>(highest);
  } else {
    const auto real =
        static_cast<std::conditional_t<std::is_same_v<Number, long double>, Number, double>>(number);
    return real >= lowest && real <= highest && real == static_cast<Scalar>(real);  // false for NaN
  }
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

/// The refusals of copy_point, out of line: compiled once, whatever the points are.
[[noreturn, gnu::cold, gnu::noinline]] inline void refuse_dimension(const PointPlace& entry,
                                                                    std::size_t found, std::size_t expected) {
  raise(std::string(entry.what) + " " + std::to_string(entry.index) + " has " + std::to_string(found) +
        " coordinates, expected " + std::to_string(expected));
}
[[noreturn, gnu::cold, gnu::noinline]] inline void refuse_coordinate(const PointPlace& entry,
                                                                     std::size_t axis, double found,
                                                                     const std::string& expected) {
  raise(std::string(entry.what) + " " + std::to_string(entry.index) + ", coordinate " + std::to_string(axis) +
        " is " + std::to_string(found) + ", expected " + expected);
}

/// What a coordinate must be, for the message of a refusal.
template <class Scalar>
[[nodiscard, gnu::cold, gnu::noinline]] std::string usable_coordinates() {
  if constexpr (std::integral<Scalar>)
    return "a whole number from " + std::to_string(std::numeric_limits<Scalar>::min()) + " to " +
           std::to_string(std::numeric_limits<Scalar>::max());
  else
    return "a finite number whose squared differences stay finite";
}

/// The number as a Scalar; `usable`, 1 before, becomes 0 where it cannot be one. Of a number as wide as a
/// float, not a bool: compilers then look at many coordinates side by side.
template <class Scalar, class Number>
[[gnu::always_inline]] inline Scalar to_coordinate(const Number& number, std::int32_t& usable) {
  if constexpr (std::floating_point<Scalar>) {
    const auto kept = static_cast<Scalar>(number);
    usable &= std::abs(kept) <= largest_coordinate<Scalar>() ? 1 : 0;  // 0 for NaN
    return kept;
  } else {
    const bool whole = is_whole<Scalar>(number);
    usable &= whole ? 1 : 0;
    return whole ? static_cast<Scalar>(number) : Scalar{};
  }
}

/// Copies the coordinates of `point` to `row`; throws Error, naming point and axis, where one is not a finite
/// number of usable size (for whole Scalars: not one of theirs) or the count is not `dim`.
template <class Scalar, Point P>
void copy_point(const P& point, std::size_t dim, Scalar* row, const PointPlace& entry) {
  if (const std::size_t size = size_of_point(point, dim); size != dim) [[unlikely]]
    refuse_dimension(entry, size, dim);
  std::int32_t usable = 1;
  for (std::size_t axis = 0; axis < dim; ++axis)
    row[axis] = to_coordinate<Scalar>(number_at(point, axis), usable);
  if (usable != 0) [[likely]]
    return;
  for (std::size_t axis = 0; axis < dim; ++axis) {
    std::int32_t good = 1;
    static_cast<void>(to_coordinate<Scalar>(number_at(point, axis), good));
    if (good == 0)
      refuse_coordinate(entry, axis, static_cast<double>(number_at(point, axis)),
                        usable_coordinates<Scalar>());
  }
}

/// Throws Error, naming point and axis, where a number among rows of `dim` is none that a point may have.
template <class Scalar>
void check_rows(const std::vector<Scalar>& rows, std::size_t dim, const char* what) {
  std::vector<Scalar> row(dim);
  for (std::size_t i = 0; i < rows.size() / dim; ++i)
    copy_point(std::span<const Scalar>(rows.data() + i * dim, dim), dim, row.data(), PointPlace{what, i});
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
  std::vector<Scalar> rows(room_for(count, dim, what));
  for (std::size_t i = 0; i < count; ++i)
    copy_point<Scalar>(points[i], dim, rows.data() + i * dim, PointPlace{what, i});
  return rows;
}

}  // namespace detail

}}  // namespace cairn::CAIRN_ABI
