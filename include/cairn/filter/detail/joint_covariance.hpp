// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The covariance of a state that grows, on plain numbers: rows come and go, named rows are measured, moved,
/// known exactly. Nothing here knows what the rows mean; joint_gaussian.hpp does.
///
/// Every operation has two halves. The first only reads and fills the workspace, makes room, and says whether
/// the result would be sound; the second writes, and cannot fail. A refused step has therefore touched
/// nothing.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/filter/detail/symmetric_rows.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Consecutive rows.
struct RowRange {
  int first = 0;
  int count = 0;
};

/// The part of a Jacobian that belongs to one block: `rows` numbers from number `first` of the measurement
/// on, by the rows of the state `block`. Column-major, columns `leading` numbers apart.
template <class S>
struct JacobianPart {
  RowRange block;
  int first;
  int rows;
  const S* jacobian;
  int leading;
};

/// Memory that is there again for the next step. A copy has none.
template <class S>
class Workspace {
public:
  Workspace() = default;
  Workspace(const Workspace&) noexcept {}
  Workspace(Workspace&& other) noexcept = default;
  Workspace& operator=(const Workspace&) noexcept { return *this; }
  Workspace& operator=(Workspace&& other) noexcept = default;
  ~Workspace() = default;

  /// Forgets what was taken and provides room for `numbers` in all, each piece rounded up to whole lines.
  void open(std::size_t numbers) {
    const std::size_t lines = numbers / CacheLine<S>::count + 1;
    if (lines_.size() < lines) lines_.resize(lines);
    used_ = 0;
  }
  [[nodiscard]] S* take(std::size_t numbers) {
    const std::size_t begin = used_;
    used_ += (numbers + CacheLine<S>::count - 1) / CacheLine<S>::count;
    CAIRN_ASSERT(used_ <= lines_.size(), "the workspace is as large as its pieces");
    return lines_[begin].numbers;
  }

private:
  std::vector<CacheLine<S>> lines_;
  std::size_t used_ = 0;
};

/// A conditional variance below this share of the variance itself is rounding.
template <class S>
inline constexpr S no_variance = S(64) * std::numeric_limits<S>::epsilon();

/// Cholesky of a symmetric positive semi-definite n x n matrix (column-major, full, destroyed) along its
/// largest pivots, in units of the diagonal: order[k] is the row of pivot k, and column order[k] of `a` then
/// holds that column of the root, in the rows order[k..n). False where the matrix is no covariance to
/// `rounding`. O(n^2 rank). (N. Higham, "Accuracy and Stability of Numerical Algorithms", 2002, 10.3.)
template <class S>
[[nodiscard]] bool pivoted_cholesky(S* a, int n, int* order, S* diagonal, int& rank,
                                    S rounding = S(2) * no_variance<S>) {
  using std::sqrt;
  const auto at = [a, n](int i, int j) -> S& {
    return a[static_cast<std::size_t>(j) * static_cast<std::size_t>(n) + static_cast<std::size_t>(i)];
  };
  rank = 0;
  for (int i = 0; i < n; ++i) {
    order[i] = i;
    diagonal[i] = at(i, i);
    if (!(diagonal[i] >= S(0) && diagonal[i] <= std::numeric_limits<S>::max())) return false;
  }
  for (; rank < n; ++rank) {
    int best = -1;
    S share = no_variance<S>;
    for (int q = rank; q < n; ++q) {
      const int i = order[q];
      if (at(i, i) > share * diagonal[i]) {
        best = q;
        share = at(i, i) / diagonal[i];
      }
    }
    if (best < 0) break;
    std::swap(order[rank], order[best]);
    const int p = order[rank];
    const S root = sqrt(at(p, p));
    at(p, p) = root;
    for (int q = rank + 1; q < n; ++q) at(order[q], p) /= root;
    for (int r = rank + 1; r < n; ++r)
      for (int q = rank + 1; q < n; ++q) at(order[q], order[r]) -= at(order[q], p) * at(order[r], p);
  }
  bool good = true;
  for (int r = rank; r < n; ++r)
    for (int q = rank; q < n; ++q) {
      const int i = order[q], j = order[r];
      const S left = at(i, j) / rounding;
      good = good && left * left <= diagonal[i] * diagonal[j];
    }
  return good;
}

/// The covariance, and the steps of a filter on it.
template <class S>
class JointCovariance {
public:
  /// Rows in all, those that belong to nobody included (they are zero).
  [[nodiscard]] int size() const noexcept { return p_.size(); }
  [[nodiscard]] SymmetricRows<S>& rows() noexcept { return p_; }
  [[nodiscard]] const SymmetricRows<S>& rows() const noexcept { return p_; }
  void make_room(int count) {
    p_.make_room(count);
    room_for(free_, index(count));
    room_for(considered_, index(count));
    room_for(kept_, index(count));
    room_for(moved_, index(count));
  }

