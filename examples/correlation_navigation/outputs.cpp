// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>

#include "support/image_io.hpp"
#include "support/report.hpp"
#include "support/result_folder.hpp"

namespace correlation_navigation {

namespace {

using example::Ink;
using example::readable;

struct StateName {
  const char* symbol;
  const char* title;
  const char* unit;
  double factor;  // from SI to the unit shown
  const char* caption;
};
constexpr std::array<StateName, 5> state_names{
    {{"x", "Position along track", "m", 1,
      "Straight flight over a Gaussian random field, x is the way along it: the errors made, what the filter "
      "says of them, and the Cramer-Rao bound, which no unbiased estimator can go below. Frames are 30 m a "
      "sample."},
     {"V", "Velocity", "m/s", 1,
      "The ground speed V is not measured, but frames at different times tell it: its error falls faster "
      "than "
      "the position's."},
     {"L_x", "Scale along track", "m", 1,
      "L_x is the true distance between two samples, 30 m nominal: height above ground is not known "
      "exactly."},
     {"L_y", "Scale across track", "m", 1, "L_y, the same across track."},
     {"psi", "Heading error", "deg", 180 / std::numbers::pi,
      "psi is the angle between the sensor's axis and the track; wide frames see it well."}}};

std::vector<double> scaled(std::vector<double> values, double factor) {
  for (double& value : values) value *= factor;
  return values;
}

std::vector<double> sizes(std::vector<double> values) {
  for (double& value : values) value = std::abs(value);
  return values;
}

/// The words ", 95 % within 1.0 to 1.2"; none for an interval that is not known.
std::string interval(const cairn::ConsistencyBand& of, double factor = 1) {
  if (!(of.high > 0)) return "";
  return ", 95 % within " + readable(factor * of.low, 3) + " to " + readable(factor * of.high, 3);
}

/// 95 % of a share of so many trials (E. Wilson, "Probable inference, the law of succession, and statistical
/// inference", J. Am. Stat. Assoc. 22, 1927).
cairn::ConsistencyBand share_interval(double share, std::size_t trials) {
  if (trials == 0) return {};
  const double n = static_cast<double>(trials), z2 = 1.96 * 1.96;
  const double middle = share + z2 / (2 * n);
  const double reach = std::sqrt(z2 * (share * (1 - share) / n + z2 / (4 * n * n)));
  return {std::max(0.0, (middle - reach) / (1 + z2 / n)), std::min(1.0, (middle + reach) / (1 + z2 / n))};
}

void add_straight(example::Report& page, const Results& r) {
  for (std::size_t i = 0; i < state_names.size(); ++i) {
    const StateName& name = state_names[i];
    page.add(example::LinePlot{
        .title = name.title,
        .caption = name.caption,
        .x = {"time", "s"},
        .y = {std::string("error of ") + name.symbol, name.unit},
        .x_values = r.straight.time,
        .curves = {{"made, rms of all runs", Ink::wrong, scaled(r.straight.rms_error[i], name.factor)},
                   {"made in one run, absolute", Ink::grey,
                    scaled(sizes(r.straight.one_run[i]), name.factor)},
                   {"predicted by the filter", Ink::belief, scaled(r.straight.sigma[i], name.factor)},
                   {"Cramer-Rao bound", Ink::truth, scaled(r.straight.bound[i], name.factor), true}},
        .logarithmic = true});
  }
  const std::vector<double> low(r.straight.time.size(), r.straight.nees_band.low);
  const std::vector<double> high(r.straight.time.size(), r.straight.nees_band.high);
  page.add(example::LinePlot{
      .title = "Does the filter know its errors?",
      .caption = "Squared error of all five states in the filter's own covariance (NEES), mean over the "
                 "runs: 5 when "
                 "the filter is honest, more when it believes too much. The dashed lines hold 95 % of honest "
                 "filters. The map's error, which neighbouring samples share, is in the filter's weights.",
      .x = {"time", "s"},
      .y = {"NEES", ""},
      .x_values = r.straight.time,
      .curves = {{"mean over the runs", Ink::belief, r.straight.nees},
                 {"95 % band", Ink::grey, low, true},
                 {"95 % band, upper end", Ink::grey, high, true}}});
  example::Table budget{
      .title = "What limits the position",
      .caption =
          "Position sigma at the end of the flight for errors of sensor and map (in units of the "
          "field). The map's error dominates as soon as it is half the sensor's: its samples err "
          "together and do not average out. Hence the loop below.",
      .columns = {"sensor error", "map error", "position sigma [m]"}};
  for (const BudgetRow& row : r.budget)
    budget.rows.push_back({readable(row.sensor_noise), readable(row.map_error), readable(row.final_sigma)});
  page.add(budget);
  example::Table lost{
      .title = "How far off may the start be?",
      .caption = "Share of runs lost after five frames, by the initial error in correlation lengths.",
      .columns = {"initial error", "extended filter", "iterated filter", "search first"}};
  for (const DivergenceRow& row : r.divergence)
    lost.rows.push_back(
        {readable(row.start), readable(row.extended), readable(row.iterated), readable(row.searched)});
  page.add(lost);
}

void add_acquisition(example::Report& page, const AcquisitionResult& r, const std::string& field) {
  example::PlaneCurve right{"right", Ink::belief, {}, {}, true}, refused{"refused", Ink::grey, {}, {}, true},
      wrong{"accepted, wrong", Ink::wrong, {}, {}, true};
  for (const AcquisitionTrial& t : r.trials) {
    example::PlaneCurve& curve = !t.fix.accepted() ? refused : t.error <= r.right_within ? right : wrong;
    curve.x.push_back(t.truth_x);
    curve.y.push_back(t.truth_y);
  }
  page.add(example::PlanePlot{
      .title = "Acquisition within 2 km",
      .caption =
          "Each start was known to 2 km only. A frame that could lie at several places is refused, and the "
          "next frame ahead is searched for; a dot marks the last one. At the first frame " +
          readable(100 * r.first_rate) + " % were found. Field: " + field,
      .x = {"east", "m"},
      .y = {"north", "m"},
      .curves = {right, refused, wrong}});
}

void add_planar(example::Report& page, const PlanarResult& r) {
  example::PlaneCurve truth{"truth", Ink::truth, {}, {}, false}, belief{"belief", Ink::belief, {}, {}, true},
      searched{"correlation search", Ink::measurement, {}, {}, true};
  std::vector<double> time, error, three_sigma, blind;
  for (const PlanarPoint& p : r.points) {
    truth.x.push_back(p.truth_x);
    truth.y.push_back(p.truth_y);
    belief.x.push_back(p.x);
    belief.y.push_back(p.y);
    if (p.searched) {
      searched.x.push_back(p.x);
      searched.y.push_back(p.y);
    }
    time.push_back(p.time);
    error.push_back(p.error);
    three_sigma.push_back(3.0 * p.sigma);
  }
  page.add(example::PlanePlot{
      .title = "A flight with turns",
      .caption =
          "The start is known to 2 km: a correlation search finds it, the filter tracks through the turns. "
          "Then the sensor is blind while a gust carries the vehicle off: what it believes (orange, for it "
          "searches at every frame) leaves the black line, until a search finds it again.",
      .x = {"east", "m"},
      .y = {"north", "m"},
      .curves = {truth, belief, searched}});
  page.add(example::LinePlot{
      .title = "Error of that flight",
      .caption = "While the sensor is blind the error grows, and the filter says so; the new fix ends it.",
      .x = {"time", "s"},
      .y = {"position error", "m"},
      .x_values = time,
      .curves = {{"error", Ink::wrong, error}, {"3 sigma", Ink::belief, three_sigma, true}},
      .logarithmic = true});
}

#ifdef EXAMPLES_HAVE_PNG
/// Columns and rows of a grid, ends excluded.
struct Window {
  int left = std::numeric_limits<int>::max(), right = 0, bottom = left, top = 0;

