// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "study/report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <sstream>

#include <nlohmann/json.hpp>

#include <cairn/core/statistics.hpp>

namespace cairn_study {
namespace {

using example::Curve;
using example::Ink;
using example::LinePlot;
using example::readable;

constexpr std::size_t usual_first_steps = 10;  ///< z where q varies
constexpr std::size_t usual_growth = 4;        ///< q where z varies

bool is_forest(const Result& result) {
  return result.drive.growth != 0;
}

Ink ink_of(const Result& result, bool by_growth) {
  if (!is_forest(result)) return result.drive.samples.back().trees > 0 ? Ink::wrong : Ink::grey;
  const std::size_t key = by_growth ? result.drive.growth : result.drive.first_steps;
  if (key <= 2) return Ink::belief;
  if (key == 3 || key == 10) return Ink::teal;
  if (key == 4) return Ink::violet;
  return Ink::measurement;
}

struct Panel {
  std::string title;
  std::string caption;
  std::string label;
  std::string unit;
  double scale = 1;
  bool logarithmic = true;
};

/// One panel; `by_growth` shows the forests of the usual z, otherwise those of the usual q.
LinePlot panel_of(const Study& study, const Panel& panel, bool by_growth, bool with_scan,
                  const std::function<const std::vector<double>&(const Result&)>& values) {
  LinePlot plot{.title = panel.title,
                .caption = panel.caption,
                .x = {"points n", ""},
                .y = {panel.label, panel.unit},
                .x_values = study.grid,
                .logarithmic = panel.logarithmic,
                .logarithmic_x = true};
  for (const Result& result : study.results) {
    const bool is_scan = &result == &study.results.back();
    if (is_scan && !with_scan) continue;
    if (is_forest(result) &&
        (by_growth ? result.drive.first_steps != usual_first_steps : result.drive.growth != usual_growth))
      continue;
    std::vector<double> scaled = values(result);
    for (double& value : scaled) value *= panel.scale;
    plot.curves.push_back({.name = result.drive.name, .ink = ink_of(result, by_growth), .values = scaled});
  }
  return plot;
}

void add_panels(example::Report& report, const Study& study) {
  const std::string& title = study.stream.title;
  const auto add = [&](const Panel& panel, bool by_growth, bool with_scan,
                       std::vector<double> Curves::* member) {
    report.add(
        panel_of(study, panel, by_growth, with_scan,
                 [member](const Result& r) -> const std::vector<double>& { return r.curves.*member; }));
  };
  const std::string per_step = std::to_string(study.stream.step) + " inserted and " +
                               std::to_string(study.stream.queries) + " asked a step";
  const std::string usual_z = "Forests with z = 10. ";
  add({title + ": sum", usual_z + per_step + ".", "a step", "ms", 1e3}, true, true, &Curves::sum);
  add({title + ": building", usual_z + "Time of the insertion alone.", "a step", "ms", 1e3}, true, false,
      &Curves::build);
  add({title + ": searching", usual_z + "Time of all queries of a step.", "a step", "ms", 1e3}, true, true,
      &Curves::search);
  add({title + ": worst step so far", usual_z + "The slowest step up to n.", "worst step", "ms", 1e3}, true,
      true, &Curves::worst);
  add({title + ": size of the first tree", "Sum a step for q = 4 and z = 1, 10, 50.", "a step", "ms", 1e3},
      false, false, &Curves::sum);
  add({title + ": points moved",
       usual_z + "Points written into trees for each inserted one: no clock is involved.", "moved / inserted",
       ""},
      true, false, &Curves::moved);
  add({title + ": distances", usual_z + "Distances to points computed a query: no clock is involved.",
       "distances / query", ""},
      true, true, &Curves::distances);
  add({title + ": memory",
       "Bytes held for each point, the point included. The single tree keeps its points a second "
       "time to rebuild from.",
       "bytes / point", "", 1, false},
      true, true, &Curves::bytes);
}

std::string at(const std::optional<double>& n) {
  return n ? readable(*n) : "-";
}

void add_table(example::Report& report, const Study& study) {
  example::Table table{
      .title = study.stream.title + ": all stores",
      .caption =
          "Exponents b of a cost that grows like n^b a step, measured / by the formula of the amortised cost "
          "over the "
          "same "
          "n. \"cheaper from\": n from which on all steps so far together cost less. Matches kept: share of "
          "the exact search's matches under the ratio test.",
      .columns = {"store", "mean step [ms]", "worst step [ms]", "worst insertion [ms]", "build exponent",
                  "search exponent", "cheaper than the single tree from", "than the scan from",
                  "bytes / point", "moved / inserted", "distances / query", "matches kept",
                  "wrong / checked"},
      .wide = true};
  for (const Result& result : study.results) {
    const Curves& curves = result.curves;
    const double steps = study.grid.back() / static_cast<double>(study.stream.step);
    const bool is_single = &result == &study.results.front();
    const bool is_scan = &result == &study.results.back();
    table.rows.push_back({result.drive.name, readable(1e3 * curves.total.back() / steps),
                          readable(1e3 * curves.worst.back()), readable(1e3 * result.worst_build),
                          readable(result.build.measured, 2) + " / " + readable(result.build.theory, 2),
                          readable(result.search.measured, 2) + " / " + readable(result.search.theory, 2),
                          is_single ? "" : at(result.below_single), is_scan ? "" : at(result.below_scan),
                          readable(curves.bytes.back()), readable(curves.moved.back()),
                          readable(curves.distances.back()),
                          readable(result.drive.matches > 0 ? result.drive.kept / result.drive.matches : 1),
                          std::to_string(result.drive.wrong) + " / " + std::to_string(result.drive.checked)});
  }
  report.add(table);
}

void add_figures(example::Report& report, const Study& study) {
  const Result& best = study.results[study.best];
  const double gain = cairn::median(study.gains);
  const auto [least, most] = std::ranges::minmax(study.gains);
  report.figure({.label = study.stream.name + ": single tree / best forest",
                 .value = readable(gain, 2),
                 .unit = "x",
                 .hint = readable(least, 3) + " to " + readable(most, 3) + " in " +
                         std::to_string(study.gains.size()) + " runs. " + best.drive.name +
                         ", all steps to n = " + readable(study.grid.back()) + " together",
                 .verdict = least > 1  ? example::KeyFigure::Verdict::good
                            : most < 1 ? example::KeyFigure::Verdict::bad
                                       : example::KeyFigure::Verdict::none});
}

}  // namespace

example::Report make_report(const std::vector<Study>& studies, const std::vector<RecallStudy>& recalls,
                            const std::string& subtitle) {
  example::Report report(
      studies.empty() ? "Recall against time" : "Single tree against multi-kd-tree, and recall against time",
      subtitle);
  std::size_t wrong = 0;
  std::size_t checked = 0;
  for (const Study& study : studies) {
    add_figures(report, study);
    for (const Result& result : study.results) {
      wrong += result.drive.wrong;
      checked += result.drive.checked;
    }
  }
  for (const RecallStudy& study : recalls) add_recall(report, study);
  if (studies.empty()) return report;
  report.figure(
      {.label = "wrong answers",
       .value = std::to_string(wrong),
       .unit = "of " + std::to_string(checked),
       .hint = "against distances summed in double",
       .verdict = wrong == 0 ? example::KeyFigure::Verdict::good : example::KeyFigure::Verdict::bad});
  report.note(
      "n: points there are; m: points that one step inserts. A forest's first tree holds n1 = z m points, "
      "each "
      "further one q times as many as the one before; full trees are merged into the next.");
  report.note(
      "Times are CPU times of one thread. The single tree and the scan are timed whenever n has grown "
      "by a twentieth; each of these steps stands for those before it. Costs a step are means over the steps "
      "since n / 2.");
  for (const Study& study : studies) {
    add_panels(report, study);
    add_table(report, study);
  }
  return report;
}

std::string to_csv(const std::vector<Study>& studies) {
  std::ostringstream out;
  out.precision(9);
  out << "stream,store,n,build_s,search_s,worst_step_s,total_s,bytes_per_point,moved_per_point,distances_per_"
         "query,"
         "trees\n";
  for (const Study& study : studies)
    for (const Result& result : study.results)
      for (std::size_t i = 0; i < study.grid.size(); ++i) {
        const Curves& c = result.curves;
        out << study.stream.name << ',' << '"' << result.drive.name << '"' << ',' << study.grid[i];
        for (const double value : {c.build[i], c.search[i], c.worst[i], c.total[i], c.bytes[i], c.moved[i],
                                   c.distances[i], c.trees[i]})
          if (std::isfinite(value))
            out << ',' << value;
          else
            out << ',';
        out << '\n';
      }
  return out.str();
}

std::string to_json(const std::vector<Study>& studies) {
  using Json = nlohmann::ordered_json;
  const auto or_null = [](const std::optional<double>& n) { return n ? Json(*n) : Json(); };
  Json json = Json::array();
  for (const Study& study : studies) {
    Json stores = Json::array();
    for (const Result& result : study.results)
      stores.push_back({{"store", result.drive.name},
                        {"q", result.drive.growth},
                        {"z", result.drive.first_steps},
                        {"total_s", result.curves.total.back()},
                        {"worst_step_s", result.curves.worst.back()},
                        {"worst_insertion_s", result.worst_build},
                        {"build_exponent", result.build.measured},
                        {"build_exponent_theory", result.build.theory},
                        {"search_exponent", result.search.measured},
                        {"search_exponent_theory", result.search.theory},
                        {"cheaper_than_single_from", or_null(result.below_single)},
                        {"cheaper_than_scan_from", or_null(result.below_scan)},
                        {"bytes_per_point", result.curves.bytes.back()},
                        {"moved_per_point", result.curves.moved.back()},
                        {"distances_per_query", result.curves.distances.back()},
                        {"checked", result.drive.checked},
                        {"wrong", result.drive.wrong},
                        {"matches", result.drive.matches},
                        {"matches_kept", result.drive.kept}});
    json.push_back({{"stream", study.stream.name},
                    {"points", study.grid.back()},
                    {"inserted_a_step", study.stream.step},
                    {"queries_a_step", study.stream.queries},
                    {"single_tree_over_best_forest", study.gains},
                    {"stores", stores}});
  }
  return json.dump(2) + "\n";
}

}  // namespace cairn_study
