// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The cells that a search under a budget has yet to visit, nearest first.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Cell: has a `bound`, how near it may be. Under a budget of few leaves no more cells are kept than can
/// still be visited, sorted: most others are turned away by one comparison, and the nearest is at hand. Equal
/// bounds come out as they went in. Under a larger one, or none, the cells are a heap.
template <class Cell>
class CellQueue {
public:
  using Real = decltype(Cell::bound);

  /// Forgets all cells; `leaves` may be visited from now on, one for each cell that is taken.
  void open(std::size_t leaves) noexcept {
    cells_.clear();
    sorted_ = leaves <= few_leaves;
    room_ = leaves;
    turned_away_ = std::numeric_limits<Real>::infinity();
  }

  /// True where no cell is left, or no leaf of the budget.
  [[nodiscard]] bool done() const noexcept { return cells_.empty() || room_ == 0; }
  /// The least bound of the cells that were not taken out.
  [[nodiscard]] Real left_out() const noexcept {
    if (cells_.empty()) return turned_away_;
    return std::min(turned_away_, (sorted_ ? cells_.back() : cells_.front()).bound);
  }

  /// False, and remembered for left_out(), where a cell of this bound is farther than as many as can be
  /// visited: push() is for the others.
  [[nodiscard]] bool takes(Real bound) noexcept {
    if (!sorted_ || cells_.size() < room_ || (room_ != 0 && bound < cells_.front().bound)) return true;
    turned_away_ = std::min(turned_away_, bound);
    return false;
  }

  void push(const Cell& cell) {
    if (!sorted_) {
      cells_.push_back(cell);
      std::push_heap(cells_.begin(), cells_.end(), Farther{});
    } else if (cells_.size() < room_) {
      cells_.push_back(cell);
      auto place = cells_.end() - 1;  // the nearest cells stand last, and move up
      for (; place != cells_.begin() && !Farther{}(place[-1], cell); --place) *place = place[-1];
      *place = cell;
    } else {
      turned_away_ = std::min(turned_away_, cells_.front().bound);
      auto place = cells_.begin();  // the farthest, which goes; those nearer than it move down
      for (; place + 1 != cells_.end() && Farther{}(place[1], cell); ++place) *place = place[1];
      *place = cell;
    }
  }

  /// Takes out the nearest cell, for a leaf of the budget. Not where done().
  Cell pop() {
    if (!sorted_) std::pop_heap(cells_.begin(), cells_.end(), Farther{});
    const Cell cell = cells_.back();
    cells_.pop_back();
    --room_;
    return cell;
  }

private:
  static constexpr std::size_t few_leaves = 256;  ///< up to here sorting is cheaper than a heap

  /// A type: a function would be called by its pointer.
  struct Farther {
    bool operator()(const Cell& a, const Cell& b) const noexcept { return a.bound > b.bound; }
  };

  std::vector<Cell> cells_;
  bool sorted_ = false;
  std::size_t room_ = 0;  ///< leaves of the budget that are not spent
  Real turned_away_ = std::numeric_limits<Real>::infinity();
};

}}}  // namespace cairn::CAIRN_ABI::detail