  /// Takes in what is not void.
  void widen(const cairn::FieldGrid& grid) {
    for (int r = 0; r < grid.rows(); ++r)
      for (int c = 0; c < grid.columns(); ++c)
        if (!std::isnan(grid(c, r))) {
          left = std::min(left, c);
          right = std::max(right, c + 1);
          bottom = std::min(bottom, r);
          top = std::max(top, r + 1);
        }
  }
};

/// The two errors side by side, north up: the darker, the larger; white where nothing was mapped.
void add_map_error(example::Report& page, const LoopResult& loop) {
  constexpr int gap = 8;
  Window window;
  window.widen(*loop.map_error_before);
  window.widen(*loop.map_error_after);
  const int width = window.right - window.left;
  cairn::Image image(2 * width + gap, window.top - window.bottom, 255);
  int shift = -window.left;
  for (const cairn::FieldGrid* error : {&*loop.map_error_before, &*loop.map_error_after}) {
    for (int r = window.bottom; r < window.top; ++r)
      for (int c = window.left; c < window.right; ++c) {
        const double size = std::abs((*error)(c, r)) / loop.field_deviation;
        if (!std::isnan(size))
          image(shift + c, window.top - 1 - r) = static_cast<std::uint8_t>(225 * (1 - std::min(1.0, size)));
      }
    shift += width + gap;
  }
  page.add(example::Picture{
      .title = "Error of the map, before and after",
      .caption =
          "Map less field at every node that was seen, by dead reckoning (left) and corrected (right). "
          "Light grey is no error, black one standard deviation of the field or more, white was not "
          "mapped.",
      .png = example::png_bytes(image),
      .width = image.width(),
      .height = image.height(),
      .wide = true});
}
#endif

void add_loop(example::Report& page, const LoopResult& r) {
  example::PlaneCurve truth{"truth", Ink::truth, {}, {}, false},
      before{"dead reckoning", Ink::wrong, {}, {}, false}, after{"corrected", Ink::belief, {}, {}, false};
  std::vector<double> time, error_before, error_after, sigma_after;
  for (const LoopFrame& f : r.frames) {
    truth.x.push_back(f.truth_x);
    truth.y.push_back(f.truth_y);
    before.x.push_back(f.before_x);
    before.y.push_back(f.before_y);
    after.x.push_back(f.after_x);
    after.y.push_back(f.after_y);
    time.push_back(f.time);
    error_before.push_back(std::hypot(f.before_x - f.truth_x, f.before_y - f.truth_y));
    error_after.push_back(std::hypot(f.after_x - f.truth_x, f.after_y - f.truth_y));
    sigma_after.push_back(f.sigma_after);
  }
  page.add(example::PlanePlot{
      .title = "Mapping along a loop",
      .caption =
          "An unknown field is mapped while dead reckoning drifts. Back at the start the first frames are "
          "recognised by correlation, and as the drift's covariances are known, one fix corrects every frame "
          "of the loop.",
      .x = {"east", "m"},
      .y = {"north", "m"},
      .curves = {truth, before, after}});
  page.add(example::LinePlot{
      .title = "Where the map's frames lie",
      .caption = "How far each frame of the loop is put from where it was seen. Map against field, rms: " +
                 readable(r.map_rms_before) + " before, " + readable(r.map_rms_after) +
                 " after; the field itself varies by " + readable(r.field_deviation) + ".",
      .x = {"time", "s"},
      .y = {"distance from the truth", "m"},
      .x_values = time,
      .curves = {{"dead reckoning", Ink::wrong, error_before},
                 {"corrected", Ink::belief, error_after},
                 {"predicted sigma after", Ink::grey, sigma_after, true}}});
#ifdef EXAMPLES_HAVE_PNG
  if (r.field_deviation > 0) add_map_error(page, r);
#endif
}

example::ResultFolder results_in(const std::filesystem::path& folder) {
  return {folder, {"summary.json", "errors.csv", "timing.json", "report.html"}};
}

}  // namespace

std::string errors_csv(const StraightResult& result) {
  std::vector<std::string> names{"time"};
  std::vector<const std::vector<double>*> columns{&result.time};
  for (std::size_t i = 0; i < state_names.size(); ++i) {
    for (const char* kind : {"_rms", "_sigma", "_bound"})
      names.push_back(std::string(state_names[i].symbol) + kind);
    for (const auto* of : {&result.rms_error[i], &result.sigma[i], &result.bound[i]}) columns.push_back(of);
  }
  names.emplace_back("nees");
  columns.push_back(&result.nees);
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ",") + name;
  text += '\n';
  for (std::size_t k = 0; k < result.time.size(); ++k)
    for (std::size_t column = 0; column < columns.size(); ++column) {
      const double value = (*columns[column])[k];
      if (!std::isfinite(value))
        cairn::raise("errors.csv: not written, " + names[column] + " of row " + std::to_string(k + 1) +
                     " is not finite");
      cairn::append_number(text, value);
      text += column + 1 < columns.size() ? ',' : '\n';
    }
  return text;
}

