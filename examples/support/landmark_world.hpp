// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The simulated world of the lessons on maps: a robot drives round a circle among point landmarks, counts
/// its wheels' turns, and sees range and bearing of what is near.
///
///   pose_k+1 = pose_k exp(control dt) exp(w),   w ~ N(0, diag(speed, slip, turn density) dt) cairn::Unicycle
///   z = (distance [m], direction from the heading [rad]) + v
///   v ~ N(0, diag(range_sigma^2, bearing_sigma^2))
/// The noise is that which the filters are told of, so that a filter without a mistake has no excuse.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/models/motion.hpp>

#include "support/report.hpp"

namespace example {

/// Range [m] and bearing [rad].
using RangeAndBearing = cairn::Product<cairn::Vector<1>, cairn::SO2>;

inline constexpr int nothing_real = -1;  ///< the landmark of a false alarm

struct LandmarkSighting {
  RangeAndBearing z;
  int landmark = nothing_real;  ///< which one it was in truth: for scores, not for filters
};

struct WorldStep {
  cairn::Vector<2> control;  ///< speed [m/s] and turn rate [rad/s], as the wheels say
  cairn::SE2 truth;          ///< the pose after the step
  std::vector<LandmarkSighting> sightings;
};

struct LandmarkWorld {
  std::size_t count = 16;       ///< landmarks
  double spacing = 5;           ///< no two are nearer than this [m]
  double reach = 9;             ///< the sensor sees as far [m]
  double detection = 0.9;       ///< chance that a landmark within reach is seen in a step
  double false_alarms = 0;      ///< mean number in a step, uniform over what the sensor can see
  double range_sigma = 0.2;     ///< [m]
  double bearing_sigma = 0.02;  ///< [rad]
  double radius = 15;           ///< of the circle driven [m]
  double speed = 1.5;           ///< [m/s]
  double dt = 0.5;              ///< [s]
  cairn::Unicycle motion{.speed_density = 0.01, .slip_density = 1e-4, .turn_density = 0.00005};

  [[nodiscard]] cairn::SE2 start() const { return {radius, 0.0, std::numbers::pi / 2}; }
  [[nodiscard]] std::size_t steps_of_lap() const {
    return static_cast<std::size_t>(2 * std::numbers::pi * radius / (speed * dt));
  }
  /// What the wheels say of the next pose.
  [[nodiscard]] cairn::Gaussian<cairn::SE2> moved(const cairn::SE2& pose,
                                                  const cairn::Vector<2>& control) const {
    return {motion.propagate(pose, control, dt), motion.noise(pose, control, dt).dense()};
  }
  /// Places on both sides of the circle.
  [[nodiscard]] std::vector<cairn::Vector<2>> landmarks(cairn::Random& random) const;
  /// What happens on the way.
  [[nodiscard]] std::vector<WorldStep> drive(const std::vector<cairn::Vector<2>>& landmarks,
                                             std::size_t steps, cairn::Random& random) const;
};

/// What a sensor without noise says of a landmark.
[[nodiscard]] inline RangeAndBearing seen_from(const cairn::SE2& pose, const cairn::Vector<2>& landmark) {
  const cairn::Vector<2> p = pose.inverse() * landmark;
  return RangeAndBearing(cairn::Vector<1>(std::hypot(p(0), p(1))), cairn::SO2(std::atan2(p(1), p(0))));
}

/// The sensor as a model of pose and landmark, for cairn::JointExtended: h and its derivatives. With p the
/// landmark as the robot sees it, a step (dx, dy, dtheta) of the pose moves p by (-dx + p_y dtheta, -dy - p_x
/// dtheta).
struct LandmarkSensor {
  using State = cairn::Product<cairn::SE2, cairn::Vector<2>>;
  using Measurement = RangeAndBearing;
  double range_sigma, bearing_sigma;

