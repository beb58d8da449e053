// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Every cell that a segment meets, in order, with the length of the segment inside.
///
/// (J. Amanatides, A. Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987.) Crossings
/// are computed from the end points, not summed up, so that the last cell is the end's own and the lengths
/// add up to the segment's however long it is.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>

#include <cairn/core/check.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// One axis of the walk: the cell, the direction, and at which share of the segment the next border is.
class RayAxis {
public:
  RayAxis(double from, double to)
      : from_(from),
        inverse_(1 / (to - from)),
        cell_(static_cast<std::int32_t>(std::floor(from))),
        last_(static_cast<std::int32_t>(std::floor(to))),
        step_(last_ < cell_ ? -1 : 1),
        border_(last_ < cell_ ? 0 : 1) {
    aim();
  }

  [[nodiscard]] std::int32_t cell() const noexcept { return cell_; }
  [[nodiscard]] double next() const noexcept { return next_; }
  [[nodiscard]] std::int64_t steps() const noexcept { return std::abs(std::int64_t{last_} - cell_); }
  void advance() noexcept {
    cell_ += step_;
    aim();
  }

private:
  void aim() noexcept {
    next_ = cell_ == last_ ? std::numeric_limits<double>::infinity()
                           : std::min(1.0, (cell_ + border_ - from_) * inverse_);
  }

  double from_, inverse_;
  std::int32_t cell_, last_, step_, border_;
  double next_ = 0;
};

}  // namespace detail

namespace detail {

inline void check_ray(double x0, double y0, double x1, double y1) {
  const auto has_cell = [](double x) { return std::abs(x) < static_cast<double>(farthest_cell); };
  CAIRN_EXPECTS(has_cell(x0) && has_cell(y0) && has_cell(x1) && has_cell(y1),
                "a ray needs finite end points less than 2^28 cells from the origin");
}

}  // namespace detail

/// Calls visit(cell, length) for the cells from (x0, y0) to (x1, y1), all in cells, where each shares an edge
/// with the one before; through a corner the step along x comes first, and the cell between has length 0. The
/// end points must be finite and less than 2^28 cells from the origin.
template <class Visit>
void walk_ray(double x0, double y0, double x1, double y1, Visit&& visit) {
  detail::check_ray(x0, y0, x1, y1);
  const double length = std::hypot(x1 - x0, y1 - y0);
  detail::RayAxis x(x0, x1), y(y0, y1);
  double share = 0;
  for (;;) {
    const double until = std::min({x.next(), y.next(), 1.0});
    visit(CellAddress{x.cell(), y.cell()}, std::max(0.0, until - share) * length);
    share = std::max(share, until);
    if (std::isinf(x.next()) && std::isinf(y.next())) return;
    if (x.next() <= y.next())
      x.advance();
    else
      y.advance();
  }
}

/// Calls visit(cell) for the same cells in the same order: without lengths, in half the time.
template <class Visit>
void walk_cells(double x0, double y0, double x1, double y1, Visit&& visit) {
  detail::check_ray(x0, y0, x1, y1);
  detail::RayAxis x(x0, x1), y(y0, y1);
  visit(CellAddress{x.cell(), y.cell()});
  for (std::int64_t left = x.steps() + y.steps(); left > 0; --left) {
    if (x.next() <= y.next())
      x.advance();
    else
      y.advance();
    visit(CellAddress{x.cell(), y.cell()});
  }
}

namespace detail {

/// The cells of walk_cells as runs along one axis, a run for each step across it. `passes(next, border)` says
/// whether the border at the share `next` of the segment is crossed before the one across, at `border`.
template <class Passes, class Visit>
void walk_runs(double along0, double across0, double along1, double across1, const Passes& passes,
               Visit&& visit) {
  const auto cell_of = [](double x) { return static_cast<std::int32_t>(std::floor(x)); };
  const auto border_at = [](std::int32_t cell, std::int32_t border, double from, double inverse) {
    return std::min(1.0, (cell + border - from) * inverse);
  };
  const double inverse = 1 / (along1 - along0), inverse_across = 1 / (across1 - across0);
  std::int32_t from = cell_of(along0), across = cell_of(across0);
  const std::int32_t last = cell_of(along1), last_across = cell_of(across1);
  const std::int32_t step = last < from ? -1 : 1, border = last < from ? 0 : 1;
  const std::int32_t step_across = last_across < across ? -1 : 1,
                     border_across = last_across < across ? 0 : 1;
  const std::int32_t low = std::min(from, last), high = std::max(from, last);
  const double slope = (along1 - along0) * inverse_across;
  const bool finite = std::isfinite(slope);       // not where a ray is level but for less than 1e-300 cells
  double way = across + border_across - across0;  // across, to the next border: exact, step by step
  for (; across != last_across; across += step_across, way += step_across) {
    const auto until = [&] { return border_at(across, border_across, across0, inverse_across); };
    const double place = along0 + (finite ? way * slope : until() * (along1 - along0));
    auto to = static_cast<std::int32_t>(place);
    to -= static_cast<std::int32_t>(place < to);
    // Rounding decides as it does cell by cell, where it decides at all.
    constexpr double unsure = 1e-5;  // cells; 2^28 of them leave 3e-7
    if (std::abs(place - to - 0.5) > 0.5 - unsure) [[unlikely]] {
      const auto crossed = [&, at = until()](std::int32_t cell) {
        return passes(border_at(cell, border, along0, inverse), at);
      };
      to = std::clamp(to, low, high);
      if ((to - from) * step < 0) to = from;
      while (to != last && crossed(to)) to += step;
      while (to != from && !crossed(to - step)) to -= step;
    }
    visit(across, std::min(from, to), std::max(from, to));
    from = to;
  }
  visit(across, std::min(from, last), std::max(from, last));
}

}  // namespace detail

/// The cells of walk_cells, row by row: visit(row, first column, last column). A visit for each row instead
/// of one for each cell: for segments that are rather level.
template <class Visit>
void walk_rows(double x0, double y0, double x1, double y1, Visit&& visit) {
  detail::check_ray(x0, y0, x1, y1);
  detail::walk_runs(x0, y0, x1, y1, [](double next, double border) { return next <= border; }, visit);
}

/// The same, column by column: visit(column, first row, last row), for segments that are rather upright.
template <class Visit>
void walk_columns(double x0, double y0, double x1, double y1, Visit&& visit) {
  detail::check_ray(x0, y0, x1, y1);
  detail::walk_runs(y0, x0, y1, x1, [](double next, double border) { return next < border; }, visit);
}

}}  // namespace cairn::CAIRN_ABI
