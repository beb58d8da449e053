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
#include <cstddef>
#include <limits>
#include <type_traits>
#include <vector>

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

/// A matrix kept by columns somewhere, of sizes known at run time: what is rarely needed works on views and
/// is compiled once for all sizes.
template <class S>
class View {
public:
  View(S* data, int rows, int cols) : data_(data), rows_(rows), cols_(cols) {}
  // NOLINTNEXTLINE(google-explicit-constructor): what may be written may be read
  operator View<const S>() const
    requires(!std::is_const_v<S>)
  {
    return {data_, rows_, cols_};
  }
  [[nodiscard]] int rows() const noexcept { return rows_; }
  [[nodiscard]] int cols() const noexcept { return cols_; }
  S& operator()(int i, int j) const { return data_[j * rows_ + i]; }
  S& operator()(int i) const { return data_[i]; }

private:
  S* data_;
  int rows_, cols_;
};
/// A View that is only read, of the S that the other arguments say.
template <class S>
using ViewOf = std::type_identity_t<View<const S>>;
template <int R, int C, class S>
[[nodiscard]] View<S> view(Matrix<R, C, S>& a) {
  return {a.data(), static_cast<int>(a.rows()), static_cast<int>(a.cols())};
}
template <int R, int C, class S>
[[nodiscard]] View<const S> view(const Matrix<R, C, S>& a) {
  return {a.data(), static_cast<int>(a.rows()), static_cast<int>(a.cols())};
}

/// Room for rows x cols numbers of any value.
template <int R, int C, class S>
[[nodiscard]] Matrix<R, C, S> room(int rows, int cols) {
  Matrix<R, C, S> result;
  if constexpr (R == dynamic || C == dynamic) result.resize(rows, cols);
  return result;
}

/// Room for Count numbers of any value; on the heap where Count is known at run time only.
template <class S, int Count>
class Room {
public:
  explicit Room(int) {}
  [[nodiscard]] S* data() noexcept { return numbers_; }

private:
  S numbers_[static_cast<std::size_t>(Count)];
};
template <class S>
class Room<S, dynamic> {
public:
  explicit Room(int count) : numbers_(static_cast<std::size_t>(count)) {}
  [[nodiscard]] S* data() noexcept { return numbers_.data(); }

private:
  std::vector<S> numbers_;
};

/// Whether every number is finite. As all_finite(), compiled once for all sizes.
template <class S>
[[nodiscard, gnu::noinline]] bool finite_numbers(View<const S> a) {
  S zero(0);
  for (int j = 0; j < a.cols(); ++j)
    for (int i = 0; i < a.rows(); ++i) zero += a(i, j) - a(i, j);
  return zero == S(0);
}

/// root root^T = a for a covariance of any rank: one column for each direction with variance, zeros after
/// them. Not triangular, but row order(k), the k-th pivot, has nothing after column k.
template <int N, class S>
struct PivotedRoot {
  Matrix<N, N, S> root;
  Vector<N, int> order;  ///< of the first `rank` entries
  int rank = 0;
};

