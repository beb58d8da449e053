// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "lines.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include <cairn/core/statistics.hpp>

#include "line_slam/drive.hpp"
#include "line_slam/run.hpp"
#include "support/line_nees.hpp"

void add_lines(cairn_bench::Scoreboard& board) {
  constexpr std::uint64_t first_seed = 101, seeds = 5;
  const unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  std::vector<double> slam, odometry, seconds;
  for (std::uint64_t seed = first_seed; seed < first_seed + seeds; ++seed) {
    const line_slam::Drive drive = line_slam::simulated_drive({.seed = seed, .threads = threads});
    const line_slam::Results r = line_slam::run(drive, {.particles = 100, .seed = seed, .threads = threads});
    slam.push_back(r.slam.rms / r.exact.rms);
    odometry.push_back(r.odometry.rms / r.exact.rms);
    seconds.push_back(r.cpu_seconds);
    std::cerr << "lines, seed " << seed << ": true poses " << r.exact.rms << " m, odometry " << r.odometry.rms
              << " m, particles " << r.slam.rms << " m\n";
  }
  const auto middle = [](std::vector<double> values) {
    std::ranges::sort(values);
    return values[values.size() / 2];
  };
  using cairn_bench::Row;
  board.add(Row{.name = "lines, 250 m, M = 100: rms of the map over that with the true poses",
                .measured = middle(slam),
                .unit = "x",
                .must = 2,
                .aim = 1.2,
                .note = "worst of 5 seeds " + std::to_string(*std::ranges::max_element(slam))});
  board.add(Row{.name = "the same along odometry alone",
                .measured = middle(odometry),
                .unit = "x",
                .must = 5,
                .better = cairn_bench::larger,
                .note = "least of 5 seeds " + std::to_string(*std::ranges::min_element(odometry))});
  board.add(Row{.name = "the same: CPU of the filter", .measured = middle(seconds), .unit = "s"});
  const cairn_test::LineNees nees = cairn_test::nees_of_lines(first_seed, 500);
  const auto band = cairn::chi_square_mean_band(4, static_cast<double>(nees.lines), 0.99);
  board.add(Row{.name = "mean NEES of 500 lines mapped along the true path, off 4",
                .measured = std::abs(nees.mean() - 4),
                .unit = "",
                .must = std::min(4 - band.low, band.high - 4),
                .note = "must: the band of 99 %"});
}
