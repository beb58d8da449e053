// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/gathered_spread.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/random.hpp>

namespace gathered_spread_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::SE2;
using cairn::Vector;
using example::Gathered;
using example::GatheredSpread;

constexpr double motion_sigma = 0.1, seen_sigma = 0.05;  // [m] a step to either axis; of what is seen of it

constexpr double a_step = 0.09;  // [m^2] that it gathers where posts are met

/// A map that knows where the pose before was: an observation is where a step along x has led, as if scans
/// were matched to the one before.
struct LastPlace {
  using Pose = SE2;
  using Observation = Vector<2>;  // from the pose before
  SE2 last;

  [[nodiscard]] double log_likelihood(const SE2& x, const Vector<2>& z) const {
    const Vector<2> e = (last.inverse() * x).translation() - z;
    return -0.5 * e.squaredNorm() / (seen_sigma * seen_sigma);
  }
  void insert(const SE2& x, const Vector<2>&) { last = x; }
};

struct Walked {
  Gaussian<SE2> told, by_particles;
  SE2 truth;
};

Walked walked(std::uint64_t seed, int steps) {
  cairn::Random random(seed, 3);
  cairn::MappedPaths<LastPlace> belief(SE2(), LastPlace{}, 60);
  const cairn::ConditionalFilter filter{.seed = seed};
  GatheredSpread spread;
  SE2 truth;
  const Matrix<3> noise =
      Vector<3>(motion_sigma * motion_sigma, motion_sigma * motion_sigma, 1e-12).asDiagonal();
  for (int k = 0; k < steps; ++k) {
    const double a = random.normal(0, motion_sigma), b = random.normal(0, motion_sigma),
                 c = random.normal(0, seen_sigma), d = random.normal(0, seen_sigma);
    const Vector<2> moved(1 + a, b);
    truth = truth * SE2(moved(0), moved(1), 0);
    const auto motion = [&](const SE2& x, std::size_t) { return Gaussian<SE2>{x * SE2(1, 0, 0), noise}; };
    REQUIRE(filter.step(belief, motion, cairn::FromMotion{}, Vector<2>(moved + Vector<2>(c, d))).accepted());
    spread.take(belief);
  }
  return {spread.pose(belief), belief.pose(), truth};
}

/// The ground is a row of posts, each seen from one place and the three before; what a look says of the
/// place, whichever posts it sees, is Gaussian about the one where the posts were put.
struct Posts {
  std::vector<double> at;  // [m] along x, where scan k is in truth
  double sigma;
  std::size_t inserted = 0;
  double shift = 0;  // of the map's scans, their poses less the truth

  void insert(std::size_t k, const SE2& pose) {
    CHECK(k == inserted);
    inserted = k + 1;
    if (k == 0) shift = pose.x() - at[k];
  }
  template <class Visit>
  void for_each_cell(std::size_t k, const SE2&, const Visit& visit) const {
    for (int i = 0; i < 3; ++i)
      visit(cairn::CellAddress{static_cast<std::int32_t>(std::lround(at[k])) + i, 0});
  }
  [[nodiscard]] auto evidence(std::size_t k) const {
    return [this, k](const SE2& pose) {
      const double e = pose.x() - shift - at[k];
      return -0.5 * (e * e + pose.y() * pose.y()) / (sigma * sigma) -
             0.5 * pose.angle() * pose.angle() / 1e-4;
    };
  }
};

/// Of ten places 1 m apart and back again: what is told of pose `asked`, which is `off` metres off.
Matrix<3> there_and_back(std::size_t asked, double sigma, double off, double farther, std::uint64_t seed) {
  std::vector<SE2> path;
  Posts posts{{}, sigma};
  Gathered gathered;
  for (std::size_t k = 0; k < 19; ++k) {
    posts.at.push_back(static_cast<double>(k < 10 ? k : 18 - k));
    path.emplace_back(posts.at.back() + (k == asked ? off : 0), 0, 0);
    gathered.before.emplace_back(a_step * static_cast<double>(k) * Matrix<3>::Identity());
    gathered.after.push_back(gathered.before.back());
  }
  return example::spread_of_poses(posts, path, gathered, {asked}, farther, seed).front();
}

}  // namespace

