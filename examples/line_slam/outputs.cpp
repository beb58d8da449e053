// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>
#include <cairn/io/trajectory.hpp>

#include "support/image_io.hpp"
#include "support/report.hpp"
#include "support/result_folder.hpp"

namespace line_slam {

namespace {

using cairn::SE3;
using cairn::Vector;
using example::Ink;
using example::readable;
using Json = nlohmann::ordered_json;

example::ResultFolder results_in(const std::filesystem::path& folder) {
  return {folder, {"trajectory.txt", "lines.csv", "summary.json", "report.html", "timing.json"}};
}

/// Seconds at walking pace: there is no clock in a rendered drive.
double time_of(const Results& r, std::size_t frame) {
  constexpr double metres_a_second = 1.5;
  return static_cast<double>(frame) * r.drive.step / metres_a_second;
}

cairn::Trajectory trajectory(const Results& r) {
  cairn::Trajectory all;
  for (std::size_t k = 0; k < r.slam.path.size(); ++k) all.push_back({time_of(r, k), r.slam.path[k]});
  return all;
}

std::string csv(const std::vector<FoundLine>& lines) {
  std::string text = "number,from_x_m,from_y_m,from_z_m,to_x_m,to_y_m,to_z_m,sightings\n";
  for (const FoundLine& l : lines) {
    text += std::to_string(l.number);
    for (const Vector<3>& p : {l.belief.mean.from, l.belief.mean.to})
      for (int i = 0; i < 3; ++i) {
        text += ',';
        cairn::append_number(text, p(i));
      }
    text += ',' + std::to_string(l.sightings) + '\n';
  }
  return text;
}

/// Lines seen from above, with gaps between them.
void append(example::PlaneCurve& curve, const Vector<3>& a, const Vector<3>& b) {
  constexpr double gap = std::numeric_limits<double>::quiet_NaN();
  for (const double x : {a(0), b(0), gap}) curve.x.push_back(x);
  for (const double y : {a(1), b(1), gap}) curve.y.push_back(y);
}

example::PlaneCurve edges_from_above(const Drive& drive) {
  example::PlaneCurve curve{.name = "true edges", .ink = Ink::grey};
  for (const Edge& e : drive.campus.edges()) append(curve, e.from, e.to);
  return curve;
}

example::PlaneCurve path_from_above(const char* name, Ink ink, const std::vector<SE3>& path) {
  example::PlaneCurve curve{.name = name, .ink = ink};
  for (const SE3& p : path) {
    curve.x.push_back(p.translation()(0));
    curve.y.push_back(p.translation()(1));
  }
  return curve;
}

void add_map(example::Report& page, const std::string& title, const std::string& caption, const MadeMap& map,
             const Drive& drive) {
  example::PlanePlot plot{.title = title,
                          .caption = caption + " Lines are " + readable(map.rms) +
                                     " m from the true edges (root mean square), the path is " +
                                     readable(map.path_rms) + " m from the true one.",
                          .x = {"x", "m"},
                          .y = {"y", "m"},
                          .curves = {edges_from_above(drive)},
                          .third = true};
  example::PlaneCurve lines{.name = "lines of the map", .ink = Ink::belief};
  for (const FoundLine& l : map.lines) append(lines, l.belief.mean.from, l.belief.mean.to);
  plot.curves.push_back(std::move(lines));
  plot.curves.push_back(path_from_above(
      "true path", Ink::truth,
      {drive.truth.begin(), drive.truth.begin() + static_cast<std::ptrdiff_t>(map.path.size())}));
  plot.curves.push_back(path_from_above("path", Ink::violet, map.path));
  page.add(plot);
}

void add_maps(example::Report& page, const Results& r, const Drive& drive) {
  add_map(page, "With the true poses", "What the cameras allow.", r.exact, drive);
  add_map(page, "Along odometry", "What comes of believing the wheels.", r.odometry, drive);
  add_map(page, "By " + std::to_string(r.options.particles) + " particles",
          r.options.smoothings == 0 ? "The best particle's path and its map."
                                    : "The best particle's path, led to the least squares of what was seen "
                                      "along it, and the map along that.",
          r.slam, drive);
  std::vector<std::array<float, 3>> path;
  const auto at = [](const Vector<3>& p) {
    return std::array{static_cast<float>(p(0)), static_cast<float>(p(1)), static_cast<float>(p(2))};
  };
  // A point cloud of the lines: a point every so often, brighter the better the line is known.
  example::Cloud cloud{.title = "The map in space",
                       .caption =
                           "Points along the lines of the best particle, coloured by how well the line is "
                           "known across itself.",
                       .unit = "m",
                       .points = {},
                       .colourings = {{"sigma across", "m", {}, false}, {"times seen", "", {}, false}},
                       .curves = {},
                       .wide = true};
  for (const FoundLine& l : r.slam.lines) {
    const MappedLine& m = l.belief.mean;
    const double sigma =
        std::max(m.line.sigma_across(0, l.belief.covariance), m.line.sigma_across(1, l.belief.covariance));
    const int points = std::max(2, static_cast<int>((m.to - m.from).norm() / 0.05));
    for (int i = 0; i <= points; ++i) {
      cloud.points.push_back(at(m.from + (m.to - m.from) * i / points));
      cloud.colourings[0].values.push_back(sigma);
      cloud.colourings[1].values.push_back(l.sightings);
    }
  }
  for (const SE3& p : r.slam.path) path.push_back(at(p.translation()));
  cloud.curves.push_back({"path", Ink::belief, path});
  path.clear();
  for (std::size_t k = 0; k < r.slam.path.size(); ++k) path.push_back(at(drive.truth[k].translation()));
  cloud.curves.push_back({"true path", Ink::truth, path});
  page.add(cloud);
}

#ifdef EXAMPLES_HAVE_PNG
example::Marks marks_of(const char* name, Ink ink, const std::vector<cairn::LineSegment>& segments) {
  example::Marks marks{.name = name, .ink = ink};
  for (const cairn::LineSegment& s : segments)
    marks.segments.push_back({static_cast<float>(s.from(0)), static_cast<float>(s.from(1)),
                              static_cast<float>(s.to(0)), static_cast<float>(s.to(1))});
  return marks;
}

void add_pictures(example::Report& page, const Results& r, const Drive& drive) {
  const std::size_t frame = std::min<std::size_t>(20, r.steps.size() - 1);
  constexpr const char* names[] = {"middle", "left", "upper"};
  for (std::size_t c = 0; c < cameras; ++c) {
    std::vector<cairn::LineSegment> found, matched;
    for (const Detected& d : drive.frames[frame].detections[c]) found.push_back(d.segment);
    for (const auto& sighting : drive.frames[frame].seen) matched.push_back(sighting.z.seen[c]);
    const cairn::Image image = drive.campus.picture(drive.rig[c], drive.truth[frame]);
    page.add(
        example::Picture{.title = std::string("What the ") + names[c] + " camera sees",
                         .caption = "Picture " + std::to_string(frame) + ": " + std::to_string(found.size()) +
                                    " segments, some of them of nothing; " + std::to_string(matched.size()) +
                                    " lines that all three cameras saw.",
                         .png = example::png_bytes(image),
                         .width = image.width(),
                         .height = image.height(),
                         .marks = {marks_of("segments", Ink::measurement, found),
                                   marks_of("lines of all three", Ink::belief, matched)}});
  }
}
#endif

void add_steps(example::Report& page, const Results& r, const Drive& drive) {
  std::vector<double> way, slam, odometry, spread, size, lines, seen, known;
  for (std::size_t k = 0; k < r.steps.size(); ++k) {
    const StepRecord& s = r.steps[k];
    const Vector<3> is = drive.truth[k].translation();
    way.push_back(static_cast<double>(k) * r.drive.step);
    slam.push_back((r.slam.path[k].translation() - is).norm());
    odometry.push_back((r.odometry.path[k].translation() - is).norm());
    spread.push_back(std::sqrt(s.pose.covariance(0, 0) + s.pose.covariance(1, 1) + s.pose.covariance(2, 2)));
    size.push_back(s.effective_size);
    lines.push_back(static_cast<double>(s.lines));
    seen.push_back(static_cast<double>(s.sightings));
    known.push_back(static_cast<double>(s.known));
  }
  page.add(example::LinePlot{.title = "Error of the path",
                             .caption = "Of the best particle's path as it is believed at the end, and how "
                                        "wide the particles' newest poses were spread.",
                             .x = {"way", "m"},
                             .y = {"distance from the truth", "m"},
                             .x_values = way,
                             .curves = {{"odometry", Ink::wrong, odometry},
                                        {"particles", Ink::belief, slam},
                                        {"spread of the newest pose", Ink::grey, spread, true}},
                             .logarithmic = true});
  page.add(example::LinePlot{.title = "Effective number of particles",
                             .caption = "1 / sum of the squared weights, before resampling.",
                             .x = {"way", "m"},
                             .y = {"N_eff", ""},
                             .x_values = way,
                             .curves = {{"N_eff", Ink::belief, size}}});
  page.add(example::LinePlot{.title = "Lines",
                             .caption = "Seen by all three cameras, and those of them that the first "
                                        "particle knew again.",
                             .x = {"way", "m"},
                             .y = {"number", ""},
                             .x_values = way,
                             .curves = {{"seen", Ink::measurement, seen}, {"known", Ink::belief, known}}});
}

Json json_of(const MadeMap& map) {
  return {{"rms_m", map.rms},        {"path_rms_m", map.path_rms}, {"lines", map.lines.size()},
          {"true_edges", map.edges}, {"tentative", map.tentative}, {"of_nothing", map.of_nothing}};
}

}  // namespace

std::string summary(const Results& r) {
  Json json;
  json["drive"] = "rendered campus";
  json["seed"] = r.options.seed;
  json["particles"] = r.options.particles;
  json["smoothings"] = r.options.smoothings;
  json["metres"] = r.drive.metres;
  json["frames"] = r.steps.size();
  json["resampled"] = std::ranges::count_if(r.steps, &StepRecord::resampled);
  json["ended_early"] = r.ended_early ? Json(*r.ended_early) : Json(nullptr);
  json["exact_poses"] = json_of(r.exact);
  json["odometry"] = json_of(r.odometry);
  json["slam"] = json_of(r.slam);
  return json.dump(2) + "\n";
}

std::optional<std::string> report(const Results& r, const Drive& drive) {
  example::Report page("Lines seen by three cameras",
                       "rendered campus, " + std::to_string(r.options.particles) + " particles, seed " +
                           std::to_string(r.options.seed));
  if (r.ended_early) page.note(*r.ended_early);
  const auto over = [&](const MadeMap& map) {
    return r.exact.rms > 0 ? readable(map.rms / r.exact.rms) : "none";
  };
  page.figure({"Map with the true poses", readable(r.exact.rms), "m",
               "distance of the lines' ends and middles from the true edges, root mean square"});
  page.figure({"Map along odometry", readable(r.odometry.rms), "m", over(r.odometry) + " times as far"});
  page.figure({"Map of the particles", readable(r.slam.rms), "m", over(r.slam) + " times as far"});
  page.figure(
      {"Lines", std::to_string(r.slam.lines.size()), "",
       "seen three times or more; " + std::to_string(r.slam.tentative) + " seen less often are not drawn"});
  if (!r.steps.empty()) {
    add_maps(page, r, drive);
#ifdef EXAMPLES_HAVE_PNG
    add_pictures(page, r, drive);
#endif
    add_steps(page, r, drive);
  }
  return page.html();
}

void prepare_folder(const std::filesystem::path& folder) {
  results_in(folder).prepare();
}

std::optional<std::string> write_outputs(const Results& r, const Drive& drive,
                                         const std::filesystem::path& folder) {
  const std::optional<std::string> page = report(r, drive);
  const Json timing{{"threads", r.options.threads}, {"seconds", r.seconds}, {"cpu_seconds", r.cpu_seconds}};
  results_in(folder).replace([&](const std::filesystem::path& staging) {
    cairn::write_tum(staging / "trajectory.txt", trajectory(r));
    cairn::write_file_atomically(staging / "lines.csv", csv(r.slam.lines));
    cairn::write_file_atomically(staging / "summary.json", summary(r));
    cairn::write_file_atomically(staging / "timing.json", timing.dump(2) + "\n");
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace line_slam
