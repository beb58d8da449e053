// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/descriptor_index.hpp>
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

/// cairn's cells around means; refers to the rows.
std::unique_ptr<DescriptorRival> make_our_cells(std::size_t dim, cairn::DescriptorCodes codes) {
  using Index = cairn::DescriptorIndex<cairn::Rows<float>>;
  struct Held {
    std::optional<cairn::Rows<float>> rows;
    std::optional<Index> index;
  };
  auto held = std::make_shared<Held>();
  return std::make_unique<DescriptorRival>(DescriptorRival{
      codes == cairn::DescriptorCodes::off ? "cells without codes" : "cells",
      [held, dim, codes](const float* rows, std::size_t count) {
        held->rows.emplace(std::span(rows, count * dim), dim);
        held->index.emplace(*held->rows, cairn::DescriptorIndexOptions{.codes = codes});
      },
      [held, dim](const std::vector<float>& queries, int leaves) {
        const cairn::Rows<float> asked(queries, dim);
        std::vector<TwoNearest> found(asked.size());
        Index::Search search;
        for (std::size_t i = 0; i < found.size(); ++i) {
          cairn::NearestTwo<float> two;
          search.search(*held->index, asked[i], two, {.leaves = static_cast<std::size_t>(leaves)});
          found[i] = {two.id(), two.first(), two.second()};
        }
        return found;
      }});
}

