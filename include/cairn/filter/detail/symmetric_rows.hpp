// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A symmetric matrix that grows: its lower triangle by rows, each padded to whole cache lines.
///
/// Rows come in bands as high as a line is long; those of a band have equal length, so the place of a row is
/// a closed form and rows are appended without moving any. The padding right of the diagonal belongs to
/// nobody: products run over it, nothing reads it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#include <cairn/core/reset_on_move.hpp>
#include <cairn/filter/detail/register_column.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Numbers of one cache line.
template <class S>
struct alignas(64) CacheLine {
  static constexpr int count = static_cast<int>(64 / sizeof(S));
  S numbers[static_cast<std::size_t>(count)];
};

/// The widest register of the target, for whole lines of S.
template <class S>
using CacheLineLane = RegisterFor<S, CacheLine<S>::count>;

/// Rows of numbers that begin on a line and are zero in the padding, `stride` numbers apart.
template <class S>
[[nodiscard]] constexpr std::size_t padded(int numbers) {
  constexpr int line = CacheLine<S>::count;
  return static_cast<std::size_t>((numbers + line - 1) / line) * line;
}

/// to[0 .. count) += factor * from, count in whole lines.
template <class S>
void add_scaled(S* to, const S* from, S factor, std::size_t count) {
  using Lane = CacheLineLane<S>;
  for (std::size_t i = 0; i < count; i += sizeof(Lane) / sizeof(S)) {
    Lane sum, term;
    std::memcpy(&sum, to + i, sizeof(Lane));
    std::memcpy(&term, from + i, sizeof(Lane));
    sum += term * factor;
    std::memcpy(to + i, &sum, sizeof(Lane));
  }
}

/// Capacity for `count`, at least twice the last: what is pushed afterwards neither throws nor moves.
template <class T>
void room_for(std::vector<T>& list, std::size_t count) {
  if (list.capacity() < count) list.reserve(std::max(count, 2 * list.capacity()));
}

template <class S>
class SymmetricRows {
  static_assert(std::is_floating_point_v<S>, "a growing covariance is of float or double");

public:
  static constexpr int line = CacheLine<S>::count;

  [[nodiscard]] int size() const noexcept { return size_; }

  /// New rows are zero. Throws only where there is no room.
  void resize(int rows) {
    lines_.resize(lines_before(rows));
    size_ = rows;
  }
  void make_room(int rows) { room_for(lines_, lines_before(rows)); }
  [[nodiscard]] std::size_t bytes() const noexcept { return lines_.capacity() * sizeof(CacheLine<S>); }

  /// Columns 0 to i of row i.
  [[nodiscard]] S* row(int i) noexcept { return lines_[lines_before(i)].numbers; }
  [[nodiscard]] const S* row(int i) const noexcept { return lines_[lines_before(i)].numbers; }
  [[nodiscard]] S at(int i, int j) const noexcept { return i >= j ? row(i)[j] : row(j)[i]; }

  /// Copies whole rows of the symmetric matrix, `stride` apart and zero from size() to there. O(n count).
  void gather(int first, int count, S* to, std::size_t stride) const {
    for (int k = 0; k < count; ++k) {
      S* const out = to + static_cast<std::size_t>(k) * stride;
      std::memcpy(out, row(first + k), static_cast<std::size_t>(first + k + 1) * sizeof(S));
      for (int i = first + k + 1; i < first + count; ++i) out[i] = row(i)[first + k];
      for (std::size_t i = static_cast<std::size_t>(size_); i < stride; ++i) out[i] = S(0);
    }
    for (int i = first + count; i < size_; ++i) {
      const S* const from = row(i) + first;
      for (int k = 0; k < count; ++k) to[static_cast<std::size_t>(k) * stride + index(i)] = from[k];
    }
  }

  /// Writes whole rows, and with them the columns that mirror them. Of the square where they cross the lower
  /// triangle is read. O(n count).
  void scatter(int first, int count, const S* from, std::size_t stride) {
    for (int k = 0; k < count; ++k)
      std::memcpy(row(first + k), from + static_cast<std::size_t>(k) * stride,
                  static_cast<std::size_t>(first + k + 1) * sizeof(S));
    for (int i = first + count; i < size_; ++i) {
      S* const to = row(i) + first;
      for (int k = 0; k < count; ++k) to[k] = from[static_cast<std::size_t>(k) * stride + index(i)];
    }
  }

  void set_zero(int first, int count) {
    for (int k = 0; k < count; ++k)
      std::memset(row(first + k), 0, static_cast<std::size_t>(first + k + 1) * sizeof(S));
    for (int i = first + count; i < size_; ++i)
      std::memset(row(i) + first, 0, static_cast<std::size_t>(count) * sizeof(S));
  }

  /// Turns D rows and the columns that mirror them: A P A^T for A = 1 but for the given D x D (column-major)
  /// on these rows. O(n D^2).
  template <int D>
  void turn(int first, const S* by) {
    const auto turned = [&](const S(&v)[D], int k) {
      S sum(0);
      for (int l = 0; l < D; ++l) sum += by[l * D + k] * v[l];
      return sum;
    };
    for (int i = 0; i < size_; ++i) {
      if (i == first) i += D;
      if (i >= size_) break;
      S v[D];
      for (int k = 0; k < D; ++k) v[k] = at(first + k, i);
      for (int k = 0; k < D; ++k) (i < first ? row(first + k)[i] : row(i)[first + k]) = turned(v, k);
    }
    S half[D][D];  // half[j] = A times column j of the square
    for (int j = 0; j < D; ++j) {
      S v[D];
      for (int k = 0; k < D; ++k) v[k] = at(first + k, first + j);
      for (int k = 0; k < D; ++k) half[j][k] = turned(v, k);
    }
    for (int i = 0; i < D; ++i) {
      S v[D];
      for (int j = 0; j < D; ++j) v[j] = half[j][i];
      for (int k = 0; k <= i; ++k) row(first + i)[first + k] = turned(v, k);
    }
  }

