// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/packed_points.hpp>
#include <cairn/index/principal_axes.hpp>

#include "areas.hpp"
#include "rivals.hpp"

namespace cairn_bench {
namespace {

constexpr float ratio_of_test = 1.25F;  // Lowe's 0.8

/// cairn over descriptors of Dim numbers: turned, one tree, a budget of leaves.
template <std::size_t Dim>
class Ours {
public:
  using Tree = cairn::KdTree<float, Dim>;

  explicit Ours(const std::vector<float>& base) : axes_(cairn::Rows<float>(base, Dim)) {
    std::vector<float> turned(base.size());
    for (std::size_t i = 0; i < base.size(); i += Dim) axes_.turn(&base[i], &turned[i]);
    tree_ = Tree::from_rows(turned, Dim);
  }

  [[nodiscard]] std::vector<TwoNearest> search(const std::vector<float>& queries, std::size_t leaves,
                                               unsigned threads = 1) const {
    std::vector<TwoNearest> found(queries.size() / Dim);
    cairn::parallel_for(found.size(), threads, [&](std::size_t begin, std::size_t end) {
      cairn::BestBinFirst<Tree> search;
      const Tree* const trees[] = {&tree_};
      float turned[Dim];
      for (std::size_t i = begin; i < end; ++i) {
        axes_.turn(&queries[i * Dim], turned);
        cairn::NearestTwo<float> two;
        search.search(std::span<const Tree* const>(trees), turned, two, {.leaves = leaves});
        found[i] = {two.id(), two.first(), two.second()};
      }
    });
    return found;
  }

private:
  cairn::PrincipalAxes axes_;
  Tree tree_;
};

/// As the rivals are asked; the budget is one of leaves.
template <std::size_t Dim>
std::unique_ptr<DescriptorRival> make_our_tree() {
  auto tree = std::make_shared<std::optional<Ours<Dim>>>();
  return std::make_unique<DescriptorRival>(
      DescriptorRival{"kd-tree",
                      [tree](const float* rows, std::size_t count) {
                        tree->emplace(std::vector<float>(rows, rows + count * Dim));
                      },
                      [tree](const std::vector<float>& queries, int leaves) {
                        return (*tree)->search(queries, static_cast<std::size_t>(leaves));
                      }});
}

/// Exact search as products of matrices, 128 queries and 2048 points at a time: a megabyte, which stays in
/// the cache. (All points at once are half a gigabyte, of which every page is new to the program each time:
/// most of the time then, and whoever is asked next pays for it, too.) The best eight are ranked again by
/// differences: a small distance is lost in the rounding of large products.
std::vector<TwoNearest> search_by_product(std::span<const float> base, std::span<const float> queries,
                                          std::size_t dim) {
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic>;
  constexpr Eigen::Index some_queries = 128, some_points = 2048;
  const auto rows = static_cast<Eigen::Index>(dim);
  const auto columns = [rows](std::span<const float> of) {
    return Eigen::Map<const Matrix>(of.data(), rows, static_cast<Eigen::Index>(of.size()) / rows);
  };
  const auto points = columns(base), asked = columns(queries);
  const Eigen::VectorXf squares = points.colwise().squaredNorm().transpose();
  struct Best {
    std::array<cairn::Neighbor<float>, 8> found;
    cairn::KNearest<float> nearest{found.data(), found.size()};
  };
  std::vector<TwoNearest> result;
  Matrix products(some_points, some_queries);
  for (Eigen::Index begin = 0; begin < asked.cols(); begin += some_queries) {
    const auto block = asked.middleCols(begin, std::min(some_queries, asked.cols() - begin));
    std::vector<Best> best(static_cast<std::size_t>(block.cols()));
    for (Eigen::Index first = 0; first < points.cols(); first += some_points) {
      const auto tile = points.middleCols(first, std::min(some_points, points.cols() - first));
      auto part = products.topLeftCorner(tile.cols(), block.cols());
      part.noalias() = tile.transpose() * block;
      for (Eigen::Index q = 0; q < block.cols(); ++q)
        for (Eigen::Index i = 0; i < tile.cols(); ++i)
          best[static_cast<std::size_t>(q)].nearest.offer(static_cast<cairn::PointId>(first + i),
                                                          squares(first + i) - 2 * part(i, q));
    }
    for (Eigen::Index q = 0; q < block.cols(); ++q) {
      const Best& of = best[static_cast<std::size_t>(q)];
      cairn::NearestTwo<float> two;
      for (std::size_t k = 0; k < of.nearest.size(); ++k)
        two.offer(of.found[k].id,
                  (points.col(static_cast<Eigen::Index>(of.found[k].id)) - block.col(q)).squaredNorm());
      result.push_back({two.id(), two.first(), two.second()});
    }
  }
  return result;
}

bool accepted(const TwoNearest& two) {
  return two.second >= ratio_of_test * two.first;
}

/// Share of the exact search's ratio-test matches that were found, and of its nearest neighbours.
struct Quality {
  double matches;
  double nearest;
};
Quality quality(const std::vector<TwoNearest>& exact, const std::vector<TwoNearest>& found) {
  double matches = 0;
  double kept = 0;
  double nearest = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    nearest += found[i].first <= exact[i].first * 1.00001F;
    if (!accepted(exact[i])) continue;
    ++matches;
    kept += accepted(found[i]) && found[i].id == exact[i].id;
  }
  return {kept / matches, nearest / static_cast<double>(exact.size())};
}

/// The smallest budget, from 2 on, that reaches the mark; 0 where none does. Steps of a quarter power of two,
/// then halves of the last of them, down to 1: where budgets are small a step is a fifth of somebody's time.
template <class Search>
std::size_t budget_for(const Search& search, const std::vector<TwoNearest>& exact, double mark,
                       bool of_matches, std::size_t most) {
  const auto reaches = [&](std::size_t budget) {
    const Quality reached = quality(exact, search(budget));
    return (of_matches ? reached.matches : reached.nearest) >= mark;
  };
  std::size_t missed = 1, budget = 2;
  while (!reaches(budget)) {
    missed = budget;
    budget = std::max(budget + 1,
                      static_cast<std::size_t>(static_cast<double>(budget) * std::sqrt(std::sqrt(2.0))));
    if (budget > most) return 0;
  }
  while (budget - missed > 1) {
    const std::size_t middle = missed + (budget - missed) / 2;
    (reaches(middle) ? budget : missed) = middle;
  }
  return budget;
}

/// Whether a rival that takes bytes may be given them: like for like, since our cells take bytes.
bool are_bytes(const std::vector<float>& rows) {
  return std::all_of(rows.begin(), rows.end(), [](float number) {
    return number >= 0 && number <= 255 && number == std::floor(number);
  });
}

/// Seconds that all threads of the process were running during a call.
double running_seconds_of(const std::function<void()>& run) {
  const double begin = running_seconds(Running::process);
  run();
  return running_seconds(Running::process) - begin;
}

/// A figure that is owed, and one that is hoped for.
struct Figure {
  double must;
  double aim;
};

/// What share of the exact search's answers is to be found, and how many times faster than the rivals.
struct Mark {
  std::string name;
  double share;
  bool of_matches;  ///< of the ratio-test matches; else of the nearest neighbours
  Figure any;       ///< over the fastest rival, whoever that is
  std::optional<Figure> quick_to_build =
      std::nullopt;  ///< over the fastest that builds within ten times our time
};

/// A set and what is asked of it.
struct Task {
  std::string name;
  const std::vector<float>& base;
  const std::vector<float>& queries;
  std::vector<Mark> marks;
  std::optional<Figure> build = std::nullopt;   ///< times that SymphonyQG takes to build over ours
  std::optional<Figure> memory = std::nullopt;  ///< MB beside the caller's descriptors
  std::size_t sets = 1;  ///< the base is so many sets, one after the other: every query is asked of each
};

/// The answers of all sets, as of_sets() gives them.
std::vector<TwoNearest> search_by_product(const Task& task, std::size_t dim) {
  std::vector<TwoNearest> found;
  const std::size_t size = task.base.size() / task.sets;
  for (std::size_t i = 0; i < task.sets; ++i) {
    const auto of_one = search_by_product(std::span(task.base).subspan(i * size, size), task.queries, dim);
    found.insert(found.end(), of_one.begin(), of_one.end());
  }
  return found;
}

/// Somebody who has taken in a set, and the seconds of processor time that it took.
struct Built {
  std::unique_ptr<DescriptorRival> contender;
  double build_seconds;
};

std::vector<Built> build_all(std::vector<std::unique_ptr<DescriptorRival>> contenders,
                             const std::vector<float>& base, std::size_t points) {
  std::vector<Built> built;
  for (auto& contender : contenders) {
    if (!contender) continue;
    const double seconds = running_seconds_of([&] { contender->add(base.data(), points); });
    std::fprintf(stderr, "  %s: built in %.2f s\n", contender->name.c_str(), seconds);
    built.push_back({std::move(contender), seconds});
  }
  return built;
}

/// One of those built, with the budget that reaches a mark.
struct Entrant {
  const Built* built;
  std::size_t budget;
};

std::vector<Entrant> reaching(const std::vector<Built>& all, const std::vector<float>& queries,
                              const std::vector<TwoNearest>& exact, const Mark& mark, std::size_t most) {
  std::vector<Entrant> entrants;
  for (const Built& built : all) {
    const auto search = [&](std::size_t checks) {
      return built.contender->search(queries, static_cast<int>(checks));
    };
    const std::size_t budget = budget_for(search, exact, mark.share, mark.of_matches, most);
    if (budget > 0) entrants.push_back({&built, budget});
  }
  return entrants;
}

using Maker = std::function<std::unique_ptr<DescriptorRival>()>;

/// Somebody who takes what is added for so many sets of equal size, one after the other, and answers all
/// queries for the first set, then all for the second ... One set alone may have too few matches to tell 98
/// of a hundred from 99.
std::unique_ptr<DescriptorRival> of_sets(const Maker& make, std::size_t sets, std::size_t dim) {
  if (sets == 1) return make();
  auto each = std::make_shared<std::vector<DescriptorRival>>();
  while (each->size() < sets) {
    auto one = make();
    if (!one) return nullptr;
    each->push_back(std::move(*one));
  }
  return std::make_unique<DescriptorRival>(
      DescriptorRival{each->front().name,
                      [each, dim](const float* rows, std::size_t count) {
                        const std::size_t size = count / each->size();
                        for (std::size_t i = 0; i < each->size(); ++i)
                          (*each)[i].add(rows + i * size * dim, size);
                      },
                      [each](const std::vector<float>& queries, int budget) {
                        std::vector<TwoNearest> found;
                        for (const DescriptorRival& one : *each) {
                          const auto of_one = one.search(queries, budget);
                          found.insert(found.end(), of_one.begin(), of_one.end());
                        }
                        return found;
                      }});
}

/// Our own ways and all rivals that are there, for descriptors of Dim numbers.
template <std::size_t Dim>
struct Field {
  std::vector<Built> ours;
  std::vector<Built> rivals;

