// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The measurement update by one orthogonal triangularisation: what the square-root filters always do, and
/// the others where a subtraction would leave no digits.
///
///   [R^1/2  H L; 0  L] -> [S^1/2 0; K S^1/2  L'],   P = L L^T,   P' = L' L'^T
/// (P. Kaminski, A. Bryson, S. Schmidt, "Discrete square root filtering", IEEE Trans. Automatic Control 16,
/// 1971.) Arrays are kept transposed: a row for each source of uncertainty, a column for each number of the
/// measurement, then one for each of the state. Nothing is subtracted, so that S may be as near to singular
/// and P' as much below P as the square of the rounding.
#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// a = root root^T, symmetric bit for bit.
template <class Root, class A>
void square(const Root& root, A&& a) {
  using S = std::remove_cvref_t<decltype(a(0, 0))>;
  for (int j = 0; j < static_cast<int>(root.rows()); ++j)
    for (int i = j; i < static_cast<int>(root.rows()); ++i) {
      S sum(0);
      for (int k = 0; k < static_cast<int>(root.cols()); ++k) sum += root(i, k) * root(j, k);
      a(i, j) = a(j, i) = sum;
    }
}
template <int N, class S>
[[nodiscard]] Matrix<N, N, S> squared_root(const Matrix<N, N, S>& root) {
  Matrix<N, N, S> a = root;
  square(root, a);
  return a;
}
/// The same, compiled once for all sizes.
template <int N, class S>
[[nodiscard]] Matrix<N, N, S> rare_square(const Matrix<N, N, S>& root) {
  Matrix<N, N, S> a = root;
  square(view(root), view(a));
  return a;
}

/// What an array's update comes to beside its matrices.
template <class S>
struct ArrayVerdict {
  S nis = S(0);
  S log_determinant = std::numeric_limits<S>::quiet_NaN();  ///< of S where S itself has lost it, else NaN
  bool regular = true;                                      ///< S has an inverse
};

/// The parts of a triangularised array.
template <int N, int M, class S>
struct ArrayUpdate : ArrayVerdict<S> {
  Matrix<M, M, S> root_s;  ///< lower triangular, S = root_s root_s^T
  Matrix<N, N, S> root;    ///< lower triangular, of the updated covariance
  Matrix<N, M, S> white;   ///< K root_s = P H^T root_s^-T
  Vector<N, S> step;

  void make_room([[maybe_unused]] int n, [[maybe_unused]] int m) {
    if constexpr (N == dynamic || M == dynamic) {
      root_s.resize(m, m);
      root.resize(n, n);
      white.resize(n, m);
      step.resize(n);
    }
  }
};

/// Triangularises `array`, which is used up, and fills the parts. `y` is the residual, whitened on return.
template <class Array, class RootS, class Root, class White, class Step, class Y>
[[nodiscard]] auto read_array(Array&& array, RootS&& root_s, Root&& root, White&& white, Step&& step, Y&& y) {
  using S = std::remove_cvref_t<decltype(array(0, 0))>;
  using std::log;
  using std::sqrt;
  const int m = static_cast<int>(root_s.rows()), n = static_cast<int>(root.rows());
  triangularise(array);
  take_lower_part(root_s, array, 0);
  take_lower_part(root, array, m);
  ArrayVerdict<S> out;
  S log_root(0), least_share(1);
  for (int i = 0; i < m; ++i) {
    S variance(0);
    for (int k = 0; k <= i; ++k) variance += root_s(i, k) * root_s(i, k);
    for (int k = 0; k < i; ++k) y(i) -= root_s(i, k) * y(k);
    const S head = root_s(i, i);
    out.regular = out.regular && head > root_digits_left<S> * sqrt(variance);
    if (head * head < least_share * variance) least_share = head * head / variance;
    y(i) /= head;
    out.nis += y(i) * y(i);
    if (out.regular) log_root += log(head);
  }
  if (least_share < digits_left<S>) out.log_determinant = S(2) * log_root;
  for (int i = 0; i < n; ++i) {
    step(i) = S(0);
    for (int k = 0; k < m; ++k) {
      white(i, k) = array(k, m + i);
      step(i) += white(i, k) * y(k);
    }
  }
  return out;
}

/// [R^1/2  H L; 0  L]^T from H, L and R^1/2.
template <class S>
[[gnu::noinline]] void fill_array(View<S> array, ViewOf<S> h, ViewOf<S> root, ViewOf<S> root_r) {
  const int n = root.rows(), m = root_r.rows();
  for (int j = 0; j < m + n; ++j)
    for (int i = 0; i < m; ++i) array(i, j) = j < m ? root_r(j, i) : S(0);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) {
      S sum(0);
      for (int k = 0; k < n; ++k) sum += h(j, k) * root(k, i);
      array(m + i, j) = sum;
    }
    for (int j = 0; j < n; ++j) array(m + i, m + j) = root(j, i);
  }
}

