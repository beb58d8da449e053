// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/index/kd_tree.hpp>

#include "areas.hpp"
#include "rivals.hpp"

namespace cairn_bench {
namespace {

using Tree = cairn::KdTree<float, 3>;
using Rivals = std::vector<std::unique_ptr<StaticRival>>;

constexpr std::size_t count = 1000000;
constexpr std::size_t query_count = 2000;

Rivals rivals_for(const std::vector<Point3>& points) {
  Rivals rivals;
  for (auto& rival :
       {make_nanoflann, make_flann_single, make_cgal, make_ann, make_pico_tree, make_small_gicp, make_scipy})
    if (auto made = rival(points)) rivals.push_back(std::move(made));
  return rivals;
}

/// A row against the fastest rival: the first timing is ours.
void add_ratio(Scoreboard& board, const std::string& name, const std::vector<Timing>& timings, double must,
               double aim, const std::string& unit) {
  const double scale = unit == "ms" ? 1e3 : 1e6;
  const Timing* best = nullptr;
  for (std::size_t i = 1; i < timings.size(); ++i)
    if (best == nullptr || timings[i].median < best->median) best = &timings[i];
  const auto rival =
      best != nullptr ? std::optional(ratio(*best, timings[0]) * timings[0].median * scale) : std::nullopt;
  board.add(against_rival(name, timings[0].median * scale, rival, best != nullptr ? best->name : "", must,
                          aim, unit));
}

/// A question, as a contender answers it: query by query, or all of them where `all` is there.
struct Ask {
  std::string name;
  std::function<double(const Point3&)> one{};
  std::function<std::vector<double>(const std::vector<Point3>&)> all{};
};

/// Answers to every seventh query, enough to tell whether a rival is right.
std::vector<double> some_answers(const Ask& ask, const std::vector<Point3>& queries) {
  const auto all = ask.all ? ask.all(queries) : std::vector<double>();
  std::vector<double> some;
  for (std::size_t i = 0; i < queries.size(); i += 7) some.push_back(ask.all ? all[i] : ask.one(queries[i]));
  return some;
}

/// The same question to all; a rival whose answers differ is reported and left out.
std::vector<Timing> time_queries(const std::vector<Point3>& queries, const std::vector<Ask>& asks) {
  const std::vector<double> expected = some_answers(asks[0], queries);
  std::vector<Contender> contenders;
  for (const Ask& ask : asks) {
    const std::vector<double> answers = some_answers(ask, queries);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < answers.size(); ++i)
      wrong += std::abs(answers[i] - expected[i]) > 1e-5 * (1 + std::abs(expected[i]));
    if (wrong > 0) {
      std::printf("  %s: %zu answers differ, left out\n", ask.name.c_str(), wrong);
      continue;
    }
    contenders.push_back({ask.name,
                          [&ask, &queries] {
                            if (ask.all) return do_not_optimise(ask.all(queries));
                            double sum = 0;
                            for (const Point3& query : queries) sum += ask.one(query);
                            do_not_optimise(sum);
                          },
                          static_cast<double>(queries.size())});
  }
  return interleave(contenders, {.rounds = 7, .seconds_per_round = 0.02});
}

std::vector<Timing> time_kth(const Tree& tree, const Rivals& rivals, const std::vector<Point3>& queries,
                             std::size_t k) {
  std::vector<Ask> asks;
  if (k == 1)
    asks.push_back({"cairn", [&tree](const Point3& query) { return double{tree.nearest(query)->distance}; }});
  else
    asks.push_back({"cairn", [&tree, k](const Point3& query) {
                      std::array<cairn::Neighbor<float>, 16> found;
                      tree.nearest(query, std::span(found).first(k));
                      return double{found[k - 1].distance};
                    }});
  for (const auto& rival : rivals) {
    Ask& ask = asks.emplace_back();
    ask.name = rival->name;
    if (rival->kth_distances)
      ask.all = [&rival, k](const std::vector<Point3>& all) {
        const auto distances = rival->kth_distances(all, k);
        return std::vector<double>(distances.begin(), distances.end());
      };
    else
      ask.one = [&rival, k](const Point3& query) { return double{rival->kth_distance(query, k)}; };
  }
  return time_queries(queries, asks);
}

std::vector<Timing> time_radius(const Tree& tree, const Rivals& rivals, const std::vector<Point3>& queries,
                                float radius) {
  std::vector<Ask> asks;
  asks.push_back({"cairn", [&tree, radius](const Point3& query) {
                    std::vector<cairn::Neighbor<float>> found;
                    cairn::Within<float> within(found, radius * radius);
                    tree.search(query, within);
                    return static_cast<double>(found.size());
                  }});
  for (const auto& rival : rivals) {
    if (!rival->count_within && !rival->counts_within) continue;  // has no such search
    Ask& ask = asks.emplace_back();
    ask.name = rival->name;
    if (rival->counts_within)
      ask.all = [&rival, radius](const std::vector<Point3>& all) {
        const auto counts = rival->counts_within(all, radius);
        return std::vector<double>(counts.begin(), counts.end());
      };
    else
      ask.one = [&rival, radius](const Point3& query) {
        return static_cast<double>(rival->count_within(query, radius));
      };
  }
  return time_queries(queries, asks);
}

std::vector<Point3> some_of(const std::vector<Point3>& points, std::size_t number) {
  cairn::Random random(5);
  std::vector<Point3> some;
  for (std::size_t i = 0; i < number; ++i) some.push_back(points[random.below(points.size())]);
  return some;
}

void score_shape(Scoreboard& board, const std::string& shape, float radius) {
  const auto points = points_like(shape, count, 1);
  const auto on = some_of(points, query_count);
  const auto off = points_like(shape, query_count, 2);
  const Rivals rivals = rivals_for(points);
  Tree tree;
  std::vector<Contender> builds{{"cairn", [&] { tree = Tree(points); }}};
  for (const auto& rival : rivals) builds.push_back({rival->name, rival->build});
  const auto building = interleave(builds, {.rounds = 3, .seconds_per_round = 0.01});
  const bool uniform = shape == "uniform";
  add_ratio(board, shape + ": build", building, uniform ? 1.5 : 1.2, uniform ? 2.5 : 2.0, "ms");
  const double must = uniform ? 1.3 : 1.2;
  add_ratio(board, shape + ": nearest 1, queries in the set", time_kth(tree, rivals, on, 1), must, 2, "us");
  add_ratio(board, shape + ": nearest 1, queries beside it", time_kth(tree, rivals, off, 1), must, 2, "us");
  add_ratio(board, shape + ": nearest 10, queries in the set", time_kth(tree, rivals, on, 10), must, 2, "us");
  add_ratio(board, shape + ": nearest 10, queries beside it", time_kth(tree, rivals, off, 10), must, 2, "us");
  add_ratio(board, shape + ": all within a radius (about 20)", time_radius(tree, rivals, off, radius), 1.2, 2,
            "us");
  if (!uniform) return;
  const double beyond = static_cast<double>(tree.bytes()) / count - sizeof(Point3);
  board.add({.name = "memory, the points themselves held by the tree",
             .measured = beyond,
             .unit = "B/point beyond",
             .must = 14,
             .aim = 4,
             .note = "the user's own copy may be dropped; 12 more if it is kept"});
}

/// Time of nearest 10 on awkward sets over that on uniform ones, in one run.
void score_cliffs(Scoreboard& board) {
  std::vector<std::string> shapes{"uniform", "line", "equal", "lattice", "duplicates"};
  std::vector<std::vector<Point3>> sets;
  std::vector<Tree> trees;
  for (const std::string& shape : shapes) {
    sets.push_back(points_like(shape, count, 1));
    trees.emplace_back(sets.back());
  }
  std::vector<Contender> contenders;
  std::vector<std::vector<Point3>> queries;
  for (const auto& set : sets) queries.push_back(some_of(set, query_count));
  for (std::size_t i = 0; i < shapes.size(); ++i)
    contenders.push_back({shapes[i],
                          [&, i] {
                            std::array<cairn::Neighbor<float>, 10> found;
                            for (const Point3& query : queries[i])
                              do_not_optimise(trees[i].nearest(query, std::span(found)));
                          },
                          static_cast<double>(query_count)});
  const auto timings = interleave(contenders, {.rounds = 7});
  for (std::size_t i = 1; i < shapes.size(); ++i)
    board.add({.name = shapes[i] + ": nearest 10 against uniform",
               .measured = ratio(timings[i], timings[0]),
               .unit = "x uniform",
               .must = 3,
               .aim = std::nullopt,
               .note = std::to_string(timings[i].median * 1e6) + " us"});
}

}  // namespace

void score_low_dimensions(Scoreboard& board) {
  score_shape(board, "uniform", 0.0168F);
  score_shape(board, "scan", 0.15F);
  score_cliffs(board);
}

}  // namespace cairn_bench
