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
#include <cstddef>
#include <limits>
#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kernels.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

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

/// Sums of (2) and (3), kept in columns; scaled once at the end, so that they stay symmetric bit for bit.
template <int N, int M, class S>
class MomentSums {
public:
  MomentSums(int, int) {
    for (int b = 0; b < M; ++b) {
      squares_[b].set_zero();
      cross_[b].set_zero();
    }
  }
  [[gnu::always_inline]] void add(const S* root_column, const Vector<M, S>& odd, const Vector<M, S>& even) {
    Column<M, S> o, e;
    Column<N, S> l;
    o.load(odd.data());
    e.load(even.data());
    l.load(root_column);
    for (int b = 0; b < M; ++b) {
      squares_[b].add(o, odd(b));
      squares_[b].add(e, even(b));
      cross_[b].add(l, odd(b));
    }
  }
  void finish(const S& w, const S& extra, const S& inverse_c, const Vector<M, S>& mean,
              Matrix<M, M, S>& covariance, Matrix<N, M, S>& cross) {
    for (int b = 0; b < M; ++b) {
      squares_[b].scale(w);
      squares_[b].store(covariance.data() + b * M);
      for (int a = 0; a < M; ++a) covariance(a, b) += extra * (mean(a) * mean(b));
      cross_[b].scale(inverse_c);
      cross_[b].store(cross.data() + b * N);
    }
  }

private:
  Column<M, S> squares_[static_cast<std::size_t>(M)];
  Column<N, S> cross_[static_cast<std::size_t>(M)];
};

/// The same for sizes known at run time.
template <int N, int M, class S>
  requires(N == dynamic || M == dynamic)
class MomentSums<N, M, S> {
public:
  MomentSums(int n, int m) : squares_(Matrix<M, M, S>::Zero(m, m)), cross_(Matrix<N, M, S>::Zero(n, m)) {}
  void add(const S* root_column, const Vector<M, S>& odd, const Vector<M, S>& even) {
    squares_ += odd * odd.transpose() + even * even.transpose();
    cross_ += Eigen::Map<const Vector<N, S>>(root_column, cross_.rows()) * odd.transpose();
  }
  void finish(const S& w, const S& extra, const S& inverse_c, const Vector<M, S>& mean,
              Matrix<M, M, S>& covariance, Matrix<N, M, S>& cross) {
    covariance = w * squares_ + extra * (mean * mean.transpose());
    cross = inverse_c * cross_;
  }

private:
  Matrix<M, M, S> squares_;
  Matrix<N, M, S> cross_;
};

/// Carries the points of N(x, root root^T) through f. `c2` is the spread squared.
template <Manifold X, class F>
[[nodiscard]] auto unscented_transform(const X& x, const CovarianceOf<X>& root, const F& f, double c2,
                                       double beta_minus_alpha2) {
  using S = ScalarOf<X>;
  using Y = std::decay_t<decltype(f(x))>;
  using std::sqrt;
  const int n = static_cast<int>(root.cols());
  const S nearest = sqrt(sqrt(std::numeric_limits<S>::epsilon()));
  const S c = sqrt(static_cast<S>(c2)) > nearest ? sqrt(static_cast<S>(c2)) : nearest;
  const S w = S(1) / (c * c);
  const Y center = f(x);
  const int m = dof_of(center);
  Tangent<Y> mean = Tangent<Y>::Zero(m);
  Transformed<Y, dof<X>> out{center, CovarianceOf<Y>::Zero(m, m), Matrix<dof<X>, dof<Y>, S>::Zero(n, m)};
  MomentSums<dof<X>, dof<Y>, S> sums(n, m);
  for (int i = 0; i < n; ++i) {
    const Tangent<X> step = c * root.col(i);
    const Tangent<Y> up = local(center, Y(f(retract(x, step))));
    const Tangent<Y> down = local(center, Y(f(retract(x, Tangent<X>(-step)))));
    const Tangent<Y> odd = S(0.5) * (up - down);
    Tangent<Y> even = S(0.5) * (up + down);
    drop_noise<Y>(center, odd, even);
    mean += even;
    sums.add(root.data() + i * n, odd, even);
  }
  mean *= w;
  sums.finish(w, static_cast<S>(beta_minus_alpha2), S(1) / c, mean, out.covariance, out.cross);
  out.mean = retract(center, mean);
  return out;
}

}  // namespace detail

/// Mean and covariance of f(x) for x of the given belief, by the unscented transform.
template <Manifold X, class F>
[[nodiscard]] auto unscented_transform(const Gaussian<X>& belief, const F& f,
                                       const SigmaPoints& points = {}) {
  const CovarianceOf<X> root = detail::semi_definite_root<dof<X>, ScalarOf<X>>(belief.covariance);
  const auto out =
      detail::unscented_transform(belief.mean, root, f, points.spread_squared(static_cast<int>(root.rows())),
                                  points.beta - points.alpha * points.alpha);
  return Gaussian<std::decay_t<decltype(f(belief.mean))>>{out.mean, out.covariance};
}

}  // namespace cairn::inline CAIRN_ABI
