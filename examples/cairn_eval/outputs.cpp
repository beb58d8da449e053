// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>

#include "support/report.hpp"
#include "support/result_folder.hpp"

namespace cairn_eval {

namespace {

using cairn::AlignBy;
using cairn::PosePair;
using cairn::Vector;
using example::Ink;
using example::readable;
using Json = nlohmann::ordered_json;

constexpr double degrees = 180 / std::numbers::pi;

example::ResultFolder results_in(const std::filesystem::path& folder) {
  return {folder, {"summary.json", "errors.csv", "report.html"}};
}

const char* name_of(AlignBy align) {
  switch (align) {
    case AlignBy::none:
      return "none";
    case AlignBy::first_pose:
      return "first";
    case AlignBy::rigid:
      return "rigid";
    case AlignBy::similarity:
      return "similarity";
  }
  return "";
}

std::string delta_of(const cairn::RelativeOptions& options) {
  const char* unit = options.unit == cairn::DeltaUnit::metres ? " m"
                     : options.delta == 1                     ? " frame"
                                                              : " frames";
  return cairn::shortest(options.delta) + unit + (options.all_pairs ? ", all pairs" : "");
}

Json json_of(const cairn::ErrorStatistics& s, double factor) {
  return {{"rmse", s.rmse * factor},     {"mean", s.mean * factor},
          {"median", s.median * factor}, {"std", s.standard_deviation * factor},
          {"min", s.smallest * factor},  {"max", s.largest * factor}};
}

Json json_of(const NamedEvaluation& one) {
  const Evaluation& e = one.evaluation;
  Json json{{"name", one.name},          {"poses", e.poses},
            {"pairs", e.pairs.size()},   {"length_m", e.length},
            {"scale", e.absolute.scale}, {"ate_m", json_of(e.absolute.translation, 1)}};
  // What the alignment does not determine is null, not a number.
  json["attitude_error_deg"] = e.absolute.rotation ? json_of(*e.absolute.rotation, degrees) : Json();
  if (e.relative) {
    json["rpe_pairs"] = e.relative->translation.count;
    json["rpe_m"] = json_of(e.relative->translation, 1);
    json["rpe_deg"] = json_of(e.relative->rotation, degrees);
  } else {
    json["rpe_m"] = nullptr;
  }
  if (e.kitti) {
    Json lengths = Json::array();
    for (const cairn::SegmentError& s : e.kitti->by_length)
      lengths.push_back({{"length_m", s.length},
                         {"translation_percent", s.translation_percent()},
                         {"rotation_deg_per_100m", s.rotation_degrees_per_100m()},
                         {"segments", s.segments}});
    json["kitti"] = {{"translation_percent", e.kitti->overall.translation_percent()},
                     {"rotation_deg_per_100m", e.kitti->overall.rotation_degrees_per_100m()},
                     {"segments", e.kitti->overall.segments},
                     {"by_length", lengths}};
  } else {
    json["kitti"] = nullptr;
  }
  if (e.nees)
    json["nees"] = {{"mean", e.nees->mean},
                    {"expected", 6},
                    {"band_95_low", e.nees->band.low},
                    {"band_95_high", e.nees->band.high},
                    {"poses", e.nees->values.size()},
                    {"without_covariance", e.nees->missing},
                    {"without_inverse", e.nees->no_inverse}};
  else if (e.has_covariances)
    json["nees"] = nullptr;
  return json;
}

std::string summary_of(const std::vector<NamedEvaluation>& all, const EvaluationOptions& options) {
  Json json{{"align", name_of(options.align)}, {"rpe_delta", delta_of(options.relative)}};
  json["estimates"] = Json::array();
  for (const NamedEvaluation& one : all) json["estimates"].push_back(json_of(one));
  return json.dump(2) + "\n";
}

std::string errors_of(const std::vector<NamedEvaluation>& all) {
  std::string text = "estimate,time_s,error_m\n";
  for (const NamedEvaluation& one : all)
    for (std::size_t i = 0; i < one.evaluation.pairs.size(); ++i) {
      // A name may have a comma or a quotation mark in it.
      text += '"';
      for (const char letter : one.name) text += letter == '"' ? std::string("\"\"") : std::string(1, letter);
      text += "\",";
      cairn::append_number(text, one.evaluation.pairs[i].time);
      text += ',';
      cairn::append_number(text, one.evaluation.absolute.distances[i]);
      text += '\n';
    }
  return text;
}

constexpr std::array inks{Ink::belief, Ink::measurement, Ink::teal, Ink::violet, Ink::wrong, Ink::grey};

Ink ink_of(std::size_t number) {
  return inks[number % inks.size()];
}

/// The two coordinates over which the truth spreads most, in their order.
std::pair<int, int> plane_of(const std::vector<PosePair>& pairs) {
  Vector<3> low = pairs.front().truth.translation(), high = low;
  for (const PosePair& pair : pairs) {
    low = low.cwiseMin(pair.truth.translation());
    high = high.cwiseMax(pair.truth.translation());
  }
  const Vector<3> spread = high - low;
  int least = 2;
  for (int axis = 0; axis < 3; ++axis)
    if (spread(axis) < spread(least)) least = axis;
  return {least == 0 ? 1 : 0, least == 2 ? 1 : 2};
}

/// More points than a page has pixels only make it slow.
std::size_t stride_of(std::size_t count) {
  return std::max<std::size_t>(1, count / 3000);
}

example::PlanePlot paths(const std::vector<NamedEvaluation>& all) {
  const auto [a, b] = plane_of(all.front().evaluation.pairs);
  constexpr std::array names{"x", "y", "z"};
  example::PlanePlot plot{
      .title = "Paths",
      .caption =
          "Each estimate after its alignment, over the truth. The third coordinate, in which the truth "
          "moves least, is left out.",
      .x = {names[static_cast<std::size_t>(a)], "m"},
      .y = {names[static_cast<std::size_t>(b)], "m"},
      .wide = true};
  const auto add = [&, a = a, b = b](example::PlaneCurve& curve, const Vector<3>& place) {
    curve.x.push_back(place(a));
    curve.y.push_back(place(b));
  };
  example::PlaneCurve truth{.name = "truth", .ink = Ink::truth};
  const auto& pairs = all.front().evaluation.pairs;
  for (std::size_t i = 0; i < pairs.size(); i += stride_of(pairs.size()))
    add(truth, pairs[i].truth.translation());
  plot.curves.push_back(std::move(truth));
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Evaluation& e = all[k].evaluation;
    example::PlaneCurve curve{.name = all[k].name, .ink = ink_of(k)};
    for (std::size_t i = 0; i < e.pairs.size(); i += stride_of(e.pairs.size()))
      add(curve,
          e.absolute.T_truth_estimate * Vector<3>(e.absolute.scale * e.pairs[i].estimate.translation()));
    plot.curves.push_back(std::move(curve));
  }
  return plot;
}

/// Values of each estimate against its times, from the first of them on.
template <class Values>
example::PlanePlot over_time(const std::vector<NamedEvaluation>& all, const Values& values) {
  example::PlanePlot plot{.x = {"time", "s"}, .wide = true, .equal_scale = false};
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Evaluation& e = all[k].evaluation;
    example::PlaneCurve curve{.name = all[k].name, .ink = ink_of(k)};
    values(e, [&, from = all.front().evaluation.pairs.front().time](double time, double value) {
      curve.x.push_back(time - from);
      curve.y.push_back(value);
    });
    if (!curve.x.empty()) plot.curves.push_back(std::move(curve));
  }
  return plot;
}

