// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// SLAM that is linear and Gaussian, for which Kalman's filter of pose and landmarks in one is exact.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numbers>
#include <vector>

#include <Eigen/LU>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/slam/landmark_map.hpp>

namespace cairn_test::linear_slam {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::Random;
using Plane = cairn::Vector<2>;

/// A robot that only shifts sees where landmarks are from it.
struct Relative {
  using State = Plane;
  using Part = Plane;
  using Measurement = Plane;
  Matrix<2> covariance = (Matrix<2>() << 0.05, 0.01, 0.01, 0.08).finished();
  double view = 3, probability = 0.5;

  [[nodiscard]] Measurement predict(const State& x, const Part& m) const { return m - x; }
  [[nodiscard]] Matrix<2> part_jacobian(const State&, const Part&) const { return Matrix<2>::Identity(); }
  [[nodiscard]] Matrix<2> state_jacobian(const State&, const Part&) const { return -Matrix<2>::Identity(); }
  [[nodiscard]] Matrix<2> noise(const State&, const Part&) const { return covariance; }
  [[nodiscard]] Part initialise(const State& x, const Measurement& z) const { return x + z; }
  [[nodiscard]] double detection_probability(const State& x, const Part& m) const {
    return (m - x).norm() < view ? probability : 0;
  }
};

using Map = cairn::LandmarkMap<Relative>;
inline const Matrix<2> motion_noise = (Matrix<2>() << 0.3, -0.1, -0.1, 0.2).finished();
inline const auto motion = [](const Plane& x, std::size_t) {
  return Gaussian<Plane>{x + Plane(0.5, 0.1), motion_noise};
};

inline Plane normal(const Matrix<2>& covariance, Random& random) {
  return cairn::sample(Gaussian<Plane>{Plane::Zero(), covariance}, random);
}

/// Kalman's filter of the pose and all landmarks in one dense matrix: shares nothing with the particles.
struct Joint {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(2);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(2, 2);
  std::map<std::uint32_t, int> row_of{};
  double log_evidence = 0;

  void move() {
    mean.head(2) += Plane(0.5, 0.1);
    covariance.topLeftCorner(2, 2) += motion_noise;
  }
  void see(std::uint32_t id, const Plane& z, const Matrix<2>& r) {
    const auto known = row_of.find(id);
    const int n = static_cast<int>(mean.size());
    if (known == row_of.end()) {
      Eigen::MatrixXd grown(n + 2, n + 2);
      grown.topLeftCorner(n, n) = covariance;
      grown.bottomLeftCorner(2, n) = covariance.topRows(2);
      grown.topRightCorner(n, 2) = covariance.leftCols(2);
      grown.bottomRightCorner(2, 2) = covariance.topLeftCorner(2, 2) + r;
      covariance = grown;
      mean.conservativeResize(n + 2);
      mean.tail(2) = mean.head(2) + z;
      row_of[id] = n;
      return;
    }
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(2, n);
    h.leftCols(2) = -Matrix<2>::Identity();
    h.middleCols(known->second, 2) = Matrix<2>::Identity();
    const Matrix<2> s = h * covariance * h.transpose() + r;
    const Matrix<2> s_inverse = s.inverse();
    const Plane v = z - h * mean;
    const Eigen::MatrixXd gain = covariance * h.transpose() * s_inverse;
    mean += gain * v;
    covariance -= gain * s * gain.transpose();
    log_evidence -= 0.5 * (v.dot(s_inverse * v) + std::log(s.determinant())) + std::log(2 * std::numbers::pi);
  }
};

inline const std::vector<Plane> landmarks{{1, 1}, {-1, 2}, {2, -1}, {0, 3}, {3, 0}};

inline Map::Observation seen_from(const Plane& x, Random& random) {
  Map::Observation z;
  for (std::uint32_t i = 0; i < landmarks.size(); ++i)
    z.push_back({landmarks[i] - x + normal(Relative{}.covariance, random), i});
  return z;
}

inline const cairn::LandmarkOptions keep_all{.gate = 1 - 1e-12};

/// A drive of a few steps, the same for every filter.
struct Drive {
  std::vector<Map::Observation> seen{};
  Joint exact{};
};
inline Drive drive(std::uint64_t seed) {
  Random random(seed);
  Drive d;
  Plane is = Plane::Zero();
  for (int step = 0; step < 4; ++step) {
    is += Plane(0.5, 0.1) + normal(motion_noise, random);
    d.seen.push_back(seen_from(is, random));
    d.exact.move();
    for (const auto& s : d.seen.back()) d.exact.see(*s.identity, s.z, Relative{}.covariance);
  }
  return d;
}

/// Squared distance of the particles' mean pose and landmarks from the joint filter's. Calls
/// after_step(belief, did) for each.
template <class AfterStep>
double squared_error(const Drive& d, std::size_t count, std::uint64_t seed,
                     const cairn::ConditionalFilter& options, const cairn::FromLandmarks& proposal,
                     const AfterStep& after_step) {
  cairn::MappedPaths<Map> belief(Plane::Zero(), Map({}, keep_all), count);
  cairn::ConditionalFilter filter = options;
  filter.seed = seed;
  for (const auto& z : d.seen) {
    const auto did = filter.step(belief, motion, proposal, z);
    if (!did.accepted()) cairn::raise("linear_slam: a step was not accepted");
    after_step(belief, did);
  }
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(d.exact.mean.size());
  const std::vector<double> weights = belief.particles().weights();
  for (std::size_t i = 0; i < count; ++i) {
    mean.head(2) += weights[i] * belief[i].pose;
    for (const auto& [id, row] : d.exact.row_of)
      mean.segment(row, 2) += weights[i] * belief[i].map.find(id)->belief.mean;
  }
  return (mean - d.exact.mean).squaredNorm();
}
inline double squared_error(const Drive& d, std::size_t count, std::uint64_t seed) {
  return squared_error(d, count, seed, {}, {}, [](const auto&, const auto&) {});
}

/// By what power of the number of particles the root mean square error falls, from 30 to 3,000.
inline double slope_of_error(const Drive& d, std::uint64_t seed) {
  const auto log_error = [&](std::size_t count, int runs) {
    double sum = 0;
    for (int run = 0; run < runs; ++run)
      sum += squared_error(d, count, seed * 1000 + static_cast<std::uint64_t>(run)) / runs;
    return 0.5 * std::log(sum);
  };
  return (log_error(3000, 30) - log_error(30, 60)) / std::log(100.0);
}

}  // namespace cairn_test::linear_slam
