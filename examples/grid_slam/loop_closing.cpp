// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "loop_closing.hpp"

#include <algorithm>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>

namespace grid_slam {

namespace {

using cairn::Matrix;
using cairn::SE2;
using cairn::Vector;

/// The chain at a linearisation point, seen from its start: with Ad_k the adjoint of pose k + 1 there, the
/// adjoint that carries step k to the right of pose `last` is Ad(pose_last)^-1 Ad_k, so that sums over the
/// steps of a loop are differences of sums from the start on.
class Linearised : public ChainCovariance {
public:
  Linearised(const StepChain& chain, const StepChain& moved)
      : ChainCovariance(moved.steps, chain.covariances), moved_{Vector<3>::Zero()} {
    for (std::size_t k = 0; k < chain.steps.size(); ++k)
      moved_.push_back(moved_.back() + adjoint(k) * cairn::local(chain.steps[k], moved.steps[k]));
  }

  /// What the steps that both loops go over contribute to the covariance between their ends.
  [[nodiscard]] Matrix<3> shared(const Loop& a, const Loop& b) const {
    const std::size_t first = std::max(a.first, b.first), last = std::min(a.last, b.last);
    if (first >= last) return Matrix<3>::Zero();
    return to(a.last) * sum(first, last) * to(b.last).transpose();
  }
  /// How far the steps have moved the loop's end already.
  [[nodiscard]] Vector<3> moved(const Loop& loop) const {
    return to(loop.last) * (moved_[loop.last] - moved_[loop.first]);
  }

private:
  std::vector<Vector<3>> moved_;
};

/// Of what all loops measure together, before they are seen: of the steps, and of each loop's own noise.
Eigen::MatrixXd covariance_of_loops(const std::vector<Loop>& loops, const Linearised& at) {
  const auto rows = static_cast<Eigen::Index>(3 * loops.size());
  Eigen::MatrixXd matrix(rows, rows);
  for (std::size_t i = 0; i < loops.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    for (std::size_t j = 0; j <= i; ++j) {
      const Matrix<3> block = at.shared(loops[i], loops[j]);
      const auto column = static_cast<Eigen::Index>(3 * j);
      matrix.block<3, 3>(row, column) = block;
      matrix.block<3, 3>(column, row) = block.transpose();
    }
    matrix.block<3, 3>(row, row) += loops[i].covariance;
  }
  return matrix;
}

/// Moves every step by what the loops over it ask: covariance times the sum of Ad_k^T Ad(last)^-T multiplier.
void pull(StepChain& moved, const StepChain& chain, const std::vector<Loop>& loops, const Linearised& at,
          const Eigen::VectorXd& multiplier) {
  std::vector<Vector<3>> change(chain.steps.size() + 1, Vector<3>::Zero());
  for (std::size_t i = 0; i < loops.size(); ++i) {
    const Vector<3> force =
        at.to(loops[i].last).transpose() * multiplier.segment<3>(static_cast<Eigen::Index>(3 * i));
    change[loops[i].first] += force;
    change[loops[i].last] -= force;
  }
  Vector<3> force = Vector<3>::Zero();
  for (std::size_t k = 0; k < chain.steps.size(); ++k) {
    force += change[k];
    moved.steps[k] =
        cairn::retract(chain.steps[k], Vector<3>(chain.covariances[k] * (at.adjoint(k).transpose() * force)));
  }
}

}  // namespace

std::vector<SE2> poses_of(const StepChain& chain) {
  std::vector<SE2> poses{chain.start};
  poses.reserve(chain.steps.size() + 1);
  for (const SE2& step : chain.steps) poses.push_back(poses.back() * step);
  return poses;
}

ChainCovariance::ChainCovariance(const std::vector<SE2>& steps, const std::vector<Matrix<3>>& covariances)
    : sums_{Matrix<3>::Zero()} {
  CAIRN_EXPECTS(steps.size() == covariances.size(), "ChainCovariance needs a covariance for every step");
  SE2 pose;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    pose = pose * steps[k];
    adjoints_.push_back(pose.adjoint());
    inverses_.push_back(pose.inverse().adjoint());
    const Matrix<3>& a = adjoints_.back();
    sums_.push_back(sums_.back() + a * covariances[k] * a.transpose());
  }
}

