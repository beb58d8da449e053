// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a user's model returns, as plain column-major matrices and states of the sizes that are wanted.
#pragma once

#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

template <class A, class S, int R, int C>
concept MayBePlain = std::is_same_v<typename A::Scalar, S> &&
                     (A::RowsAtCompileTime == R || A::RowsAtCompileTime == dynamic || R == dynamic) &&
                     (A::ColsAtCompileTime == C || A::ColsAtCompileTime == dynamic || C == dynamic);

/// Reads a Structured or anything of Eigen's (row-major, Map, Block, expression) into `to`. False, and `to`
/// left, where that is not of rows x columns.
template <int R, int C, class S, class A>
[[nodiscard]] bool to_plain(const A& a, Eigen::Index rows, Eigen::Index columns, Matrix<R, C, S>& to) {
  if constexpr (is_structured<A>) {
    static_assert(std::is_same_v<typename A::Scalar, S> && (R == dynamic || A::row_count == R) &&
                      (C == dynamic || A::column_count == C),
                  "a model returns a matrix of other sizes or another number type than its State and "
                  "Measurement ask for");
    if (A::row_count != rows || A::column_count != columns) return false;
    to = a.dense();
  } else {
    static_assert(MayBePlain<A, S, R, C>,
                  "a model returns a matrix of other sizes or another number type than its State and "
                  "Measurement ask for");
    if (a.rows() != rows || a.cols() != columns) return false;
    // Strided numbers one by one: gcc 12 calls a matrix that is made from an Eigen transpose uninitialised.
    if constexpr (requires { requires(A::Flags & Eigen::DirectAccessBit) != 0; }) {
      if constexpr (R == dynamic || C == dynamic) to.resize(rows, columns);
      for (Eigen::Index j = 0; j < columns; ++j)
        for (Eigen::Index i = 0; i < rows; ++i) to(i, j) = a.coeff(i, j);
    } else {
      to = a;
    }
  }
  return true;
}

/// The state that a model returned, into `to`. False where it is a vector of another size.
template <Manifold X, class A>
[[nodiscard]] bool to_state(const A& a, X& to) {
  if constexpr (is_vector<X> && requires { a.rows(); })
    return to_plain<dof<X>, 1, ScalarOf<X>>(a, dof<X> == dynamic ? a.rows() : dof<X>, 1, to);
  else
    to = a;
  return true;
}

}}}  // namespace cairn::CAIRN_ABI::detail
