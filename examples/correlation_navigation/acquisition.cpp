// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "acquisition.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

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

/// A vehicle that flies straight on and searches for where it is, frame after frame.
class Trial {
public:
  Trial(const cairn::BsplineMap& map, const AcquisitionOptions& options, double spacing, double noise)
      : map_(map), options_(options), spacing_(spacing), noise_(noise) {}

  AcquisitionTrial operator()(cairn::Random random) const {
    const double along = spacing_ * (1.0 + options_.scale_sigma * random.normal());
    const double across = spacing_ * (1.0 + options_.scale_sigma * random.normal());
    const double gain = random.uniform(0.5, 2.0), bias = 100.0 * random.normal();
    cairn::PatchSamples samples;
    PatchPlacement truth = start(along, across, random, samples);
    // Drawn one by one: the order in which arguments are evaluated is the compiler's.
    double off_x = random.uniform(-options_.uncertainty, options_.uncertainty);
    double off_y = random.uniform(-options_.uncertainty, options_.uncertainty);
    const double off_heading = options_.heading_sigma * random.normal();
    AcquisitionTrial trial;
    for (trial.frames = 1;; ++trial.frames) {
      for (double& value : samples.value) value = gain * (value + noise_ * random.normal()) + bias;
      const double heading = std::atan2(truth.along_y, truth.along_x) + off_heading;
      search(samples.value, truth,
             PatchPlacement::of(truth.x + off_x, truth.y + off_y, spacing_, spacing_, heading), trial);
      if (trial.fix.accepted() || trial.frames >= options_.frames) return trial;
      if (!fly_on(truth, samples)) return trial;
      const double way = spacing_ * options_.shape.along();
      off_x += options_.reckoning * way * random.normal();
      off_y += options_.reckoning * way * random.normal();
    }
  }

private:
  /// A place whose frame meets no void.
  PatchPlacement start(double along, double across, cairn::Random& random,
                       cairn::PatchSamples& samples) const {
    const cairn::FieldGrid& grid = map_.grid();
    const double margin = spacing_ * (std::hypot(options_.shape.along(), options_.shape.half_width) + 2.0);
    for (int tries = 0; tries < 1000; ++tries) {
      const double x = random.uniform(grid.frame().x0 + margin, grid.x_end() - margin);
      const double y = random.uniform(grid.frame().y0 + margin, grid.y_end() - margin);
      const double heading = random.uniform(-std::numbers::pi, std::numbers::pi);
      const PatchPlacement at = PatchPlacement::of(x, y, along, across, heading);
      cairn::sample_patch(map_, options_.shape, at, samples);
      if (samples.count_inside == options_.shape.size()) return at;
    }
    cairn::raise("acquisition: expected a field with room for a frame that meets no void");
  }

  /// One frame further, or back where the map ends there or has voids. False where neither can be seen.
  bool fly_on(PatchPlacement& truth, cairn::PatchSamples& samples) const {
    for (const double sign : {1.0, -1.0}) {
      const double steps = sign * options_.shape.along();
      const PatchPlacement next{truth.x + steps * truth.along_x,
                                truth.y + steps * truth.along_y,
                                sign * truth.along_x,
                                sign * truth.along_y,
                                sign * truth.across_x,
                                sign * truth.across_y};
      cairn::sample_patch(map_, options_.shape, next, samples);
      if (samples.count_inside < options_.shape.size()) continue;
      truth = next;
      return true;
    }
    return false;
  }

  void search(const std::vector<double>& z, const PatchPlacement& truth, const PatchPlacement& guess,
              AcquisitionTrial& trial) const {
    // The square of starts, turned to the sensor's axes, lies in a square of 1.42 times its side.
    trial.fix =
        cairn::correlation_search(map_, options_.shape, z, guess,
                                  {.radius = std::numbers::sqrt2 * options_.uncertainty + 2.0 * spacing_,
                                   .scale_sigma = options_.scale_sigma,
                                   .heading_sigma = options_.heading_sigma});
    trial.truth_x = truth.x;
    trial.truth_y = truth.y;
    trial.error = std::hypot(trial.fix.placement.x - truth.x, trial.fix.placement.y - truth.y);
  }

  const cairn::BsplineMap& map_;
  const AcquisitionOptions& options_;
  double spacing_, noise_;
};

}  // namespace

AcquisitionResult acquire(const cairn::FieldGrid& field, const AcquisitionOptions& options) {
  const double spacing = std::max(field.frame().dx, field.frame().dy);
  const double needed = 2.0 * spacing * (std::hypot(options.shape.along(), options.shape.half_width) + 4.0);
  if (field.x_end() - field.frame().x0 < needed || field.y_end() - field.frame().y0 < needed)
    cairn::raise("acquisition: expected a map of at least " + std::to_string(needed) + " m each way");
  const cairn::BsplineMap map(field);
  const Trial trial(map, options, spacing, options.sensor_noise * deviation_of(field));
  AcquisitionResult result;
  result.right_within = 1.5 * spacing;
  result.trials.resize(options.starts);
  cairn::parallel_for(options.starts, options.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      result.trials[i] = trial(cairn::Random(options.seed, i));
      if (options.on_start) options.on_start();
    }
  });
  double right = 0, first = 0, wrong = 0, squares = 0;
  for (const AcquisitionTrial& t : result.trials) {
    if (!t.fix.accepted()) continue;
    const bool good = t.error <= result.right_within;
    right += good ? 1.0 : 0.0;
    first += good && t.frames == 1 ? 1.0 : 0.0;
    wrong += good ? 0.0 : 1.0;
    squares += good ? t.error * t.error : 0.0;
  }
  const auto count = static_cast<double>(std::max<std::size_t>(options.starts, 1));
  result.rate = right / count;
  result.first_rate = first / count;
  result.wrong_rate = wrong / count;
  result.rms_error = right > 0.0 ? std::sqrt(squares / right) : 0.0;
  return result;
}

}  // namespace correlation_navigation
