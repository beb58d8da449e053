// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Grid SLAM: a Rao-Blackwellised particle filter over occupancy grids, from a CARMEN log or a rendered drive.
// Exit codes: 0 well; 2 a mistake; 3 a scan could not be mapped, 4 interrupted, the results are of the scans
// before.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iostream>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>
#include <cairn/eval/relations.hpp>
#include <cairn/io/carmen.hpp>

#include "floor_plan.hpp"
#include "outputs.hpp"
#include "run.hpp"
#include "scan_checks.hpp"
#include "stop_mapper.hpp"
#include "support/command_line.hpp"
#include "support/interruption.hpp"
#include "support/progress.hpp"
#include "support/result_folder.hpp"

namespace {

using namespace grid_slam;

enum class Maps { tiles, ancestry, stop };
enum class Frame { odometry, start };

constexpr std::size_t film_frames = 48;  // of the report

struct Options {
  Maps map = Maps::tiles;
  Frame frame = Frame::start;
  StopProposal proposal = StopProposal::motion;
  std::string log, relations;
  bool simulate = false;
  std::filesystem::path out = "grid_slam_out";
  std::filesystem::path save, load;
  bool localise = false;
  std::vector<double> window;
  std::optional<double> resolution;
  std::optional<std::size_t> particles;
  std::optional<std::uint64_t> seed;
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
};

struct Input {
  std::string name;
  cairn::CarmenLog log;
  std::vector<cairn::PoseRelation> relations;
  std::vector<std::string> notes;
};

Input input_of(const Options& options) {
  Input input;
  if (options.log.empty()) {
    const Drive drive = simulated_drive({.seed = options.seed.value_or(1)});
    input = {"rendered drive", drive.log, true_relations(drive), {}};
  } else {
    input.name = std::filesystem::path(options.log).filename().string();
    input.log = cairn::read_carmen(options.log);
    cairn::place_by_odometry(input.log, options.log);
    input.notes = check_scans(input.log, options.log);
  }
  if (!options.relations.empty()) input.relations = cairn::read_relations(options.relations);
  return input;
}

/// Of the laser in a new map; none: where odometry has it.
std::optional<cairn::SE2> start_of(const Options& options) {
  return options.frame == Frame::start ? std::optional(cairn::SE2()) : std::nullopt;
}

Mapper mapper_of(const Options& options) {
  if (!options.load.empty()) {
    const MapRequest wanted{options.resolution, options.particles, options.seed, options.threads};
    if (!options.localise) return Mapper::loaded(options.load, wanted);
    std::optional<PlaceWindow> window;
    if (!options.window.empty())
      window = {options.window[0], options.window[1], options.window[2], options.window[3]};
    return Mapper::localiser(options.load, wanted, window);
  }
  MapperOptions made;
  made.particles = options.particles.value_or(made.particles);
  made.seed = options.seed.value_or(made.seed);
  made.threads = options.threads;
  made.cell_size = options.resolution.value_or(made.cell_size);
  made.start = start_of(options);
  return Mapper(made);
}

/// What to call after every scan.
std::function<std::optional<std::string>()> watched(example::Progress& progress) {
  return [&]() -> std::optional<std::string> {
    progress.step();
    if (const auto signal = example::Interruption::caught())
      return "interrupted (" + *signal + ") after " + std::to_string(progress.done()) + " scans";
    return std::nullopt;
  };
}

Results map_stops(const Options& options, const Input& input) {
  StopMapperOptions made = options.proposal == StopProposal::match ? matching_stops() : StopMapperOptions{};
  made.start = start_of(options);
  made.storage = options.map == Maps::ancestry ? StopStorage::ancestry : StopStorage::tiles;
  made.particles = options.particles.value_or(made.particles);
  made.seed = options.seed.value_or(made.seed);
  made.threads = options.threads;
  made.map.geometry.cell_size = options.resolution.value_or(made.map.geometry.cell_size);
  prepare_folder(options.out);
  const example::Interruption interruption;
  example::Progress progress(std::clog, "scans", input.log.scans.size());
  return run_stop_mapper(input.log, made, input.relations, watched(progress), film_frames);
}

Results map_occupancy(const Options& options, const Input& input, std::optional<Mapper>& mapper) {
  mapper.emplace(mapper_of(options));
  prepare_folder(options.out, {options.save});
  const example::Interruption interruption;
  example::Progress progress(std::clog, "scans", input.log.scans.size());
  return run(*mapper, input.log, input.relations, watched(progress), film_frames);
}

void print(const Results& r, const std::filesystem::path& out) {
  std::cout << r.steps.size() << " of " << r.scans << " scans processed, " << r.loops.size() << " loops\n";
  for (std::size_t i = 0; i < r.places.size() && i < 2; ++i) {
    const cairn::SE2& p = r.places[i].pose;
    std::cout << (i == 0 ? "began at " : "the second best place: ") << p.x() << " " << p.y() << " m, heading "
              << p.angle() << " rad, share " << r.places[i].share << "\n";
  }
  if (!r.places.empty() && r.places.front().share < 0.9)
    std::cout << "places look alike to the first scan: a smaller --window decides\n";
  const auto line = [](const char* name, const std::optional<cairn::RelationError>& e) {
    if (e && e->count > 0)
      std::cout << "relations, " << name << e->mean << " m, " << e->mean_angle * 57.29577951308232
                << " deg, largest " << e->largest << " m\n";
  };
  line("odometry    ", r.of_odometry);
  line("means       ", r.of_means);
  line("rematched   ", r.of_rematched);
  std::cout << "results in " << std::filesystem::absolute(out).lexically_normal().string() << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = "grid_slam";
  Options options;
  CLI::App app{"Maps a floor from laser scans and odometry: a particle filter over occupancy grids."};
  app.option_defaults()->always_capture_default();
  auto* log = app.add_option("--log", options.log,
                             "a CARMEN log (FLASER, ROBOTLASER1 or RAWLASER1 lines) or one of DP-SLAM");
  app.add_flag("--simulate", options.simulate, "a rendered drive around a corridor, also without --log")
      ->excludes(log);
  app.add_option("--map", options.map,
                 "tiles: occupancy, scans matched; stop, ancestry: DP-SLAM on shared tiles or on its tree")
      ->transform(
          example::one_of<Maps>({{"tiles", Maps::tiles}, {"stop", Maps::stop}, {"ancestry", Maps::ancestry}}))
      ->type_name("NAME")
      ->default_str("tiles");
  app.add_option("--frame", options.frame,
                 "of a new map and of the path in it: the laser's first pose, wherever odometry begins, or "
                 "odometry's, which --map stop and ancestry have without being asked")
      ->transform(example::one_of<Frame>({{"odometry", Frame::odometry}, {"start", Frame::start}}))
      ->type_name("NAME")
      ->default_str("start");
  app.add_option("--proposal", options.proposal,
                 "of --map stop and ancestry: poses drawn from odometry (motion), or where the scan matches")
      ->transform(
          example::one_of<StopProposal>({{"motion", StopProposal::motion}, {"match", StopProposal::match}}))
      ->type_name("NAME")
      ->default_str("motion");
  app.add_option("--relations", options.relations,
                 "relations to measure the path by: t1 t2 x y z roll pitch yaw");
  app.add_option("--out", options.out, "folder for the map, the trajectory, the summary and the report");
  auto* load =
      app.add_option("--load", options.load, "a map to go on with: the log goes on where that one ended");
  auto* localise =
      app.add_flag("--localise", options.localise, "leave the loaded map as it is, and find the way in it")
          ->needs(load);
  app.add_option("--window", options.window,
                 "left bottom right top [m] of where the robot may be; without, it is where the map ended")
      ->expected(4)
      ->check(example::number_between(-1e6, 1e6))
      ->needs(localise);
  app.add_option("--save", options.save, "a file for the map and all that going on with it needs")
      ->excludes(localise);
  app.add_option("--resolution", options.resolution, "side of a cell [m]: 0.05, or what a loaded map has")
      ->check(example::number_between(0.01, 1));
  app.add_option("--particles", options.particles,
                 "number of particles: 30 (50 of --map stop and ancestry drawn from motion), or what a "
                 "loaded map has")
      ->check(example::whole_number(1, 10000));
  app.add_option(
         "--seed", options.seed,
         "the same seed gives the same results for any number of threads: 1, or what a loaded map has")
      ->check(example::whole_number(0));
  app.add_option("--threads", options.threads, "threads")->check(example::whole_number(1, 1024));
  if (const std::optional<int> code = example::parse(app, name, argc, argv)) return *code;
  return example::exit_code_of(name, [&]() -> int {
    if (options.map != Maps::tiles && !(options.save.empty() && options.load.empty()))
      cairn::raise("--save and --load are for --map tiles");
    if (options.map == Maps::tiles && app.count("--proposal") > 0)
      cairn::raise("--proposal is for --map stop and --map ancestry");
    if (app.count("--frame") > 0 && !options.load.empty())
      cairn::raise("--frame is for a new map: a loaded one has its own");
    if (!options.load.empty() && options.log.empty() && !options.simulate)
      cairn::raise("--load goes on with a log: expected --log too, or --simulate for the rendered drive");
    if (app.count("--frame") == 0 && options.map != Maps::tiles) options.frame = Frame::odometry;
    example::expect_not_read(options.save, {options.log, options.relations});
    const Input input = input_of(options);
    const example::NoEmptyFolder tidy(options.out);
    std::optional<Mapper> mapper;
    Results results =
        options.map == Maps::tiles ? map_occupancy(options, input, mapper) : map_stops(options, input);
    results.name = input.name;
    results.notes.insert(results.notes.begin(), input.notes.begin(), input.notes.end());
    if (results.data_ended) *results.ended_early = input.name + ": " + *results.ended_early;
    if (results.ended_early) std::cerr << name << ": " << *results.ended_early << '\n';
    for (const std::string& note : results.notes) std::cerr << name << ": " << note << '\n';
    if (const auto no_report = write_outputs(results, options.out)) std::cout << *no_report << '\n';
    if (mapper && !options.save.empty()) mapper->save(options.save);
    print(results, options.out);
    if (results.data_ended) return example::exit_data_ended;
    return results.ended_early ? example::exit_interrupted : example::exit_well;
  });
}
