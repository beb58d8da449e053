// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include <cairn/core/statistics.hpp>
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
/// Where the pixels of a page's picture lie.
struct Canvas {
  double left = 0, top = 0, pixel = 1;  // [m]
  int width = 1, height = 1;

  [[nodiscard]] float column(const cairn::SE2& p) const { return static_cast<float>((p.x() - left) / pixel); }
  [[nodiscard]] float row(const cairn::SE2& p) const { return static_cast<float>((top - p.y()) / pixel); }
};

/// Where a map lies.
struct Extent {
  double cell_size, left, bottom;  // [m]
  int width, height;               // [cells]
};
Extent extent_of(const MapImage& map) {
  return {map.cell_size, map.left, map.bottom, map.image.width(), map.image.height()};
}
Extent extent_of(const PackedMap& map) {
  return {map.cell_size, map.left, map.bottom, map.width, map.height};
}

/// Of all these maps, and with no more pixels than a page shows.
Canvas canvas_of(const std::vector<Extent>& maps) {
  double left = maps.front().left, bottom = maps.front().bottom, right = left, top = bottom;
  const double cell = maps.front().cell_size;
  for (const Extent& m : maps) {
    left = std::min(left, m.left);
    bottom = std::min(bottom, m.bottom);
    right = std::max(right, m.left + cell * m.width);
    top = std::max(top, m.bottom + cell * m.height);
  }
  constexpr double most = 1400;  // pixels
  Canvas canvas{left, top,
                cell * std::max(1.0, std::ceil(std::max(right - left, top - bottom) / cell / most))};
  canvas.width = std::max(1, static_cast<int>(std::ceil((right - left) / canvas.pixel)));
  canvas.height = std::max(1, static_cast<int>(std::ceil((top - bottom) / canvas.pixel)));
  return canvas;
}

/// The map on the canvas; where a pixel has several cells, the darkest known one.
cairn::Image drawn_on(const Canvas& canvas, const MapImage& map) {
  cairn::Image image(canvas.width, canvas.height, unknown_grey);
  const double height = map.image.height() * map.cell_size;
  for (int r = 0; r < map.image.height(); ++r)
    for (int c = 0; c < map.image.width(); ++c) {
      const std::uint8_t grey = map.image(c, r);
      if (grey == unknown_grey) continue;
      const int column =
          static_cast<int>((map.left - canvas.left + (c + 0.5) * map.cell_size) / canvas.pixel);
      const int row =
          static_cast<int>((canvas.top - map.bottom - height + (r + 0.5) * map.cell_size) / canvas.pixel);
      if (column < 0 || row < 0 || column >= canvas.width || row >= canvas.height) continue;
      std::uint8_t& pixel = image(column, row);
      if (pixel == unknown_grey || grey < pixel) pixel = grey;
    }
  return image;
}

example::Marks marked(const std::string& name, Ink ink) {
  return {name, ink, {}, {}};
}
void add_step(example::Marks& marks, const Canvas& canvas, const cairn::SE2& from, const cairn::SE2& to) {
  marks.segments.push_back({canvas.column(from), canvas.row(from), canvas.column(to), canvas.row(to)});
}

constexpr const char* ancestors =
    " The particles' paths lie on each other where they have an ancestor in common.";

void add_map(example::Report& page, const Results& r) {
  const Canvas canvas = canvas_of({extent_of(r.map)});
  example::Marks all = marked("all particles' paths", Ink::violet), path = marked("path", Ink::belief);
  for (const auto& each : r.paths)
    for (std::size_t k = 1; k < each.size(); ++k) add_step(all, canvas, each[k - 1], each[k]);
  for (std::size_t k = 1; k < r.means.size(); ++k)
    add_step(path, canvas, r.means[k - 1].pose, r.means[k].pose);
  page.add(example::Picture{.title = "The map and the paths",
                            .caption = "The map of the best particle, " + readable(100 * canvas.pixel) +
                                       " cm a pixel, grey where no beam has been." + ancestors,
                            .png = example::png_bytes(drawn_on(canvas, r.map)),
                            .width = canvas.width,
                            .height = canvas.height,
                            .marks = {path, all},
                            .wide = true});
}

