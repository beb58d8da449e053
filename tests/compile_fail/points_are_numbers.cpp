// words: cairn: a set of points is asked for; rows_of(m); Rows(numbers, 3)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <vector>

#include <cairn/index/kd_tree.hpp>

auto tree(const std::vector<double>& numbers) {
  return cairn::KdTree<double, 3>(numbers);
}
