// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Matrices whose zeros and ones are known when the program is compiled.
///
/// A model that returns one of these as its Jacobian lets every filter skip the zeros:
///
/// ```cpp
/// const cairn::Structured<"1.* .1. ..1"> F{dt};  // 1 and 0 where '1' and '.', the next number where '*'
/// const cairn::Identity<3> H_landmark;           // a landmark seen directly
/// const cairn::Selection<6, 0, 2> H_position;    // rows of the identity: two positions out of six states
/// ```
///
/// Each converts to the plain Matrix it stands for, so nothing else needs to know.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Rows of '1', '.' and '*', separated by blanks; as a template argument: Structured<"1* .1">.
template <std::size_t Size>
struct Pattern {
  char text[Size]{};

  constexpr Pattern() = default;
  // NOLINTNEXTLINE(google-explicit-constructor): a literal is a pattern
  consteval Pattern(const char (&literal)[Size]) {
    for (std::size_t i = 0; i < Size; ++i) text[i] = literal[i];
  }
  [[nodiscard]] constexpr int columns() const {
    int count = 0;
    for (std::size_t i = 0; i + 1 < Size && text[i] != ' '; ++i) ++count;
    return count;
  }
  [[nodiscard]] constexpr int rows() const { return static_cast<int>(Size) / (columns() + 1); }
  [[nodiscard]] constexpr char at(int row, int column) const {
    return text[static_cast<std::size_t>(row * (columns() + 1) + column)];
  }
  [[nodiscard]] constexpr int count(char kind) const {
    int result = 0;
    for (std::size_t i = 0; i + 1 < Size; ++i) result += text[i] == kind ? 1 : 0;
    return result;
  }
  /// Rows of equal length that hold nothing but '1', '.' and '*'.
  [[nodiscard]] constexpr bool valid() const {
    for (std::size_t i = 0; i + 1 < Size; ++i) {
      const bool gap = static_cast<int>(i) % (columns() + 1) == columns();
      const char c = text[i];
      if (gap ? c != ' ' : (c != '1' && c != '.' && c != '*')) return false;
    }
    return rows() * (columns() + 1) == static_cast<int>(Size);
  }
};

namespace detail {

/// Place of one entry that is not zero; slot counts the '*' in reading order and is -1 for a '1'.
struct Entry {
  int row = 0;
  int column = 0;
  int slot = -1;
};

template <auto P>
consteval auto entries_of() {
  std::array<Entry, static_cast<std::size_t>(P.count('1') + P.count('*'))> entries{};
  std::size_t next = 0;
  int slot = 0;
  for (int i = 0; i < P.rows(); ++i)
    for (int j = 0; j < P.columns(); ++j)
      if (P.at(i, j) != '.') entries[next++] = {i, j, P.at(i, j) == '*' ? slot++ : -1};
  return entries;
}

template <int Columns, int... Chosen>
consteval auto selection_pattern() {
  static_assert(((Chosen >= 0 && Chosen < Columns) && ...),
                "cairn: Selection<N, rows...> takes rows of the N x N identity, numbered from 0");
  constexpr int rows = sizeof...(Chosen);
  Pattern<static_cast<std::size_t>(rows) * (Columns + 1)> pattern;
  int row = 0;
  const auto write = [&](int chosen) {
    for (int j = 0; j <= Columns; ++j)
      pattern.text[row * (Columns + 1) + j] = j == Columns ? ' ' : (j == chosen ? '1' : '.');
    ++row;
  };
  (write(Chosen), ...);
  pattern.text[rows * (Columns + 1) - 1] = '\0';
  return pattern;
}

template <int N>
consteval auto diagonal_pattern() {
  Pattern<static_cast<std::size_t>(N) * (N + 1)> pattern;
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= N; ++j) pattern.text[i * (N + 1) + j] = j == N ? ' ' : (j == i ? '*' : '.');
  pattern.text[N * (N + 1) - 1] = '\0';
  return pattern;
}

template <std::size_t... I>
consteval auto identity_pattern(std::index_sequence<I...>) {
  return selection_pattern<static_cast<int>(sizeof...(I)), static_cast<int>(I)...>();
}

