// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "study/recall.hpp"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>
#include <sstream>
#include <utility>

#include <cairn/index/packed_points.hpp>
#include <cairn/index/points.hpp>

#include "data.hpp"
#include "rivals.hpp"
#include "support/timing.hpp"

namespace cairn_study {
namespace {

using cairn_bench::DescriptorRival;
using cairn_bench::Descriptors;
using cairn_bench::TwoNearest;

bool are_bytes(const std::vector<float>& rows) {
  return std::all_of(rows.begin(), rows.end(), [](float number) {
    return number >= 0 && number <= 255 && number == std::floor(number);
  });
}

/// Ours first.
std::vector<std::unique_ptr<DescriptorRival>> contenders(const Descriptors& set) {
  const bool bytes = are_bytes(set.base) && are_bytes(set.queries);
  std::vector<std::unique_ptr<DescriptorRival>> all;
  all.push_back(cairn_bench::make_our_cells(set.dim, true));
  all.push_back(cairn_bench::make_symphony_qg(set.dim, 100));
  all.push_back(cairn_bench::make_glass(set.dim));
  all.push_back(bytes ? cairn_bench::make_hnswlib_of_bytes(set.dim) : cairn_bench::make_hnswlib(set.dim));
  all.push_back(cairn_bench::make_faiss_ivf(set.dim));
  all.push_back(cairn_bench::make_flann_trees(set.dim, 4));
  std::erase(all, nullptr);
  return all;
}

double recall_of(const std::vector<TwoNearest>& found, const std::vector<float>& nearest) {
  double right = 0;
  for (std::size_t i = 0; i < found.size(); ++i) right += found[i].first <= nearest[i] * 1.00001F;
  return right / static_cast<double>(found.size());
}

/// Budgets that double twice in three steps, until nearly all is found or time is not worth it any more.
std::vector<RecallPoint> measured(const DescriptorRival& contender, const std::vector<float>& queries,
                                  const std::vector<float>& nearest) {
  std::vector<RecallPoint> points;
  const auto count = static_cast<double>(nearest.size());
  int last = 0;
  for (double budget = 2; budget < 9000; budget *= 1.6) {
    if (static_cast<int>(budget) == last) continue;
    last = static_cast<int>(budget);
    RecallPoint point{last, recall_of(contender.search(queries, last), nearest), 0};
    std::vector<double> rounds;
    for (int round = 0; round < 5; ++round) {
      const double begin = cairn_bench::running_seconds(cairn_bench::Running::thread);
      cairn_bench::do_not_optimise(contender.search(queries, last));
      rounds.push_back((cairn_bench::running_seconds(cairn_bench::Running::thread) - begin) / count);
    }
    point.seconds = cairn_bench::median_of(rounds);
    points.push_back(point);
    if (point.recall >= 0.998 || point.seconds > 2e-3) break;
  }
  return points;
}

RecallStudy study_of(std::string name, std::string title, const Descriptors& set) {
  RecallStudy study{.name = std::move(name),
                    .title = std::move(title),
                    .count = set.base.size() / set.dim,
                    .dim = set.dim,
                    .queries = set.queries.size() / set.dim};
  std::vector<float> nearest;
  {
    const cairn::PackedPoints packed{cairn::Rows<float>(set.base, set.dim)};
    for (const auto& two : cairn::nearest_two(packed, cairn::Rows<float>(set.queries, set.dim)))
      nearest.push_back(two.first);
  }
  for (const auto& contender : contenders(set)) {
    std::cerr << study.name << ": " << contender->name << '\n';
    RecallCurve curve{.name = contender->name};
    const double begin = cairn_bench::running_seconds(cairn_bench::Running::process);
    contender->add(set.base.data(), study.count);
    curve.build_seconds = cairn_bench::running_seconds(cairn_bench::Running::process) - begin;
    if (contender->bytes) curve.megabytes = static_cast<double>(contender->bytes()) / 1e6;
    curve.points = measured(*contender, set.queries, nearest);
    study.curves.push_back(std::move(curve));
  }
  return study;
}

example::Ink ink_of(std::size_t curve) {
  using example::Ink;
  constexpr Ink inks[] = {Ink::belief, Ink::measurement, Ink::teal, Ink::violet, Ink::grey, Ink::truth};
  return inks[std::min(curve, std::size(inks) - 1)];
}

std::string microseconds(const std::optional<double>& seconds) {
  return seconds ? example::readable(1e6 * *seconds) : "-";
}

}  // namespace

std::optional<double> seconds_at(const RecallCurve& curve, double recall) {
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const RecallPoint& after = curve.points[i];
    if (after.recall < recall) continue;
    if (i == 0) return after.recall == recall ? std::optional(after.seconds) : std::nullopt;
    const RecallPoint& before = curve.points[i - 1];
    constexpr double least = 1e-4;  // of the share missed, whose logarithm is asked for
    const double from = std::log(std::max(least, 1 - before.recall));
    const double to = std::log(std::max(least, 1 - after.recall));
    const double share = from > to ? (from - std::log(std::max(least, 1 - recall))) / (from - to) : 1.0;
    return std::exp(std::log(before.seconds) + share * std::log(after.seconds / before.seconds));
  }
  return std::nullopt;
}

