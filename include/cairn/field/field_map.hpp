// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A field between the nodes of its grid: value, and the gradient of the same interpolant.
///
///   BilinearMap   continuous; the gradient jumps between cells
///   BsplineMap    bicubic B-spline through the nodes; value and gradient are continuous
///
/// The spline is f(u, v) = sum c_ij b(u - i) b(v - j) with the cubic B-spline b; the c_ij that make it pass
/// through the nodes come from a recursive filter of pole sqrt(3) - 2 along rows and columns, mirrored at the
/// rim (M. Unser, A. Aldroubi, M. Eden, "B-spline signal processing", IEEE T-SP 41(2), 1993). A filter that
/// linearises needs the gradient of the very function it predicts with: a gradient from finite differences
/// beside a bilinear value is a different function's.
///
/// A question outside the grid, or in a cell that touches a void, is answered by nothing. Safe for concurrent
/// use. Building is O(nodes), a question O(1).
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/field/grid.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A field at a point.
struct FieldSample {
  double value;
  double dx;  ///< derivative by x
  double dy;  ///< derivative by y
};

/// A field that can be asked anywhere: nothing means outside or void.
template <class M>
concept FieldInterpolant = requires(const M& map, double x, double y) {
  { map.at(x, y) } noexcept -> std::same_as<std::optional<FieldSample>>;
};

/// The grid with its voids filled by the mean of their nearest known neighbours, outwards from the known
/// nodes: a guess that is smooth enough to lay a spline through. Throws Error when nothing is known.
[[nodiscard]] inline FieldGrid without_voids(FieldGrid grid) {
  const int columns = grid.columns(), rows = grid.rows();
  std::vector<std::pair<int, int>> front;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c)
      if (std::isnan(grid(c, r))) front.emplace_back(c, r);
  if (front.size() == grid.values().size()) raise("FieldMap: every node is void");
  while (!front.empty()) {
    std::vector<std::pair<int, int>> left;
    std::vector<std::pair<std::size_t, double>> filled;
    for (const std::pair<int, int>& node : front) {
      double sum = 0;
      int known = 0;
      for (int r = std::max(node.second - 1, 0); r <= std::min(node.second + 1, rows - 1); ++r)
        for (int c = std::max(node.first - 1, 0); c <= std::min(node.first + 1, columns - 1); ++c)
          if (!std::isnan(grid(c, r))) {
            sum += grid(c, r);
            ++known;
          }
      if (known == 0)
        left.push_back(node);
      else
        filled.emplace_back(&grid(node.first, node.second) - grid.values().data(), sum / known);
    }
    for (const std::pair<std::size_t, double>& value : filled) grid.values()[value.first] = value.second;
    front.swap(left);
  }
  return grid;
}

namespace detail {

/// Which cells can answer: reach 0 asks the four corners, reach 1 the sixteen nodes of a cubic.
inline std::vector<std::uint8_t> usable_cells(const FieldGrid& grid, int reach) {
  const int columns = grid.columns(), rows = grid.rows();
  std::vector<std::uint8_t> usable;
  if (std::none_of(grid.values().begin(), grid.values().end(), [](double v) { return std::isnan(v); }))
    return usable;
  usable.assign(grid.values().size(), 1);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c)
      if (std::isnan(grid(c, r)))
        for (int y = std::max(r - 1 - reach, 0); y <= std::min(r + reach, rows - 1); ++y)
          for (int x = std::max(c - 1 - reach, 0); x <= std::min(c + reach, columns - 1); ++x)
            usable[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns) +
                   static_cast<std::size_t>(x)] = 0;
  return usable;
}

/// The cell a point lies in and where in it.
struct CellPlace {
  int column, row;
  double u, v;  // 0..1
};

/// What both interpolants share: the frame, the cell of a point, voids.
class CellFinder {
public:
  CellFinder(const FieldGrid& grid, int reach)
      : columns_(grid.columns()),
        rows_(grid.rows()),
        frame_(grid.frame()),
        per_dx_(1.0 / frame_.dx),
        per_dy_(1.0 / frame_.dy),
        usable_(usable_cells(grid, reach)) {}

  /// False outside, in a void, and for NaN.
  [[nodiscard]] bool find(double x, double y, CellPlace& place) const noexcept {
    const double column = (x - frame_.x0) * per_dx_;
    const double row = (y - frame_.y0) * per_dy_;
    if (!(column >= 0.0 && column <= columns_ - 1 && row >= 0.0 && row <= rows_ - 1)) return false;
    place.column = std::min(static_cast<int>(column), columns_ - 2);
    place.row = std::min(static_cast<int>(row), rows_ - 2);
    place.u = column - place.column;
    place.v = row - place.row;
    return usable_.empty() ||
           usable_[static_cast<std::size_t>(place.row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(place.column)] != 0;
  }

  [[nodiscard]] double per_dx() const noexcept { return per_dx_; }
  [[nodiscard]] double per_dy() const noexcept { return per_dy_; }

private:
  int columns_, rows_;
  GridFrame frame_;
  double per_dx_, per_dy_;
  std::vector<std::uint8_t> usable_;  // empty: all
};

/// Turns samples into the coefficients of the cubic B-spline through them, in place, mirrored at both ends.
inline void to_bspline_coefficients(double* samples, int count, std::ptrdiff_t stride) {
  const double pole = std::sqrt(3.0) - 2.0;
  const auto at = [&](int i) -> double& { return samples[i * stride]; };
  const int horizon = std::min(count, 30);  // pole^30 < 1e-17
  double first = at(0), power = pole;
  if (horizon < count) {
    for (int i = 1; i < horizon; ++i, power *= pole) first += power * at(i);
  } else {  // the mirrored signal repeats after 2 (count - 1)
    const double last_power = std::pow(pole, count - 1);
    double back = last_power * last_power / pole;
    first += last_power * at(count - 1);
    for (int i = 1; i < count - 1; ++i, power *= pole, back /= pole) first += (power + back) * at(i);
    first /= 1.0 - last_power * last_power;
  }
  at(0) = first;
  for (int i = 1; i < count; ++i) at(i) += pole * at(i - 1);
  at(count - 1) = pole / (pole * pole - 1.0) * (at(count - 1) + pole * at(count - 2));
  for (int i = count - 2; i >= 0; --i) at(i) = pole * (at(i + 1) - at(i));
  for (int i = 0; i < count; ++i) at(i) *= 6.0;
}

}  // namespace detail

