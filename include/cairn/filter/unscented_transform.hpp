// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The unscented transform in difference form, on manifolds.
///
/// Points x_0 and x_0 (+) (+-c l_i), l_i the columns of a root of P, c = alpha sqrt(n + kappa). With
/// d_i = f(x_i) (-) f(x_0), odd_i = (d_i+ - d_i-)/2, even_i = (d_i+ + d_i-)/2 and w = 1/c^2:
///   m     = w sum even_i                                     mean = f(x_0) (+) m           (1)
///   P     = w sum (odd_i odd_i^T + even_i even_i^T) + (beta - alpha^2) m m^T               (2)
///   cross = w sum c l_i odd_i^T                                                            (3)
/// These are the scaled transform of S. Julier ("The scaled unscented transformation", ACC 2002) with its
/// central weight, about -1/alpha^2, removed by algebra: no weight is negative where beta >= alpha^2, so P is
/// a sum of squares, and angles average by their wrapped differences. An even part below a few units in the
/// last place of f is rounding noise that 1/alpha^2 would blow up; it counts as zero. Points nearer than
/// eps^(1/4) standard deviations (0.02 in float) drown in rounding altogether and are moved out to there,
/// which changes the result by O(c^2) only.
#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/array_update.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/sigma_moments.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Where the points lie and how they count. alpha = 1, beta = 0, kappa = 0 is the cubature rule.
struct SigmaPoints {
  double alpha = 1.0;  ///< spread; > 0
  double beta = 2.0;   ///< knowledge of the fourth moment; 2 for Gaussians
  double kappa = 0.0;  ///< n + kappa > 0

  /// c^2 for n states; not positive where the options do not fit.
  [[nodiscard]] double spread_squared(int n) const noexcept { return alpha * alpha * (n + kappa); }
};