/// The map as it grew.
void add_film(example::Report& page, const Results& r) {
  std::vector<Extent> maps;
  for (const Snapshot& s : r.snapshots)
    if (s.map.has_picture()) maps.push_back(extent_of(s.map));
  if (maps.empty()) return;
  const Canvas canvas = canvas_of(maps);
  example::PictureFilm film{.title = "The map as it grew",
                            .caption = "The map of the particle that was best at each time, " +
                                       readable(100 * canvas.pixel) +
                                       " cm a pixel, grey where no beam has been." + ancestors +
                                       " Where a loop is closed, they are one path again.",
                            .slider = {"scan", ""},
                            .width = canvas.width,
                            .height = canvas.height,
                            .wide = true};
  for (const Snapshot& s : r.snapshots) {
    if (!s.map.has_picture()) continue;
    example::Marks all = marked("all particles' paths", Ink::violet), best = marked("best path", Ink::belief);
    for (const auto& [from, to] : s.paths) add_step(all, canvas, from, to);
    for (std::size_t k = 1; k < s.best.size(); ++k) add_step(best, canvas, s.best[k - 1], s.best[k]);
    film.frames.push_back({.at = static_cast<double>(s.scans),
                           .caption = std::to_string(s.processed) + " scans processed, " +
                                      std::to_string(s.loops) + (s.loops == 1 ? " loop" : " loops") +
                                      "; effective number of particles " + readable(s.effective_size) +
                                      "; maps " + readable(static_cast<double>(s.bytes) / 1048576.0) + " MB",
                           .png = example::png_bytes(drawn_on(canvas, s.map.unpacked())),
                           .marks = {best, all}});
  }
  page.add(film);
}
#endif

void add_spread(example::Report& page, const Results& r) {
  std::vector<double> step, size;
  for (std::size_t k = 0; k < r.steps.size(); ++k) {
    step.push_back(static_cast<double>(k));
    size.push_back(r.steps[k].effective_size);
  }
  page.add(example::LinePlot{.title = "Effective number of particles",
                             .caption = "1 / sum of the squared weights, before resampling.",
                             .x = {"processed scan", ""},
                             .y = {"N_eff", ""},
                             .x_values = step,
                             .curves = {{"N_eff", Ink::belief, size}}});
  if (r.snapshots.empty()) return;
  std::vector<double> at, sigma, turn;
  for (const Snapshot& s : r.snapshots) {
    at.push_back(static_cast<double>(s.processed));
    sigma.push_back(std::sqrt(s.newest(0, 0) + s.newest(1, 1)));
    turn.push_back(std::sqrt(s.newest(2, 2)) * degrees);
  }
  const std::string path =
      "Standard deviation of the newest pose, seen from where the map begins: of the particles' spread "
      "and of what the best one's path has gathered step by step, less what places met again have told of "
      "it.";
  const std::string particles =
      "Standard deviation of the newest pose over all particles. It does not hold what they all have "
      "in common, as the steps of a common ancestor.";
  page.add(
      example::LinePlot{.title = "Spread of the newest pose",
                        .caption = r.newest_has_path ? path : particles,
                        .x = {"processed scan", ""},
                        .y = {"sigma", "m, deg"},
                        .x_values = at,
                        .curves = {{"position [m]", Ink::belief, sigma}, {"heading [deg]", Ink::teal, turn}},
                        .logarithmic = true});
}

void add_memory(example::Report& page, const Results& r) {
  if (r.snapshots.empty()) return;
  std::vector<double> step, held, as_tiles, separate;
  for (const Snapshot& s : r.snapshots) {
    step.push_back(static_cast<double>(s.processed));
    held.push_back(static_cast<double>(s.bytes) / 1048576.0);
    as_tiles.push_back(static_cast<double>(s.tile_bytes) / 1048576.0);
    separate.push_back(static_cast<double>(s.separate_bytes) / 1048576.0);
  }
  const bool is_tree = r.snapshots.back().tile_bytes > 0;
  std::vector<example::Curve> curves{{is_tree ? "held: a tree" : "held: shared tiles", Ink::belief, held}};
  if (is_tree) curves.push_back({"if they were shared tiles", Ink::violet, as_tiles});
  curves.push_back({"if each particle had its own", Ink::grey, separate});
  const std::string shared =
      "All particles' maps together: what several particles have in common is held once";
  page.add(example::LinePlot{
      .title = "Memory of the maps",
      .caption =
          shared + (is_tree ? ", cell by cell in a tree of ancestors, or tile by tile." : ", tile by tile."),
      .x = {"processed scan", ""},
      .y = {"memory", "MB"},
      .x_values = step,
      .curves = curves,
      .logarithmic = true});
}

