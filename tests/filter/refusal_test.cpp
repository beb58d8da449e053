// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What the filters say of numbers that come near the end of what can be said: singular priors, noises that
// are none, contradictions, scales of many decades. The oracles are closed forms, long double and 113 bits.
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/constraint.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/interacting.hpp>
#include <cairn/filter/joint_extended.hpp>
#include <cairn/filter/joint_gaussian.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/kalman_bucy.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/filter/robust.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/square_root_information.hpp>
#include <cairn/filter/steady_state.hpp>
#include <cairn/filter/timeline.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so3.hpp>
#include <cairn/models/linear.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "filter/every_form.hpp"
#include "filter/exact_filter.hpp"
#include "support/random.hpp"

namespace refusal_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;
using cairn_test::plain;
using cairn_test::Quad;
using cairn_test::quad_solve;
using cairn_test::QuadMatrix;
using cairn_test::times;
using cairn_test::turned;

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

using Long = long double;
using LongVector2 = std::array<Long, 2>;

// Two bent numbers of three.
template <class T>
std::array<T, 2> bent(T x, T y, T z) {
  using std::sin;
  return {x + T(0.25) * y * y, sin(T(0.5) * z) + y};
}
struct Bent {
  using State = Vector<3>;
  using Measurement = Vector<2>;
  [[nodiscard]] Vector<2> predict(const State& x) const {
    const auto seen = bent(x(0), x(1), x(2));
    return {seen[0], seen[1]};
  }
  [[nodiscard]] Matrix<2, 3> jacobian(const State& x) const {
    return (Matrix<2, 3>() << 1, 0.5 * x(1), 0, 0, 1, 0.5 * std::cos(0.5 * x(2))).finished();
  }
  [[nodiscard]] Matrix<2> noise(const State&) const { return Vector<2>(0.01, 0.04).asDiagonal(); }
};

struct Logarithm {
  using State = Vector<1>;
  using Measurement = Vector<1>;
  [[nodiscard]] Vector<1> predict(const State& x) const { return Vector<1>(std::log(x(0))); }
  [[nodiscard]] Matrix<1> jacobian(const State& x) const { return Matrix<1>(1.0 / x(0)); }
  [[nodiscard]] Matrix<1> noise(const State&) const { return Matrix<1>(0.01); }
};

// The most likely point of a prior mean + G u, u ~ N(0, I), in the plane of G, by Newton's method with
// numeric second derivatives in long double.
struct Plane {
  Matrix<3, 2> g;
  Vector<3> mean;
  Vector<2> z;

  [[nodiscard]] std::array<Long, 3> at(const LongVector2& u) const {
    std::array<Long, 3> x{};
    for (int i = 0; i < 3; ++i)
      x[static_cast<std::size_t>(i)] = Long(mean(i)) + Long(g(i, 0)) * u[0] + Long(g(i, 1)) * u[1];
    return x;
  }
  [[nodiscard]] Long cost(const LongVector2& u) const {
    const auto x = at(u);
    const auto seen = bent<Long>(x[0], x[1], x[2]);
    const Long a = Long(z(0)) - seen[0], b = Long(z(1)) - seen[1];
    return u[0] * u[0] + u[1] * u[1] + a * a / Long(0.01) + b * b / Long(0.04);
  }
  [[nodiscard]] LongVector2 slope(const LongVector2& u) const {
    LongVector2 out{};
    for (std::size_t i = 0; i < 2; ++i) {
      LongVector2 up = u, down = u;
      const Long h = 1e-6L;
      up[i] += h;
      down[i] -= h;
      out[i] = (cost(up) - cost(down)) / (2 * h);
    }
    return out;
  }
  // From u down; false where that does not come to rest.
  [[nodiscard]] bool descend(LongVector2& u) const {
    for (int step = 0; step < 200; ++step) {
      const LongVector2 s = slope(u);
      LongVector2 right = u, above = u;
      const Long h = 1e-5L;
      right[0] += h;
      above[1] += h;
      const LongVector2 sr = slope(right), sa = slope(above);
      Long a = (sr[0] - s[0]) / h, b = ((sr[1] - s[1]) / h + (sa[0] - s[0]) / h) / 2, c = (sa[1] - s[1]) / h;
      Long shift = 0;
      while (!((a + shift) * (c + shift) > b * b) || !(a + shift > 0)) shift = 2 * shift + 1;
      a += shift;
      c += shift;
      const Long determinant = a * c - b * b;
      LongVector2 change{-(c * s[0] - b * s[1]) / determinant, -(a * s[1] - b * s[0]) / determinant};
      const Long now = cost(u);
      for (int halving = 0; halving < 60; ++halving) {
        const LongVector2 next{u[0] + change[0], u[1] + change[1]};
        if (cost(next) <= now) {
          u = next;
          break;
        }
        change[0] /= 2;
        change[1] /= 2;
      }
      if (std::abs(change[0]) + std::abs(change[1]) < 1e-9L) return true;
    }
    return false;
  }
};

