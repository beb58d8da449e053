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
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/parallel.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/kd_layout.hpp>
#include <cairn/index/detail/select_rank.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Points with a coordinate <= value are on the left, those with one >= value on the right.
template <class Scalar>
struct Split {
  Scalar value;
  std::uint32_t axis;
};

/// How far apart two coordinates are, low <= high; of whole numbers too, whose difference may not fit their
/// type.
template <class Scalar>
[[nodiscard]] constexpr auto reach(Scalar low, Scalar high) noexcept {
  if constexpr (std::is_integral_v<Scalar>) {
    using Whole = std::make_unsigned_t<Scalar>;
    return static_cast<std::uint64_t>(static_cast<Whole>(static_cast<Whole>(high) - static_cast<Whole>(low)));
  } else {
    return high - low;
  }
}

/// The axis along which whole points of a range reach farthest; the first of equals.
template <class Record>
[[nodiscard]] std::size_t farthest_axis(const Record* begin, const Record* end) {
  auto low = begin->point;
  auto high = begin->point;
  if constexpr (sizeof(Record) == 16 && std::is_same_v<std::remove_cvref_t<decltype(low[0])>, float>) {
    using Four = Lanes<float, 4>;  // the number rides along as a fourth coordinate
    Four lows = load<Four>(begin), highs = lows;
    for (const Record* at = begin; at != end; ++at) {
      const Four numbers = load<Four>(at);
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
    if (reach(low[a], high[a]) > reach(low[widest], high[widest])) widest = a;
  return widest;
}

/// Orders points that are moved whole.
template <class Scalar, std::size_t Dim>
class WholePoints {
public:
  struct Scratch {
    explicit Scratch(std::size_t) {}
  };

  explicit WholePoints(std::size_t) {}

  void reserve(std::size_t count) { records_.reserve(count); }
  void add(PointId id, const Scalar* row) {
    Record& record = records_.emplace_back();
    std::memcpy(record.point.data(), row, sizeof(record.point));
    record.id = id;
  }
  /// Takes all points at once; ids 0, 1, ... where none are given.
  void take(const std::vector<Scalar>& rows, std::span<const PointId> ids, unsigned threads) {
    records_.resize(rows.size() / Dim);
    parallel_for(records_.size(), threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        std::memcpy(records_[i].point.data(), &rows[i * Dim], sizeof(records_[i].point));
        records_[i].id = ids.empty() ? static_cast<PointId>(i) : ids[i];
      }
    });
  }
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }

  /// Puts the lower points of [begin, end) before `middle` and the upper ones behind.
  Split<Scalar> split(std::size_t begin, std::size_t middle, std::size_t end, Scratch&) {
    Record* const first = records_.data();
    const std::size_t axis = farthest_axis(first + begin, first + end);
    select_rank(first + begin, first + middle, first + end,
                [axis](const Record& r) { return r.point[axis]; });
    return {first[middle].point[axis], static_cast<std::uint32_t>(axis)};
  }

  [[nodiscard]] PointId id(std::size_t rank) const noexcept { return records_[rank].id; }
  [[nodiscard]] const Scalar* point(std::size_t rank) const noexcept { return records_[rank].point.data(); }

private:
  struct Record {
    std::array<Scalar, Dim> point;
    PointId id;
  };
  std::vector<Record> records_;
};

/// Orders points by their numbers. The spread is the variance over a sample, since in many dimensions the
/// outermost points say little.
template <class Scalar>
class NumberedPoints {
public:
  using Real = RealOf<Scalar>;
  struct Scratch {
    explicit Scratch(std::size_t dim) : sums(dim), squares(dim) {}
    std::vector<Real> sums;
    std::vector<Real> squares;
  };

  explicit NumberedPoints(std::size_t dim) : dim_(dim) {}

  void reserve(std::size_t count) {
    rows_.reserve(count * dim_);
    ids_.reserve(count);
    records_.reserve(count);
  }
  void add(PointId id, const Scalar* row) {
    records_.push_back({Scalar{}, static_cast<std::uint32_t>(records_.size())});
    rows_.insert(rows_.end(), row, row + dim_);
    ids_.push_back(id);
  }
  void take(std::vector<Scalar> rows, std::span<const PointId> ids, unsigned) {
    rows_ = std::move(rows);
    ids_.assign(ids.begin(), ids.end());
    records_.resize(rows_.size() / dim_);
    for (std::size_t i = 0; i < records_.size(); ++i) records_[i].number = static_cast<std::uint32_t>(i);
  }
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }

  Split<Scalar> split(std::size_t begin, std::size_t middle, std::size_t end, Scratch& scratch) {
    Record* const first = records_.data();
    const std::size_t axis = varying_axis(begin, end, scratch);
    for (std::size_t i = begin; i < end; ++i) first[i].key = point(i)[axis];
    select_rank(first + begin, first + middle, first + end, [](const Record& r) { return r.key; });
    return {first[middle].key, static_cast<std::uint32_t>(axis)};
  }

  [[nodiscard]] PointId id(std::size_t rank) const noexcept {
    return ids_.empty() ? records_[rank].number : ids_[records_[rank].number];
  }
  [[nodiscard]] const Scalar* point(std::size_t rank) const noexcept {
    return rows_.data() + std::size_t{records_[rank].number} * dim_;
  }

private:
  struct Record {
    Scalar key;
    std::uint32_t number;
  };

  [[nodiscard]] std::size_t varying_axis(std::size_t begin, std::size_t end, Scratch& scratch) const {
    constexpr std::size_t sample = 256;
    const std::size_t step = (end - begin + sample - 1) / sample;
    const auto count = static_cast<Real>((end - begin + step - 1) / step);
    scratch.sums.assign(dim_, 0);
    scratch.squares.assign(dim_, 0);
    for (std::size_t i = begin; i < end; i += step)
      for (std::size_t a = 0; a < dim_; ++a) {
        const Real from_first = static_cast<Real>(point(i)[a]) - static_cast<Real>(point(begin)[a]);
        scratch.sums[a] += from_first;
        scratch.squares[a] += from_first * from_first;
      }
    std::size_t widest = 0;
    Real largest = 0;
    for (std::size_t a = 0; a < dim_; ++a) {
      const Real variance = scratch.squares[a] - scratch.sums[a] * scratch.sums[a] / count;
      if (variance > largest) {
        largest = variance;
        widest = a;
      }
    }
    return widest;
  }

  std::size_t dim_;
  std::vector<Scalar> rows_;
  std::vector<PointId> ids_;
  std::vector<Record> records_;
};

/// Most coordinates of a point that is moved whole and whose tree holds boxes.
inline constexpr std::size_t few_axes = 8;

template <class Scalar, std::size_t Dim>
using PointsToSplit = std::conditional_t<Dim != 0 && Dim <= few_axes, WholePoints<Scalar, Dim == 0 ? 1 : Dim>,
                                         NumberedPoints<Scalar>>;

}}}  // namespace cairn::CAIRN_ABI::detail
