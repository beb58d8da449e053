// words: a radius? within(query, radius)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>

#include <cairn/index/kd_tree.hpp>

auto near(const cairn::KdTree<float, 3>& tree, const std::array<float, 3>& query) {
  return tree.nearest(query, 0.5F);
}
