// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Between distances of bytes and a collector of points: who may be nearer than the collector's limit, by as
/// much as the bytes are off, is offered with the exact distance; where they are exact, with their own.
///
/// By how much they are off is bounded by the triangle's inequality, which roundings of many coordinates
/// never come near: theirs have all directions, and of e = |what rounding misses of query and point| a
/// distance sees about e / sqrt(dim). Who is below the limit by four of those is measured at once; who is
/// only possible is written down, and measured before an answer is called exact.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/block_lanes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Distances of bytes against those of points.
struct ByteAccuracy {
  std::size_t dimension;
  float unit;             ///< what a byte's step is worth
  float query_error;      ///< what rounding misses of the query at most, in bytes
  float point_error;      ///< and of any point
  float outside_squared;  ///< how far the query is from the box of bytes; 0 where points are outside too
};

/// A point that its bytes make possible, but not likely.
struct ByteDoubt {
  std::int32_t distance;  ///< of its bytes, squared
  PointId id;
};

/// exact(id) is the reduced distance of a point from the query, exact.prefetch(id) asks for what that takes.
template <class Exact, class C>
class ByteOffer {
public:
  /// `doubts` is empty, and used until settle().
  ByteOffer(const ByteAccuracy& accuracy, const Exact& exact, C& collector, std::vector<ByteDoubt>& doubts,
            std::vector<ByteDoubt>& asked)
      : exact_(exact),
        collector_(collector),
        doubts_(doubts),
        asked_(asked),
        unit_(accuracy.unit),
        slack_(accuracy.query_error + accuracy.point_error),
        likely_slack_(std::min(slack_, likely_slack(accuracy))),
        outside_squared_(0.999F * accuracy.outside_squared),
        in_bytes_((1.0001F + static_cast<float>(accuracy.dimension) * std::numeric_limits<float>::epsilon()) /
                  accuracy.unit) {
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

  /// As one(), but where the coordinates are needed they are asked for, and the point is offered by asked():
  /// they have come meanwhile.
  void ask(std::int32_t distance, PointId id) {
    if (slack_ == 0) return one(distance, id);
    if (distance >= below_ || id == no_point) return;
    exact_.prefetch(id);
    asked_.push_back({distance, id});
  }
  /// Offers those who were asked for, nearest by their bytes first: the limit is soon below the others.
  /// Returns whether there was anybody.
  bool asked() {
    if (asked_.empty()) return false;
    std::sort(asked_.begin(), asked_.end(),
              [](const ByteDoubt& a, const ByteDoubt& b) { return a.distance < b.distance; });
    for (const ByteDoubt& point : asked_) one(point.distance, point.id);
    asked_.clear();
    return true;
  }

  /// Points of so many blocks, `most_blocks` at most.
  void blocks(const std::int32_t* distances, const PointId* ids, std::size_t count) {
    unsigned masks[most_blocks];
    const std::int32_t below = below_;
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t b = 0; b < count; ++b) {
        Block<std::int32_t> numbers;
        load_block<std::int32_t>(distances + b * block_size, numbers);
        masks[b] = mask_below<std::int32_t>(numbers, below);
      }
    });
    const auto each = [&](const auto& visit) {
      for (std::size_t b = 0; b < count; ++b)
        for (unsigned mask = masks[b]; mask != 0; mask &= mask - 1) {
          const std::size_t place = b * block_size + static_cast<std::size_t>(std::countr_zero(mask));
          visit(distances[place], ids[place]);
        }
    };
    if (slack_ > 0)  // one() may measure them
      each([this](std::int32_t, PointId id) {
        if (id != no_point) exact_.prefetch(id);
      });
    each([this](std::int32_t distance, PointId id) { one(distance, id); });
  }
  static constexpr std::size_t most_blocks = 8;

  /// Measures whoever is still possible: then nobody who was offered is left out.
  void settle() {
    for (const ByteDoubt& doubt : doubts_)
      if (doubt.distance < below_) measure(doubt.id);
    doubts_.clear();
  }

private:
  /// Four times what the roundings of so many coordinates usually amount to.
  [[nodiscard]] static float likely_slack(const ByteAccuracy& accuracy) noexcept {
    return 4 * std::sqrt((accuracy.query_error * accuracy.query_error +
                          accuracy.point_error * accuracy.point_error) /
                         static_cast<float>(accuracy.dimension));
  }

  void point(std::int32_t bytes, PointId id) {
    if (slack_ == 0)
      offer(id, static_cast<float>(bytes) * unit_ * unit_);
    else
      inexact(bytes, id);
  }
  [[gnu::noinline]] void inexact(std::int32_t bytes, PointId id) {
    if (bytes < likely_below_)
      measure(id);
    else
      doubts_.push_back({bytes, id});
  }
  void measure(PointId id) {
    ++measured_;
    offer(id, exact_(id));
  }
  void offer(PointId id, float reduced) {
    if (!(reduced < static_cast<float>(collector_.limit()))) return;
    collector_.offer(id, reduced);
    tighten();
  }

  /// The collector's limit in the units of the bytes, and what rounding can hide.
  void tighten() {
    float inside = std::sqrt(static_cast<float>(collector_.limit())) * in_bytes_;
    if (outside_squared_ > 0) inside = std::sqrt(std::max(0.0F, inside * inside - outside_squared_));
    reach_ = inside + slack_;
    below_ = squared_up(reach_);
    if (slack_ > 0) likely_below_ = squared_up(inside + likely_slack_);
  }
  [[nodiscard]] static std::int32_t squared_up(float bytes) noexcept {
    const float square = bytes * bytes + 1;
    constexpr float most = 2147483520.0F;  // the largest float below 2^31
    return square < most ? static_cast<std::int32_t>(square) + 1 : std::numeric_limits<std::int32_t>::max();
  }

  const Exact& exact_;
  C& collector_;
  std::vector<ByteDoubt>& doubts_;
  std::vector<ByteDoubt>& asked_;
  float unit_;
  float slack_;            ///< how far the bytes of query and point together may be from them, in bytes
  float likely_slack_;     ///< and how far they are as a rule, at most
  float outside_squared_;  ///< what the query being outside of the box adds, squared, at least
  float in_bytes_;         ///< of a distance; covers the rounding of sums
  float reach_ = 0;
  std::int32_t below_ = 0;
  std::int32_t likely_below_ = 0;
  std::size_t measured_ = 0;
};

}}}  // namespace cairn::CAIRN_ABI::detail
