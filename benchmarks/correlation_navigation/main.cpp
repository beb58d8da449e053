// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The scoreboard of correlation navigation: scripts/scoreboard correlation_navigation.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/field/correlation.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch_filter.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/field/patch_noise.hpp>
#include <cairn/field/random_field.hpp>

#include "acquisition.hpp"
#include "agreement.hpp"
#include "straight_flight.hpp"
#include "support/data.hpp"
#include "support/scoreboard.hpp"
#include "support/timing.hpp"
#include "terrain_file.hpp"

namespace {

using namespace cairn_bench;
using namespace correlation_navigation;

void add_accuracy_rows(Scoreboard& board, unsigned threads) {
  StraightFlight flight;
  flight.threads = threads;
  const StraightResult result = fly_straight(flight, 200);
  board.add({.name = "position RMSE over the Cramer-Rao bound, 200 runs, random field",
             .measured = result.rmse_over_bound,
             .unit = "x",
             .must = 1.2,
             .aim = 1.05,
             .rival_name = "no rival",
             .note = "rms " + std::to_string(result.rms_position_error) + " m at 30 m a sample"});
  const auto& band = result.nees_band;
  board.add({.name = "NEES of 5 states beyond its 95 % band (1 or less is inside)",
             .measured = std::max(result.nees_mean / band.high, band.low / result.nees_mean),
             .unit = "x",
             .must = 1.0,
             .rival_name = "no rival",
             .note = "mean " + std::to_string(result.nees_mean) + ", band " + std::to_string(band.low) +
                     " to " + std::to_string(band.high) + ", correlated map error included"});
  board.add({.name = "five filters, largest relative disagreement",
             .measured = largest_disagreement(1, 8),
             .unit = "",
             .must = 1e-6,
             .rival_name = "no rival"});
}

void add_acquisition_rows(Scoreboard& board, unsigned threads) {
  Row first{.name = "acquired on real terrain within 2 km, 5 x 100 starts, 10 % noise, first frame",
            .unit = "%",
            .must = 95,
            .aim = 99,
            .better = larger,
            .rival_name = "no rival"};
  Row flying{.name = "the same, searching on for up to 5 frames",
             .unit = "%",
             .must = 95,
             .aim = 99,
             .better = larger,
             .rival_name = "no rival"};
  Row wrong{.name = "wrong fixes accepted", .unit = "%", .must = 0, .rival_name = "no rival"};
  const auto folder = cairn_test::real_data("terrain");
  if (folder) {
    const auto field = read_terrain(*folder / "srtm_bigtujunga30m_utm11.tif");
    double at_first = 0, in_flight = 0, falsely = 0, worst = 1, squares = 0;
    constexpr std::uint64_t seeds = 5;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      const AcquisitionResult result = acquire(field, {.seed = seed, .threads = threads});
      at_first += result.first_rate / seeds;
      in_flight += result.rate / seeds;
      falsely += result.wrong_rate / seeds;
      squares += result.rms_error * result.rms_error / seeds;
      worst = std::min(worst, result.first_rate);
    }
    first.measured = 100 * at_first;
    first.note = "worst seed " + std::to_string(std::lround(100 * worst)) + " %";
    flying.measured = 100 * in_flight;
    flying.note = "rms " + std::to_string(std::sqrt(squares)) + " m";
    wrong.measured = 100 * falsely;
  } else {
    first.note = flying.note = wrong.note = "no data";
  }
  board.add(first);
  board.add(flying);
  board.add(wrong);
}

void add_time_rows(Scoreboard& board) {
  cairn::Random random(3);
  const cairn::BsplineMap map(
      cairn::RandomField{1.0, 1.0 / 240.0}.draw(400, 400, {-6000, -6000, 30, 30}, random));
  const cairn::PatchShape shape{};
  const cairn::AlongTrackPlacement where{};
  const cairn::Vector<5> truth(20.0, 200.0, 30.3, 29.8, 0.01), sigma(60.0, 3.0, 0.6, 0.6, 0.02);
  const cairn::Gaussian<cairn::Vector<5>> prior{cairn::Vector<5>(0.0, 200.0, 30.0, 30.0, 0.0),
                                                sigma.cwiseAbs2().asDiagonal()};
  // Tracking: the prior that one frame interval after a fix has.
  const cairn::Gaussian<cairn::Vector<5>> tracked{truth + 0.3 * sigma / 20.0, prior.covariance / 400.0};
  cairn::PatchSamples seen;
  cairn::sample_patch(map, shape, where.placement(truth), seen);
  for (double& value : seen.value) value += 0.1 * random.normal();
  const cairn::PatchNoise white(0.01), correlated(0.01, shape, 0.0025, 1.0 / 240.0, 30.0, 30.0);
  cairn::PatchScratch scratch;
  const auto update = [&](const cairn::PatchNoise& noise, const cairn::Gaussian<cairn::Vector<5>>& start) {
    cairn::Gaussian<cairn::Vector<5>> belief = start;
    const auto result = cairn::PatchFilter{}.update(belief, where, map, shape, seen.value, noise, scratch);
    do_not_optimise(result);
    do_not_optimise(belief);
  };
  const std::vector<Timing> times =
      interleave({{"tracking", [&] { update(white, tracked); }},
                  {"tracking, correlated", [&] { update(correlated, tracked); }},
                  {"first frame", [&] { update(correlated, prior); }}});
  board.add({.name = "one frame of 32 x 33 samples, filter update, one thread",
             .measured = 1e3 * times[0].fastest,
             .unit = "ms",
             .must = 0.5,
             .aim = 0.1,
             .rival_name = "no rival",
             .note = "white noise, tracking; fastest of 15 rounds"});
  board.add({.name = "the same against a map with correlated errors",
             .measured = 1e3 * times[1].fastest,
             .unit = "ms",
             .must = 0.5,
             .rival_name = "no rival"});
  board.add({.name = "the same, first frame after a search",
             .measured = 1e3 * times[2].fastest,
             .unit = "ms",
             .rival_name = "no rival"});
  const auto guess = cairn::PatchPlacement::of(0, 0, 30, 30, 0);
  const std::vector<Timing> search = interleave({{"search", [&] {
                                                    const auto fix = cairn::correlation_search(
                                                        map, shape, seen.value, guess, {.radius = 2000});
                                                    do_not_optimise(fix);
                                                  }}});
  board.add({.name = "correlation search, 2 km each way, 30 m a sample",
             .measured = 1e3 * search[0].fastest,
             .unit = "ms",
             .rival_name = "no rival"});
}

}  // namespace

int main(int argc, char** argv) {
  if (const auto code = cairn_bench::answer(argc, argv, "scoreboard_correlation_navigation")) return *code;
  const unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  Scoreboard board("correlation_navigation");
  add_time_rows(board);
  add_accuracy_rows(board, threads);
  add_acquisition_rows(board, threads);
  return board.finish();
}
