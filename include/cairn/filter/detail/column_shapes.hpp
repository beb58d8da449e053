// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Columns of matrices of a known shape: structured, triangular, symmetric; and transposition in registers,
/// which mirrors a covariance without a detour through memory.
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

#include <cairn/filter/detail/register_column.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// |x| lane by lane.
template <class Lane>
[[gnu::always_inline]] inline Lane magnitude(const Lane& x) {
  return x < Lane{} ? -x : x;
}

/// The smaller of two, in one instruction and without a branch; `a` where `b` is no number.
template <class S>
[[gnu::always_inline]] inline S lesser(const S& a, const S& b) {
  return b < a ? b : a;
}

/// Column j of a triangular matrix: zero after row j, or before it.
template <int N, class S>
[[gnu::always_inline]] inline void clear_after(Column<N, S>& column, int j) {
  using Lane = typename Column<N, S>::Lane;
  constexpr int width = Column<N, S>::width;
  each<Column<N, S>::count>([&](int k) {
    if constexpr (width == 1)
      column.lanes[k] = k <= j ? column.lanes[k] : S(0);
    else
      column.lanes[k] = lane_numbers<S, width>() <= Lane{} + S(j - k * width) ? column.lanes[k] : Lane{};
  });
}
template <int N, class S>
[[gnu::always_inline]] inline void clear_before(Column<N, S>& column, int j) {
  using Lane = typename Column<N, S>::Lane;
  constexpr int width = Column<N, S>::width;
  each<Column<N, S>::count>([&](int k) {
    if constexpr (width == 1)
      column.lanes[k] = k >= j ? column.lanes[k] : S(0);
    else
      column.lanes[k] = lane_numbers<S, width>() >= Lane{} + S(j - k * width) ? column.lanes[k] : Lane{};
  });
}

/// The number of a structured matrix at (Row, Col).
template <int Row, int Col, class A>
[[gnu::always_inline]] inline typename A::Scalar number_at(const A& a) {
  constexpr int found = [] {
    for (std::size_t e = 0; e < A::entries.size(); ++e)
      if (A::entries[e].row == Row && A::entries[e].column == Col) return static_cast<int>(e);
    return -1;
  }();
  if constexpr (found < 0)
    return typename A::Scalar(0);
  else
    return a.template value<static_cast<std::size_t>(found)>();
}

/// Column Col of a structured matrix, less the diagonal where asked. Put together from single numbers in
/// registers: an array of them would be stored number by number and loaded whole.
template <int Col, bool WithoutDiagonal, class A>
[[gnu::always_inline]] inline auto column_of(const A& a) {
  using S = typename A::Scalar;
  using Result = Column<A::row_count, S>;
  constexpr int w = Result::width;
  Result result;
  unrolled<static_cast<std::size_t>(Result::count)>([&](auto index) __attribute__((always_inline)) {
    constexpr int k = static_cast<int>(index);
    if constexpr (w == 1) {
      result.lanes[k] = WithoutDiagonal && k == Col ? S(0) : number_at<k, Col>(a);
    } else {
      [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
        result.lanes[k] = typename Result::Lane{(WithoutDiagonal && k * w + static_cast<int>(I) == Col
                                                     ? S(0)
                                                     : number_at<k * w + static_cast<int>(I), Col>(a))...};
      }(std::make_index_sequence<w>{});
    }
  });
  return result;
}

/// Transposes the W x W matrix whose rows are given: log2(W) rounds of exchanges.
template <class S, int W, class Lane>
[[gnu::always_inline]] inline void transpose_lanes(Lane (&rows)[W]) {
  unrolled<4>([&](auto round) __attribute__((always_inline)) {
    constexpr int s = 1 << static_cast<int>(round);
    if constexpr (s < W) {
      unrolled<static_cast<std::size_t>(W)>([&](auto row) __attribute__((always_inline)) {
        constexpr int i = static_cast<int>(row);
        if constexpr ((i & s) == 0) {
          const Lane a = rows[i], b = rows[i + s];
          rows[i] = shuffled<S, W, PickExchanged<W, s, false>>(a, b);
          rows[i + s] = shuffled<S, W, PickExchanged<W, s, true>>(a, b);
        }
      });
    }
  });
}

/// f(Row, Column) for every pair of numbers below Count, both known at compile time.
template <int Count, class F>
[[gnu::always_inline]] inline void unrolled_pairs(const F& f) {
  unrolled<static_cast<std::size_t>(Count * Count)>([&](auto pair) __attribute__((always_inline)) {
    constexpr int number = static_cast<int>(pair);
    f(std::integral_constant<int, number % Count>{}, std::integral_constant<int, number / Count>{});
  });
}

/// The W x W block of a square matrix in block row Row and block column Col, transposed: lane l of block[i]
/// is what stands in row Row W + i and column Col W + l; zero past the last column.
template <int Row, int Col, int N, class S, int W, class Lane>
[[gnu::always_inline]] inline void load_transposed(const Column<N, S> (&from)[N], Lane (&block)[W]) {
  unrolled<static_cast<std::size_t>(W)>([&](auto lane) __attribute__((always_inline)) {
    constexpr int j = Col * W + static_cast<int>(lane);
    if constexpr (j < N)
      block[lane] = from[j].lanes[Row];
    else
      block[lane] = Lane{};
  });
  transpose_lanes<S, W>(block);
}

/// to = from^T for square matrices.
template <int N, class S>
[[gnu::always_inline]] inline void transpose(const Column<N, S> (&from)[N], Column<N, S> (&to)[N]) {
  constexpr int w = Column<N, S>::width;
  if constexpr (w == 1) {
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) to[i].lanes[j] = from[j].lanes[i];
  } else {
    unrolled_pairs<Column<N, S>::count>([&](auto row, auto column) __attribute__((always_inline)) {
      typename Column<N, S>::Lane block[w];
      load_transposed<row(), column()>(from, block);
      unrolled<static_cast<std::size_t>(w)>([&](auto lane) __attribute__((always_inline)) {
        constexpr int i = row() * w + static_cast<int>(lane);
        if constexpr (i < N) to[i].lanes[column()] = block[lane];
      });
    });
  }
}

/// Copies what stands below the diagonal of a square matrix to above it.
template <int N, class S>
[[gnu::always_inline]] inline void mirror_lower(Column<N, S> (&columns)[N]) {
  constexpr int w = Column<N, S>::width;
  if constexpr (N == 1) {
    return;
  } else if constexpr (w == 1) {
    for (int j = 0; j < N; ++j)
      for (int i = j + 1; i < N; ++i) columns[i].lanes[j] = columns[j].lanes[i];
  } else {
    unrolled_pairs<Column<N, S>::count>([&](auto row, auto column) __attribute__((always_inline)) {
      if constexpr (row() >= column()) {
        typename Column<N, S>::Lane block[w];
        load_transposed<row(), column()>(columns, block);
        unrolled<static_cast<std::size_t>(w)>([&](auto lane) __attribute__((always_inline)) {
          constexpr int l = static_cast<int>(lane);
          constexpr int mirrored = row() * w + l;  // the rows of the block become columns
          if constexpr (mirrored < N) {
            auto& target = columns[mirrored].lanes[column()];
            if constexpr (row() == column())  // above the diagonal is what stands before lane l
              target = shuffled<S, w, PickHead<w, l>>(target, block[l]);
            else
              target = block[l];
          }
        });
      }
    });
  }
}

}}}  // namespace cairn::CAIRN_ABI::detail
