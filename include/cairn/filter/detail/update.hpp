// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The measurement update that the Kalman, extended and iterated filters share, given H, R and the residual.
///
/// With r = z - h(x), S = H P H^T + R and K = P H^T S^-1:
///   standard    P - W W^T,  W = P H^T S^-1/2            symmetric; the fastest
///   joseph      (I - K H) P (I - K H)^T + K R K^T       a sum of squares; keeps more digits when R is tiny
///   sequential  one number of the measurement after the other (R is decorrelated first)
/// (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, 5.2.3 and
/// 7.3; Grewal, Andrews, "Kalman Filtering", chapter 6.) Where S is so nearly singular or P lowered so far
/// that rounding would leave fewer than three digits (a sensor that is a million times better than the prior,
/// two that see the same, R = 0), the update is done again by the array of array_update.hpp: several times
/// slower, and right to the square of that. A belief that keeps P itself cannot remember more than the
/// rounding of P, though: where that matters from step to step use square_root.hpp or ud.hpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/array_update.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/gain.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Result of an update before anyone decides to keep it. Of fixed size, it stays in columns: a copy through a
/// matrix would be stored and loaded in different pieces (register_column.hpp).
template <int N, int M, class S>
struct Candidate {
  Innovation<M, S> innovation;
  Column<N, S> step;
  Column<N, S> covariance[static_cast<std::size_t>(N)];

  void step_to(Vector<N, S>& to) const { step.store(to.data()); }
  void covariance_to(Matrix<N, N, S>& to) const {
    each<N>([&](int j) { covariance[j].store(to.data() + j * N); });
  }
  void take(const Vector<N, S>& new_step, const Matrix<N, N, S>& new_covariance) {
    step.load(new_step.data());
    load_columns(new_covariance, covariance);
  }
};
template <int N, int M, class S>
  requires(N == dynamic || M == dynamic)
struct Candidate<N, M, S> {
  Innovation<M, S> innovation;
  Vector<N, S> step;
  Matrix<N, N, S> covariance;

  void step_to(Vector<N, S>& to) const { to = step; }
  void covariance_to(Matrix<N, N, S>& to) const { to = covariance; }
  void take(const Vector<N, S>& new_step, const Matrix<N, N, S>& new_covariance) {
    step = new_step;
    covariance = new_covariance;
  }
};

template <int M, class S>
[[nodiscard]] Innovation<M, S> fresh_innovation(const Vector<M, S>& residual, const Matrix<M, M, S>& r) {
  Innovation<M, S> result;
  result.residual = residual;
  result.covariance = r;
  return result;
}

/// What forbids an update that was not simply sound at once, if anything. Compiled once for all sizes.
template <class S>
[[nodiscard, gnu::cold, gnu::noinline]] Status refused_at_once(ViewOf<S> residual, ViewOf<S> covariance,
                                                               ViewOf<S> prior, double gate, S nis) {
  if (!(gate > 0.0)) return Status::bad_option;
  if (!finite_numbers<S>(residual) || !finite_numbers<S>(covariance) || !finite_numbers<S>(prior))
    return Status::not_finite;
  return nis > static_cast<S>(gate) ? Status::gated : Status::accepted;
}

/// An update that was not simply sound: says why it is refused, or does it again by again(), which fills an
/// array for update_by_array() and returns its result or the status that forbids it. `sound` where S kept its
/// digits, so that its NIS is right. Off the hot path.
template <int N, int M, class S, class Again>
[[gnu::cold, gnu::noinline]] void reconsider(Candidate<N, M, S>& out, const Matrix<N, N, S>& prior,
                                             double gate, bool sound, const Again& again) {
  Innovation<M, S>& in = out.innovation;
  in.status =
      refused_at_once<S>(view(in.residual), view(in.covariance), view(prior), gate, sound ? in.nis : S(0));
  if (in.status != Status::accepted) return;
  ArrayUpdate<N, M, S> update;
  in.status = again(update);
  if (in.status == Status::accepted) in.status = judge_array<Wanted::rarely>(update, in, gate);
  if (in.status == Status::accepted) out.take(update.step, rare_square<N, S>(update.root));
}

