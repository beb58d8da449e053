// words: deleted; a temporary or an expression; give it a name
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <Eigen/Core>

#include <cairn/index/kd_tree.hpp>

auto tree(const Eigen::Matrix3d& R, const Eigen::Matrix3Xd& points) {
  return cairn::KdTree<double, 3>(cairn::columns_of(R * points));
}
