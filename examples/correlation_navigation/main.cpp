// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Correlation navigation: a vehicle that sees a patch of a mapped field knows where it is. Four experiments:
// the founding document's straight flight, acquisition, a flight with turns and a loss, mapping along a loop.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <iostream>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/field/random_field.hpp>

#include "outputs.hpp"
#include "terrain_file.hpp"

namespace {

using namespace correlation_navigation;

struct Options {
  std::string terrain;
  double spacing = 30;
  std::filesystem::path out = "correlation_navigation_out";
  std::size_t runs = 200;
  std::size_t starts = 100;
  std::uint64_t seed = 1;
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
};

/// 27 x 21 km of rolling synthetic ground, 200 m of standard deviation.
cairn::FieldGrid synthetic_ground(std::uint64_t seed) {
  cairn::Random random(seed, 99);
  return cairn::RandomField{200.0, 1.0 / 600.0}.draw(900, 700, {0, 0, 30, 30}, random);
}

Results run(const Options& options) {
  const auto begin = std::chrono::steady_clock::now();
  Results results;
  results.seed = options.seed;
  results.runs = options.runs;
  results.field = options.terrain.empty() ? "synthetic Gaussian random field"
                                          : std::filesystem::path(options.terrain).filename().string();
  const cairn::FieldGrid field = options.terrain.empty() ? synthetic_ground(options.seed)
                                                         : read_terrain(options.terrain, options.spacing);
  results.straight_options.seed = options.seed;
  results.straight_options.threads = options.threads;
  std::clog << "straight flight, " << options.runs << " runs\n";
  results.straight = fly_straight(results.straight_options, options.runs);
  results.budget = error_budget(results.straight_options);
  results.divergence = divergence(results.straight_options, std::max<std::size_t>(1, options.runs / 2));
  // A field may be too small for a flight: say so and go on with the others.
  const auto fly = [&](const char* name, const auto& flight) {
    std::clog << name << '\n';
    try {
      flight();
    } catch (const cairn::Error& error) {
      results.notes.emplace_back(error.what());
    }
  };
  fly("acquisition", [&] {
    results.acquisition =
        acquire(field, {.starts = options.starts, .seed = options.seed, .threads = options.threads});
  });
  fly("flight with turns", [&] { results.planar = fly_planar(field, {.seed = options.seed}); });
  fly("loop", [&] { results.loop = fly_loop(field, {.seed = options.seed}); });
  results.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return results;
}

void print(const Results& r, const std::filesystem::path& out) {
  std::cout << "position RMSE over the Cramer-Rao bound  " << r.straight.rmse_over_bound << "\n"
            << "NEES of 5 states                         " << r.straight.nees_mean << "  (band "
            << r.straight.nees_band.low << " to " << r.straight.nees_band.high << ")\n"
            << "acquired within 2 km                     " << 100 * r.acquisition.rate << " % ("
            << 100 * r.acquisition.first_rate << " % at the first frame), wrong "
            << 100 * r.acquisition.wrong_rate << " %, rms " << r.acquisition.rms_error << " m\n"
            << "flight with turns                        rms " << r.planar.rms_error << " m, "
            << r.planar.frames_tracked << " of " << r.planar.points.size() << " frames tracked, "
            << (r.planar.reacquired ? "acquired again after the loss\n"
                                    : "not acquired again after the loss\n")
            << "map error, loop                          " << r.loop.map_rms_before << " before, "
            << r.loop.map_rms_after << " after (field varies by " << r.loop.field_deviation << ")\n"
            << std::flush;
  for (const std::string& note : r.notes) std::cout << "note: " << note << '\n';
  std::cout << "results in " << std::filesystem::absolute(out).lexically_normal().string() << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Correlation navigation over a mapped field: search, track, map and correct."};
  app.add_option(
      "--terrain", options.terrain,
      "elevation model for acquisition, turns and loop: GeoTIFF, .hgt or .pgm; a synthetic field by default");
  app.add_option("--spacing", options.spacing, "metres between the pixels of a .pgm")
      ->check(CLI::PositiveNumber);
  app.add_option("--out", options.out, "folder for summary.json, errors.csv and report.html");
  app.add_option("--runs", options.runs, "Monte Carlo runs of the straight flight")
      ->check(CLI::Range(1, 100000));
  app.add_option("--starts", options.starts, "random starts of the acquisition")
      ->check(CLI::Range(1, 100000));
  app.add_option("--seed", options.seed, "the same seed gives the same numbers for any number of threads");
  app.add_option("--threads", options.threads, "threads of the Monte Carlo runs")->check(CLI::Range(1, 1024));
  CLI11_PARSE(app, argc, argv);
  try {
    prepare_folder(options.out);
    const Results results = run(options);
    write_outputs(results, options.out);
    print(results, options.out);
  } catch (const std::exception& error) {
    std::cerr << "correlation_navigation: " << error.what() << '\n';
    return 2;
  }
  return 0;
}