  Field(const std::vector<float>& base, const std::vector<float>& queries, std::size_t sets) {
    const std::size_t points = base.size() / Dim;
    const bool bytes = are_bytes(base) && are_bytes(queries);
    std::vector<std::unique_ptr<DescriptorRival>> own, others;
    const auto enter = [sets](auto& into, const Maker& make) { into.push_back(of_sets(make, sets, Dim)); };
    enter(own, [] { return make_our_tree<Dim>(); });
    enter(own, [] { return make_our_cells(Dim, true); });
    if (Dim >= 96) enter(own, [] { return make_our_cells(Dim, false); });  // what codes are worth
    enter(others, [] { return make_flann_trees(Dim, 4); });
    enter(others, [] { return make_faiss_ivf(Dim); });
    enter(others, [] { return make_glass(Dim); });
    constexpr std::size_t largest_graph = 200000;  // a million take these ten minutes and more to build
    if (points <= largest_graph) {
      enter(others, [] { return make_symphony_qg(Dim, 100); });
      enter(others, [] { return make_symphony_qg(Dim, 200); });
      enter(others, [bytes] { return bytes ? make_hnswlib_of_bytes(Dim) : make_hnswlib(Dim); });
    }
    ours = build_all(std::move(own), base, points);
    rivals = build_all(std::move(others), base, points);
  }
};

std::string described(const Entrant& entrant, const Timing& timing) {
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), "%s %.3g us (budget %zu, built in %.3g s)",
                entrant.built->contender->name.c_str(), timing.median * 1e6, entrant.budget,
                entrant.built->build_seconds);
  return text.data();
}