example::PlanePlot errors(const std::vector<NamedEvaluation>& all) {
  example::PlanePlot plot = over_time(all, [](const Evaluation& e, const auto& add) {
    for (std::size_t i = 0; i < e.pairs.size(); i += stride_of(e.pairs.size()))
      add(e.pairs[i].time, e.absolute.distances[i]);
  });
  plot.title = "Error of the position";
  plot.caption =
      "Distance between the aligned estimate and the truth. A KITTI file without times has the numbers of "
      "its rows for seconds.";
  plot.y = {"error", "m"};
  return plot;
}

example::PlanePlot nees_over_time(const std::vector<NamedEvaluation>& all) {
  example::PlanePlot plot = over_time(all, [](const Evaluation& e, const auto& add) {
    if (!e.nees) return;
    for (std::size_t i = 0; i < e.nees->values.size(); i += stride_of(e.nees->values.size()))
      add(e.nees->times[i], std::sqrt(e.nees->values[i]));
  });
  plot.title = "How many sigmas off: root of NEES";
  plot.caption =
      "NEES, normalised estimation error squared, has the mean 6 where the covariance is true, so that the "
      "curve "
      "stays about 2.4; far above, the estimate is surer than it is right.";
  plot.y = {"root of NEES", ""};
  return plot;
}