  /// The first of `count` rows of zeros that from now on belong to the caller: where others were released, or
  /// at the end.
  [[nodiscard]] int place(int count) {
    int run = 0;
    for (int i = 0; i < size() && free_count_ >= count; ++i) {
      run = free_[index(i)] != 0 ? run + 1 : 0;
      if (run == count) {
        for (int k = i - count + 1; k <= i; ++k) free_[index(k)] = 0;
        free_count_ -= count;
        return i - count + 1;
      }
    }
    const int first = size();
    p_.resize(first + count);
    free_.resize(index(first + count), 0);
    considered_.resize(index(first + count), 0);
    return first;
  }

  /// Marginalises rows: they belong to nobody. O(n count).
  void release(RowRange range) {
    p_.set_zero(range.first, range.count);
    consider(range, false);
    for (int i = range.first; i < range.first + range.count; ++i) free_[index(i)] = 1;
    free_count_ += range.count;
    int end = size();
    while (end > 0 && free_[index(end - 1)] != 0) --end;
    free_count_ -= size() - end;
    shrink(end);
  }
  /// A quarter of the rows belongs to nobody: steps would take 1.8 times as long as they need to.
  [[nodiscard]] bool sparse() const noexcept { return 4 * free_count_ > size(); }
  /// Closes the gaps. Returns the new place of each old row. O(n^2).
  const std::vector<int>& compact() {
    moved_.clear();
    kept_.clear();
    for (int i = 0; i < size(); ++i) {
      moved_.push_back(static_cast<int>(kept_.size()));
      if (free_[index(i)] == 0) kept_.push_back(i);
    }
    p_.keep(kept_);
    for (std::size_t i = 0; i < kept_.size(); ++i) considered_[i] = considered_[index(kept_[i])];
    std::fill(free_.begin(), free_.end(), static_cast<unsigned char>(0));
    free_count_ = 0;
    shrink(static_cast<int>(kept_.size()));
    return moved_;
  }

  /// Updates leave the mean and the covariance of these rows among one another as they are.
  void consider(RowRange range, bool on) {
    for (int i = range.first; i < range.first + range.count; ++i) {
      considered_count_ += (on ? 1 : 0) - considered_[index(i)];
      considered_[index(i)] = on ? 1 : 0;
    }
  }

  // Reading.

  /// P of some rows by others, column-major.
  void read(std::span<const RowRange> rows, std::span<const RowRange> columns, S* to) const {
    for (const RowRange& column : columns)
      for (int j = 0; j < column.count; ++j)
        for (const RowRange& row : rows)
          for (int i = 0; i < row.count; ++i) *to++ = p_.at(row.first + i, column.first + j);
  }

  /// H P H^T (m x m, column-major, symmetric). O(d^2), whatever the number of rows.
  void predicted(std::span<const JacobianPart<S>> parts, int m, S* hph) const {
    std::fill_n(hph, m * m, S(0));
    for (const auto& a : parts)
      for (const auto& b : parts)
        for (int l = 0; l < b.block.count; ++l)
          for (int k = 0; k < a.block.count; ++k) {
            const S p = p_.at(a.block.first + k, b.block.first + l);
            for (int j = 0; j < b.rows; ++j) {
              const S pj = p * b.jacobian[l * b.leading + j];
              for (int i = 0; i < a.rows; ++i)
                hph[(b.first + j) * m + a.first + i] += a.jacobian[k * a.leading + i] * pj;
            }
          }
    mirror(hph, m);
  }

  // A measurement: measure(), whiten(), one of the steps, sound() or stabilise(), then lower().

  /// Reads the named rows, U = H P and H P H^T (m x m, column-major). O(n d m).
  void measure(std::span<const JacobianPart<S>> parts, int m, S* hph) {
    m_ = m;
    name(parts);
    stride_ = padded<S>(size());
    work_.open((2 * index(named_count()) + 3 * index(m) + 1) * stride_ + scratch_for(m));
    gathered_ = gather(index(named_count()));
    cross_ = rows_of_zeros(index(m));
    for (std::size_t i = 0; i < parts.size(); ++i)
      for (int k = 0; k < parts[i].block.count; ++k)
        add_rows(cross_, parts[i], k, row(gathered_, where_[i] + k));
    std::fill_n(hph, m * m, S(0));
    for (const auto& part : parts)
      for (int c = 0; c < m; ++c)
        for (int k = 0; k < part.block.count; ++k) {
          const S u = row(cross_, c)[part.block.first + k];
          for (int a = 0; a < part.rows; ++a)
            hph[c * m + part.first + a] += part.jacobian[k * part.leading + a] * u;
        }
    mirror(hph, m);
  }

