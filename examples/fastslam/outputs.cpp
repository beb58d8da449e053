// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>

#include "scores.hpp"
#include "support/report.hpp"
#include "support/result_folder.hpp"

namespace fastslam {

namespace {

using cairn::Vector;
using example::Ink;
using example::readable;
using Json = nlohmann::ordered_json;

example::ResultFolder results_in(const std::filesystem::path& folder) {
  return {folder, {"trajectory.txt", "landmarks.csv", "summary.json", "report.html", "timing.json"}};
}

/// Numbers with blanks, or what else, between them and a line end.
template <std::size_t N>
void append_line(std::string& text, const double (&numbers)[N], char between) {
  for (const double& n : numbers) {
    if (&n != numbers) text += between;
    cairn::append_number(text, n);
  }
  text += '\n';
}

/// The TUM format: time x y z qx qy qz qw.
std::string tum(const std::vector<cairn::StampedPose2>& path) {
  std::string text;
  for (const cairn::StampedPose2& p : path)
    append_line(
        text,
        {p.time, p.pose.x(), p.pose.y(), 0, 0, 0, std::sin(p.pose.angle() / 2), std::cos(p.pose.angle() / 2)},
        ' ');
  return text;
}

std::string csv(const std::vector<FoundLandmark>& landmarks) {
  std::string text = "number,x_m,y_m,xx_m2,xy_m2,yy_m2,sightings,log_odds\n";
  for (const FoundLandmark& l : landmarks)
    append_line(
        text,
        {static_cast<double>(l.number), l.belief.mean(0), l.belief.mean(1), l.belief.covariance(0, 0),
         l.belief.covariance(0, 1), l.belief.covariance(1, 1), static_cast<double>(l.sightings), l.log_odds},
        ',');
  return text;
}

Json json_of(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}
const char* name_of(ProposalKind kind) {
  return kind == ProposalKind::motion ? "motion" : "landmarks";
}

/// Puts what is drawn into the frame of the truth, where that is known.
cairn::SE2 into_truth(const Results& r) {
  if (r.truth.empty()) return {};
  std::vector<Vector<2>> is = places_of(r.truth), path = places_of(r.mean);
  path.erase(path.begin(), path.end() - static_cast<std::ptrdiff_t>(std::min(path.size(), is.size())));
  return rigid_fit(path, is);
}

example::PlaneCurve curve_of(std::string name, Ink ink, const std::vector<Vector<2>>& places,
                             const cairn::SE2& T, bool dots = false) {
  // More points than a page has pixels only make it slow.
  const std::size_t every = dots ? 1 : std::max<std::size_t>(1, places.size() / 4000);
  example::PlaneCurve curve{.name = std::move(name), .ink = ink, .dots = dots};
  for (std::size_t k = 0; k < places.size(); k += every) {
    const Vector<2> p = T * places[k];
    curve.x.push_back(p(0));
    curve.y.push_back(p(1));
  }
  return curve;
}

/// Two standard deviations around every landmark, one line with gaps.
example::PlaneCurve ellipses(const std::vector<FoundLandmark>& landmarks, const cairn::SE2& T) {
  example::PlaneCurve curve{.name = "landmarks, 2 sigma", .ink = Ink::teal};
  for (const FoundLandmark& l : landmarks) {
    const auto& p = l.belief.covariance;
    const double a = std::sqrt(p(0, 0)), b = p(0, 1) / a, c = std::sqrt(std::max(0.0, p(1, 1) - b * b));
    for (int k = 0; k <= 24; ++k) {
      const double angle = 2 * std::numbers::pi * k / 24, u = 2 * std::cos(angle), v = 2 * std::sin(angle);
      const Vector<2> at = T * Vector<2>(l.belief.mean + Vector<2>(a * u, b * u + c * v));
      curve.x.push_back(at(0));
      curve.y.push_back(at(1));
    }
    curve.x.push_back(std::nan(""));
    curve.y.push_back(std::nan(""));
  }
  return curve;
}

void add_map(example::Report& page, const Results& r) {
  const cairn::SE2 T = into_truth(r);
  const auto odometry = places_of(r.odometry);
  const bool drifts_far = r.odometry_error && r.path_error && *r.odometry_error > 100 * *r.path_error;
  example::PlanePlot plot{
      .title = "Path and landmarks",
      .caption =
          "The particles' mean path and the best particle's landmarks with ellipses of two standard "
          "deviations" +
          std::string(r.truth.empty() ? ", where the robot began."
                      : r.T_truth_landmarks
                          ? ", each moved rigidly onto its own truth: the mean of many paths and the map of "
                            "one particle have no frame in common."
                          : ", moved rigidly onto the truth."),
      .x = {"x", "m"},
      .y = {"y", "m"},
      .curves = {},
      .wide = true};
  if (!drifts_far && r.odometry.size() == r.mean.size()) {
    cairn::SE2 fit = T;
    if (!r.truth.empty()) {
      const auto is = places_of(r.truth);
      std::vector<Vector<2>> last(odometry.end() - static_cast<std::ptrdiff_t>(is.size()), odometry.end());
      fit = rigid_fit(last, is);
    }
    plot.curves.push_back(curve_of("odometry", Ink::grey, odometry, fit));
  }
  if (!r.truth.empty()) plot.curves.push_back(curve_of("truth", Ink::truth, places_of(r.truth), {}));
  if (!r.gps.empty()) {
    plot.curves.push_back(curve_of("GPS", Ink::measurement, r.gps, T, true));
    plot.caption +=
        " GPS, which was not used, is moved rigidly onto the path: half of its fixes are within " +
        readable(*r.gps_median) +
        " m of the part of it where the wheels had turned as far. The receiver jumps, and was out for "
        "a part of the way.";
  }
  plot.curves.push_back(curve_of("path", Ink::belief, places_of(r.mean), T));
  if (!r.true_landmarks.empty())
    plot.curves.push_back(curve_of("true landmarks", Ink::truth, r.true_landmarks, {}, true));
  plot.curves.push_back(ellipses(r.landmarks, r.T_truth_landmarks.value_or(T)));
  page.add(plot);
}

void add_steps(example::Report& page, const Results& r) {
  std::vector<double> time, size, landmarks, seen, sigma, redrawn;
  for (const StepRecord& s : r.steps) {
    redrawn.push_back(s.redrawn.value_or(std::nan("")));
    time.push_back(s.time - r.steps.front().time);
    size.push_back(s.effective_size);
    landmarks.push_back(static_cast<double>(s.landmarks));
    seen.push_back(static_cast<double>(s.sightings));
    sigma.push_back(std::sqrt(s.pose.covariance(0, 0) + s.pose.covariance(1, 1)));
  }
  page.add(example::LinePlot{
      .title = "Effective number of particles",
      .caption = "1 / sum of the squared weights, before resampling; and of the paths "
                 "where all were drawn again.",
      .x = {"time", "s"},
      .y = {"N_eff", ""},
      .x_values = time,
      .curves = {{"N_eff", Ink::belief, size},
                 {.name = "drawn again", .ink = Ink::violet, .values = redrawn, .dots = true}}});
  page.add(example::LinePlot{
      .title = "Landmarks",
      .caption = "In the map of one particle, and how many were seen at once.",
      .x = {"time", "s"},
      .y = {"number", ""},
      .x_values = time,
      .curves = {{"in the map", Ink::belief, landmarks}, {"seen", Ink::measurement, seen}}});
  page.add(example::LinePlot{
      .title = "Spread of the newest pose",
      .caption =
          "Standard deviation of the position over all particles, in the frame in which the robot began.",
      .x = {"time", "s"},
      .y = {"sigma", "m"},
      .x_values = time,
      .curves = {{"position", Ink::belief, sigma}},
      .logarithmic = true});
}

/// A line from each of the paths to the next, with gaps.
example::PlaneCurve together(const std::string& name, Ink ink,
                             const std::vector<std::vector<Vector<2>>>& paths, const cairn::SE2& T) {
  example::PlaneCurve all{.name = name, .ink = ink};
  for (const auto& path : paths) {
    const example::PlaneCurve one = curve_of(name, ink, path, T);
    all.x.insert(all.x.end(), one.x.begin(), one.x.end());
    all.y.insert(all.y.end(), one.y.begin(), one.y.end());
    all.x.push_back(std::nan(""));
    all.y.push_back(std::nan(""));
  }
  return all;
}

void add_film(example::Report& page, const Results& r) {
  if (r.snapshots.empty()) return;
  const cairn::SE2 T = into_truth(r);
  example::PlaneFilm film{
      .title = "Particles and their landmarks over time",
      .caption =
          "The paths of a dozen particles, and the best one's landmarks with ellipses of two standard "
          "deviations. " +
          std::string(
              std::ranges::any_of(r.steps, [](const StepRecord& s) { return s.redrawn.has_value(); })
                  ? "When too few ancestors are left all paths are drawn again: where they fan out far "
                    "back it is by what the log leaves open. Where they lie on each other only one has "
                    "descendants yet."
                  : "A little while back the paths lie on each other: all particles but one have died "
                    "out there, and the filter has made up its mind.") +
          std::string(r.truth.empty()
                          ? ""
                          : " All are moved by the one rigid motion that lays the mean path on the "
                            "truth; a single particle may lie turned against it."),
      .x = {"x", "m"},
      .y = {"y", "m"},
      .slider = {"time", "s"},
      .wide = true};
  if (!r.true_landmarks.empty())
    film.still.push_back(curve_of("true landmarks", Ink::truth, r.true_landmarks, {}, true));
  for (const Snapshot& s : r.snapshots)
    film.frames.push_back(
        {s.time - r.steps.front().time,
         std::to_string(s.landmarks.size()) + " landmarks",
         {together("particles", Ink::violet, s.paths, T),
          together("best particle", Ink::belief, {s.paths.front()}, T), ellipses(s.landmarks, T)}});
  page.add(film);
}

}  // namespace

std::string summary(const Results& r) {
  Json json;
  json["log"] = r.name;
  json["seed"] = r.seed;
  json["particles"] = r.particles;
  json["proposal"] = name_of(r.proposal);
  json["identities"] = r.identities_known ? "known" : "withheld";
  json["frames"] = r.steps.size();
  json["resampled"] = std::ranges::count_if(r.steps, &StepRecord::resampled);
  json["landmarks"] = r.landmarks.size();
  json["true_landmarks"] = r.true_landmarks.size();
  json["path_rms_m"] = json_of(r.path_error);
  json["odometry_rms_m"] = json_of(r.odometry_error);
  json["landmarks_rms_m"] = json_of(r.landmark_error);
  json["pose_nees_median"] = json_of(r.median_nees);
  json["gps_median_m"] = json_of(r.gps_median);
  json["notes"] = r.notes;
  json["ended_early"] = r.ended_early ? Json(*r.ended_early) : Json(nullptr);
  return json.dump(2) + "\n";
}

std::optional<std::string> report(const Results& r) {
  example::Report page("FastSLAM", r.name + ", " + std::to_string(r.particles) + " particles, seed " +
                                       std::to_string(r.seed) + ", identities " +
                                       (r.identities_known ? "known" : "withheld"));
  if (r.ended_early) page.note(*r.ended_early);
  for (const std::string& note : r.notes) page.note(note);
  page.figure({"Frames", std::to_string(r.steps.size())});
  page.figure({"Landmarks", std::to_string(r.landmarks.size()), "", "of the best particle"});
  if (r.path_error)
    page.figure({"Path", readable(*r.path_error), "m",
                 "root mean square after a rigid fit; odometry " + readable(*r.odometry_error) + " m"});
  if (r.median_nees)
    page.figure({"NEES", readable(*r.median_nees), "",
                 "of the pose, median of the frames; 2.4 where its covariance is right"});
  if (r.landmark_error)
    page.figure({"Landmarks' error", readable(*r.landmark_error), "m",
                 "root mean square after a rigid fit of their own"});
  add_map(page, r);
  add_film(page, r);
  add_steps(page, r);
  return page.html();
}

void prepare_folder(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& besides) {
  results_in(folder).prepare(besides);
}

std::optional<std::string> write_outputs(const Results& r, const std::filesystem::path& folder) {
  const std::optional<std::string> page = report(r);
  const Json timing{{"threads", r.threads},
                    {"seconds", r.seconds},
                    {"cpu_seconds", r.cpu_seconds},
                    {"node_copies", r.node_copies}};
  results_in(folder).replace([&](const std::filesystem::path& staging) {
    cairn::write_file_atomically(staging / "trajectory.txt", tum(r.mean));
    cairn::write_file_atomically(staging / "landmarks.csv", csv(r.landmarks));
    cairn::write_file_atomically(staging / "summary.json", summary(r));
    cairn::write_file_atomically(staging / "timing.json", timing.dump(2) + "\n");
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace fastslam
