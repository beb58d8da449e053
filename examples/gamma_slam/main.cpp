// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Gamma-SLAM: rough ground mapped by the spread of its heights, from a stereo camera and visual odometry. The
// drive is rendered, so that truth is known: two laps, 20 m of each with hardly anything to follow. Or it is
// recorded: its frames forwards, then backwards.
// Exit codes: 0 well; 2 a mistake; 3 the recording broke off, 4 interrupted: the results are of the scans
// before.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>

#include "drive.hpp"
#include "outputs.hpp"
#ifdef GAMMA_SLAM_HAS_RECORDINGS
#include "recorded_drive.hpp"
#endif
#include "run.hpp"
#include "support/command_line.hpp"
#include "support/interruption.hpp"
#include "support/progress.hpp"

namespace {

using namespace gamma_slam;

/// What to call after every scan or frame.
std::function<std::optional<std::string>()> watched(example::Progress& progress, const char* what) {
  return [&progress, what]() -> std::optional<std::string> {
    progress.step();
    if (const auto signal = example::Interruption::caught())
      return "interrupted (" + *signal + ") after " + std::to_string(progress.done()) + " " + what;
    return std::nullopt;
  };
}

Results run_with_progress(const Drive& drive, const RunOptions& options) {
  example::Progress progress(std::clog, "scans", drive.scans.size());
  return run(drive, options, watched(progress, "scans"));
}

void print(const Results& r, const std::filesystem::path& out) {
  std::cout << r.scans << " scans, resampled " << r.resampled << " times\n"
            << "mean error: visual odometry " << r.odometry_error() << " m, filter " << r.filter_error()
            << " m\n"
            << "error at the end: visual odometry " << r.odometry_end_error() << " m, filter "
            << r.filter_end_error() << " m\n";
  if (r.coverage)
    std::cout << "90 % intervals of sigma hold in " << 100 * r.coverage->share() << " % of "
              << r.coverage->cells << " cells\n";
  std::cout << "results in " << std::filesystem::absolute(out).lexically_normal().string() << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = "gamma_slam";
  RunOptions options;
  options.threads = std::max(1U, std::thread::hardware_concurrency());
  int laps = 2;
  std::filesystem::path out = "gamma_slam_out";
#ifdef GAMMA_SLAM_HAS_RECORDINGS
  RecordedDriveOptions recorded;
#endif
  CLI::App app{"Maps rough ground by the spread of its heights: particles over a rendered terrain."};
  app.option_defaults()->always_capture_default();
  app.add_option("--cells", options.cells,
                 "what a cell keeps: heights (mean and spread) or variance (spread)")
      ->transform(example::one_of<Cells>({{"heights", Cells::heights}, {"variance", Cells::variance}}))
      ->type_name("NAME")
      ->default_str("heights");
  app.add_option("--cell-size", options.map.geometry.cell_size, "[m]")
      ->check(example::number_between(0.05, 2));
  auto* const laps_option =
      app.add_option("--laps", laps, "of 80 m, of the rendered drive")->check(example::whole_number(1, 20));
#ifdef GAMMA_SLAM_HAS_RECORDINGS
  auto* const folder = app.add_option(
      "--drive", recorded.folder,
      "a folder of recorded stereo images and their true poses (poses_cam0_rectified.txt "
      "of kitti_raw, poses.txt of kitti_odometry, state_groundtruth_estimate0/ of euroc), driven "
      "forwards and backwards");
  folder->excludes(laps_option);
  app.add_option("--kind", recorded.kind, "of the folder: kitti_raw, kitti_odometry or euroc")
      ->check(CLI::IsMember({"kitti_raw", "kitti_odometry", "euroc"}))
      ->needs(folder);
  app.add_option("--frames", recorded.frames, "only so many")
      ->check(example::whole_number(2))
      ->default_str("all")
      ->needs(folder);
#endif
  app.add_option("--out", out, "folder for the maps, the trajectory, the summary and the report");
  app.add_option("--particles", options.particles, "number of particles")
      ->check(example::whole_number(1, 10000));
  app.add_option("--seed", options.seed, "the same seed gives the same results for any number of threads")
      ->check(example::whole_number(0));
  app.add_option("--threads", options.threads, "threads")->check(example::whole_number(1, 1024));
  if (const std::optional<int> code = example::parse(app, name, argc, argv)) return *code;
  return example::exit_code_of(name, [&]() -> int {
#ifdef GAMMA_SLAM_HAS_RECORDINGS
    recorded.seed = options.seed;
    recorded.threads = options.threads;
    std::shared_ptr<const stereo_slam::Dataset> recording;  // what is none is said before a folder is made
    if (!recorded.folder.empty()) recording = opened_recording(recorded);
#endif
    prepare_folder(out);
    const example::Interruption interruption;
    Drive drive;
#ifdef GAMMA_SLAM_HAS_RECORDINGS
    if (recording) {
      example::Progress frames(std::clog, "frames", frame_count(*recording));
      std::optional<example::Progress> steps;  // from the first on, for its clock
      try {
        drive = recorded_drive(*recording, recorded, watched(frames, "frames"), [&] {
          if (!steps) steps.emplace(std::clog, "odometry", frame_count(*recording) - 1);
          return watched(*steps, "steps of odometry")();
        });
      } catch (const Interrupted& why) {
        std::cerr << name << ": " << why.what() << ", before the first scan: nothing is written\n";
        return example::exit_interrupted;
      }
    }
#endif
    if (drive.scans.empty()) drive = simulated_drive({.seed = options.seed, .laps = laps});
    const Results results = run_with_progress(drive, options);
    if (results.ended_early) std::cerr << name << ": " << *results.ended_early << '\n';
    if (const auto no_report = write_outputs(results, out)) std::cout << *no_report << '\n';
    print(results, out);
    if (!results.ended_early) return example::exit_well;
    return results.ended_early == drive.ended_early ? example::exit_data_ended : example::exit_interrupted;
  });
}
