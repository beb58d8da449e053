// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// LESSON 07  A forest that grows: the logarithmic method is a binary counter
//
// At each step a robot meets 32 new points, and asks at once which known point is nearest. A kd-tree cannot
// grow and stay balanced: it is built, which moves each of its n points once a level, about n log2 n moves.
// Doing that at each step costs n^2 log n in all, n being the points at the end, but for a constant. Bentley
// and Saxe keep several trees, of 32, 64, 128, ... points, each size once:
//   a step is 1 more in binary: a second tree of 32 makes one of 64 with the first, that with another one of
//   128, ... a point moves once a digit, into trees of log2 n levels: n log^2 n moves in all
// (J. Bentley, J. Saxe, Decomposable searching problems I, J. Algorithms 1, 1980.) A search asks all trees,
// as many as the step has digits 1, and takes the nearest of all answers. What is erased is marked, and
// dropped when its tree is next merged.
//
// Look for: the bars are the digits of the step. The sum of the work stays below n log^2 n, but at 128, 256,
// ... one step moves all there is: amortised is not worst-case.
//
// Now change this (answers at the end): (1) --steps 512: how large is the worst step now? (2) .growth = 4:
// fewer moves? And trees? (3) .merging = cairn::Merging::spread behind .rule: which step is long then?
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/multi_kd_tree.hpp>

#include "support/lesson.hpp"

using example::Ink;
using Place = std::array<float, 2>;
constexpr std::size_t batch = 32;

/// Building a tree moves every point once a level, down to leaves of 16.
double work_of(std::size_t points) {
  return static_cast<double>(points) * (1 + std::log2(std::max(1.0, static_cast<double>(points) / 16)));
}

/// 1 where two distances are not the same up to rounding.
double differ(float a, float b) {
  return std::abs(a - b) > 1e-6F ? 1 : 0;
}

std::vector<Place> random_places(std::size_t count, cairn::Random& random) {
  std::vector<Place> places(count);
  for (Place& p : places) p = {static_cast<float>(random.uniform()), static_cast<float>(random.uniform())};
  return places;
}

/// The trees as bars: the digit of 2^i is worth 32 * 2^i points.
example::PlaneFrame drawn(std::size_t step, const std::vector<std::size_t>& sizes) {
  std::string binary;
  for (std::size_t left = step; left > 0; left /= 2) binary.insert(0, 1, left % 2 == 0 ? '0' : '1');
  example::PlaneFrame frame{
      static_cast<double>(step), binary + " in binary; trees: " + std::to_string(sizes.size()), {}};
  for (const std::size_t size : sizes) {
    const double x = std::log2(static_cast<double>(size) / batch), y = std::log2(static_cast<double>(size));
    const std::vector<double> sides{-x - 0.4, -x - 0.4, -x + 0.4, -x + 0.4};
    frame.curves.push_back(
        {.name = "tree", .ink = Ink::belief, .x = sides, .y = {0, y, y, 0}, .filled = true});
  }
  return frame;
}