/// Bilinear interpolation of a grid.
class BilinearMap {
public:
  explicit BilinearMap(FieldGrid grid) : cells_(grid, 0), grid_(std::move(grid)) {}

  [[nodiscard]] std::optional<FieldSample> at(double x, double y) const noexcept {
    detail::CellPlace p;
    if (!cells_.find(x, y, p)) return std::nullopt;
    const double f00 = grid_(p.column, p.row), f10 = grid_(p.column + 1, p.row);
    const double f01 = grid_(p.column, p.row + 1), f11 = grid_(p.column + 1, p.row + 1);
    const double low = f00 + p.u * (f10 - f00), high = f01 + p.u * (f11 - f01);
    const double slope = (1.0 - p.v) * (f10 - f00) + p.v * (f11 - f01);
    return FieldSample{low + p.v * (high - low), slope * cells_.per_dx(), (high - low) * cells_.per_dy()};
  }

  [[nodiscard]] const FieldGrid& grid() const noexcept { return grid_; }

private:
  detail::CellFinder cells_;
  FieldGrid grid_;
};

/// Bicubic B-spline through the nodes of a grid.
class BsplineMap {
public:
  /// Throws Error when every node is void.
  explicit BsplineMap(FieldGrid grid)
      : cells_(grid, 1), grid_(std::move(grid)), stride_(grid_.columns() + 2) {
    FieldGrid filled = without_voids(grid_);
    const int columns = filled.columns(), rows = filled.rows();
    for (int r = 0; r < rows; ++r) detail::to_bspline_coefficients(&filled(0, r), columns, 1);
    for (int c = 0; c < columns; ++c) detail::to_bspline_coefficients(&filled(c, 0), rows, columns);
    coefficients_.resize(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(rows + 2));
    const auto mirrored = [](int i, int count) { return i < 0 ? -i : i < count ? i : 2 * count - 2 - i; };
    for (int r = -1; r <= rows; ++r)
      for (int c = -1; c <= columns; ++c)
        coefficients_[static_cast<std::size_t>(r + 1) * static_cast<std::size_t>(stride_) +
                      static_cast<std::size_t>(c + 1)] = filled(mirrored(c, columns), mirrored(r, rows));
  }

  [[nodiscard]] std::optional<FieldSample> at(double x, double y) const noexcept {
    detail::CellPlace p;
    if (!cells_.find(x, y, p)) return std::nullopt;
    Four b, db, value{}, slope{};  // first down the rows, four columns at a time, then across
    weights(p.v, b, db);
    const double* row = coefficients_.data() + static_cast<std::ptrdiff_t>(p.row) * stride_ + p.column;
    for (int r = 0; r < 4; ++r, row += stride_) {
      Four c;
      std::memcpy(&c, row, sizeof c);
      value += b[r] * c;
      slope += db[r] * c;
    }
    weights(p.u, b, db);
    const Four f = b * value, fx = db * value, fy = b * slope;
    return FieldSample{(f[0] + f[2]) + (f[1] + f[3]), ((fx[0] + fx[2]) + (fx[1] + fx[3])) * cells_.per_dx(),
                       ((fy[0] + fy[2]) + (fy[1] + fy[3])) * cells_.per_dy()};
  }

  [[nodiscard]] const FieldGrid& grid() const noexcept { return grid_; }

private:
  using Four = detail::Lanes<double, 4>;

  /// The four cubic B-splines that are not zero at t in [0, 1], and their derivatives.
  static void weights(double t, Four& b, Four& db) noexcept {
    const double s = 1.0 - t, tt = t * t, ss = s * s;
    b[0] = ss * s / 6.0;
    b[1] = 2.0 / 3.0 - 0.5 * tt * (2.0 - t);
    b[2] = 2.0 / 3.0 - 0.5 * ss * (2.0 - s);
    b[3] = tt * t / 6.0;
    db[0] = -0.5 * ss;
    db[1] = t * (1.5 * t - 2.0);
    db[2] = -s * (1.5 * s - 2.0);
    db[3] = 0.5 * tt;
  }

  detail::CellFinder cells_;
  FieldGrid grid_;
  int stride_;
  std::vector<double> coefficients_;  // with one mirrored node around
};

}}  // namespace cairn::CAIRN_ABI
