// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// stereo_slam: runs the stereo landmark SLAM system on a rendered arena or a recorded drive.
///
/// Exit codes: 0 all frames; 2 a mistake, or nothing could be done; 3 a frame could not be read, and 4
/// interrupted: the results are of the frames before.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>

#include "dataset.hpp"
#include "frames_ahead.hpp"
#include "outputs.hpp"
#include "pipeline.hpp"
#include "run_report.hpp"
#include "summary.hpp"
#include "support/command_line.hpp"
#include "support/interruption.hpp"
#include "support/live_page.hpp"
#include "support/progress.hpp"
#include "support/report.hpp"
#include "support/result_folder.hpp"
#include "support/rig_file.hpp"
#include "support/standard_output.hpp"
#include "there_and_back.hpp"

namespace {

struct Arguments {
  stereo_slam::DatasetOptions dataset;
  stereo_slam::PipelineOptions pipeline;
  std::filesystem::path out = "stereo_slam_out";
  std::filesystem::path camera, dump, map, save_map, save_rig;
  bool there_and_back = false;
  std::optional<std::uint16_t> live;
  std::string store = "multi";
  std::string features = "surf";
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  std::string calibrate = "auto";
  std::string motion = "off";
};

/// Takes the words of a choice.
template <class Names>
CLI::Validator one_of(const Names& names) {
  return CLI::IsMember(std::vector<std::string>(names.begin(), names.end()));
}

/// The choice that a word stands for, which is one of `names`, in the order of the enumeration.
template <class Choice, class Names>
Choice choice_of(const Names& names, const std::string& word) {
  return static_cast<Choice>(std::ranges::find(names, word) - names.begin());
}

/// Everything the command line can say; CLI11 ends the program by an exception on --help and on mistakes.
void define(CLI::App& app, Arguments& arguments, std::vector<std::string>& dataset) {
  app.add_option("--dataset", dataset,
                 "arena (rendered, needs nothing), or a recorded drive and its folder:\n"
                 "kitti_odometry DIR, kitti_raw DIR (unrectified), euroc DIR; for other images see --left")
      ->expected(1, 2)
      ->type_name("KIND [DIR]")
      ->default_str("arena");
  CLI::Option* const camera =
      app.add_option(
             "--camera", arguments.camera,
             "the stereo rig (rig.yaml, of cairn, OpenCV or Kalibr): of --left and --right, or instead of "
             "the recording's own")
          ->type_name("FILE");
  CLI::Option* const left =
      app.add_option("--left", arguments.dataset.left,
                     "images of anybody's: the left ones as a pattern in quotes, 'drive/left/*.png'")
          ->type_name("GLOB")
          ->needs(camera)
          ->excludes("--dataset");
  app.add_option("--right", arguments.dataset.right, "the right ones; paired by the numbers in their names")
      ->type_name("GLOB")
      ->needs(left);
  left->needs("--right");
  app.add_option("--fps", arguments.dataset.rate, "their frames a second (default: the names are times)")
      ->check(example::number_between(1e-3, 1e4))
      ->needs(left);
  app.add_option("--out", arguments.out, "folder for the results")->type_name("DIR")->capture_default_str();
  app.add_option("--frames", arguments.dataset.frames, "stop after so many frames; 0 = all")
      ->check(example::whole_number(0))
      ->capture_default_str();
  app.add_option("--seed", arguments.pipeline.seed,
                 "of the arena and of all random draws; same seed, same bytes")
      ->check(example::whole_number(0))
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "threads; the results do not depend on it")
      ->check(example::whole_number(1, 1024))
      ->capture_default_str();
  app.add_option("--store", arguments.store,
                 "landmark store: multi (a forest of kd-trees) or single (one, rebuilt)")
      ->check(CLI::IsMember({"multi", "single"}))
      ->capture_default_str();
  app.add_option("--points", arguments.pipeline.points, "interest points to keep in an image")
      ->check(example::whole_number(50, 20000))
      ->capture_default_str();
  app.add_option_function<double>(
         "--budget", [&](double milliseconds) { arguments.pipeline.budget.milliseconds = milliseconds; },
         "keep the work on a frame (all but reading it) near MS milliseconds: where that is too little, less "
         "is done, what is\nmissed least first, and summary.json and the report say what was left out. The "
         "results then depend on how fast this\nmachine is; without it they do not")
      ->check(example::number_between(0.01, 1e6))
      ->type_name("MS");
  app.add_flag("--oriented", arguments.pipeline.oriented,
               "oriented SURF, for cameras that roll (default: upright)");
  app.add_option(
         "--calibrate", arguments.calibrate,
         "the rig's calibration is corrected while moving: auto (where the first frame shows that it "
         "is off,\n"
         "and where later ones show that it has come loose), on, off, or drifting (loose from the start)")
      ->check(one_of(stereo_slam::calibration_names))
      ->capture_default_str();
  app.add_option("--motion", arguments.motion,
                 "a filter follows the camera's motion: off, ekf, iterated or ukf. It narrows the search, "
                 "carries the "
                 "camera\nover frames that show nothing and refuses poses that it cannot have come to")
      ->check(one_of(stereo_slam::motion_names))
      ->capture_default_str();
  app.add_option("--features", arguments.features,
                 "interest points: surf, or OpenCV's sift or orb where it was there when building")
      ->check(one_of(stereo_slam::feature_names))
      ->capture_default_str();
  app.add_option("--script", arguments.dataset.arena.script,
                 "arena: loop (two laps), turn (on the spot) or spiral")
      ->check(CLI::IsMember({"loop", "turn", "spiral"}))
      ->capture_default_str();
  app.add_option("--drift", arguments.dataset.arena.drift,
                 "arena: the right camera turns by so many degrees in 100 frames, unknown to the system")
      ->check(example::number_between(-5, 5))
      ->capture_default_str();
  app.add_flag("--there-and-back", arguments.there_and_back,
               "the frames forwards, then backwards: how far from its start does the drive end?");
  app.add_flag("!--no-cache", arguments.dataset.arena.cache, "arena: do not keep rendered images on disk");
  app.add_option(
         "--live", arguments.live,
         "serve the report while it grows to a browser of this machine, at this port of 127.0.0.1; without "
         "one, or 0: any free one")
      ->check(example::whole_number(0, 65535))
      ->expected(0, 1)
      ->default_str("0")
      ->type_name("PORT");
  app.add_option("--save", arguments.save_map, "write the map for another run into FILE")->type_name("FILE");
  app.add_option("--save-rig", arguments.save_rig,
                 "write the rig as the run corrected it, with its standard deviations, for --camera")
      ->type_name("FILE");
  CLI::Option* const map =
      app.add_option("--load", arguments.map, "begin in the map of an earlier run and go on with it")
          ->type_name("FILE");
  app.add_flag("--localise", arguments.pipeline.localise, "leave that map as it is")->needs(map);
  app.add_option("--dump", arguments.dump, "write the frames as a KITTI odometry sequence into DIR and stop")
      ->type_name("DIR");
}

