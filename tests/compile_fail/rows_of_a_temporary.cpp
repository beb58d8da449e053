// words: deleted; a temporary: gone before it is read
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <vector>

#include <cairn/index/kd_tree.hpp>

std::vector<float> measured();

auto tree() {
  const cairn::Rows<float> points(measured(), 3);
  return cairn::KdTree<float, 3>(points);
}
