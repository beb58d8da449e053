// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Building a balanced kd-tree: at each node take the coordinate of the largest spread and split at the
/// median by rank (Friedman, Bentley, Finkel, "An algorithm for finding best matches in logarithmic expected
/// time", ACM TOMS 3, 1977). Points that are equal in it go to either side, so a thousand equal points make
/// no deeper tree than a thousand different ones. O(n log n), by selection.
///
/// Points of few coordinates are moved whole, so that every pass runs through memory in order; of longer ones
/// only the coordinate of the split and the number are.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include <cairn/index/kd_layout.hpp>
#include <cairn/index/select_rank.hpp>

namespace cairn::inline CAIRN_ABI::detail {

/// Points with a coordinate <= value are on the left, those with one >= value on the right.
template <class Scalar>
struct Split {
  Scalar value;
  std::uint32_t axis;
};

/// The axis along which whole points of a range reach farthest; the first of equals.
template <class Record>
[[nodiscard]] std::size_t farthest_axis(const Record* begin, const Record* end) {
  auto low = begin->point;
  auto high = begin->point;
  if constexpr (sizeof(Record) == 16 && std::is_same_v<std::remove_cvref_t<decltype(low[0])>, float>) {
    using Four __attribute__((vector_size(16))) = float;  // the number rides along as a fourth coordinate
    Four lows;
    std::memcpy(&lows, begin, sizeof(lows));
    Four highs = lows;
    for (const Record* at = begin; at != end; ++at) {
      Four numbers;
      std::memcpy(&numbers, at, sizeof(numbers));
      lows = numbers < lows ? numbers : lows;
      highs = numbers > highs ? numbers : highs;
    }
    std::memcpy(low.data(), &lows, sizeof(low));
    std::memcpy(high.data(), &highs, sizeof(high));
  } else {
    for (const Record* at = begin; at != end; ++at)
      for (std::size_t a = 0; a < low.size(); ++a) {
        low[a] = at->point[a] < low[a] ? at->point[a] : low[a];
        high[a] = high[a] < at->point[a] ? at->point[a] : high[a];
      }
  }
  std::size_t widest = 0;
  for (std::size_t a = 1; a < low.size(); ++a)
    if (high[a] - low[a] > high[widest] - low[widest]) widest = a;
  return widest;
}

/// Orders points that are moved whole.
template <class Scalar, std::size_t Dim>
class WholePoints {
public:
  WholePoints(const std::vector<Scalar>& rows, std::size_t) : records_(rows.size() / Dim) {
    for (std::size_t i = 0; i < records_.size(); ++i) {
      std::memcpy(records_[i].point.data(), &rows[i * Dim], sizeof(records_[i].point));
      records_[i].number = static_cast<std::uint32_t>(i);
    }
  }

  /// Puts the lower points of [begin, end) before `middle` and the upper ones behind.
  Split<Scalar> split(std::size_t begin, std::size_t middle, std::size_t end) {
    Record* const first = records_.data();
    const std::size_t axis = farthest_axis(first + begin, first + end);
    select_rank(first + begin, first + middle, first + end,
                [axis](const Record& r) { return r.point[axis]; });
    return {first[middle].point[axis], static_cast<std::uint32_t>(axis)};
  }

  [[nodiscard]] std::uint32_t number(std::size_t rank) const noexcept { return records_[rank].number; }
  [[nodiscard]] const Scalar* point(std::size_t rank) const noexcept { return records_[rank].point.data(); }

private:
  struct Record {
    std::array<Scalar, Dim> point;
    std::uint32_t number;
  };
  std::vector<Record> records_;
};

/// Orders points by their numbers. The spread is the variance over a sample, since in many dimensions the
/// outermost points say little.
template <class Scalar>
class NumberedPoints {
public:
  NumberedPoints(const std::vector<Scalar>& rows, std::size_t dim)
      : rows_(rows), dim_(dim), records_(rows.size() / dim), sums_(dim), squares_(dim) {
    for (std::size_t i = 0; i < records_.size(); ++i) records_[i].number = static_cast<std::uint32_t>(i);
  }

  Split<Scalar> split(std::size_t begin, std::size_t middle, std::size_t end) {
    Record* const first = records_.data();
    const std::size_t axis = varying_axis(begin, end);
    for (std::size_t i = begin; i < end; ++i) first[i].key = point(i)[axis];
    select_rank(first + begin, first + middle, first + end, [](const Record& r) { return r.key; });
    return {first[middle].key, static_cast<std::uint32_t>(axis)};
  }

  [[nodiscard]] std::uint32_t number(std::size_t rank) const noexcept { return records_[rank].number; }
  [[nodiscard]] const Scalar* point(std::size_t rank) const noexcept {
    return rows_.data() + std::size_t{records_[rank].number} * dim_;
  }

private:
  using Real = RealOf<Scalar>;
  struct Record {
    Scalar key;
    std::uint32_t number;
  };

  std::size_t varying_axis(std::size_t begin, std::size_t end) {
    constexpr std::size_t sample = 256;
    const std::size_t step = (end - begin + sample - 1) / sample;
    const auto count = static_cast<Real>((end - begin + step - 1) / step);
    sums_.assign(dim_, 0);
    squares_.assign(dim_, 0);
    for (std::size_t i = begin; i < end; i += step)
      for (std::size_t a = 0; a < dim_; ++a) {
        const Real from_first = static_cast<Real>(point(i)[a]) - static_cast<Real>(point(begin)[a]);
        sums_[a] += from_first;
        squares_[a] += from_first * from_first;
      }
    std::size_t widest = 0;
    Real largest = 0;
    for (std::size_t a = 0; a < dim_; ++a) {
      const Real variance = squares_[a] - sums_[a] * sums_[a] / count;
      if (variance > largest) {
        largest = variance;
        widest = a;
      }
    }
    return widest;
  }

  const std::vector<Scalar>& rows_;
  std::size_t dim_;
  std::vector<Record> records_;
  std::vector<Real> sums_;
  std::vector<Real> squares_;
};

/// Most coordinates of a point that is moved whole and whose tree holds boxes.
inline constexpr std::size_t few_axes = 8;

template <class Scalar, std::size_t Dim>
using PointsToSplit = std::conditional_t<Dim != 0 && Dim <= few_axes, WholePoints<Scalar, Dim == 0 ? 1 : Dim>,
                                         NumberedPoints<Scalar>>;

/// Splits all points down to leaves; splits[] as KdLayout::split_at says.
template <class Points, class Scalar>
void split_all(Points& points, const KdLayout& layout, std::vector<Split<Scalar>>& splits, unsigned depth = 0,
               std::size_t slot = 0) {
  const Range leaves = layout.leaves_below(depth, slot);
  if (leaves.size() <= 1) return;
  const std::size_t middle = layout.leaves_below(depth + 1, 2 * slot).end;
  splits[KdLayout::split_at(depth, slot)] = points.split(
      layout.first_point(leaves.begin), layout.first_point(middle), layout.first_point(leaves.end));
  split_all(points, layout, splits, depth + 1, 2 * slot);
  split_all(points, layout, splits, depth + 1, 2 * slot + 1);
}

}  // namespace cairn::inline CAIRN_ABI::detail