namespace detail {

/// Mean, covariance and cross-covariance of y = f(x). cross = E (x - mean)(y - mean)^T.
template <Manifold Y, int N>
struct Transformed {
  Y mean;
  CovarianceOf<Y> covariance;
  Matrix<N, dof<Y>, ScalarOf<Y>> cross;
};

/// State and image of f have sizes known at compile time.
template <class X, class F>
inline constexpr bool fixed_sizes =
    dof<X> != dynamic && dof<std::decay_t<std::invoke_result_t<const F&, const X&>>> != dynamic;

/// Carries the points of N(x, root root^T) through f. `c2` is the spread squared.
template <Manifold X, class F>
  requires fixed_sizes<X, F>
[[nodiscard]] auto unscented_transform(const X& x, const CovarianceOf<X>& root, const F& f, double c2,
                                       double beta_minus_alpha2) {
  using S = ScalarOf<X>;
  using Y = std::decay_t<decltype(f(x))>;
  constexpr int n = dof<X>, m = dof<Y>;
  Column<n, S> l[n];
  load_columns(root, l);
  Y center = f(x);
  const Moments<n, m, S> moments =
      sum_points<Pairs::with_cross>(x, l, f, spread<S>(c2), beta_minus_alpha2, center);
  Transformed<Y, n> out{center, {}, {}};
  Tangent<Y> mean;
  moments.mean.store(mean.data());
  out.mean = retract(center, mean);
  each<m>([&](int b) __attribute__((always_inline)) {
    moments.covariance[b].store(out.covariance.data() + b * m);
    moments.cross[b].store(out.cross.data() + b * n);
  });
  return out;
}

/// The same where a size is known at run time only.
template <Manifold X, class F>
[[nodiscard]] auto unscented_transform(const X& x, const CovarianceOf<X>& root, const F& f, double c2,
                                       double beta_minus_alpha2) {
  using S = ScalarOf<X>;
  using Y = std::decay_t<decltype(f(x))>;
  const int n = static_cast<int>(root.cols());
  const S c = spread<S>(c2);
  const S w = S(1) / (c * c);
  const Y center = f(x);
  const int m = dof_of(center);
  Tangent<Y> mean = Tangent<Y>::Zero(m);
  CovarianceOf<Y> squares = CovarianceOf<Y>::Zero(m, m);
  Matrix<dof<X>, dof<Y>, S> cross = Matrix<dof<X>, dof<Y>, S>::Zero(n, m);
  for (int i = 0; i < n; ++i) {
    const Tangent<X> step = c * root.col(i);
    const Tangent<Y> up = local(center, Y(f(retract(x, step))));
    const Tangent<Y> down = local(center, Y(f(retract(x, Tangent<X>(-step)))));
    const Tangent<Y> odd = S(0.5) * (up - down);
    Tangent<Y> even = S(0.5) * (up + down);
    drop_noise<Y>(center, odd, even);
    mean += even;
    squares += odd * odd.transpose() + even * even.transpose();
    cross += root.col(i) * odd.transpose();
  }
  mean *= w;
  Transformed<Y, dof<X>> out{retract(center, mean), CovarianceOf<Y>::Zero(m, m), cross / c};
  out.covariance = w * squares + static_cast<S>(beta_minus_alpha2) * (mean * mean.transpose());
  return out;
}

/// The same sums as rows of an array for triangularise(), whose squares they are: odd_i / c for i < n, then
/// even_i / c, then sqrt(beta - alpha^2) m, so that nothing is lost by squaring. `rows` has 2n + 1 of them.
/// Where beta < alpha^2 the even rows lose a part of their mean instead, since m is their sum by c:
///   sum e_i e_i^T - w m m^T = sum f_i f_i^T,   f_i = e_i - (1 - sqrt(1 - s)) sum e_i / n,   s = w n / c^2
/// for s <= 1; beyond, the last row is NaN where m is not zero. Returns the transformed mean.
template <Manifold X, class F, class Array>
[[nodiscard]] auto sigma_rows(const X& x, const CovarianceOf<X>& root, const F& f, double c2,
                              double beta_minus_alpha2, Array& rows) {
  using S = ScalarOf<X>;
  using Y = std::decay_t<decltype(f(x))>;
  using std::sqrt;
  const int n = static_cast<int>(root.rows());
  const S c = spread<S>(c2);
  const Y center = f(x);
  const int m = dof_of(center);
  Tangent<Y> mean = room<dof<Y>, 1, S>(m, 1);
  for (int k = 0; k < m; ++k) mean(k) = S(0);
  Tangent<X> step = room<dof<X>, 1, S>(n, 1);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n; ++k) step(k) = c * root(k, i);
    const Tangent<Y> up = local(center, Y(f(retract(x, step))));
    for (int k = 0; k < n; ++k) step(k) = -step(k);
    const Tangent<Y> down = local(center, Y(f(retract(x, step))));
    Tangent<Y> odd = up, even = down;
    for (int k = 0; k < m; ++k) {
      odd(k) = S(0.5) * (up(k) - down(k));
      even(k) = S(0.5) * (up(k) + down(k));
    }
    drop_noise<Y>(center, odd, even);
    for (int k = 0; k < m; ++k) {
      rows(i, k) = odd(k) / c;
      rows(n + i, k) = even(k) / c;
      mean(k) += even(k) / (c * c);
    }
  }
  const S of_mean = static_cast<S>(beta_minus_alpha2);
  const S share = of_mean < S(0) ? -of_mean * static_cast<S>(n) / (c * c) : S(0);
  const bool shared = share > S(0) && share <= S(1) + S(8) * std::numeric_limits<S>::epsilon();
  for (int k = 0; k < m; ++k) {
    rows(2 * n, k) = mean(k) == S(0) || shared ? S(0) : sqrt(of_mean) * mean(k);
    if (!shared) continue;
    const S rest = share < S(1) ? S(1) - share : S(0);
    const S part = (S(1) - sqrt(rest)) * c * mean(k) / static_cast<S>(n);
    for (int i = 0; i < n; ++i) rows(n + i, k) -= part;
  }
  return retract(center, mean);
}

/// digits_left for numbers that came from points: their differences have lost what the numbers themselves are
/// larger than the standard deviations. `variances` of y as a matrix.
template <Manifold Y, class Variances>
[[nodiscard]] inline ScalarOf<Y> largest_ratio(const Y& y, const Variances& variances) {
  using S = ScalarOf<Y>;
  S largest(1);
  if constexpr (is_vector<Y>)
    for (int i = 0; i < static_cast<int>(y.size()); ++i) {
      const S squared = y(i) * y(i);
      if (squared > largest * variances(i, i) && variances(i, i) > S(0)) largest = squared / variances(i, i);
    }
  return largest;
}
template <Manifold X, Manifold Y, class P, class Q>
[[nodiscard]] inline ScalarOf<X> digits_of_points(const X& x, const P& p, const Y& y, const Q& q) {
  using S = ScalarOf<X>;
  using std::sqrt;
  const S by_x = largest_ratio(x, p), by_y = largest_ratio(y, q);
  const S digits = S(8192) * std::numeric_limits<S>::epsilon() * sqrt(by_x > by_y ? by_x : by_y);
  return digits > digits_left<S> ? digits : digits_left<S>;
}

