// words: cairn: a query; [axis]; Through
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <vector>

#include <cairn/index/inner_product.hpp>
#include <cairn/index/kd_tree.hpp>

struct Foreign {
  double x, y, z;
};

auto largest(const cairn::KdTree<float>& tree,
             const cairn::InnerProductPoints<std::vector<std::vector<float>>>& points, const Foreign& query) {
  return cairn::largest_products(tree, points, query, 5);
}
