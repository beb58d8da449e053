// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Roots of small matrices that may be singular, in plain loops: of a covariance by elimination along its
/// largest pivots, of a sum of squares by orthogonal reflections.
///
/// A covariance without pivots to spare is where elimination in the given order goes wrong: a pivot that is
/// rounding alone divides the next ones. Along the largest pivot of what is left, in units of each row's own
/// standard deviation, what is dropped at the end is rounding and nothing else (N. Higham, "Accuracy and
/// Stability of Numerical Algorithms", 2002, 10.3).
#pragma once

#include <cmath>
#include <limits>

#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Part of a variance that rounding may have made or hidden: a conditional variance below this share of the
/// variance itself counts as none.
template <class S>
inline constexpr S rounding_share = S(64) * std::numeric_limits<S>::epsilon();

/// Part of a number that has to be left after a subtraction for three of its digits to be right.
template <class S>
inline constexpr S digits_left = S(4096) * std::numeric_limits<S>::epsilon();

/// The same for a root of a sum of squares, by reflections: they lose less.
template <class S>
inline constexpr S root_digits_left = S(1024) * std::numeric_limits<S>::epsilon();

/// root root^T = a for a covariance of any rank: one column for each direction with variance, zeros after
/// them. Not triangular, but row order(k), the k-th pivot, has nothing after column k.
template <int N, class S>
struct PivotedRoot {
  Matrix<N, N, S> root;
  Vector<N, int> order;  ///< of the first `rank` entries
  int rank = 0;
};

/// Fills `result` from a symmetric `a`, whose lower triangle is read. False, and no use, where that is not
/// finite or not positive semi-definite up to the rounding of its own diagonal. O(N^3 / 3).
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool pivoted_root(const Matrix<N, N, S>& a,
                                                          PivotedRoot<N, S>& result) {
  using std::sqrt;
  Matrix<N, N, S>& root = result.root;
  constexpr S slack = rounding_share<S>;
  const int n = static_cast<int>(a.rows());
  Matrix<N, N, S> left = a;  // what is still to be explained, in units of the standard deviations
  Vector<N, S> sigma = Vector<N, S>::Zero(n);
  Vector<N, S> waits = Vector<N, S>::Ones(n);  // 0 for a row that was a pivot
  root = Matrix<N, N, S>::Zero(n, n);
  result.order = Vector<N, int>::Zero(n);
  for (int i = 0; i < n; ++i) {
    if (!(a(i, i) >= S(0)) || !(a(i, i) <= std::numeric_limits<S>::max())) return false;
    sigma(i) = sqrt(a(i, i));
    left(i, i) = a(i, i) > S(0) ? S(1) : S(0);
    for (int j = 0; j < i; ++j) {
      const bool vary = a(i, i) > S(0) && a(j, j) > S(0);
      left(i, j) = vary ? a(i, j) / sigma(i) / sigma(j) : a(i, j);
      const S most = vary ? S(1) + slack : S(0);
      if (!(left(i, j) <= most && left(i, j) >= -most)) return false;
    }
  }
  const auto entry = [&](int i, int j) { return i > j ? left(i, j) : left(j, i); };
  int k = 0;
  for (; k < n; ++k) {
    int best = -1;
    for (int i = 0; i < n; ++i)
      if (waits(i) > S(0) && left(i, i) > (best < 0 ? slack : left(best, best))) best = i;
    if (best < 0) break;
    waits(best) = S(0);
    result.order(k) = best;
    const S deviation = sqrt(left(best, best));
    root(best, k) = deviation;
    for (int i = 0; i < n; ++i)
      if (waits(i) > S(0)) root(i, k) = entry(i, best) / deviation;
    for (int j = 0; j < n; ++j)
      for (int i = j; i < n; ++i)
        if (waits(i) > S(0) && waits(j) > S(0)) left(i, j) -= root(i, k) * root(j, k);
  }
  result.rank = k;
  for (int j = 0; j < n; ++j)
    for (int i = j; i < n; ++i)
      if (waits(i) > S(0) && waits(j) > S(0) && !(left(i, j) >= S(-2) * slack && left(i, j) <= S(2) * slack))
        return false;
  for (int j = 0; j < k; ++j)
    for (int i = 0; i < n; ++i) root(i, j) *= sigma(i);
  return true;
}

