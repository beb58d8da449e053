// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Between distances of bytes and a collector of points: who may be nearer than the collector's limit, by as
/// much as the bytes are off, is offered with the exact distance; where they are exact, with their own.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/block_lanes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Distances of bytes against those of points.
struct ByteAccuracy {
  std::size_t dimension;
  float unit;   ///< what a byte's step is worth
  float slack;  ///< how far the bytes of query and point together may be from them, in bytes
};

/// exact(id) is the reduced distance of a point from the query.
template <class Exact, class C>
class ByteOffer {
public:
  ByteOffer(const ByteAccuracy& accuracy, const Exact& exact, C& collector)
      : exact_(exact),
        collector_(collector),
        unit_(accuracy.unit),
        slack_(accuracy.slack),
        growth_(1.0001F + static_cast<float>(accuracy.dimension) * std::numeric_limits<float>::epsilon()) {
    tighten();
  }

  [[nodiscard]] std::size_t measured() const noexcept { return measured_; }

  /// Whether a point that is so far away, in bytes, may be below the limit.
  [[nodiscard]] bool may_hold_nearer(float bytes) const noexcept { return bytes < reach_; }

  /// In bytes: only who is nearer, squared, may be below the limit.
  [[nodiscard]] std::int32_t below() const noexcept { return below_; }
  [[nodiscard]] bool unlimited() const noexcept { return reach_ == std::numeric_limits<float>::infinity(); }

  void one(std::int32_t distance, PointId id) {
    if (distance < below_ && id != no_point) point(distance, id);
  }

  void block(const std::int32_t* distances, const PointId* ids) {
    unsigned mask = 0;
    const std::int32_t below = below_;
    with_widest_lanes([&]() CAIRN_INLINED {
      Block<std::int32_t> numbers;
      load_block<std::int32_t>(distances, numbers);
      mask = mask_below<std::int32_t>(numbers, below);
    });
    for (; mask != 0; mask &= mask - 1) {
      const auto lane = static_cast<unsigned>(std::countr_zero(mask));
      if (distances[lane] < below_ && ids[lane] != no_point) point(distances[lane], ids[lane]);
    }
  }

private:
  void point(std::int32_t bytes, PointId id) {
    float reduced = 0;
    if (slack_ == 0) {
      reduced = static_cast<float>(bytes) * unit_ * unit_;
    } else {
      ++measured_;
      reduced = exact_(id);
    }
    if (!(reduced < static_cast<float>(collector_.limit()))) return;
    collector_.offer(id, reduced);
    tighten();
  }

  /// The collector's limit in the units of the bytes, and what rounding can hide.
  void tighten() {
    const float distance = std::sqrt(static_cast<float>(collector_.limit())) / unit_;
    reach_ = distance * growth_ + slack_;
    const float square = reach_ * reach_ + 1;
    constexpr float most = 2147483520.0F;  // the largest float below 2^31
    below_ = square < most ? static_cast<std::int32_t>(square) + 1 : std::numeric_limits<std::int32_t>::max();
  }

  const Exact& exact_;
  C& collector_;
  float unit_;
  float slack_;
  float growth_;  ///< covers the rounding of sums
  float reach_ = 0;
  std::int32_t below_ = 0;
  std::size_t measured_ = 0;
};

}}}  // namespace cairn::CAIRN_ABI::detail
