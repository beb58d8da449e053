// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "planar_flight.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>

#include "navigator.hpp"

namespace correlation_navigation {

namespace {

using cairn::Vector;

/// Laps of four legs with round corners in the middle of the field: position and heading at a distance flown.
class RoundedCircuit {
public:
  RoundedCircuit(const cairn::FieldGrid& field, double margin)
      : width_(std::min(largest_side, field.x_end() - field.frame().x0 - 2.0 * margin)),
        height_(std::min(largest_side, field.y_end() - field.frame().y0 - 2.0 * margin)) {
    if (!(width_ > 2000.0 && height_ > 2000.0))
      cairn::raise("planar flight: expected a map of at least " + std::to_string(2.0 * margin + 2000.0) +
                   " m each way");
    left_ = 0.5 * (field.frame().x0 + field.x_end() - width_);
    bottom_ = 0.5 * (field.frame().y0 + field.y_end() - height_);
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
  static constexpr double largest_side = 9000.0;  // [m]
  double left_ = 0, bottom_ = 0, width_, height_, radius_ = 0;
};

/// The vehicle as it is: it flies the circuit, its dead reckoning drifts, its sensor is blind for a while.
class Vehicle {
public:
  Vehicle(const cairn::FieldGrid& field, const PlanarFlight& flight, double spacing)
      : flight_(flight),
        world_(cairn::without_voids(field)),  // the ground has no voids
        circuit_(field, spacing * std::hypot(flight.shape.along(), flight.shape.half_width)),
        random_(flight.seed) {
    cairn::RunningMoments moments;
    for (const double value : field.values())
      if (!std::isnan(value)) moments.add(value);
    mean_ = moments.mean();
    noise_ = flight.sensor_noise * moments.standard_deviation();
    Vector<7> sigma;
    sigma << flight.start_sigma, flight.start_sigma, flight.drift_sigma, flight.drift_sigma,
        flight.scale_sigma * spacing, flight.scale_sigma * spacing, flight.heading_sigma;
    circuit_.at(0.0, position_, heading_);
    // What dead reckoning misses of the velocity, the true scales and the heading's error are drawn; the
    // belief starts at their means with the position off by a draw.
    start_.mean << position_, 0.0, 0.0, spacing, spacing, 0.0;
    start_.covariance = sigma.cwiseAbs2().asDiagonal();
    truth_ = cairn::sample(start_, random_);
    start_.mean(0) += flight.start_sigma * random_.normal();
    start_.mean(1) += flight.start_sigma * random_.normal();
    truth_.head<2>() = position_;
  }

  /// Flies to frame k; the ground velocity that dead reckoning believes in.
  Vector<2> fly_to(std::size_t k) {
    const Vector<2> before = position_;
    circuit_.at(flight_.velocity * flight_.interval * static_cast<double>(k), position_, heading_);
    for (int i = 2; i < 4; ++i)
      truth_(i) += std::sqrt(flight_.drift_density * flight_.interval) * random_.normal();
    if (k == flight_.blind_from) truth_.segment<2>(2) += Vector<2>(flight_.gust_x, flight_.gust_y);
    truth_.head<2>() = position_;
    return (position_ - before) / flight_.interval - truth_.segment<2>(2);
  }

  /// What the sensor sees; of a blind one, noise.
  const std::vector<double>& see(bool blind) {
    cairn::sample_patch(world_, flight_.shape, cairn::PlanarPlacement{believed_heading()}.placement(truth_),
                        samples_);
    for (double& value : samples_.value) value = (blind ? mean_ : value) + noise_ * random_.normal();
    return samples_.value;
  }

  [[nodiscard]] double believed_heading() const { return heading_ - truth_(6); }
  [[nodiscard]] const Vector<2>& position() const { return position_; }
  [[nodiscard]] const Navigator::Belief& start() const { return start_; }
  [[nodiscard]] double noise() const { return noise_; }

private:
  const PlanarFlight& flight_;
  cairn::BsplineMap world_;
  RoundedCircuit circuit_;
  cairn::Random random_;
  cairn::PatchSamples samples_;
  Navigator::Belief start_;
  Vector<7> truth_;
  Vector<2> position_;
  double heading_ = 0, mean_ = 0, noise_ = 0;
};

PlanarPoint point_of(const Navigator& navigator, const NavigatorStep& step, const Vector<2>& position) {
  const Navigator::Belief& belief = navigator.belief();
  PlanarPoint point;
  point.truth_x = position(0);
  point.truth_y = position(1);
  point.x = belief.mean(0);
  point.y = belief.mean(1);
  point.error = (belief.mean.head<2>() - position).norm();
  point.sigma = std::sqrt(belief.covariance(0, 0) + belief.covariance(1, 1));
  point.tracking = step.mode == Mode::tracking && step.frame == cairn::PatchVerdict::accepted;
  point.searched = step.searched;
  point.fixed = step.fixed;
  return point;
}

}  // namespace

PlanarResult fly_planar(const cairn::FieldGrid& field, const PlanarFlight& flight) {
  const cairn::BsplineMap map(field);
  Vehicle vehicle(field, flight, std::max(field.frame().dx, field.frame().dy));
  Navigator navigator(map, flight.shape, cairn::PatchNoise(vehicle.noise() * vehicle.noise()),
                      cairn::PlanarMotion{{flight.drift_density, 1e-6, 1e-9}}, vehicle.start());
  PlanarResult result;
  double squares = 0;
  for (std::size_t k = 0; k < flight.frames; ++k) {
    if (k > 0) navigator.predict(vehicle.fly_to(k), flight.interval);
    const bool blind = k >= flight.blind_from && k < flight.blind_until;
    const NavigatorStep step = navigator.update(vehicle.see(blind), vehicle.believed_heading());
    PlanarPoint point = point_of(navigator, step, vehicle.position());
    point.time = static_cast<double>(k) * flight.interval;
    point.blind = blind;
    result.searches += step.searched ? 1 : 0;
    if (point.tracking) {
      ++result.frames_tracked;
      squares += point.error * point.error;
      result.max_error = std::max(result.max_error, point.error);
      result.reacquired = result.reacquired || k >= flight.blind_until;
    }
    result.points.push_back(point);
    if (flight.on_frame) flight.on_frame();
  }
  if (result.frames_tracked > 0)
    result.rms_error = std::sqrt(squares / static_cast<double>(result.frames_tracked));
  return result;
}

}  // namespace correlation_navigation
