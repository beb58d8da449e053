// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// LESSON 06  A kd-tree: most of the map need not be looked at, unless it has many dimensions
//
// 200 shops in a town of 100 m x 100 m: which is nearest to you? Looking at all n costs n distances. A tree
// halves the longer side of its cell at the median shop, and again, down to leaves of at most 8. A query q
// walks down to its leaf and, on the way back, asks at each split, r [m] being the distance to the nearest
// shop so far:
//   (q[axis] - split)^2 < r^2 ?     if not, nothing beyond can be nearer: all of it is skipped
// Both sides are SQUARED [m^2]: no roots to take, and a famous trap. (J. Friedman, J. Bentley, R. Finkel, ACM
// TOMS 3, 1977: O(n log n) to build, O(log n) a query at random points.)
// Look for: the circle shrinks, and what it does not reach stays grey. Then the plot of dimensions: at 16
// nearly every cell touches the ball, and the tree looks at nine points of ten.
// Now change this (the build is in support/small_tree.hpp, answers at the end): (1) leaves of one shop: what
// is gained, what is lost? (2) A query far off: query = {300, 50}; before the last walk. (3) All shops along
// one street, y = 50: which axis will be split?
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/kd_tree.hpp>

#include "support/lesson.hpp"
#include "support/small_tree.hpp"

using example::Ink, example::PlaneCurve, example::Shop, example::Cell, example::column;

struct Walk {
  const example::Lesson& lesson;
  const std::vector<Shop>& shops;
  Shop query;
  std::size_t nearest = 0, distances = 0;
  double squared = 1e300;                // distance to the nearest so far
  std::vector<const Cell*> leaves = {};  // in the order of looking
  std::vector<double> squares = {};      // `squared` after each

  void visit(const Cell& cell) {
    if (cell.halves.empty()) return look_at(cell);
    const double offset = query[cell.axis] - cell.split;
    const Cell& far = cell.halves[offset < 0 ? 1 : 0];
    visit(cell.halves[offset < 0 ? 0 : 1]);
    double nearest_there = offset * offset, limit = squared;
    if (lesson.mistake("plain-radius")) limit = std::sqrt(squared);
    if (lesson.mistake("child-point"))
      nearest_there = std::pow(query[cell.axis] - shops[(far.begin + far.end) / 2][cell.axis], 2);
    if (nearest_there < limit) visit(far);
  }
  void look_at(const Cell& leaf) {
    for (std::size_t i = leaf.begin; i < leaf.end; ++i, ++distances) {
      const double dx = shops[i][0] - query[0], dy = shops[i][1] - query[1];
      if (dx * dx + dy * dy < squared) squared = dx * dx + dy * dy, nearest = i;
    }
    leaves.push_back(&leaf);
    squares.push_back(squared);
  }
  PlaneCurve circle(double r2) const { return ellipse("nearest so far", Ink::belief, query, {r2, 0, r2}, 1); }
};

/// Share of `count` random points that the library's tree looks at for the nearest one.
double share_looked_at(std::size_t dimension, cairn::Random& random) {
  constexpr std::size_t count = 4096, queries = 50;
  std::vector<std::vector<float>> points(count + queries, std::vector<float>(dimension));
  for (auto& point : points)
    for (float& x : point) x = static_cast<float>(random.uniform());
  const cairn::KdTree<float> tree(std::vector(points.begin() + queries, points.end()));
  cairn::Work work;
  for (std::size_t i = 0; i < queries; ++i) {
    cairn::Nearest<float> nearest;
    tree.search(points[i], nearest, &work);
  }
  return std::min(1.0, static_cast<double>(work.distances) / (count * queries));
}