template <int N, int M, class S, class H>
[[nodiscard, gnu::noinline]] Matrix<N, N, S> joseph(const Matrix<N, N, S>& p, const H& h,
                                                    const Matrix<M, M, S>& r, const Correction<N, M, S>& c) {
  Column<N, S> gain[M];  // K = W D^-1/2 L^-1, last column first
  for (int j = M - 1; j >= 0; --j) {
    gain[j] = c.w[j];
    gain[j].scale(c.inverse_root[j]);
    for (int i = j + 1; i < M; ++i) gain[j].subtract(gain[i], c.lower[i][j]);
  }
  Matrix<N, M, S> k;
  for (int j = 0; j < M; ++j) gain[j].store(k.data() + j * N);
  Matrix<N, N, S> a = column_product(k, Matrix<M, N, S>(dense_of(h)));
  Matrix<N, N, S> zero;
  for (int j = 0; j < N; ++j)
    for (int i = 0; i < N; ++i) {
      a(i, j) = S(i == j ? 1 : 0) - a(i, j);
      zero(i, j) = S(0);
    }
  return congruence(a, p, congruence(k, r, zero));
}

/// The updated P has three digits left: no variance has shrunk to the rounding error of the one it was taken
/// from. `digits` is the least part that may be left.
template <int N, class S>
[[nodiscard]] inline bool keeps_digits(const Matrix<N, N, S>& updated, const Matrix<N, N, S>& prior,
                                       const S& digits) {
  bool good = true;
  for (int i = 0; i < static_cast<int>(prior.rows()); ++i)
    good = good && updated(i, i) >= digits * prior(i, i);
  return good;
}
/// The same in registers. NaN keeps them here: is_covariance() is what sees it.
template <int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool keeps_digits(const Column<N, S> (&updated)[N],
                                                              const Matrix<N, N, S>& prior, const S& digits) {
  S least = updated[0][0] - digits * prior(0, 0);
  each<N>(1, N, [&](int i) { least = lesser(least, updated[i][i] - digits * prior(i, i)); });
  return least >= S(0);
}

/// One number at a time: z_j = h_j x + noise of variance d_j, after L^-1 with R = L diag(d) L^T. False where
/// a variance is left too few digits.
template <int N, int M, class S, class H>
[[nodiscard, gnu::noinline]] bool sequential(const H& h, const Matrix<M, M, S>& r,
                                             const Vector<M, S>& residual, const Matrix<N, N, S>& prior,
                                             Column<N, S> (&lowered)[N], Column<N, S>& moved, S& nis) {
  using std::sqrt;
  S lower[M][M];
  S inverse_root[M];
  S loss;
  if (!factor(r, lower, inverse_root, loss) || !(digits_left<S> * loss < S(1))) return false;
  Matrix<M, N, S> rows = dense_of(h);
  Vector<M, S> left = residual;
  load_columns(prior, lowered);
  moved.set_zero();
  nis = S(0);
  for (int j = 0; j < M; ++j) {
    for (int k = 0; k < j; ++k) {
      for (int i = 0; i < N; ++i) rows(j, i) -= lower[j][k] * rows(k, i);
      left(j) -= lower[j][k] * left(k);
    }
    Column<N, S> w[1];  // P h_j, then in units of the deviation of z_j
    w[0].set_zero();
    for (int i = 0; i < N; ++i) w[0].add(lowered[i], rows(j, i));
    S variance = S(1) / (inverse_root[j] * inverse_root[j]);
    S before = variance;  // its size had the numbers before it not been taken
    S error = left(j);
    for (int i = 0; i < N; ++i) {
      variance += rows(j, i) * w[0][i];
      before += rows(j, i) * rows(j, i) * prior(i, i);
      error -= rows(j, i) * moved[i];
    }
    if (!(variance > digits_left<S> * before)) return false;
    loss = std::max(loss, before / variance);
    moved.add(w[0], error / variance);
    nis += error * error / variance;
    w[0].scale(S(1) / sqrt(variance));
    lower_by_squares(lowered, w);
  }
  return keeps_digits<N, S>(lowered, prior, digits_left<S> * loss);
}

/// The update for sizes known at compile time.
template <int N, int M, class S, class H>
  requires(N != dynamic && M != dynamic)
