// words: cairn: ; []; Through
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <vector>

#include <cairn/index/kd_tree.hpp>

struct Foreign {
  double x, y, z;
};

auto tree(const std::vector<Foreign>& points) {
  return cairn::KdTree<double, 3>(points);
}