/// The mean slope H of a function over the points, m x n: H root is the transpose of the first n rows from
/// `column` on, the odd ones of sigma_rows(). No slope in a direction without variance. O(n^2 m).
template <class Array, class Root, class Slope>
void fill_slope(const Array& rows, const Root& root, Slope&& slope, int column) {
  using S = std::remove_cvref_t<decltype(slope(0, 0))>;
  const int n = static_cast<int>(root.rows());
  for (int j = 0; j < static_cast<int>(slope.rows()); ++j)
    for (int k = n - 1; k >= 0; --k) {
      S sum = rows(k, column + j);
      for (int i = k + 1; i < n; ++i) sum -= slope(j, i) * root(i, k);
      slope(j, k) = root(k, k) > S(0) ? S(sum / root(k, k)) : S(0);
    }
}
template <int M, int N, class S, class Array>
[[nodiscard]] Matrix<M, N, S> mean_slope(const Array& rows, const Matrix<N, N, S>& root, int m,
                                         int column = 0) {
  Matrix<M, N, S> slope = room<M, N, S>(m, static_cast<int>(root.rows()));
  fill_slope(rows, root, slope, column);
  return slope;
}

/// The update of a filter by points, from the rows of sigma_rows() in the first columns of `array`, which is
/// used up, and the prior's root: the array of square_root.hpp, compiled once for all sizes. Fills what
/// update_by_array() returns, whitens `y`, the residual. `numbers` is room for room_by_points().
[[nodiscard]] constexpr int room_by_points(int n, int m) {
  if (n == dynamic || m == dynamic) return dynamic;
  return m * m + m * n + room_for_root(m) + room_to_judge(n, m);
}
template <class S>
[[nodiscard, gnu::cold, gnu::noinline]] Status update_by_points(View<S> array, ViewOf<S> root, ViewOf<S> r,
                                                                View<S> root_s, View<S> updated,
                                                                View<S> white, View<S> step, View<S> y,
                                                                S digits, ArrayVerdict<S>& verdict,
                                                                S* numbers) {
  const int n = root.rows(), m = r.rows();
  const View<S> root_r(numbers, m, m), slope(numbers + m * m, m, n);
  S* const free = numbers + m * m + m * n;
  if (!rare_root(r, root_r, free)) return Status::not_positive_definite;
  for (int j = 0; j < m + n; ++j)
    for (int i = 0; i < array.rows(); ++i) {
      if (i > 2 * n) array(i, j) = j < m ? root_r(j, i - 2 * n - 1) : S(0);
      if (i <= 2 * n && j >= m) array(i, j) = i < n ? root(j - m, i) : S(0);
    }
  if (!finite_numbers<S>(array)) return Status::not_positive_definite;
  fill_slope(array, root, slope, 0);
  verdict = read_array(array, root_s, updated, white, step, y);
  const bool good = verdict.regular && is_determined<S>(root, slope, r, root_s, updated, white,
                                                        KeptAs::covariance, digits, free);
  return good ? Status::accepted : Status::not_positive_definite;
}

}  // namespace detail

/// Mean and covariance of f(x) for x of the given belief, by the unscented transform.
template <Manifold X, class F>
[[nodiscard]] auto unscented_transform(const Gaussian<X>& belief, const F& f,
                                       const SigmaPoints& points = {}) {
  CAIRN_EXPECTS(detail::common_size(belief.mean, belief.covariance) > 0,
                "unscented_transform needs a covariance of the mean's size");
  const CovarianceOf<X> root = detail::semi_definite_root<dof<X>, ScalarOf<X>>(belief.covariance);
  const auto sent = [&](const X& x) { return detail::evaluated(f(x)); };
  const auto out = detail::unscented_transform(belief.mean, root, sent,
                                               points.spread_squared(static_cast<int>(root.rows())),
                                               points.beta - points.alpha * points.alpha);
  return Gaussian<decltype(sent(belief.mean))>{out.mean, out.covariance};
}

}}  // namespace cairn::CAIRN_ABI
