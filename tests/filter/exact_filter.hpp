// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Kalman filter in 113 bits, in plain loops that share nothing with the library: what one prediction and
/// one update of a linear model must give for the numbers as they stand, and how far that is determined by
/// numbers that are only known to their last digit.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>

namespace cairn_test {

#if defined(__SIZEOF_FLOAT128__)
using Quad = __float128;
#else
using Quad = long double;
static_assert(std::numeric_limits<Quad>::digits == 113);  // aarch64
#endif

inline double plain(Quad x) {
  return static_cast<double>(x);
}
inline Quad quad_abs(Quad x) {
  return x < 0 ? -x : x;
}
inline Quad quad_root(Quad x) {
  if (!(x > 0)) return 0;
  Quad scale = 1;  // beyond the range of double too
  for (; x < Quad(1e-200); x *= Quad(1e200)) scale *= Quad(1e-100);
  for (; x > Quad(1e200); x *= Quad(1e-200)) scale *= Quad(1e100);
  Quad root = std::sqrt(static_cast<double>(x));
  for (int step = 0; step < 3; ++step) root = (root + x / root) / 2;
  return root * scale;
}

/// A dense matrix of 113-bit numbers.
struct QuadMatrix {
  int rows = 0, cols = 0;
  std::vector<Quad> numbers;

  QuadMatrix() = default;
  QuadMatrix(int r, int c) : rows(r), cols(c), numbers(static_cast<std::size_t>(r * c), Quad(0)) {}
  template <class Derived>
  explicit QuadMatrix(const Eigen::DenseBase<Derived>& m)
      : QuadMatrix(static_cast<int>(m.rows()), static_cast<int>(m.cols())) {
    for (int j = 0; j < cols; ++j)
      for (int i = 0; i < rows; ++i) at(i, j) = static_cast<Quad>(m.derived()(i, j));
  }
  Quad& at(int i, int j) { return numbers[static_cast<std::size_t>(i * cols + j)]; }
  const Quad& at(int i, int j) const { return numbers[static_cast<std::size_t>(i * cols + j)]; }
};

inline QuadMatrix times(const QuadMatrix& a, const QuadMatrix& b) {
  QuadMatrix c(a.rows, b.cols);
  for (int i = 0; i < a.rows; ++i)
    for (int j = 0; j < b.cols; ++j)
      for (int k = 0; k < a.cols; ++k) c.at(i, j) += a.at(i, k) * b.at(k, j);
  return c;
}
inline QuadMatrix turned(const QuadMatrix& a) {
  QuadMatrix t(a.cols, a.rows);
  for (int i = 0; i < a.rows; ++i)
    for (int j = 0; j < a.cols; ++j) t.at(j, i) = a.at(i, j);
  return t;
}
inline QuadMatrix plus(const QuadMatrix& a, const QuadMatrix& b, int sign = 1) {
  QuadMatrix c = a;
  for (std::size_t k = 0; k < c.numbers.size(); ++k) c.numbers[k] += sign * b.numbers[k];
  return c;
}
inline QuadMatrix quad_identity(int n) {
  QuadMatrix one(n, n);
  for (int i = 0; i < n; ++i) one.at(i, i) = 1;
  return one;
}

/// Solves s x = b for symmetric s > 0 of any scales by elimination along the largest pivot; false where a
/// pivot is lost in the rounding of 113 bits.
inline bool quad_solve(QuadMatrix s, QuadMatrix& b, double* log_determinant = nullptr) {
  const int m = s.rows;
  double log_sum = 0.0;
  std::vector<Quad> scale(static_cast<std::size_t>(m));
  for (int i = 0; i < m; ++i) {
    if (!(s.at(i, i) > 0)) return false;
    scale[static_cast<std::size_t>(i)] = 1 / quad_root(s.at(i, i));
    log_sum -= 2 * std::log(plain(scale[static_cast<std::size_t>(i)]));
  }
  const auto scale_of = [&](int i) { return scale[static_cast<std::size_t>(i)]; };
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < m; ++j) s.at(i, j) *= scale_of(i) * scale_of(j);
    for (int k = 0; k < b.cols; ++k) b.at(i, k) *= scale_of(i);
  }
  for (int j = 0; j < m; ++j) {
    int best = j;
    for (int i = j + 1; i < m; ++i)
      if (quad_abs(s.at(i, j)) > quad_abs(s.at(best, j))) best = i;
    if (!(quad_abs(s.at(best, j)) > Quad(1e-30))) return false;
    log_sum += std::log(plain(quad_abs(s.at(best, j))));
    for (int k = 0; k < m; ++k) std::swap(s.at(j, k), s.at(best, k));
    for (int k = 0; k < b.cols; ++k) std::swap(b.at(j, k), b.at(best, k));
    for (int i = 0; i < m; ++i) {
      if (i == j) continue;
      const Quad factor = s.at(i, j) / s.at(j, j);
      for (int k = j; k < m; ++k) s.at(i, k) -= factor * s.at(j, k);
      for (int k = 0; k < b.cols; ++k) b.at(i, k) -= factor * b.at(j, k);
    }
  }
  for (int i = 0; i < m; ++i)
    for (int k = 0; k < b.cols; ++k) b.at(i, k) *= scale_of(i) / s.at(i, i);
  if (log_determinant != nullptr) *log_determinant = log_sum;
  return true;
}

