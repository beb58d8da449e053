// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/principal_axes.hpp>

#include "areas.hpp"
#include "rivals.hpp"

namespace cairn_bench {
namespace {

/// Seconds of a growing map: per step the insertion, and the queries.
struct Drive {
  std::vector<double> insert;
  std::vector<double> query;
  [[nodiscard]] double mean_step() const {
    double sum = 0;
    for (std::size_t i = 0; i < insert.size(); ++i) sum += insert[i] + query[i];
    return sum / static_cast<double>(insert.size());
  }
  [[nodiscard]] double worst_insert() const { return *std::max_element(insert.begin(), insert.end()); }
};

void add_rows(Scoreboard& board, const std::string& name, const Drive& ours,
              const std::optional<Drive>& rival, const std::string& rival_name, double must, double aim,
              double worst_must) {
  const auto milliseconds = [](const std::optional<Drive>& drive) {
    return drive ? std::optional(drive->mean_step() * 1e3) : std::nullopt;
  };
  board.add(against_rival(name + ": mean step", ours.mean_step() * 1e3, milliseconds(rival), rival_name, must,
                          aim, "ms"));
  Row worst{.name = name + ": worst insertion",
            .measured = ours.worst_insert() * 1e3,
            .unit = "ms",
            .must = worst_must,
            .aim = 10,
            .rival_name = rival_name,
            .note = "merged in the foreground"};
  if (rival) worst.rival = rival->worst_insert() * 1e3;
  board.add(worst);
}

void score_points(Scoreboard& board) {
  constexpr std::size_t count = 1000000;
  constexpr std::size_t batch = 5000;
  const auto points = points_like("uniform", count, 3);
  const auto queries = points_like("uniform", 2000, 4);
  cairn::MultiKdTree<float, 3> index({.first_size = 16384, .growth = 8});
  const auto rival = make_nanoflann_dynamic(points);
  Drive ours;
  Drive theirs;
  std::size_t different = 0;
  for (std::size_t begin = 0; begin < count; begin += batch) {
    std::vector<float> mine(queries.size());
    std::vector<float> other(queries.size());
    ours.insert.push_back(seconds_of([&] { index.insert(std::span(points).subspan(begin, batch)); }));
    ours.query.push_back(seconds_of([&] {
      for (std::size_t i = 0; i < queries.size(); ++i) mine[i] = index.nearest(queries[i])->distance;
    }));
    if (!rival) continue;
    theirs.insert.push_back(seconds_of([&] { rival->insert(begin, begin + batch); }));
    theirs.query.push_back(seconds_of([&] {
      for (std::size_t i = 0; i < queries.size(); ++i) other[i] = rival->nearest(queries[i]);
    }));
    for (std::size_t i = 0; i < queries.size(); ++i) different += std::abs(mine[i] - other[i]) > 1e-6F;
  }
  if (different > 0)
    board.add({.name = "growing 3-D: answers differ from the rival's", .note = std::to_string(different)});
  add_rows(board, "growing 3-D, 5000 + 2000 queries to 1e6", ours,
           rival ? std::optional(theirs) : std::nullopt, rival ? rival->name : "", 1.5, 2.5, 50);

  const cairn::KdTree<float, 3> whole(points);
  const auto ask = [&](const auto& tree) {
    return [&] {
      for (const Point3& query : queries) do_not_optimise(tree.nearest(query));
    };
  };
  const auto timings = interleave({{"one", ask(whole), 1}, {"several", ask(index), 1}}, {.rounds = 9});
  board.add({.name = "query in the multi-kd-tree against one tree, 3-D, n = 1e6",
             .measured = ratio(timings[1], timings[0]),
             .unit = "x one tree",
             .must = 1.4,
             .aim = 1.15,
             .note = std::to_string(index.trees().size()) + " levels"});
}

/// 64 numbers: the thesis's map. Queries are timed on a tenth of the 2000 and counted ten times.
class DescriptorDrive {
public:
  using Tree = cairn::KdTree<float, 64>;
  static constexpr std::size_t batch = 500;
  static constexpr std::size_t timed = 200;
  static constexpr std::size_t leaves = 24;
  static constexpr int checks = 128;