/// Where the pose of a scan may be before it is drawn.
void add_proposals(example::Report& page, const Results& r) {
  if (r.drawn_from.empty()) return;
  std::vector<example::PlaneGaussian> places;
  for (const auto& q : r.drawn_from) {
    const cairn::Matrix<2> R = q.mean.rotation().matrix();
    const cairn::Matrix<2> spread =
        R * q.covariance.topLeftCorner<2, 2>() * R.transpose();  // of the map's axes
    places.push_back({{q.mean.x(), q.mean.y()}, {spread(0, 0), spread(0, 1), spread(1, 1)}});
  }
  auto [ellipses, scale] = example::spreads_along(places, Ink::violet);
  const std::string by_scans =
      "Where the pose of a scan may be, by odometry and the scan together, before it is drawn: long along a "
      "corridor, "
      "whose walls say nothing of the way along it.";
  const std::string by_motion =
      "Where the pose of a scan may be by odometry, before it is drawn and weighed by the scan.";
  page.add(example::PlanePlot{.title = "Spread of the proposal",
                              .caption = (r.drawn_by_scans ? by_scans : by_motion) +
                                         " Ellipses of 3 sigma, drawn " + readable(scale) +
                                         " times as large, at the first visit of a place.",
                              .x = {"x", "m"},
                              .y = {"y", "m"},
                              .curves = {curve_of("path", Ink::grey, r.means), std::move(ellipses)}});
}

/// DP-SLAM's tree as it was at each time, now at the right.
void add_ancestors(example::Report& page, const Results& r) {
  if (r.snapshots.empty() || r.snapshots.back().ancestors.empty()) return;
  // As far back as nine tenths of the trees go: some reach back many times as far as the others.
  std::vector<double> oldest;
  for (const Snapshot& s : r.snapshots) {
    oldest.push_back(1);
    for (const Ancestor& a : s.ancestors)
      if (a.parent) oldest.back() = std::max(oldest.back(), static_cast<double>(s.processed - a.born));
  }
  const double left = -1.1 * cairn::quantile(oldest, 0.9);
  constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  struct Age {
    const char* name;
    double below;  // processed scans
    Ink ink;
  };
  constexpr Age ages[] = {{"younger than 10 scans", 10, Ink::measurement},
                          {"10 to 99 scans old", 100, Ink::teal},
                          {"older", std::numeric_limits<double>::infinity(), Ink::violet}};
  example::PlaneFilm film{
      .title = "The tree of ancestors",
      .caption =
          "What each particle's map is made of: a line is a stretch of path that the "
          "particles to its right have in common, and holds the cells that were written "
          "along it. A dot is where it splits, or a particle as it is now. Coloured by how "
          "long ago the line began; what is farther back than the picture stands at its "
          "left edge.",
      .x = {"processed scans before now", ""},
      .y = {"particle", ""},
      .slider = {"scan", ""},
      .equal_scale = false,
      .wide = true};
  for (const Snapshot& s : r.snapshots) {
    example::PlaneFrame frame{.at = static_cast<double>(s.scans)};
    const auto ago = [&](std::uint64_t step) {
      return static_cast<double>(step) - static_cast<double>(s.processed);
    };
    std::size_t last_common = 0;
    for (const Age& age : ages) {
      example::PlaneCurve lines{.name = age.name, .ink = age.ink},
          dots{.name = age.name, .ink = age.ink, .dots = true};
      const double above = &age == ages ? -1 : (&age - 1)->below;
      for (const Ancestor& a : s.ancestors) {
        if (!a.parent) last_common = a.end;
        if (-ago(a.born) >= age.below || -ago(a.born) < above) continue;
        const double from = a.parent ? std::max(left, ago(a.born)) : left, to = std::max(left, ago(a.end));
        const double split = a.parent ? s.ancestors[*a.parent].place : a.place;
        lines.x.insert(lines.x.end(), {from, from, to, nothing});
        lines.y.insert(lines.y.end(), {split + 1, a.place + 1, a.place + 1, nothing});
        dots.x.push_back(to);
        dots.y.push_back(a.place + 1);
      }
      frame.curves.push_back(std::move(lines));
      frame.curves.push_back(std::move(dots));
    }
    frame.caption = std::to_string(s.ancestors.size()) + " ancestors; what all have in common ends " +
                    std::to_string(s.processed - last_common) + " scans ago, effective number of particles " +
                    readable(s.effective_size);
    film.frames.push_back(std::move(frame));
  }
  page.add(film);
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
  add("the path with which the map was made, each pose drawn at random", r.of_drawn);
  add("the same, each pose the mean of what it was drawn from", r.of_means);
  add("the same, each scan matched once more to the finished map", r.of_rematched);
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
    if (seen.insert(&tile).second) bytes += tile.bytes();
  };
  for (std::size_t i = 0; i < belief.size(); ++i) {
    belief[i].map.grid.cells().for_each_tile(count);
  }
  return bytes;
}

