// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "hidden_cells.hpp"

#include <algorithm>

namespace stereo_slam {

HiddenCells::HiddenCells(int width, int height)
    : side_(std::max(8, std::min(width, height) / 12)),
      columns_(width / side_ + 1),
      rows_(height / side_ + 1),
      cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0) {}

std::size_t HiddenCells::cell_of(double x, double y) const noexcept {
  const int column = std::clamp(static_cast<int>(x) / side_, 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(y) / side_, 0, rows_ - 1);
  return static_cast<std::size_t>(row * columns_ + column);
}

void HiddenCells::set(std::size_t cell, bool hidden) noexcept {
  if (hidden != (cells_[cell] != 0)) count_ = hidden ? count_ + 1 : count_ - 1;
  cells_[cell] = hidden ? 1 : 0;
}

std::size_t HiddenCells::unlike(const HiddenCells& other) const {
  std::size_t result = 0;
  for (std::size_t i = 0; i < cells_.size(); ++i) result += cells_[i] != other.cells_[i] ? 1 : 0;
  return result;
}

}  // namespace stereo_slam