template <int N>
Matrix<N> random_covariance(cairn::Random& random, int rank, double decades) {
  Matrix<N, cairn::dynamic> root(N, rank);
  for (int i = 0; i < N; ++i) {
    const double scale = std::pow(10.0, random.uniform(-decades, decades));
    for (int j = 0; j < rank; ++j) root(i, j) = scale * random.normal();
  }
  return cairn::symmetrised(Matrix<N>(root * root.transpose()));
}

// No direction has less variance than the rounding of 64 bits, in units of the diagonal.
template <int N, class S>
bool is_covariance(const Matrix<N, N, S>& p) {
  if (!(p == p.transpose())) return false;
  QuadMatrix a(p), none(N, 0);
  for (int i = 0; i < N; ++i) {
    if (!(p(i, i) >= S(0))) return false;
    for (int j = 0; j < N; ++j)
      if (p(i, i) == S(0) && p(i, j) != S(0)) return false;
    const Quad slack = 512 * Quad(std::numeric_limits<S>::epsilon()) * a.at(i, i);
    a.at(i, i) += p(i, i) == S(0) ? Quad(1) : slack;
  }
  // elimination in turn: all pivots of a positive definite matrix are positive
  for (int j = 0; j < N; ++j) {
    if (!(a.at(j, j) > 0)) return false;
    for (int i = j + 1; i < N; ++i) {
      const Quad factor = a.at(i, j) / a.at(j, j);
      for (int k = j; k < N; ++k) a.at(i, k) -= factor * a.at(j, k);
    }
  }
  return true;
}

