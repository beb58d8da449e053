// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The founding document's case: straight flight over a Gaussian random field whose map has errors of its
/// own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <cairn/core/statistics.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/field/random_field.hpp>

namespace correlation_navigation {

/// Everything in metres, seconds, radians; errors of sensor and map in units of the field.
struct StraightFlight {
  cairn::RandomField field{1.0, 1.0 / 240.0};  ///< what is flown over
  cairn::PatchShape shape{};                   ///< 32 x 33 samples
  double scale = 30.0;                         ///< L_x = L_y, nominal
  double velocity = 200.0;
  double interval =
      6.0;  ///< between frames: they do not overlap, so the map's errors in them are independent
  int frames = 20;
  double sensor_noise = 0.1;                               ///< white, of one sample
  double map_error = 0.05;                                 ///< standard deviation of the map's error
  double map_alpha = 1.0 / 240.0;                          ///< of its correlation
  std::array<double, 5> sigma{60.0, 3.0, 0.6, 0.6, 0.02};  ///< of x, V, L_x, L_y, psi at the start
  std::uint64_t seed = 1;
  unsigned threads = 1;
  std::function<void()> on_run{};  ///< called after each run, by any thread; what it throws ends the flight
};

/// Statistics over the runs, at each frame.
struct StraightResult {
  std::vector<double> time;
  std::array<std::vector<double>, 5> rms_error;  ///< made
  std::array<std::vector<double>, 5> sigma;      ///< predicted, root mean square over the runs
  std::array<std::vector<double>, 5> bound;    ///< Cramer-Rao: the Riccati recursion linearised at the truth
  std::array<std::vector<double>, 5> one_run;  ///< the errors of the first run
  std::vector<double> nees;                    ///< mean over the runs, 5 degrees of freedom
  double rmse_over_bound = 0;                  ///< of the position, root mean square over the second half
  cairn::ConsistencyBand rmse_over_bound_interval{};  ///< 95 %, by the spread of the runs; empty for one run
  double nees_mean = 0;                               ///< over the second half
  cairn::ConsistencyBand nees_band{};  ///< 95 %, for as many independent values as there are runs
  double rms_position_error = 0;       ///< over the second half [m]
  double max_position_error = 0;       ///< over the second half of all runs [m]
  std::size_t refused = 0;             ///< frames that the filter refused
};

[[nodiscard]] StraightResult fly_straight(const StraightFlight& flight, std::size_t runs);

/// How errors of sensor and map limit the position: the bound at the end of the flight [m].
struct BudgetRow {
  double sensor_noise, map_error, final_sigma;
};
inline constexpr std::size_t runs_of_budget = 12 * 6;
[[nodiscard]] std::vector<BudgetRow> error_budget(const StraightFlight& flight);

/// How often a filter that starts `start` correlation lengths (1 / alpha) off is still lost (more than 5 of
/// its sigmas and a tenth of a correlation length off) after five frames.
struct DivergenceRow {
  double start = 0;
  double extended = 0;  ///< share of runs lost by the extended filter, one linearisation a frame
  double iterated = 0;  ///< by the iterated filter
  double searched = 0;  ///< by the iterated filter after a correlation search over the uncertainty
};
inline constexpr std::size_t starts_of_divergence = 7;
[[nodiscard]] std::vector<DivergenceRow> divergence(const StraightFlight& flight, std::size_t runs);

}  // namespace correlation_navigation
