// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/geometry/ransac.hpp>

#include "support/random.hpp"

namespace ransac_test {
namespace {

using cairn::RansacOptions;
using cairn::RansacScore;
using cairn::SamplingOrder;

/// A line y = a x + b through points of which some are wrong: the smallest problem there is.
struct LineProblem {
  struct Model {
    double a = 0, b = 0;
  };
  struct Point {
    double x, y;
  };
  static constexpr std::size_t sample_size = 2;
  std::vector<Point> points;
  double threshold_squared = 0.01;
  mutable std::vector<std::vector<std::uint32_t>> samples{};

  [[nodiscard]] std::size_t size() const { return points.size(); }
  [[nodiscard]] bool solve(std::span<const std::uint32_t> sample, Model& model) const {
    samples.emplace_back(sample.begin(), sample.end());
    const Point p = points[sample[0]], q = points[sample[1]];
    if (std::abs(p.x - q.x) < 1e-9) return false;
    model.a = (q.y - p.y) / (q.x - p.x);
    model.b = p.y - model.a * p.x;
    return true;
  }
  [[nodiscard]] double squared(const Model& m, const Point& p) const {
    return (p.y - m.a * p.x - m.b) * (p.y - m.a * p.x - m.b);
  }
  [[nodiscard]] RansacScore score(const Model& m, double limit) const {
    RansacScore s{0, 0};
    for (const Point& p : points) {
      s.cost += std::min(threshold_squared, squared(m, p));
      s.inliers += squared(m, p) < threshold_squared;
      if (s.cost > limit) break;
    }
    return s;
  }
  [[nodiscard]] bool refine(Model& m) const {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    for (const Point& p : points)
      if (squared(m, p) < threshold_squared) {
        ++n;
        x += p.x;
        y += p.y;
        xx += p.x * p.x;
        xy += p.x * p.y;
      }
    const double determinant = n * xx - x * x;
    if (!(determinant > 1e-9)) return false;
    m.a = (n * xy - x * y) / determinant;
    m.b = (y - m.a * x) / n;
    return true;
  }
  void inliers(const Model& m, std::span<std::uint8_t> mask) const {
    for (std::size_t i = 0; i < points.size(); ++i) mask[i] = squared(m, points[i]) < threshold_squared;
  }
};
static_assert(cairn::RansacProblem<LineProblem>);

/// `good` points on y = 2x - 1, then `wrong` ones anywhere.
LineProblem line_problem(std::size_t good, std::size_t wrong, cairn::Random& random) {
  LineProblem problem;
  for (std::size_t i = 0; i < good + wrong; ++i) {
    const double x = random.uniform(-1, 1);
    problem.points.push_back({x, i < good ? 2 * x - 1 + random.normal(0, 0.02) : random.uniform(-4, 2)});
  }
  return problem;
}

void shuffle(LineProblem& problem, cairn::Random& random) {
  for (std::size_t i = problem.points.size() - 1; i > 0; --i)
    std::swap(problem.points[i], problem.points[random.below(i + 1)]);
}

}  // namespace

TEST_SUITE("ransac") {
  TEST_CASE("ransac: finds the line through outliers of 0 to 80 percent, for a hundred seeds each") {
    cairn::Random random(cairn_test::seed());
    for (const std::size_t wrong : {0U, 30U, 60U, 80U}) {
      int found = 0;
      for (std::uint64_t seed = 0; seed < 100; ++seed) {
        LineProblem problem = line_problem(100 - wrong, wrong, random);
        shuffle(problem, random);
        const auto result = cairn::ransac(problem, {.seed = seed});
        REQUIRE(result.model.has_value());
        found += std::abs(result.model->a - 2) < 0.1 && std::abs(result.model->b + 1) < 0.1;
      }
      CHECK(found >= 99);
    }
  }

  TEST_CASE("ransac: the answer is one that least squares on its own inliers does not improve by a percent") {
    cairn::Random random(cairn_test::seed());
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      LineProblem problem = line_problem(70, 30, random);
      shuffle(problem, random);
      const auto result = cairn::ransac(problem, {.refinements = 20, .seed = seed});
      REQUIRE(result.model.has_value());
      LineProblem::Model again = *result.model;
      REQUIRE(problem.refine(again));
      CHECK(problem.score(again, 1e9).cost >= 0.99 * result.score.cost);
    }
  }

