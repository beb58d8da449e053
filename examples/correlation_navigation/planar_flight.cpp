// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "planar_flight.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>

#include "navigator.hpp"

namespace correlation_navigation {

namespace {

using cairn::Vector;

/// A lap of four legs with round corners, fitted into the field: position and heading at a distance flown.
class RoundedCircuit {
public:
  RoundedCircuit(const cairn::FieldGrid& field, double margin)
      : left_(field.frame().x0 + margin),
        bottom_(field.frame().y0 + margin),
        width_(field.x_end() - margin - left_),
        height_(field.y_end() - margin - bottom_) {
    if (!(width_ > 2000.0 && height_ > 2000.0))
      cairn::raise("planar flight: expected a map of at least " + std::to_string(2.0 * margin + 2000.0) +
                   " m each way");
    radius_ = std::min({1500.0, 0.4 * width_, 0.4 * height_});
  }

  void at(double distance, Vector<2>& position, double& heading) const {
    const double legs[2] = {width_ - 2.0 * radius_, height_ - 2.0 * radius_};
    const double corner = 0.5 * std::numbers::pi * radius_;
    double left = std::fmod(distance, 2.0 * (legs[0] + legs[1]) + 4.0 * corner);
    position << left_ + radius_, bottom_;
    heading = 0;
    for (int side = 0;; ++side) {
      const Vector<2> ahead(std::cos(heading), std::sin(heading)), port(-ahead(1), ahead(0));
      const double leg = std::min(left, legs[side % 2]);
      position += leg * ahead;
      left -= leg;
      if (left <= 0.0) return;
      const double angle = std::min(left, corner) / radius_;
      position += radius_ * (std::sin(angle) * ahead + (1.0 - std::cos(angle)) * port);
      heading += angle;
      left -= corner;
      if (left <= 0.0) return;
    }
  }

private:
  double left_, bottom_, width_, height_, radius_;
};

}  // namespace

PlanarResult fly_planar(const cairn::FieldGrid& field, const PlanarFlight& flight) {
  const cairn::BsplineMap map(field), world(cairn::without_voids(field));  // the ground has no voids
  const double spacing = std::max(field.frame().dx, field.frame().dy);
  const double margin = spacing * std::hypot(flight.shape.along(), flight.shape.half_width);
  const RoundedCircuit circuit(field, margin);
  cairn::RunningMoments moments;
  for (const double value : field.values())
    if (!std::isnan(value)) moments.add(value);
  const double noise = flight.sensor_noise * moments.standard_deviation();

  cairn::Random random(flight.seed);
  const cairn::PlanarMotion motion{{flight.drift_density, 1e-6, 1e-9}};
  Vector<7> sigma;
  sigma << flight.start_sigma, flight.start_sigma, flight.drift_sigma, flight.drift_sigma,
      flight.scale_sigma * spacing, flight.scale_sigma * spacing, flight.heading_sigma;
  Vector<2> position;
  double heading = 0;
  circuit.at(0.0, position, heading);
  // What dead reckoning misses of the velocity, the true scales and the heading's error are drawn; the belief
  // starts at their means with the position off by a draw.
  cairn::Gaussian<Vector<7>> start;
  start.mean << position, 0.0, 0.0, spacing, spacing, 0.0;
  start.covariance = sigma.cwiseAbs2().asDiagonal();
  Vector<7> truth = cairn::sample(start, random);
  start.mean(0) += flight.start_sigma * random.normal();
  start.mean(1) += flight.start_sigma * random.normal();
  truth.head<2>() = position;
  Navigator navigator(map, flight.shape, cairn::PatchNoise(noise * noise), motion, start);

  PlanarResult result;
  double squares = 0;
  cairn::PatchSamples samples;
  for (std::size_t k = 0; k < flight.frames; ++k) {
    if (k > 0) {
      const Vector<2> before = position;
      circuit.at(flight.velocity * flight.interval * static_cast<double>(k), position, heading);
      for (int i = 2; i < 4; ++i)
        truth(i) += std::sqrt(flight.drift_density * flight.interval) * random.normal();
      if (k == flight.blind_from) truth.segment<2>(2) += Vector<2>(flight.gust_x, flight.gust_y);
      const Vector<2> reckoned = (position - before) / flight.interval - truth.segment<2>(2);
      navigator.predict(reckoned, flight.interval);
      truth.head<2>() = position;
    }
    const double believed = heading - truth(6);
    cairn::sample_patch(world, flight.shape, cairn::PlanarPlacement{believed}.placement(truth), samples);
    const bool blind = k >= flight.blind_from && k < flight.blind_until;
    for (std::size_t i = 0; i < samples.value.size(); ++i)
      samples.value[i] = (blind ? moments.mean() : samples.value[i]) + noise * random.normal();
    const NavigatorStep step = navigator.update(samples.value, believed);
    const auto& belief = navigator.belief();
    PlanarPoint point{static_cast<double>(k) * flight.interval, position(0), position(1), belief.mean(0),
                      belief.mean(1)};
    point.error = (belief.mean.head<2>() - position).norm();
    point.sigma = std::sqrt(belief.covariance(0, 0) + belief.covariance(1, 1));
    point.tracking = step.mode == Mode::tracking && step.frame == cairn::PatchVerdict::accepted;
    point.searched = step.searched;
    point.fixed = step.fixed;
    point.blind = blind;
    result.searches += step.searched ? 1 : 0;
    if (point.tracking) {
      ++result.frames_tracked;
      squares += point.error * point.error;
      result.max_error = std::max(result.max_error, point.error);
      result.reacquired = result.reacquired || k >= flight.blind_until;
    }
    result.points.push_back(point);
  }
  if (result.frames_tracked > 0)
    result.rms_error = std::sqrt(squares / static_cast<double>(result.frames_tracked));
  return result;
}

}  // namespace correlation_navigation
