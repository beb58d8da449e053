// words: cairn: a query; [axis]; Through
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/index/kd_tree.hpp>

struct Foreign {
  double x, y, z;
};

auto nearest(const cairn::KdTree<double, 3>& tree, const Foreign& query) {
  return tree.nearest(query, 2);
}