/// Householder: makes the C x R matrix `a` upper triangular in its first R rows, a^T a unchanged, diagonal
/// not negative. C >= R. An error of rounding is one of each column by itself, so that columns may differ in
/// size (Higham, 2002, theorem 19.4).
template <int C, int R, class S>
void triangularise(Matrix<C, R, S>& a) {
  using std::sqrt;
  const int rows = static_cast<int>(a.rows());
  const int columns = static_cast<int>(a.cols());
  for (int k = 0; k < columns; ++k) {
    S squared(0);
    for (int i = k + 1; i < rows; ++i) squared += a(i, k) * a(i, k);
    const S head = a(k, k);
    const S norm = sqrt(head * head + squared);
    if (squared > S(0)) {
      const S first =
          head > S(0) ? -squared / (head + norm) : head - norm;  // head - norm without cancellation
      const S factor = S(2) / (first * first + squared);
      for (int j = k + 1; j < columns; ++j) {
        S dot = first * a(k, j);
        for (int i = k + 1; i < rows; ++i) dot += a(i, k) * a(i, j);
        dot *= factor;
        a(k, j) -= dot * first;
        for (int i = k + 1; i < rows; ++i) a(i, j) -= dot * a(i, k);
      }
    } else if (head < S(0)) {
      for (int j = k + 1; j < columns; ++j) a(k, j) = -a(k, j);
    }
    a(k, k) = norm;
    for (int i = k + 1; i < rows; ++i) a(i, k) = S(0);
  }
}

/// Householder on the first `count` columns, where some may depend on others: rows(j) is the row in which
/// column j has its pivot, or -1 where it has none above its own rounding. Each pivot takes the next row.
template <int C, int R, int N, class S>
void to_echelon(Matrix<C, R, S>& a, int count, Vector<N, int>& rows) {
  using std::sqrt;
  int row = 0;
  for (int j = 0; j < count; ++j) {
    S whole(0), squared(0);
    for (int i = 0; i < static_cast<int>(a.rows()); ++i) {
      whole += a(i, j) * a(i, j);
      if (i > row) squared += a(i, j) * a(i, j);
    }
    const S head = row < static_cast<int>(a.rows()) ? a(row, j) : S(0);
    const S norm = sqrt(head * head + squared);
    rows(j) = norm > digits_left<S> * sqrt(whole) ? row : -1;
    if (rows(j) < 0) continue;
    const S first = head > S(0) ? head + norm : head - norm;
    const S factor = S(2) / (first * first + squared);
    for (int k = j + 1; k < static_cast<int>(a.cols()); ++k) {
      S dot = first * a(row, k);
      for (int i = row + 1; i < static_cast<int>(a.rows()); ++i) dot += a(i, j) * a(i, k);
      dot *= factor;
      a(row, k) -= dot * first;
      for (int i = row + 1; i < static_cast<int>(a.rows()); ++i) a(i, k) -= dot * a(i, j);
    }
    a(row, j) = head > S(0) ? -norm : norm;
    for (int i = row + 1; i < static_cast<int>(a.rows()); ++i) a(i, j) = S(0);
    ++row;
  }
}

/// The transpose of the upper triangle of `array` that starts at (from, from).
template <class Root, class Array>
[[nodiscard]] Root lower_part(const Array& array, int from, int size) {
  Root root = Root::Zero(size, size);
  for (int j = 0; j < size; ++j)
    for (int i = j; i < size; ++i) root(i, j) = array(from + j, from + i);
  return root;
}

/// Writes a^T into `array` from (row, column) on.
template <class Array, class A>
void put_transposed(Array& array, int row, int column, const A& a) {
  for (int j = 0; j < static_cast<int>(a.cols()); ++j)
    for (int i = 0; i < static_cast<int>(a.rows()); ++i) array(row + j, column + i) = a(i, j);
}

/// Cholesky's factor where every pivot is well above the rounding of its row, else false: `lower` is of no
/// use then.
template <int N, class S>
[[nodiscard]] bool regular_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& lower) {
  using std::sqrt;
  const int n = static_cast<int>(a.rows());
  lower = Matrix<N, N, S>::Zero(n, n);
  for (int j = 0; j < n; ++j) {
    for (int i = j; i < n; ++i) {
      S sum = a(i, j);
      for (int k = 0; k < j; ++k) sum -= lower(i, k) * lower(j, k);
      lower(i, j) = sum;
    }
    const S pivot = lower(j, j);
    if (!(pivot > rounding_share<S> * a(j, j)) || !(pivot <= std::numeric_limits<S>::max())) return false;
    const S deviation = sqrt(pivot);
    for (int i = j; i < n; ++i) lower(i, j) /= deviation;
  }
  return true;
}

/// Lower triangular root of any positive semi-definite `a`; false where it is none.
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool singular_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  PivotedRoot<N, S> pivoted;
  if (!pivoted_root<N, S>(a, pivoted)) return false;
  Matrix<N, N, S> array = transposed<N, N, S>(pivoted.root);
  triangularise(array);
  root = lower_part<Matrix<N, N, S>>(array, 0, static_cast<int>(a.rows()));
  return true;
}

/// The same, the quick way first.
template <int N, class S>
[[nodiscard]] bool dense_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  return regular_root<N, S>(a, root) || singular_root<N, S>(a, root);
}

}}}  // namespace cairn::CAIRN_ABI::detail
