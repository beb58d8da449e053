// words: cairn: a query; [axis]; Through
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/index/multi_kd_tree.hpp>

struct Foreign {
  double x, y, z;
};

bool search(const cairn::MultiKdTree<double, 3>& tree, const Foreign& query, cairn::KNearest<double>& found) {
  return tree.search(query, found);
}
