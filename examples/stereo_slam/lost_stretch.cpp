// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "lost_stretch.hpp"

#include <cstddef>
#include <optional>

#include <cairn/core/check.hpp>

namespace stereo_slam {
namespace {

double time_between(const FrameRecord& from, const FrameRecord& to) {
  return seconds_between(from.time, to.time);
}

cairn::Gaussian<cairn::SE3> pose_of(const FrameRecord& frame) {
  return {frame.T_world_camera, frame.covariance};
}

/// A of (1).
cairn::Vector<6> densities(const SteadyTwist& process) {
  cairn::Vector<6> A;
  A << cairn::Vector<3>::Constant(process.acceleration * process.acceleration),
      cairn::Vector<3>::Constant(process.turning * process.turning);
  return A;
}

/// How far the camera may have come in so many seconds, as a covariance.
cairn::Matrix<6> gone_on(const cairn::Vector<6>& twist, double seconds, const SteadyTwist& process) {
  cairn::Vector<6> variances = seconds * seconds * seconds / 3 * densities(process);
  variances.head<3>().array() += seconds * seconds * twist.head<3>().squaredNorm();
  variances.tail<3>().array() += seconds * seconds * twist.tail<3>().squaredNorm();
  return variances.asDiagonal();
}

}  // namespace

cairn::Gaussian<cairn::SE3> pose_between(const cairn::Gaussian<cairn::SE3>& before,
                                         const cairn::Gaussian<cairn::SE3>& after, double seconds,
                                         double duration, const SteadyTwist& process) {
  CAIRN_EXPECTS(seconds >= 0 && seconds <= duration && duration > 0, "pose_between needs a time between");
  const double part = seconds / duration, left = duration - seconds;
  const cairn::Vector<6> step = cairn::local(before.mean, after.mean);
  cairn::Matrix<6> P = (1 - part) * before.covariance + part * after.covariance;
  P.diagonal() += seconds * seconds * left * left / (3 * duration) * densities(process);
  return {cairn::retract(before.mean, cairn::Vector<6>(part * step)), P};
}

void lay_lost_frames(std::vector<FrameRecord>& frames, const SteadyTwist& process) {
  std::optional<std::size_t> known;  // the newest frame whose pose is
  cairn::Vector<6> twist = cairn::Vector<6>::Zero();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i].tracked && !frames[i].carried) continue;
    if (known && *known + 1 == i)
      twist = cairn::local(frames[*known].T_world_camera, frames[i].T_world_camera) /
              time_between(frames[*known], frames[i]);
    if (known && *known + 1 < i) {
      double duration = 0, seconds = 0;
      for (std::size_t k = *known; k < i; ++k) duration += time_between(frames[k], frames[k + 1]);
      for (std::size_t k = *known + 1; k < i; ++k) {
        seconds += time_between(frames[k - 1], frames[k]);
        const auto pose =
            pose_between(pose_of(frames[*known]), pose_of(frames[i]), seconds, duration, process);
        frames[k].T_world_camera = pose.mean;
        frames[k].covariance = pose.covariance;
        frames[k].bridged = true;
      }
      twist = cairn::local(frames[*known].T_world_camera, frames[i].T_world_camera) / duration;
    }
    known = i;
  }
  if (!known) return;
  double seconds = 0;
  for (std::size_t k = *known + 1; k < frames.size(); ++k) {
    seconds += time_between(frames[k - 1], frames[k]);
    frames[k].covariance = frames[*known].covariance + gone_on(twist, seconds, process);
  }
}

}  // namespace stereo_slam
