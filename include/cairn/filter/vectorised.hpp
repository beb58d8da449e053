// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Sigma points side by side: vectorised(model) lets the unscented filter send them through the model in SIMD
/// lanes.
///
/// ```cpp
/// const cairn::Status status = unscented.predict(belief, cairn::vectorised(vehicle), dt, u);
/// ```
///
/// For models whose propagate or predict is a template over the scalar, as automatic() needs it, and neither
/// branches on a number (say select(), pack.hpp) nor uses functions that packs do not have. Results differ
/// from those without by a few ulp of the functions.
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/column_shapes.hpp>
#include <cairn/filter/detail/register_column.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/manifold/derivatives.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/pack.hpp>
#include <cairn/manifold/pack_math.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The model, to be called with packs.
template <class Model>
struct Vectorised : Model {
  using State = typename Model::State;
  static constexpr bool side_by_side = true;
};

template <class Model>
[[nodiscard]] Vectorised<Model> vectorised(const Model& model) {
  return {model};
}

namespace detail {

/// A function of a state, and whether it is to be called with packs.
template <bool SideBySide, class F>
struct PointFunction {
  static constexpr bool side_by_side = SideBySide;
  const F& f;
  template <class X>
  [[gnu::always_inline]] auto operator()(const X& x) const {
    return f(x);
  }
};

template <class Model>
inline constexpr bool is_vectorised = false;
template <class Model>
inline constexpr bool is_vectorised<Vectorised<Model>> = true;

/// What came out of N points that were sent in packs, as differences of M numbers from a reference: a pack
/// holds one of the numbers for as many points as it has lanes.
template <int N, int M, class S>
class PackedDifferences {
public:
  static constexpr int width = Column<N, S>::width;
  static constexpr int batches = Column<N, S>::count;

  [[gnu::always_inline]] void put(int batch, const Vector<M, Pack<S, width>>& differences) {
    each<M>(
        [&](int a) { std::memcpy(numbers_[a] + batch * width, &differences(a).lanes, width * sizeof(S)); });
  }
  /// That of point i; points from N on are those that went along in free lanes.
  [[gnu::always_inline]] Column<M, S> of_point(int i) const {
    S numbers[M];
    each<M>([&](int a) { numbers[a] = numbers_[a][i]; });
    Column<M, S> result;
    result.gather(numbers);
    return result;
  }

private:
  S numbers_[M][batches * width];
};

/// send_points() of sigma_moments.hpp with as many points at once as a register of a column has lanes. The
/// centre goes along, in a lane that is free or by itself, so that all differences are taken between numbers
/// that were computed alike.
template <Manifold X, class F, class Y, int N, int M, class S>
[[gnu::always_inline]] inline void send_packs(const X& x, const Column<N, S> (&root)[N], const F& f,
                                              const S& c, const Y& center, Column<M, S> (&up)[N],
                                              Column<M, S> (&down)[N]) {
  using Differences = PackedDifferences<N, M, S>;
  constexpr int w = Differences::width;
  static_assert(w > 1, "vectorised() needs float or double");
  using P = Pack<S, w>;
  using PX = typename Recast<X, P>::type;
  using PY = typename Recast<Y, P>::type;
  const PX start = Recast<X, P>::of(x);
  const PY reference = Recast<Y, P>::of(center);
  Column<N, S> rows[N];  // row a of the root: number a of the steps, one point to a lane
  transpose(root, rows);
  const auto send = [&](int batch, const S& scale) __attribute__((always_inline)) {
    Vector<N, P> step;
    each<N>([&](int a) { step(a) = P::of(rows[a].lanes[batch] * scale); });
    const PY there = f(retract(start, step));
    return Vector<M, P>(local(reference, there));
  };
  Differences above, below;
  for (int batch = 0; batch < Differences::batches; ++batch) {
    above.put(batch, send(batch, c));
    below.put(batch, send(batch, -c));
  }
  Column<M, S> origin;
  if constexpr (N % w != 0) {
    origin = above.of_point(N);  // lanes past the last point took no step
  } else {
    const PY there = f(start);
    const Vector<M, P> d = local(reference, there);
    S offset[M];
    each<M>([&](int a) { offset[a] = d(a)[0]; });
    origin.gather(offset);
  }
  each<N>([&](int i) {
    up[i] = above.of_point(i);
    down[i] = below.of_point(i);
    up[i].subtract(origin, S(1));
    down[i].subtract(origin, S(1));
  });
}

}  // namespace detail
}}  // namespace cairn::CAIRN_ABI
