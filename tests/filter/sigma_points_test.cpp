// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/filter/unscented_transform.hpp>

namespace sigma_points_test {
namespace {

using cairn::Matrix;
using cairn::NoControl;
using cairn::SigmaPoints;
using cairn::Status;
using cairn::Vector;

using Numbers = std::vector<long double>;
using Table = std::vector<Numbers>;

/// The functions of both models, in any numbers.
template <class S>
void move(const S* x, S* y) {
  using std::sin;
  y[0] = x[0] + S(0.3) * x[1] * x[1];
  y[1] = x[1] + sin(x[2]);
  y[2] = S(0.9) * x[2] - S(0.2) * x[0] * x[1];
}
template <class S>
void see(const S* x, S* z) {
  using std::sqrt;
  z[0] = sqrt(x[0] * x[0] + x[1] * x[1] + S(1));
  z[1] = x[1] * x[2];
}

/// Of 3 states and 2 measured numbers; N and M may say so at run time.
template <int N>
struct Motion {
  using State = Vector<N>;
  using Control = NoControl;
  [[nodiscard]] State propagate(const State& x, const Control&, double) const {
    State y = x;
    move(x.data(), y.data());
    return y;
  }
  [[nodiscard]] Matrix<N> noise(const State&, const Control&, double) const {
    return 0.01 * Matrix<N>::Identity(3, 3);
  }
};
template <int N, int M>
struct Eye {
  using State = Vector<N>;
  using Measurement = Vector<M>;
  double variance;
  [[nodiscard]] Measurement predict(const State& x) const {
    Measurement z = Measurement::Zero(2);
    see(x.data(), z.data());
    return z;
  }
  [[nodiscard]] Matrix<M> noise(const State&) const { return variance * Matrix<M>::Identity(2, 2); }
};

struct Moments {
  Numbers mean;
  Table covariance, cross;
};

/// Sums over the 2n + 1 weighted points, as S. Julier's "The scaled unscented transformation" (2002) has
/// them.
template <class F>
Moments weighted(const Numbers& x, const Table& p, std::size_t m, const F& f, const SigmaPoints& options) {
  const std::size_t n = x.size();
  Table root(n, Numbers(n, 0));
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = j; i < n; ++i) {
      long double sum = p[i][j];
      for (std::size_t k = 0; k < j; ++k) sum -= root[i][k] * root[j][k];
      root[i][j] = i == j ? std::sqrt(sum) : sum / root[j][j];
    }
  const auto size = static_cast<long double>(n);
  const long double alpha = options.alpha, lambda = alpha * alpha * (size + options.kappa) - size;
  const long double spread = std::sqrt(size + lambda);
  Table points{x}, images;
  for (std::size_t k = 0; k < n; ++k)
    for (const long double sign : {1.0L, -1.0L}) {
      points.push_back(x);
      for (std::size_t i = 0; i < n; ++i) points.back()[i] += sign * spread * root[i][k];
    }
  Numbers of_mean(points.size(), 0.5L / (size + lambda)), of_square = of_mean;
  of_mean[0] = lambda / (size + lambda);
  of_square[0] = of_mean[0] + 1 - alpha * alpha + options.beta;
  Moments out{Numbers(m, 0), Table(m, Numbers(m, 0)), Table(n, Numbers(m, 0))};
  for (std::size_t k = 0; k < points.size(); ++k) {
    images.emplace_back(m, 0);
    f(points[k].data(), images[k].data());
    for (std::size_t a = 0; a < m; ++a) out.mean[a] += of_mean[k] * images[k][a];
  }
  for (std::size_t k = 0; k < points.size(); ++k)
    for (std::size_t a = 0; a < m; ++a) {
      const long double d = images[k][a] - out.mean[a];
      for (std::size_t b = 0; b < m; ++b)
        out.covariance[a][b] += of_square[k] * d * (images[k][b] - out.mean[b]);
      for (std::size_t i = 0; i < n; ++i) out.cross[i][a] += of_square[k] * (points[k][i] - x[i]) * d;
    }
  return out;
}

const Numbers prior_mean{1.0L, -0.5L, 0.75L};
const Table prior_covariance{{0.5L, 0.1L, -0.05L}, {0.1L, 0.4L, 0.08L}, {-0.05L, 0.08L, 0.3L}};

template <int N>
cairn::Gaussian<Vector<N>> prior() {
  cairn::Gaussian<Vector<N>> belief{Vector<N>::Zero(3), Matrix<N>::Zero(3, 3)};
  for (int i = 0; i < 3; ++i) {
    belief.mean(i) = static_cast<double>(prior_mean[static_cast<std::size_t>(i)]);
    for (int j = 0; j < 3; ++j)
      belief.covariance(i, j) =
          static_cast<double>(prior_covariance[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]);
  }
  return belief;
}

template <class Mean, class Covariance>
void check(const Mean& mean, const Covariance& covariance, const Numbers& m, const Table& p) {
  for (std::size_t i = 0; i < 3; ++i) {
    const int row = static_cast<int>(i);
    CHECK(mean(row) == doctest::Approx(static_cast<double>(m[i])).epsilon(1e-9));
    for (std::size_t j = 0; j < 3; ++j)
      CHECK(covariance(row, static_cast<int>(j)) ==
            doctest::Approx(static_cast<double>(p[i][j])).epsilon(1e-9));
  }
}

/// Both forms of the filter, of these sizes, against the sums.
template <int N, int M>
void check_filters() {
  const auto steer = [](const long double* x, long double* y) { move(x, y); };
  const auto look = [](const long double* x, long double* z) { see(x, z); };
  for (const SigmaPoints& points : {SigmaPoints{1.0, 2.0, 0.0}, SigmaPoints{0.5, 2.0, 1.0},
                                    SigmaPoints{0.9, 0.81, 0.0}, SigmaPoints{1.2, 1.5, -1.0}}) {
    CAPTURE(points.alpha);
    const cairn::Unscented filter{.points = points};
    const cairn::SquareRootUnscented by_roots{.points = points};

    Moments moved = weighted(prior_mean, prior_covariance, 3, steer, points);
    for (std::size_t i = 0; i < 3; ++i) moved.covariance[i][i] += 0.01L;
    auto belief = prior<N>();
    auto root = cairn::SquareRootGaussian<Vector<N>>::from(belief);
    REQUIRE(filter.predict(belief, Motion<N>{}, 1.0) == Status::accepted);
    check(belief.mean, belief.covariance, moved.mean, moved.covariance);
    if (points.beta >= points.alpha * points.alpha) {
      REQUIRE(by_roots.predict(root, Motion<N>{}, 1.0) == Status::accepted);
      check(root.mean, root.covariance(), moved.mean, moved.covariance);
    }

    for (const double variance : {20.0, 0.5}) {
      CAPTURE(variance);
      const Moments seen = weighted(prior_mean, prior_covariance, 2, look, points);
      Table s = seen.covariance;
      s[0][0] += variance;
      s[1][1] += variance;
      const std::array<long double, 2> d{2.5L - seen.mean[0], 0.5L - seen.mean[1]};
      const long double determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
      Numbers m = prior_mean;
      Table p = prior_covariance, gain(3, Numbers(2, 0));
      for (std::size_t i = 0; i < 3; ++i) {
        const Numbers& c = seen.cross[i];
        gain[i] = {(c[0] * s[1][1] - c[1] * s[1][0]) / determinant,
                   (c[1] * s[0][0] - c[0] * s[0][1]) / determinant};
        m[i] += gain[i][0] * d[0] + gain[i][1] * d[1];
      }
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
          p[i][j] -= gain[i][0] * seen.cross[j][0] + gain[i][1] * seen.cross[j][1];
      belief = prior<N>();
      root = cairn::SquareRootGaussian<Vector<N>>::from(belief);
      Vector<M> z = Vector<M>::Zero(2);
      z(0) = 2.5;
      z(1) = 0.5;
      const Eye<N, M> eye{variance};
      REQUIRE(filter.update(belief, eye, z).accepted());
      check(belief.mean, belief.covariance, m, p);
      if (points.beta >= points.alpha * points.alpha) {
        REQUIRE(by_roots.update(root, eye, z).accepted());
        check(root.mean, root.covariance(), m, p);
      }
    }
  }
}

}  // namespace

TEST_SUITE("sigma_points") {
  TEST_CASE("sigma_points: fixed sizes give the sums over the weighted points") {
    check_filters<3, 2>();
  }
  TEST_CASE("sigma_points: sizes known at run time give the sums over the weighted points") {
    check_filters<cairn::dynamic, cairn::dynamic>();
  }
}

}  // namespace sigma_points_test
