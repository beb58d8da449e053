// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// FastSLAM: particles over paths, each with its own landmarks, from published logs or a simulated drive.
// Exit codes: 0 well; 2 a mistake; 4 interrupted, the results are of the frames before.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>

#include "landmark_log.hpp"
#include "mapper.hpp"
#include "outputs.hpp"
#include "slam.hpp"
#include "support/command_line.hpp"
#include "support/interruption.hpp"
#include "support/progress.hpp"
#include "support/result_folder.hpp"

namespace {

using namespace fastslam;

struct Options {
  std::string data = "loop", name, folder, identities = "known", proposal = "landmarks",
              association = "drawn";
  int robot = 1;
  std::optional<std::size_t> frames;
  std::filesystem::path out = "fastslam_out", save, load;
  SlamOptions slam{.threads = std::max(1U, std::thread::hardware_concurrency())};
};

std::filesystem::path folder_of(const Options& options) {
  if (!options.folder.empty()) return options.folder;
  const char* const name = options.data == "mrclam"          ? "mrclam_7"
                           : options.data == "victoria_park" ? "victoria_park"
                                                             : "fastslam_maps";
  const char* root = std::getenv("CAIRN_DATA");
  if (root == nullptr)
    cairn::raise("--data " + options.data +
                 ": expected its folder as --folder, or that of all data in CAIRN_DATA");
  return std::filesystem::path(root) / name;
}

std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) files.push_back(entry.path());
  return files;
}

LandmarkLog log_of(const Options& options) {
  const std::size_t simulated_frames = options.frames.value_or(500);
  if (options.data == "mrclam") return read_mrclam(folder_of(options), options.robot);
  if (options.data == "victoria_park") {
    const std::filesystem::path folder = folder_of(options);
    LandmarkLog log = read_graph(folder / "victoria_park_graph.txt");
    const std::filesystem::path fixes = folder / "aa3_gpsx.mat", wheels = folder / "aa3_dr.mat";
    if (std::filesystem::exists(fixes) && std::filesystem::exists(wheels)) read_gps(log, fixes, wheels);
    return log;
  }
  if (options.data == "map") {
    if (options.name.empty())
      cairn::raise("--data map: expected the name of a map as --name: example_webmap, say");
    const PointMap map = read_point_map(folder_of(options) / (options.name + ".mat"));
    return simulated(map, options.slam.seed, simulated_frames);
  }
  return simulated(loop_map(), options.slam.seed, simulated_frames);
}

LandmarkLog read_log(const Options& options) {
  LandmarkLog log = log_of(options);
  if (options.frames) log.keep_first(*options.frames);
  if (options.identities == "withheld") log.withhold_identities();
  return log;
}

Results run_with_progress(Mapper& mapper) {
  const example::Interruption interruption;
  example::Progress progress(std::clog, "frames", mapper.log().frames.size() - mapper.steps().size());
  return run(mapper, [&]() -> std::optional<std::string> {
    progress.step();
    if (const auto signal = example::Interruption::caught())
      return "interrupted (" + *signal + ") after " + std::to_string(progress.done()) + " frames";
    return std::nullopt;
  });
}

void print(const Results& r, const std::filesystem::path& out) {
  std::cout << r.steps.size() << " frames, " << r.landmarks.size() << " landmarks\n";
  if (r.path_error)
    std::cout << "path " << *r.path_error << " m, odometry " << *r.odometry_error
              << " m (rms after a rigid fit)\n";
  if (r.landmark_error)
    std::cout << "landmarks " << *r.landmark_error << " m (rms after a rigid fit of their own)\n";
  if (r.median_nees)
    std::cout << "NEES of the pose " << *r.median_nees << " (median; 2.4 where its covariance is right)\n";
  if (r.gps_median) std::cout << "GPS " << *r.gps_median << " m from the path (median after a rigid fit)\n";
  for (const std::string& note : r.notes) std::cout << note << "\n";
  std::cout << "results in " << std::filesystem::absolute(out).lexically_normal().string() << "\n";
}

