// words: cairn: a query; [axis]; Through
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/index/nearest_first.hpp>

struct Foreign {
  double x, y, z;
};

auto first(const cairn::KdTree<double, 3>& tree, const Foreign& query) {
  return cairn::NearestFirst(tree, query).next();
}