/// The rows of one mark: all who reach it take turns, and the fastest of ours is held against the rivals.
void score_mark(Scoreboard& board, const Task& task, const Mark& mark, std::size_t dim,
                const std::vector<TwoNearest>& exact, const std::vector<Built>& own,
                const std::vector<Built>& rivals) {
  std::vector<Entrant> entrants =
      reaching(own, task.queries, exact, mark, task.base.size() / dim / task.sets / 8);
  const std::size_t us_end = entrants.size();
  for (const Entrant& rival : reaching(rivals, task.queries, exact, mark, 8192)) entrants.push_back(rival);

  const auto count = static_cast<double>(exact.size());
  std::vector<Contender> contenders;
  for (const Entrant& entrant : entrants)
    contenders.push_back(
        {entrant.built->contender->name,
         [&entrant, &task] {
           do_not_optimise(entrant.built->contender->search(task.queries, static_cast<int>(entrant.budget)));
         },
         count});
  contenders.push_back({"matrix product", [&] { do_not_optimise(search_by_product(task, dim)); }, count});
  const auto timings = interleave(contenders, {.rounds = 9, .seconds_per_round = 0.02, .run_first = true});
  const std::string name = task.name + ": " + mark.name;
  if (us_end == 0) {
    board.add({.name = name, .note = "no data: none of ours reaches the mark"});
    return;
  }
  std::size_t us = 0;
  for (std::size_t i = 1; i < us_end; ++i) us = timings[i].median < timings[us].median ? i : us;
  /// The fastest of the rivals that may be entered; those built, or the product, which builds nothing.
  const auto add_row = [&](const std::string& of, Figure owed, double longest_build) {
    std::size_t best = entrants.size();
    for (std::size_t i = us_end; i < entrants.size(); ++i)
      if (entrants[i].built->build_seconds <= longest_build && timings[i].median < timings[best].median)
        best = i;
    const double ours = timings[us].median * 1e6;
    Row row = against_rival(of, ours, ratio(timings[best], timings[us]) * ours, contenders[best].name,
                            owed.must, owed.aim, "us");
    for (std::size_t i = 0; i < entrants.size(); ++i)
      row.note += (i == 0 ? "; " : ", ") + described(entrants[i], timings[i]);
    board.add(row);
  };
  add_row(name, mark.any, std::numeric_limits<double>::infinity());
  if (mark.quick_to_build)
    add_row(name + ", over what builds within ten times our time", *mark.quick_to_build,
            10 * entrants[us].built->build_seconds);
}

