// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Held against Eigen's dense decompositions, which know nothing of blocks, triangles or damping.
#include "support/sparse_least_squares.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Dense>
#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>

#include "support/random.hpp"

namespace sparse_least_squares_test {
namespace {

using cairn::Matrix;
using cairn::Vector;

/// A chain of unknowns, two numbers each: every residual is linear in two neighbours, the first in one.
struct Chain {
  struct Link {
    Matrix<3, 2> before, after;
    Vector<3> offset;
  };
  std::vector<Link> links;

  Chain(std::size_t size, cairn::Random& random) : links(size) {
    const auto fill = [&](auto& m) {
      for (auto& v : m.reshaped()) v = random.normal(0, 1);
    };
    for (Link& link : links) {
      fill(link.before);
      fill(link.after);
      fill(link.offset);
    }
  }
  [[nodiscard]] int unknowns() const { return 2 * static_cast<int>(links.size()); }
  [[nodiscard]] Vector<3> residual(const Eigen::VectorXd& x, std::size_t k) const {
    const int at = 2 * static_cast<int>(k);
    Vector<3> e = links[k].after * x.segment<2>(at) - links[k].offset;
    if (k > 0) e += links[k].before * x.segment<2>(at - 2);
    return e;
  }
  [[nodiscard]] example::NormalEquations equations_at(const Eigen::VectorXd& x) const {
    example::NormalEquations equations(unknowns());
    for (std::size_t k = 0; k < links.size(); ++k) {
      const auto& [before, after, offset] = links[k];
      const Vector<3> e = residual(x, k);
      const int at = 2 * static_cast<int>(k);
      equations.add_cost(0.5 * e.squaredNorm());
      equations.add_block(at, at, Matrix<2>(after.transpose() * after));
      equations.add_gradient(at, Vector<2>(after.transpose() * e));
      if (k == 0) continue;
      equations.add_block(at - 2, at - 2, Matrix<2>(before.transpose() * before));
      equations.add_gradient(at - 2, Vector<2>(before.transpose() * e));
      equations.add_block(at, at - 2, Matrix<2>(after.transpose() * before));
    }
    return equations;
  }
  /// All residuals' slopes and offsets in one dense matrix and vector.
  [[nodiscard]] Eigen::MatrixXd dense() const {
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(3 * static_cast<int>(links.size()), unknowns());
    for (int k = 0; k < static_cast<int>(links.size()); ++k) {
      j.block<3, 2>(3 * k, 2 * k) = links[static_cast<std::size_t>(k)].after;
      if (k > 0) j.block<3, 2>(3 * k, 2 * k - 2) = links[static_cast<std::size_t>(k)].before;
    }
    return j;
  }
  [[nodiscard]] Eigen::VectorXd offsets() const {
    Eigen::VectorXd b(3 * static_cast<int>(links.size()));
    for (int k = 0; k < static_cast<int>(links.size()); ++k)
      b.segment<3>(3 * k) = links[static_cast<std::size_t>(k)].offset;
    return b;
  }
};

Eigen::VectorXd added(const Eigen::VectorXd& x, const Eigen::VectorXd& d) {
  return x + d;
}

/// Two places in the plane, by their distances from three beacons and from each other.
struct Ranges {
  std::vector<Vector<2>> beacons{{0, 0}, {10, 0}, {0, 10}};
  Eigen::VectorXd measured;  // of the first from each beacon, of the second, of one from the other

  [[nodiscard]] Eigen::VectorXd predicted(const Eigen::VectorXd& x) const {
    Eigen::VectorXd d(7);
    for (int i = 0; i < 3; ++i) {
      d(i) = (x.head<2>() - beacons[static_cast<std::size_t>(i)]).norm();
      d(3 + i) = (x.tail<2>() - beacons[static_cast<std::size_t>(i)]).norm();
    }
    d(6) = (x.head<2>() - x.tail<2>()).norm();
    return d;
  }
  [[nodiscard]] Eigen::MatrixXd numeric_slopes(const Eigen::VectorXd& x) const {
    Eigen::MatrixXd j(7, 4);
    for (int i = 0; i < 4; ++i) {
      Eigen::VectorXd h = Eigen::VectorXd::Zero(4);
      h(i) = 1e-6;
      j.col(i) = (predicted(x + h) - predicted(x - h)) / 2e-6;
    }
    return j;
  }
  [[nodiscard]] example::NormalEquations equations_at(const Eigen::VectorXd& x) const {
    example::NormalEquations equations(4);
    const auto add = [&](int row, const Vector<2>& from, double e) {
      const Vector<2> to = x.segment<2>(row), along = (to - from).normalized();
      equations.add_block(row, row, Matrix<2>(along * along.transpose()));
      equations.add_gradient(row, Vector<2>(along * e));
    };
    const Eigen::VectorXd e = predicted(x) - measured;
    equations.add_cost(0.5 * e.squaredNorm());
    for (int i = 0; i < 3; ++i) {
      add(0, beacons[static_cast<std::size_t>(i)], e(i));
      add(2, beacons[static_cast<std::size_t>(i)], e(3 + i));
    }
    add(0, x.tail<2>(), e(6));
    add(2, x.head<2>(), e(6));
    const Vector<2> along = (x.head<2>() - x.tail<2>()).normalized();
    equations.add_block(2, 0, Matrix<2>(-along * along.transpose()));
    return equations;
  }
};

}  // namespace

TEST_SUITE("examples/sparse_least_squares") {
  TEST_CASE("least squares: the sparse equations are the dense ones' lower triangle") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const Chain chain(7, random);
    const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(chain.unknowns(), -1, 2);
    const example::NormalEquations equations = chain.equations_at(x);
    const Eigen::MatrixXd j = chain.dense(), h = j.transpose() * j;
    const Eigen::VectorXd e = j * x - chain.offsets();
    CHECK(equations.cost() == doctest::Approx(0.5 * e.squaredNorm()));
    CHECK((equations.gradient() - j.transpose() * e).norm() < 1e-12 * (1 + e.norm()));
    const Eigen::MatrixXd lower = h.triangularView<Eigen::Lower>();
    CHECK((Eigen::MatrixXd(equations.matrix()) - lower).norm() < 1e-12 * h.norm());
    Eigen::MatrixXd damped = lower;
    damped.diagonal() *= 1.5;
    CHECK((Eigen::MatrixXd(example::damped(equations.matrix(), 0.5)) - damped).norm() < 1e-12 * h.norm());
  }