std::string summary(const Results& r) {
  using Json = nlohmann::ordered_json;
  // A figure of an experiment, null where that was not made or had nothing to measure.
  const auto figure = [](const auto& result, bool measured, auto member) {
    return result && measured ? Json((*result).*member) : Json(nullptr);
  };
  const bool any_acquired = r.acquisition && r.acquisition->rate > 0;
  Json json;
  json["field"] = r.field;
  json["notes"] = r.notes;
  json["seed"] = r.seed;
  json["runs"] = r.runs;
  json["ended_early"] = r.ended_early ? Json(*r.ended_early) : Json(nullptr);
  json["acquisition_rate"] = figure(r.acquisition, true, &AcquisitionResult::rate);
  json["acquisition_first_frame_rate"] = figure(r.acquisition, true, &AcquisitionResult::first_rate);
  json["acquisition_wrong_rate"] = figure(r.acquisition, true, &AcquisitionResult::wrong_rate);
  json["acquisition_rms_error_m"] = figure(r.acquisition, any_acquired, &AcquisitionResult::rms_error);
  json["rms_position_error_m"] = r.straight.rms_position_error;
  json["max_position_error_m"] = r.straight.max_position_error;
  json["rmse_over_crb"] = r.straight.rmse_over_bound;
  json["nees_mean"] = r.straight.nees_mean;
  json["nees_band"] = {r.straight.nees_band.low, r.straight.nees_band.high};
  json["divergence_rate"] = nlohmann::ordered_json::array();
  for (const DivergenceRow& row : r.divergence)
    json["divergence_rate"].push_back({{"initial_error_over_correlation_length", row.start},
                                       {"extended", row.extended},
                                       {"iterated", row.iterated},
                                       {"search_first", row.searched}});
  json["error_budget"] = nlohmann::ordered_json::array();
  for (const BudgetRow& row : r.budget)
    json["error_budget"].push_back({{"sensor_noise", row.sensor_noise},
                                    {"map_error", row.map_error},
                                    {"final_position_sigma_m", row.final_sigma}});
  json["planar"] = nullptr;
  if (r.planar) {
    const bool tracked = r.planar->frames_tracked > 0;
    json["planar"] = {{"rms_position_error_m", figure(r.planar, tracked, &PlanarResult::rms_error)},
                      {"max_position_error_m", figure(r.planar, tracked, &PlanarResult::max_error)},
                      {"frames", r.planar->points.size()},
                      {"frames_tracked", r.planar->frames_tracked},
                      {"searches", r.planar->searches},
                      {"reacquired", r.planar->reacquired}};
  }
  json["loop"] = nullptr;
  if (r.loop)
    json["loop"] = {{"closed", r.loop->closed},
                    {"closing_error_m", figure(r.loop, r.loop->closed, &LoopResult::closing_error)},
                    {"placement_rms_before_m", r.loop->placement_rms_before},
                    {"placement_rms_after_m", r.loop->placement_rms_after},
                    {"map_rms_before", r.loop->map_rms_before},
                    {"map_rms_after", r.loop->map_rms_after},
                    {"field_deviation", r.loop->field_deviation}};
  return json.dump(2) + "\n";
}