  void run(std::size_t count) {
    const auto points = clustered_descriptors(count, 7);
    const std::vector<float> sample(points.begin(), points.begin() + 64 * 2000);
    const cairn::PrincipalAxes axes{cairn::Rows<float>(sample, 64)};
    for (std::size_t begin = 0; begin < count; begin += batch) {
      const auto rows = std::span(points).subspan(64 * begin, 64 * batch);
      const std::vector<float> seen(points.begin(),
                                    points.begin() + static_cast<std::ptrdiff_t>(64 * (begin + batch)));
      const auto queries = noisy_copies(seen, timed, begin);
      step_ours(axes, rows, queries);
      if (flann) step_flann(rows, queries);
      if (begin % (count / 10) == 0) compare(axes, queries);
    }
  }

  Drive ours;
  Drive theirs;
  std::unique_ptr<DescriptorRival> flann = make_flann_trees(64, 4);
  double matches = 0;
  double kept = 0;
  double kept_by_flann = 0;

private:
  std::vector<TwoNearest> search(const cairn::PrincipalAxes& axes, const std::vector<float>& queries,
                                 cairn::Budget budget) {
    std::vector<TwoNearest> found;
    float turned[64];
    for (std::size_t i = 0; i < queries.size(); i += 64) {
      axes.turn(&queries[i], turned);
      cairn::NearestTwo<float> two;
      search_.search(index_.trees(), turned, two, budget);
      found.push_back({two.id(), std::sqrt(two.first()), std::sqrt(two.second())});
    }
    return found;
  }

  void step_ours(const cairn::PrincipalAxes& axes, std::span<const float> rows,
                 const std::vector<float>& queries) {
    ours.insert.push_back(seconds_of([&] {
      std::vector<float> turned(rows.size());
      for (std::size_t i = 0; i < rows.size(); i += 64) axes.turn(&rows[i], &turned[i]);
      index_.insert(cairn::Rows<float>(turned, 64));
    }));
    ours.query.push_back(10 * seconds_of([&] { found_ = search(axes, queries, {.leaves = leaves}); }));
  }

  void step_flann(std::span<const float> rows, const std::vector<float>& queries) {
    theirs.insert.push_back(seconds_of([&] { flann->add(rows.data(), rows.size() / 64); }));
    theirs.query.push_back(10 * seconds_of([&] { found_by_flann_ = flann->search(queries, checks); }));
  }

  void compare(const cairn::PrincipalAxes& axes, const std::vector<float>& queries) {
    const auto exact = search(axes, queries, {});
    const auto accepted = [](const TwoNearest& two) { return two.second >= 1.25F * two.first; };
    for (std::size_t i = 0; i < exact.size(); ++i) {
      if (!accepted(exact[i])) continue;
      ++matches;
      kept += accepted(found_[i]) && found_[i].id == exact[i].id;
      if (flann) kept_by_flann += accepted(found_by_flann_[i]) && found_by_flann_[i].id == exact[i].id;
    }
  }

  cairn::MultiKdTree<float, 64> index_{cairn::MultiTreeShape{.first_size = 2000, .growth = 4}};
  cairn::BestBinFirst<Tree> search_;
  std::vector<TwoNearest> found_;
  std::vector<TwoNearest> found_by_flann_;
};

void score_descriptor_map(Scoreboard& board) {
  DescriptorDrive drive;
  drive.run(100000);
  add_rows(board, "growing 64-d, 500 + 2000 queries to 1e5", drive.ours,
           drive.flann ? std::optional(drive.theirs) : std::nullopt, drive.flann ? drive.flann->name : "", 3,
           6, 150);
  board.add({.name = "growing 64-d: share of exact search's matches found",
             .measured = drive.kept / drive.matches,
             .unit = "",
             .must = 0.99,
             .aim = std::nullopt,
             .better = larger,
             .rival = drive.flann ? std::optional(drive.kept_by_flann / drive.matches) : std::nullopt,
             .rival_name = "FLANN 128 checks",
             .note = std::to_string(DescriptorDrive::leaves) + " leaves"});
}

}  // namespace

void score_growing(Scoreboard& board) {
  score_points(board);
  score_descriptor_map(board);
}

}  // namespace cairn_bench