  /// W = L^-1 U, for H P H^T + R = L L^T (m x m, column-major).
  void whiten(const S* lower) {
    using std::sqrt;
    losses_.resize(index(m_));
    for (int j = 0; j < m_; ++j) {
      S diagonal(0);
      for (int k = 0; k <= j; ++k) diagonal += lower[k * m_ + j] * lower[k * m_ + j];
      losses_[index(j)] = sqrt(diagonal) / lower[j * m_ + j];
      for (int k = 0; k < j; ++k) add_scaled(row(cross_, j), row(cross_, k), -lower[k * m_ + j], stride_);
      scale(row(cross_, j), S(1) / lower[j * m_ + j]);
    }
  }

  /// The step W^T y of the mean; zero where it may not move.
  void step_by_whitened(const S* y) {
    step_ = rows_of_zeros(1);
    for (int j = 0; j < m_; ++j) add_scaled(step_, row(cross_, j), y[j], stride_);
    if (considered_count_ > 0) mask(step_, 1);
  }
  /// The step P_:n y for numbers that belong to the columns of the parts given to measure(), one part after
  /// the other.
  void step_by_dual(std::span<const JacobianPart<S>> parts, const S* y) {
    step_ = rows_of_zeros(1);
    for (std::size_t i = 0; i < parts.size(); ++i)
      for (int k = 0; k < parts[i].block.count; ++k)
        add_scaled(step_, row(gathered_, where_[i] + k), *y++, stride_);
    if (considered_count_ > 0) mask(step_, 1);
  }
  [[nodiscard]] const S* step() const noexcept { return step_; }
  /// Every number of the step is finite, and its square: groups turn by the length of theirs.
  [[nodiscard]] bool may_step() const {
    S none(0);
    for (std::size_t i = 0; i < stride_; ++i) none += (step_[i] * step_[i]) * S(8) * S(0);
    return none == S(0);
  }

  /// P - W W^T has digits left in every variance, and is a covariance where it was looked at.
  [[nodiscard]] bool sound() {
    if (!keeps_digits(S(16) * digits_left<S>)) return false;
    const int d = named_count();
    S* const left = work_.take(index(d) * index(d));
    for (int b = 0; b < d; ++b)
      for (int a = 0; a < d; ++a) {
        const int i = named_rows_[index(a)], j = named_rows_[index(b)];
        S sum = row(gathered_, b)[i];
        if (considered_[index(i)] == 0 || considered_[index(j)] == 0)
          for (int k = 0; k < m_; ++k) sum -= row(cross_, k)[i] * row(cross_, k)[j];
        left[b * d + a] = sum;
      }
    stabilised_ = nullptr;
    return semi_definite(left, d);
  }

  /// The named rows of the result by Joseph's form, A P A^T + K R K^T with A = I - K H, whose rounding is of
  /// the result's size and not of the prior's. As A P H^T - K R is zero but for rounding, these rows are
  /// A_nn P_n: less a small correction: O(n d^2).
  [[nodiscard]] bool stabilise(std::span<const JacobianPart<S>> parts, const S* lower, const S* r) {
    if (!keeps_digits(S(0))) return false;
    const int d = named_count(), m = m_;
    S* const gain = gain_rows(lower);
    const View<S> h = jacobian_over_named(parts), hp = predicted_of_named(lower);
    const View<S> a = small(d, d), rest = small(d, m);  // A_nn; A P H^T - K R of the named rows
    for (int q = 0; q < d; ++q)
      for (int p = 0; p < d; ++p) {
        S sum = S(p == q ? 1 : 0);
        for (int i = 0; i < m; ++i) sum -= named(gain, i, p) * h(i, q);
        a(p, q) = sum;
      }
    for (int i = 0; i < m; ++i)
      for (int p = 0; p < d; ++p) {
        S sum(0);
        for (int q = 0; q < d; ++q) sum += a(p, q) * hp(i, q);
        for (int k = 0; k < m; ++k) sum -= named(gain, k, p) * r[i * m + k];
        rest(p, i) = sum;
      }
    stabilised_ = rows_of_zeros(index(d));
    for (int p = 0; p < d; ++p) {
      for (int q = 0; q < d; ++q) add_scaled(row(stabilised_, p), row(gathered_, q), a(p, q), stride_);
      for (int i = 0; i < m; ++i) add_scaled(row(stabilised_, p), row(gain, i), -rest(p, i), stride_);
    }
    S* const corner = work_.take(index(d) * index(d));
    for (int q = 0; q < d; ++q)
      for (int p = 0; p < d; ++p) corner[q * d + p] = named(stabilised_, p, q);
    mirror_mean(corner, d);
    // What rounding made negative in a singular P_nn may be more than that of a result far below it.
    const bool good =
        semi_definite(corner, d) || (squares_by_root(a, gain, r, corner) && semi_definite(corner, d));
    put_corner(stabilised_, corner);
    return good;
  }