example::PlanePlot kitti_by_length(const std::vector<NamedEvaluation>& all) {
  example::PlanePlot plot{.title = "Drift by length: the KITTI measure",
                          .caption = "Mean error of stretches of the path of each length, as a share of it.",
                          .x = {"length of the stretches", "m"},
                          .y = {"error of the translation", "%"},
                          .equal_scale = false};
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!all[k].evaluation.kitti) continue;
    example::PlaneCurve curve{.name = all[k].name, .ink = ink_of(k)};
    for (const cairn::SegmentError& s : all[k].evaluation.kitti->by_length) {
      curve.x.push_back(s.length);
      curve.y.push_back(s.translation_percent());
    }
    plot.curves.push_back(std::move(curve));
  }
  return plot;
}

example::Table table(const std::vector<NamedEvaluation>& all, const EvaluationOptions& options) {
  example::Table table{
      .title = "Figures",
      .caption = std::string("ATE: absolute trajectory error after the alignment '") +
                 name_of(options.align) + "'. RPE: relative pose error over " + delta_of(options.relative) +
                 ". KITTI: mean drift over stretches of 100 to 800 m. NEES: 6 where the covariance is "
                 "true, with the 95 % band of its mean as if poses were independent.",
      .columns = {"estimate", "pairs", "ATE rmse [m]", "median [m]", "largest [m]", "attitude rmse [deg]",
                  "RPE rmse [m]", "RPE rmse [deg]", "KITTI [%]", "KITTI [deg/100 m]", "NEES", "scale"},
      .wide = true};
  for (const NamedEvaluation& one : all) {
    const Evaluation& e = one.evaluation;
    const cairn::ErrorStatistics& ate = e.absolute.translation;
    table.rows.push_back({one.name, std::to_string(e.pairs.size()), readable(ate.rmse, 4),
                          readable(ate.median, 4), readable(ate.largest, 4),
                          e.absolute.rotation ? readable(e.absolute.rotation->rmse * degrees, 4) : "-",
                          e.relative ? readable(e.relative->translation.rmse, 4) : "-",
                          e.relative ? readable(e.relative->rotation.rmse * degrees, 4) : "-",
                          e.kitti ? readable(e.kitti->overall.translation_percent(), 4) : "-",
                          e.kitti ? readable(e.kitti->overall.rotation_degrees_per_100m(), 4) : "-",
                          e.nees ? readable(e.nees->mean, 3) + " (" + readable(e.nees->band.low, 3) + " to " +
                                       readable(e.nees->band.high, 3) + ")"
                                 : "-",
                          readable(e.absolute.scale, 4)});
  }
  return table;
}

constexpr const char* attitude_is_open =
    "not determined by this alignment: the path is too near a straight line, which leaves the turn about it "
    "free; see --align first";

