// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "straight_flight.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/field/correlation.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch_filter.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/field/patch_noise.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kalman.hpp>

namespace correlation_navigation {

namespace {

using Belief = cairn::Gaussian<cairn::Vector<5>>;
using cairn::Vector;

/// The ground as it is, and as the first mapping recorded it.
struct Ground {
  cairn::BsplineMap truth, map;
};

Ground draw_ground(const StraightFlight& flight, cairn::Random& random) {
  const double step = flight.scale;
  const double behind = (flight.shape.behind + 2) * step + 6.0 * flight.sigma[0];
  const double ahead = flight.velocity * flight.interval * flight.frames + behind +
                       6.0 * flight.sigma[1] * flight.interval * flight.frames;
  const int columns = static_cast<int>((behind + ahead) / step) + 2 * flight.shape.ahead;
  const int half_rows = flight.shape.half_width + 6;
  const cairn::GridFrame frame{-behind - flight.shape.ahead * step, -half_rows * step, step, step};
  cairn::FieldGrid truth = flight.field.draw(columns, 2 * half_rows + 1, frame, random);
  cairn::FieldGrid map = truth;
  if (flight.map_error > 0.0) {
    const cairn::FieldGrid error = cairn::RandomField{flight.map_error, flight.map_alpha}.draw(
        columns, 2 * half_rows + 1, frame, random);
    for (std::size_t i = 0; i < map.values().size(); ++i) map.values()[i] += error.values()[i];
  }
  return {cairn::BsplineMap(std::move(truth)), cairn::BsplineMap(std::move(map))};
}

cairn::PatchNoise noise_of(const StraightFlight& flight) {
  return cairn::PatchNoise(flight.sensor_noise * flight.sensor_noise, flight.shape,
                           flight.map_error * flight.map_error, flight.map_alpha, flight.scale, flight.scale);
}

Belief start_of(const StraightFlight& flight) {
  const Vector<5> sigma = Eigen::Map<const Vector<5>>(flight.sigma.data());
  return {Vector<5>(0.0, flight.velocity, flight.scale, flight.scale, 0.0), sigma.cwiseAbs2().asDiagonal()};
}

std::vector<double> see(const StraightFlight& flight, const Ground& ground, const Vector<5>& truth,
                        cairn::Random& random) {
  cairn::PatchSamples samples;
  cairn::sample_patch(ground.truth, flight.shape, cairn::AlongTrackPlacement{}.placement(truth), samples);
  for (double& value : samples.value) value += flight.sensor_noise * random.normal();
  return std::move(samples.value);
}

/// One run: errors, predicted variances, bound and NEES at each frame.
struct Run {
  std::vector<Vector<5>> error, variance, bound;
  std::vector<double> nees;
  std::size_t refused = 0;
};

Run fly_once(const StraightFlight& flight, const cairn::PatchNoise& noise, cairn::Random random) {
  const Ground ground = draw_ground(flight, random);
  const cairn::AlongTrackMotion motion{};
  const cairn::AlongTrackPlacement where{};
  const cairn::PatchFilter filter{};
  cairn::PatchScratch scratch;
  Belief belief = start_of(flight), bound = belief;
  Vector<5> truth = cairn::sample(belief, random);
  Run run;
  for (int k = 0; k < flight.frames; ++k) {
    if (k > 0) {
      truth = motion.propagate(truth, {}, flight.interval);
      static_cast<void>(cairn::Kalman{}.predict(belief, motion, flight.interval));
      static_cast<void>(cairn::Kalman{}.predict(bound, motion, flight.interval));
    }
    const std::vector<double> z = see(flight, ground, truth, random);
    if (!filter.update(belief, where, ground.map, flight.shape, z, noise, scratch).accepted()) ++run.refused;
    if (const auto information =
            filter.information(truth, where, ground.truth, flight.shape, noise, scratch)) {
      const cairn::Matrix<5> prior = cairn::Cholesky<5>(bound.covariance).inverse();
      bound.covariance = cairn::Cholesky<5>(prior + *information).inverse();
    }
    run.error.push_back(belief.mean - truth);
    run.variance.push_back(belief.covariance.diagonal());
    run.bound.push_back(bound.covariance.diagonal());
    run.nees.push_back(cairn::nees(belief, truth));
  }
  return run;
}

/// Puts a belief where a search finds the frame; its scales and heading stay as they were.
void search_first(const StraightFlight& flight, const cairn::BsplineMap& map, const std::vector<double>& z,
                  Belief& belief) {
  const cairn::Fix fix =
      cairn::correlation_search(map, flight.shape, z, cairn::AlongTrackPlacement{}.placement(belief.mean),
                                {.radius = 3.0 * flight.sigma[0] + flight.scale,
                                 .scale_sigma = std::max(flight.sigma[2], flight.sigma[3]) / flight.scale,
                                 .heading_sigma = flight.sigma[4]});
  if (!fix.accepted()) return;
  belief.mean(0) = fix.placement.x;
  belief.covariance(0, 0) = 9.0 * fix.covariance(0, 0);  // wide: the filter takes in the same frame
}

/// Whether the extended filter, the iterated one, and the iterated one after a search are lost after a flight
/// that starts one sigma of x off, to one side or the other.
std::array<bool, 3> fly_from_afar(const StraightFlight& flight, const cairn::PatchNoise& noise,
                                  cairn::Random random) {
  const cairn::AlongTrackMotion motion{};
  const cairn::AlongTrackPlacement where{};
  cairn::PatchScratch scratch;
  const Ground ground = draw_ground(flight, random);
  std::array<Belief, 3> beliefs{start_of(flight), start_of(flight), start_of(flight)};
  Vector<5> truth = beliefs[0].mean;
  truth(0) += (random.uniform() < 0.5 ? -1.0 : 1.0) * flight.sigma[0];
  for (int k = 0; k < flight.frames; ++k) {
    if (k > 0) {
      truth = motion.propagate(truth, {}, flight.interval);
      for (Belief& belief : beliefs)
        static_cast<void>(cairn::Kalman{}.predict(belief, motion, flight.interval));
    }
    const std::vector<double> z = see(flight, ground, truth, random);
    if (k == 0) search_first(flight, ground.map, z, beliefs[2]);
    for (std::size_t f = 0; f < 3; ++f)
      static_cast<void>(cairn::PatchFilter{.iterations = f == 0 ? 1 : 8}.update(
          beliefs[f], where, ground.map, flight.shape, z, noise, scratch));
  }
  std::array<bool, 3> lost{};
  for (std::size_t f = 0; f < 3; ++f) {
    const double error = std::abs(beliefs[f].mean(0) - truth(0));
    lost[f] = error > 5.0 * std::sqrt(beliefs[f].covariance(0, 0)) && error > 0.1 / flight.field.alpha;
  }
  return lost;
}

/// Statistics of frame k over the runs.
void add_frame(const StraightFlight& flight, const std::vector<Run>& runs, std::size_t k,
               StraightResult& result) {
  const auto count = static_cast<double>(runs.size());
  Vector<5> error = Vector<5>::Zero(), variance = error, bound = error;
  double mean_nees = 0;
  for (const Run& run : runs) {
    error += run.error[k].cwiseAbs2() / count;
    variance += run.variance[k] / count;
    bound += run.bound[k] / count;
    mean_nees += run.nees[k] / count;
  }
  result.time.push_back(static_cast<double>(k) * flight.interval);
  result.nees.push_back(mean_nees);
  for (int i = 0; i < 5; ++i) {
    const auto state = static_cast<std::size_t>(i);
    result.rms_error[state].push_back(std::sqrt(error(i)));
    result.sigma[state].push_back(std::sqrt(variance(i)));
    result.bound[state].push_back(std::sqrt(bound(i)));
    result.one_run[state].push_back(runs.front().error[k](i));
  }
}

/// 95 % of the ratio of RMSE and bound over the frames from `first`: that of a ratio of means, by the
/// residuals of the runs (W. Cochran, "Sampling Techniques", 1977, chapter 6).
cairn::ConsistencyBand ratio_interval(const std::vector<Run>& runs, std::size_t first, double ratio) {
  if (runs.size() < 2) return {};
  cairn::RunningMoments residuals, bounds;
  for (const Run& run : runs) {
    double squares = 0, bound = 0;
    for (std::size_t k = first; k < run.error.size(); ++k) {
      squares += run.error[k](0) * run.error[k](0);
      bound += run.bound[k](0);
    }
    residuals.add(squares - ratio * ratio * bound);
    bounds.add(bound);
  }
  const double reach =
      1.96 * residuals.standard_deviation() / std::sqrt(static_cast<double>(runs.size())) / bounds.mean();
  return {std::sqrt(std::max(0.0, ratio * ratio - reach)), std::sqrt(ratio * ratio + reach)};
}

}  // namespace

StraightResult fly_straight(const StraightFlight& flight, std::size_t runs) {
  const cairn::PatchNoise noise = noise_of(flight);
  std::vector<Run> all(runs);
  cairn::parallel_for(runs, flight.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t run = begin; run < end; ++run) {
      all[run] = fly_once(flight, noise, cairn::Random(flight.seed, run));
      if (flight.on_run) flight.on_run();
    }
  });
  StraightResult result;
  const auto frames = static_cast<std::size_t>(flight.frames);
  double squares = 0, bounds = 0, nees = 0;
  for (std::size_t k = 0; k < frames; ++k) {
    add_frame(flight, all, k, result);
    if (k < frames / 2) continue;
    squares += result.rms_error[0][k] * result.rms_error[0][k];
    bounds += result.bound[0][k] * result.bound[0][k];
    nees += result.nees[k];
    for (const Run& run : all)
      result.max_position_error = std::max(result.max_position_error, std::abs(run.error[k](0)));
  }
  const auto half = static_cast<double>(frames - frames / 2);
  result.rmse_over_bound = std::sqrt(squares / bounds);
  result.rmse_over_bound_interval = ratio_interval(all, frames / 2, result.rmse_over_bound);
  result.rms_position_error = std::sqrt(squares / half);
  result.nees_mean = nees / half;
  result.nees_band = cairn::chi_square_mean_band(5, static_cast<double>(runs));
  for (const Run& run : all) result.refused += run.refused;
  return result;
}

