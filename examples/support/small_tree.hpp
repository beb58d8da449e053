// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A kd-tree that is small enough to be read, for the lesson on walking one. The longer side
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

}  // namespace example