/// A linear model and a measurement, as numbers.
struct ExactProblem {
  QuadMatrix transition, process_noise, design, sensor_noise, z;

  /// Every number moved by up to `part` of itself, symmetric where it must be.
  [[nodiscard]] ExactProblem shaken(cairn::Random& random, double part) const {
    ExactProblem other = *this;
    for (QuadMatrix* m : {&other.transition, &other.design, &other.z})
      for (Quad& x : m->numbers) x *= 1 + Quad(part * random.uniform(-1.0, 1.0));
    for (QuadMatrix* m : {&other.process_noise, &other.sensor_noise})
      for (int i = 0; i < m->rows; ++i)
        for (int j = 0; j <= i; ++j)
          m->at(i, j) = m->at(j, i) = m->at(i, j) * (1 + Quad(part * random.uniform(-1.0, 1.0)));
    return other;
  }
};

/// What the filter must say.
struct ExactBelief {
  QuadMatrix mean, covariance;
  bool solvable = true;  ///< false where S has no inverse
  double log_likelihood = 0.0, log_determinant = 0.0;
};

inline ExactBelief exact_prediction(const ExactProblem& p, const ExactBelief& prior) {
  return {times(p.transition, prior.mean),
          plus(times(p.transition, times(prior.covariance, turned(p.transition))), p.process_noise)};
}

inline ExactBelief exact_update(const ExactProblem& p, const ExactBelief& prior) {
  const QuadMatrix hp = times(p.design, prior.covariance);
  const QuadMatrix s = plus(times(hp, turned(p.design)), p.sensor_noise);
  const QuadMatrix residual = plus(p.z, times(p.design, prior.mean), -1);
  QuadMatrix gain_t = hp, weighed = residual;
  ExactBelief out = prior;
  out.solvable = quad_solve(s, gain_t) && quad_solve(s, weighed, &out.log_determinant);
  if (!out.solvable) return out;
  const double nis = plain(times(turned(residual), weighed).at(0, 0));
  out.log_likelihood = -0.5 * (nis + out.log_determinant + p.z.rows * std::log(2 * M_PI));
  const QuadMatrix gain = turned(gain_t);
  const QuadMatrix left = plus(quad_identity(prior.mean.rows), times(gain, p.design), -1);
  out.mean = plus(prior.mean, times(gain, residual));
  out.covariance =
      plus(times(left, times(prior.covariance, turned(left))), times(gain, times(p.sensor_noise, gain_t)));
  return out;
}

/// How far an answer is from the exact one: means in standard deviations, covariances in products of two of
/// them (half, so that it is the relative error of a standard deviation).
struct Distance {
  double mean = 0.0, covariance = 0.0;
  [[nodiscard]] double worst() const { return std::max(mean, covariance); }
};

/// A standard deviation below `floor` of the prior's and of the number itself counts as that.
inline Distance distance_in_sigmas(const ExactBelief& found, const ExactBelief& exact,
                                   const ExactBelief& prior, double floor) {
  const int n = exact.mean.rows;
  std::vector<Quad> sigma(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    const Quad size = quad_root(prior.covariance.at(i, i)) + quad_abs(exact.mean.at(i, 0));
    sigma[static_cast<std::size_t>(i)] = std::max(quad_root(exact.covariance.at(i, i)), Quad(floor) * size);
    if (!(sigma[static_cast<std::size_t>(i)] > 0)) sigma[static_cast<std::size_t>(i)] = Quad(1e-300);
  }
  Distance result;
  const auto note = [](double& worst, Quad error) {
    const double e = plain(error);
    if (!(e <= worst)) worst = std::isnan(e) ? std::numeric_limits<double>::infinity() : e;
  };
  for (int i = 0; i < n; ++i) {
    const Quad si = sigma[static_cast<std::size_t>(i)];
    note(result.mean, quad_abs(found.mean.at(i, 0) - exact.mean.at(i, 0)) / si);
    for (int j = 0; j < n; ++j)
      note(result.covariance, quad_abs(found.covariance.at(i, j) - exact.covariance.at(i, j)) /
                                  (2 * si * sigma[static_cast<std::size_t>(j)]));
  }
  return result;
}

}  // namespace cairn_test
