// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "acquisition.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/field/field_map.hpp>

namespace correlation_navigation {

namespace {

using cairn::PatchPlacement;

double deviation_of(const cairn::FieldGrid& field) {
  cairn::RunningMoments moments;
  for (const double value : field.values())
    if (!std::isnan(value)) moments.add(value);
  return moments.standard_deviation();
}

struct Trial {
  const cairn::BsplineMap& map;
  const AcquisitionOptions& options;
  double spacing, noise;

  AcquisitionTrial operator()(cairn::Random random) const {
    const cairn::FieldGrid& grid = map.grid();
    const double margin =
        spacing * std::hypot(options.shape.along(), options.shape.half_width) + 2.0 * spacing;
    cairn::PatchSamples samples;
    AcquisitionTrial trial;
    double heading = 0;
    int tries = 0;
    do {  // a start whose frame meets no void
      if (++tries > 1000)
        cairn::raise("acquisition: expected a field with room for a frame that meets no void");
      trial.truth_x = random.uniform(grid.frame().x0 + margin, grid.x_end() - margin);
      trial.truth_y = random.uniform(grid.frame().y0 + margin, grid.y_end() - margin);
      heading = random.uniform(-std::numbers::pi, std::numbers::pi);
      const double along = spacing * (1.0 + options.scale_sigma * random.normal());
      const double across = spacing * (1.0 + options.scale_sigma * random.normal());
      cairn::sample_patch(map, options.shape,
                          PatchPlacement::of(trial.truth_x, trial.truth_y, along, across, heading), samples);
    } while (samples.count_inside < options.shape.size());
    const double gain = random.uniform(0.5, 2.0), bias = 100.0 * random.normal();
    for (double& value : samples.value) value = gain * (value + noise * random.normal()) + bias;
    // Drawn one by one: the order in which arguments are evaluated is the compiler's.
    const double guess_x = trial.truth_x + random.uniform(-options.uncertainty, options.uncertainty);
    const double guess_y = trial.truth_y + random.uniform(-options.uncertainty, options.uncertainty);
    const double guess_heading = heading + options.heading_sigma * random.normal();
    const PatchPlacement guess = PatchPlacement::of(guess_x, guess_y, spacing, spacing, guess_heading);
    // The square of starts, turned to the sensor's axes, lies in a square of 1.42 times its side.
    trial.fix = cairn::correlation_search(map, options.shape, samples.value, guess,
                                          {.radius = std::numbers::sqrt2 * options.uncertainty});
    trial.error = std::hypot(trial.fix.placement.x - trial.truth_x, trial.fix.placement.y - trial.truth_y);
    return trial;
  }
};

}  // namespace

AcquisitionResult acquire(const cairn::FieldGrid& field, const AcquisitionOptions& options) {
  const double spacing = std::max(field.frame().dx, field.frame().dy);
  const double needed = 2.0 * spacing * (std::hypot(options.shape.along(), options.shape.half_width) + 4.0);
  if (field.x_end() - field.frame().x0 < needed || field.y_end() - field.frame().y0 < needed)
    cairn::raise("acquisition: expected a map of at least " + std::to_string(needed) + " m each way");
  const cairn::BsplineMap map(field);
  const Trial trial{map, options, spacing, options.sensor_noise * deviation_of(field)};
  AcquisitionResult result;
  result.right_within = 1.5 * spacing;
  result.trials.resize(options.starts);
  cairn::parallel_for(options.starts, options.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) result.trials[i] = trial(cairn::Random(options.seed, i));
  });
  double right = 0, wrong = 0, squares = 0;
  for (const AcquisitionTrial& t : result.trials) {
    if (!t.fix.accepted()) continue;
    const bool good = t.error <= result.right_within;
    right += good ? 1.0 : 0.0;
    wrong += good ? 0.0 : 1.0;
    squares += good ? t.error * t.error : 0.0;
  }
  const auto count = static_cast<double>(std::max<std::size_t>(options.starts, 1));
  result.rate = right / count;
  result.wrong_rate = wrong / count;
  result.rms_error = right > 0.0 ? std::sqrt(squares / right) : 0.0;
  return result;
}

}  // namespace correlation_navigation