std::string timing(const Results& r) {
  nlohmann::ordered_json json;
  double sum = 0;
  for (const auto& [name, seconds] : r.seconds) sum += seconds;
  json["threads"] = r.threads;
  json["seconds"] = sum;
  for (const auto& [name, seconds] : r.seconds) json["experiment_seconds"][name] = seconds;
  return json.dump(2) + "\n";
}

std::optional<std::string> report(const Results& r) {
  example::Report page("Correlation navigation", "position from a mapped field, " + std::to_string(r.runs) +
                                                     " runs; field of "
                                                     "the flights: " +
                                                     r.field);
  using Verdict = example::KeyFigure::Verdict;
  const auto judged = [](bool good) { return good ? Verdict::good : Verdict::bad; };
  page.figure({"Position RMSE / Cramer-Rao bound", readable(r.straight.rmse_over_bound, 4), "",
               "straight flight, second half" + interval(r.straight.rmse_over_bound_interval),
               judged(r.straight.rmse_over_bound <= 1.2)});
  page.figure({"NEES, 5 states", readable(r.straight.nees_mean), "",
               "band " + readable(r.straight.nees_band.low) + " to " + readable(r.straight.nees_band.high),
               judged(r.straight.nees_band.contains(r.straight.nees_mean))});
  if (r.acquisition)
    page.figure({"Acquired within 2 km", readable(100 * r.acquisition->rate), "%",
                 std::to_string(r.acquisition->trials.size()) + " starts" +
                     interval(share_interval(r.acquisition->rate, r.acquisition->trials.size()), 100) +
                     "; at the first frame " + readable(100 * r.acquisition->first_rate) + " %; wrong " +
                     readable(100 * r.acquisition->wrong_rate) + " %",
                 judged(r.acquisition->rate >= 0.95 && r.acquisition->wrong_rate == 0)});
  if (r.planar)
    page.figure({"Flight with turns, rms error",
                 r.planar->frames_tracked > 0 ? readable(r.planar->rms_error) : "none", "m",
                 "frames tracked: " + std::to_string(r.planar->frames_tracked),
                 judged(r.planar->reacquired)});
  if (r.loop) {
    page.figure({"Map error before", readable(r.loop->map_rms_before), "", "rms against the field"});
    page.figure({"Map error after the loop", readable(r.loop->map_rms_after), "", "rms against the field",
                 judged(r.loop->map_rms_after < r.loop->map_rms_before)});
  }
  if (r.ended_early) page.note(*r.ended_early);
  for (const std::string& note : r.notes) page.note(note);
  add_straight(page, r);
  if (r.acquisition) add_acquisition(page, *r.acquisition, r.field);
  if (r.planar) add_planar(page, *r.planar);
  if (r.loop) add_loop(page, *r.loop);
  return page.html();
}

void prepare_folder(const std::filesystem::path& folder) {
  results_in(folder).prepare();
}

std::optional<std::string> write_outputs(const Results& results, const std::filesystem::path& folder) {
  const std::optional<std::string> page = report(results);
  results_in(folder).replace([&](const std::filesystem::path& staging) {
    cairn::write_file_atomically(staging / "summary.json", summary(results));
    cairn::write_file_atomically(staging / "errors.csv", errors_csv(results.straight));
    cairn::write_file_atomically(staging / "timing.json", timing(results));
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace correlation_navigation
