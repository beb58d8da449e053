// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// calibrate_stereo: a stereo rig from pairs of images of a chessboard, as a rig.yaml for stereo_slam
// --camera. Exit codes: 0 well; 2 a mistake, or the images do not make a calibration.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/io/text.hpp>

#include "board_calibration.hpp"
#include "chessboards.hpp"
#include "outputs.hpp"
#include "recording.hpp"
#include "support/command_line.hpp"
#include "support/image_io.hpp"
#include "support/progress.hpp"
#include "support/report.hpp"

namespace {

using namespace calibrate_stereo;

struct Arguments {
  stereo_slam::ImageGlobs images;
  std::array<int, 2> corners{9, 6};
  double square = 0.025;
  BoardCalibrationOptions calibration;
  std::filesystem::path out = "calibrate_stereo_out";
};

/// The boards of the pairs in which both images show all of it.
void find_boards(const Arguments& arguments, Results& results, std::array<int, 2>& size) {
  const stereo_slam::Recording recording = stereo_slam::read_images(arguments.images);
  example::Progress progress(std::clog, "pairs", recording.frames.size());
  std::string without;
  for (const stereo_slam::RecordedFrame& frame : recording.frames) {
    std::array<std::optional<std::vector<cairn::Vector<2>>>, 2> corners;
    for (const bool left : {true, false}) {
      const std::filesystem::path& file = left ? frame.left : frame.right;
      const cairn::Image image = example::read_image(file);
      if (size[0] == 0) size = {image.width(), image.height()};
      if (image.width() != size[0] || image.height() != size[1])
        cairn::raise(file.string() + ": the image has " + std::to_string(image.width()) + " x " +
                     std::to_string(image.height()) + " pixels; expected " + std::to_string(size[0]) + " x " +
                     std::to_string(size[1]) + " as the first");
      corners[left ? 0 : 1] = find_corners(image, arguments.corners[0], arguments.corners[1]);
      if (left && corners[0] && results.sample.empty()) results.sample = image;
    }
    progress.step();
    const std::string name = frame.left.filename().string();
    if (corners[0] && corners[1]) {
      results.views.push_back({name, std::move(*corners[0]), std::move(*corners[1])});
    } else {
      without += (without.empty() ? "" : ", ") + name;
      if (results.views.empty()) results.sample = {};
    }
  }
  if (!without.empty()) results.notes.push_back("no whole board in both images: " + without);
  if (results.views.size() < 3)
    cairn::raise("the board of " + std::to_string(arguments.corners[0]) + " x " +
                 std::to_string(arguments.corners[1]) + " inner corners was found in " +
                 std::to_string(results.views.size()) +
                 " pairs; expected three at least (--corners counts inner corners)");
}

/// Views that are far worse than the others, whose corners were mistaken, are left out once.
void leave_out_mistaken(const BoardCalibration& calibration, Results& results) {
  std::vector<double> errors;
  for (const ViewError& view : calibration.views) errors.push_back(std::hypot(view.left, view.right));
  const double limit = 3 * cairn::median(errors);
  std::string out;
  for (std::size_t v = errors.size(); v-- > 0;) {
    if (errors[v] <= limit || results.views.size() <= 3) continue;
    out += (out.empty() ? "" : ", ") + results.views[v].name;
    results.views.erase(results.views.begin() + static_cast<std::ptrdiff_t>(v));
    if (v == 0) results.sample = {};
  }
  if (!out.empty())
    results.notes.push_back("left out, more than three times the error of the others: " + out);
}

Results run(const Arguments& arguments) {
  Results results;
  results.columns = arguments.corners[0];
  results.rows = arguments.corners[1];
  results.square = arguments.square;
  results.board = board_points(results.columns, results.rows, results.square);
  std::array<int, 2> size{0, 0};
  find_boards(arguments, results, size);
  for (int round = 0; round < 2; ++round) {
    const Start start = begin(results.board, results.views, size[0], size[1], arguments.calibration);
    results.start_rms = start.rms;
    results.calibration =
        calibrate(results.board, results.views, start.rig, start.T_left_board, arguments.calibration);
    results.start_difference = largest_difference(results.calibration, start.rig);
    const std::size_t before = results.views.size();
    if (round == 0) leave_out_mistaken(results.calibration, results);
    if (results.views.size() == before) break;
  }
  const cairn::Vector<3> to_right = results.calibration.rig.rig.T_left_right.translation();
  if (!(to_right(0) > 0.5 * to_right.norm()))
    results.notes.push_back(
        "the camera of --right does not stand to the right of the other: expected the images exchanged, "
        "where this is a rig that looks ahead with its cameras side by side");
  results.held_out = leave_one_out(results.board, results.columns, results.views, results.calibration,
                                   arguments.calibration);
  results.calibration.rig.note = "calibrated from " + std::to_string(results.views.size()) + " pairs, RMS " +
                                 example::readable(results.calibration.rms) + " pixels";
  return results;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = "calibrate_stereo";
  Arguments arguments;
  CLI::App app(
      "Calibrates a stereo rig from pairs of images of a chessboard: rig.yaml for stereo_slam --camera.");
  app.add_option("--left", arguments.images.left, "left images as a pattern in quotes, 'boards/left*.png'")
      ->type_name("GLOB")
      ->required();
  app.add_option("--right", arguments.images.right, "right ones; paired by the numbers in their names")
      ->type_name("GLOB")
      ->required();
  app.add_option("--corners", arguments.corners, "inner corners of the board: in a row, and rows")
      ->check(example::whole_number(3, 100))  // fewer OpenCV does not look for
      ->type_name("COLUMNS ROWS")
      ->capture_default_str();
  app.add_option("--square", arguments.square, "side of a square [m]; the length of the baseline follows it")
      ->check(example::number_between(1e-4, 10))
      ->capture_default_str();
  app.add_option("--distortion", arguments.calibration.distortion,
                 "numbers of a lens to estimate: the first of k1, k2, p1, p2, k3")
      ->check(CLI::IsMember({0, 1, 2, 4, 5}))
      ->capture_default_str();
  app.add_option("--out", arguments.out, "folder for the results")->type_name("DIR")->capture_default_str();
  if (const std::optional<int> code = example::parse(app, name, argc, argv)) return *code;
  return example::exit_code_of(name, [&]() -> int {
    arguments.images.rate = 1;  // they are no video
    prepare_folder(arguments.out);
    const Results results = run(arguments);
    for (const std::string& note : results.notes) std::cout << "note: " << note << '\n';
    if (const auto no_report = write_outputs(results, arguments.out)) std::cout << *no_report << '\n';
    const BoardCalibration& c = results.calibration;
    std::cout << results.views.size() << " pairs, RMS " << example::readable(c.rms)
              << " px; a pair that was not used: " << example::readable(held_out_epipolar(results))
              << " px from its epipolar lines, lengths "
              << example::readable(100 * held_out_length(results), 2) << " % off\n"
              << "baseline " << example::readable(c.rig.rig.baseline(), 5) << " m, sigma "
              << example::readable(c.baseline_sigma, 2) << "\nresults: " << arguments.out.string() << '\n';
    return example::exit_well;
  });
}