  /// P <- P - W W^T, but for the rows that are considered among one another; and the stabilised rows.
  void lower() {
    subtract(cross_, cross_, m_);
    if (stabilised_ != nullptr) scatter(stabilised_);
  }

  // Named rows move, or make new ones.

  /// Of named rows, each range once: F P F^T + Q and what it does to all others. False where the result is
  /// not finite or has a negative variance. Column-major d x d. O(n d^2).
  [[nodiscard]] bool transform(std::span<const RowRange> blocks, const S* f, const S* q) {
    name(blocks);
    const int d = named_count();
    stride_ = padded<S>(size());
    work_.open(2 * index(d) * stride_ + 2 * scratch_for(d));
    gathered_ = gather(index(d));
    stabilised_ = rows_of_zeros(index(d));
    for (int k = 0; k < d; ++k)
      for (int i = 0; i < d; ++i)
        if (f[k * d + i] != S(0)) add_scaled(row(stabilised_, i), row(gathered_, k), f[k * d + i], stride_);
    S* const corner = work_.take(index(d) * index(d));
    std::copy_n(q, d * d, corner);
    for (int j = 0; j < d; ++j)
      for (int k = 0; k < d; ++k)
        for (int i = 0; i < d; ++i)
          corner[j * d + i] += row(stabilised_, i)[named_rows_[index(k)]] * f[k * d + j];
    mirror(corner, d);
    put_corner(stabilised_, corner);
    is_finite_ = finite_rows(stabilised_, d);
    return is_finite_ && variances(corner, d);
  }
  /// Whether what transform() or extend() has refused was a negative variance, and all numbers finite.
  [[nodiscard]] bool is_finite() const noexcept { return is_finite_; }
  void write_transformed() { scatter(stabilised_); }

  /// Rows for `count` new numbers, J times named rows, with covariance J P J^T + Q; Q is column-major. The
  /// parts' rows are the new numbers. O(n d count).
  [[nodiscard]] bool extend(std::span<const JacobianPart<S>> parts, int count, const S* q) {
    name(parts);
    stride_ = padded<S>(size() + count);
    work_.open((index(named_count()) + index(count)) * stride_ + scratch_for(count));
    gathered_ = gather(index(named_count()));
    added_ = rows_of_zeros(index(count));
    for (std::size_t i = 0; i < parts.size(); ++i)
      for (int k = 0; k < parts[i].block.count; ++k)
        add_rows(added_, parts[i], k, row(gathered_, where_[i] + k));
    corner_ = work_.take(index(count) * index(count));
    std::copy_n(q, count * count, corner_);
    for (const auto& part : parts)
      for (int k = 0; k < part.block.count; ++k)
        for (int j = 0; j < part.rows; ++j)
          for (int i = 0; i < count; ++i)
            corner_[(part.first + j) * count + i] +=
                row(added_, i)[part.block.first + k] * part.jacobian[k * part.leading + j];
    mirror(corner_, count);
    make_room(size() + count);
    is_finite_ = finite_rows(added_, count);
    return is_finite_ && variances(corner_, count);
  }
  [[nodiscard]] int write_extension(int count) {
    const int first = place(count);
    for (int j = 0; j < count; ++j)
      for (int i = 0; i < count; ++i) row(added_, i)[first + j] = corner_[j * count + i];
    p_.scatter(first, count, added_, stride_);
    return first;
  }

  // Named rows become known: better, or exactly.