void add_options(CLI::App& app, Options& o) {
  app.option_defaults()->always_capture_default();
  app.add_option("--data", o.data,
                 "loop (simulated), map (simulated over a published map), mrclam, victoria_park")
      ->check(CLI::IsMember({"loop", "map", "mrclam", "victoria_park"}));
  app.add_option("--name", o.name,
                 "of the map: example_webmap, example_loop1, example_loop2, example_loop902");
  app.add_option("--folder", o.folder, "where the data is; else below CAIRN_DATA");
  app.add_option("--robot", o.robot, "of mrclam")->check(example::whole_number(1, 5));
  app.add_option("--frames", o.frames, "only so many; of a simulated drive, five a second, 500")
      ->check(example::whole_number(1, 1000000))
      ->default_str("all");
  app.add_option("--identities", o.identities, "known or withheld: is it said which landmark was seen?")
      ->check(CLI::IsMember({"known", "withheld"}));
  app.add_option("--association", o.association, "where withheld: likeliest, or drawn by each particle")
      ->check(CLI::IsMember({"likeliest", "drawn"}));
  app.add_option("--proposal", o.proposal, "motion (FastSLAM 1.0) or landmarks (2.0)")
      ->check(CLI::IsMember({"motion", "landmarks"}));
  app.add_option("--out", o.out, "folder for the trajectory, the landmarks, the summary and the report");
  app.add_option("--particles", o.slam.particles, "number of particles")
      ->check(example::whole_number(1, 100000));
  app.add_option(
         "--redraw", o.slam.redraw_below,
         "draw all paths again when fewer than this share of those drawn before have descendants; 0: never")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--seed", o.slam.seed, "the same seed gives the same results for any number of threads")
      ->check(example::whole_number(0));
  app.add_option("--threads", o.slam.threads, "threads")->check(example::whole_number(1, 1024));
  app.add_option("--save", o.save, "a file for the map and all that going on with it needs")
      ->default_str("none");
  app.add_option("--load", o.load,
                 "a map to go on with: the log begins with the frames that it was made of, and has more")
      ->default_str("none");
}

/// Throws where an option was given that would do nothing.
void expect_use_of_all(const CLI::App& app, const Options& o) {
  using example::expect_absent;
  if (o.data != "map") expect_absent(app, {"--name"}, "for --data map");
  if (o.data == "loop") expect_absent(app, {"--folder"}, "for data that is read: map, mrclam, victoria_park");
  if (o.data != "mrclam") expect_absent(app, {"--robot"}, "for --data mrclam");
  if (o.identities == "known") expect_absent(app, {"--association"}, "for --identities withheld");
  if (o.proposal == "motion" && o.slam.redraw_below > 0)
    expect_absent(app, {"--redraw"}, "for --proposal landmarks");
  if (!o.load.empty())
    expect_absent(app, {"--particles", "--seed", "--proposal", "--association", "--redraw"},
                  "for a map that begins: a loaded one has its own");
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = "fastslam";
  Options options;
  CLI::App app{
      "Maps landmarks from odometry and sightings: a particle filter, each particle with its own map."};
  add_options(app, options);
  if (const std::optional<int> code = example::parse(app, name, argc, argv)) return *code;
  return example::exit_code_of(name, [&]() -> int {
    expect_use_of_all(app, options);
    if (!options.save.empty() && options.data != "loop")
      example::expect_not_read(options.save, files_in(folder_of(options)));
    options.slam.proposal = options.proposal == "motion" ? ProposalKind::motion : ProposalKind::landmarks;
    options.slam.landmarks.pick =
        options.association == "drawn" ? cairn::Pick::drawn : cairn::Pick::likeliest;
    if (!options.load.empty()) options.slam.seed = saved_options(options.load).seed;  // of a simulated drive
    const LandmarkLog log = read_log(options);
    Mapper mapper = options.load.empty() ? Mapper(log, options.slam)
                                         : Mapper::loaded(options.load, log, options.slam.threads);
    if (!options.load.empty() && !mapper.has_next())
      cairn::raise(options.load.string() + ": the map is of all " + std::to_string(log.frames.size()) +
                   " frames of the log: expected more to go on with (--frames)");
    const example::NoEmptyFolder tidy(options.out);
    prepare_folder(options.out, {options.save});
    const Results results = run_with_progress(mapper);
    if (results.ended_early) std::cerr << name << ": " << *results.ended_early << '\n';
    if (const auto no_report = write_outputs(results, options.out)) std::cout << *no_report << '\n';
    if (!options.save.empty()) mapper.save(options.save);
    print(results, options.out);
    return results.ended_early ? example::exit_interrupted : example::exit_well;
  });
}
