// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// LESSON 08  Good enough: buying accuracy with work
//
// A camera sees a landmark again: its descriptor, 64 numbers, is the old one plus noise. Which of 4096 is it?
// In so many dimensions an exact search looks at nearly everything (lesson 06). Best-bin-first keeps the
// cells that it has passed by in a queue, the nearest on top, and stops after a budget of leaves (16
// descriptors each):
//   b' = b - old^2 + new^2     b: squared distance of a cell from the query. Beyond a split at `new` from the
//   query along an axis the cell is that far, not `old` as before; what the other axes add stays.
// (J. Beis, D. Lowe, CVPR 1997; the bound: S. Arya, D. Mount, DCC 1993.)
//
// Look for: recall, the share of right answers, against leaves looked at: most is bought by the first few
// dozen of 256.
//
// Now change this (the build is in support/small_tree.hpp): (1) sigma = 0.3. (2) Leave out `old`: FLANN and
// OpenCV did (FLANN #76, #327). Why did nobody notice in 64 dimensions? (3) .leaves = 32 in a map of 400,000:
// will recall stay?
#include <algorithm>
#include <cmath>
#include <queue>
#include <string>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/kd_tree.hpp>

#include "support/lesson.hpp"
#include "support/small_tree.hpp"

using example::Descriptor, example::Ink, example::Node;

struct Waiting {  // a cell not yet visited
  float bound;    // squared distance from the query
  std::size_t node;
  Descriptor offsets;  // how far the query is outside of it, axis by axis
  bool operator<(const Waiting& other) const { return bound > other.bound; }  // the nearest is on top
};

/// What is nearest after 1, 2, 3, ... leaves, until no cell can hold anything nearer.
std::vector<std::size_t> search(const std::vector<Node>& tree, const std::vector<Descriptor>& all,
                                const Descriptor& query, bool child_point) {
  std::vector<std::size_t> after;
  float least = 1e30F;
  std::size_t nearest = 0;
  std::priority_queue<Waiting> queue;
  for (queue.push({0, 0, Descriptor(query.size())}); !queue.empty() && queue.top().bound < least;) {
    Waiting here = queue.top();
    queue.pop();
    while (tree[here.node].children != 0) {
      const Node& node = tree[here.node];
      const bool below = query[node.axis] < node.split;
      Waiting far = here;
      far.node = node.children + (below ? 1 : 0);
      here.node = node.children + (below ? 0 : 1);
      const Node& beyond = tree[far.node];
      const float to = child_point ? all[(beyond.begin + beyond.end) / 2][node.axis] : node.split;
      far.offsets[node.axis] = query[node.axis] - to;
      far.bound +=
          far.offsets[node.axis] * far.offsets[node.axis] - here.offsets[node.axis] * here.offsets[node.axis];
      queue.push(far);
    }
    for (std::size_t i = tree[here.node].begin; i < tree[here.node].end; ++i) {
      float sum = 0;
      for (std::size_t a = 0; a < query.size(); ++a) sum += (query[a] - all[i][a]) * (query[a] - all[i][a]);
      if (sum < least) least = sum, nearest = i;
    }
    after.push_back(nearest);
  }
  return after;
}

int main(int argc, char** argv) {
  example::Lesson lesson(
      {"08_good_enough",
       "Good enough: buying accuracy with work",
       "Most of it is bought by the first few leaves.",
       200,
       100,
       1000,
       {{"child-point", "bounds reach to a point of the cell, not to its border (scholar #343)"},
        {"uniform-noise", "uniform draws in the place of normal ones (manif's demo)"}}},
      argc, argv);
  cairn::Random random(lesson.seed());
  constexpr std::size_t count = 4096, leaves = 256;
  constexpr double sigma = 0.7;  // of the noise; the descriptors' numbers have 1
  const auto queries = static_cast<double>(lesson.steps());
  example::LinePlot plot{"Recall", "", {"leaves looked at, of 256"}, {"share of right answers"}};
  plot.caption = "One curve for each number of dimensions. The last few per cent cost more than all before.";
  std::vector<std::vector<double>> rows;
  for (std::size_t k = 1; k <= leaves; ++k) {
    plot.x_values.push_back(static_cast<double>(k));
    rows.push_back({plot.x_values.back()});
  }
  double wrong = 0, distance = 0, ours = 0, of_library = 0;
  for (const std::size_t dimension : std::vector<std::size_t>{4, 8, 16, 64}) {
    std::vector<Descriptor> all(count, Descriptor(dimension));
    for (Descriptor& descriptor : all)
      for (float& x : descriptor) x = static_cast<float>(random.normal());
    const std::vector<Node> tree = example::build(all);  // puts them in the order of its leaves
    const cairn::BruteForce everything(all);
    const cairn::KdTree library(all);
    std::vector<double> recall(leaves);
    ours = of_library = distance = 0;
    for (std::size_t q = 0; q < lesson.steps(); ++q) {
      Descriptor query = all[random.below(count)];
      for (float& x : query) {
        const double noise =
            lesson.mistake("uniform-noise") ? random.uniform(-sigma, sigma) : random.normal(0, sigma);
        x += static_cast<float>(noise);
        distance += noise * noise / (sigma * sigma * queries);
      }
      const std::size_t exact = everything.nearest(query)->id;
      std::vector<std::size_t> found = search(tree, all, query, lesson.mistake("child-point"));
      wrong += found.back() != exact ? 1 : 0;
      found.resize(leaves, found.back());
      for (std::size_t k = 0; k < leaves; ++k) recall[k] += (found[k] == exact ? 1 : 0) / queries;
      of_library += (library.nearest(query, {.leaves = 32})->id == exact ? 1 : 0) / queries;
    }
    for (std::size_t k = 0; k < leaves; ++k) rows[k].push_back(recall[k]);
    const Ink inks[] = {Ink::teal, Ink::violet, Ink::measurement, Ink::belief};
    plot.curves.push_back({std::to_string(dimension) + " numbers", inks[plot.curves.size()], recall});
    ours = recall[31];
  }
  const auto band = cairn::chi_square_mean_band(64, queries, 0.9999);
  lesson.verdict("wrong answers without a budget", wrong, 0, 0, "of four times 200, against looking at all");
  lesson.verdict("noise / sigma, squared, of 64 numbers", distance, band.low, band.high, "chi-square: 64");
  lesson.verdict("recall, 32 leaves, 64 numbers", ours, of_library - 0.15, 1,
                 "cairn::KdTree under that budget: " + example::readable(of_library));
  plot.logarithmic_x = plot.wide = true;
  lesson.add(plot);
  lesson.csv("recall", {"leaves", "d4", "d8", "d16", "d64"}, rows);
  return lesson.finish();
}

// Answers. (1) The right one is far nearer than all others: most queries end in the first leaves. (2) An axis
// is hardly ever cut twice on a way of eight cuts; in 2 or 3 dimensions it is, and exact answers were not
// exact. (3) No: a way down is seven cuts longer, and each may lead astray. The budget has to grow, slowly.