int main(int argc, char** argv) {
  example::Lesson lesson(
      {"06_tree_walk",
       "06 Tree walk: what need not be looked at",
       "Which of 200 shops is the nearest? A look at a dozen proves it.",
       200,
       20,
       5000,
       {{"plain-radius", "r in the place of r^2: OpenCV called a squared radius \"radius\" (#12683)"},
        {"child-point", "distance to a point beyond the split, not to the split (elixir-nx/scholar #343)"}}},
      argc, argv);
  cairn::Random random(lesson.seed());
  std::vector<Shop> shops(lesson.steps());
  for (Shop& shop : shops) shop = {random.uniform(0, 100), random.uniform(0, 100)};
  std::vector<std::vector<PlaneCurve>> levels;
  const Cell town = example::build(shops, {{0, 0}, {100, 100}, 0, shops.size()}, levels);
  const cairn::BruteForce everything(shops);
  double wrong = 0, share = 0;
  Shop query{};
  for (std::size_t i = 0, most = 0; i < 1000; ++i) {
    Walk walk{lesson, shops, {random.uniform(0, 100), random.uniform(0, 100)}};
    walk.visit(town);
    share += static_cast<double>(walk.distances) / static_cast<double>(1000 * shops.size());
    wrong += walk.nearest != everything.nearest(walk.query)->id;
    if (walk.leaves.size() > most) most = walk.leaves.size(), query = walk.query;
  }
  lesson.verdict("wrong answers", wrong, 0, 0, "of 1000, against looking at all shops");
  lesson.verdict("share of the shops looked at", share, 0, 0.5, "mean of 1000 queries");
  PlaneCurve dots{.name = "shops", .ink = Ink::grey, .dots = true};
  for (const Shop& shop : shops) dots.x.push_back(shop[0]), dots.y.push_back(shop[1]);
  example::PlaneFilm film{"Build, then walk: the longest walk", "", {"east", "m"}, {"north", "m"}, {"step"}};
  film.caption = "The circle reaches to the nearest shop so far. What it does not reach is skipped.";
  std::vector<PlaneCurve> cells;
  for (const std::vector<PlaneCurve>& level : levels) {
    cells.insert(cells.end(), level.begin(), level.end());
    film.frames.push_back({static_cast<double>(film.frames.size()),
                           "building: " + std::to_string(level.size()) + " new cells", cells});
  }
  Walk walk{lesson, shops, query};
  walk.visit(town);
  film.still = {dots, {"query", Ink::truth, {query[0]}, {query[1]}, true}};
  for (std::size_t k = 0, seen = 0; k < walk.leaves.size(); ++k) {
    seen += walk.leaves[k]->end - walk.leaves[k]->begin;
    cells.push_back(walk.leaves[k]->box("looked at", Ink::measurement, true));
    film.frames.push_back({static_cast<double>(film.frames.size()),
                           "leaf " + std::to_string(k + 1) + ", shops looked at: " + std::to_string(seen),
                           cells});
    film.frames.back().curves.push_back(walk.circle(walk.squares[k]));
  }
  lesson.add(film);
  example::PlaneFilm ride{"Now move the query", "", {"east", "m"}, {"north", "m"}, {"east [m]:"}};
  ride.still = {dots, town.box("town", Ink::grey, false)}, ride.start = 50;
  ride.caption = "A ride through the town: every query looks at the leaves that its circle reaches.";
  for (double east = 0; east <= 100; ++east) {
    Walk here{lesson, shops, {east, 50}};
    here.visit(town);
    std::vector<PlaneCurve> drawn{{"query", Ink::truth, {east}, {50}, true}, here.circle(here.squared)};
    for (const Cell* leaf : here.leaves) drawn.push_back(leaf->box("looked at", Ink::measurement, true));
    ride.frames.push_back({east, "shops looked at: " + std::to_string(here.distances), drawn});
  }
  lesson.add(ride);
  example::Rows rows;
  for (std::size_t d = 1; d <= 16; ++d) rows.push_back({static_cast<double>(d), share_looked_at(d, random)});
  lesson.csv("share_by_dimension", {"dimension", "share"}, rows);
  example::LinePlot plot{"And in more dimensions?", "", {"dimension"}, {"share looked at"}, column(rows, 0)};
  plot.curves = {{"share", Ink::belief, column(rows, 1)}};
  plot.caption = "Nearest of 4096 uniform points, exact, by cairn::KdTree; mean of 50 queries.";
  lesson.add(plot);
  return lesson.finish();
}
// Answers. (1) 4.4 shops of 200, not 11.9, but more splits and cells: a distance is cheap, a jump in memory
// is not. (2) The ball is huge and reaches into all cells on that side of the town: 39 shops. (3) Every other
// cut goes through y, for nothing: 0.58, and RED. cairn::KdTree asks how far the points reach, not the cell.