template <std::size_t Dim>
void score(Scoreboard& board, const Task& task) {
  const Field<Dim> field(task.base, task.queries, task.sets);
  const auto exact = search_by_product(task, Dim);
  for (const Mark& mark : task.marks) score_mark(board, task, mark, Dim, exact, field.ours, field.rivals);
  const Built& cells = field.ours[1];
  if (task.build) {
    std::optional<double> theirs;
    for (const Built& rival : field.rivals)
      if (rival.contender->name.starts_with("SymphonyQG"))
        theirs = std::min(theirs.value_or(rival.build_seconds), rival.build_seconds);
    board.add(against_rival(task.name + ": build", cells.build_seconds, theirs, "SymphonyQG",
                            task.build->must, task.build->aim, "s"));
  }
  if (task.memory)
    board.add({.name = task.name + ": memory beside the caller's descriptors",
               .measured = static_cast<double>(cells.contender->bytes()) / 1e6,
               .unit = "MB",
               .must = task.memory->must,
               .aim = task.memory->aim});
}

/// The first 64 of each 128 numbers: half of the patch.
std::vector<float> first_half(const std::vector<float>& rows) {
  std::vector<float> halves;
  for (std::size_t i = 0; i < rows.size(); i += 128)
    halves.insert(halves.end(), rows.begin() + static_cast<std::ptrdiff_t>(i),
                  rows.begin() + static_cast<std::ptrdiff_t>(i + 64));
  return halves;
}

void score_threads(Scoreboard& board, const std::vector<float>& base, const std::vector<float>& queries) {
  const Ours<64> ours(base);
  const auto ask = [&](unsigned threads) {
    return [&, threads] { do_not_optimise(ours.search(queries, 32, threads)); };
  };
  const auto timings =
      interleave({{"1", ask(1), 1}, {"2", ask(2), 1}}, {.rounds = 15, .seconds_per_round = 0.05});
  std::vector<double> work;  // what two threads run for together against one: 1 where none is lost
  for (int round = 0; round < 9; ++round)
    work.push_back(running_seconds_of(ask(2)) / running_seconds_of(ask(1)));
  board.add({.name = "batch of queries, two threads against one",
             .measured = ratio(timings[0], timings[1]),
             .unit = "x",
             .must = 1.8,
             .aim = std::nullopt,
             .better = larger,
             .note = "needs two idle cores; two threads run " + std::to_string(median_of(work)) +
                     " times as long together as one"});
}

