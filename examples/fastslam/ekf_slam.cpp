// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "ekf_slam.hpp"

#include <ctime>
#include <limits>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/joint_extended.hpp>
#include <cairn/manifold/product.hpp>

namespace fastslam {

namespace {

using cairn::Matrix;
using cairn::SE2;
using cairn::Vector;

/// A step that odometry gives with its covariance.
struct Step {
  using State = SE2;
  using Control = cairn::Gaussian<SE2>;
  [[nodiscard]] State propagate(const State& x, const Control& u, double) const { return x * u.mean; }
  [[nodiscard]] Matrix<3> jacobian(const State&, const Control& u, double) const {
    return u.mean.inverse().adjoint();
  }
  [[nodiscard]] Matrix<3> noise(const State&, const Control& u, double) const { return u.covariance; }
};

/// The point sensor over pose and landmark together.
struct JointSensor {
  using State = cairn::Product<SE2, Vector<2>>;
  using Measurement = PointSensor::Measurement;
  PointSensor sensor;

  [[nodiscard]] Measurement predict(const State& x) const { return sensor.predict(x.part<0>(), x.part<1>()); }
  [[nodiscard]] Matrix<2, 5> jacobian(const State& x) const {
    Matrix<2, 5> h;
    h.leftCols<3>() = sensor.state_jacobian(x.part<0>(), x.part<1>());
    h.rightCols<2>() = sensor.part_jacobian(x.part<0>(), x.part<1>());
    return h;
  }
  [[nodiscard]] Matrix<2> noise(const State& x) const { return sensor.noise(x.part<0>(), x.part<1>()); }
  [[nodiscard]] Vector<2> initialise(const SE2& x, const Measurement& z) const {
    return sensor.initialise(x, z);
  }
};

}  // namespace

EkfSlamRun ekf_slam(const LandmarkLog& log, double gate) {
  using Joint = cairn::JointGaussian<SE2, Vector<2>>;
  EkfSlamRun run;
  const std::clock_t begin = std::clock();
  const cairn::JointExtended filter{.gate = gate < 1 ? cairn::chi_square_quantile(gate, 2)
                                                     : std::numeric_limits<double>::infinity()};
  const JointSensor sensor{log.sensor};
  Joint belief;
  const auto robot = belief.add(SE2(), Matrix<3>::Zero()).id;
  std::map<std::uint32_t, cairn::BlockId<Vector<2>>> known;
  for (const Frame& frame : log.frames) {
    const cairn::Status status = filter.predict(belief, Step{}, 0.0, frame.moved, robot);
    if (status != cairn::Status::accepted) cairn::raise(std::string("ekf_slam: ") + explain(status));
    for (const auto& sighting : frame.seen) {
      if (!sighting.identity) continue;
      if (const auto at = known.find(*sighting.identity); at != known.end()) {
        static_cast<void>(filter.update(belief, sensor, sighting.z, robot, at->second));
      } else if (const auto added = belief.augment(cairn::inverted(sensor), sighting.z, robot);
                 added.accepted()) {
        known[*sighting.identity] = added.id;
      }
    }
    run.poses.push_back(belief.marginal(robot));
  }
  for (const auto& [id, block] : known) run.landmarks[id] = belief.mean(block);
  run.cpu_seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return run;
}

}  // namespace fastslam
