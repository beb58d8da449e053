// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "reference_mounting.hpp"

#include <utility>
#include <vector>

#include <cairn/core/cholesky.hpp>
#include <cairn/manifold/derivatives.hpp>

#include "summary.hpp"

namespace stereo_slam {
namespace {

constexpr std::size_t fewest = 3;

/// The frames to be judged, with their reference in the world that has it right at the first.
std::vector<FrameRecord> judged(std::span<const FrameRecord> frames, std::size_t first,
                                const cairn::SO3& mounting) {
  std::vector<FrameRecord> result;
  if (first >= frames.size() || !frames[first].truth) return result;
  const cairn::SE3 X(mounting, cairn::Vector<3>::Zero());
  const cairn::SE3 T_estimate_truth = frames[first].T_world_camera * (*frames[first].truth * X).inverse();
  for (FrameRecord frame : frames.subspan(first + 1)) {
    if (!pose_nees(frame)) continue;
    frame.truth = T_estimate_truth * *frame.truth * X;
    result.push_back(std::move(frame));
  }
  return result;
}

double mean_nees(const std::vector<FrameRecord>& frames) {
  double sum = 0;
  for (const FrameRecord& frame : frames) sum += pose_nees(frame).value_or(0);
  return sum / static_cast<double>(frames.size());
}

}  // namespace

std::optional<MountedConsistency> mounted_consistency(std::span<const FrameRecord> frames,
                                                      std::size_t first) {
  const std::vector<FrameRecord> given = judged(frames, first, {});
  if (given.size() < fewest) return std::nullopt;
  // The errors in their standard deviations, one after the other, all frames as one vector.
  const auto whitened = [&](const cairn::SO3& X) {
    cairn::Vector<cairn::dynamic> all(6 * static_cast<Eigen::Index>(given.size()));
    Eigen::Index row = 0;
    for (const FrameRecord& frame : judged(frames, first, X)) {
      all.segment<6>(row) =
          cairn::Cholesky<6>(frame.covariance).whiten(cairn::local(frame.T_world_camera, *frame.truth));
      row += 6;
    }
    return all;
  };
  MountedConsistency result;
  result.nees_as_given = mean_nees(given);
  result.frames = given.size();
  cairn::SO3 X;
  constexpr int most_steps = 20;
  for (int step = 0; step < most_steps; ++step) {
    const cairn::Vector<cairn::dynamic> e = whitened(X);
    cairn::Matrix<cairn::dynamic, 3> J(e.size(), 3);
    constexpr double small = 1e-6;  // [rad]
    for (int i = 0; i < 3; ++i) {
      const cairn::Vector<3> turn = small * cairn::Vector<3>::Unit(i);
      J.col(i) = (whitened(X * cairn::SO3::exp(turn)) - whitened(X * cairn::SO3::exp(-turn))) / (2 * small);
    }
    const cairn::Cholesky<3> normal(cairn::Matrix<3>(J.transpose() * J));
    if (!normal.good()) return std::nullopt;
    const cairn::Vector<3> change = -normal.solve(cairn::Vector<3>(J.transpose() * e));
    X = X * cairn::SO3::exp(change);
    if (change.norm() < 1e-9) break;
  }
  result.turn = X.log();
  result.nees = mean_nees(judged(frames, first, X));
  return result;
}

std::optional<double> level_nees(std::span<const FrameRecord> frames, std::size_t first) {
  const std::vector<FrameRecord> given = judged(frames, first, {});
  if (given.size() < fewest) return std::nullopt;
  constexpr int level[3] = {0, 2, 4};  // x, z, and the turn about y, which points down
  double sum = 0;
  for (const FrameRecord& frame : given) {
    const cairn::Vector<6> error = cairn::local(frame.T_world_camera, *frame.truth);
    cairn::Vector<3> e;
    cairn::Matrix<3> P;
    for (int i = 0; i < 3; ++i) {
      e(i) = error(level[i]);
      for (int j = 0; j < 3; ++j) P(i, j) = frame.covariance(level[i], level[j]);
    }
    sum += cairn::Cholesky<3>(P).whiten(e).squaredNorm();
  }
  return sum / static_cast<double>(given.size());
}

}  // namespace stereo_slam