  /// What all rows learn where the named ones (each range once) move by `step` and get the covariance
  /// `posterior` (d x d; null for zero), and `added` new numbers with them (posterior is then of d + added).
  ///   K = P_:s P_ss^-1,   step_: = K step,   P <- P - K (P_ss - posterior) K^T
  /// through the Cholesky factor of P_ss along its largest pivots, so that it may be singular. False where
  /// the step leaves the directions in which the prior has variance, and for a posterior that is larger than
  /// P_ss in any direction while others are considered: those keep their covariance, and their share in what
  /// grows would be more than it holds. O(n d^2 + d^3).
  [[nodiscard]] bool learn(std::span<const RowRange> blocks, const S* step, const S* posterior, int added,
                           S& squared) {
    name(blocks);
    const int d = named_count();
    stride_ = padded<S>(size() + added);
    work_.open((4 * index(d) + index(added) + 1) * stride_ + scratch_for(d + added));
    gathered_ = gather(index(d));
    if (posterior != nullptr && others_are_considered() && !lowers_named(posterior, d + added)) return false;
    NamedRoot root;
    if (!factor_named(root)) return false;
    m_ = root.rank;
    S* const y = work_.take(index(d));
    if (!whiten_step(root, step, y, squared)) return false;
    whiten_gathered(root);
    step_ = rows_of_zeros(1);
    for (int k = 0; k < m_; ++k) add_scaled(step_, row(cross_, k), y[k], stride_);

    const View<S> with = small(m_, d + added), own = small(m_, m_);
    if (posterior != nullptr) whiten_posterior(root, posterior, with, own);
    less_ = rows_of_zeros(index(m_));  // (I - own) V
    for (int k = 0; k < m_; ++k)
      for (int l = 0; l < m_; ++l)
        add_scaled(row(less_, k), row(cross_, l), S(k == l ? 1 : 0) - own(k, l), stride_);
    // The named rows take the place of what was read of them.
    stabilised_ = gathered_;
    std::fill_n(stabilised_, index(d) * stride_, S(0));
    added_ = rows_of_zeros(index(added));
    for (int k = 0; k < m_; ++k) {
      for (int p = 0; p < d; ++p) add_scaled(row(stabilised_, p), row(cross_, k), with(k, p), stride_);
      for (int i = 0; i < added; ++i) add_scaled(row(added_, i), row(cross_, k), with(k, d + i), stride_);
    }
    put_learned(step, posterior, added);
    make_room(size() + added);
    const bool finite = finite_rows(stabilised_, d) && may_step() && finite_rows(added_, added);
    // Considered rows other than the named ones stay.
    for (int i = 0; i < size() && considered_count_ > 0; ++i)
      if (considered_[index(i)] != 0 && !is_named(i)) step_[i] = S(0);
    return find_certain(added) && finite;
  }
  /// Keeps what was learned; rows whose variance is nothing but rounding get none. New numbers are to be
  /// written by write_extension() afterwards.
  void write_learned() {
    subtract(less_, cross_, m_);
    scatter(stabilised_);
    for (const int i : certain_) p_.set_zero(i, 1);
  }

private:
  static constexpr std::size_t index(int i) { return static_cast<std::size_t>(i); }
  [[nodiscard]] S* row(S* rows, int i) const noexcept { return rows + index(i) * stride_; }
  [[nodiscard]] const S* row(const S* rows, int i) const noexcept { return rows + index(i) * stride_; }
  [[nodiscard]] int named_count() const noexcept { return static_cast<int>(named_rows_.size()); }
  [[nodiscard]] bool is_named(int i) const noexcept {
    return std::find(named_rows_.begin(), named_rows_.end(), i) != named_rows_.end();
  }

  /// More than the small matrices of a step of m numbers take.
  [[nodiscard]] std::size_t scratch_for(int m) const {
    const std::size_t d = index(named_count()) + index(m);
    return 8 * (d + 8) * (d + 8);
  }
  [[nodiscard]] S* zeros(std::size_t numbers) {
    S* const piece = work_.take(numbers);
    std::fill_n(piece, numbers, S(0));
    return piece;
  }
  [[nodiscard]] S* rows_of_zeros(std::size_t count) { return zeros(count * stride_); }

  [[nodiscard]] View<S> small(int rows, int cols) { return {zeros(index(rows) * index(cols)), rows, cols}; }
  /// What row i of whole rows has in the column of named row p.
  [[nodiscard]] S& named(S* rows, int i, int p) const { return row(rows, i)[named_rows_[index(p)]]; }

  // Of stabilise().

  /// K^T = L^-T W, a row for each number of the measurement.
  [[nodiscard]] S* gain_rows(const S* lower) {
    S* const gain = rows_of_zeros(index(m_));
    for (int j = m_ - 1; j >= 0; --j) {
      add_scaled(row(gain, j), row(cross_, j), S(1), stride_);
      for (int i = j + 1; i < m_; ++i) add_scaled(row(gain, j), row(gain, i), -lower[j * m_ + i], stride_);
      scale(row(gain, j), S(1) / lower[j * m_ + j]);
    }
    if (considered_count_ > 0) mask(gain, m_);
    return gain;
  }
  /// H, a column for each named row.
  [[nodiscard]] View<S> jacobian_over_named(std::span<const JacobianPart<S>> parts) {
    const View<S> h = small(m_, named_count());
    for (std::size_t i = 0; i < parts.size(); ++i)
      for (int k = 0; k < parts[i].block.count; ++k)
        for (int a = 0; a < parts[i].rows; ++a)
          h(parts[i].first + a, where_[i] + k) += parts[i].jacobian[k * parts[i].leading + a];
    return h;
  }
  /// Joseph's form of the named rows among one another from a root of theirs, (A L) (A L)^T + K R K^T:
  /// nothing negative is left of P_nn = L L^T. What there was may be as much as the least that keeps_digits()
  /// wants left of a variance: rounding of updates before, of larger variances. False where it is more.
  [[nodiscard]] bool squares_by_root(const View<S>& a, S* gain, const S* r, S* corner) {
    const int d = named_count(), m = m_;
    NamedRoot root;
    if (!factor_named(root, digits_left<S>)) return false;
    const View<S> al = small(d, d), kr = small(d, m);
    for (int p = 0; p < d; ++p) {
      for (int k = 0; k < root.rank; ++k)
        for (int q = k; q < d; ++q) al(p, k) += a(p, root.pivot(q)) * root(root.pivot(q), k);
      for (int i = 0; i < m; ++i)
        for (int k = 0; k < m; ++k) kr(p, i) += named(gain, k, p) * r[i * m + k];
    }
    for (int q = 0; q < d; ++q)
      for (int p = 0; p < d; ++p) {
        S sum(0);
        for (int k = 0; k < root.rank; ++k) sum += al(p, k) * al(q, k);
        for (int i = 0; i < m; ++i) sum += kr(p, i) * named(gain, i, q);
        corner[q * d + p] = sum;
      }
    mirror_mean(corner, d);
    return true;
  }
  /// H P = L W in the columns of the named rows.
  [[nodiscard]] View<S> predicted_of_named(const S* lower) {
    const View<S> hp = small(m_, named_count());
    for (int q = 0; q < hp.cols(); ++q)
      for (int i = 0; i < m_; ++i)
        for (int k = 0; k <= i; ++k) hp(i, q) += lower[k * m_ + i] * named(cross_, k, q);
    return hp;
  }