  /// Drops all rows and columns but these, given in rising order. O(n^2).
  void keep(std::span<const int> kept) {
    for (int i = 0; i < static_cast<int>(kept.size()); ++i) {
      S* const to = row(i);
      const S* const from = row(kept[index(i)]);  // never before `to`
      for (int j = 0; j <= i; ++j) to[j] = from[kept[index(j)]];
    }
    resize(static_cast<int>(kept.size()));
  }

  /// Subtracts sum_k left[k][i] right[k][j] from the entries (i, j <= i) of the rows [first, last). Both are
  /// `count` rows, `stride` apart, zero from size() on. The one pass over the matrix that an update makes.
  void subtract_products(int first, int last, const S* left, const S* right, std::size_t stride, int count) {
    const auto by = [&](auto rows, auto terms) {
      constexpr int together = rows;
      for (int i = first; i < last;) {
        if (i % together == 0 && i + together <= last) {
          subtract_rows<together, terms>(i, left + i, right, stride, count);
          i += together;
        } else {
          subtract_rows<1, 0>(i, left + i, right, stride, count);
          ++i;
        }
      }
    };
    using std::integral_constant;
    // As many rows together as leave the factors in the sixteen registers of the smallest targets.
    if (count == 1) return by(integral_constant<int, 4>{}, integral_constant<int, 1>{});
    if (count == 2) return by(integral_constant<int, 4>{}, integral_constant<int, 2>{});
    if (count == 3) return by(integral_constant<int, 2>{}, integral_constant<int, 3>{});
    by(integral_constant<int, 4>{}, integral_constant<int, 0>{});
  }

private:
  using Lane = CacheLineLane<S>;
  static constexpr int width = static_cast<int>(sizeof(Lane) / sizeof(S));
  static constexpr std::size_t index(int i) { return static_cast<std::size_t>(i); }

  /// Lines of all rows before row i: in band b each row has b + 1.
  [[nodiscard]] static std::size_t lines_before(int i) noexcept {
    const std::size_t band = index(i) / line, within = index(i) % line;
    return line * (band * (band + 1) / 2) + within * (band + 1);
  }

  /// Rows of one band; `left` begins at theirs. Terms is `count`, or 0 for any.
  template <int Rows, int Terms>
  void subtract_rows(int i, const S* left, const S* right, std::size_t stride, int count) {
    S* rows[Rows];
    for (int r = 0; r < Rows; ++r) rows[r] = row(i + r);
    const int end = (i / line + 1) * line;
    int column = 0;
    if constexpr (Terms > 0) {
      Lane factors[Rows][Terms];
      each<Rows>([&](int r) __attribute__((always_inline)) {
        each<Terms>(
            [&](int k) { factors[r][k] = Lane{} + left[static_cast<std::size_t>(k) * stride + index(r)]; });
      });
      for (; column < end; column += width) {
        Lane terms[Terms];
        each<Terms>([&](int k) {
          std::memcpy(&terms[k], right + static_cast<std::size_t>(k) * stride + column, sizeof(Lane));
        });
        each<Rows>([&](int r) __attribute__((always_inline)) {
          Lane sum;
          std::memcpy(&sum, rows[r] + column, sizeof(Lane));
          each<Terms>([&](int k) { sum -= terms[k] * factors[r][k]; });
          std::memcpy(rows[r] + column, &sum, sizeof(Lane));
        });
      }
    } else {
      for (; column + 2 * width <= end; column += 2 * width)
        subtract_tile<Rows, 2>(rows, left, right, stride, count, column);
      for (; column < end; column += width) subtract_tile<Rows, 1>(rows, left, right, stride, count, column);
    }
  }
  template <int Rows, int Lanes>
  [[gnu::always_inline]] static void subtract_tile(S* const (&rows)[Rows], const S* left, const S* right,
                                                   std::size_t stride, int count, int column) {
    Lane sums[Rows][Lanes];
    each<Rows>([&](int r) __attribute__((always_inline)) {
      each<Lanes>([&](int l) { std::memcpy(&sums[r][l], rows[r] + column + l * width, sizeof(Lane)); });
    });
    for (int k = 0; k < count; ++k) {
      const S* const factors = left + static_cast<std::size_t>(k) * stride;
      const S* const from = right + static_cast<std::size_t>(k) * stride + column;
      Lane terms[Lanes];
      each<Lanes>([&](int l) { std::memcpy(&terms[l], from + l * width, sizeof(Lane)); });
      each<Rows>([&](int r) __attribute__((always_inline)) {
        const S factor = factors[r];
        each<Lanes>([&](int l) { sums[r][l] -= terms[l] * factor; });
      });
    }
    each<Rows>([&](int r) __attribute__((always_inline)) {
      each<Lanes>([&](int l) { std::memcpy(rows[r] + column + l * width, &sums[r][l], sizeof(Lane)); });
    });
  }

  std::vector<CacheLine<S>> lines_;
  ResetOnMove<int> size_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