std::vector<BudgetRow> error_budget(const StraightFlight& flight) {
  std::vector<BudgetRow> rows;
  constexpr std::array sensors{0.05, 0.1, 0.2};
  constexpr std::array maps{0.0, 0.05, 0.1, 0.2};
  for (const double sensor : sensors)
    for (const double map : maps) {
      StraightFlight variant = flight;
      variant.sensor_noise = sensor;
      variant.map_error = map;
      const StraightResult result = fly_straight(variant, runs_of_budget / (sensors.size() * maps.size()));
      rows.push_back({sensor, map, result.bound[0].back()});
    }
  return rows;
}

std::vector<DivergenceRow> divergence(const StraightFlight& flight, std::size_t runs) {
  std::vector<DivergenceRow> rows;
  const double length = 1.0 / flight.field.alpha;
  constexpr std::array<double, starts_of_divergence> starts{0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0};
  for (const double start : starts) {
    StraightFlight variant = flight;
    variant.frames = 5;
    variant.sigma[0] = start * length;
    const cairn::PatchNoise noise = noise_of(variant);
    std::vector<std::array<bool, 3>> lost(runs);
    cairn::parallel_for(runs, flight.threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t run = begin; run < end; ++run) {
        lost[run] = fly_from_afar(variant, noise, cairn::Random(flight.seed + 7, run));
        if (flight.on_run) flight.on_run();
      }
    });
    DivergenceRow row{start};
    for (const std::array<bool, 3>& run : lost) {
      row.extended += run[0] ? 1.0 / static_cast<double>(runs) : 0.0;
      row.iterated += run[1] ? 1.0 / static_cast<double>(runs) : 0.0;
      row.searched += run[2] ? 1.0 / static_cast<double>(runs) : 0.0;
    }
    rows.push_back(row);
  }
  return rows;
}

}  // namespace correlation_navigation