  // Of learn().

  [[nodiscard]] bool others_are_considered() const {
    int named = 0;
    for (const int i : named_rows_) named += considered_[index(i)];
    return considered_count_ > named;
  }
  /// P_ss - posterior (of `leading` rows, those of P_ss first) is a covariance but for the rounding of P_ss.
  [[nodiscard]] bool lowers_named(const S* posterior, int leading) {
    const int d = named_count();
    S* const less = work_.take(index(d) * index(d));
    for (int q = 0; q < d; ++q) {
      for (int p = 0; p < d; ++p) less[q * d + p] = named(gathered_, p, q) - posterior[q * leading + p];
      less[q * d + q] += no_variance<S> * named(gathered_, q, q);
    }
    return semi_definite(less, d);
  }

  /// P_ss = L L^T along its largest pivots, as pivoted_cholesky() leaves it: (p, k) is L of named row p and
  /// pivot k, for rows that are pivots from k on.
  struct NamedRoot {
    const S* numbers = nullptr;
    const S* diagonal = nullptr;  // of P_ss
    const int* pivots = nullptr;  // the named row of each pivot, then those without one
    int d = 0;
    int rank = 0;

    [[nodiscard]] int pivot(int k) const { return pivots[index(k)]; }
    S operator()(int p, int k) const { return numbers[pivot(k) * d + p]; }
  };
  [[nodiscard]] bool factor_named(NamedRoot& root, S rounding = S(2) * no_variance<S>) {
    const int d = named_count();
    order_.resize(index(d));
    S* const numbers = work_.take(index(d) * index(d));
    S* const diagonal = work_.take(index(d));
    for (int q = 0; q < d; ++q)
      for (int p = 0; p < d; ++p) numbers[q * d + p] = named(gathered_, p, q);
    root = {numbers, diagonal, order_.data(), d, 0};
    return pivoted_cholesky(numbers, d, order_.data(), diagonal, root.rank, rounding);
  }
  /// y of step = L y, and |y|^2. False where the step leaves the range of L.
  [[nodiscard]] bool whiten_step(const NamedRoot& root, const S* step, S* y, S& squared) {
    S* const left = work_.take(index(root.d));
    std::copy_n(step, root.d, left);
    squared = S(0);
    for (int k = 0; k < root.rank; ++k) {
      y[k] = left[root.pivot(k)] / root(root.pivot(k), k);
      squared += y[k] * y[k];
      for (int q = k; q < root.d; ++q) left[root.pivot(q)] -= root(root.pivot(q), k) * y[k];
    }
    for (int q = root.rank; q < root.d; ++q) {
      const int i = root.pivot(q);
      if (!(left[i] * left[i] <= no_variance<S> * root.diagonal[i] * (S(1) + squared))) return false;
    }
    return true;
  }
  /// cross_: V = L^-1 P_s:, so that P_:s P_ss^-1 P_s: = V^T V.
  void whiten_gathered(const NamedRoot& root) {
    cross_ = rows_of_zeros(index(root.rank));
    for (int k = 0; k < root.rank; ++k) {
      const int p = root.pivot(k);
      add_scaled(row(cross_, k), row(gathered_, p), S(1), stride_);
      for (int l = 0; l < k; ++l) add_scaled(row(cross_, k), row(cross_, l), -root(p, l), stride_);
      scale(row(cross_, k), S(1) / root(p, k));
    }
  }
  /// The covariance of y, after what was learned, with the named and the new numbers, and its own.
  static void whiten_posterior(const NamedRoot& root, const S* posterior, const View<S>& with,
                               const View<S>& own) {
    for (int j = 0; j < with.cols(); ++j)
      for (int k = 0; k < root.rank; ++k) {
        const int p = root.pivot(k);
        S sum = posterior[j * with.cols() + p];
        for (int l = 0; l < k; ++l) sum -= root(p, l) * with(l, j);
        with(k, j) = sum / root(p, k);
      }
    for (int j = 0; j < root.rank; ++j)
      for (int k = 0; k < root.rank; ++k) {
        const int p = root.pivot(k);
        S sum = with(j, p);
        for (int l = 0; l < k; ++l) sum -= root(p, l) * own(j, l);
        own(j, k) = sum / root(p, k);
      }
  }
  /// What is known of the named and the new numbers among one another is what was given, to the last bit.
  void put_learned(const S* step, const S* posterior, int added) {
    const int d = named_count(), all = d + added;
    corner_ = zeros(index(added) * index(added));
    for (int q = 0; q < d; ++q) {
      for (int p = 0; p < d; ++p)
        named(stabilised_, p, q) = posterior == nullptr ? S(0) : posterior[q * all + p];
      for (int i = 0; i < added; ++i) named(added_, i, q) = posterior[q * all + d + i];
      step_[named_rows_[index(q)]] = step[q];
    }
    for (int j = 0; j < added; ++j)
      for (int i = 0; i < added; ++i) corner_[j * added + i] = posterior[(d + j) * all + d + i];
  }
  /// certain_: rows whose variance becomes nothing but rounding, which then vary with nothing. False where a
  /// variance is not finite.
  [[nodiscard]] bool find_certain(int added) {
    bool good = true;
    certain_.clear();
    for (int i = 0; i < size(); ++i) {
      if (considered_[index(i)] != 0) continue;
      const S prior = p_.at(i, i);
      S lowered = prior;
      for (int k = 0; k < m_; ++k) lowered -= row(less_, k)[i] * row(cross_, k)[i];
      good = good && lowered - lowered == S(0);
      if (!(lowered > no_variance<S> * prior) && !is_named(i)) certain_.push_back(i);
    }
    for (const int i : certain_) {
      for (int p = 0; p < named_count(); ++p) row(stabilised_, p)[i] = S(0);
      for (int k = 0; k < added; ++k) row(added_, k)[i] = S(0);
    }
    return good;
  }

