// words: cairn: a query; [axis]; std::array{q.x, q.y}
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/index/box_query.hpp>

struct Foreign {
  double x, y, z;
};

auto in_a_room(const cairn::KdTree<double, 3>& tree, const Foreign& low, const Foreign& high) {
  return cairn::inside(tree, low, high);
}
