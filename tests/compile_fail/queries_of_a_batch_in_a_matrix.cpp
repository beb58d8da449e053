// words: cairn: a set of points is asked for; columns_of(m)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <Eigen/Core>

#include <cairn/index/batch_search.hpp>
#include <cairn/index/kd_tree.hpp>

auto ask(const cairn::KdTree<double, 3>& tree, const Eigen::Matrix3Xd& scan) {
  return cairn::nearest_batch(tree, scan, 5);
}
