// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Square root, sine, cosine and arcus tangent of packs.
///
/// sin and cos reduce by multiples of pi/2 held in two parts and use the minimax polynomials of fdlibm (Sun
/// Microsystems 1993); atan2 uses the rational approximation of the Cephes library (S. Moshier 1989) on
/// [-tan(pi/8), tan(pi/8)]. Errors are below 2.5 ulp. Arguments beyond 1e5, packs of other types than double
/// and other targets go number by number through <cmath>. NaN and infinity give NaN.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include <cairn/manifold/pack.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// a0 + x (a1 + x (a2 + ...)).
template <class P, class... Rest>
[[gnu::always_inline]] inline P horner(const P& x, double a0, const Rest&... rest) {
  if constexpr (sizeof...(Rest) == 0)
    return P(a0);
  else
    return P(a0) + x * horner(x, rest...);
}

template <int W>
struct SineCosine {
  Pack<double, W> sine;
  Pack<double, W> cosine;
};

/// For |x| <= 1e5.
template <int W>
[[gnu::always_inline]] inline SineCosine<W> sine_cosine(const Pack<double, W>& x) {
  using P = Pack<double, W>;
  using Bits = Lanes<std::int64_t, W>;
  constexpr double magic = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to whole numbers
  const P shifted = x * P(0.63661977236758134308) + P(magic);
  const P turns = shifted - P(magic);
  const P r = (x - turns * P(1.57079632673412561417)) - turns * P(6.07710050650619224932e-11);
  Bits quadrant;
  std::memcpy(&quadrant, &shifted.lanes, sizeof(quadrant));
  const P r2 = r * r;
  const P s =
      r + r * r2 *
              horner(r2, -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
                     2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10);
  const P c = P(1.0) - (P(0.5) * r2 - r2 * r2 *
                                          horner(r2, 4.16666666666666019037e-02, -1.38888888888741095749e-03,
                                                 2.48015872894767294178e-05, -2.75573143513906633035e-07,
                                                 2.08757232129817482790e-09, -1.13596475577881948265e-11));
  const Bits odd = (quadrant & 1) != 0;
  P sine = P::of(odd ? c.lanes : s.lanes);
  P cosine = P::of(odd ? s.lanes : c.lanes);
  sine = P::of((quadrant & 2) != 0 ? -sine.lanes : sine.lanes);
  cosine = P::of(((quadrant + 1) & 2) != 0 ? -cosine.lanes : cosine.lanes);
  return {sine, cosine};
}

template <int W>
[[gnu::always_inline]] inline bool within(const Pack<double, W>& x, double bound) {
  bool inside = true;
  const auto mask = abs(x) <= Pack<double, W>(bound);
  for (int l = 0; l < W; ++l) inside &= mask[l] != 0;
  return inside;
}

/// atan(t) for t in [0, 1], given as smaller / larger >= 0.
template <int W>
[[gnu::always_inline]] inline Pack<double, W> arc_of_ratio(const Pack<double, W>& smaller,
                                                           const Pack<double, W>& larger) {
  using P = Pack<double, W>;
  const auto steep = smaller > larger * P(0.41421356237309504880);  // tan(pi/8): turn by pi/4
  const P up = select(steep, smaller - larger, smaller);
  const P down = select(steep, smaller + larger, larger);
  const P t = select(down == P(0.0), up, up / down);  // atan2(0, 0) is 0
  const P t2 = t * t;
  const P numerator =
      horner(t2, -6.485021904942025371773e1, -1.228866684490136173410e2, -7.500855792314704667340e1,
             -1.615753718733365076637e1, -8.750608600031904122785e-1);
  const P denominator =
      horner(t2, 1.945506571482613964425e2, 4.853903996359136964868e2, 4.328810604912902668951e2,
             1.650270098316988542046e2, 2.485846490142306297962e1, 1.0);
  const P arc = t + t * t2 * (numerator / denominator);
  return select(steep, P(0.78539816339744830962) + (arc + P(3.061616997868383e-17)), arc);
}

}  // namespace detail

template <class S, int W>
[[gnu::always_inline]] inline Pack<S, W> sqrt(const Pack<S, W>& a) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<S, double> && W == 8)
    return Pack<S, W>::of(_mm512_maskz_sqrt_pd(0xff, a.lanes));
#endif
#if defined(__AVX__)
  if constexpr (std::is_same_v<S, double> && W == 4) return Pack<S, W>::of(_mm256_sqrt_pd(a.lanes));
#endif
#if defined(__SSE2__)
  if constexpr (std::is_same_v<S, double> && W == 2) return Pack<S, W>::of(_mm_sqrt_pd(a.lanes));
#endif
  return Pack<S, W>::map([](S v) { return std::sqrt(v); }, a);
}

template <class S, int W>
[[gnu::always_inline]] inline Pack<S, W> sin(const Pack<S, W>& a) {
  if constexpr (std::is_same_v<S, double>)
    if (detail::within(a, 1e5)) [[likely]]
      return detail::sine_cosine(a).sine;
  return Pack<S, W>::map([](S v) { return std::sin(v); }, a);
}

template <class S, int W>
[[gnu::always_inline]] inline Pack<S, W> cos(const Pack<S, W>& a) {
  if constexpr (std::is_same_v<S, double>)
    if (detail::within(a, 1e5)) [[likely]]
      return detail::sine_cosine(a).cosine;
  return Pack<S, W>::map([](S v) { return std::cos(v); }, a);
}

/// The angle of (x, y), in [-pi, pi].
template <class S, int W>
[[gnu::always_inline]] inline Pack<S, W> atan2(const Pack<S, W>& y, const Pack<S, W>& x) {
  using P = Pack<S, W>;
  if constexpr (std::is_same_v<S, double>) {
    const P across = abs(y), along = abs(x);
    const auto steep = across > along;
    const P arc = detail::arc_of_ratio(select(steep, along, across), select(steep, across, along));
    const P first = select(steep, P(1.57079632679489661923) - (arc - P(6.123233995736766e-17)), arc);
    const P half = select(x < P(0.0), P(3.14159265358979323846) - (first - P(1.2246467991473532e-16)), first);
    return select(y < P(0.0), -half, half);
  } else {
    P result;
    for (int l = 0; l < W; ++l) result.lanes[l] = std::atan2(y.lanes[l], x.lanes[l]);
    return result;
  }
}

/// The angle equal to `a` modulo 2 pi in [-pi, pi]: see so2.hpp.
template <class S, int W>
[[gnu::always_inline]] inline Pack<S, W> wrapped(const Pack<S, W>& a) {
  using P = Pack<S, W>;
  constexpr S pi = S(3.14159265358979323846264338327950288L);
  const auto inside = abs(a) <= P(pi);
  bool all = true;
  for (int l = 0; l < W; ++l) all &= inside[l] != 0;
  if (all) [[likely]]
    return a;
  const P turns = floor(a / P(S(2) * pi) + P(S(0.5)));
  return select(inside, a, a - turns * P(S(2) * pi));
}

}}  // namespace cairn::CAIRN_ABI
