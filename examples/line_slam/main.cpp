// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Lines of space seen by three cameras: a particle filter over the rig's path, each particle with its own map
// of lines. The drive is rendered, so that truth is known; the same segments are mapped with the true poses
// and along odometry besides.
// Exit codes: 0 well; 2 a mistake; 4 interrupted, the results are of the frames before.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <optional>
#include <ostream>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>

#include "drive.hpp"
#include "outputs.hpp"
#include "run.hpp"
#include "segment_detector.hpp"
#include "support/command_line.hpp"
#include "support/interruption.hpp"
#include "support/progress.hpp"

namespace {

using namespace line_slam;

/// Ends early where it is interrupted, as the run that follows then says.
Drive drawn_with_progress(const DriveOptions& options, bool quiet) {
  std::ostream nowhere(nullptr);
  std::optional<example::Progress> progress;  // from the first on, for it knows how many there are
  return simulated_drive(options, [&](std::size_t frames, std::size_t of) {
    if (!progress)
      progress.emplace(quiet || options.detector_kind != DetectorKind::lsd ? nowhere : std::clog, "pictures",
                       of);
    while (progress->done() < frames) progress->step();
    return !example::Interruption::caught();
  });
}

Results run_with_progress(const Drive& drive, const RunOptions& options, bool quiet) {
  std::ostream nowhere(nullptr);
  example::Progress progress(quiet ? nowhere : std::clog, "frames", drive.frames.size());
  return run(drive, options, [&]() -> std::optional<std::string> {
    progress.step();
    if (const auto signal = example::Interruption::caught())
      return "interrupted (" + *signal + ") after " + std::to_string(progress.done()) + " frames";
    return std::nullopt;
  });
}

void print(const Results& r, const std::filesystem::path& out) {
  const auto line = [](const char* name, const MadeMap& map) {
    std::cout << name << map.lines.size() << " lines, " << map.rms << " m from the true edges; path "
              << map.path_rms << " m\n";
  };
  std::cout << r.steps.size() << " frames (root mean squares)\n";
  line("true poses:  ", r.exact);
  line("odometry:    ", r.odometry);
  line("particles:   ", r.slam);
  std::cout << "results in " << std::filesystem::absolute(out).lexically_normal().string() << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = "line_slam";
  RunOptions options;
  options.threads = std::max(1U, std::thread::hardware_concurrency());
  DriveOptions drive_options;
  std::filesystem::path out = "line_slam_out";
  bool quiet = false;
  CLI::App app{
      "Maps straight edges that three cameras see: particles over a drive around a rendered campus."};
  app.option_defaults()->always_capture_default();
  std::string detector = "noise";
  app.add_option("--detector", detector,
                 "noise: the edges in view, with errors; lsd: what OpenCV's detector finds in the pictures")
      ->check(CLI::IsMember({"noise", "lsd"}));
  app.add_option("--metres", drive_options.metres, "of the drive; once around is 230")
      ->check(example::number_between(1, 10000));
  app.add_option("--out", out, "folder for the trajectory, the lines, the summary and the report");
  app.add_option("--particles", options.particles, "number of particles")
      ->check(example::whole_number(1, 10000));
  app.add_flag("--quiet", quiet, "no progress");
  app.add_option("--seed", options.seed,
                 "of campus, noise and particles: the same gives the same results for any number of threads")
      ->check(example::whole_number(0));
  app.add_option(
         "--smoothings", options.smoothings,
         "how often the best path is led to the least squares of all that was seen along it, at the "
         "end; 0: that particle's own path and map, in which nothing seen later bends what was before")
      ->check(example::whole_number(0, 100));
  app.add_option("--threads", options.threads, "threads")->check(example::whole_number(1, 1024));
  if (const std::optional<int> code = example::parse(app, name, argc, argv)) return *code;
  return example::exit_code_of(name, [&]() -> int {
    if (detector == "lsd") {
      if (!has_segment_detector())
        cairn::raise("--detector lsd: expected OpenCV, and this program was built without (libopencv-dev)");
      drive_options.detector_kind = DetectorKind::lsd;
    }
    prepare_folder(out);
    const example::Interruption interruption;
    drive_options.seed = options.seed;
    drive_options.threads = options.threads;
    const Drive drive = drawn_with_progress(drive_options, quiet);
    const Results results = run_with_progress(drive, options, quiet);
    if (results.ended_early) std::cerr << name << ": " << *results.ended_early << '\n';
    if (const auto no_report = write_outputs(results, drive, out)) std::cout << *no_report << '\n';
    print(results, out);
    return results.ended_early ? example::exit_interrupted : example::exit_well;
  });
}