[[gnu::always_inline]] inline void correct_into(Candidate<N, M, S>& out, const Matrix<N, N, S>& prior,
                                                const H& h, const Matrix<M, M, S>& r, double gate,
                                                Form form) {
  Innovation<M, S>& in = out.innovation;
  Column<N, S>(&p)[N] = out.covariance;
  load_columns(prior, p);
  Correction<N, M, S> c;
  const bool regular = correction(p, h, r, in.covariance, c);
  const S digits = digits_left<S> * c.loss;
  const bool sound = regular && (M == 1 || digits < S(1));
  in.nis = c.take(in.residual.data(), out.step);
  bool good =
      sound && gate > 0.0 && in.nis <= static_cast<S>(gate) && in.nis <= std::numeric_limits<S>::max();
  if (form == Form::standard) [[likely]]
    lower_by_squares(p, c.w);
  else if (good && form == Form::joseph)
    load_columns(joseph<N, M, S>(prior, h, r, c), p);
  else if (good)
    good = sequential<N, M, S>(h, r, in.residual, prior, p, out.step, in.nis);
  good = good && keeps_digits<N, S>(p, prior, digits) && is_covariance(p);
  if (!good) [[unlikely]]
    reconsider(out, prior, gate, sound, [&](ArrayUpdate<N, M, S>& update) {
      return update_by_roots<N, M, S>(prior, dense_of(h), r, in.residual, update);
    });
}

/// The update for sizes known at run time; sequential is standard there.
template <int N, int M, class S>
  requires(N == dynamic || M == dynamic)
void correct_into(Candidate<N, M, S>& out, const Matrix<N, N, S>& prior, const Matrix<M, N, S>& h,
                  const Matrix<M, M, S>& r, double gate, Form form) {
  Innovation<M, S>& in = out.innovation;
  if (h.cols() != prior.rows() || h.rows() != in.residual.size() || r.rows() != h.rows() ||
      r.cols() != h.rows()) {
    in.status = Status::size_mismatch;
    return;
  }
  const Matrix<N, M, S> ph = product_transposed(prior, h);
  in.covariance = symmetrised(product(h, ph) + r);
  const Cholesky<M, S> root(in.covariance);
  const Matrix<M, N, S> w = root.whiten(transposed(ph));  // S^-1/2 H P
  const Vector<M, S> y = root.whiten(in.residual);
  in.nis = y.squaredNorm();
  const S digits = digits_left<S> / root.least_share();
  const bool sound = root.good() && digits < S(1);
  bool good =
      sound && in.nis <= static_cast<S>(gate) && gate > 0.0 && in.nis <= std::numeric_limits<S>::max();
  if (good) {
    out.step = transposed_product(w, y);
    if (form == Form::joseph) {
      const Matrix<M, N, S> gain_t = root.unwhiten(w);
      const Matrix<N, M, S> gain = transposed(gain_t);
      Matrix<N, N, S> a = -product(gain, h);
      for (int i = 0; i < static_cast<int>(a.rows()); ++i) a(i, i) += S(1);
      out.covariance =
          symmetrised(product_transposed(product(a, prior), a) + product(product(gain, r), gain_t));
    } else {
      out.covariance = symmetrised(prior - transposed_product(w, w));
    }
    good = keeps_digits<N, S>(out.covariance, prior, digits) && is_valid_covariance<N, S>(out.covariance);
  }
  if (!good)
    reconsider(out, prior, gate, sound, [&](ArrayUpdate<N, M, S>& update) {
      return update_by_roots<N, M, S>(prior, h, r, in.residual, update);
    });
}

/// Runs the update and keeps it in the belief if everything about it is sound.
template <Manifold X, int M, class H>
[[gnu::always_inline]] inline Innovation<M, ScalarOf<X>> correct(Gaussian<X>& belief, const H& h,
                                                                 const Matrix<M, M, ScalarOf<X>>& r,
                                                                 const Vector<M, ScalarOf<X>>& residual,
                                                                 double gate, Form form) {
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  Candidate<n, M, S> candidate{fresh_innovation<M, S>(residual, r), {}, {}};
  if constexpr (n == dynamic || M == dynamic)
    correct_into<n, M, S>(candidate, belief.covariance, dense_of(h), r, gate, form);
  else
    correct_into<n, M, S>(candidate, belief.covariance, h, r, gate, form);
  if (candidate.innovation.status == Status::accepted) [[likely]] {
    Tangent<X> step;
    candidate.step_to(step);
    if (move_by(belief.mean, step)) [[likely]]
      candidate.covariance_to(belief.covariance);
    else
      candidate.innovation.status = Status::not_finite;
  }
  return candidate.innovation;
}

/// Bits of Count numbers, to be told from those of others without a branch for each.
template <class S, int Count>
  requires(std::is_same_v<S, double> || std::is_same_v<S, float>)