std::vector<RecallStudy> recall_studies() {
  std::vector<RecallStudy> studies;
  if (const auto set = cairn_bench::sift())
    studies.push_back(study_of("sift_128", "SIFT descriptors", *set));
  else
    std::cerr << "sift_128: skipped, there is no such data here\n";
  studies.push_back(study_of("features_256", "made-up features", cairn_bench::features(40000, 256, 5)));
  return studies;
}

void add_recall(example::Report& report, const RecallStudy& study) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string set =
      study.title + ", n = " + std::to_string(study.count) + " of " + std::to_string(study.dim) + " numbers";
  example::LinePlot plot{
      .title = "Recall against time: " + set,
      .caption = "Recall: share of " + std::to_string(study.queries) +
                 " queries whose nearest descriptor (by an exact search) is found. The horizontal "
                 "axis is what is missed, 1 - recall, in percent; farther left finds more, "
                 "lower is faster. Each line goes through one contender's budgets; straight "
                 "between them. CPU time of one thread.",
      .x = {"nearest descriptors missed, 1 - recall", "%"},
      .y = {"time of a query", "us"},
      .logarithmic = true,
      .logarithmic_x = true,
      .wide = true};
  for (double missed = 0.3; missed < 40; missed *= 1.08) plot.x_values.push_back(missed);
  for (std::size_t i = 0; i < study.curves.size(); ++i) {
    std::vector<double> values;
    for (const double missed : plot.x_values) {
      const auto seconds = seconds_at(study.curves[i], 1 - missed / 100);
      values.push_back(seconds ? 1e6 * *seconds : nan);
    }
    plot.curves.push_back({.name = study.curves[i].name, .ink = ink_of(i), .values = values});
  }
  report.add(plot);
  example::Table table{
      .title = "What it takes: " + set,
      .caption =
          "Microseconds a query at a recall of 0.90, 0.95 and 0.99, from the lines above (\"-\": not "
          "reached); processor seconds to build; megabytes beside the rows, where the "
          "contender tells them.",
      .columns = {"contender", "0.90 [us]", "0.95 [us]", "0.99 [us]", "build [s]", "memory [MB]"},
      .wide = true};
  for (const RecallCurve& curve : study.curves)
    table.rows.push_back({curve.name, microseconds(seconds_at(curve, 0.9)),
                          microseconds(seconds_at(curve, 0.95)), microseconds(seconds_at(curve, 0.99)),
                          example::readable(curve.build_seconds),
                          curve.megabytes ? example::readable(*curve.megabytes) : "-"});
  report.add(table);
}

std::string recall_csv(const std::vector<RecallStudy>& studies) {
  std::ostringstream out;
  out.precision(9);
  out << "set,contender,build_s,budget,recall,query_s\n";
  for (const RecallStudy& study : studies)
    for (const RecallCurve& curve : study.curves)
      for (const RecallPoint& point : curve.points)
        out << study.name << ",\"" << curve.name << "\"," << curve.build_seconds << ',' << point.budget << ','
            << point.recall << ',' << point.seconds << '\n';
  return out.str();
}

}  // namespace cairn_study
