// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Grid SLAM: a Rao-Blackwellised particle filter over occupancy grids, from a CARMEN log or a rendered drive.
// Exit codes: 0 well; 2 a mistake; 4 interrupted, the results are of the scans before.
#include <algorithm>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>

#include <cairn/eval/relations.hpp>
#include <cairn/io/carmen.hpp>

#include "floor_plan.hpp"
#include "outputs.hpp"
#include "run.hpp"
#include "support/command_line.hpp"
#include "support/interruption.hpp"
#include "support/progress.hpp"
#include "support/standard_output.hpp"

namespace {

using namespace grid_slam;

struct Options {
  std::string log, relations;
  bool simulate = false;
  std::filesystem::path out = "grid_slam_out";
  std::size_t particles = 30;
  std::uint64_t seed = 1;
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
};

struct Input {
  std::string name;
  cairn::CarmenLog log;
  std::vector<cairn::PoseRelation> relations;
};

Input input_of(const Options& options) {
  Input input;
  if (options.log.empty()) {
    const Drive drive = simulated_drive({.seed = options.seed});
    input = {"rendered drive", drive.log, true_relations(drive)};
  } else {
    input.name = std::filesystem::path(options.log).filename().string();
    input.log = cairn::read_carmen(options.log);
    cairn::place_by_odometry(input.log, options.log);
  }
  if (!options.relations.empty()) input.relations = cairn::read_relations(options.relations);
  return input;
}

Results run_with_progress(const Input& input, const MapperOptions& options) {
  const example::Interruption interruption;
  example::Progress progress(std::clog, "scans", input.log.scans.size());
  return run(input.log, options, input.relations, [&]() -> std::optional<std::string> {
    progress.step();
    if (const auto signal = example::Interruption::caught())
      return "interrupted (" + *signal + ") after " + std::to_string(progress.done()) + " scans";
    return std::nullopt;
  });
}

void print(const Results& r, const std::filesystem::path& out) {
  std::cout << r.steps.size() << " of " << r.scans << " scans processed, " << r.loops.size() << " loops\n";
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
  auto* log = app.add_option("--log", options.log, "a CARMEN log: FLASER or ROBOTLASER1 lines");
  app.add_flag("--simulate", options.simulate, "a rendered drive around a corridor, also without --log")
      ->excludes(log);
  app.add_option("--relations", options.relations,
                 "relations to measure the path by: t1 t2 x y z roll pitch yaw");
  app.add_option("--out", options.out, "folder for the map, the trajectory, the summary and the report");
  app.add_option("--particles", options.particles, "number of particles")
      ->check(example::whole_number(1, 10000));
  app.add_option("--seed", options.seed, "the same seed gives the same results for any number of threads")
      ->check(example::whole_number(0));
  app.add_option("--threads", options.threads, "threads")->check(example::whole_number(1, 1024));
  if (const std::optional<int> code = example::parse(app, name, argc, argv)) return *code;
  try {
    const Input input = input_of(options);
    prepare_folder(options.out);
    Results results = run_with_progress(
        input, {.particles = options.particles, .seed = options.seed, .threads = options.threads});
    results.name = input.name;
    if (results.ended_early) std::cerr << name << ": " << *results.ended_early << '\n';
    if (const auto no_report = write_outputs(results, options.out)) std::cout << *no_report << '\n';
    print(results, options.out);
    if (!example::flush_standard_output(name)) return example::exit_mistake;
    return results.ended_early ? example::exit_interrupted : example::exit_well;
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << '\n';
    return example::exit_mistake;
  }
}
