// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <array>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/io/trajectory.hpp>
#include <cairn/manifold/se3.hpp>

#include "support/image_io.hpp"
#include "support/report.hpp"
#include "support/result_folder.hpp"

namespace gamma_slam {

namespace {

using cairn::SE2;
using example::Ink;
using example::readable;
using Json = nlohmann::ordered_json;

example::ResultFolder results_in(const std::filesystem::path& folder) {
  return {
      folder,
      {"sigma.pgm", "sigma_by_odometry.pgm", "trajectory.txt", "summary.json", "report.html", "timing.json"}};
}

cairn::Trajectory trajectory(const Results& r) {
  cairn::Trajectory all;
  for (std::size_t i = 0; i < r.path.size(); ++i)
    all.push_back({r.time[i], cairn::SE3(cairn::SO3::exp(cairn::Vector<3>(0, 0, r.path[i].angle())),
                                         cairn::Vector<3>(r.path[i].x(), r.path[i].y(), 0))});
  return all;
}

example::PlaneCurve curve_of(const char* name, Ink ink, const std::vector<SE2>& path) {
  example::PlaneCurve curve{name, ink, {}, {}, false};
  for (const SE2& p : path) {
    curve.x.push_back(p.x());
    curve.y.push_back(p.y());
  }
  return curve;
}

#ifdef EXAMPLES_HAVE_PNG
example::Marks marks_of(const char* name, Ink ink, const SigmaImage& map, const std::vector<SE2>& path) {
  const auto at = [&](const SE2& p) {
    return std::array{static_cast<float>((p.x() - map.left) / map.pixel),
                      static_cast<float>((map.top - p.y()) / map.pixel)};
  };
  example::Marks marks{name, ink, {}, {}};
  for (std::size_t k = 1; k < path.size(); ++k) {
    const auto from = at(path[k - 1]), to = at(path[k]);
    marks.segments.push_back({from[0], from[1], to[0], to[1]});
  }
  return marks;
}

void add_map(example::Report& page, const std::string& title, const std::string& caption,
             const SigmaImage& map, std::vector<example::Marks> marks) {
  page.add(example::Picture{.title = title,
                            .caption = caption,
                            .png = example::png_bytes(map.image),
                            .width = map.image.width(),
                            .height = map.image.height(),
                            .marks = std::move(marks)});
}

void add_maps(example::Report& page, const Results& r) {
  add_map(page, "By visual odometry alone",
          "Expected sigma of the heights in cells of " + readable(100 * r.odometry_map.pixel) +
              " cm, black from 20 cm on, white where nothing was seen. What is seen again lies beside what "
              "was seen first.",
          r.odometry_map,
          {marks_of("visual odometry", Ink::wrong, r.odometry_map, r.odometry),
           marks_of("truth", Ink::truth, r.odometry_map, r.truth)});
  example::Marks all{"all particles' paths", Ink::violet, {}, {}};
  for (const auto& path : r.paths) {
    const example::Marks one = marks_of("", Ink::violet, r.filter_map, path);
    all.segments.insert(all.segments.end(), one.segments.begin(), one.segments.end());
  }
  add_map(page, "By " + std::to_string(r.options.particles) + " particles",
          "The map of the best particle. Paths lie on each other where they have an ancestor in common.",
          r.filter_map,
          {marks_of("path", Ink::belief, r.filter_map, r.path),
           marks_of("truth", Ink::truth, r.filter_map, r.truth), all});
  if (r.true_map)
    add_map(page, "The terrain's own sigma", "Of the cells that the best particle has seen.", *r.true_map,
            {});
}
#endif

void add_plots(example::Report& page, const Results& r) {
  page.add(example::PlanePlot{
      .title = "Paths",
      .caption = "Both begin at the true place.",
      .x = {"x", "m"},
      .y = {"y", "m"},
      .curves = {curve_of("visual odometry", Ink::wrong, r.odometry), curve_of("truth", Ink::truth, r.truth),
                 curve_of("path", Ink::belief, r.path)}});
  std::vector<double> time, by_odometry, by_filter;
  for (std::size_t i = 0; i < r.path.size(); ++i) {
    time.push_back(r.time[i] - r.time.front());  // recordings have theirs since 1970
    by_odometry.push_back((r.odometry[i].translation() - r.truth[i].translation()).norm());
    by_filter.push_back((r.path[i].translation() - r.truth[i].translation()).norm());
  }
  page.add(example::LinePlot{
      .title = "Error of the path",
      .caption = "Distance from the truth, of the best particle's path as it is believed at the end.",
      .x = {"time", "s"},
      .y = {"error", "m"},
      .x_values = time,
      .curves = {{"visual odometry", Ink::wrong, by_odometry}, {"path", Ink::belief, by_filter}}});
  page.add(example::LinePlot{.title = "Effective number of particles",
                             .caption = "1 / sum of the squared weights, before resampling.",
                             .x = {"time", "s"},
                             .y = {"N_eff", ""},
                             .x_values = time,
                             .curves = {{"N_eff", Ink::belief, r.effective_size}}});
}

}  // namespace

std::string summary(const Results& r) {
  Json json;
  json["drive"] = r.drive;
  json["cells"] = r.options.cells == Cells::heights ? "heights" : "variance";
  json["cell_m"] = r.options.map.geometry.cell_size;
  json["seed"] = r.options.seed;
  json["particles"] = r.options.particles;
  json["scans"] = r.scans;
  json["resampled"] = r.resampled;
  json["ended_early"] = r.ended_early ? Json(*r.ended_early) : Json(nullptr);
  json["error_m"] = {{"odometry", {{"mean", r.odometry_error()}, {"end", r.odometry_end_error()}}},
                     {"filter", {{"mean", r.filter_error()}, {"end", r.filter_end_error()}}}};
  if (r.coverage)
    json["sigma_of_heights"] = {{"cells", r.coverage->cells},
                                {"covered_by_90_percent", r.coverage->share()},
                                {"mean_log_ratio", r.coverage->log_ratio}};
  const auto& p = r.newest.covariance;
  json["newest_pose"] = {
      {"x_m", r.newest.mean.x()},
      {"y_m", r.newest.mean.y()},
      {"heading_rad", r.newest.mean.angle()},
      {"covariance",
       {{p(0, 0), p(0, 1), p(0, 2)}, {p(1, 0), p(1, 1), p(1, 2)}, {p(2, 0), p(2, 1), p(2, 2)}}}};
  return json.dump(2) + "\n";
}

std::optional<std::string> report(const Results& r) {
  example::Report page("Gamma-SLAM", r.drive + ", " + std::to_string(r.options.particles) +
                                         " particles, seed " + std::to_string(r.options.seed));
  if (r.ended_early) page.note(*r.ended_early);
  page.figure(
      {"Error of visual odometry", readable(r.odometry_error()), "m", "mean distance from the truth"});
  page.figure({"Error of the filter", readable(r.filter_error()), "m", "the same, of the best particle"});
  page.figure({"Where odometry ends", readable(r.odometry_end_error()), "m", "from the truth"});
  page.figure({"Where the filter ends", readable(r.filter_end_error()), "m", "the same"});
  if (r.coverage)
    page.figure({"Cells whose 90 % interval of sigma is right", readable(100 * r.coverage->share()), "%",
                 "of " + std::to_string(r.coverage->cells) + " with ten heights or more"});
#ifdef EXAMPLES_HAVE_PNG
  add_maps(page, r);
#endif
  add_plots(page, r);
  return page.html();
}

void prepare_folder(const std::filesystem::path& folder) {
  results_in(folder).prepare();
}

std::optional<std::string> write_outputs(const Results& r, const std::filesystem::path& folder) {
  const std::optional<std::string> page = report(r);
  const Json timing{{"threads", r.options.threads}, {"seconds", r.seconds}};
  results_in(folder).replace([&](const std::filesystem::path& staging) {
    cairn::write_pgm(staging / "sigma.pgm", r.filter_map.image);
    cairn::write_pgm(staging / "sigma_by_odometry.pgm", r.odometry_map.image);
    cairn::write_tum(staging / "trajectory.txt", trajectory(r));
    cairn::write_file_atomically(staging / "summary.json", summary(r));
    cairn::write_file_atomically(staging / "timing.json", timing.dump(2) + "\n");
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace gamma_slam
