// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Eigenvalues and eigenvectors of a symmetric matrix by Jacobi's rotations (cyclic; Golub and Van Loan,
/// "Matrix Computations", 4th ed., section 8.5), in plain loops over the standard library.
///
/// A plane is left alone once its entry is below rounding of both diagonal entries: what is left out is a few
/// roundings of the largest eigenvalue. Made for matrices of up to a few hundred rows.
///
/// ```cpp
/// std::array<double, 4> a{2, 1, 1, 2}, vectors;
/// std::array<double, 2> values;
/// cairn::symmetric_eigen(std::span(a), std::span(values), std::span(vectors));  // values 3 and 1
/// ```
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// Turns the plane of axes p and q so that a[p][q] becomes zero; `vectors` turns along.
template <class S>
[[gnu::always_inline]] inline void rotate_plane(S* a, S* vectors, std::size_t n, std::size_t p,
                                                std::size_t q) noexcept {
  const S theta = (a[q * n + q] - a[p * n + p]) / (2 * a[p * n + q]);
  const S t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
  const S c = 1 / std::sqrt(t * t + 1), s = t * c;
  const auto turn = [c, s](S& x, S& y) {
    const S old = x;
    x = c * old - s * y;
    y = s * old + c * y;
  };
  for (std::size_t k = 0; k < n; ++k) turn(a[p * n + k], a[q * n + k]);
  for (std::size_t k = 0; k < n; ++k) turn(vectors[p * n + k], vectors[q * n + k]);
  for (std::size_t k = 0; k < n; ++k) turn(a[k * n + p], a[k * n + q]);
  a[p * n + q] = a[q * n + p] = 0;
}

}  // namespace detail

/// Writes the n eigenvalues of `a`, largest first, to `values` and the unit eigenvectors, one after the other
/// in the same order, to `vectors`; `a` (n x n, both triangles) is used up. Of equal eigenvalues any basis of
/// their space. Rotations end where the entries off the diagonal sum up to no more than `tolerance` times the
/// diagonal's; 0: where none would change a digit. False, and nothing of use, where numbers are not finite or
/// so large that sums of them are not, or where 30 sweeps do not do (8 are many). O(n^3) a sweep; fixed
/// extents let small sizes be unrolled.
template <class S, std::size_t Square, std::size_t Size>
bool symmetric_eigen(std::span<S, Square> a, std::span<S, Size> values, std::span<S, Square> vectors,
                     S tolerance = S(0)) {
  static_assert(Square == std::dynamic_extent || Size == std::dynamic_extent || Square == Size * Size,
                "symmetric_eigen: n values take a matrix and vectors of n x n numbers");
  const std::size_t n = values.size();
  CAIRN_EXPECTS(a.size() == n * n && vectors.size() == n * n,
                "symmetric_eigen: n values take a matrix and vectors of n x n numbers");
  constexpr S negligible = std::numeric_limits<S>::epsilon() * S(0.045);
  std::fill(vectors.begin(), vectors.end(), S(0));
  for (std::size_t i = 0; i < n; ++i) vectors[i * n + i] = 1;
  bool done = false;
  for (int sweep = 0; sweep < 30 && !done; ++sweep) {
    S rest = 0, diagonal = 0;
    for (std::size_t p = 0; p < n; ++p) {
      diagonal += std::abs(a[p * n + p]);
      for (std::size_t q = p + 1; q < n; ++q) rest += std::abs(a[p * n + q]);
    }
    if (!std::isfinite(4 * (rest + diagonal))) return false;
    done = true;
    if (rest <= tolerance * diagonal) break;
    for (std::size_t p = 0; p + 1 < n; ++p)
      for (std::size_t q = p + 1; q < n; ++q) {
        // Smaller than rounding of both diagonal entries: a rotation would change nothing.
        if (std::abs(a[p * n + q]) <= negligible * (std::abs(a[p * n + p]) + std::abs(a[q * n + q])))
          continue;
        done = false;
        detail::rotate_plane(a.data(), vectors.data(), n, p, q);
      }
  }
  for (std::size_t i = 0; i < n; ++i) values[i] = a[i * n + i];
  for (std::size_t i = 1; i < n; ++i)
    for (std::size_t j = i; j > 0 && values[j] > values[j - 1]; --j) {
      std::swap(values[j], values[j - 1]);
      for (std::size_t k = 0; k < n; ++k) std::swap(vectors[j * n + k], vectors[(j - 1) * n + k]);
    }
  return done;
}

}}  // namespace cairn::CAIRN_ABI