  [[nodiscard]] Measurement predict(const State& x) const { return seen_from(x.part<0>(), x.part<1>()); }
  [[nodiscard]] cairn::Matrix<2, 5> jacobian(const State& x) const {
    const cairn::Vector<2> p = x.part<0>().inverse() * x.part<1>();
    const double squared = p(0) * p(0) + p(1) * p(1), range = std::sqrt(squared);
    cairn::Matrix<2> by_p;
    by_p << p(0) / range, p(1) / range, -p(1) / squared, p(0) / squared;
    cairn::Matrix<2, 5> h;
    h << -by_p, cairn::Vector<2>(0, -1), by_p * x.part<0>().rotation().inverse().matrix();
    return h;
  }
  [[nodiscard]] cairn::Matrix<2> noise(const State&) const {
    return cairn::Vector<2>(range_sigma * range_sigma, bearing_sigma * bearing_sigma).asDiagonal();
  }
  /// Where the landmark must be.
  [[nodiscard]] static cairn::Vector<2> initialise(const cairn::SE2& pose, const Measurement& z) {
    const double range = z.part<0>()(0), bearing = z.part<1>().angle();
    return pose * cairn::Vector<2>(range * std::cos(bearing), range * std::sin(bearing));
  }
  /// How well that is known, if the pose is: G R G^T, G the derivative of initialise() by z.
  [[nodiscard]] cairn::Matrix<2> spread(const cairn::SE2& pose, const Measurement& z) const {
    const double range = z.part<0>()(0), bearing = z.part<1>().angle();
    cairn::Matrix<2> g;
    g << std::cos(bearing), -range * std::sin(bearing), std::sin(bearing), range * std::cos(bearing);
    g = (pose.rotation().matrix() * g).eval();
    return g * noise(State()) * g.transpose();
  }
};

/// The sensor as a model of the pose alone: what is not known of the landmark counts as noise,
/// R + H_landmark P H_landmark^T.
struct SensorOfPose {
  using State = cairn::SE2;
  using Measurement = RangeAndBearing;
  const LandmarkSensor& sensor;
  const cairn::Gaussian<cairn::Vector<2>>& landmark;

  [[nodiscard]] Measurement predict(const State& x) const { return seen_from(x, landmark.mean); }
  [[nodiscard]] cairn::Matrix<2, 3> jacobian(const State& x) const { return by_both(x).leftCols<3>(); }
  [[nodiscard]] cairn::Matrix<2> noise(const State& x) const {
    const cairn::Matrix<2> h = by_both(x).rightCols<2>();
    return sensor.noise(LandmarkSensor::State()) + h * landmark.covariance * h.transpose();
  }
  [[nodiscard]] cairn::Matrix<2, 5> by_both(const State& x) const {
    return sensor.jacobian(LandmarkSensor::State(x, landmark.mean));
  }
};

/// The sensor as a model of the landmark alone, the pose known exactly.
struct SensorOfLandmark {
  using State = cairn::Vector<2>;
  using Measurement = RangeAndBearing;
  const LandmarkSensor& sensor;
  const cairn::SE2& pose;

  [[nodiscard]] Measurement predict(const State& landmark) const { return seen_from(pose, landmark); }
  [[nodiscard]] cairn::Matrix<2> jacobian(const State& landmark) const {
    return sensor.jacobian(LandmarkSensor::State(pose, landmark)).rightCols<2>();
  }
  [[nodiscard]] cairn::Matrix<2> noise(const State&) const { return sensor.noise(LandmarkSensor::State()); }
};

inline std::vector<cairn::Vector<2>> LandmarkWorld::landmarks(cairn::Random& random) const {
  std::vector<cairn::Vector<2>> places;
  for (int tries = 0; places.size() < count && tries < 100000; ++tries) {
    const double angle = random.uniform(0, 2 * std::numbers::pi),
                 from_middle = random.uniform(0.45, 1.45) * radius;
    const cairn::Vector<2> place(from_middle * std::cos(angle), from_middle * std::sin(angle));
    bool free = std::abs(from_middle - radius) > 1;  // not on the way
    for (const cairn::Vector<2>& other : places)
      free = free && std::hypot(place(0) - other(0), place(1) - other(1)) > spacing;
    if (free) places.push_back(place);
  }
  return places;
}

inline std::vector<WorldStep> LandmarkWorld::drive(const std::vector<cairn::Vector<2>>& landmarks,
                                                   std::size_t steps, cairn::Random& random) const {
  std::vector<WorldStep> log;
  cairn::SE2 pose = start();
  for (std::size_t k = 0; k < steps; ++k) {
    WorldStep step{cairn::Vector<2>(speed, speed / radius), pose, {}};
    pose = step.truth = cairn::sample(moved(pose, step.control), random);
    const auto see = [&](double range, double bearing, int which) {
      step.sightings.push_back({RangeAndBearing(cairn::Vector<1>(range), cairn::SO2(bearing)), which});
    };
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      const RangeAndBearing z = seen_from(pose, landmarks[i]);
      const double range = z.part<0>()(0);
      if (range > reach || random.uniform() > detection) continue;
      const double turned = random.normal(0, bearing_sigma), farther = random.normal(0, range_sigma);
      see(range + farther, z.part<1>().angle() + turned, static_cast<int>(i));
    }
    for (double left = false_alarms; random.uniform() < left; left -= 1) {
      const double bearing = random.uniform(-std::numbers::pi, std::numbers::pi);
      see(reach * std::sqrt(random.uniform(0.02, 1)), bearing, nothing_real);
    }
    log.push_back(std::move(step));
  }
  return log;
}

