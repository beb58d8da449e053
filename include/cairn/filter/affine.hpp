// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A x + b for models that are linear in their state (models/linear.hpp).
#pragma once

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/register_column.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// A vector of N numbers, or of none where sizes known at run time did not fit.
template <int N, class S>
using VectorOrNone = Eigen::Matrix<S, dynamic, 1, 0, N, 1>;

/// A x + b. An empty b of run-time size is zero; run-time sizes that do not fit give an empty vector.
template <int R, int C, class S>
[[gnu::always_inline]] [[nodiscard]] inline auto affine(const Matrix<R, C, S>& a, const Vector<C, S>& x,
                                                        const Vector<R, S>& b) {
  if constexpr (R == dynamic || C == dynamic) {
    VectorOrNone<R, S> y;
    if (a.cols() != x.size() || (b.size() != 0 && b.size() != a.rows())) return y;
    y = product(a, x);
    if (b.size() != 0) y += b;
    return y;
  } else {
    Column<R, S> sum, column;
    sum.load(b.data());
    each<C>([&](int j) {
      column.load(a.data() + j * R);
      sum.add(column, x(j));
    });
    Vector<R, S> y;
    sum.store(y.data());
    return y;
  }
}

}}}  // namespace cairn::CAIRN_ABI::detail