TEST_SUITE("examples/gathered_spread") {
  TEST_CASE(
      "gathered_spread: a walk whose steps are seen gathers their posterior, far more than particles hold") {
    constexpr int walks = 60, steps = 100;
    // Of each step given what is seen of it; and the truth is as far from that as a single line is at worst.
    const double of_step = 1 / (1 / (motion_sigma * motion_sigma) + 1 / (seen_sigma * seen_sigma));
    double claimed = 0, by_particles = 0, nees = 0;
    for (std::uint64_t seed = 1; seed <= walks; ++seed) {
      const Walked w = walked(seed, steps);
      claimed += w.told.covariance(0, 0) / walks;
      by_particles += w.by_particles.covariance(0, 0) / walks;
      const double off = (w.told.mean.translation() - w.truth.translation()).squaredNorm();
      nees += 0.5 * off / w.told.covariance(0, 0) / walks;  // of one number; both axes are alike
    }
    CAPTURE(claimed);
    CAPTURE(by_particles);
    CHECK(claimed / (steps * of_step) > 0.8);
    CHECK(claimed / (steps * of_step) < 1.25);
    CHECK(by_particles < 0.5 * claimed);
    CAPTURE(nees);
    CHECK(nees > 0.6);
    CHECK(nees < 2.3);  // 1 of the truth about the posterior, and up to 1 of a line that was drawn from it
  }

  TEST_CASE("moments_about_zero: a Gaussian likelihood that lies off, however much sharper than the prior") {
    for (const double sigma : {0.02, 0.3, 3.0}) {
      const Matrix<3> prior = Vector<3>(4, 1, 0.01).asDiagonal();
      const double off = 2 * sigma;
      const auto log_likelihood = [&](const Vector<3>& d) {
        return -0.5 * ((d(0) - off) * (d(0) - off) + d(1) * d(1)) / (sigma * sigma);
      };
      constexpr int times = 40;  // one answer is of some fifty draws
      Matrix<3> m = Matrix<3>::Zero();
      for (std::uint64_t seed = 0; seed < times; ++seed) {
        cairn::Random random(seed);
        m += example::moments_about_zero(prior, log_likelihood, random) / times;
      }
      const double left = 1 / (1 / 4.0 + 1 / (sigma * sigma)), mean = off * left / (sigma * sigma);
      CAPTURE(sigma);
      CHECK(m(0, 0) == doctest::Approx(left + mean * mean).epsilon(0.12));
      CHECK(m(1, 1) == doctest::Approx(1 / (1 + 1 / (sigma * sigma))).epsilon(0.12));
      CHECK(m(2, 2) == doctest::Approx(0.01).epsilon(0.12));
    }
    const Matrix<3> prior = Matrix<3>::Identity();
    cairn::Random random(7);
    const double never = -std::numeric_limits<double>::infinity();
    CHECK(example::moments_about_zero(prior, [&](const Vector<3>&) { return never; }, random) == prior);
  }

  TEST_CASE(
      "spread_of_poses: ground met again leaves what the first visit and the look leave, and how far it is "
      "off") {
    const auto along = [](std::size_t asked, double sigma, double off, double farther) {
      constexpr int times = 40;  // one answer is of some fifty draws
      double sum = 0;
      for (std::uint64_t seed = 0; seed < times; ++seed)
        sum += there_and_back(asked, sigma, off, farther, seed)(0, 0);
      return sum / times;
    };
    CHECK(along(18, 0.1, 0, 100) == doctest::Approx(18 * a_step));
    CHECK(along(18, 0.1, 0, 4) == doctest::Approx(0.01).epsilon(0.1));  // the first post's place is the start
    CHECK(along(18, 0.1, 0.5, 4) == doctest::Approx(0.25 + 0.01).epsilon(0.1));
    // Posts that poses 4 to 6 saw first, 5 of them in the middle, which is not known better than this; and a
    // look that says nothing leaves what the way has gathered.
    CHECK(along(12, 0.1, 0, 4) == doctest::Approx(5 * a_step + 0.01).epsilon(0.05));
    CHECK(along(12, 50, 0, 4) == doctest::Approx(12 * a_step).epsilon(0.1));
  }
}

}  // namespace gathered_spread_test
