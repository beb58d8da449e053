// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A field measured on a regular grid: brightness, elevation, magnetic anomaly...
///
/// Node (column, row) lies at x = x0 + column dx, y = y0 + row dy, with dx, dy > 0. NaN marks a void: a node
/// whose value is not known. The folder field/ stands on core/ and filter/ and knows nothing of index/,
/// vision/ and geometry/; grid, field_map, gaussian_blur, random_field and patch need the standard library
/// alone.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Where the nodes of a grid lie. [m], or whatever the user measures ground in.
struct GridFrame {
  double x0 = 0;  ///< of node (0, 0)
  double y0 = 0;
  double dx = 1;  ///< between columns, > 0
  double dy = 1;  ///< between rows, > 0
};

/// The value of a void.
inline constexpr double void_value = std::numeric_limits<double>::quiet_NaN();

/// Values at the nodes, row by row; owns them.
class FieldGrid {
public:
  /// A grid of `columns` x `rows` nodes (at least 2 x 2) filled with `value`. Throws Error on bad sizes or a
  /// bad frame.
  FieldGrid(int columns, int rows, const GridFrame& frame = {}, double value = 0.0)
      : columns_(columns), rows_(rows), frame_(frame) {
    check_frame();
    values_.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), value);
  }

  /// A grid of these values, row by row; NaN are voids. Throws Error naming the first infinite value, or when
  /// their number is wrong.
  FieldGrid(int columns, int rows, const GridFrame& frame, std::vector<double> values)
      : columns_(columns), rows_(rows), frame_(frame), values_(std::move(values)) {
    check_frame();
    const std::size_t expected = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
    if (values_.size() != expected)
      raise("FieldGrid: expected " + std::to_string(expected) + " values, found " +
            std::to_string(values_.size()));
    for (std::size_t i = 0; i < values_.size(); ++i)
      if (std::isinf(values_[i])) raise("FieldGrid: value " + std::to_string(i) + " is infinite");
  }

  [[nodiscard]] int columns() const noexcept { return columns_; }
  [[nodiscard]] int rows() const noexcept { return rows_; }
  [[nodiscard]] const GridFrame& frame() const noexcept { return frame_; }
  [[nodiscard]] double operator()(int column, int row) const noexcept { return values_[index(column, row)]; }
  [[nodiscard]] double& operator()(int column, int row) noexcept { return values_[index(column, row)]; }
  [[nodiscard]] const std::vector<double>& values() const noexcept { return values_; }
  [[nodiscard]] std::vector<double>& values() noexcept { return values_; }

  /// Coordinates of a column and of a row.
  [[nodiscard]] double x(double column) const noexcept { return frame_.x0 + column * frame_.dx; }
  [[nodiscard]] double y(double row) const noexcept { return frame_.y0 + row * frame_.dy; }
  /// Coordinates of the last node.
  [[nodiscard]] double x_end() const noexcept { return x(columns_ - 1); }
  [[nodiscard]] double y_end() const noexcept { return y(rows_ - 1); }

private:
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  void check_frame() const {
    if (columns_ < 2 || rows_ < 2)
      raise("FieldGrid: expected at least 2 columns and 2 rows, found " + std::to_string(columns_) + " x " +
            std::to_string(rows_));
    if (!(frame_.dx > 0.0 && frame_.dy > 0.0) ||
        !std::isfinite(frame_.dx + frame_.dy + frame_.x0 + frame_.y0))
      raise("FieldGrid: expected a finite origin and finite spacings above zero");
  }

  int columns_;
  int rows_;
  GridFrame frame_;
  std::vector<double> values_;
};

}}  // namespace cairn::CAIRN_ABI