/// How often an update by an array is wanted: at every step of a filter, or where another has lost its
/// digits; then it is compiled once for all sizes.
enum class Wanted { always, rarely };

/// Triangularises `array`, which is used up.
template <int N, int M, class S, Wanted When = Wanted::always, class Array>
[[nodiscard]] ArrayUpdate<N, M, S> update_by_array(Array& array, const Vector<M, S>& residual, int n) {
  const int m = static_cast<int>(residual.size());
  ArrayUpdate<N, M, S> out;
  out.make_room(n, m);
  Vector<M, S> y = residual;
  ArrayVerdict<S>& verdict = out;
  if constexpr (When == Wanted::always)
    verdict = read_array(array, out.root_s, out.root, out.white, out.step, y);
  else
    verdict =
        read_array(view(array), view(out.root_s), view(out.root), view(out.white), view(out.step), view(y));
  return out;
}

/// In which numbers a prior came, whose last digits are not to be trusted: those of P or those of its root.
enum class KeptAs { covariance, root };

/// The update is determined by the numbers it came from: were each variance of P (or number of its root) and
/// of R known to its last digit only, H x, z and x - K H x would still keep three digits of their deviations.
/// Where differences of nearly equal numbers decide, it is not. `lower` is the prior's root, `digits` what
/// the columns of the array need to have left; `white`, H on entry, becomes root_s^-1 H and `noise`
/// root_s^-1, a column for each deviation of R. O(n^2 m).
template <class Lower, class R, class RootS, class Root, class Gain, class White, class Noise, class Sigma,
          class S>
[[nodiscard]] bool is_determined(const Lower& lower, const R& r, const RootS& root_s, const Root& root,
                                 const Gain& gain, White&& white, Noise&& noise, Sigma&& sigma, KeptAs kept,
                                 S digits) {
  using std::abs;
  using std::sqrt;
  const int n = static_cast<int>(lower.rows()), m = static_cast<int>(noise.rows());
  // Rounding of the deviations `of_state` and `of_noise` against the one that is left.
  const auto shrinks = [&](const S& of_state, const S& of_noise, const S& left) {
    const S as_squares = digits_left<S> * (kept == KeptAs::covariance ? of_state * of_state : S(0));
    return of_state * digits <= left && as_squares + digits_left<S> * of_noise * of_noise <= left * left;
  };
  const auto deviation = [n](const auto& of, int i) {
    S variance(0);
    for (int k = 0; k < n; ++k) variance += of(i, k) * of(i, k);
    return static_cast<S>(sqrt(variance));
  };
  for (int i = 0; i < n; ++i) sigma(i) = deviation(lower, i);
  for (int j = 0; j < m; ++j) {
    S of_state(0), of_noise(0);
    for (int i = 0; i < j; ++i) noise(j, i) = S(0);
    noise(j, j) = r(j, j) > S(0) ? S(sqrt(r(j, j))) : S(0);
    for (int k = 0; k < j; ++k) {
      for (int i = 0; i < n; ++i) white(j, i) -= root_s(j, k) * white(k, i);
      for (int i = 0; i <= k; ++i) noise(j, i) -= root_s(j, k) * noise(k, i);
    }
    for (int i = 0; i < n; ++i) {
      white(j, i) /= root_s(j, j);
      of_state += abs(white(j, i)) * sigma(i);
    }
    for (int i = 0; i <= j; ++i) {
      noise(j, i) /= root_s(j, j);
      of_noise += abs(noise(j, i));
    }
    if (!shrinks(of_state, of_noise, S(1))) return false;
  }
  for (int i = 0; i < n; ++i) {
    S of_state(0), of_noise(0);
    for (int j = 0; j < n; ++j) {
      S entry(i == j ? 1 : 0);  // of I - K H
      for (int k = 0; k < m; ++k) entry -= gain(i, k) * white(k, j);
      of_state += abs(entry) * sigma(j);
    }
    for (int j = 0; j < m; ++j) {
      S entry(0);  // of K
      for (int k = j; k < m; ++k) entry += gain(i, k) * noise(k, j);
      of_noise += abs(entry);
    }
    const S least = root_digits_left<S> * sigma(i), left = deviation(root, i);
    if (!shrinks(of_state, of_noise, left > least ? left : least)) return false;
  }
  return true;
}

