// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "outputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>

#include "support/image_io.hpp"
#include "support/report.hpp"
#include "support/result_folder.hpp"

namespace calibrate_stereo {
namespace {

using Json = nlohmann::ordered_json;
using example::Ink;
using example::readable;

constexpr std::array<const char*, 9> names{"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};
constexpr double degrees = 57.29577951308232;

example::ResultFolder results_in(const std::filesystem::path& folder) {
  return {folder, {"rig.yaml", "summary.json", "report.html"}};
}

std::array<double, 9> parameters_of(const cairn::PinholeCamera& camera) {
  const cairn::PinholeParameters& p = camera.parameters();
  return {p.fx, p.fy, p.cx, p.cy, p.k1, p.k2, p.p1, p.p2, p.k3};
}

double sigma_of(const example::CameraSigmas& sigmas, std::size_t i) {
  return i < 4 ? sigmas.intrinsics.value()[i] : sigmas.distortion.value()[i - 4];
}

std::string summary(const Results& r) {
  const BoardCalibration& c = r.calibration;
  Json json;
  json["views"] = r.views.size();
  json["board"] = {{"columns", r.columns}, {"rows", r.rows}, {"square_m", r.square}};
  json["rms_px"] = c.rms;
  json["opencv_rms_px"] = r.start_rms;
  json["opencv_largest_difference_sigma"] = r.start_difference;
  json["pixel_sigma_px"] = c.pixel_sigma;
  json["held_out"] = {{"epipolar_rms_px", held_out_epipolar(r)}, {"length_error", held_out_length(r)}};
  json["baseline_m"] = {{"value", c.rig.rig.baseline()}, {"sigma", c.baseline_sigma}};
  for (const bool left : {true, false}) {
    Json& camera = json[left ? "left" : "right"];
    const auto numbers = parameters_of(left ? c.rig.rig.left : c.rig.rig.right);
    for (std::size_t i = 0; i < names.size(); ++i)
      camera[names[i]] = {{"value", numbers[i]}, {"sigma", sigma_of(left ? c.rig.left : c.rig.right, i)}};
  }
  const cairn::Vector<3> turn = c.rig.rig.T_left_right.rotation().log();
  for (int i = 0; i < 3; ++i)
    json["rotation_rad"].push_back({{"value", turn(i)}, {"sigma", (*c.rig.rotation_sigma)(i)}});
  for (std::size_t v = 0; v < c.views.size(); ++v)
    json["views_px"].push_back({{"name", c.views[v].name},
                                {"left", c.views[v].left},
                                {"right", c.views[v].right},
                                {"epipolar", c.views[v].epipolar},
                                {"epipolar_held_out", r.held_out[v].epipolar}});
  json["notes"] = r.notes;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

/// A number down to the second digit of its standard deviation, and that.
std::array<std::string, 2> with_sigma(double value, double sigma) {
  int digits = 6;
  if (sigma > 0 && std::abs(value) > 0)
    digits = static_cast<int>(std::floor(std::log10(std::abs(value))) - std::floor(std::log10(sigma))) + 2;
  return {readable(value, std::max(digits, 1)), readable(sigma, 2)};
}

example::Table number_table(const BoardCalibration& c) {
  example::Table table{.title = "The rig",
                       .caption = "Estimates with their standard deviations. Pixels, radians, metres.",
                       .columns = {"number", "left", "sigma", "right", "sigma"},
                       .rows = {}};
  const auto left = parameters_of(c.rig.rig.left), right = parameters_of(c.rig.rig.right);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto [of_left, its_sigma] = with_sigma(left[i], sigma_of(c.rig.left, i));
    const auto [of_right, other_sigma] = with_sigma(right[i], sigma_of(c.rig.right, i));
    table.rows.push_back({names[i], of_left, its_sigma, of_right, other_sigma});
  }
  const auto add = [&](const std::string& name, double value, double sigma) {
    const auto [number, deviation] = with_sigma(value, sigma);
    table.rows.push_back({name, "", "", number, deviation});
  };
  const cairn::Vector<3> place = c.rig.rig.T_left_right.translation(),
                         turn = c.rig.rig.T_left_right.rotation().log();
  const std::array<std::string, 3> axes{"x", "y", "z"};
  for (int i = 0; i < 3; ++i)
    add("right camera, " + axes[static_cast<std::size_t>(i)] + " [m]", place(i),
        (*c.rig.translation_sigma)(i));
  for (int i = 0; i < 3; ++i)
    add("turned about " + axes[static_cast<std::size_t>(i)] + " [deg]", turn(i) * degrees,
        (*c.rig.rotation_sigma)(i)*degrees);
  return table;
}

example::Table view_table(const Results& r) {
  example::Table table{
      .title = "Every view",
      .caption =
          "RMS in pixels: of the corners about where the calibration puts them, and of the "
          "distance from the epipolar line, with this view and by the others alone.",
      .columns = {"view", "left", "right", "epipolar", "epipolar, not used", "length, not used [%]"},
      .rows = {}};
  for (std::size_t v = 0; v < r.calibration.views.size(); ++v) {
    const ViewError& view = r.calibration.views[v];
    table.rows.push_back({view.name, readable(view.left), readable(view.right), readable(view.epipolar),
                          readable(r.held_out[v].epipolar), readable(100 * r.held_out[v].length, 2)});
  }
  return table;
}

/// Epipolar distance of every corner over where it is in the left image.
example::PlanePlot epipolar_plot(const Results& r, bool rows) {
  example::PlanePlot plot{
      .title = rows ? "Epipolar check over the rows" : "Epipolar check over the columns",
      .caption =
          "Distance of every corner from its epipolar line. A slope or a curve is what the model of the lens "
          "or the rotation of the right camera does not explain.",
      .x = {rows ? "row" : "column", "px"},
      .y = {"distance", "px"},
      .curves = {},
      .equal_scale = false};
  example::PlaneCurve dots{"corner", Ink::measurement, {}, {}, true};
  for (const BoardView& view : r.views)
    for (std::size_t i = 0; i < view.left.size(); ++i)
      if (const auto distance =
              cairn::epipolar_distance(r.calibration.rig.rig, view.left[i], view.right[i])) {
        dots.x.push_back(view.left[i](rows ? 1 : 0));
        dots.y.push_back(*distance);
      }
  plot.curves.push_back(std::move(dots));
  return plot;
}

/// Where the corners were in the left images.
example::PlanePlot coverage_plot(const Results& r) {
  example::PlanePlot plot{
      .title = "Where the board was",
      .caption =
          "Corners of all views in both images, seen as the image is. Parts without a corner are "
          "extrapolated.",
      .x = {"column", "px"},
      .y = {"row", "px"},
      .curves = {},
      .downwards = true};
  for (const bool left : {true, false}) {
    example::PlaneCurve dots{left ? "left" : "right", left ? Ink::belief : Ink::measurement, {}, {}, true};
    for (const BoardView& view : r.views)
      for (const cairn::Vector<2>& corner : left ? view.left : view.right) {
        dots.x.push_back(corner(0));
        dots.y.push_back(corner(1));
      }
    plot.curves.push_back(std::move(dots));
  }
  return plot;
}

example::Picture sample_picture(const Results& r) {
  constexpr double zoom = 50;
  example::Picture picture{.title = "The first view",
                           .caption = "Left image. Lines: where the calibration puts a corner, " +
                                      readable(zoom) + " times as far from where it was seen.",
                           .png = example::png_bytes(r.sample),
                           .width = r.sample.width(),
                           .height = r.sample.height(),
                           .marks = {}};
  example::Marks marks{"corners", Ink::measurement, {}, {}};
  for (std::size_t i = 0; i < r.board.size(); ++i) {
    const cairn::Vector<2>& seen = r.views[0].left[i];
    const auto put = r.calibration.rig.rig.left.project(r.calibration.T_left_board[0] * r.board[i]);
    marks.points.push_back({static_cast<float>(seen(0)), static_cast<float>(seen(1))});
    if (!put) continue;
    const cairn::Vector<2> end = seen + zoom * (*put - seen);
    marks.segments.push_back({static_cast<float>(seen(0)), static_cast<float>(seen(1)),
                              static_cast<float>(end(0)), static_cast<float>(end(1))});
  }
  picture.marks.push_back(std::move(marks));
  return picture;
}

std::optional<std::string> report(const Results& r) {
  const BoardCalibration& c = r.calibration;
  example::Report page("Stereo calibration", std::to_string(r.views.size()) + " pairs, chessboard of " +
                                                 std::to_string(r.columns) + " x " + std::to_string(r.rows) +
                                                 " inner corners, squares of " + readable(r.square) + " m");
  page.figure({"RMS", readable(c.rms), "px", "of a corner; OpenCV's own minimum " + readable(r.start_rms)});
  page.figure({"noise of a coordinate", readable(c.pixel_sigma), "px", ""});
  page.figure({"epipolar error of a new pair", readable(held_out_epipolar(r)), "px",
               "each pair by the calibration of the others"});
  page.figure({"length error of a new pair", readable(100 * held_out_length(r), 2), "%",
               "triangulated squares, mean"});
  page.figure({"baseline", readable(c.rig.rig.baseline(), 5), "m", "sigma " + readable(c.baseline_sigma, 2)});
  page.figure({"focal length, left", readable(c.rig.rig.left.fx(), 5), "px",
               "sigma " + readable(c.rig.left.intrinsics.value()[0], 2)});
  for (const std::string& note : r.notes) page.note(note);
  if (!r.sample.empty()) page.add(sample_picture(r));
  page.add(coverage_plot(r));
  page.add(epipolar_plot(r, false));
  page.add(epipolar_plot(r, true));
  page.add(number_table(c));
  page.add(view_table(r));
  return page.html();
}

}  // namespace

double held_out_epipolar(const Results& r) {
  double sum = 0;
  for (const HeldOut& one : r.held_out) sum += one.epipolar * one.epipolar;
  return std::sqrt(sum / static_cast<double>(r.held_out.size()));
}

double held_out_length(const Results& r) {
  double sum = 0;
  for (const HeldOut& one : r.held_out) sum += one.length;
  return sum / static_cast<double>(r.held_out.size());
}

void prepare_folder(const std::filesystem::path& folder) {
  results_in(folder).prepare();
}

std::optional<std::string> write_outputs(const Results& r, const std::filesystem::path& folder) {
  const std::optional<std::string> page = report(r);
  results_in(folder).replace([&](const std::filesystem::path& staging) {
    example::write_rig(staging / "rig.yaml", r.calibration.rig);
    cairn::write_file_atomically(staging / "summary.json", summary(r));
    if (page) cairn::write_file_atomically(staging / "report.html", *page);
  });
  return page ? std::nullopt : std::optional(example::why_no_report());
}

}  // namespace calibrate_stereo