example::Report report_of(const std::vector<NamedEvaluation>& all, const EvaluationOptions& options) {
  example::Report report("Trajectories against the truth",
                         std::to_string(all.size()) + (all.size() == 1 ? " estimate" : " estimates") +
                             ", aligned: " + name_of(options.align));
  for (const NamedEvaluation& one : all)
    report.figure({"ATE of " + one.name, readable(one.evaluation.absolute.translation.rmse), "m",
                   "root mean square over " + std::to_string(one.evaluation.pairs.size()) + " poses"});
  for (const NamedEvaluation& one : all)
    if (!one.evaluation.absolute.rotation)
      report.note("The attitude of " + one.name +
                  (one.evaluation.has_covariances ? ", and so NEES, is " : " is ") + attitude_is_open + ".");
  report.add(table(all, options));
  report.add(paths(all));
  report.add(errors(all));
  const auto any = [&](const auto& has) { return std::any_of(all.begin(), all.end(), has); };
  if (any([](const NamedEvaluation& one) { return one.evaluation.kitti.has_value(); }))
    report.add(kitti_by_length(all));
  if (any([](const NamedEvaluation& one) { return one.evaluation.nees.has_value(); }))
    report.add(nees_over_time(all));
  return report;
}

std::string left_out(const NeesFigures& nees) {
  std::string text;
  if (nees.missing > 0) text += std::to_string(nees.missing) + " without a covariance of their time";
  if (nees.no_inverse > 0)
    text += (text.empty() ? "" : ", ") + std::to_string(nees.no_inverse) + " whose covariance has no inverse";
  return text.empty() ? text : "; left out: " + text;
}

}  // namespace

std::string in_words(const std::vector<NamedEvaluation>& all, const EvaluationOptions& options) {
  std::string text;
  for (const NamedEvaluation& one : all) {
    const Evaluation& e = one.evaluation;
    const cairn::ErrorStatistics& ate = e.absolute.translation;
    text += one.name + ": " + std::to_string(e.pairs.size()) + " of " + std::to_string(e.poses) +
            " poses have a partner, " + readable(e.length, 5) + " m\n";
    text += "  ATE    " + readable(ate.rmse, 4) + " m rmse, " + readable(ate.median, 4) + " median, " +
            readable(ate.largest, 4) + " largest; attitude " +
            (e.absolute.rotation ? readable(e.absolute.rotation->rmse * degrees, 4) + " deg rmse"
                                 : std::string(attitude_is_open)) +
            " (aligned: " + name_of(options.align) +
            (options.align == AlignBy::similarity ? ", scale " + readable(e.absolute.scale, 5) : "") + ")\n";
    text += "  RPE    " +
            (e.relative ? readable(e.relative->translation.rmse, 4) + " m, " +
                              readable(e.relative->rotation.rmse * degrees, 4) + " deg rmse over " +
                              delta_of(options.relative)
                        : "the path is shorter than " + delta_of(options.relative)) +
            "\n";
    text += "  KITTI  " +
            (e.kitti ? readable(e.kitti->overall.translation_percent(), 4) + " %, " +
                           readable(e.kitti->overall.rotation_degrees_per_100m(), 4) +
                           " deg per 100 m over " + std::to_string(e.kitti->overall.segments) + " stretches"
                     : std::string("the path is shorter than the shortest stretch")) +
            "\n";
    if (e.nees)
      text += "  NEES   " + readable(e.nees->mean, 3) + " on the average of " +
              std::to_string(e.nees->values.size()) +
              " poses, 6 where the covariance is true (95 %: " + readable(e.nees->band.low, 3) + " to " +
              readable(e.nees->band.high, 3) + " if independent)" + left_out(*e.nees) + "\n";
    else if (e.has_covariances)
      text += "  NEES   needs attitudes, which this alignment does not determine (--align first)\n";
  }
  return text;
}

void prepare_output_folder(const std::filesystem::path& folder) {
  results_in(folder).prepare();
}

std::optional<std::string> write_outputs(const std::filesystem::path& folder,
                                         const std::vector<NamedEvaluation>& all,
                                         const EvaluationOptions& options) {
  const std::optional<std::string> page = report_of(all, options).html();
  results_in(folder).replace([&](const std::filesystem::path& staging) {
    cairn::write_file_atomically(staging / "summary.json", summary_of(all, options));
    cairn::write_file_atomically(staging / "errors.csv", errors_of(all));
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace cairn_eval