/// Throws where an option was given that would do nothing.
void expect_use_of_all(const CLI::App& app, const Arguments& arguments) {
  const bool arena = arguments.dataset.kind == "arena";
  if (arena && !arguments.dataset.folder.empty())
    cairn::raise("--dataset arena is rendered; expected no folder, found " +
                 arguments.dataset.folder.string());
  if (!arena) example::expect_absent(app, {"--script", "--drift"}, "for --dataset arena");
  if (arguments.features != "surf") example::expect_absent(app, {"--oriented"}, "for --features surf");
  if (!arguments.dump.empty())
    example::expect_absent(app,
                           {"--out", "--store", "--points", "--budget", "--oriented", "--calibrate",
                            "--motion", "--features", "--live", "--save", "--save-rig", "--load"},
                           "for a run, and --dump makes none");
  example::expect_not_read(arguments.save_map, {arguments.camera});
}

/// What a run left, and with which exit code the program is to say so.
struct Run {
  stereo_slam::RunRecord record;
  int code = example::exit_well;
  std::optional<std::string> not_saved{};  ///< why there is no map
};

/// The report of a run that is under way.
example::Report growing_report(stereo_slam::RunRecord record, std::size_t frames) {
  record.notes.insert(record.notes.begin(), "frame " + std::to_string(record.frames.size()) + " of " +
                                                std::to_string(frames) + ": the run goes on");
  return run_report(record, summarise(record));
}

