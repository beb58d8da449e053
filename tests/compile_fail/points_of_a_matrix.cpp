// words: cairn: a set of points is asked for; columns_of(m)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <Eigen/Core>

#include <cairn/index/multi_kd_tree.hpp>

auto grow(cairn::MultiKdTree<double, 3>& map, const Eigen::Matrix3Xd& cloud) {
  return map.insert(cloud);
}