Snapshot snapshot_of(const Mapper& mapper) {
  const Mapper::Belief& belief = mapper.belief();
  const std::size_t best = belief.best();
  Snapshot s{.scans = mapper.scans().size(),
             .processed = mapper.steps().size(),
             .loops = mapper.loops().size(),
             .effective_size = mapper.steps().empty() ? 0 : mapper.steps().back().effective_size,
             .newest = mapper.newest().covariance,
             .map = PackedMap(map_image(belief[best].map.grid)),
             .bytes = map_bytes(belief)};
  put_paths(s, belief);
  for (std::size_t i = 0; i < belief.size(); ++i)
    belief[i].map.grid.cells().for_each_tile(
        [&](cairn::TileAddress, const auto& tile) { s.separate_bytes += tile.bytes(); });
  return s;
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
  if (!r.places.empty()) {
    json["places"] = Json::array();
    for (const PossiblePlace& p : r.places)
      json["places"].push_back(
          {{"x_m", p.pose.x()}, {"y_m", p.pose.y()}, {"heading_rad", p.pose.angle()}, {"share", p.share}});
  }
  json["ended_early"] = r.ended_early ? Json(*r.ended_early) : Json(nullptr);
  json["notes"] = r.notes;
  const auto& p = r.newest.covariance;
  json["newest_pose"] = {
      {"x_m", r.newest.mean.x()},
      {"y_m", r.newest.mean.y()},
      {"heading_rad", r.newest.mean.angle()},
      {"covariance",
       {{p(0, 0), p(0, 1), p(0, 2)}, {p(1, 0), p(1, 1), p(1, 2)}, {p(2, 0), p(2, 1), p(2, 2)}}}};
  json["scan_delay"] = {{"scans", r.delay}, {"standard_deviation", r.delay_spread}};
  json["map"] = {{"width", r.map.columns},
                 {"height", r.map.rows},
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
  for (const std::string& note : r.notes) page.note(note);
  page.figure({"Scans", std::to_string(r.scans), "", std::to_string(r.steps.size()) + " processed"});
  page.figure({"Loops", std::to_string(r.loops.size()), "", "relative poses measured at revisits"});
  if (r.of_means && r.of_means->count > 0)
    page.figure(
        {"Error of relative poses", readable(r.of_means->mean), "m",
         readable(r.of_means->mean_angle * degrees) + " deg; mean over the pairs whose truth is known"});
  page.figure({"Maps of all particles", readable(static_cast<double>(r.bytes) / 1048576.0), "MB"});
#ifdef EXAMPLES_HAVE_PNG
  if (r.snapshots.empty() && r.map.has_picture())
    add_map(page, r);
  else
    add_film(page, r);
#endif
  page.add(example::PlanePlot{
      .title = "Path and odometry",
      .caption = "What the wheels say, and what the filter made of it.",
      .x = {"x", "m"},
      .y = {"y", "m"},
      .curves = {curve_of("odometry", Ink::wrong, r.odometry), curve_of("path", Ink::belief, r.means)}});
  add_proposals(page, r);
  add_spread(page, r);
  add_memory(page, r);
  add_ancestors(page, r);
  add_errors(page, r);
  return page.html();
}

void prepare_folder(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& besides) {
  results_in(folder).prepare(besides);
}

std::optional<std::string> write_outputs(const Results& r, const std::filesystem::path& folder) {
  const std::optional<std::string> page = report(r);
  Json timing{{"threads", r.threads}, {"seconds", r.seconds}, {"cpu_seconds", r.cpu_seconds}};
  results_in(folder).replace([&](const std::filesystem::path& staging) {
    if (r.map.has_picture()) {
      cairn::write_pgm(staging / "map.pgm", r.map.image);
      cairn::write_file_atomically(staging / "map.yaml", yaml(r.map));
    }
    cairn::write_file_atomically(staging / "trajectory.txt", tum(r.means));
    cairn::write_file_atomically(staging / "summary.json", summary(r));
    cairn::write_file_atomically(staging / "timing.json", timing.dump(2) + "\n");
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace grid_slam
