// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/axis_metrics.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/nearest_first.hpp>
#include <cairn/index/tree_file.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace axis_metrics_test {
namespace {

using cairn::straight;
constexpr double pi = 3.14159265358979323846;
constexpr auto turn = static_cast<float>(2 * pi);

/// The shorter way round, from the definition: the least over representatives.
double circular_difference(double a, double b, double period) {
  if (std::isinf(period)) return std::abs(a - b);
  double least = std::numeric_limits<double>::infinity();
  for (int k = -9; k <= 9; ++k) least = std::min(least, std::abs(a - b + k * period));
  return least;
}

/// Points of several kinds: any representative, all near the seam, on a lattice that has points on the seam.
template <std::size_t Dim>
std::vector<std::array<float, Dim>> make_poses(const std::string& shape, std::size_t count,
                                               const std::array<float, Dim>& periods, cairn::Random& random) {
  std::vector<std::array<float, Dim>> poses(count);
  for (auto& pose : poses)
    for (std::size_t a = 0; a < Dim; ++a) {
      const double span = std::isinf(periods[a]) ? 2.0 : double{periods[a]};
      double number = random.uniform(-2.5, 2.5) * span;
      if (shape == "seam") number = span / 2 + 1e-3 * random.normal();
      if (shape == "lattice") number = static_cast<double>(random.below(9)) * span / 8;
      if (shape == "equal") number = span / 2;
      pose[a] = static_cast<float>(number);
    }
  return poses;
}

template <class Hits>
std::size_t differing(const Hits& found, const Hits& expected) {
  if (found.size() != expected.size()) return 1 + found.size() + expected.size();
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    wrong += std::abs(found[i].distance - expected[i].distance) > 1e-5F * expected[i].distance + 1e-6F;
  return wrong;
}

/// The other ways to search.
template <std::size_t Dim, class M, class Hits>
std::size_t differing_elsewhere(const cairn::KdTree<float, Dim, M>& tree, const M& metric,
                                const std::vector<std::array<float, Dim>>& poses,
                                const std::array<float, Dim>& query, const Hits& expected) {
  cairn::MultiKdTree<float, Dim, M> forest({.first_size = 40, .growth = 2}, metric);
  forest.insert(std::span(poses).first(poses.size() / 2));
  forest.insert(std::span(poses).subspan(poses.size() / 2));
  std::size_t wrong = differing(forest.nearest(query, 7), expected);

  Hits found(expected.size());
  cairn::KNearest<float> collector(found.data(), found.size());
  cairn::BestBinFirst<cairn::KdTree<float, Dim, M>> best_bin_first;
  wrong += !best_bin_first.search(tree, query, collector);
  collector.restore(metric);
  wrong += differing(found, expected);

  cairn::NearestFirst order(tree, query);
  Hits ordered;
  while (ordered.size() < found.size()) ordered.push_back(*order.next());
  wrong += differing(ordered, expected);

  Hits near;
  for (const auto& hit : expected)
    if (hit.distance <= 0.3F) near.push_back(hit);
  const Hits within = tree.within(query, 0.3F);
  if (near.size() < 7) wrong += differing(within, near);
  return wrong;
}

/// Searches against brute force, which the first test compares with the definition.
template <bool thorough, std::size_t Dim, class M>
void compare(const M& metric, const std::array<float, Dim>& periods, const std::string& shape,
             std::size_t count, cairn::Random& random) {
  using Tree = cairn::KdTree<float, Dim, M>;
  const auto poses = make_poses<Dim>(shape, count, periods, random);
  const Tree tree(poses, metric);
  const cairn::BruteForce<float, Dim, M> brute(poses, metric);
  std::size_t wrong = 0;
  for (int round = 0; round < 10; ++round) {
    const auto query = make_poses<Dim>(round % 2 == 0 ? shape : "uniform", 1, periods, random)[0];
    const auto expected = brute.nearest(query, 7);
    wrong += differing(tree.nearest(query, 7), expected);
    if constexpr (thorough) wrong += differing_elsewhere(tree, metric, poses, query, expected);
  }
  REQUIRE(wrong == 0);
}

template <bool thorough, std::size_t Dim, class M>
void compare_all(const M& metric, const std::array<float, Dim>& periods) {
  cairn::Random random(cairn_test::seed(31));
  for (const std::string shape : {"uniform", "seam", "lattice", "equal"})
    for (const std::size_t count : {1U, 17U, 100U, 600U}) {
      CAPTURE(shape);
      CAPTURE(count);
      compare<thorough, Dim>(metric, periods, shape, count, random);
    }
}

}  // namespace