/// Exact search as a product of matrices, 128 queries at a time.
std::vector<TwoNearest> search_by_product(const std::vector<float>& base, const std::vector<float>& queries,
                                          std::size_t dim) {
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic>;
  const auto rows = static_cast<Eigen::Index>(dim);
  const Eigen::Map<const Matrix> points(base.data(), rows, static_cast<Eigen::Index>(base.size() / dim));
  const Eigen::VectorXf squares = points.colwise().squaredNorm().transpose();
  std::vector<TwoNearest> found;
  const std::size_t count = queries.size() / dim;
  for (std::size_t begin = 0; begin < count; begin += 128) {
    const auto size = static_cast<Eigen::Index>(std::min<std::size_t>(128, count - begin));
    const Eigen::Map<const Matrix> block(queries.data() + begin * dim, rows, size);
    const Matrix products = points.transpose() * block;
    for (Eigen::Index q = 0; q < size; ++q) {
      const float own = block.col(q).squaredNorm();
      cairn::NearestTwo<float> two;
      for (Eigen::Index i = 0; i < squares.size(); ++i)
        two.offer(static_cast<cairn::PointId>(i), squares(i) - 2 * products(i, q));
      found.push_back({two.id(), std::sqrt(std::max(0.0F, two.first_reduced() + own)),
                       std::sqrt(two.second_reduced() + own)});
    }
  }
  return found;
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

/// The smallest budget on a grid of quarter powers of two that reaches the mark; 0 where none does.
template <class Search>
std::size_t budget_for(const Search& search, const std::vector<TwoNearest>& exact, double mark,
                       bool of_matches, std::size_t most) {
  for (double budget = 2; budget <= static_cast<double>(most); budget *= std::sqrt(std::sqrt(2.0))) {
    const Quality reached = quality(exact, search(static_cast<std::size_t>(budget)));
    if ((of_matches ? reached.matches : reached.nearest) >= mark) return static_cast<std::size_t>(budget);
  }
  return 0;
}

/// Whether a rival that takes bytes may be given them: like for like, since our cells take bytes.
bool are_bytes(const std::vector<float>& rows) {
  return std::all_of(rows.begin(), rows.end(), [](float number) {
    return number >= 0 && number <= 255 && number == std::floor(number);
  });
}

/// A contender with the budget that reaches a mark, and what building it took.
struct Marked {
  std::unique_ptr<DescriptorRival> contender;
  std::size_t budget;
  double build_seconds;
};

std::string notes_of(const std::vector<Marked>& all) {
  std::string note;
  for (const Marked& marked : all)
    note += "; " + marked.contender->name + " budget " + std::to_string(marked.budget) + ", built in " +
            std::to_string(std::lround(1e3 * marked.build_seconds)) + " ms";
  return note;
}

template <std::size_t Dim>
void score_mark(Scoreboard& board, const std::string& name, const std::vector<float>& base,
                const std::vector<float>& queries, double mark, bool of_matches, double must, double aim) {
  const auto exact = search_by_product(base, queries, Dim);
  const std::size_t points = base.size() / Dim;
  const auto reaching = [&](std::vector<std::unique_ptr<DescriptorRival>> all, std::size_t most) {
    std::vector<Marked> result;
    for (auto& contender : all) {
      if (!contender) continue;
      const double seconds = seconds_of([&] { contender->add(base.data(), points); });
      const std::size_t budget =
          budget_for([&](std::size_t checks) { return contender->search(queries, static_cast<int>(checks)); },
                     exact, mark, of_matches, most);
      if (budget > 0) result.push_back({std::move(contender), budget, seconds});
    }
    return result;
  };
  std::vector<std::unique_ptr<DescriptorRival>> own, others;
  own.push_back(make_our_tree<Dim>());
  own.push_back(make_our_cells(Dim, cairn::DescriptorCodes::automatic));
  if (Dim >= 96) own.push_back(make_our_cells(Dim, cairn::DescriptorCodes::off));  // what the codes are worth
  others.push_back(make_flann_trees(Dim, 4));
  others.push_back(make_faiss_ivf(Dim));
  constexpr std::size_t largest_graph = 200000;  // a million take it a quarter of an hour to build
  if (points <= largest_graph) others.push_back(make_symphony_qg(Dim));
  if (points <= largest_graph)
    others.push_back(are_bytes(base) && are_bytes(queries) ? make_hnswlib_of_bytes(Dim) : make_hnswlib(Dim));
  const std::vector<Marked> ours = reaching(std::move(own), points / 8);
  const std::vector<Marked> rivals = reaching(std::move(others), 8192);

  const auto count = static_cast<double>(queries.size() / Dim);
  std::vector<Contender> contenders;
  const auto enter = [&](const std::vector<Marked>& all) {
    for (const Marked& marked : all)
      contenders.push_back(
          {marked.contender->name,
           [&] { do_not_optimise(marked.contender->search(queries, static_cast<int>(marked.budget))); },
           count});
  };
  enter(ours);
  contenders.push_back(
      {"matrix product", [&] { do_not_optimise(search_by_product(base, queries, Dim)); }, count});
  enter(rivals);
  const auto timings = interleave(contenders, {.rounds = 7, .seconds_per_round = 0.02});
  const auto fastest = [&](std::size_t begin, std::size_t end) {
    std::size_t best = begin;
    for (std::size_t i = begin; i < end; ++i) best = timings[i].median < timings[best].median ? i : best;
    return best;
  };
  const std::size_t us = fastest(0, ours.size()), best = fastest(ours.size(), timings.size());
  Row row = against_rival(name, timings[us].median * 1e6,
                          ratio(timings[best], timings[us]) * timings[us].median * 1e6, contenders[best].name,
                          must, aim, "us");
  row.note += "; ours is the " + contenders[us].name;
  for (std::size_t i = 0; i < ours.size(); ++i)
    if (i != us)
      row.note += ", " + contenders[i].name + " " + std::to_string(timings[i].median * 1e6) + " us";
  row.note += notes_of(ours) + notes_of(rivals);
  board.add(row);
}

/// The first 64 of each 128 numbers: half of the patch.
std::vector<float> first_half(const std::vector<float>& rows) {
  std::vector<float> halves;
  for (std::size_t i = 0; i < rows.size(); i += 128)
    halves.insert(halves.end(), rows.begin() + static_cast<std::ptrdiff_t>(i),
                  rows.begin() + static_cast<std::ptrdiff_t>(i + 64));
  return halves;
}

/// Seconds that all threads of the process were running during a call.
double running_seconds_of(const std::function<void()>& run) {
  const double begin = running_seconds(Running::process);
  run();
  return running_seconds(Running::process) - begin;
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
    const auto million = clustered_descriptors(1000000, 3);
    score_mark<64>(board, "clusters, 64 numbers, n = 1e6: 99 % of matches", million,
                   noisy_copies(million, 500, 4), 0.99, true, 2, 4);
  }
  {
    const Descriptors learned = features(40000, 256, 5);
    score_mark<256>(board, "features, 256 numbers, n = 40000: recall 0.95", learned.base, learned.queries,
                    0.95, false, 1.2, 2);
  }
  const auto data = sift();
  if (!data) {
    board.add({.name = "128-d SIFT", .note = "no data"});
    return;
  }
  const std::vector<float> small(data->base.begin(), data->base.begin() + 128 * 10000);
  score_mark<64>(board, "64 of SIFT's numbers, n = 99000: 99 % of matches", first_half(data->base),
                 first_half(data->queries), 0.99, true, 3, 6);
  score_bulk(board, "SIFT, n = 1e4: exact, all queries at once", small, data->queries);
  score_bulk(board, "SIFT, n = 99000: exact, all queries at once", data->base, data->queries);
  score_mark<128>(board, "SIFT, n = 1e4: 99 % of matches", small, data->queries, 0.99, true, 2, 4);
  score_mark<128>(board, "SIFT, n = 99000: 99 % of matches", data->base, data->queries, 0.99, true, 3, 6);
  score_mark<128>(board, "SIFT, n = 99000: recall 0.95", data->base, data->queries, 0.95, false, 1.2, 2);
  score_mark<128>(board, "SIFT, n = 99000: recall 0.99", data->base, data->queries, 0.99, false, 1.2, 2);
}

}  // namespace cairn_bench