/// All queries at once, exactly, without a tree.
void score_bulk(Scoreboard& board, const std::string& name, const std::vector<float>& base,
                const std::vector<float>& queries) {
  const cairn::PackedPoints packed{cairn::Rows<float>(base, 128)};
  const auto ours = [&] { return cairn::nearest_two(packed, cairn::Rows<float>(queries, 128)); };
  const auto expected = search_by_product(base, queries, 128);
  const auto found = ours();
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    wrong += std::abs(found[i].first - expected[i].first) > 1e-3F * expected[i].first + 0.1F;
  const auto count = static_cast<double>(expected.size());
  const auto timings =
      interleave({{"ours", [&] { do_not_optimise(ours()); }, count},
                  {"matrix product", [&] { do_not_optimise(search_by_product(base, queries, 128)); }, count}},
                 {.rounds = 7, .seconds_per_round = 0.02});
  Row row =
      against_rival(name, timings[0].median * 1e6, ratio(timings[1], timings[0]) * timings[0].median * 1e6,
                    "matrix product", 1, 2, "us");
  if (wrong > 0) row.note = std::to_string(wrong) + " answers differ";
  board.add(row);
}

}  // namespace

void score_descriptors(Scoreboard& board) {
  const auto base = clustered_descriptors(100000, 1);
  const auto queries = noisy_copies(base, 1000, 2);
  score_threads(board, base, queries);
  {
    const Descriptors learned = features(40000, 256, 5);
    score<256>(board, {.name = "features, 256 numbers, n = 40000",
                       .base = learned.base,
                       .queries = learned.queries,
                       .marks = {{"recall 0.95", 0.95, false, {1.2, 2}}}});
  }
  const auto data = sift();
  if (!data) {
    board.add({.name = "128-d SIFT", .note = "no data"});
    return;
  }
  const std::vector<float> small(data->base.begin(), data->base.begin() + 128 * 10000);
  score_bulk(board, "SIFT, n = 1e4: exact, all queries at once", small, data->queries);
  score_bulk(board, "SIFT, n = 99000: exact, all queries at once", data->base, data->queries);
  const std::vector<float> halves = first_half(data->base), half_queries = first_half(data->queries);
  score<64>(board, {.name = "64 of SIFT's numbers, n = 99000",
                    .base = halves,
                    .queries = half_queries,
                    .marks = {{"99 % of matches", 0.99, true, {1.5, 2.5}}}});
  score<128>(board,
             {.name = "SIFT, n = 1e4",
              .base = small,
              .queries = data->queries,
              .marks = {{"recall 0.95", 0.95, false, {2.2, 3}}, {"recall 0.99", 0.99, false, {2.2, 3}}}});
  const std::vector<float> nine(data->base.begin(), data->base.begin() + 128 * 90000);
  score<128>(board, {.name = "SIFT, nine sets of 1e4",
                     .base = nine,
                     .queries = data->queries,
                     .marks = {{"99 % of matches", 0.99, true, {2.2, 3}}},
                     .sets = 9});
  score<128>(board, {.name = "SIFT, n = 99000",
                     .base = data->base,
                     .queries = data->queries,
                     .marks = {{"recall 0.95", 0.95, false, {1.1, 1.6}, Figure{1.8, 3}},
                               {"recall 0.99", 0.99, false, {1.1, 1.6}, Figure{1.8, 3}},
                               {"99 % of matches", 0.99, true, {1.2, 1.6}, Figure{1.8, 3}}},
                     .build = Figure{30, 80},
                     .memory = Figure{20, 12}});
}

void score_a_million_clustered(Scoreboard& board) {
  const auto million = clustered_descriptors(1000000, 3);
  const auto asked = noisy_copies(million, 500, 4);
  score<64>(board,
            {.name = "clusters, 64 numbers, n = 1e6",
             .base = million,
             .queries = asked,
             .marks = {{"recall 0.95", 0.95, false, {2.5, 4}}, {"99 % of matches", 0.99, true, {2, 4}}}});
}

void score_a_million_of_pictures(Scoreboard& board) {
  const auto real = surf_of_pictures(1000000, 1000);
  if (!real) {
    board.add({.name = "SURF of pictures", .note = "no data"});
    return;
  }
  score<64>(board,
            {.name = "SURF of street pictures, n = " + std::to_string(real->base.size() / 64),
             .base = real->base,
             .queries = real->queries,
             .marks = {{"recall 0.95", 0.95, false, {1, 1.5}}, {"99 % of matches", 0.99, true, {1, 1.5}}}});
}

}  // namespace cairn_bench
