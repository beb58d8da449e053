// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a model may return where a matrix or a vector is asked for: whatever stands for one.
///
///   MatrixOf<A, 2, 3>   a Structured of 2 x 3, or anything of Eigen's (row-major, Map, Block, transposed,
///                       diagonal, expression, aligned or not) of 2 rows and 3 columns of double
/// A size known at run time stands for every size; the filters compare it and refuse what does not fit with
/// Status::size_mismatch. They make a plain column-major matrix of what they are given once, where it enters
/// (plain_model.hpp), and nothing where it is one already; a Structured keeps its zeros.
#pragma once

#include <concepts>
#include <limits>
#include <type_traits>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

template <class D>
std::type_identity<D> of_eigen(const Eigen::EigenBase<D>&);

/// A matrix, vector or expression of Eigen's, or derived from one.
template <class A>
concept OfEigen = requires(const A& a) { detail::of_eigen(a); };

/// Rows, columns (cairn::dynamic for run-time sizes) and number type of what stands for a matrix.
template <class A>
struct ShapeOf {};
template <Pattern P, class S>
struct ShapeOf<Structured<P, S>> {
  using Scalar = S;
  static constexpr int rows = P.rows();
  static constexpr int columns = P.columns();
};
template <OfEigen A>
struct ShapeOf<A> {
  using Type = typename decltype(detail::of_eigen(std::declval<const A&>()))::type;
  using Scalar = typename Type::Scalar;
  static constexpr int rows = Type::RowsAtCompileTime;
  static constexpr int columns = Type::ColsAtCompileTime;
};

/// Two compile-time sizes that may be the same.
[[nodiscard]] constexpr bool may_equal(int a, int b) {
  return a == b || a == dynamic || b == dynamic;
}

}  // namespace detail

/// Stands for a matrix of R rows and C columns of S; a size that is cairn::dynamic on either side may fit.
template <class A, int R, int C = R, class S = double>
concept MatrixOf = requires { typename detail::ShapeOf<std::remove_cvref_t<A>>::Scalar; } &&
                   std::same_as<typename detail::ShapeOf<std::remove_cvref_t<A>>::Scalar, S> &&
                   detail::may_equal(detail::ShapeOf<std::remove_cvref_t<A>>::rows, R) &&
                   detail::may_equal(detail::ShapeOf<std::remove_cvref_t<A>>::columns, C);

/// Stands for a vector of N numbers S: a column, or a row.
template <class A, int N, class S = double>
concept VectorOf = MatrixOf<A, N, 1, S> || MatrixOf<A, 1, N, S>;

/// Stands for a state X: what stands for a vector where X is one of Eigen's, else what converts to X.
template <class A, class X>
concept StateOf =
    std::same_as<std::remove_cvref_t<A>, X> ||
    (detail::is_vector<X> && detail::OfEigen<std::remove_cvref_t<A>> && VectorOf<A, dof<X>, ScalarOf<X>>) ||
    (!(detail::is_vector<X> && detail::OfEigen<std::remove_cvref_t<A>>) && std::convertible_to<A, X>);