  TEST_CASE("least squares: a linear problem ends where Eigen's dense decomposition does") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const std::size_t size : {1U, 2U, 30U}) {
      const Chain chain(size, random);
      const Eigen::VectorXd is = chain.dense().colPivHouseholderQr().solve(chain.offsets());
      const auto found = example::levenberg(Eigen::VectorXd(Eigen::VectorXd::Constant(chain.unknowns(), 5)),
                                            [&](const Eigen::VectorXd& x) { return chain.equations_at(x); },
                                            added, {.least_gain = 1e-14});
      CHECK((found.at - is).norm() < 1e-5 * (1 + is.norm()));
      CHECK(found.cost == doctest::Approx(0.5 * (chain.dense() * is - chain.offsets()).squaredNorm()));
      CHECK(found.iterations < 30);
    }
  }

  TEST_CASE("least squares: a start that is the optimum is left as soon as no step promises anything") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int repeat = 0; repeat < 20; ++repeat) {
      const Chain chain(30, random);
      const Eigen::VectorXd is = chain.dense().colPivHouseholderQr().solve(chain.offsets());
      const auto found = example::levenberg(
          Eigen::VectorXd(is), [&](const Eigen::VectorXd& x) { return chain.equations_at(x); }, added);
      CHECK(found.converged);
      CHECK(found.iterations == 1);
      CHECK((found.at - is).norm() < 1e-8 * (1 + is.norm()));
    }
    // Where nothing is left of the cost, no share of it is.
    const auto exact = [](const Eigen::VectorXd& x) {
      example::NormalEquations equations(1);
      equations.add_cost(0.5 * x(0) * x(0));
      equations.add_block(0, 0, Matrix<1>(Matrix<1>::Ones()));
      equations.add_gradient(0, Vector<1>(Vector<1>(x(0))));
      return equations;
    };
    const auto found = example::levenberg(Eigen::VectorXd(Vector<1>(0.0)), exact, added);
    CHECK(found.converged);
    CHECK(found.iterations == 1);
  }

  TEST_CASE("least squares: from a start where whole steps lead astray it ends where every slope is zero") {
    Ranges ranges;
    const Eigen::VectorXd is = Eigen::Vector4d(3, 4, 7, 5);
    ranges.measured = ranges.predicted(is);
    ranges.measured(2) += 0.2;  // so that something is left
    const auto cost = [&](const Eigen::VectorXd& x) {
      return 0.5 * (ranges.predicted(x) - ranges.measured).squaredNorm();
    };
    for (const Eigen::Vector4d& start : {Eigen::Vector4d(1, 1, 9, 9), Eigen::Vector4d(-40, 30, 60, -5)}) {
      const auto found = example::levenberg(
          Eigen::VectorXd(start), [&](const Eigen::VectorXd& x) { return ranges.equations_at(x); }, added);
      CHECK(found.converged);
      CHECK(found.cost == doctest::Approx(cost(found.at)));
      CHECK(found.cost < cost(is));
      const Eigen::VectorXd slope =
          ranges.numeric_slopes(found.at).transpose() * (ranges.predicted(found.at) - ranges.measured);
      CHECK(slope.norm() < 1e-3);
    }
  }

  TEST_CASE("least squares: the cost never rises, and what cannot be solved is the start as it was") {
    // An unknown of which nothing is said: the equations are singular, whatever the damping.
    const auto half_said = [](const Eigen::VectorXd& x) {
      example::NormalEquations equations(2);
      equations.add_cost(0.5 * x(0) * x(0));
      equations.add_block(0, 0, Matrix<1>(Matrix<1>::Ones()));
      equations.add_gradient(0, Vector<1>(Vector<1>(x(0))));
      return equations;
    };
    const auto stayed = example::levenberg(Eigen::VectorXd(Eigen::Vector2d(3, 4)), half_said, added);
    CHECK(stayed.at == Eigen::Vector2d(3, 4));
    CHECK_FALSE(stayed.converged);
    CHECK(stayed.cost == 4.5);
    // Beyond one there is no cost, and the whole step from 0 goes there.
    const auto walled = [](const Eigen::VectorXd& x) {
      example::NormalEquations equations(1);
      const double e = x(0) - 2;
      equations.add_cost(x(0) > 1 ? std::numeric_limits<double>::quiet_NaN() : 0.5 * e * e);
      equations.add_block(0, 0, Matrix<1>(Matrix<1>::Ones()));
      equations.add_gradient(0, Vector<1>(Vector<1>(e)));
      return equations;
    };
    const auto before = example::levenberg(Eigen::VectorXd(Vector<1>(0.0)), walled, added);
    CHECK(before.at(0) > 0.5);
    CHECK(before.at(0) <= 1);
    CHECK(std::isfinite(before.cost));
    // No more steps than allowed.
    const auto none =
        example::levenberg(Eigen::VectorXd(Vector<1>(0.0)), walled, added, {.most_iterations = 0});
    CHECK(none.at(0) == 0);
    CHECK(none.cost == 2);
  }
}

}  // namespace sparse_least_squares_test