/// Fills `root` and `order` from a symmetric `a`, whose lower triangle is read and used up, and returns the
/// rank; -1, and no use, where that is not finite or not positive semi-definite up to the rounding of its own
/// diagonal. `order` may be null; `sigma` and `waits` are room for a number a row. O(n^3 / 3).
template <class S>
[[nodiscard, gnu::cold, gnu::noinline]] int pivot_root(View<S> a, View<S> root, int* order, S* sigma,
                                                       S* waits) {
  using std::sqrt;
  constexpr S slack = rounding_share<S>;
  const int n = a.rows();
  // What is still to be explained is kept in units of the standard deviations.
  for (int i = 0; i < n; ++i) {
    if (!(a(i, i) >= S(0)) || !(a(i, i) <= std::numeric_limits<S>::max())) return -1;
    sigma[i] = sqrt(a(i, i));
    waits[i] = S(1);  // 0 for a row that was a pivot
    if (order != nullptr) order[i] = 0;
    for (int j = 0; j < n; ++j) root(i, j) = S(0);
    for (int j = 0; j < i; ++j) {
      const bool vary = sigma[i] > S(0) && sigma[j] > S(0);
      if (vary) a(i, j) = a(i, j) / sigma[i] / sigma[j];
      const S most = vary ? S(1) + slack : S(0);
      if (!(a(i, j) <= most && a(i, j) >= -most)) return -1;
    }
  }
  for (int i = 0; i < n; ++i) a(i, i) = sigma[i] > S(0) ? S(1) : S(0);
  int rank = 0;
  for (; rank < n; ++rank) {
    int best = -1;
    for (int i = 0; i < n; ++i)
      if (waits[i] > S(0) && a(i, i) > (best < 0 ? slack : a(best, best))) best = i;
    if (best < 0) break;
    waits[best] = S(0);
    if (order != nullptr) order[rank] = best;
    const S deviation = sqrt(a(best, best));
    root(best, rank) = deviation;
    for (int i = 0; i < n; ++i)
      if (waits[i] > S(0)) root(i, rank) = (i > best ? a(i, best) : a(best, i)) / deviation;
    for (int j = 0; j < n; ++j)
      for (int i = j; i < n; ++i)
        if (waits[i] > S(0) && waits[j] > S(0)) a(i, j) -= root(i, rank) * root(j, rank);
  }
  for (int j = 0; j < n; ++j)
    for (int i = j; i < n; ++i)
      if (waits[i] > S(0) && waits[j] > S(0) && !(a(i, j) >= S(-2) * slack && a(i, j) <= S(2) * slack))
        return -1;
  for (int j = 0; j < rank; ++j)
    for (int i = 0; i < n; ++i) root(i, j) *= sigma[i];
  return rank;
}

/// The same for a matrix. False where it is no covariance.
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool pivoted_root(const Matrix<N, N, S>& a,
                                                          PivotedRoot<N, S>& result) {
  const int n = static_cast<int>(a.rows());
  Matrix<N, N, S> left = a;
  Room<S, N == dynamic ? dynamic : 2 * N> numbers(2 * n);
  result.root = a;
  result.order = room<N, 1, int>(n, 1);
  result.rank =
      pivot_root(view(left), view(result.root), result.order.data(), numbers.data(), numbers.data() + n);
  return result.rank >= 0;
}

/// Numbers of room that the functions below ask for, which need a matrix of n rows to be looked at.
[[nodiscard]] constexpr int room_for_root(int n) {
  return n == dynamic ? dynamic : 2 * n * (n + 1);
}

/// Symmetric `a` is finite and positive semi-definite up to the rounding of its own diagonal.
template <class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool is_semi_definite(ViewOf<S> a, S* numbers) {
  const int n = a.rows();
  const View<S> left(numbers, n, n), root(numbers + n * n, n, n);
  for (int j = 0; j < n; ++j)
    for (int i = j; i < n; ++i) left(i, j) = a(i, j);
  return pivot_root(left, root, nullptr, numbers + 2 * n * n, numbers + 2 * n * n + n) >= 0;
}
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool is_semi_definite(const Matrix<N, N, S>& a) {
  const int n = static_cast<int>(a.rows());
  Room<S, room_for_root(N)> numbers(room_for_root(n));
  return is_semi_definite(view(a), numbers.data());
}