/// Runs the system over the data set; the next frames are read and their points found while one is worked on.
/// A frame that cannot be read and an interruption end the run early, with what there is until then; throws
/// where that is nothing.
Run run(const stereo_slam::Dataset& dataset, const Arguments& arguments, example::LivePage* live) {
  using Clock = std::chrono::steady_clock;
  Run result;
  stereo_slam::Pipeline pipeline =
      arguments.map.empty()
          ? stereo_slam::Pipeline(dataset.rig(), arguments.pipeline)
          : stereo_slam::Pipeline(dataset.rig(), arguments.pipeline, stereo_slam::load_map(arguments.map),
                                  arguments.map.string());
  const auto record_so_far = [&] {
    stereo_slam::RunRecord record = pipeline.record();
    record.dataset = dataset.name();
    record.threads = arguments.threads;
    const std::vector<std::string> notes = dataset.notes();
    record.notes.insert(record.notes.begin(), notes.begin(), notes.end());
    return record;
  };
  example::Progress progress(std::cerr, "frames", dataset.size());
  const Clock::time_point start = Clock::now();
  std::string why;
  const example::Interruption interruption;
  try {
    stereo_slam::FramesAhead frames(dataset, stereo_slam::feature_options(arguments.pipeline),
                                    arguments.threads);
    for (std::size_t i = 0; i < dataset.size(); ++i) {
      if (const auto signal = interruption.caught()) {
        why = "interrupted (" + *signal + ")";
        result.code = example::exit_interrupted;
        break;
      }
      const stereo_slam::FrameAhead next = frames.take();
      const stereo_slam::FrameRecord& done = pipeline.step(next.frame, next.points, next.load_milliseconds);
      frames.match_by(pipeline.settled_matcher());
      frames.leave_alone(pipeline.left_alone());
      frames.keep(pipeline.wanted_points());
      progress.step(done.tracked
                        ? std::to_string(done.inliers) + " of " + std::to_string(done.stereo_matches) +
                              " points agree, " + std::to_string(done.landmarks) + " landmarks"
                        : "lost");
      if (live && live->wanted()) live->show(growing_report(record_so_far(), dataset.size()));
    }
  } catch (const std::exception& error) {
    if (progress.done() == 0) throw;
    why = error.what();
    result.code = example::exit_data_ended;
  }
  try {  // a full disk is said when the results are there
    if (!arguments.save_map.empty() && progress.done() > 0)
      stereo_slam::save_map(arguments.save_map, pipeline.map());
  } catch (const cairn::Error& error) {
    result.not_saved = error.what();
  }
  stereo_slam::RunRecord& record = result.record = record_so_far();
  record.newest.reset();
  if (!why.empty())
    record.ended_early = "ended after " + std::to_string(record.frames.size()) + " of " +
                         std::to_string(dataset.size()) + " frames: " + why;
  record.seconds = std::chrono::duration<double>(Clock::now() - start).count();
  return result;
}

/// Writes the frames as a KITTI sequence, those before an interruption where there is one.
int dump(const stereo_slam::Dataset& dataset, const std::filesystem::path& folder) {
  example::Progress progress(std::cerr, "frames", dataset.size());
  const example::Interruption interruption;
  const std::size_t written = stereo_slam::write_kitti_sequence(dataset, folder, [&] {
    progress.step();
    return !interruption.caught();
  });
  if (const auto signal = interruption.caught())
    std::cerr << "stereo_slam: interrupted (" << *signal << ") after " << written << " of " << dataset.size()
              << " frames\n";
  std::cout << "KITTI odometry sequence of " << written << " frames: " << folder.string() << '\n';
  if (!example::flush_standard_output("stereo_slam")) return example::exit_mistake;
  return interruption.caught() ? example::exit_interrupted : example::exit_well;
}

/// The run in a few lines; summary.json has everything.
void print_summary(const stereo_slam::RunRecord& record) {
  const stereo_slam::Summary summary = stereo_slam::summarise(record);
  const stereo_slam::Timing timing = stereo_slam::timing(record);
  for (const std::string& note : record.notes) std::cout << "note: " << note << '\n';
  std::printf("%s: %zu frames, %zu lost, %.1f s, %.1f frames a second, %zu landmarks\n",
              record.dataset.c_str(), summary.frames, summary.frames_lost, timing.seconds, timing.hz,
              summary.landmarks);
  if (summary.budget) std::printf("%s\n", stereo_slam::budget_text(*summary.budget).c_str());
  if (!summary.errors) return;
  const stereo_slam::TruthErrors& errors = *summary.errors;
  std::printf("path %.2f m, error at the end %s, largest %s and %.2g degrees\n", summary.path,
              example::readable_length(errors.end).words().c_str(),
              example::readable_length(errors.largest.position).words().c_str(),
              errors.largest.heading * stereo_slam::degrees);
}