TEST_SUITE("axis_metrics") {
  TEST_CASE("axis_metrics: a circular distance is the least over all representatives") {
    using Pose = cairn::Circular<cairn::WeightedL2<3>, 3>;
    const Pose metric{.periods = {straight, straight, turn}, .base = {{1.0F, 0.5F, 2.0F}}};
    cairn::Random random(cairn_test::seed(30));
    const auto poses = make_poses<3>("uniform", 60, metric.periods, random);
    const cairn::BruteForce<float, 3, Pose> brute(poses, metric);
    for (const auto& query : make_poses<3>("uniform", 40, metric.periods, random)) {
      const auto hits = brute.nearest(query, 60);
      REQUIRE(hits.size() == 60);
      for (const auto& hit : hits) {
        const auto& pose = poses[hit.id];
        const double x = double{query[0]} - double{pose[0]};
        const double y = 0.5 * (double{query[1]} - double{pose[1]});
        const double heading = 2 * circular_difference(double{query[2]}, double{pose[2]}, double{turn});
        REQUIRE(double{hit.distance} == doctest::Approx(std::hypot(x, y, heading)).epsilon(1e-5));
      }
    }
  }

  TEST_CASE("axis_metrics: all searches answer like brute force where headings wrap") {
    compare_all<true, 3>(
        cairn::Circular<cairn::WeightedL2<3>, 3>{{straight, straight, turn}, {{1.0F, 1.0F, 0.5F}}},
        {straight, straight, turn});
  }

  TEST_CASE("axis_metrics: and on tori, in other norms, and above eight dimensions") {
    compare_all<false, 2>(cairn::Circular<cairn::LInfinity, 2>{{1.0F, 360.0F}}, {1.0F, 360.0F});
    std::array<float, 10> periods;
    periods.fill(straight);
    periods[0] = periods[4] = turn;
    compare_all<true, 10>(cairn::Circular<cairn::L1, 10>{periods}, periods);
  }

  TEST_CASE("axis_metrics: neighbours across the seam are found") {
    const std::vector<std::array<float, 1>> angles{{3.1F}, {0.0F}, {-3.0F + 4 * turn}};
    using Heading = cairn::Circular<cairn::L2, 1>;
    const cairn::KdTree<float, 1, Heading> tree(angles, Heading{{turn}});
    const auto hits = tree.nearest(std::array{-3.1F}, 2);
    REQUIRE(hits.size() == 2);
    CHECK(hits[0].id == 0);
    CHECK(hits[0].distance == doctest::Approx(2 * pi - 6.2).epsilon(1e-4));
    CHECK(hits[1].id == 2);
    CHECK(hits[1].distance == doctest::Approx(0.1).epsilon(1e-3).scale(0));
  }

  TEST_CASE("axis_metrics: a box on a circle is the arc from low to high") {
    using Heading = cairn::Circular<cairn::L2, 2>;
    const Heading metric{{straight, turn}};
    cairn::Random random(cairn_test::seed(33));
    const auto poses = make_poses<2>("uniform", 700, metric.periods, random);
    const cairn::KdTree<float, 2, Heading> tree(poses, metric);
    for (int round = 0; round < 60; ++round) {
      const double low = random.uniform(-9, 9);
      const double length = random.uniform(0, 7);
      std::size_t expected = 0;
      for (const auto& pose : poses) {
        const double from_low = std::fmod(double{pose[1]} - low + 20 * double{turn}, double{turn});
        expected += std::abs(pose[0]) <= 3 && (from_low <= length || length >= double{turn});
      }
      const auto found = cairn::inside(tree, std::array{-3.0, low}, std::array{3.0, low + length});
      CHECK(found.size() == expected);
    }
    const std::vector<std::array<float, 2>> seam{{0.0F, turn / 2}, {0.0F, -turn / 2}};
    const cairn::KdTree<float, 2, Heading> two(seam, metric);
    CHECK(cairn::inside(two, std::array{-1.0F, turn / 4}, std::array{1.0F, turn / 2}).size() == 2);
    CHECK(cairn::inside(two, std::array{-1.0F, -turn / 2}, std::array{1.0F, 0.0F}).size() == 2);
  }

  TEST_CASE("axis_metrics: weights of zero leave an axis out") {
    cairn::Random random(cairn_test::seed(34));
    compare_all<false, 3>(cairn::Weighted<cairn::L1, 3>{{2.0F, 0.0F, 0.25F}}, {straight, straight, straight});
    const std::vector<std::array<double, 2>> points{{0, 5}, {1, 0}};
    using Metric = cairn::WeightedL2<2>;  // float weights, double points
    const cairn::KdTree<double, 2, Metric> tree(points, Metric{{1.0F, 0.0F}});
    CHECK(tree.nearest(std::array{0.25, 0.0})->distance == 0.25);
  }

  TEST_CASE("axis_metrics: a saved tree is loaded under the metric that is given") {
    using Pose = cairn::Circular<cairn::L2, 1>;
    using Tree = cairn::KdTree<float, 1, Pose>;
    const std::vector<std::array<float, 1>> angles{{3.0F}, {0.0F}};
    std::ostringstream out;
    cairn::save_tree(out, Tree(angles, Pose{{turn}}));
    std::istringstream in(out.str());
    const Tree loaded = cairn::load_tree<Tree>(in, "memory", Pose{{turn}});
    CHECK(loaded.nearest(std::array{-3.0F})->id == 0);
  }

  TEST_CASE("axis_metrics: what cannot be a weight, a period or a dimension is refused") {
    using cairn_test::message_of;
    const std::vector<std::array<float, 2>> points(3, {1, 2});
    using Weights = cairn::WeightedL2<2>;
    const auto weighted = [&](float weight) {
      return message_of([&] { cairn::KdTree<float, 2, Weights> tree(points, Weights{{1.0F, weight}}); });
    };
    CHECK(weighted(1.0F).empty());
    CHECK(weighted(-1.0F).find("Weighted: weight 1 is -1") != std::string::npos);
    CHECK(weighted(std::numeric_limits<float>::quiet_NaN()).find("weight 1 is nan") != std::string::npos);
    CHECK(weighted(straight).find("weight 1 is inf") != std::string::npos);
    using Circle = cairn::Circular<cairn::L2, 2>;
    const auto circular = [&](float period) {
      return message_of(
          [&] { cairn::BruteForce<float, 2, Circle> brute(points, Circle{{period, straight}}); });
    };
    CHECK(circular(1.0F).empty());
    CHECK(circular(0.0F).find("Circular: period 0 is 0") != std::string::npos);
    CHECK(circular(-turn).find("period 0 is -6.28") != std::string::npos);
    const std::vector<std::vector<float>> wide{{1, 2, 3}};
    using Dynamic = cairn::KdTree<float, cairn::dynamic_dim, Weights>;
    CHECK(message_of([&] { Dynamic tree(wide, Weights{{1, 1}}); }).find("2 axes for points of 3") !=
          std::string::npos);
    cairn::MultiKdTree<float, 2, Circle> forest({}, Circle{{-1.0F, straight}});
    CHECK_THROWS_AS(forest.insert(points), cairn::Error);
    CHECK(forest.empty());
  }
}

}  // namespace axis_metrics_test