class SameBits {
  using Word = std::uint64_t;
  using Lane = RegisterFor<Word, 8>;
  static constexpr std::size_t size = sizeof(S) * static_cast<std::size_t>(Count);

public:
  [[gnu::always_inline]] [[nodiscard]] inline bool operator()(const S* numbers) const {
    const char* const a = reinterpret_cast<const char*>(numbers);
    const char* const b = reinterpret_cast<const char*>(numbers_);
    constexpr std::size_t width = sizeof(Lane);
    Lane differ{};
    std::size_t at = 0;
    for (; at + width <= size; at += width) differ |= load<Lane>(a + at) ^ load<Lane>(b + at);
    Word rest = 0;
    for (; at + sizeof(Word) <= size; at += sizeof(Word)) rest |= load<Word>(a + at) ^ load<Word>(b + at);
    if constexpr (size % sizeof(Word) != 0) rest |= load<std::uint32_t>(a + at) ^ load<std::uint32_t>(b + at);
    if constexpr (size >= width)
      for (std::size_t k = 0; k < width / sizeof(Word); ++k) rest |= differ[k];
    return rest == 0;
  }
  void set(const S* numbers) { std::memcpy(numbers_, numbers, size); }

private:
  S numbers_[static_cast<std::size_t>(Count)];
};

/// Nothing stands beside the diagonal of `q` as it happens, and nothing negative on it.
template <int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool happens_to_be_diagonal(const Matrix<N, N, S>& q) {
  S least = q(0, 0);
  S beside(0);
  each<N>([&](int j) __attribute__((always_inline)) {
    least = lesser(least, q(j, j));
    each<N>(j + 1, N, [&](int i) { beside += magnitude(q(i, j)); });
  });
  return least >= S(0) && beside == S(0);
}

/// A dense noise is a covariance. A model that keeps one returns it at every step, and to see that costs a
/// tenth of an elimination: each thread remembers the last of each size that was eliminated (zeros at first).
template <int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool is_known_covariance(const Matrix<N, N, S>& q) {
  if constexpr (std::is_same_v<S, double> || std::is_same_v<S, float>) {
    static thread_local SameBits<S, N * N> last;
    if (last(q.data()) || happens_to_be_diagonal(q)) return true;
    const bool good = is_covariance(q);
    if (good) last.set(q.data());
    return good;
  } else {
    return happens_to_be_diagonal(q) || is_covariance(q);
  }
}

/// At first sight: the noise is a covariance. False says only that judge_noise() must look. Zeros that are
/// known when compiling cost nothing, and a matrix that is diagonal as it happens next to nothing; any other
/// is eliminated where it is not the one of the step before, O(N^3 / 6). NaN may pass: it is in the predicted
/// covariance too.
template <int N, class Q>
[[gnu::always_inline]] [[nodiscard]] inline bool looks_like_noise(const Q& q) {
  bool good = true;
  if constexpr (is_diagonal<Q>) {
    typename Q::Scalar least = q.values[0];
    each<N>(1, N, [&](int i) { least = lesser(least, q.values[static_cast<std::size_t>(i)]); });
    good = least >= 0;
  } else if constexpr (in_pairs<Q>()) {
    good = covaries_in_pairs(q);
  } else if constexpr (is_structured<Q> && N <= 10) {
    good = eliminates(q);
  } else if constexpr (is_structured<Q>) {
    good = is_known_covariance(Matrix<N, N, typename Q::Scalar>(q.dense()));
  } else {
    good = is_known_covariance(q);
  }
  return good;
}

/// Q with the stabilising noise, if the options are in range and it is a covariance.
template <Manifold X>
[[nodiscard]] Status stabilise(CovarianceOf<X>& q, double fading, double stabilising_noise) {
  using S = ScalarOf<X>;
  if (!(fading >= 1.0) || !(stabilising_noise >= 0.0)) return Status::bad_option;
  if (const Status status = check_noise<dof<X>, S>(q); status != Status::accepted) return status;
  for (int i = 0; i < static_cast<int>(q.rows()); ++i) q(i, i) += static_cast<S>(stabilising_noise);
  return all_finite(q) ? Status::accepted : Status::not_finite;
}

/// Finite, with no variance below zero. One pass: a NaN or infinity anywhere makes the sum NaN.
template <int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool finite_variances(const Column<N, S> (&p)[N]) {
  typename Column<N, S>::Lane none = p[0].lanes[0] * S(0);
  S least = p[0][0];
  each<N>([&](int j) {
    each<Column<N, S>::count>([&](int k) { none += p[j].lanes[k] * S(0); });
    least = lesser(least, p[j][j]);
  });
  S sum(0);
  if constexpr (Column<N, S>::width == 1)
    sum = none;
  else
    for (int k = 0; k < Column<N, S>::width; ++k) sum += none[k];
  return (least >= S(0)) & (sum == S(0));
}

