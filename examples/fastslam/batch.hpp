// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The least squares estimate of a whole log whose associations are known: what a filter is held against
/// where there is no truth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/manifold/se2.hpp>

#include "landmark_log.hpp"

namespace fastslam {

struct BatchOptimum {
  std::vector<cairn::SE2> poses;  ///< one for each frame
  std::map<std::uint32_t, cairn::Vector<2>> landmarks;
  double cost = 0;  ///< half of the sum of the squared whitened residuals
  int iterations = 0;
  bool converged = false;
};

/// Gauss-Newton with Levenberg's damping from these poses; landmarks begin where they are first seen from.
/// The first frame's motion starts at the identity. Sightings without an identity do not count. Throws
/// cairn::Error where there are not as many poses as frames, or a motion's covariance is singular.
[[nodiscard]] BatchOptimum batch_optimum(const LandmarkLog& log, const std::vector<cairn::SE2>& start);

/// The same of the log's first frames and then of more and more, each begun where the last ended and moved on
/// by odometry: no start is needed, and drift does not grow before a loop corrects it.
[[nodiscard]] BatchOptimum growing_batch_optimum(const LandmarkLog& log, std::size_t by = 50);

/// The Gaussian about a batch optimum that has its curvature (Laplace's approximation), of the poses alone:
/// landmarks are integrated out.
class PathDensity {
public:
  /// Throws cairn::Error where the optimum's equations are singular.
  PathDensity(const LandmarkLog& log, BatchOptimum at);
  ~PathDensity();

  [[nodiscard]] const BatchOptimum& optimum() const noexcept;
  [[nodiscard]] std::vector<cairn::SE2> draw(cairn::Random& random) const;
  /// But for a constant.
  [[nodiscard]] double log_density(const std::vector<cairn::SE2>& poses) const;

private:
  struct Equations;
  std::unique_ptr<const Equations> equations_;
};

}  // namespace fastslam
