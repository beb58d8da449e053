// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// NEES of a map wherever its frame is.
///
/// A map whose frame is its first camera is held against the truth through the true pose of that camera. An
/// error of this one pose moves all points alike, and a covariance of the map alone knows nothing of it: the
/// six numbers of it can outweigh all others in the NEES of the map. Here they are free:
///   min over xi of (e - G xi)^T P^-1 (e - G xi),   G_i = [I, -skew(x_i)]                                 (1)
/// which is what NEES would be if P held an endless variance of G xi, and has 3 n - 6 degrees of freedom.
#pragma once

#include <optional>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/eval/consistency.hpp>

namespace cairn_bench {

struct ShapeNees {
  double shape = 0;  ///< (1), of 3 n - 6
  double frame = 0;  ///< by how much NEES is more where the frame is held, of 6
};

/// By how much points, three numbers each, move with a step of the world about a centre: G of (1), 3 n x 6.
[[nodiscard]] inline cairn::Matrix<cairn::dynamic, 6> moved_with_world(
    const cairn::Vector<cairn::dynamic>& points, const cairn::Vector<3>& centre) {
  cairn::Matrix<cairn::dynamic, 6> G(points.size(), 6);
  for (Eigen::Index i = 0; i < points.size(); i += 3)
    G.middleRows<3>(i) << cairn::Matrix<3>::Identity(),
        -cairn::skew(cairn::Vector<3>(points.segment<3>(i) - centre));
  return G;
}

/// Of n points, three numbers each: where they are believed to be and their errors [m], their joint
/// covariance [m^2]. Nothing where the points lie on a line, so that some turn moves none of them, or P is
/// not positive definite. O(n^3).
[[nodiscard]] inline std::optional<ShapeNees> shape_nees(const cairn::Vector<cairn::dynamic>& points,
                                                         const cairn::Vector<cairn::dynamic>& errors,
                                                         const cairn::Matrix<cairn::dynamic>& P) {
  using cairn::dynamic;
  const Eigen::Index numbers = points.size();
  CAIRN_EXPECTS(numbers % 3 == 0 && errors.size() == numbers && P.rows() == numbers && P.cols() == numbers,
                "shape_nees: expected three numbers a point, and a covariance of all");
  const cairn::Cholesky<dynamic> factor(P);
  if (numbers == 0 || !factor.good()) return std::nullopt;
  const cairn::Matrix<dynamic, 6> G = moved_with_world(points, points.head<3>());
  const cairn::Matrix<dynamic, 6> W = factor.whiten(G);
  const cairn::Vector<dynamic> w = factor.whiten(errors);
  const cairn::Cholesky<6> information(cairn::Matrix<6>(W.transpose() * W));
  if (!information.good() || !(information.least_share() > 1e-12)) return std::nullopt;
  const cairn::Vector<6> step = information.solve(cairn::Vector<6>(W.transpose() * w));
  const double shape = (w - W * step).squaredNorm();
  return ShapeNees{shape, w.squaredNorm() - shape};
}

}  // namespace cairn_bench