Matrix<3> ChainCovariance::between(std::size_t first, std::size_t last) const {
  CAIRN_EXPECTS(first < last && last < sums_.size(), "ChainCovariance::between needs two poses in order");
  return to(last) * sum(first, last) * to(last).transpose();
}

std::vector<SE2> conditioned(const StepChain& chain, const std::vector<Loop>& loops,
                             const std::vector<Vector<3>>& noise) {
  CAIRN_EXPECTS(loops.size() == noise.size(), "conditioned needs a noise for every loop");
  StepChain moved = chain;
  const auto rows = static_cast<Eigen::Index>(3 * loops.size());
  for (int round = 0; round < 3 && !loops.empty(); ++round) {
    const std::vector<SE2> poses = poses_of(moved);
    const Linearised at(chain, moved);
    Eigen::VectorXd error(rows);
    for (std::size_t i = 0; i < loops.size(); ++i) {
      const Loop& loop = loops[i];
      CAIRN_EXPECTS(loop.first < loop.last && loop.last < poses.size(),
                    "a loop needs two poses of the path, in order");
      const auto row = static_cast<Eigen::Index>(3 * i);
      const SE2 seen = poses[loop.first].inverse() * poses[loop.last];
      error.segment<3>(row) = cairn::local(seen, loop.T_first_last) + noise[i] + at.moved(loop);
    }
    const cairn::Cholesky<cairn::dynamic> root(covariance_of_loops(loops, at));
    if (!root.good()) return poses_of(chain);
    pull(moved, chain, loops, at, root.solve(error));
  }
  return poses_of(moved);
}

StepChain drawn_steps(const std::vector<cairn::PathPose<SE2>>& path) {
  // A match that is surer than this is a match to what was seen a moment ago.
  const Matrix<3> least = Vector<3>(9e-6, 9e-6, 1e-6).asDiagonal();
  StepChain chain{path.front().pose, {}, {}};
  for (std::size_t k = 1; k < path.size(); ++k) {
    chain.steps.push_back(path[k].before.inverse() * path[k].drawn);
    chain.covariances.push_back(path[k].drawn_from.covariance + least);
  }
  return chain;
}

Matrix<3> covariance_of_end(const std::vector<cairn::PathPose<SE2>>& path, const std::vector<Loop>& loops) {
  CAIRN_EXPECTS(!path.empty(), "covariance_of_end needs a path");
  if (path.size() == 1) return Matrix<3>::Zero();
  const StepChain drawn = drawn_steps(path);
  StepChain moved = drawn;
  for (std::size_t k = 0; k < moved.steps.size(); ++k)
    moved.steps[k] = path[k].pose.inverse() * path[k + 1].pose;
  const Linearised at(drawn, moved);
  const Loop whole{0, drawn.steps.size(), {}, Matrix<3>::Zero()};
  const Matrix<3> prior = at.shared(whole, whole);
  if (loops.empty()) return prior;
  const cairn::Cholesky<cairn::dynamic> root(covariance_of_loops(loops, at));
  if (!root.good()) return prior;
  Eigen::MatrixXd seen(static_cast<Eigen::Index>(3 * loops.size()), 3);
  for (std::size_t i = 0; i < loops.size(); ++i)
    seen.block<3, 3>(static_cast<Eigen::Index>(3 * i), 0) = at.shared(loops[i], whole);
  Matrix<3> told = Matrix<3>::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::VectorXd column = seen.col(axis);
    told.col(axis) = seen.transpose() * root.solve(column);
  }
  return cairn::symmetrised(Matrix<3>(prior - told));
}

std::vector<cairn::PathPose<SE2>> moved_by(std::vector<cairn::PathPose<SE2>> path,
                                           const std::vector<Loop>& loops, cairn::Random& random) {
  CAIRN_EXPECTS(!path.empty(), "moved_by needs a path");
  std::vector<Vector<3>> noise;
  for (const Loop& loop : loops) {
    const double turn = random.normal(), y = random.normal(), x = random.normal();
    noise.emplace_back(cairn::Cholesky<3>(loop.covariance).lower() * Vector<3>(x, y, turn));
  }
  const std::vector<SE2> moved = conditioned(drawn_steps(path), loops, noise);
  for (std::size_t k = 0; k < moved.size(); ++k) {
    path[k].drawn_from.mean = moved[k] * (path[k].pose.inverse() * path[k].drawn_from.mean);
    path[k].pose = moved[k];
  }
  return path;
}

}  // namespace grid_slam
