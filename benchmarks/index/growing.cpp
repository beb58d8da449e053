// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
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

/// Seconds that a call takes, and those of it that the calling thread was running: on a busy machine the
/// worst of many calls is the one that was interrupted.
struct Elapsed {
  double wall;
  double running;
};

Elapsed elapsed_of(const std::function<void()>& run) {
  const double begin = running_seconds(Running::thread);
  const double wall = seconds_of(run);
  return {wall, running_seconds(Running::thread) - begin};
}

/// A growing map: what the insertion of a step took, and its queries.
struct Drive {
  std::string name;
  std::vector<Elapsed> insert{};
  std::vector<double> query{};
  [[nodiscard]] double mean_step() const {
    double sum = 0;
    for (std::size_t i = 0; i < insert.size(); ++i) sum += insert[i].wall + query[i];
    return sum / static_cast<double>(insert.size());
  }
  [[nodiscard]] double worst(double Elapsed::* seconds) const {
    double worst = 0;
    for (const Elapsed& one : insert) worst = std::max(worst, one.*seconds);
    return worst;
  }
};

void add_mean(Scoreboard& board, const std::string& name, const Drive& ours, const Drive* rival, double must,
              double aim) {
  board.add(against_rival(name + ", " + ours.name + ": mean step", ours.mean_step() * 1e3,
                          rival ? std::optional(rival->mean_step() * 1e3) : std::nullopt,
                          rival ? rival->name : "", must, aim, "ms"));
}

void add_worst(Scoreboard& board, const std::string& name, const Drive& ours, const Drive* rival,
               std::optional<double> must, std::optional<double> aim) {
  Row row{.name = name + ", " + ours.name + ": worst insertion",
          .measured = ours.worst(&Elapsed::wall) * 1e3,
          .unit = "ms",
          .must = must,
          .aim = aim,
          .note = std::to_string(ours.worst(&Elapsed::running) * 1e3) + " ms of it running"};
  if (rival) {
    row.rival = rival->worst(&Elapsed::wall) * 1e3;
    row.rival_name = rival->name;
  }
  board.add(row);
}

constexpr std::array merging_names{"merged at once", "merged in shares", "merged in the background"};

/// 3-D points, in one multi-kd-tree for each way of merging.
class PointDrive {
public:
  using Index = cairn::MultiKdTree<float, 3>;
  static constexpr std::size_t count = 1000000;
  static constexpr std::size_t batch = 5000;

  PointDrive() {
    for (const auto make : {make_nanoflann_dynamic, make_nanoflann_incremental, make_ikd_tree})
      if (auto rival = make(points_)) {
        theirs.push_back({.name = rival->name});
        rivals_.push_back(std::move(rival));
      }
    for (std::size_t i = 0; i < merging_names.size(); ++i) {
      ours[i].name = merging_names[i];
      indices_.emplace_back(
          cairn::MultiTreeShape{.first_size = 16384, .growth = 8, .merging = static_cast<cairn::Merging>(i)});
    }
  }

  void run() {
    for (std::size_t begin = 0; begin < count; begin += batch) {
      std::vector<std::vector<float>> answers;
      for (std::size_t i = 0; i < indices_.size(); ++i) answers.push_back(step(ours[i], indices_[i], begin));
      for (std::size_t r = 0; r < rivals_.size(); ++r) {
        theirs[r].insert.push_back(elapsed_of([&] { rivals_[r]->insert(begin, begin + batch); }));
        std::vector<float>& found = answers.emplace_back(queries_.size());
        theirs[r].query.push_back(seconds_of([&] {
          for (std::size_t i = 0; i < queries_.size(); ++i) found[i] = rivals_[r]->nearest(queries_[i]);
        }));
      }
      for (const auto& found : answers)
        for (std::size_t i = 0; i < found.size(); ++i)
          different += std::abs(found[i] - answers[0][i]) > 1e-6F;
      if ((begin / batch + 1) % 20 == 0) compare_with_one(begin + batch);
    }
  }

  std::array<Drive, 3> ours;
  std::vector<Drive> theirs;
  std::size_t different = 0;
  std::array<std::vector<double>, 3> against_one;  ///< time of a query over that in a single tree

private:
  std::vector<float> step(Drive& drive, Index& index, std::size_t begin) {
    std::vector<float> found(queries_.size());
    drive.insert.push_back(elapsed_of([&] { index.insert(std::span(points_).subspan(begin, batch)); }));
    drive.query.push_back(seconds_of([&] {
      for (std::size_t i = 0; i < queries_.size(); ++i) found[i] = index.nearest(queries_[i])->distance;
    }));
    return found;
  }

  void compare_with_one(std::size_t size) {
    const cairn::KdTree<float, 3> one(std::span<const Point3>(points_).first(size));
    const auto ask = [&](const auto& tree) {
      return [&] {
        for (const Point3& query : queries_) do_not_optimise(tree.nearest(query));
      };
    };
    std::vector<Contender> contenders{{"one", ask(one), 1}};
    for (const Index& index : indices_) contenders.push_back({"several", ask(index), 1});
    const auto timings = interleave(contenders, {.rounds = 15, .seconds_per_round = 0.005});
    for (std::size_t i = 0; i < indices_.size(); ++i)
      against_one[i].push_back(timings[i + 1].fastest / timings[0].fastest);
  }