TEST_SUITE("refusals") {
  TEST_CASE("extended: iterations from a singular prior end at the most likely point of its plane") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    int judged = 0;
    for (int k = 0; k < 400; ++k) {
      Plane plane;
      for (int i = 0; i < 3; ++i) {
        plane.mean(i) = random.normal();
        for (int j = 0; j < 2; ++j) plane.g(i, j) = 0.5 * random.normal();
      }
      const Gaussian<Vector<3>> prior{plane.mean,
                                      cairn::symmetrised(Matrix<3>(plane.g * plane.g.transpose()))};
      LongVector2 truth{Long(random.normal()), Long(random.normal())};
      const auto x = plane.at(truth);
      const auto seen = bent(x[0], x[1], x[2]);
      plane.z = Vector<2>(double(seen[0]) + 0.1 * random.normal(), double(seen[1]) + 0.2 * random.normal());
      Gaussian<Vector<3>> belief = prior;
      // Gauss-Newton's errors shrink by a factor q: what has changed by less than 1e-6 deviations after 200
      // iterations, (1 - q) q^200 of the first error, is off by no more than 2e-5 of it.
      const auto in = cairn::Extended{.iterations = 200, .settled = 1e-6}.update(belief, Bent{}, plane.z);
      if (!in.accepted()) {
        CHECK(belief.mean == prior.mean);
        CHECK(belief.covariance == prior.covariance);
        continue;
      }
      // u of the answer, by least squares; what it leaves is outside of the plane
      const Matrix<2> gg = plane.g.transpose() * plane.g;
      const Vector<2> u = gg.inverse() * (plane.g.transpose() * (belief.mean - prior.mean));
      CHECK((belief.mean - prior.mean - plane.g * u).norm() < 1e-7 * (1 + belief.mean.norm()));
      LongVector2 best{Long(u(0)), Long(u(1))};
      REQUIRE(plane.descend(best));
      CHECK(std::abs(double(best[0]) - u(0)) < 1e-4);
      CHECK(std::abs(double(best[1]) - u(1)) < 1e-4);
      const Matrix<2> j = Bent{}.jacobian(belief.mean) * plane.g;
      const Matrix<2> information =
          Matrix<2>::Identity() + j.transpose() * Bent{}.noise(belief.mean).inverse() * j;
      const Matrix<3> left = plane.g * information.inverse() * plane.g.transpose();
      CHECK((belief.covariance - left).norm() < 1e-3 * left.norm());
      ++judged;
    }
    CHECK(judged > 380);
  }

  TEST_CASE("extended: iterations that cannot end are refused, and the belief is left") {
    const Gaussian<Vector<1>> prior{Vector<1>(1.0), Matrix<1>(1.0)};
    Gaussian<Vector<1>> belief = prior;
    for (const int iterations : {2, 10, 100}) {
      const auto in = cairn::Extended{.iterations = iterations}.update(belief, Logarithm{}, Vector<1>(-1e6));
      CHECK(in.status == Status::not_converged);
      CHECK(belief.mean == prior.mean);
      CHECK(belief.covariance == prior.covariance);
    }
    CHECK(cairn::Extended{.iterations = 20}.update(belief, Logarithm{}, Vector<1>(0.3)).accepted());
  }

  TEST_CASE("constrain: scales of twelve decades keep a covariance, and the constraint holds") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed, 4);
    int accepted = 0;
    constexpr int models = 4000;
    for (int k = 0; k < models; ++k) {
      const Matrix<4> p = random_covariance<4>(random, 1 + static_cast<int>(random.below(4)), 6.0);
      Gaussian<Vector<4>> belief{Vector<4>::Zero(), p};
      Matrix<2, 4> d;
      for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 2; ++i) d(i, j) = random.normal();
      const Vector<4> there =
          p * Vector<4>(random.normal(), random.normal(), random.normal(), random.normal());
      const Vector<2> c = d * there;
      if (cairn::constrain(belief, d, c) != Status::accepted) {
        CHECK(belief.covariance == p);
        continue;
      }
      ++accepted;
      CHECK(is_covariance<4, double>(belief.covariance));
      for (int i = 0; i < 2; ++i) {
        double size = 0.0, deviations = 0.0;
        for (int j = 0; j < 4; ++j) {
          size += std::abs(d(i, j) * there(j)) + std::abs(d(i, j) * belief.mean(j));
          deviations += std::abs(d(i, j)) * std::sqrt(p(j, j));
        }
        CHECK(std::abs(d.row(i).dot(belief.mean) - c(i)) <= 1e-6 * (size + deviations));
        const double left = d.row(i) * belief.covariance * d.row(i).transpose();
        CHECK(std::abs(left) <= 1e-9 * deviations * deviations);
      }
    }
    CHECK(accepted > models / 4);
  }

  TEST_CASE("constrain: the sum of a wide and a narrow number is known, and little else") {
    Gaussian<Vector<2>> belief{Vector<2>::Zero(), Vector<2>(1e12, 1e-6).asDiagonal()};
    REQUIRE(cairn::constrain(belief, Matrix<1, 2>(1, 1), Vector<1>(0.0)) == Status::accepted);
    const Matrix<2> left = (Matrix<2>() << 1e-6, -1e-6, -1e-6, 1e-6).finished();  // ab / (a + b) to 18 digits
    CHECK((belief.covariance - left).norm() < 1e-15);
  }

  TEST_CASE("constrain: a mean that is not finite, or would not be, is refused") {
    Gaussian<Vector<2>> belief{Vector<2>(std::nan(""), 1), Matrix<2>::Identity()};
    CHECK(cairn::constrain(belief, Matrix<1, 2>(1, 0), Vector<1>(0.5)) == Status::not_finite);
    CHECK(belief.covariance == Matrix<2>::Identity());
    Gaussian<cairn::SO3> attitude{cairn::SO3(), 1e308 * Matrix<3>::Identity()};
    CHECK(cairn::constrain(attitude, Matrix<1, 3>(1, 0, 0), Vector<1>(1e180)) == Status::not_finite);
    CHECK(attitude.mean.w() == 1);
    CHECK(cairn::constrain(attitude, Matrix<1, 3>(1, 0, 0), Vector<1>(1.0)) == Status::accepted);
  }

  TEST_CASE("constrain: what contradicts itself, or what is certain, is refused; repetitions are not") {
    const Gaussian<Vector<2>> prior{Vector<2>(1, 2), Vector<2>(4, 1).asDiagonal()};
    Gaussian<Vector<2>> belief = prior;
    const Matrix<2> twice = Matrix<2>::Ones();
    CHECK(cairn::constrain(belief, twice, Vector<2>(1, 2)) == Status::contradiction);
    CHECK(belief.covariance == prior.covariance);
    CHECK(cairn::constrain(belief, twice, Vector<2>(1, 1)) == Status::accepted);
    CHECK(belief.mean.isApprox(Vector<2>(1.8, 2.2)));
    Gaussian<Vector<2>> certain{Vector<2>(1, 2), Vector<2>(4, 0).asDiagonal()};
    CHECK(cairn::constrain(certain, Matrix<1, 2>(0, 1), Vector<1>(0.5)) == Status::contradiction);
    CHECK(cairn::constrain(certain, Matrix<1, 2>(0, 1), Vector<1>(0.0)) == Status::accepted);
    CHECK(certain.covariance(0, 0) == 4.0);
  }

  TEST_CASE("steady_state: small states settle beside large ones") {
    Matrix<2> f = Vector<2>(0.9, 0.99999).asDiagonal(), q = Vector<2>(1e4, 1e-18).asDiagonal(),
              r = Vector<2>(1.0, 1e-8).asDiagonal();
    const auto s = cairn::steady_state<2, 2, double>(f, Matrix<2>::Identity(), q, r);
    REQUIRE(s.accepted());
    for (int i = 0; i < 2; ++i) {  // p = f^2 p r / (p + r) + q is a quadratic equation
      const Long ff = Long(f(i, i)) * Long(f(i, i)), qq = Long(q(i, i)), rr = Long(r(i, i));
      const Long b = rr * (1 - ff) - qq;
      const Long root = std::sqrt(b * b + 4 * qq * rr);
      const Long p = b > 0 ? 2 * qq * rr / (b + root) : (root - b) / 2;
      CHECK(std::abs(s.predicted(i, i) / double(p) - 1) < 1e-6);
      CHECK(std::abs(s.gain(i, i) / double(p / (p + rr)) - 1) < 1e-6);
    }
    CHECK(std::abs(s.gain(1, 1) - 4.14e-6) < 1e-8);
  }

  TEST_CASE("information forms: a covariance without an inverse has none") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed, 6);
    for (int k = 0; k < 2000; ++k) {
      const int rank = 1 + static_cast<int>(random.below(3));
      const Gaussian<Vector<3>> belief{Vector<3>::Zero(), random_covariance<3>(random, rank, 3.0)};
      const auto information = cairn::InformationBelief<Vector<3>>::from(belief);
      const auto root = cairn::SquareRootInformation<Vector<3>>::from(belief);
      if (rank < 3) {
        CHECK_FALSE(information.has_value());
        CHECK_FALSE(root.has_value());
        continue;
      }
      for (const auto& back :
           {information ? information->gaussian() : std::nullopt, root ? root->gaussian() : std::nullopt}) {
        if (!back) continue;
        for (int i = 0; i < 3; ++i)
          CHECK(std::abs(back->covariance(i, i) / belief.covariance(i, i) - 1) < 2e-3);
      }
    }
  }

  TEST_CASE(
      "nees: an error inside the range of a singular covariance has a size, one outside is impossible") {
    Matrix<3, 2> g;
    g << 1, 2, -0.5, 3, 0.25, 1;
    const Gaussian<Vector<3>> belief{Vector<3>(1, 2, 3), cairn::symmetrised(Matrix<3>(g * g.transpose()))};
    const Vector<2> u(0.7, -1.1);
    CHECK(cairn::nees(belief, Vector<3>(belief.mean + g * u)) ==
          doctest::Approx(u.squaredNorm()).epsilon(1e-9));
    const Vector<3> normal = Vector<3>(g.col(0)).cross(Vector<3>(g.col(1))).normalized();
    CHECK(cairn::nees(belief, Vector<3>(belief.mean + 1e-3 * normal)) == infinite);
  }

  TEST_CASE("smoother: covariances after an all but unknown start are those of the whole record at once") {
    // position and velocity, F = [1 1; 0 1], over `count` steps; batch normal equations in 113 bits
    constexpr int count = 12;
    Matrix<2> f;
    f << 1, 1, 0, 1;
    const Matrix<2> q = (Matrix<2>() << 1e-3 / 3, 1e-3 / 2, 1e-3 / 2, 1e-3).finished();
    for (const double p0 : {1.0, 1e4, 1e8}) {
      CAPTURE(p0);
      const cairn::LinearModel<2> process{f, q};
      const cairn::LinearSensor<1, 2> sensor{Matrix<1, 2>(1, 0), Matrix<1>(1e-6)};
      cairn::Recorder recorder(cairn::Kalman{},
                               Gaussian<Vector<2>>{Vector<2>::Zero(), p0 * Matrix<2>::Identity()});
      for (int k = 0; k < count; ++k) {
        REQUIRE(recorder.predict(process, 1.0) == Status::accepted);
        REQUIRE(recorder.update(sensor, Vector<1>(std::sin(0.3 * k))).accepted());
      }
      QuadMatrix y(2 * count + 2, 2 * count + 2);
      for (int i = 0; i < 2; ++i) y.at(i, i) = 1 / Quad(p0);
      QuadMatrix w = cairn_test::quad_identity(2);
      REQUIRE(quad_solve(QuadMatrix(q), w));
      const QuadMatrix fq(f);
      for (int k = 0; k < count; ++k) {
        const QuadMatrix wf = times(w, fq), fwf = times(turned(fq), wf);
        for (int i = 0; i < 2; ++i)
          for (int j = 0; j < 2; ++j) {
            y.at(2 * k + i, 2 * k + j) += fwf.at(i, j);
            y.at(2 * k + 2 + i, 2 * k + 2 + j) += w.at(i, j);
            y.at(2 * k + 2 + i, 2 * k + j) -= wf.at(i, j);
            y.at(2 * k + j, 2 * k + 2 + i) -= wf.at(i, j);
          }
        y.at(2 * k + 2, 2 * k + 2) += 1 / Quad(1e-6);
      }
      QuadMatrix p = cairn_test::quad_identity(2 * count + 2);
      REQUIRE(quad_solve(y, p));
      const auto path = recorder.smoothed();
      for (int k = 0; k <= count; ++k) {
        CAPTURE(k);
        const Matrix<2>& found = path[static_cast<std::size_t>(k)].covariance;
        CHECK(is_covariance<2, double>(found));
        for (int i = 0; i < 2; ++i)
          for (int j = 0; j < 2; ++j) {
            const double size =
                std::sqrt(plain(p.at(2 * k + i, 2 * k + i)) * plain(p.at(2 * k + j, 2 * k + j)));
            CHECK(std::abs(found(i, j) - plain(p.at(2 * k + i, 2 * k + j))) < 1e-3 * size);
          }
      }
    }
  }

  TEST_CASE("filters: a process noise that is no covariance is refused, and the belief is left") {
    const Gaussian<Vector<2>> prior{Vector<2>(1, 2), Vector<2>(4, 9).asDiagonal()};
    const std::array<Matrix<2>, 3> noises{Matrix<2>(-0.5 * Matrix<2>::Identity()),
                                          (Matrix<2>() << 1, 2, 2, 1).finished(),
                                          Matrix<2>(Vector<2>(1e-9, -1e-9).asDiagonal())};
    for (const Matrix<2>& q : noises) {
      const cairn::LinearModel<2> process{Matrix<2>::Identity(), q};
      const auto refuses = [&](const auto& filter, auto belief) {
        const auto before = belief;
        CHECK(filter.predict(belief, process, 1.0) == Status::not_positive_definite);
        if constexpr (requires { belief.covariance.rows(); }) CHECK(belief.covariance == before.covariance);
      };
      refuses(cairn::Kalman{}, prior);
      refuses(cairn::Extended{}, prior);
      refuses(cairn::Unscented{}, prior);
      refuses(cairn::SquareRoot{}, cairn::SquareRootGaussian<Vector<2>>::from(prior));
      refuses(cairn::SquareRootUnscented{}, cairn::SquareRootGaussian<Vector<2>>::from(prior));
      refuses(cairn::UDFilter{}, cairn::UDGaussian<Vector<2>>::from(prior));
      refuses(cairn::InformationFilter{}, *cairn::InformationBelief<Vector<2>>::from(prior));
      refuses(cairn::SquareRootInformationFilter{}, *cairn::SquareRootInformation<Vector<2>>::from(prior));
      const Gaussian<Vector<cairn::dynamic>> wide{prior.mean, prior.covariance};
      const cairn::LinearModel<cairn::dynamic> wide_process{Matrix<2>::Identity(), q};
      auto belief = wide;
      CHECK(cairn::Kalman{}.predict(belief, wide_process, 1.0) == Status::not_positive_definite);
      CHECK(cairn::Unscented{}.predict(belief, wide_process, 1.0) == Status::not_positive_definite);
      CHECK(belief.covariance == wide.covariance);
    }
  }

  TEST_CASE("interacting: probabilities that are none are refused, and the belief is left") {
    using X = Vector<1>;
    const Gaussian<X> mode{X(1.0), Matrix<1>(1.0)};
    const cairn::Interacting<2, cairn::Kalman> filter{{}, {{{0.9, 0.1}, {0.2, 0.8}}}};
    const cairn::LinearModel<1> walk{Matrix<1>(1.0), Matrix<1>(0.1)};
    const cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(1.0)};
    const std::array<std::array<double, 2>, 5> none{
        {{not_a_number, 1.0}, {-0.5, 1.5}, {0.0, 0.0}, {0.5, infinite}, {0.5, 0.25}}};
    for (const auto& probability : none) {
      cairn::ModeBelief<X, 2> belief{{mode, mode}, probability};
      CHECK(filter.predict(belief, std::tuple(walk, walk), 1.0) != Status::accepted);
      CHECK(filter.update(belief, sensor, X(2.0)) != Status::accepted);
      CHECK(belief.modes[0].mean(0) == 1.0);
      CHECK(belief.modes[1].covariance(0) == 1.0);
    }
    cairn::ModeBelief<X, 2> belief{{mode, mode}, {0.5, 0.5}};
    CHECK(filter.predict(belief, std::tuple(walk, walk), 1.0) == Status::accepted);
    CHECK(filter.update(belief, sensor, X(2.0)) == Status::accepted);
  }

  TEST_CASE("resampling: weights that are none are named") {
    for (const auto scheme : {cairn::Resampling::systematic, cairn::Resampling::stratified,
                              cairn::Resampling::residual, cairn::Resampling::multinomial}) {
      cairn::Random random(3);
      const auto draw = [&](const std::vector<double>& weights) {
        return cairn::resampled_indices(weights, 10, scheme, random);
      };
      CHECK_THROWS_WITH_AS(static_cast<void>(draw({0.5, not_a_number, 0.5})), doctest::Contains("index 1"),
                           cairn::Error);
      CHECK_THROWS_WITH_AS(static_cast<void>(draw({0.5, 0.75, -0.25})), doctest::Contains("index 2"),
                           cairn::Error);
      CHECK_THROWS_AS(static_cast<void>(draw({0.0, 0.0})), cairn::Error);
      CHECK_THROWS_AS(static_cast<void>(draw({infinite, 1.0})), cairn::Error);
      for (const std::size_t i : draw({0.0, 3.0, 0.0})) CHECK(i == 1);
    }
  }

  // x' = -x + noise of density q settles at q / 2.
  struct Decay {
    using State = Vector<1>;
    using Control = cairn::NoControl;
    [[nodiscard]] Vector<1> rate(const State& x, const Control&) const { return -x; }
    [[nodiscard]] Matrix<1> rate_jacobian(const State&, const Control&) const { return Matrix<1>(-1.0); }
    [[nodiscard]] Matrix<1> spectral_density(const State&, const Control&) const { return Matrix<1>(3.0); }
  };
  TEST_CASE("kalman-bucy: over many time constants it settles, or says that it did not converge") {
    for (const double dt : {0.5, 10.0, 1000.0}) {
      Gaussian<Vector<1>> belief{Vector<1>(5.0), Matrix<1>(2.0)};
      REQUIRE(cairn::KalmanBucy{}.predict(belief, Decay{}, dt) == Status::accepted);
      const double p = 1.5 + 0.5 * std::exp(-2 * dt), x = 5.0 * std::exp(-dt);
      CHECK(std::abs(belief.mean(0) - x) < 1e-4);
      CHECK(std::abs(belief.covariance(0) - p) < 1e-4);
    }
    Gaussian<Vector<1>> belief{Vector<1>(5.0), Matrix<1>(2.0)};
    CHECK(cairn::KalmanBucy{.most_parts = 10}.predict(belief, Decay{}, 1000.0) == Status::not_converged);
    CHECK(belief.mean(0) == 5.0);
  }

  TEST_CASE("robust: an outlier of a sensor without noise is refused, and the belief is left") {
    const cairn::LinearSensor<1, 2> exact{Matrix<1, 2>(1, 0), Matrix<1>(0.0)};
    const Gaussian<Vector<2>> prior{Vector<2>(1, 2), Matrix<2>::Identity()};
    const auto refuses = [&](const auto& filter) {
      Gaussian<Vector<2>> belief = prior;
      CHECK(filter.update(belief, exact, Vector<1>(50.0)).status == Status::not_positive_definite);
      CHECK(belief.mean == prior.mean);
      CHECK(belief.covariance == prior.covariance);
    };
    refuses(cairn::Robust<>{});
    refuses(cairn::Huber<>{});
    refuses(cairn::StudentT<>{});
  }

  TEST_CASE("gaussian: covariances of floats are taken, and those of roots are symmetric bit for bit") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed, 9);
    for (int k = 0; k < 1000; ++k) {
      Matrix<4, 4, float> g;
      for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) g(i, j) = static_cast<float>(random.normal());
      Matrix<4, 4, float> p;
      for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) {  // each entry rounded on its own way, as a product of floats is
          float sum = 0.0F;
          for (int l = 0; l < 4; ++l) sum += i < j ? g(i, l) * g(j, l) : g(i, 3 - l) * g(j, 3 - l);
          p(i, j) = sum;
        }
      using Belief = Gaussian<Vector<4, float>>;
      REQUIRE_NOTHROW(static_cast<void>(Belief::checked(Vector<4, float>::Zero(), p)));
      const Belief belief = Belief::checked(Vector<4, float>::Zero(), p);
      const auto root = cairn::SquareRootGaussian<Vector<4, float>>::from(belief);
      const Matrix<4, 4, float> back = root.covariance();
      CHECK(back == back.transpose());
      Matrix<4, 4, float> lopsided = p;
      lopsided(0, 1) += 0.01F * std::sqrt(p(0, 0) * p(1, 1));
      CHECK_THROWS_AS(static_cast<void>(Belief::checked(Vector<4, float>::Zero(), lopsided)), cairn::Error);
    }
  }

  TEST_CASE("timeline: what is older than the horizon is refused, also before anything is forgotten") {
    const Gaussian<cairn::SE2> prior{cairn::SE2(0, 0, 0.3), Vector<3>(0.5, 0.5, 0.2).asDiagonal()};
    cairn::Timeline<cairn::Extended, cairn::Unicycle, cairn::PlanarPosition> run(
        cairn::Extended{}, cairn::Unicycle{}, prior, 0.0, Vector<2>(1.0, 0.2), 1.0);
    const cairn::PlanarPosition sensor{.sigma = 0.4};
    REQUIRE(run.measure(sensor, Vector<2>(2.0, 1.0), 2.5).accepted());
    CHECK(run.measure(sensor, Vector<2>(1.0, 0.0), 1.25).status == Status::too_old);
    CHECK(run.measure(sensor, Vector<2>(1.0, 0.0), 1.75).accepted());
  }

  /// Of the very object: a copy's padding may differ.
  template <class Belief>
  std::vector<unsigned char> bytes_of(const Belief& belief) {
    std::vector<unsigned char> bytes(sizeof(belief));
    std::memcpy(bytes.data(), &belief, sizeof(belief));
    return bytes;
  }

  // A turn by 1e155 radians has a square that no double holds.
  struct FarTurn {
    using State = cairn::SO3;
    using Measurement = Vector<3>;
    [[nodiscard]] Vector<3> predict(const State&) const { return Vector<3>::Zero(); }
    [[nodiscard]] Matrix<3> jacobian(const State&) const { return Matrix<3>::Identity(); }
    [[nodiscard]] Matrix<3> noise(const State&) const { return Matrix<3>::Identity(); }
  };
  TEST_CASE("filters: a step that leaves what numbers hold is refused, and the belief is left") {
    const Gaussian<cairn::SO3> prior{cairn::SO3::exp(Vector<3>(0.1, 0.2, 0.3)),
                                     1e306 * Matrix<3>::Identity()};
    const Vector<3> z(1e155, -2e155, 1.5e155);
    const auto refuses = [&](const char* name, const auto& filter) {
      CAPTURE(name);
      auto belief = cairn_test::begin_with(filter, prior);
      const auto before = bytes_of(belief);
      CHECK_FALSE(filter.update(belief, FarTurn{}, z).accepted());
      CHECK(bytes_of(belief) == before);
    };
    refuses("Extended", cairn::Extended{});
    refuses("SquareRoot", cairn::SquareRoot{});
    refuses("UDFilter", cairn::UDFilter{});
    auto information = *cairn::InformationBelief<cairn::SO3>::from(prior);
    CHECK(cairn::InformationFilter{}.update(information, FarTurn{}, z).accepted());  // no step is made yet
    CHECK_FALSE(information.gaussian());
    CHECK_FALSE(cairn::InformationFilter::recentre(information));
    cairn::JointGaussian<cairn::SO3> joint;
    const auto turned = joint.add(prior).id;
    for (const cairn::JointExtended filter : {cairn::JointExtended{}, {.iterations = 3}}) {
      CHECK_FALSE(filter.update(joint, FarTurn{}, z, turned).accepted());
      CHECK(joint.mean(turned).matrix() == prior.mean.matrix());
      CHECK(joint.covariance() == prior.covariance);
    }
    // Of two numbers the second moves 1e153 times as far as the first, from 1.79e308.
    const Gaussian<Vector<2>> far{Vector<2>(0, 1.79e308), (Matrix<2>() << 1, 1e153, 1e153, 2e306).finished()};
    const cairn::LinearSensor<1, 2> first{Matrix<1, 2>(1, 0), Matrix<1>(0.01)};
    const auto refuses_far = [&](const char* name, const auto& filter) {
      CAPTURE(name);
      auto belief = cairn_test::begin_with(filter, far);
      const auto before = bytes_of(belief);
      CHECK(filter.update(belief, first, Vector<1>(2e153)).status == Status::not_finite);
      CHECK(bytes_of(belief) == before);
    };
    refuses_far("Kalman", cairn::Kalman{});
    refuses_far("Extended", cairn::Extended{});
    refuses_far("SquareRoot", cairn::SquareRoot{});
    refuses_far("UDFilter", cairn::UDFilter{});
    cairn::JointGaussian<Vector<2>> blocks;
    const auto id = blocks.add(far).id;
    CHECK_FALSE(cairn::JointExtended{}.update(blocks, first, Vector<1>(2e153), id).accepted());
    CHECK(blocks.mean(id) == far.mean);
    CHECK(blocks.covariance() == far.covariance);
  }

  TEST_CASE("so3, se2: quaternions of any length, and small turns in float") {
    for (const double scale : {1e-200, 1e-20, 1.0, 1e20, 1e200}) {
      const auto r = cairn::SO3::from_quaternion(scale * 0.5, -scale * 0.5, scale * 0.5, scale * 0.5);
      CHECK(std::abs(r.w() - 0.5) < 1e-15);
    }
    for (const float scale : {1e-30F, 1e-10F, 1e20F, 1e38F}) {
      const auto r = cairn::BasicSO3<float>::from_quaternion(scale, 0.0F, scale, 0.0F);
      CHECK(std::abs(r.w() - std::sqrt(0.5F)) < 1e-6F);
    }
    float worst = 0.0F;
    for (int k = 1; k < 3000; ++k) {
      const float angle = 0.001F * static_cast<float>(k);
      const auto found = cairn::BasicSE2<float>::exp(Vector<3, float>(1.0F, 0.0F, angle));
      const Long a = Long(angle), s = std::sin(a) / a, c = (1 - std::cos(a)) / a;
      const std::array<Long, 2> exact{s, c};
      for (int i = 0; i < 2; ++i) {
        const Long e = exact[static_cast<std::size_t>(i)];
        const auto ulp = static_cast<float>(std::abs(found.translation()(i) - e) / std::abs(e) /
                                            Long(std::numeric_limits<float>::epsilon()));
        worst = std::max(worst, ulp);
      }
    }
    CHECK(worst < 4.0F);
  }
}

}  // namespace
}  // namespace refusal_test