/// Why a prediction that went wrong went wrong. Off the hot path.
template <Manifold X, int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] Status diagnose_prediction(const Column<N, S> (&p)[N],
                                                                   const X& mean) {
  bool good = finite_state(mean);
  for (int j = 0; j < N; ++j)
    for (int i = 0; i < N; ++i) good = good && finite(p[j][i]);
  return good ? Status::not_positive_definite : Status::not_finite;
}

/// The covariance part of a prediction: fading * F P F^T + Q + extra I, kept with the mean if both are sound.
template <Manifold X, class F, class Q>
  requires(dof<X> != dynamic)
[[gnu::always_inline]] inline Status advance(Gaussian<X>& belief, const X& mean, const F& f, const Q& q,
                                             double fading, double extra) {
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  Column<n, S> p[n];
  Column<n, S> next[n];
  load_columns(belief.covariance, p);
  if (fading != 1.0) [[unlikely]]
    each<n>([&](int j) { p[j].scale(static_cast<S>(fading)); });
  congruence(f, p, q, next);
  if (extra > 0.0) [[unlikely]]
    add_to_diagonal(next, static_cast<S>(extra));
  if (!finite_variances(next) || !finite_state(mean)) [[unlikely]]
    return diagnose_prediction(next, mean);
  if (!looks_like_noise<n>(q)) [[unlikely]]
    if (const Status status = judge_noise<n, S>(dense_of(q)); status != Status::accepted) return status;
  belief.mean = mean;
  each<n>([&](int j) { next[j].store(belief.covariance.data() + j * n); });
  return Status::accepted;
}

/// The same for sizes known at run time.
template <Manifold X, class F>
  requires(dof<X> == dynamic)
Status advance(Gaussian<X>& belief, const X& mean, const F& f, const CovarianceOf<X>& q, double fading,
               double extra) {
  using S = ScalarOf<X>;
  if (f.rows() != belief.covariance.rows() || f.cols() != f.rows() || q.rows() != f.rows() ||
      q.cols() != f.rows())
    return Status::size_mismatch;
  if (const Status status = check_noise<dof<X>, S>(q); status != Status::accepted) return status;
  CovarianceOf<X> next = product_transposed(product(f, belief.covariance), f);
  next = symmetrised(static_cast<S>(fading) * next + q);
  bool positive = true;
  for (int i = 0; i < static_cast<int>(next.rows()); ++i) {
    next(i, i) += static_cast<S>(extra);
    positive = positive && next(i, i) >= S(0);
  }
  if (!all_finite(next) || !finite_state(mean)) return Status::not_finite;
  if (!positive) return Status::not_positive_definite;
  belief.mean = mean;
  belief.covariance = next;
  return Status::accepted;
}

/// The prediction by a process's Jacobian.
template <class F, class U>
[[gnu::always_inline]] inline Status predict_linearised(Gaussian<typename F::State>& belief, const F& model,
                                                        const U& control, double dt, double fading,
                                                        double extra) {
  if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
  if (!(fading >= 1.0) || !(extra >= 0.0)) return Status::bad_option;
  const PlainProcess process(model, common_size(belief.mean, belief.covariance), control);
  decltype(auto) f = process.jacobian(belief.mean, dt);
  decltype(auto) q = process.noise(belief.mean, dt);
  if (process.misfit()) return Status::size_mismatch;
  decltype(auto) mean = process.propagate(belief.mean, dt);
  if (process.misfit()) return Status::size_mismatch;
  return advance(belief, mean, f, q, fading, extra);
}

/// The update by a sensor's Jacobian.
template <class H, class V>
[[gnu::always_inline]] inline auto update_linearised(Gaussian<typename H::State>& belief,
                                                     const PlainSensor<H, V>& sensor, double gate,
                                                     Form form) {
  using S = ScalarOf<typename H::State>;
  constexpr int m = dof<typename H::Measurement>;
  decltype(auto) h = sensor.jacobian(belief.mean);
  decltype(auto) noise = sensor.noise(belief.mean);
  if (sensor.misfit()) return misfitting(sensor);
  const Vector<m, S> residual = sensor.residual(belief.mean);
  if (sensor.misfit()) return misfitting(sensor);
  return correct<typename H::State, m>(belief, h, dense_of(noise), residual, gate, form);
}

}}}  // namespace cairn::CAIRN_ABI::detail