  std::vector<Point3> points_ = points_like("uniform", count, 3);
  std::vector<Point3> queries_ = points_like("uniform", 2000, 4);
  std::vector<std::unique_ptr<GrowingRival>> rivals_;
  std::vector<Index> indices_;
};

void score_points(Scoreboard& board) {
  PointDrive drive;
  drive.run();
  const auto best =
      std::min_element(drive.theirs.begin(), drive.theirs.end(),
                       [](const Drive& a, const Drive& b) { return a.mean_step() < b.mean_step(); });
  const Drive* rival = best == drive.theirs.end() ? nullptr : &*best;
  if (drive.different > 0)
    board.add({.name = "growing 3-D: answers differ", .note = std::to_string(drive.different)});
  const std::string name = "growing 3-D, 5000 + 2000 queries to 1e6";
  for (std::size_t i = 0; i < drive.ours.size(); ++i) {
    const bool deferred = i > 0;
    add_mean(board, name, drive.ours[i], rival, 1.5, 3);
    add_worst(board, name, drive.ours[i], rival, deferred ? std::optional(50.0) : std::nullopt,
              deferred ? std::optional(10.0) : std::nullopt);
    const auto& ratios = drive.against_one[i];
    board.add({.name = "query in the multi-kd-tree against one tree while growing, " + drive.ours[i].name,
               .measured = median_of(ratios),
               .unit = "x one tree",
               .must = 1.4,
               .aim = 1.15,
               .note = "fastest of 15 rounds, median of 10 sizes, worst " +
                       std::to_string(*std::max_element(ratios.begin(), ratios.end()))});
  }
}

/// 64 numbers: a map of SURF descriptors. Queries are timed on a tenth of the 2000 and counted ten times.
class DescriptorDrive {
public:
  using Tree = cairn::KdTree<float, 64>;
  using Index = cairn::MultiKdTree<float, 64>;
  static constexpr std::size_t batch = 500;
  static constexpr std::size_t timed = 200;
  static constexpr std::size_t leaves = 24;
  static constexpr int checks = 128;

  DescriptorDrive() {
    if (flann) theirs.name = flann->name;
    for (std::size_t i = 0; i < merging_names.size(); ++i) {
      ours[i].name = merging_names[i];
      indices_.emplace_back(
          cairn::MultiTreeShape{.first_size = 2000, .growth = 4, .merging = static_cast<cairn::Merging>(i)});
    }
  }

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

  std::array<Drive, 3> ours;
  Drive theirs;
  std::unique_ptr<DescriptorRival> flann = make_flann_trees(64, 4);
  double matches = 0;
  double kept = 0;
  double kept_by_flann = 0;

private:
  std::vector<TwoNearest> search(const cairn::PrincipalAxes& axes, const Index& index,
                                 const std::vector<float>& queries, cairn::Budget budget) {
    std::vector<TwoNearest> found;
    float turned[64];
    for (std::size_t i = 0; i < queries.size(); i += 64) {
      axes.turn(&queries[i], turned);
      cairn::NearestTwo<float> two;
      search_.search(index, turned, two, budget);
      found.push_back({two.id(), two.first(), two.second()});
    }
    return found;
  }

  void step_ours(const cairn::PrincipalAxes& axes, std::span<const float> rows,
                 const std::vector<float>& queries) {
    for (std::size_t i = 0; i < ours.size(); ++i) {
      ours[i].insert.push_back(elapsed_of([&] {
        std::vector<float> turned(rows.size());
        for (std::size_t at = 0; at < rows.size(); at += 64) axes.turn(&rows[at], &turned[at]);
        indices_[i].insert(cairn::Rows<float>(turned, 64));
      }));
      ours[i].query.push_back(
          10 * seconds_of([&] { found_ = search(axes, indices_[i], queries, {.leaves = leaves}); }));
    }
  }

  void step_flann(std::span<const float> rows, const std::vector<float>& queries) {
    theirs.insert.push_back(elapsed_of([&] { flann->add(rows.data(), rows.size() / 64); }));
    theirs.query.push_back(10 * seconds_of([&] { found_by_flann_ = flann->search(queries, checks); }));
  }

  void compare(const cairn::PrincipalAxes& axes, const std::vector<float>& queries) {
    const auto exact = search(axes, indices_.back(), queries, {});
    const auto accepted = [](const TwoNearest& two) { return two.second >= 1.25F * two.first; };
    for (std::size_t i = 0; i < exact.size(); ++i) {
      if (!accepted(exact[i])) continue;
      ++matches;
      kept += accepted(found_[i]) && found_[i].id == exact[i].id;
      if (flann) kept_by_flann += accepted(found_by_flann_[i]) && found_by_flann_[i].id == exact[i].id;
    }
  }

  std::vector<Index> indices_;
  cairn::BestBinFirst<Index> search_;
  std::vector<TwoNearest> found_;
  std::vector<TwoNearest> found_by_flann_;
};

void score_descriptor_map(Scoreboard& board) {
  DescriptorDrive drive;
  drive.run(100000);
  const Drive* rival = drive.flann ? &drive.theirs : nullptr;
  for (std::size_t i = 0; i < drive.ours.size(); ++i) {
    const std::string name = "growing 64-d, 500 + 2000 queries to 1e5";
    add_mean(board, name, drive.ours[i], rival, 7, 12);
    add_worst(board, name, drive.ours[i], rival, i == 0 ? 150.0 : 30.0, 10.0);
  }
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