/// How far a drive there and back ends from where it began.
void print_return(const stereo_slam::RunRecord& record) {
  const stereo_slam::ReturnError error = stereo_slam::return_error(record.frames);
  std::printf("back at the start: %s off after %.1f m (%.2g %%), turned by %.2g degrees\n",
              example::readable_length(error.distance).words().c_str(), error.path, error.percent(),
              error.angle * stereo_slam::degrees);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Stereo landmark SLAM: SURF points, a growing forest of kd-trees, robust pose in pixels, keyframes "
      "with "
      "one joint covariance.");
  Arguments arguments;
  std::vector<std::string> dataset{"arena"};
  define(app, arguments, dataset);
  if (const std::optional<int> code = example::parse(app, "stereo_slam", argc, argv)) return *code;
  try {
    arguments.dataset.kind = arguments.dataset.left.empty() ? dataset.front() : "images";
    if (dataset.size() > 1) arguments.dataset.folder = dataset[1];
    expect_use_of_all(app, arguments);
    arguments.pipeline.threads = stereo_slam::threads_behind(arguments.threads);
    arguments.dataset.threads = arguments.threads;
    if (arguments.dump.empty()) arguments.dataset.threads /= stereo_slam::threads_ahead(arguments.threads);
    arguments.dataset.arena.seed = arguments.pipeline.seed;
    arguments.pipeline.store.kind =
        arguments.store == "multi" ? stereo_slam::StoreKind::multi : stereo_slam::StoreKind::single;
    arguments.pipeline.features =
        choice_of<stereo_slam::FeatureKind>(stereo_slam::feature_names, arguments.features);
    arguments.pipeline.calibrate =
        choice_of<stereo_slam::Calibration>(stereo_slam::calibration_names, arguments.calibrate);
    arguments.pipeline.motion.filter =
        choice_of<stereo_slam::Motion>(stereo_slam::motion_names, arguments.motion);
    std::optional<example::CalibratedRig> given;
    if (!arguments.camera.empty()) {
      given = example::read_rig(arguments.camera);
      arguments.dataset.rig = given->rig;
    }
    auto frames = stereo_slam::open_dataset(arguments.dataset);
    if (arguments.there_and_back) frames = stereo_slam::there_and_back(std::move(frames));
    if (!arguments.dump.empty()) return dump(*frames, arguments.dump);
    if (given) {
      // What was calibrated well may have come loose since: never surer than by default.
      cairn::RigSigmas& rig = arguments.pipeline.rig;
      rig.rotation = std::max(rig.rotation, given->angle_sigma().value_or(0));
      rig.direction = std::max(rig.direction, given->angle_sigma().value_or(0));
    }
    stereo_slam::prepare_output_folder(arguments.out, {arguments.save_map, arguments.save_rig});
    arguments.pipeline.sample_frame = frames->size() / 2;
    std::optional<example::LivePage> live;
    if (arguments.live) {
      live.emplace(*arguments.live);
      arguments.pipeline.keep_newest = true;
      std::cerr << "live report: " << live->address() << '\n';
    }
    const Run done = run(*frames, arguments, live ? &*live : nullptr);
    if (done.record.ended_early) std::cerr << "stereo_slam: " << *done.record.ended_early << '\n';
    if (done.record.frames.empty()) return done.code;  // the results of an earlier run stay
    const std::optional<std::string> no_report = stereo_slam::write_outputs(done.record, arguments.out);
    if (live && !no_report) live->finish(cairn::read_file(arguments.out / "report.html"));
    print_summary(done.record);
    if (arguments.there_and_back && !done.record.ended_early) print_return(done.record);
    if (no_report) std::cout << "no report.html: " << *no_report << '\n';
    std::cout << "results: " << arguments.out.string() << '\n';
    const bool said = example::flush_standard_output("stereo_slam");
    if (!arguments.save_rig.empty()) {
      if (!given) given.emplace();
      given->rig = frames->rig();  // which knows the size of its images
      example::write_rig(arguments.save_rig, stereo_slam::learned_rig(*given, done.record));
    }
    if (done.not_saved) cairn::raise(*done.not_saved);
    return said ? done.code : example::exit_mistake;
  } catch (const std::exception& error) {
    std::cerr << "stereo_slam: " << error.what() << '\n';
    return example::exit_mistake;
  }
}