  TEST_CASE("ransac: the number of samples is the exact formula's") {
    // log(1 - 0.99) / log(1 - w^3 without replacement), w = 1/2 of 100: C(50,3)/C(100,3) = 0.121212
    CHECK(cairn::detail::samples_needed(50, 100, 3, 0.99, 1e9) ==
          doctest::Approx(std::log(0.01) / std::log(1 - 4.0 / 33)).epsilon(1e-12));
    CHECK(cairn::detail::samples_needed(100, 100, 3, 0.99, 1e9) == 1);
    CHECK(cairn::detail::samples_needed(2, 100, 3, 0.99, 77) == 77);
    cairn::Random random(cairn_test::seed());
    LineProblem problem = line_problem(50, 50, random);
    shuffle(problem, random);
    const auto result = cairn::ransac(problem, {.confidence = 0.99, .min_iterations = 1});
    const double needed = cairn::detail::samples_needed(result.score.inliers, 100, 2, 0.99, 1000);
    CHECK(result.iterations >= static_cast<int>(needed));
    CHECK(result.iterations < 200);
  }

  TEST_CASE("ransac: samples are distinct and uniform over all data") {
    cairn::Random random(cairn_test::seed());
    LineProblem problem = line_problem(0, 10, random);
    (void)cairn::ransac(problem, {.min_iterations = 5000, .max_iterations = 5000});
    std::vector<int> count(10, 0);
    for (const auto& sample : problem.samples) {
      REQUIRE(sample[0] != sample[1]);
      for (const std::uint32_t i : sample) ++count[i];
    }
    for (const int c : count) CHECK(std::abs(c - 1000) < 5 * std::sqrt(1000 * 0.8));  // five sigmas
  }

  TEST_CASE("ransac: progressive order begins with the best and ends with everything") {
    cairn::Random random(cairn_test::seed());
    LineProblem problem = line_problem(0, 60, random);
    RansacOptions options{
        .min_iterations = 2000, .max_iterations = 2000, .order = SamplingOrder::progressive};
    (void)cairn::ransac(problem, options);
    CHECK(std::set<std::uint32_t>(problem.samples[0].begin(), problem.samples[0].end()) ==
          std::set<std::uint32_t>{0, 1});
    std::uint32_t early = 0, late = 0;
    for (std::size_t k = 0; k < 10; ++k)
      early = std::max({early, problem.samples[k][0], problem.samples[k][1]});
    for (std::size_t k = 1000; k < 2000; ++k)
      late = std::max({late, problem.samples[k][0], problem.samples[k][1]});
    CHECK(early <= 11);
    CHECK(late >= 50);
    for (const auto& sample : problem.samples) REQUIRE(sample[0] != sample[1]);
  }

  TEST_CASE("ransac: a good order needs fewer samples than none") {
    cairn::Random random(cairn_test::seed());
    int uniform = 0, progressive = 0;
    for (std::uint64_t seed = 0; seed < 30; ++seed) {
      const LineProblem problem = line_problem(40, 160, random);  // the good ones come first
      const auto a = cairn::ransac(problem, {.seed = seed});
      const auto b = cairn::ransac(problem, {.order = SamplingOrder::progressive, .seed = seed});
      uniform += a.iterations;
      progressive += b.iterations;
      CHECK(b.score.inliers >= 40);
    }
    CHECK(progressive * 5 < uniform);
  }

  TEST_CASE("ransac: the same seed gives the same bits, another seed other samples") {
    cairn::Random random(cairn_test::seed());
    LineProblem problem = line_problem(30, 30, random);
    const auto a = cairn::ransac(problem, {.seed = 9});
    const auto samples = problem.samples;
    problem.samples.clear();
    const auto b = cairn::ransac(problem, {.seed = 9});
    CHECK(samples == problem.samples);
    CHECK(a.model->a == b.model->a);
    CHECK(a.score.cost == b.score.cost);
    problem.samples.clear();
    (void)cairn::ransac(problem, {.seed = 10});
    CHECK(samples != problem.samples);
  }

  TEST_CASE("ransac: guesses are tried first, and are all there is when a sample cannot be drawn") {
    cairn::Random random(cairn_test::seed());
    const LineProblem one = line_problem(1, 0, random);
    CHECK_FALSE(cairn::ransac(one).model.has_value());
    CHECK_FALSE(cairn::ransac(LineProblem{}).model.has_value());
    const LineProblem::Model guess{2, -1};
    const auto result = cairn::ransac(one, {}, std::span<const LineProblem::Model>(&guess, 1));
    REQUIRE(result.model.has_value());
    CHECK(result.score.inliers == 1);
    CHECK(result.iterations == 0);

    const LineProblem many = line_problem(20, 80, random);
    const auto with =
        cairn::ransac(many, {.max_iterations = 0}, std::span<const LineProblem::Model>(&guess, 1));
    CHECK(with.score.inliers >= 20);
  }
}

}  // namespace ransac_test