  /// Lists the distinct ranges, in rising order, and says which named row each part begins with.
  void name(std::span<const JacobianPart<S>> parts) {
    named_.clear();
    for (const auto& part : parts) named_.push_back(part.block);
    where_.resize(parts.size());
    list_named();
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const auto found = std::lower_bound(named_rows_.begin(), named_rows_.end(), parts[i].block.first);
      where_[i] = static_cast<int>(found - named_rows_.begin());
    }
  }
  void list_named() {
    std::sort(named_.begin(), named_.end(),
              [](const RowRange& a, const RowRange& b) { return a.first < b.first; });
    const auto same = [](const RowRange& a, const RowRange& b) { return a.first == b.first; };
    named_.erase(std::unique(named_.begin(), named_.end(), same), named_.end());
    named_rows_.clear();
    for (const RowRange& range : named_)
      for (int k = 0; k < range.count; ++k) named_rows_.push_back(range.first + k);
  }
  /// Takes the ranges as they come: each once, so that matrices given with them keep their order.
  void name(std::span<const RowRange> blocks) {
    named_.assign(blocks.begin(), blocks.end());
    named_rows_.clear();
    for (const RowRange& range : named_)
      for (int k = 0; k < range.count; ++k) named_rows_.push_back(range.first + k);
  }

  [[nodiscard]] S* gather(std::size_t count) {
    S* const to = work_.take(count * stride_);
    S* next = to;
    for (const RowRange& range : named_) {
      p_.gather(range.first, range.count, next, stride_);
      next += index(range.count) * stride_;
    }
    return to;
  }
  void scatter(const S* from) {
    for (const RowRange& range : named_) {
      p_.scatter(range.first, range.count, from, stride_);
      from += index(range.count) * stride_;
    }
  }

  /// Column k of a part's Jacobian times a row of the state.
  void add_rows(S* to, const JacobianPart<S>& part, int k, const S* from) {
    for (int a = 0; a < part.rows; ++a)
      if (const S factor = part.jacobian[k * part.leading + a]; factor != S(0))
        add_scaled(row(to, part.first + a), from, factor, stride_);
  }
  void scale(S* to, S factor) {
    for (std::size_t i = 0; i < stride_; ++i) to[i] *= factor;
  }
  /// Zero in the columns of considered rows.
  void mask(S* rows, int count) {
    for (int i = 0; i < size(); ++i)
      for (int k = 0; considered_[index(i)] != 0 && k < count; ++k) row(rows, k)[i] = S(0);
  }
  static void mirror(S* a, int n) {
    for (int j = 0; j < n; ++j)
      for (int i = j + 1; i < n; ++i) a[i * n + j] = a[j * n + i];
  }
  static void mirror_mean(S* a, int n) {
    for (int j = 0; j < n; ++j)
      for (int i = j + 1; i < n; ++i) a[i * n + j] = a[j * n + i] = S(0.5) * (a[i * n + j] + a[j * n + i]);
  }
  /// The square of named rows by named rows into whole rows.
  void put_corner(S* rows, const S* corner) {
    const int d = named_count();
    for (int j = 0; j < d; ++j)
      for (int i = 0; i < d; ++i) row(rows, i)[named_rows_[index(j)]] = corner[j * d + i];
  }
  [[nodiscard]] bool finite_rows(const S* rows, int count) const {
    S none(0);
    for (std::size_t i = 0; i < index(count) * stride_; ++i) none += rows[i] * S(0);
    return none == S(0);
  }
  static bool variances(const S* a, int n) {
    bool good = true;
    for (int i = 0; i < n; ++i) good = good && a[i * n + i] >= S(0);
    return good;
  }
  [[nodiscard]] bool semi_definite(const S* a, int n) {
    int rank = 0;
    order_.resize(index(n));
    S* const copy = work_.take(index(n) * index(n));
    S* const diagonal = work_.take(index(n));
    std::copy_n(a, n * n, copy);
    return pivoted_cholesky(copy, n, order_.data(), diagonal, rank);
  }

  /// What is left of every variance has digits above the rounding of what is taken from it, that of row k of
  /// W being the prior's by what the pivot k of H P H^T + R has lost: so many of the named rows, which can be
  /// had in another way, and two of the others, for which there is none.
  [[nodiscard]] bool keeps_digits(const S& of_named) const {
    using std::abs;
    using std::sqrt;
    constexpr S of_others = digits_left<S> / S(4);
    const S most = std::max(of_others, of_named) * static_cast<S>(m_) *
                   (m_ > 0 ? *std::max_element(losses_.begin(), losses_.end()) : S(1));
    bool good = true;
    for (int i = 0; i < size(); ++i) {
      if (considered_[index(i)] != 0) continue;
      const S prior = p_.at(i, i);
      S lowered = prior;
      for (int k = 0; k < m_; ++k) lowered -= row(cross_, k)[i] * row(cross_, k)[i];
      if (lowered >= most * prior) [[likely]]
        continue;
      S rounded(0);
      for (int k = 0; k < m_; ++k) rounded += abs(row(cross_, k)[i]) * losses_[index(k)];
      const S needed = (is_named(i) ? of_named : of_others) * sqrt(prior) * rounded;
      good = good && (needed == S(0) || lowered >= needed);
    }
    return good;
  }

  /// p -= left^T right, without the entries of considered rows in considered columns.
  void subtract(const S* left, const S* right, int count) {
    if (considered_count_ == 0) {
      p_.subtract_products(0, size(), left, right, stride_, count);
      return;
    }
    const auto by_runs = [&](bool considered, const S* by) {
      for (int first = 0; first < size();) {
        int last = first;
        while (last < size() && considered_[index(last)] == considered_[index(first)]) ++last;
        if ((considered_[index(first)] != 0) == considered)
          p_.subtract_products(first, last, left, by, stride_, count);
        first = last;
      }
    };
    by_runs(false, right);
    S* const masked = rows_of_zeros(index(count));
    std::copy_n(right, index(count) * stride_, masked);
    mask(masked, count);
    by_runs(true, masked);
  }

  void shrink(int rows) {
    p_.resize(rows);
    free_.resize(index(rows));
    considered_.resize(index(rows));
  }

  SymmetricRows<S> p_;
  std::vector<unsigned char> free_, considered_;  // by row
  ResetOnMove<int> free_count_, considered_count_;

  // Of the step that is being made.
  Workspace<S> work_;
  std::vector<RowRange> named_;
  std::vector<int> named_rows_, where_, order_, certain_, kept_, moved_;
  std::size_t stride_ = 0;
  int m_ = 0;
  std::vector<S> losses_;  // by row of W: how many times its rounding is that of P
  bool is_finite_ = true;
  S *gathered_ = nullptr, *cross_ = nullptr, *less_ = nullptr, *step_ = nullptr, *stabilised_ = nullptr,
    *added_ = nullptr, *corner_ = nullptr;
};

}}}  // namespace cairn::CAIRN_ABI::detail