/// The same in views, compiled once for all sizes. `numbers` is room for room_to_judge().
[[nodiscard]] constexpr int room_to_judge(int n, int m) {
  return n == dynamic || m == dynamic ? dynamic : m * n + m * m + n;
}
template <class S>
[[nodiscard, gnu::noinline]] bool is_determined(ViewOf<S> lower, ViewOf<S> h, ViewOf<S> r, ViewOf<S> root_s,
                                                ViewOf<S> root, ViewOf<S> gain, KeptAs kept, S digits,
                                                S* numbers) {
  const int n = lower.rows(), m = h.rows();
  const View<S> white(numbers, m, n), noise(numbers + m * n, m, m), sigma(numbers + m * n + m * m, n, 1);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < m; ++i) white(i, j) = h(i, j);
  return is_determined(lower, r, root_s, root, gain, white, noise, sigma, kept, digits);
}

/// The same for an array's update.
template <int N, int M, class S, Wanted When = Wanted::always>
[[nodiscard]] bool determined(const ArrayUpdate<N, M, S>& update, const Matrix<N, N, S>& lower,
                              const Matrix<M, N, S>& h, const Matrix<M, M, S>& r, KeptAs kept,
                              S digits = root_digits_left<S>) {
  const int n = static_cast<int>(lower.rows()), m = static_cast<int>(h.rows());
  if constexpr (When == Wanted::always) {
    Matrix<M, N, S> white = h;
    Matrix<M, M, S> noise = room<M, M, S>(m, m);
    Vector<N, S> sigma = room<N, 1, S>(n, 1);
    return is_determined(lower, r, update.root_s, update.root, update.white, white, noise, sigma, kept,
                         digits);
  } else {
    Room<S, room_to_judge(N, M)> numbers(room_to_judge(n, m));
    return is_determined<S>(view(lower), view(h), view(r), view(update.root_s), view(update.root),
                            view(update.white), kept, digits, numbers.data());
  }
}

/// The update by an array from P, H and R themselves, compiled once for all sizes: fills what
/// update_by_array() returns, whitens `y`, the residual. `numbers` is room for room_for_roots().
[[nodiscard]] constexpr int room_for_roots(int n, int m) {
  if (n == dynamic || m == dynamic) return dynamic;
  return n * n + m * m + (n + m) * (n + m) + room_for_root(n > m ? n : m) + room_to_judge(n, m);
}
template <class S>
[[nodiscard, gnu::cold, gnu::noinline]] Status update_by_roots(ViewOf<S> prior, ViewOf<S> h, ViewOf<S> r,
                                                               View<S> root_s, View<S> updated, View<S> white,
                                                               View<S> step, View<S> y,
                                                               ArrayVerdict<S>& verdict, S* numbers) {
  const int n = prior.rows(), m = h.rows();
  const View<S> root(numbers, n, n), root_r(numbers + n * n, m, m),
      array(numbers + n * n + m * m, n + m, n + m);
  S* const free = numbers + n * n + m * m + (n + m) * (n + m);
  if (!rare_root(prior, root, free) || !rare_root(r, root_r, free)) return Status::not_positive_definite;
  fill_array(array, h, root, root_r);
  verdict = read_array(array, root_s, updated, white, step, y);
  const bool good = verdict.regular && is_determined<S>(root, h, r, root_s, updated, white,
                                                        KeptAs::covariance, root_digits_left<S>, free);
  return good ? Status::accepted : Status::not_positive_definite;
}
template <int N, int M, class S>
[[nodiscard]] Status update_by_roots(const Matrix<N, N, S>& prior, const Matrix<M, N, S>& h,
                                     const Matrix<M, M, S>& r, const Vector<M, S>& residual,
                                     ArrayUpdate<N, M, S>& update) {
  const int n = static_cast<int>(prior.rows()), m = static_cast<int>(residual.size());
  update.make_room(n, m);
  Vector<M, S> y = residual;
  Room<S, room_for_roots(N, M)> numbers(room_for_roots(n, m));
  return update_by_roots<S>(view(prior), view(h), view(r), view(update.root_s), view(update.root),
                            view(update.white), view(update.step), view(y), update, numbers.data());
}

/// Takes an array's update over into the innovation, and says whether it may be kept.
template <Wanted When, int N, int M, class S>
[[nodiscard]] Status judge_array(const ArrayUpdate<N, M, S>& update, Innovation<M, S>& in, double gate) {
  bool finite_parts = false;
  if constexpr (When == Wanted::always) {
    in.covariance = squared_root<M, S>(update.root_s);
    finite_parts = all_finite(update.root) && all_finite(update.step);
  } else {
    square(view(update.root_s), view(in.covariance));
    finite_parts = finite_numbers(view(update.root)) && finite_numbers(view(update.step));
  }
  in.nis = update.nis;
  in.log_determinant = update.log_determinant;
  if (!update.regular || !finite_parts) {
    in.nis = S(0);
    return Status::not_positive_definite;
  }
  return update.nis <= static_cast<S>(gate) ? Status::accepted : Status::gated;
}

}}}  // namespace cairn::CAIRN_ABI::detail