namespace detail {

/// A is the plain R x C matrix itself, or structured: the filters work on it as it is.
template <class A, int R, int C, class S>
inline constexpr bool is_plain =
    R != dynamic && C != dynamic && (std::same_as<A, Matrix<R, C, S>> || is_structured<A>);

/// Sizes as they are now.
template <class A>
[[nodiscard]] bool has_size(const A& a, Eigen::Index rows, Eigen::Index columns) {
  return a.rows() == rows && a.cols() == columns;
}

/// The plain matrix that `a`, of fitting size, stands for. Strided numbers go one by one: gcc 12 calls a
/// matrix that is constructed from an Eigen transpose uninitialised.
template <int R, int C, class S, class A>
[[nodiscard]] Matrix<R, C, S> plain_copy(const A& a) {
  if constexpr (is_structured<A>) {
    return a.dense();
  } else if constexpr (requires { requires(ShapeOf<A>::Type::Flags & Eigen::DirectAccessBit) != 0; }) {
    Matrix<R, C, S> result;
    if constexpr (R == dynamic || C == dynamic) result.resize(a.rows(), a.cols());
    for (Eigen::Index j = 0; j < a.cols(); ++j)
      for (Eigen::Index i = 0; i < a.rows(); ++i) result(i, j) = a.coeff(i, j);
    return result;
  } else {
    return Matrix<R, C, S>(a);
  }
}

/// A matrix of nothing but NaN, which stands for one of another size until the filter refuses.
template <int R, int C, class S>
[[nodiscard, gnu::cold]] Matrix<R, C, S> no_matrix(Eigen::Index rows, Eigen::Index columns) {
  return Matrix<R, C, S>::Constant(rows, columns, S(std::numeric_limits<double>::quiet_NaN()));
}

/// The plain matrix of rows x columns that `a` stands for; of another size, one of NaN and `misfit`.
template <int R, int C, class S, class A>
[[nodiscard]] Matrix<R, C, S> plain_matrix(const A& a, Eigen::Index rows, Eigen::Index columns,
                                           bool& misfit) {
  if constexpr (ShapeOf<A>::rows == dynamic || ShapeOf<A>::columns == dynamic || R == dynamic || C == dynamic)
    if (!has_size(a, rows, columns)) [[unlikely]] {
      misfit = true;
      return no_matrix<R, C, S>(rows, columns);
    }
  return plain_copy<R, C, S>(a);
}

/// A matrix of one's own of what `a` stands for, of the size that was found.
template <class A>
[[nodiscard]] auto as_found(const A& a) {
  return plain_copy<ShapeOf<A>::rows, ShapeOf<A>::columns, typename ShapeOf<A>::Scalar>(a);
}

/// The state that `a` stands for, of the size that was found.
template <Manifold X, class A>
[[nodiscard]] auto state_found(const A& a) {
  if constexpr (is_vector<X> && OfEigen<A>)
    return evaluated(a);
  else
    return X(a);
}

/// The vector of `size` numbers that `given` stands for; of another size, one of NaN and `misfit`.
template <class X, class Given>
[[nodiscard]] X plain_vector(Given&& given, Eigen::Index size, bool& misfit) {
  using A = std::remove_cvref_t<Given>;
  constexpr bool row = ShapeOf<A>::rows == 1 && dof<X> != 1;
  if constexpr (dof<X> == dynamic || ShapeOf<A>::rows == dynamic || ShapeOf<A>::columns == dynamic)
    if (!(row ? has_size(given, 1, size) : has_size(given, size, 1))) [[unlikely]] {
      misfit = true;
      return no_matrix<dof<X>, 1, ScalarOf<X>>(size, 1);
    }
  if constexpr (std::same_as<A, X>)
    return std::forward<Given>(given);
  else if constexpr (row)
    return plain_copy<dof<X>, 1, ScalarOf<X>>(typename ShapeOf<A>::Type::PlainObject(given).transpose());
  else
    return plain_copy<dof<X>, 1, ScalarOf<X>>(given);
}

/// The state that `given` stands for, of steps of `size` numbers; of another size, NaN or `other`, and
/// `misfit`.
template <Manifold X, class Given>
[[nodiscard]] X plain_state(Given&& given, int size, const X& other, bool& misfit) {
  if constexpr (is_vector<X> && OfEigen<std::remove_cvref_t<Given>>) {
    return plain_vector<X>(std::forward<Given>(given), size, misfit);
  } else {
    X x(std::forward<Given>(given));
    if constexpr (dof<X> == dynamic)
      if (dof_of(x) != size) [[unlikely]] {
        misfit = true;
        return other;
      }
    return x;
  }
}

}  // namespace detail
}}  // namespace cairn::CAIRN_ABI
