// words: deleted; a temporary or an expression; give it a name
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <Eigen/Core>

#include <cairn/index/kd_tree.hpp>

Eigen::Matrix3Xd measured();

auto tree() {
  const auto points = cairn::columns_of(measured());
  return cairn::KdTree<double, 3>(points);
}