/// Calls body(std::integral_constant<std::size_t, i>) for i in [0, Count).
template <std::size_t Count, class Body>
[[gnu::always_inline]] inline constexpr void unrolled(Body&& body) {
  [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
    (body(std::integral_constant<std::size_t, I>{}), ...);
  }(std::make_index_sequence<Count>{});
}

}  // namespace detail

/// A matrix of the given pattern. Aggregate: the values of its '*' in reading order.
template <Pattern P, class S = double>
struct Structured {
  static_assert(P.valid(), "a pattern has rows of equal length of '1', '.' and '*', separated by one blank");
  using Scalar = S;
  static constexpr auto entries = detail::entries_of<P>();
  static constexpr int row_count = P.rows();
  static constexpr int column_count = P.columns();
  using Dense = Matrix<row_count, column_count, S>;

  std::array<S, static_cast<std::size_t>(P.count('*'))> values{};

  [[nodiscard]] static constexpr int rows() noexcept { return row_count; }
  [[nodiscard]] static constexpr int cols() noexcept { return column_count; }

  /// The value of entry number E of `entries`.
  template <std::size_t E>
  [[nodiscard]] S value() const {
    if constexpr (entries[E].slot < 0)
      return S(1);
    else
      return values[static_cast<std::size_t>(entries[E].slot)];
  }

  /// A x, without the zeros.
  [[nodiscard]] Vector<row_count, S> operator*(const Vector<column_count, S>& x) const {
    Vector<row_count, S> y = Vector<row_count, S>::Zero();
    detail::unrolled<entries.size()>([&](auto e) __attribute__((always_inline)) {
      if constexpr (entries[e].slot < 0)
        y(entries[e].row) += x(entries[e].column);
      else
        y(entries[e].row) += this->template value<e>() * x(entries[e].column);
    });
    return y;
  }

  [[nodiscard]] Dense dense() const {
    Dense result = Dense::Zero();
    detail::unrolled<entries.size()>(
        [&](auto e) { result(entries[e].row, entries[e].column) = this->template value<e>(); });
    return result;
  }
  // NOLINTNEXTLINE(google-explicit-constructor): stands for the matrix
  operator Dense() const { return dense(); }
};

/// The N x N identity, known at compile time.
template <int N, class S = double>
using Identity = Structured<detail::identity_pattern(std::make_index_sequence<N>{}), S>;

/// A diagonal N x N matrix, as noise often is: Diagonal<3>{{0.1, 0.1, 0.02}}.
template <int N, class S = double>
using Diagonal = Structured<detail::diagonal_pattern<N>(), S>;

/// Rows `Chosen` of the N x N identity: a sensor that sees those states.
template <int N, int... Chosen>
using Selection = Structured<detail::selection_pattern<N, Chosen...>(), double>;

namespace detail {

template <class T>
inline constexpr bool is_structured = false;
template <Pattern P, class S>
inline constexpr bool is_structured<Structured<P, S>> = true;

/// A square pattern with ones on the diagonal and nothing else.
template <class T>
inline constexpr bool is_identity = false;
template <Pattern P, class S>
inline constexpr bool is_identity<Structured<P, S>> = [] {
  bool good = P.rows() == P.columns() && P.count('*') == 0 && P.count('1') == P.rows();
  for (int i = 0; good && i < P.rows(); ++i) good = P.at(i, i) == '1';
  return good;
}();

/// Nothing off the diagonal, and every number of the diagonal given.
template <class T>
inline constexpr bool is_diagonal = false;
template <Pattern P, class S>
inline constexpr bool is_diagonal<Structured<P, S>> = [] {
  bool good = P.rows() == P.columns() && P.count('1') == 0 && P.count('*') == P.rows();
  for (int i = 0; good && i < P.rows(); ++i) good = P.at(i, i) == '*';
  return good;
}();

/// The plain matrix of anything that is or stands for one.
template <class A>
[[nodiscard]] decltype(auto) dense_of(const A& a) {
  if constexpr (is_structured<A>)
    return a.dense();
  else
    return (a);
}

}  // namespace detail

}}  // namespace cairn::CAIRN_ABI
