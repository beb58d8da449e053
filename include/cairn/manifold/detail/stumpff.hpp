// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Stumpff functions: the trigonometric quotients of rigid motions, without cancellation at small angles.
///
///   c_k(x) = sum_j (-x)^j / (2j + k)!       x = angle^2
///   c_0 = cos a   c_1 = sin a / a   c_2 = (1 - cos a) / a^2   c_3 = (a - sin a) / a^3   ...
///   c_k = 1/k! - x c_{k+2}                                                               (1)
///
/// (K. Stumpff, Himmelsmechanik I, 1959.) Below x = 1 the last two come from their series and the others from
/// (1) downwards, which loses nothing. Above it the first two come from sine and cosine, and the others, as
/// long as (1) upwards would lose digits (x < 10, just beyond half a turn), from longer series and (1)
/// downwards.
#pragma once

#include <cmath>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// c[k] = c_k(x), k = 0..5.
template <class S>
struct Stumpff {
  S c[6];
};

/// The six functions at x = angle^2 >= 0, to a few units of the last place. Works for any scalar with
/// arithmetic, order, and sqrt, sin and cos found by argument; derivatives of dual numbers are finite at 0.
template <class S>
[[nodiscard]] Stumpff<S> stumpff(const S& x) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  Stumpff<S> result;
  auto& c = result.c;
  if (x < S(1)) {
    c[4] = S(1);
    c[5] = S(1);
    for (int j = 9; j >= 1; --j) {
      c[4] = S(1) - x * c[4] / S((2 * j + 3) * (2 * j + 4));
      c[5] = S(1) - x * c[5] / S((2 * j + 4) * (2 * j + 5));
    }
    c[4] = c[4] / S(24);
    c[5] = c[5] / S(120);
    c[3] = S(1) / S(6) - x * c[5];
    c[2] = S(1) / S(2) - x * c[4];
    c[1] = S(1) - x * c[3];
    c[0] = S(1) - x * c[2];
  } else if (x < S(10)) {
    const S angle = sqrt(x);
    c[4] = S(1);
    c[5] = S(1);
    for (int j = 14; j >= 1; --j) {
      c[4] = S(1) - x * c[4] / S((2 * j + 3) * (2 * j + 4));
      c[5] = S(1) - x * c[5] / S((2 * j + 4) * (2 * j + 5));
    }
    c[4] = c[4] / S(24);
    c[5] = c[5] / S(120);
    c[3] = S(1) / S(6) - x * c[5];
    c[2] = S(1) / S(2) - x * c[4];
    c[0] = cos(angle);
    c[1] = sin(angle) / angle;
  } else {
    const S angle = sqrt(x);
    c[0] = cos(angle);
    c[1] = sin(angle) / angle;
    c[2] = (S(1) - c[0]) / x;
    c[3] = (S(1) - c[1]) / x;
    c[4] = (S(1) / S(2) - c[2]) / x;
    c[5] = (S(1) / S(6) - c[3]) / x;
  }
  return result;
}

}}}  // namespace cairn::CAIRN_ABI::detail
