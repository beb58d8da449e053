// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Parts of the images that are left out, cell by cell (riding_along.hpp says which and why).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stereo_slam {

/// Cells of one image that are left out; none where it was not given a size.
class HiddenCells {
public:
  HiddenCells() = default;
  /// Of an image of that size [pixels].
  HiddenCells(int width, int height);

  /// Whether a point there is left out; what lies beyond the rim counts to the cell nearest to it. O(1).
  [[nodiscard]] bool hides(double x, double y) const noexcept {
    return !cells_.empty() && cells_[cell_of(x, y)] != 0;
  }
  [[nodiscard]] std::size_t cell_of(double x, double y) const noexcept;
  [[nodiscard]] std::size_t size() const noexcept { return cells_.size(); }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] bool hidden(std::size_t cell) const noexcept { return cells_[cell] != 0; }
  void set(std::size_t cell, bool hidden) noexcept;
  /// Cells that are hidden in one and not in the other, of images of one size.
  [[nodiscard]] std::size_t unlike(const HiddenCells& other) const;

private:
  int side_ = 1, columns_ = 0, rows_ = 0;  // of a cell [pixels], of the grid [cells]
  std::size_t count_ = 0;
  std::vector<std::uint8_t> cells_;
};

/// Where points are looked for.
struct HiddenParts {
  std::array<HiddenCells, 2> cells;  ///< not here, in the left and the right image
  bool evenly = false;               ///< all over the images, though other parts have stronger ones
};

}  // namespace stereo_slam
