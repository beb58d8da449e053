// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// kd-trees that are small enough to be read, for the lessons on walking them. In the plane the longer side
/// of a cell is cut at the median of its points, down to leaves of at most eight (J. Friedman, J. Bentley, R.
/// Finkel, ACM TOMS 3, 1977, who cut the axis of the largest spread of the points). cairn::KdTree is the one
/// to use.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/statistics.hpp>

#include "support/report.hpp"

namespace example {

using Shop = std::array<double, 2>;  ///< a place [m]

/// A node.
struct Cell {
  Shop low, high;          // its box
  std::size_t begin, end;  // its shops
  std::size_t level = 0, axis = 0;
  double split = 0;
  std::vector<Cell> halves = {};  // none: a leaf

  [[nodiscard]] PlaneCurve box(std::string name, Ink ink, bool filled) const {
    PlaneCurve curve{.name = std::move(name), .ink = ink, .filled = filled};
    curve.x = {low[0], high[0], high[0], low[0], low[0]};
    curve.y = {low[1], low[1], high[1], high[1], low[1]};
    return curve;
  }
};

/// The tree below a cell, whose points it puts in the order of the leaves; O(n log n). `drawn` gets the
/// cells, level by level.
[[nodiscard]] inline Cell build(std::vector<Shop>& shops, Cell cell,
                                std::vector<std::vector<PlaneCurve>>& drawn) {
  drawn.resize(std::max(drawn.size(), cell.level + 1));
  drawn[cell.level].push_back(cell.box("cells", Ink::grey, false));
  if (cell.end - cell.begin <= 8) return cell;
  const std::size_t middle = cell.begin + (cell.end - cell.begin) / 2,
                    axis = cell.axis = cell.high[1] - cell.low[1] > cell.high[0] - cell.low[0] ? 1 : 0;
  const auto at = [&](std::size_t i) { return shops.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(cell.begin), at(middle), at(cell.end),
                   [&](const Shop& s, const Shop& t) { return s[axis] < t[axis]; });
  cell.split = shops[middle][axis];
  Cell left = cell, right = cell;
  left.level = right.level = cell.level + 1;
  left.end = right.begin = middle;
  left.high[axis] = right.low[axis] = cell.split;
  cell.halves = {build(shops, left, drawn), build(shops, right, drawn)};
  return cell;
}

/// Many numbers that stand for one thing.
using Descriptor = std::vector<float>;

struct Node {                                      // of a tree whose leaves hold up to 16 descriptors
  std::size_t begin, end, axis = 0, children = 0;  // children: the first of two, or 0 in a leaf
  float split = 0;
};

/// The axis along which a node's descriptors vary most.
[[nodiscard]] inline std::size_t widest_axis(const std::vector<Descriptor>& all, const Node& node) {
  double largest = -1;
  std::size_t widest = 0;
  for (std::size_t a = 0; a < all[0].size(); ++a) {
    cairn::RunningMoments moments;
    for (std::size_t i = node.begin; i < node.end; ++i) moments.add(static_cast<double>(all[i][a]));
    if (moments.variance() > largest) largest = moments.variance(), widest = a;
  }
  return widest;
}

/// The tree over descriptors of one length, which it puts in the order of the leaves; O(n d log n). The root
/// is the first node.
[[nodiscard]] inline std::vector<Node> build(std::vector<Descriptor>& all) {
  std::vector<Node> nodes{{0, all.size()}};
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    Node node = nodes[n];
    if (node.end - node.begin <= 16) continue;
    const std::size_t axis = node.axis = widest_axis(all, node), middle = (node.begin + node.end) / 2;
    const auto at = [&](std::size_t i) { return all.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(node.begin), at(middle), at(node.end),
                     [axis](const Descriptor& x, const Descriptor& y) { return x[axis] < y[axis]; });
    node.split = all[middle][axis];
    node.children = nodes.size();
    nodes[n] = node;
    nodes.push_back({node.begin, middle});
    nodes.push_back({middle, node.end});
  }
  return nodes;
}

}  // namespace example
