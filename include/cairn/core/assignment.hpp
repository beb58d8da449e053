// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Which sighting is of which landmark, where no two may be of the same: the assignment problem.
///
/// Rows are added one by one, each along the shortest augmenting path in reduced costs
///   c(r, c) - u(r) - v(c) >= 0,   with equality on the assigned pairs
/// (J. Edmonds, R. Karp, J. ACM 19, 1972; R. Jonker, A. Volgenant, Computing 38, 1987), by Dijkstra's search
/// over a dense matrix: O(rows^2 columns).
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// The search for one row's column after the other. Column `columns` is where the row that is being added
/// stands before it has one.
class ShortestAugmentation {
public:
  ShortestAugmentation(std::span<const double> costs, std::size_t rows, std::size_t columns)
      : costs_(costs), columns_(columns), u_(rows), v_(columns + 1), row_of_(columns + 1, none) {}

  /// Gives the row a column, moving others where that is cheaper. False where it cannot have one.
  bool add(std::size_t row) {
    length_.assign(columns_ + 1, std::numeric_limits<double>::infinity());
    before_.assign(columns_ + 1, columns_);
    done_.assign(columns_ + 1, false);
    row_of_[columns_] = row;
    std::size_t at = columns_;
    while (row_of_[at] != none) {
      done_[at] = true;
      const std::size_t next = relax(at);
      if (next == columns_) return false;
      shift(length_[next]);
      at = next;
    }
    for (; at != columns_; at = before_[at]) row_of_[at] = row_of_[before_[at]];
    return true;
  }

  [[nodiscard]] std::size_t row_of(std::size_t column) const { return row_of_[column]; }
  static constexpr std::size_t none = ~std::size_t{0};

private:
  /// Shortens the ways to the columns through the row at `at`; the nearest that is not done, if any is in
  /// reach.
  std::size_t relax(std::size_t at) {
    const std::size_t row = row_of_[at];
    std::size_t nearest = columns_;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < columns_; ++c) {
      if (done_[c]) continue;
      const double reduced = costs_[row * columns_ + c] - u_[row] - v_[c];
      if (reduced < length_[c]) {
        length_[c] = reduced;
        before_[c] = at;
      }
      if (length_[c] < least) {
        least = length_[c];
        nearest = c;
      }
    }
    return nearest;
  }

  /// Keeps the reduced costs at least zero, and zero on the way to the nearest.
  void shift(double by) {
    for (std::size_t c = 0; c <= columns_; ++c)
      if (done_[c]) {
        u_[row_of_[c]] += by;
        v_[c] -= by;
      } else {
        length_[c] -= by;
      }
  }

  std::span<const double> costs_;
  std::size_t columns_;
  std::vector<double> u_, v_, length_;
  std::vector<std::size_t> row_of_, before_;
  std::vector<bool> done_;
};

}  // namespace detail

/// A column for each row, no column twice, of the least sum of costs; nothing where that cannot be. Costs are
/// row by row; infinity forbids a pair. Throws Error for NaN, -infinity and a number of costs that is no
/// multiple of the rows. Which of several assignments of the same sum is not said, but always the same.
[[nodiscard]] inline std::optional<std::vector<std::size_t>> best_assignment(std::span<const double> costs,
                                                                             std::size_t rows) {
  if (rows == 0) return costs.empty() ? std::optional(std::vector<std::size_t>{}) : std::nullopt;
  if (costs.size() % rows != 0)
    raise("best_assignment: expected as many costs in each row, found " + std::to_string(costs.size()) +
          " in " + std::to_string(rows) + " rows");
  for (const double cost : costs)
    if (!(cost > -std::numeric_limits<double>::infinity()))
      raise("best_assignment: expected costs that are numbers or infinity, found another");
  const std::size_t columns = costs.size() / rows;
  detail::ShortestAugmentation search(costs, rows, columns);
  for (std::size_t r = 0; r < rows; ++r)
    if (!search.add(r)) return std::nullopt;
  std::vector<std::size_t> column_of(rows);
  for (std::size_t c = 0; c < columns; ++c)
    if (search.row_of(c) != search.none) column_of[search.row_of(c)] = c;
  return column_of;
}

}}  // namespace cairn::CAIRN_ABI