int main(int argc, char** argv) {
  example::Lesson lesson(
      {"07_growing_forest",
       "07 A forest that grows",
       "Adding points is adding one to a binary number.",
       500,
       64,
       1500,
       {{"rebuild", "one tree, built anew at each step, as A-LOAM's laserMapping.cpp does"},
        {"erased-come-back", "a merge brings erased points back (nanoflann until #99, 2018)"}}},
      argc, argv);
  cairn::Random random(lesson.seed());
  cairn::MultiKdTree<float, 2> forest({.first_size = batch, .growth = 2, .rule = cairn::MergeRule::counter});
  std::vector<Place> places;
  std::vector<double> steps, sums, singles, anew, bound;
  std::vector<std::vector<double>> rows;
  example::PlaneFilm film{
      "The trees", "", {"digit of the step (0 is the last)"}, {"points of the tree, log2"}, {"step"}};
  film.caption = "A step adds one at the right. Two equal trees become one of twice the size: the carry.";
  film.equal_scale = false;
  double wrong = 0, no_digits = 0;
  for (std::size_t k = 1; k <= lesson.steps(); ++k) {
    const std::vector<Place> fresh = random_places(batch, random);
    const std::uint64_t before = forest.points_moved();
    forest.insert(fresh);
    if (lesson.mistake("rebuild")) forest.rebuild();
    places.insert(places.end(), fresh.begin(), fresh.end());
    std::size_t number = 0;
    for (const std::size_t size : forest.tree_sizes())
      number += std::has_single_bit(size / batch) ? size / batch : 0;
    no_digits += number != k || forest.tree_count() != static_cast<std::size_t>(std::popcount(k)) ? 1 : 0;
    const Place query = random_places(1, random)[0];
    wrong += differ(forest.nearest(query)->distance, cairn::BruteForce(places).nearest(query)->distance);
    const auto n = static_cast<double>(places.size());
    steps.push_back(static_cast<double>(k));
    singles.push_back(work_of(forest.points_moved() - before));
    sums.push_back((sums.empty() ? 0 : sums.back()) + singles.back());
    anew.push_back((anew.empty() ? 0 : anew.back()) + work_of(places.size()));
    bound.push_back(n * (1 + std::log2(steps.back())) * (1 + std::log2(n / 16)));
    rows.push_back({steps.back(), singles.back(), sums.back(), bound.back(), anew.back()});
    if (k <= 64 || (k + 1) % 64 < 2 || k == lesson.steps())
      film.frames.push_back(drawn(k, forest.tree_sizes()));
  }
  // Every third is erased, and so many come that the largest tree is merged. Is what was erased still found?
  std::vector<Place> alive = random_places(forest.tree_sizes().back(), random), erased;
  const std::vector<Place> fresh = alive;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (i % 3 == 0) forest.erase(static_cast<cairn::PointId>(i));
    (i % 3 == 0 ? erased : alive).push_back(places[i]);
  }
  forest.insert(fresh);
  if (lesson.mistake("erased-come-back")) forest.insert(erased);
  const cairn::BruteForce living(alive);
  for (std::size_t i = 0; i < erased.size(); i += 16)
    wrong += differ(forest.nearest(erased[i])->distance, living.nearest(erased[i])->distance);
  lesson.verdict("steps whose trees are not its digits", no_digits, 0, 0);
  lesson.verdict("wrong answers", wrong, 0, 0, "against looking at all points that are not erased");
  lesson.verdict("work over n log^2 n", sums.back() / bound.back(), 0.2, 1, "moves of points, counted");
  lesson.figure({"one step, at worst",
                 example::readable(*std::max_element(singles.begin(), singles.end()), 6), "moves",
                 "the mean is " + example::readable(sums.back() / steps.back(), 5)});
  lesson.add(film);
  example::LinePlot plot{"Work so far", "", {"step"}, {"moves of points"}, steps};
  plot.caption = "Counted; n: points so far. Building one tree anew at each step costs n^2 log n.";
  plot.curves = {{"forest", Ink::belief, sums},
                 {"n log^2 n", Ink::grey, bound, true},
                 {"anew each time", Ink::wrong, anew}};
  plot.logarithmic = plot.logarithmic_x = true;
  lesson.add(plot);
  plot.title = "Work of each step";
  plot.caption = "Every second step costs next to nothing; at powers of two one step moves all there is.";
  plot.curves = {{"this step", Ink::belief, singles}};
  plot.logarithmic_x = false, plot.wide = true;
  lesson.add(plot);
  lesson.csv("work", {"step", "moves", "sum", "n_log2_n", "anew"}, rows);
  return lesson.finish();
}
// Answers. (1) Twice as large and more, 180224 moves: step 512 carries through all digits. (2) Half as many
// digits, so 618 moves a step and not 879, but up to three trees a digit to search, 12 in all. (3) None: each
// does its share of all merges, though the count gets a merge whole, when it ends. Until then old trees are
// searched too, up to 16. In (2) and (3) the trees are not the digits of binary, and the verdict is RED.
