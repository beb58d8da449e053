// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A path of drawn steps, conditioned on relative poses that were measured between its ends: loops.
///
/// The steps d_k of a path are independent with covariance S_k; a loop measures the product of the steps from
/// `first` to `last`, with covariance R. Linearised, the loop's error e is A d with A_k the adjoint that
/// carries step k to the loop's end, and the path is moved by S A^T (A S A^T + R)^-1 (e + v), v ~ N(0, R),
/// all loops at once: Matheron's rule, which turns a draw from the prior into a draw from the posterior. So
/// every particle stays a sample, and none needs a weight for it. (A. Journel, C. Huijbregts, "Mining
/// Geostatistics", 1978, p. 495; J. Wilson et al., "Pathwise conditioning of Gaussian processes", JMLR 22,
/// 2021, eq. 8.)
#pragma once

#include <cstddef>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/manifold/se2.hpp>

namespace grid_slam {

/// Pose `last` of the path was seen at T_first_last from pose `first`, first < last.
struct Loop {
  std::size_t first = 0;
  std::size_t last = 0;
  cairn::SE2 T_first_last;
  cairn::Matrix<3> covariance = cairn::Matrix<3>::Zero();  ///< of steps on the right of T_first_last
};

/// A path as its steps: pose k + 1 is pose k times step k.
struct StepChain {
  cairn::SE2 start;
  std::vector<cairn::SE2> steps;
  std::vector<cairn::Matrix<3>> covariances;  ///< of each step, on its right
};

/// Poses of the chain, one more than steps.
[[nodiscard]] std::vector<cairn::SE2> poses_of(const StepChain& chain);

/// How uncertain poses of a chain are, seen from others, as sums over its steps from the start on: O(steps)
/// to make, O(1) to ask.
class ChainCovariance {
public:
  /// `covariances` are those of the steps, each on its right; as many as steps.
  ChainCovariance(const std::vector<cairn::SE2>& steps, const std::vector<cairn::Matrix<3>>& covariances);
  explicit ChainCovariance(const StepChain& chain) : ChainCovariance(chain.steps, chain.covariances) {}

  /// Covariance of pose `last` seen from pose `first`, by the steps between them, on the right of `last`.
  [[nodiscard]] cairn::Matrix<3> between(std::size_t first, std::size_t last) const;

  /// Of what the steps from `first` to `last` add, seen from the start.
  [[nodiscard]] cairn::Matrix<3> sum(std::size_t first, std::size_t last) const {
    return sums_[last] - sums_[first];
  }
  /// Carries what is on the right of step k to the start.
  [[nodiscard]] const cairn::Matrix<3>& adjoint(std::size_t k) const { return adjoints_[k]; }
  /// Carries what is seen from the start to the right of pose `last`, which is not the first.
  [[nodiscard]] const cairn::Matrix<3>& to(std::size_t last) const { return inverses_[last - 1]; }

private:
  std::vector<cairn::Matrix<3>> adjoints_, inverses_, sums_;
};

/// The chain given the loops, each with its noise v (zeros for the most likely path). Three rounds of
/// Gauss-Newton. The chain as it is where the loops' matrix is not positive definite.
[[nodiscard]] std::vector<cairn::SE2> conditioned(const StepChain& chain, const std::vector<Loop>& loops,
                                                  const std::vector<cairn::Vector<3>>& noise);

/// The steps of a particle's path as they were drawn, with the covariances of what they were drawn from.
[[nodiscard]] StepChain drawn_steps(const std::vector<cairn::PathPose<cairn::SE2>>& path);

/// Covariance of a path's last pose, seen from its first, by the steps as they were drawn and given the
/// loops; on the right of the last pose.
[[nodiscard]] cairn::Matrix<3> covariance_of_end(const std::vector<cairn::PathPose<cairn::SE2>>& path,
                                                 const std::vector<Loop>& loops);

/// The path given the loops, with a noise drawn for each of them. It begins from the steps as they were
/// drawn, whatever has moved the path since: so no loop counts twice, and a path that is moved again is as
/// likely to go there as to come back (the move keeps the posterior, in detailed balance).
[[nodiscard]] std::vector<cairn::PathPose<cairn::SE2>> moved_by(std::vector<cairn::PathPose<cairn::SE2>> path,
                                                                const std::vector<Loop>& loops,
                                                                cairn::Random& random);

}  // namespace grid_slam
