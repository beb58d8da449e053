// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The camera's motion between frames: where it will be, for how long that can be said of a camera that sees
/// nothing, and whether it can be where the map says it is.
///
/// State (T, u): pose of the camera in the world and its twist u = (v, w) in its own axes [m/s, rad/s], which
/// white acceleration changes:
///   T <- T exp(u dt),   u <- u,   Q = [dt^3/3 D, dt^2/2 D; dt^2/2 D, dt D]                 (1)
/// with D = diag(a^2, a^2, a^2, b^2, b^2, b^2), to first order in how far a step turns. The poses that the
/// map gives are measurements of T. What is reported of a frame that was located stays the map's word: its
/// errors are those of the keyframes, the same for many frames, which a filter over frames would take for
/// independent.
#pragma once

#include <array>
#include <optional>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se3.hpp>

namespace stereo_slam {

/// Seconds from one frame to the next; a tenth where the clock of a recording stands still or runs back.
[[nodiscard]] double seconds_between(double from, double to);

/// Which filter follows the motion.
enum class Motion {
  off,       ///< the last step is repeated; a camera that is lost stays where it was seen last
  ekf,       ///< extended Kalman filter
  iterated,  ///< the same, its update iterated
  ukf        ///< unscented
};
inline constexpr std::array<const char*, 4> motion_names{"off", "ekf", "iterated", "ukf"};

/// Pose of the left camera in the world, and its twist.
using Moving = cairn::Product<cairn::SE3, cairn::Vector<6>>;

/// (1) as a process.
struct SteadyTwist {
  using State = Moving;
  using Control = cairn::NoControl;

  double acceleration = 1;  ///< a: root of the spectral density of the acceleration [m/s^2/sqrt(Hz)]
  double turning = 1;       ///< b: of the angular acceleration [rad/s^2/sqrt(Hz)]

  [[nodiscard]] State propagate(const State& x, const Control&, double dt) const;
  [[nodiscard]] cairn::Matrix<12> jacobian(const State& x, const Control&, double dt) const;
  [[nodiscard]] cairn::Matrix<12> noise(const State& x, const Control&, double dt) const;
};

/// A pose as the map gives it.
struct LocatedPose {
  using State = Moving;
  using Measurement = cairn::SE3;

  cairn::Matrix<6> covariance;  ///< of a right step, translation then rotation

  [[nodiscard]] Measurement predict(const State& x) const { return x.part<0>(); }
  [[nodiscard]] cairn::Matrix<6, 12> jacobian(const State&) const;
  [[nodiscard]] const cairn::Matrix<6>& noise(const State&) const { return covariance; }
};

struct MotionOptions {
  Motion filter = Motion::off;
  SteadyTwist process;
  double first_speed = 20;  ///< sigma of the speed at first [m/s]
  double first_turn = 2;    ///< of the turn rate [rad/s]
  /// A pose that right models give so rarely is refused. Jolts have longer tails than normal noise.
  double refused_probability = 1e-9;
  double lost_position = 0.5;  ///< a camera that sees nothing is lost when its place is this unsure [m]
  double lost_angle = 0.5;     ///< or its attitude [rad]: standard deviations of any one axis
};

/// Follows one camera. What the filter refuses to compute (numbers that are not finite) counts as unknown.
class PoseFilter {
public:
  explicit PoseFilter(const MotionOptions& options = {});

  [[nodiscard]] bool on() const noexcept { return options_.filter != Motion::off; }
  /// Where the camera is, of which nothing else is known.
  void begin(const cairn::SE3& T_world_camera, const cairn::Matrix<6>& covariance);
  /// Goes on by dt seconds.
  void predict(double dt);
  /// Takes the pose that the map gives, or refuses it: false, and the belief is as before.
  [[nodiscard]] bool update(const cairn::SE3& T_world_camera, const cairn::Matrix<6>& covariance);

  /// Pose and covariance; nothing before begin().
  [[nodiscard]] std::optional<cairn::Gaussian<cairn::SE3>> pose() const;
  /// Whether the pose is known well enough to go on from. False before begin().
  [[nodiscard]] bool knows() const;

private:
  MotionOptions options_;
  double gate_;
  std::optional<cairn::Gaussian<Moving>> belief_;
};

}  // namespace stereo_slam
