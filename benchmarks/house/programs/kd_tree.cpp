// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <iostream>
#include <vector>

#include <cairn/index/kd_tree.hpp>

int main() {
  const std::vector<std::array<float, 3>> points{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}};
  const std::array query{0.9F, 0.1F, 0.0F};
  const cairn::KdTree<float, 3> tree(points);
  if (const auto hit = tree.nearest(query)) std::cout << hit->id << ' ' << hit->distance << '\n';
  for (const auto& [id, distance] : tree.nearest(query, 2)) std::cout << id << ' ' << distance << '\n';
  for (const auto& [id, distance] : tree.within(query, 1.5F)) std::cout << id << ' ' << distance << '\n';
}
