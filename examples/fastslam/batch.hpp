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

/// The same without the names that all else contradicts, which the log then no longer has: bar codes are read
/// wrongly, and one that is 60 sigma off bends a whole path. The worst is left out first, with what is half
/// as far off, and the rest solved again, until what is left is off by no more than one sighting in ten
/// million that are right. So many of the start's first poses are `settled`, near the optimum. Where
/// something beyond is left out, what was read wrongly may have bent the rest of the start so far that there
/// is no way back from it: then more and more frames are also added to the settled ones, and the likelier is
/// taken.
[[nodiscard]] BatchOptimum doubting_batch_optimum(LandmarkLog& log, const std::vector<cairn::SE2>& start,
                                                  std::size_t settled = 0);

/// The same of the log's first frames and then of more and more, each begun where the last ended and moved on
/// by odometry: no start is needed, and drift does not grow before a loop corrects it.
[[nodiscard]] BatchOptimum growing_batch_optimum(const LandmarkLog& log, std::size_t by = 50);

/// The Gaussian about a batch optimum that has its curvature (Laplace's approximation), of the poses alone:
/// landmarks are integrated out. It is Gaussian in what the motions are off odometry, step by step, and a
/// path is made of its steps: wheels slip by millimetres where a place is known to decimetres, and a Gaussian
/// of the places bends every step by more than that, to the second order of turns and places.
class PathDensity {
public:
  /// Throws cairn::Error where the optimum's equations are singular.
  PathDensity(const LandmarkLog& log, BatchOptimum at);
  PathDensity(PathDensity&&) noexcept;
  PathDensity& operator=(PathDensity&&) noexcept;
  ~PathDensity();

  [[nodiscard]] const BatchOptimum& optimum() const noexcept;
  /// How many numbers a path is made of: those of poses and landmarks.
  [[nodiscard]] std::size_t size() const noexcept;
  /// The path of so many numbers, which are independent and standard normal where it is a draw.
  [[nodiscard]] std::vector<cairn::SE2> path(const std::vector<double>& white) const;
  [[nodiscard]] std::vector<cairn::SE2> draw(cairn::Random& random) const;
  /// But for the power of 2 pi, which all paths of as many poses share, whatever was seen.
  [[nodiscard]] double log_density(const std::vector<cairn::SE2>& poses) const;

private:
  struct Equations;
  std::unique_ptr<const Equations> equations_;
};

}  // namespace fastslam
