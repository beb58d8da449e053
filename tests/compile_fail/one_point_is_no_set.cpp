// words: cairn: a set of points is asked for; std::array{point}
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>

#include <cairn/index/multi_kd_tree.hpp>

auto grow(cairn::MultiKdTree<float, 3>& map) {
  return map.insert(std::array{1.0F, 2.0F, 3.0F});
}
