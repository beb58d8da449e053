// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Correlation navigation: a vehicle that sees a patch of a mapped field knows where it is. Four experiments:
// the founding document's straight flight, acquisition, a flight with turns and a loss, mapping along a loop.
// Exit codes: 0 all of them; 2 a mistake; 4 interrupted, the results are of the experiments before.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <iostream>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/field/random_field.hpp>
#include <cairn/io/text.hpp>

#include "outputs.hpp"
#include "support/command_line.hpp"
#include "support/interruption.hpp"
#include "support/progress.hpp"
#include "support/standard_output.hpp"
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

/// Thrown out of an experiment that was interrupted.
struct Interrupted {
  std::string signal;
};

/// Makes one experiment after the other, with a line that says how far each has come.
class Experiments {
public:
  explicit Experiments(Results& results) : results_(results) {}

  /// Calls make(step), which calls step() `steps` times from any thread.
  template <class Make>
  void run(const std::string& name, std::size_t steps, const Make& make) {
    name_ = name;
    example::Progress progress(std::clog, name, steps);
    std::mutex turn;
    const auto begin = std::chrono::steady_clock::now();
    make([&] {
      if (const auto signal = interruption_.caught()) throw Interrupted{*signal};
      const std::lock_guard lock(turn);
      progress.step();
    });
    results_.seconds.emplace_back(
        name, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }

  /// run(), but a field may be too small for a flight: that is noted, and the others are made.
  template <class Make>
  void fly(const std::string& name, std::size_t steps, const Make& make) {
    try {
      run(name, steps, make);
    } catch (const cairn::Error& error) {
      results_.notes.emplace_back(error.what());
    }
  }

  /// Of the last experiment.
  [[nodiscard]] const std::string& name() const { return name_; }

private:
  Results& results_;
  std::string name_;
  example::Interruption interruption_;
};

/// Whether all values are the same, voids aside.
bool is_flat(const cairn::FieldGrid& field) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : field.values())
    if (!std::isnan(value)) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  return !(high > low);
}

/// All experiments, or those before an interruption; throws Interrupted where that is none.
Results run(const cairn::FieldGrid& field, const Options& options) {
  Results results;
  results.seed = options.seed;
  results.runs = options.runs;
  results.threads = options.threads;
  results.field = options.terrain.empty() ? "synthetic Gaussian random field"
                                          : std::filesystem::path(options.terrain).filename().string();
  results.straight_options.seed = options.seed;
  results.straight_options.threads = options.threads;
  StraightFlight straight = results.straight_options;
  const std::size_t starts_off = std::max<std::size_t>(1, options.runs / 2);
  const LoopFlight loop{.seed = options.seed};
  Experiments experiments(results);
  try {
    experiments.run("straight flight", options.runs, [&](const auto& step) {
      straight.on_run = step;
      results.straight = fly_straight(straight, options.runs);
    });
    experiments.run("error budget", runs_of_budget, [&](const auto& step) {
      straight.on_run = step;
      results.budget = error_budget(straight);
    });
    experiments.run("divergence", starts_of_divergence * starts_off, [&](const auto& step) {
      straight.on_run = step;
      results.divergence = divergence(straight, starts_off);
    });
    if (is_flat(field)) {
      results.notes.emplace_back(
          "the terrain is flat: there is nothing to navigate by, and acquisition, the flight with turns and "
          "the "
          "loop are left out");
      return results;
    }
    experiments.fly("acquisition", options.starts, [&](const auto& step) {
      results.acquisition = acquire(
          field,
          {.starts = options.starts, .seed = options.seed, .threads = options.threads, .on_start = step});
    });
    experiments.fly("flight with turns", PlanarFlight{}.frames, [&](const auto& step) {
      results.planar = fly_planar(field, {.seed = options.seed, .on_frame = step});
    });
    experiments.fly("loop", frames_of(loop), [&](const auto& step) {
      results.loop = fly_loop(field, {.seed = options.seed, .on_frame = step});
    });
  } catch (const Interrupted& interrupted) {
    if (results.seconds.empty()) throw;
    results.ended_early = "ended in " + experiments.name() + ": interrupted (" + interrupted.signal + ")";
  }
  return results;
}