template <class A>
[[gnu::always_inline]] inline void reflect_columns(A& a) {
  using S = std::remove_cvref_t<decltype(a(0, 0))>;
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

/// Householder: makes the C x R matrix `a` upper triangular in its first R rows, a^T a unchanged, diagonal
/// not negative. C >= R. An error of rounding is one of each column by itself, so that columns may differ in
/// size (Higham, 2002, theorem 19.4).
template <class A>
void triangularise(A&& a) {
  reflect_columns(a);
}
/// The same, compiled once for all sizes.
template <class S>
[[gnu::noinline]] void triangularise(View<S> a) {
  reflect_columns(a);
}

/// Householder on the first `count` columns, where some may depend on others: rows(j) is the row in which
/// column j has its pivot, or -1 where it has none: where a^T a as a matrix holds less than three digits of
/// what is left of the column. Each pivot takes the next row.
template <int C, int R, int N, class S>
void to_echelon(Matrix<C, R, S>& a, int count, Vector<N, int>& rows) {
  using std::sqrt;
  constexpr S held = S(1024) * std::numeric_limits<S>::epsilon();
  int row = 0;
  for (int j = 0; j < count; ++j) {
    S whole(0), squared(0);
    for (int i = 0; i < static_cast<int>(a.rows()); ++i) {
      whole += a(i, j) * a(i, j);
      if (i > row) squared += a(i, j) * a(i, j);
    }
    const S head = row < static_cast<int>(a.rows()) ? a(row, j) : S(0);
    const S left = head * head + squared, norm = sqrt(left);
    rows(j) = left > held * whole ? row : -1;
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

/// Fills `root` with the transpose of the upper triangle of `array` that starts at (from, from).
template <class Root, class Array>
void take_lower_part(Root&& root, const Array& array, int from) {
  const std::remove_cvref_t<decltype(array(0, 0))> zero(0);
  const int size = static_cast<int>(root.rows());
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) root(i, j) = i < j ? zero : array(from + j, from + i);
}
template <class Root, class Array>
[[nodiscard]] Root lower_part(const Array& array, int from, int size) {
  Root root = Root::Zero(size, size);
  take_lower_part(root, array, from);
  return root;
}

/// Writes a^T into `array` from (row, column) on.
template <class Array, class A>
void put_transposed(Array&& array, int row, int column, const A& a) {
  for (int j = 0; j < static_cast<int>(a.cols()); ++j)
    for (int i = 0; i < static_cast<int>(a.rows()); ++i) array(row + j, column + i) = a(i, j);
}

/// Cholesky's factor where every pivot is well above the rounding of its row, else false: `lower` is of no
/// use then.
template <class A, class L>
[[nodiscard]] bool eliminate_root(const A& a, L&& lower) {
  using S = std::remove_cvref_t<decltype(lower(0, 0))>;
  using std::sqrt;
  const int n = static_cast<int>(a.rows());
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < j; ++i) lower(i, j) = S(0);
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
template <int N, class S>
[[nodiscard]] bool regular_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& lower) {
  lower = a;
  return eliminate_root(a, lower);
}

/// Lower triangular root of any positive semi-definite `a`; false where it is none.
template <class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool singular_root(ViewOf<S> a, View<S> root, S* numbers) {
  const int n = a.rows();
  const View<S> pivoted(numbers + n * n, n, n);
  const View<S> array(numbers, n, n);
  for (int j = 0; j < n; ++j)
    for (int i = j; i < n; ++i) array(i, j) = a(i, j);
  if (pivot_root(array, pivoted, nullptr, numbers + 2 * n * n, numbers + 2 * n * n + n) < 0) return false;
  put_transposed(array, 0, 0, pivoted);
  triangularise(array);
  take_lower_part(root, array, 0);
  return true;
}
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool singular_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  const int n = static_cast<int>(a.rows());
  Room<S, room_for_root(N)> numbers(room_for_root(n));
  root = a;
  return singular_root(view(a), view(root), numbers.data());
}

/// The same, the quick way first; compiled once for all sizes.
template <class S>
[[nodiscard, gnu::noinline]] bool rare_root(ViewOf<S> a, View<S> root, S* numbers) {
  return eliminate_root(a, root) || singular_root(a, root, numbers);
}
template <int N, class S>
[[nodiscard]] bool rare_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  root = a;
  return eliminate_root(view(a), view(root)) || singular_root<N, S>(a, root);
}

/// The same for what is done at every step.
template <int N, class S>
[[nodiscard]] bool dense_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  return regular_root<N, S>(a, root) || singular_root<N, S>(a, root);
}

}}}  // namespace cairn::CAIRN_ABI::detail
