// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "run_report.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/statistics.hpp>

#include "support/image_io.hpp"

namespace stereo_slam {
namespace {

using example::Ink;

constexpr double gap = std::numeric_limits<double>::quiet_NaN();

/// One value a frame.
template <class Get>
std::vector<double> over_frames(const RunRecord& run, Get&& get) {
  std::vector<double> values;
  values.reserve(run.frames.size());
  for (const FrameRecord& frame : run.frames) values.push_back(static_cast<double>(get(frame)));
  return values;
}

/// The common axis of all plots over time: seconds since the first frame, or frame numbers where the data
/// set's clock does not run forward.
struct TimeAxis {
  example::Axis axis{"time", "s"};
  std::vector<double> values;
};

TimeAxis time_axis(const RunRecord& run) {
  TimeAxis result;
  const double start = run.frames.front().time;
  result.values = over_frames(run, [&](const FrameRecord& frame) { return frame.time - start; });
  const bool runs = std::is_sorted(result.values.begin(), result.values.end()) && result.values.back() > 0 &&
                    std::isfinite(result.values.back());
  if (!runs) {
    result.axis = {"frame", ""};
    for (std::size_t i = 0; i < result.values.size(); ++i) result.values[i] = static_cast<double>(i);
  }
  return result;
}

/// From the first camera's axes (x right, y down, z ahead) to the report's (x right, y ahead, z up).
std::array<float, 3> upright(const cairn::Vector<3>& p) {
  return {static_cast<float>(p(0)), static_cast<float>(p(2)), static_cast<float>(-p(1))};
}

void add_figures(example::Report& report, const RunRecord& run, const Summary& summary) {
  using Verdict = example::KeyFigure::Verdict;
  using example::readable;
  const auto length = [&](const char* name, double metres, std::string note) {
    auto [value, unit] = example::readable_length(metres);
    report.figure({name, std::move(value), std::move(unit), std::move(note)});
  };
  report.figure({"frames tracked", std::to_string(summary.frames_tracked),
                 "of " + std::to_string(summary.frames),
                 summary.frames_lost == 0 ? "none lost" : std::to_string(summary.frames_lost) + " lost",
                 summary.frames_lost == 0 ? Verdict::good : Verdict::bad});
  if (summary.frames_carried > 0)
    report.figure({"frames carried", std::to_string(summary.frames_carried), "of the lost",
                   "their pose is where the motion leads"});
  if (summary.frames_bridged > 0)
    report.figure({"frames bridged", std::to_string(summary.frames_bridged), "of the lost",
                   "their pose lies between those before and after"});
  if (summary.budget)
    report.figure({"frames that left work out", std::to_string(summary.budget->frames_shed),
                   "of " + std::to_string(summary.frames),
                   "budget of " + readable(summary.budget->milliseconds) + " ms a frame"});
  length("path", summary.path, "");
  report.figure({"landmarks", std::to_string(summary.landmarks), "", "in the map at the end"});
  report.figure({"keyframes", std::to_string(summary.keyframes), "", "in the map at the end"});
  report.figure({"loops closed", std::to_string(summary.loops_closed), "", "places met again after long"});
  report.figure(
      {"inliers", readable(summary.inliers), "", "points that agree with the pose, median of a frame"});
  if (!summary.errors) return;
  const TruthErrors& errors = *summary.errors;
  const std::string share =
      summary.path > 0 ? readable(100.0 * errors.end / summary.path) + " % of the path" : "";
  length("end error", errors.end, share);
  length("max position error", errors.largest.position,
         run.truth_laid_on_estimate ? "the first pose found coincides" : "the map's first frame coincides");
  report.figure({"max heading error", readable(errors.largest.heading * degrees), "deg",
                 "angle of the whole rotation"});
  length("ATE", errors.ate_rmse, "RMSE of positions, alignment: " + errors.ate_alignment);
  if (errors.kitti_translation_percent)
    report.figure({"KITTI drift", readable(*errors.kitti_translation_percent), "%", "over 100 to 800 m"});
  if (errors.consistency)
    report.figure({"NEES of the pose", readable(errors.consistency->nees_mean), "",
                   "6 where the covariance is right; " + readable(100 * errors.consistency->nees_above_999) +
                       " % of the frames above 22.5"});
  if (errors.revisit)
    length("same place again", errors.revisit->position,
           "largest disagreement of " + std::to_string(errors.revisit->pairs) + " returns");
}

/// The path as it was known while driving and as the map has it at the end, errors drawn so much larger that
/// they can be seen: about the truth, or about the path at the end where there is none.
std::optional<example::PlaneFilm> correction_film(const RunRecord& run, const Summary& summary) {
  if (run.corrected.size() != run.frames.size() || run.frames.size() < 2) return std::nullopt;
  using Place = std::array<double, 2>;
  const auto place = [](const cairn::SE3& T) { return Place{T.translation()(0), T.translation()(2)}; };
  const bool all_true =
      std::ranges::all_of(run.frames, [](const FrameRecord& f) { return f.truth.has_value(); });
  std::vector<Place> about;
  std::array<double, 4> box{gap, gap, gap, gap};
  double largest = 0;
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    const FrameRecord& frame = run.frames[i];
    about.push_back(place(all_true ? *frame.truth : run.corrected[i]));
    for (const cairn::SE3& T : {frame.T_world_camera, run.corrected[i]})
      for (std::size_t k = 0; k < 2; ++k) {
        largest = std::max(largest, std::abs(place(T)[k] - about.back()[k]));
        box[k] = std::fmin(box[k], about.back()[k]);
        box[k + 2] = std::fmax(box[k + 2], about.back()[k]);
      }
  }
  const double extent = std::max(box[2] - box[0], box[3] - box[1]);
  if (!(largest > 1e-9 * extent) || !(extent > 0)) return std::nullopt;
  constexpr double shown = 0.04;  // of the drawing
  const double zoom = std::max(1.0, std::pow(10.0, std::floor(std::log10(shown * extent / largest))));
  const auto curve = [&](double share) {
    example::PlaneCurve path{"estimate", Ink::belief, {}, {}};
    for (std::size_t i = 0; i < run.frames.size(); ++i) {
      const Place before = place(run.frames[i].T_world_camera), after = place(run.corrected[i]);
      const auto at = [&](std::size_t k) {
        return about[i][k] + zoom * ((1 - share) * before[k] + share * after[k] - about[i][k]);
      };
      path.x.push_back(at(0));
      path.y.push_back(at(1));
    }
    return path;
  };
  example::PlaneFilm film{.title = "What meeting places again changed",
                          .caption = "",
                          .x = {"right", "m"},
                          .y = {"ahead", "m"},
                          .slider = {"share of the correction", ""},
                          .still = {},
                          .frames = {}};
  film.caption =
      std::string("Distances from the ") + (all_true ? "truth" : "path at the end") +
      (zoom > 1 ? " are drawn " + example::readable(zoom) + " times as large. " : " as they are. ");
  if (run.loops.empty()) film.caption += "No place was met again after it had been out of view for long.";
  example::PlaneCurve still{
      all_true ? "truth" : "path at the end", all_true ? Ink::truth : Ink::grey, {}, {}};
  for (const Place& one : about) {
    still.x.push_back(one[0]);
    still.y.push_back(one[1]);
  }
  film.still.push_back(std::move(still));
  if (!run.loops.empty()) {
    example::PlaneCurve met{"met again", Ink::measurement, {}, {}, true};
    for (const LoopClosure& loop : run.loops) {
      met.x.push_back(about[loop.frame][0]);
      met.y.push_back(about[loop.frame][1]);
    }
    film.still.push_back(std::move(met));
  }
  constexpr int steps = 10;
  for (int step = 0; step <= steps; ++step) {
    example::PlaneFrame frame{
        static_cast<double>(step) / steps, "", {curve(static_cast<double>(step) / steps)}};
    if (step == 0) {
      frame.caption = "As it was estimated while driving";
      if (summary.path_error)
        frame.caption += ", RMSE " + example::readable_length(summary.path_error->while_driving).words();
    } else if (step == steps) {
      frame.caption = "As the map has it at the end";
      if (summary.path_error)
        frame.caption += ", RMSE " + example::readable_length(summary.path_error->at_the_end).words();
    } else {
      frame.caption = "Between the two";
    }
    film.frames.push_back(std::move(frame));
  }
  return film;
}

std::optional<example::Table> loop_table(const Summary& summary) {
  if (summary.loops.empty()) return std::nullopt;
  example::Table table{.title = "Places met again",
                       .caption =
                           "Pose of the first frame of each return, by the landmarks that were in view "
                           "just before alone and with those that came back.",
                       .columns = {"frame", "landmarks back", "after frames", "moved by [mm]",
                                   "turned by [deg]", "error before [mm]", "error after [mm]"},
                       .rows = {}};
  const auto length = [](double metres) { return example::readable(1e3 * metres); };
  for (const LoopEffect& loop : summary.loops)
    table.rows.push_back({std::to_string(loop.frame), std::to_string(loop.landmarks),
                          std::to_string(loop.away), length(loop.correction.position),
                          example::readable(loop.correction.heading * degrees),
                          loop.before ? length(loop.before->position) : "no truth",
                          loop.after ? length(loop.after->position) : "no truth"});
  return table;
}

example::PlanePlot path_plot(const RunRecord& run) {
  example::PlanePlot plot{.title = "Path from above",
                          .caption = "World of the first camera, which looks towards the top of the page.",
                          .x = {"right", "m"},
                          .y = {"ahead", "m"},
                          .curves = {}};
  example::PlaneCurve truth{"truth", Ink::truth, {}, {}}, belief{"estimate", Ink::belief, {}, {}},
      lost{"not tracked", Ink::wrong, {}, {}, true}, keyframes{"keyframes", Ink::teal, {}, {}, true},
      met{"met again", Ink::measurement, {}, {}, true};
  std::vector<example::PlaneGaussian> known;
  const auto add = [](example::PlaneCurve& curve, const cairn::Vector<3>& place) {
    curve.x.push_back(place(0));
    curve.y.push_back(place(2));
  };
  for (const FrameRecord& frame : run.frames) {
    const cairn::Vector<3>& estimate = frame.T_world_camera.translation();
    add(truth, frame.truth ? frame.truth->translation() : cairn::Vector<3>(gap, gap, gap));
    add(belief, estimate);
    if (!frame.tracked) add(lost, estimate);
    if (frame.keyframe) add(keyframes, estimate);
    if (!frame.tracked || !frame.covariance.allFinite()) continue;
    const cairn::Matrix<3> R = frame.T_world_camera.rotation().matrix();
    const cairn::Matrix<3> spread = R * frame.covariance.topLeftCorner<3, 3>() * R.transpose();
    const std::array<double, 3> flat{spread(0, 0), spread(0, 2), spread(2, 2)};
    if (flat[0] > 0 && flat[0] * flat[2] >= flat[1] * flat[1])  // a page is not lost for one that is none
      known.push_back({{estimate(0), estimate(2)}, flat});
  }
  for (const LoopClosure& loop : run.loops)
    if (loop.frame < run.frames.size()) add(met, run.frames[loop.frame].T_world_camera.translation());
  const bool any_truth = std::any_of(run.frames.begin(), run.frames.end(),
                                     [](const FrameRecord& frame) { return frame.truth.has_value(); });
  if (any_truth)
    plot.curves.push_back(std::move(truth));
  else
    plot.caption += " This data has no truth to compare with.";
  plot.curves.push_back(std::move(belief));
  if (auto [ellipses, scale] = example::spreads_along(known, Ink::violet); !ellipses.x.empty()) {
    plot.caption += " Ellipses: three standard deviations of the pose, drawn " + example::readable(scale) +
                    " times as large, at the first visit of a place.";
    plot.curves.push_back(std::move(ellipses));
  }
  for (example::PlaneCurve* const dots : {&keyframes, &met, &lost})
    if (!dots->x.empty()) plot.curves.push_back(std::move(*dots));
  return plot;
}

/// The error of every frame, in metres or degrees, beside what the covariance claims.
example::LinePlot error_plot(const RunRecord& run, const TimeAxis& time, bool heading) {
  example::LinePlot plot{.title = heading ? "Heading error" : "Position error",
                         .caption = {},
                         .x = time.axis,
                         .y = {"error", heading ? "deg" : "m"},
                         .x_values = time.values,
                         .curves = {}};
  auto error = over_frames(run, [&](const FrameRecord& frame) {
    if (!frame.truth) return gap;
    const FrameError e = frame_error(frame.T_world_camera, *frame.truth);
    return heading ? e.heading * degrees : e.position;
  });
  if (std::none_of(error.begin(), error.end(), [](double e) { return std::isfinite(e); })) {
    plot.caption = "This data has no truth: the error is not known.";
    return plot;
  }
  auto claimed = over_frames(run, [&](const FrameRecord& frame) {
    const int first = heading ? 3 : 0;
    const double variance = frame.covariance.diagonal().segment<3>(first).sum();
    return variance > 0 ? 3.0 * std::sqrt(variance) * (heading ? degrees : 1.0) : gap;
  });
  constexpr double small = 0.01;  // [m]; an axis of millimetres below it
  if (!heading && std::ranges::none_of(error, [](double e) { return e > small; })) {
    plot.y.unit = "mm";
    for (std::vector<double>* const values : {&error, &claimed})
      for (double& value : *values) value *= 1e3;
  }
  plot.caption =
      "Distance from the truth, the first poses coinciding. 3 sigma: three standard deviations of the pose "
      "as "
      "the system states them; the error should stay below.";
  plot.curves = {{"error", Ink::wrong, error, false}, {"3 sigma", Ink::belief, claimed, true}};
  return plot;
}

/// How far the truth is from the estimate in units of what the covariance claims.
example::LinePlot consistency_plot(const RunRecord& run, const TimeAxis& time) {
  example::LinePlot plot{.title = "Does it know how wrong it is?",
                         .caption = {},
                         .x = time.axis,
                         .y = {"NEES", ""},
                         .x_values = time.values,
                         .curves = {}};
  const auto nees = over_frames(run, [](const FrameRecord& frame) { return pose_nees(frame).value_or(gap); });
  if (std::none_of(nees.begin(), nees.end(), [](double e) { return std::isfinite(e); })) {
    plot.caption = "This data has no truth: whether the covariance is right is not known.";
    return plot;
  }
  plot.caption =
      "Error of the pose, squared, over its covariance (6 numbers): 6 on average where the covariance is "
      "right, one frame in a thousand above the line of 99.9 %. Neighbouring frames err together.";
  plot.curves = {
      {"NEES", Ink::belief, nees, false},
      {"expected", Ink::truth, std::vector<double>(nees.size(), 6.0), false},
      {"99.9 %", Ink::wrong, std::vector<double>(nees.size(), cairn::chi_square_quantile(0.999, 6)), true}};
  return plot;
}

/// What the budget left out, kind by kind.
std::optional<example::Table> budget_table(const Summary& summary) {
  if (!summary.budget) return std::nullopt;
  constexpr std::array<const char*, shed_names.size()> meanings{
      "old and twin landmarks were kept for longer, the worth of a loop was not computed",
      "fewer interest points than asked for", "no search for landmarks where they must be",
      "landmarks were where keypoints were found, not where their surface was", "a keyframe was put off"};
  example::Table table{.title = "What the budget left out",
                       .caption = "Missed least first. " + std::to_string(summary.budget->frames_over) +
                                  " frames took longer than the budget all the same.",
                       .columns = {"left out", "frames", "which means"},
                       .rows = {}};
  for (std::size_t kind = 0; kind < shed_names.size(); ++kind)
    table.rows.push_back({shed_names[kind], std::to_string(summary.budget->shed[kind]), meanings[kind]});
  return table;
}

example::LinePlot match_plot(const RunRecord& run, const TimeAxis& time) {
  const auto count = [&](int FrameRecord::* member) {
    return over_frames(run, [&](const FrameRecord& frame) { return frame.*member; });
  };
  return {.title = "Points and matches",
          .caption =
              "Points found in the left image; those of them that the right one shows too; those that are "
              "landmarks of the map; and those that agree with the pose, which rests on them.",
          .x = time.axis,
          .y = {"count", ""},
          .x_values = time.values,
          .curves = {{"in the left image", Ink::grey, count(&FrameRecord::points_left)},
                     {"in both images", Ink::measurement, count(&FrameRecord::stereo_matches)},
                     {"in the map", Ink::teal, count(&FrameRecord::map_matches)},
                     {"agreeing (inliers)", Ink::belief, count(&FrameRecord::inliers)}}};
}

example::LinePlot landmark_plot(const RunRecord& run, const TimeAxis& time) {
  return {.title = "Landmarks",
          .caption = "Kept after each frame, however seldom they were seen.",
          .x = time.axis,
          .y = {"landmarks", ""},
          .x_values = time.values,
          .curves = {{"landmarks", Ink::belief,
                      over_frames(run, [](const FrameRecord& frame) { return frame.landmarks; })}}};
}

example::Cloud map_cloud(const RunRecord& run) {
  example::Cloud cloud{
      .title = "Landmarks and path",
      .caption =
          "The map at the end of the run. Sightings: in how many frames a landmark was seen; age: "
          "how many frames ago it was first seen; sigma: how well its place is known.",
      .unit = "m",
      .points = {},
      .colourings = {{"grey level", "", {}, true},
                     {"sightings", "", {}},
                     {"age", "frames", {}},
                     {"sigma", "m", {}}},
      .curves = {},
      .wide = true};
  for (const LandmarkRecord& landmark : run.landmarks) {
    cloud.points.push_back(upright(landmark.position));
    cloud.colourings[0].values.push_back(landmark.grey);
    cloud.colourings[1].values.push_back(landmark.sightings);
    cloud.colourings[2].values.push_back(landmark.age);
    cloud.colourings[3].values.push_back(std::sqrt(std::max(0.0, landmark.covariance.trace())));
  }
  example::SpaceCurve truth{"truth", Ink::truth, {}}, belief{"estimate", Ink::belief, {}};
  for (const FrameRecord& frame : run.frames) {
    belief.points.push_back(upright(frame.T_world_camera.translation()));
    if (frame.truth) truth.points.push_back(upright(frame.truth->translation()));
  }
  if (!truth.points.empty()) cloud.curves.push_back(std::move(truth));
  cloud.curves.push_back(std::move(belief));
  return cloud;
}

example::Picture sample_picture(const RunRecord& run) {
  example::Picture picture{
      .title = "One frame with its matches", .caption = "No frame was kept.", .png = {}, .marks = {}};
  const std::optional<SampleFrame>& kept = run.newest ? run.newest : run.sample;
  if (!kept || kept->left.empty()) return picture;
  const SampleFrame& sample = *kept;
  picture.caption =
      "Left image of frame " + std::to_string(sample.index) +
      ". Lines lead to where the right image shows a point: of all that do not agree, and of one "
      "of the others in each part of the image.";
  picture.png = example::png_bytes(sample.left);
  picture.width = sample.left.width();
  picture.height = sample.left.height();
  picture.wide = picture.width > 2 * picture.height;
  picture.marks = {{"new", Ink::measurement, {}, {}},
                   {"matched, but not where the pose says", Ink::wrong, {}, {}},
                   {"matched and agreed upon", Ink::belief, {}, {}}};
  const double part = picture.width / 16.0;
  std::set<std::array<int, 3>> drawn;  // part of the image, kind
  for (const SamplePoint& point : sample.points) {
    const auto kind = static_cast<std::size_t>(point.kind);
    example::Marks& marks = picture.marks[kind];
    marks.points.push_back({point.x, point.y});
    const std::array<int, 3> place{static_cast<int>(point.x / part), static_cast<int>(point.y / part),
                                   static_cast<int>(kind)};
    if (marks.ink == Ink::wrong || drawn.insert(place).second)
      marks.segments.push_back({point.x, point.y, point.right_x, point.right_y});
  }
  return picture;
}

std::string subtitle_of(const RunRecord& run, const Summary& summary) {
  std::string features = run.features;
  for (char& letter : features) letter = static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
  return std::to_string(summary.frames) + " frames, up to " + std::to_string(run.target_points) + " " +
         features + " points an image, landmarks in " +
         (run.store == "multi" ? "a growing forest of kd-trees" : "one kd-tree built anew") + ", seed " +
         std::to_string(run.seed) + "; times are in timing.json";
}

}  // namespace

example::Report run_report(const RunRecord& run, const Summary& summary) {
  example::Report report("Stereo SLAM: " + run.dataset, subtitle_of(run, summary));
  add_figures(report, run, summary);
  if (run.ended_early) report.note(*run.ended_early);
  if (summary.budget) report.note(budget_text(*summary.budget));
  for (const std::string& note : run.notes) report.note(note);
  const TimeAxis time = time_axis(run);
  report.add(map_cloud(run));
  report.add(path_plot(run));
  if (const auto film = correction_film(run, summary)) report.add(*film);
  if (const auto table = loop_table(summary)) report.add(*table);
  if (const auto table = budget_table(summary)) report.add(*table);
  report.add(sample_picture(run));
  report.add(error_plot(run, time, false));
  report.add(error_plot(run, time, true));
  report.add(consistency_plot(run, time));
  report.add(match_plot(run, time));
  report.add(landmark_plot(run, time));
  return report;
}

}  // namespace stereo_slam