/// Of what was found; of nothing there is no error.
std::string rms_of(bool found, double rms) {
  return found ? "rms " + cairn::shortest(std::round(1e3 * rms) / 1e3) + " m" : "no rms";
}

void print(const Results& r, const std::filesystem::path& out) {
  std::cout << "position RMSE over the Cramer-Rao bound  " << r.straight.rmse_over_bound << "\n"
            << "NEES of 5 states                         " << r.straight.nees_mean << "  (band "
            << r.straight.nees_band.low << " to " << r.straight.nees_band.high << ")\n";
  if (r.acquisition)
    std::cout << "acquired within 2 km                     " << 100 * r.acquisition->rate << " % ("
              << 100 * r.acquisition->first_rate << " % at the first frame), wrong "
              << 100 * r.acquisition->wrong_rate << " %, "
              << rms_of(r.acquisition->rate > 0, r.acquisition->rms_error) << "\n";
  if (r.planar)
    std::cout << "flight with turns                        "
              << rms_of(r.planar->frames_tracked > 0, r.planar->rms_error) << ", " << r.planar->frames_tracked
              << " of " << r.planar->points.size() << " frames tracked, "
              << (r.planar->reacquired ? "acquired again after the loss\n"
                                       : "not acquired again after the loss\n");
  if (r.loop)
    std::cout << "map error, loop                          " << r.loop->map_rms_before << " before, "
              << r.loop->map_rms_after << " after (field varies by " << r.loop->field_deviation << ")\n";
  for (const std::string& note : r.notes) std::cout << "note: " << note << '\n';
  std::cout << "results in " << std::filesystem::absolute(out).lexically_normal().string() << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = "correlation_navigation";
  Options options;
  CLI::App app{"Correlation navigation over a mapped field: search, track, map and correct."};
  app.option_defaults()->always_capture_default();
  auto* const terrain = app.add_option(
      "--terrain", options.terrain,
      "elevation model for acquisition, turns and loop: GeoTIFF, .hgt or .pgm; a synthetic field by default");
  app.add_option("--spacing", options.spacing,
                 "metres between the pixels of a .pgm, or of a GeoTIFF that does not say")
      ->check(example::number_between(0.01, 1e6))
      ->needs(terrain);
  app.add_option("--out", options.out, "folder for summary.json, errors.csv and report.html");
  app.add_option("--runs", options.runs, "Monte Carlo runs of the straight flight")
      ->check(example::whole_number(1, 100000));
  app.add_option("--starts", options.starts, "random starts of the acquisition")
      ->check(example::whole_number(1, 100000));
  app.add_option("--seed", options.seed, "the same seed gives the same numbers for any number of threads")
      ->check(example::whole_number(0));
  app.add_option("--threads", options.threads, "threads of the Monte Carlo runs")
      ->check(example::whole_number(1, 1024));
  if (const std::optional<int> code = example::parse(app, name, argc, argv)) return *code;
  try {
    const cairn::FieldGrid field = options.terrain.empty() ? synthetic_ground(options.seed)
                                                           : read_terrain(options.terrain, options.spacing);
    prepare_folder(options.out);
    const Results results = run(field, options);
    if (results.ended_early) std::cerr << name << ": " << *results.ended_early << '\n';
    if (const std::optional<std::string> no_report = write_outputs(results, options.out))
      std::cout << *no_report << '\n';
    print(results, options.out);
    if (!example::flush_standard_output(name)) return example::exit_mistake;
    return results.ended_early ? example::exit_interrupted : example::exit_well;
  } catch (const Interrupted& interrupted) {
    std::cerr << name << ": interrupted (" << interrupted.signal << ") before there was anything to write\n";
    return example::exit_interrupted;
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << '\n';
    return example::exit_mistake;
  }
}
