// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Ranges and bearings of points from a pose in the plane, as a sensor of landmarks.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/models/sensor.hpp>
#include <cairn/slam/landmark_map.hpp>

namespace fastslam {

/// A sensor that sees points up to a range, between two bearings. The numbers are its data sheet's.
struct PointSensor {
  using State = cairn::SE2;
  using Part = cairn::Vector<2>;
  using Measurement = cairn::RangeBearing::Measurement;

  double range_sigma = 0.1;     ///< [m]
  double bearing_sigma = 0.02;  ///< [rad]
  double across_sigma = 0;      ///< [m] across the line of sight, whatever the range: adds to the bearing's
  double farthest = 10;         ///< [m]
  double half_view = std::numbers::pi / 2;  ///< [rad] to either side
  double detection = 0;  ///< probability that a landmark in view is reported; 0: not seeing says nothing

  [[nodiscard]] Measurement predict(const State& x, const Part& m) const {
    return cairn::RangeBearing{.beacon = m}.predict(x);
  }
  [[nodiscard]] cairn::Matrix<2, 3> state_jacobian(const State& x, const Part& m) const {
    return cairn::RangeBearing{.beacon = m}.jacobian(x);
  }
  [[nodiscard]] cairn::Matrix<2> part_jacobian(const State& x, const Part& m) const {
    const Part d = m - x.translation();  // a landmark that moves in the world does not ask for the heading
    const double squared = d.squaredNorm(), range = std::sqrt(squared);
    cairn::Matrix<2> h;
    h << d(0) / range, d(1) / range, -d(1) / squared, d(0) / squared;
    return h;
  }
  [[nodiscard]] cairn::Matrix<2> noise(const State& x, const Part& m) const {
    return noise_at((m - x.translation()).norm());
  }
  [[nodiscard]] cairn::Matrix<2> noise_at(double range) const {
    const double across = across_sigma / std::max(0.1, range);
    return cairn::Vector<2>(range_sigma * range_sigma, bearing_sigma * bearing_sigma + across * across)
        .asDiagonal();
  }
  [[nodiscard]] Part initialise(const State& x, const Measurement& z) const {
    const double range = z.part<0>()(0), bearing = z.part<1>().angle();
    return x * Part(range * std::cos(bearing), range * std::sin(bearing));
  }
  [[nodiscard]] double reach() const { return farthest; }
  [[nodiscard]] double detection_probability(const State& x, const Part& m) const {
    const Part d = m - x.translation();  // asked for every landmark around and not seen: few want an angle
    if (!(d.squaredNorm() < farthest * farthest)) return 0;
    const cairn::SO2 bearing(std::atan2(d(1), d(0)) - x.rotation().angle());
    return std::abs(bearing.angle()) < half_view ? detection : 0;
  }
};

using Map = cairn::LandmarkMap<PointSensor>;
using Belief = cairn::MappedPaths<Map>;

}  // namespace fastslam
