// words: cairn: a point needs [axis]; cairn::Through
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <vector>

#include <cairn/index/batch_search.hpp>
#include <cairn/index/kd_tree.hpp>

struct Foreign {
  double x, y, z;
};

auto ask(const cairn::KdTree<double, 3>& tree, const std::vector<Foreign>& scan) {
  return cairn::nearest_batch(tree, scan, 5);
}
