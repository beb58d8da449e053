// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The loops of the unscented transform (unscented_transform.hpp) for sizes known at compile time: the points
/// are sent through the function first, one by one or side by side, and their differences summed as columns.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <new>
#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/column_shapes.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/register_column.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/vectorised.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Distance of the points in standard deviations, for its square.
template <class S>
[[nodiscard]] S spread(double c2) {
  using std::sqrt;
  const S nearest = sqrt(sqrt(std::numeric_limits<S>::epsilon()));
  const S c = sqrt(static_cast<S>(c2));
  return c > nearest ? c : nearest;
}

/// Parts of `even` that rounding alone explains become zero.
template <Manifold Y>
void drop_noise(const Y& center, const Tangent<Y>& odd, Tangent<Y>& even) {
  using std::abs;
  using S = ScalarOf<Y>;
  constexpr S ulps = S(4) * std::numeric_limits<S>::epsilon();
  for (int i = 0; i < static_cast<int>(even.size()); ++i) {
    S size = S(1);
    if constexpr (is_vector<Y>) size = abs(center(i));
    if (abs(even(i)) <= ulps * (size + abs(odd(i)))) even(i) = S(0);
  }
}

/// The same for columns; `size` is that of the numbers the differences were taken from.
template <int M, class S>
[[gnu::always_inline]] inline void drop_noise(const Column<M, S>& size, const Column<M, S>& odd,
                                              Column<M, S>& even) {
  constexpr S ulps = S(4) * std::numeric_limits<S>::epsilon();
  each<Column<M, S>::count>([&](int k) {
    const auto bound = (size.lanes[k] + magnitude(odd.lanes[k])) * ulps;
    even.lanes[k] = magnitude(even.lanes[k]) <= bound ? typename Column<M, S>::Lane{} : even.lanes[k];
  });
}

/// Mean (as a step from the centre), covariance and cross-covariance as columns.
template <int N, int M, class S>
struct Moments {
  Column<M, S> mean;
  Column<M, S> covariance[static_cast<std::size_t>(M)];
  Column<N, S> cross[static_cast<std::size_t>(M)];
};

enum class Pairs { without_cross, with_cross };

/// Room for a value that is constructed where it stays. (Assigning the result of a function copies it while
/// its numbers are still on their way to memory, which waits for them.)
template <class Y>
union Place {
  Y value;
  Place() {}   // NOLINT(modernize-use-equals-default): a union of a class type
  ~Place() {}  // NOLINT(modernize-use-equals-default)
};

/// x (+) scale * direction.
template <Manifold X, int N, class S>
[[gnu::always_inline]] inline X point_at(const X& x, const Column<N, S>& direction, const S& scale) {
  Tangent<X> step;
  Column<N, S> scaled;
  if constexpr (is_vector<X>) {
    scaled.load(x.data());
    scaled.add(direction, scale);
    scaled.store(step.data());
    return step;
  } else {
    scaled = direction;
    scaled.scale(scale);
    scaled.store(step.data());
    return retract(x, step);
  }
}

/// y (-) center as a column.
template <Manifold Y, int M, class S>
[[gnu::always_inline]] inline void difference(const Y& center, const Y& y, Column<M, S>& out) {
  if constexpr (is_vector<Y>) {
    Column<M, S> origin;
    origin.load(center.data());
    out.load(y.data());
    out.subtract(origin, S(1));
  } else {
    const Tangent<Y> d = local(center, y);
    S numbers[M];
    each<M>([&](int i) { numbers[i] = d(i); });
    out.gather(numbers);
  }
}

/// local(center, f(x (+) c l_i)) and local(center, f(x (+) -c l_i)) for every column l_i.
template <Manifold X, class F, class Y, int N, int M, class S>
[[gnu::always_inline]] inline void send_points(const X& x, const Column<N, S> (&root)[N], const F& f,
                                               const S& c, const Y& center, Column<M, S> (&up)[N],
                                               Column<M, S> (&down)[N]) {
  if constexpr (requires { requires F::side_by_side; }) {
    send_packs(x, root, f, c, center, up, down);
  } else {
    Place<Y> there[2 * N];
    for (int i = 0; i < N; ++i) {
      ::new (static_cast<void*>(&there[i])) Y(f(point_at(x, root[i], c)));
      ::new (static_cast<void*>(&there[N + i])) Y(f(point_at(x, root[i], S(-c))));
    }
    each<N>([&](int i) {
      difference(center, there[i].value, up[i]);
      difference(center, there[N + i].value, down[i]);
    });
    if constexpr (!std::is_trivially_destructible_v<Y>)
      for (Place<Y>& place : there) place.value.~Y();
  }
}

/// The sums (1) to (3) of unscented_transform.hpp. Symmetric bit for bit.
template <Pairs Wanted, Manifold X, class F, class Y, int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline Moments<N, dof<Y>, S> sum_points(const X& x,
                                                                             const Column<N, S> (&root)[N],
                                                                             const F& f, const S& c,
                                                                             double beta_minus_alpha2,
                                                                             const Y& center) {
  using std::abs;
  constexpr int m = dof<Y>;
  Column<m, S> odd[N], even[N], size;
  send_points(x, root, f, c, center, odd, even);
  S sizes[m];
  each<m>([&](int i) {
    sizes[i] = S(1);
    if constexpr (is_vector<Y>) sizes[i] = abs(center(i));
  });
  size.gather(sizes);
  Moments<N, m, S> out;
  out.mean.set_zero();
  each<N>([&](int i) {
    Column<m, S> half_sum = odd[i];
    half_sum.add(even[i]);
    half_sum.scale(S(0.5));
    odd[i].subtract(even[i], S(1));
    odd[i].scale(S(0.5));
    drop_noise(size, odd[i], half_sum);
    even[i] = half_sum;
    out.mean.add(half_sum);
  });
  const S w = S(1) / (c * c);
  const S inverse_c = S(1) / c;
  out.mean.scale(w);
  each<m>([&](int b) {
    Column<m, S> squares, extra = out.mean;
    squares.set_zero();
    each<N>([&](int i) {
      squares.add(odd[i], odd[i][b]);
      squares.add(even[i], even[i][b]);
    });
    squares.scale(w);
    extra.scale(extra[b]);
    squares.add(extra, static_cast<S>(beta_minus_alpha2));
    out.covariance[b] = squares;
    if constexpr (Wanted == Pairs::with_cross) {
      out.cross[b].set_zero();
      each<N>([&](int i) { out.cross[b].add(root[i], odd[i][b]); });
      out.cross[b].scale(inverse_c);
    }
  });
  return out;
}

}}}  // namespace cairn::CAIRN_ABI::detail