/// 2-sigma ellipse of a place.
[[nodiscard]] inline PlaneCurve ellipse_of(std::string name, Ink ink, const cairn::Vector<2>& mean,
                                           const cairn::Matrix<2>& p) {
  return ellipse(std::move(name), ink, {mean(0), mean(1)}, {p(0, 0), p(0, 1), p(1, 1)});
}
/// The same of where a robot is, turned from its own axes to the map's.
[[nodiscard]] inline PlaneCurve ellipse_of(std::string name, Ink ink,
                                           const cairn::Gaussian<cairn::SE2>& pose) {
  const cairn::Matrix<2> turn = pose.mean.rotation().matrix();
  const cairn::Matrix<2> own = pose.covariance.topLeftCorner<2, 2>();
  return ellipse_of(std::move(name), ink, pose.mean.translation(), turn * own * turn.transpose());
}

/// Lengthens a curve by a point.
inline void extend(PlaneCurve& curve, const cairn::Vector<2>& point) {
  curve.x.push_back(point(0));
  curve.y.push_back(point(1));
}

/// Landmarks as dots.
[[nodiscard]] inline PlaneCurve dots_of(std::string name, Ink ink,
                                        const std::vector<cairn::Vector<2>>& points) {
  PlaneCurve curve{.name = std::move(name), .ink = ink, .dots = true};
  for (const cairn::Vector<2>& point : points) extend(curve, point);
  return curve;
}

/// The path that was really driven.
[[nodiscard]] inline PlaneCurve true_path(const std::vector<WorldStep>& log) {
  PlaneCurve curve{.name = "true path", .ink = Ink::truth};
  for (const WorldStep& step : log) extend(curve, step.truth.translation());
  return curve;
}

/// Correlations of the numbers of a state, from its covariance.
[[nodiscard]] inline HeatMap correlations_of(const cairn::Matrix<cairn::dynamic, cairn::dynamic>& p) {
  HeatMap map{.title = "Correlations at the end",
              .caption =
                  "Of all numbers of the state: three of the pose, then two a landmark, in the order of "
                  "meeting. Zero, the pale colour, would mean that one says nothing of the other.",
              .x = {"number of the state"},
              .y = {"number of the state"},
              .value = {"correlation"},
              .columns = static_cast<std::size_t>(p.cols()),
              .rows = static_cast<std::size_t>(p.rows()),
              .diverging = true};
  for (int i = 0; i < p.rows(); ++i)
    for (int j = 0; j < p.cols(); ++j) {
      const double scale = std::sqrt(p(i, i) * p(j, j));
      map.values.push_back(scale > 0 ? p(i, j) / scale : 0);
    }
  return map;
}

/// How many landmarks a log has met.
[[nodiscard]] inline std::size_t landmarks_met(const std::vector<WorldStep>& log) {
  std::set<int> met;
  for (const WorldStep& step : log)
    for (const LandmarkSighting& seen : step.sightings)
      if (seen.landmark != nothing_real) met.insert(seen.landmark);
  return met.size();
}

}  // namespace example
