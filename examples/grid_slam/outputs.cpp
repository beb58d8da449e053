// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/io/text.hpp>

#include "map_image.hpp"
#include "support/image_io.hpp"
#include "support/report.hpp"
#include "support/result_folder.hpp"

namespace grid_slam {

namespace {

using example::Ink;
using example::readable;
using Json = nlohmann::ordered_json;

constexpr double degrees = 180 / std::numbers::pi;

example::ResultFolder results_in(const std::filesystem::path& folder) {
  return {folder, {"map.pgm", "map.yaml", "trajectory.txt", "summary.json", "report.html", "timing.json"}};
}

/// The TUM format: time x y z qx qy qz qw, in the order of the log, whose times may run back.
std::string tum(const std::vector<cairn::StampedPose2>& path) {
  std::string text;
  for (const cairn::StampedPose2& p : path) {
    const double numbers[] = {
        p.time, p.pose.x(), p.pose.y(), 0, 0, 0, std::sin(p.pose.angle() / 2), std::cos(p.pose.angle() / 2)};
    for (const double n : numbers) {
      if (&n != numbers) text += ' ';
      cairn::append_number(text, n);
    }
    text += '\n';
  }
  return text;
}

std::string yaml(const MapImage& map) {
  std::string text = "image: map.pgm\nresolution: ";
  cairn::append_number(text, map.cell_size);
  text += "\norigin: [";
  cairn::append_number(text, map.left);
  text += ", ";
  cairn::append_number(text, map.bottom);
  text += ", 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
  return text;
}

Json json_of(const std::optional<cairn::RelationError>& error) {
  if (!error || error->count == 0) return nullptr;
  return {{"relations", error->count},   {"missing", error->missing},
          {"mean_m", error->mean},       {"deviation_m", error->deviation},
          {"largest_m", error->largest}, {"mean_deg", error->mean_angle * degrees}};
}

example::PlaneCurve curve_of(const std::string& name, Ink ink, const std::vector<cairn::StampedPose2>& path) {
  example::PlaneCurve curve{name, ink, {}, {}, false};
  for (const auto& p : path) {
    curve.x.push_back(p.pose.x());
    curve.y.push_back(p.pose.y());
  }
  return curve;
}

#ifdef EXAMPLES_HAVE_PNG
void add_map(example::Report& page, const Results& r) {
  const auto column = [&](const cairn::SE2& p) {
    return static_cast<float>((p.x() - r.map.left) / r.map.cell_size);
  };
  const auto row = [&](const cairn::SE2& p) {
    return static_cast<float>(r.map.image.height()) -
           static_cast<float>((p.y() - r.map.bottom) / r.map.cell_size);
  };
  example::Marks all{"all particles' paths", Ink::violet, {}, {}}, path{"path", Ink::belief, {}, {}};
  for (const auto& each : r.paths)
    for (std::size_t k = 1; k < each.size(); ++k)
      all.segments.push_back({column(each[k - 1]), row(each[k - 1]), column(each[k]), row(each[k])});
  for (std::size_t k = 1; k < r.means.size(); ++k)
    path.segments.push_back({column(r.means[k - 1].pose), row(r.means[k - 1].pose), column(r.means[k].pose),
                             row(r.means[k].pose)});
  page.add(example::Picture{
      .title = "The map and the paths",
      .caption =
          "The map of the best particle, " + readable(100 * r.map.cell_size) +
          " cm a pixel, grey where no beam has been. The particles' paths lie on each other where they "
          "have an ancestor in common.",
      .png = example::png_bytes(r.map.image),
      .width = r.map.image.width(),
      .height = r.map.image.height(),
      .marks = {path, all},
      .wide = true});
}
#endif

void add_spread(example::Report& page, const Results& r) {
  std::vector<double> step, size, sigma, turn;
  for (std::size_t k = 0; k < r.steps.size(); ++k) {
    step.push_back(static_cast<double>(k));
    size.push_back(r.steps[k].effective_size);
    const auto& p = r.steps[k].pose.covariance;
    sigma.push_back(std::sqrt(p(0, 0) + p(1, 1)));
    turn.push_back(std::sqrt(p(2, 2)) * degrees);
  }
  page.add(example::LinePlot{.title = "Effective number of particles",
                             .caption = "1 / sum of the squared weights, before resampling.",
                             .x = {"processed scan", ""},
                             .y = {"N_eff", ""},
                             .x_values = step,
                             .curves = {{"N_eff", Ink::belief, size}}});
  page.add(example::LinePlot{
      .title = "Spread of the newest pose",
      .caption = "Standard deviation of the newest pose over all particles: in the map's frame, which begins "
                 "where the robot began. It grows with the path and falls where a loop closes.",
      .x = {"processed scan", ""},
      .y = {"sigma", "m, deg"},
      .x_values = step,
      .curves = {{"position [m]", Ink::belief, sigma}, {"heading [deg]", Ink::teal, turn}},
      .logarithmic = true});
}

void add_errors(example::Report& page, const Results& r) {
  if (!r.of_means) return;
  example::Table table{
      .title = "Relations",
      .caption =
          "How well paths keep the relative poses of the relations file, or of the truth: mean and "
          "standard deviation, the largest, and the mean angle.",
      .columns = {"path", "mean [m]", "deviation [m]", "largest [m]", "angle [deg]"}};
  const auto add = [&](const char* name, const std::optional<cairn::RelationError>& e) {
    if (e && e->count > 0)
      table.rows.push_back({name, readable(e->mean, 4), readable(e->deviation, 4), readable(e->largest),
                            readable(e->mean_angle * degrees)});
  };
  add("odometry", r.of_odometry);
  add("drawn, with which the map was made", r.of_drawn);
  add("means of the proposals", r.of_means);
  add("matched once more to the final map", r.of_rematched);
  page.add(table);
}

}  // namespace

MapImage map_image(const cairn::OccupancyGrid& grid) {
  return image_of(grid.geometry(), grid.cells(), [](const cairn::OccupancyCell& cell) {
    if (!cell.known()) return unknown_grey;
    return cell.is_obstacle() ? occupied_grey : free_grey;
  });
}

std::size_t map_bytes(const Mapper::Belief& belief) {
  std::set<const void*> seen;
  std::size_t bytes = 0;
  const auto count = [&](cairn::TileAddress, const auto& tile) {
    if (seen.insert(&tile).second) bytes += sizeof tile;
  };
  for (std::size_t i = 0; i < belief.size(); ++i) {
    belief[i].map.grid.cells().for_each_tile(count);
    belief[i].map.grid.field().tiles().for_each_tile(count);
  }
  return bytes;
}

std::string summary(const Results& r) {
  Json json;
  json["log"] = r.name;
  json["seed"] = r.seed;
  json["particles"] = r.particles;
  json["scans"] = r.scans;
  json["processed_scans"] = r.steps.size();
  json["resampled"] = std::ranges::count_if(r.steps, &StepRecord::resampled);
  json["loops"] = r.loops.size();
  json["paths_moved"] = std::ranges::count_if(r.steps, &StepRecord::moved);
  json["ended_early"] = r.ended_early ? Json(*r.ended_early) : Json(nullptr);
  const auto& p = r.newest.covariance;
  json["newest_pose"] = {
      {"x_m", r.newest.mean.x()},
      {"y_m", r.newest.mean.y()},
      {"heading_rad", r.newest.mean.angle()},
      {"covariance",
       {{p(0, 0), p(0, 1), p(0, 2)}, {p(1, 0), p(1, 1), p(1, 2)}, {p(2, 0), p(2, 1), p(2, 2)}}}};
  json["map"] = {{"width", r.map.image.width()},
                 {"height", r.map.image.height()},
                 {"resolution_m", r.map.cell_size},
                 {"bytes_of_all_particles", r.bytes}};
  json["relations"] = {{"odometry", json_of(r.of_odometry)},
                       {"drawn", json_of(r.of_drawn)},
                       {"means", json_of(r.of_means)},
                       {"rematched", json_of(r.of_rematched)}};
  return json.dump(2) + "\n";
}

std::optional<std::string> report(const Results& r) {
  example::Report page("Grid SLAM", r.name + ", " + std::to_string(r.particles) + " particles, seed " +
                                        std::to_string(r.seed));
  if (r.ended_early) page.note(*r.ended_early);
  page.figure({"Scans", std::to_string(r.scans), "", std::to_string(r.steps.size()) + " processed"});
  page.figure({"Loops", std::to_string(r.loops.size()), "", "relative poses measured at revisits"});
  if (r.of_means && r.of_means->count > 0)
    page.figure({"Relations, mean", readable(r.of_means->mean), "m",
                 readable(r.of_means->mean_angle * degrees) + " deg; means of the proposals"});
  page.figure({"Maps of all particles", readable(static_cast<double>(r.bytes) / 1048576.0), "MB"});
#ifdef EXAMPLES_HAVE_PNG
  add_map(page, r);
#endif
  page.add(example::PlanePlot{
      .title = "Path and odometry",
      .caption = "What the wheels say, and what the filter made of it.",
      .x = {"x", "m"},
      .y = {"y", "m"},
      .curves = {curve_of("odometry", Ink::wrong, r.odometry), curve_of("path", Ink::belief, r.means)}});
  add_spread(page, r);
  add_errors(page, r);
  return page.html();
}

void prepare_folder(const std::filesystem::path& folder) {
  results_in(folder).prepare();
}

std::optional<std::string> write_outputs(const Results& r, const std::filesystem::path& folder) {
  const std::optional<std::string> page = report(r);
  Json timing{{"threads", r.threads}, {"seconds", r.seconds}, {"cpu_seconds", r.cpu_seconds}};
  results_in(folder).replace([&](const std::filesystem::path& staging) {
    cairn::write_pgm(staging / "map.pgm", r.map.image);
    cairn::write_file_atomically(staging / "map.yaml", yaml(r.map));
    cairn::write_file_atomically(staging / "trajectory.txt", tum(r.means));
    cairn::write_file_atomically(staging / "summary.json", summary(r));
    cairn::write_file_atomically(staging / "timing.json", timing.dump(2) + "\n");
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace grid_slam
