// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The points of a tree in the order of its leaves: sixteen to a block, coordinate by coordinate, their
/// numbers beside them. A block that is not full repeats its last point under the number no_point.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <cairn/core/sizes.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/kd_layout.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// `count` numbers on the stack where they are few, else on the heap.
template <class Real>
class Scratch {
public:
  explicit Scratch(std::size_t count) {
    if (count > near_.size()) far_ = std::make_unique<Real[]>(count);
  }
  [[nodiscard]] Real* data() noexcept { return far_ ? far_.get() : near_.data(); }

private:
  std::array<Real, 160> near_;
  std::unique_ptr<Real[]> far_;
};

template <class Scalar>
class LeafBlocks {
public:
  using Real = RealOf<Scalar>;

  LeafBlocks() = default;

  /// Room for the leaves of a layout, not yet written.
  LeafBlocks(std::size_t dim, const KdLayout& layout)
      : dim_(dim),
        coordinates_(room_for(layout.leaves() * block_size, dim, "KdTree")),
        ids_(layout.leaves() * block_size) {}

  /// Writes some leaves from the ordered points: points.point(rank) and points.id(rank).
  template <class Points>
  void fill(const Points& points, const KdLayout& layout, const Range& leaves) {
    for (std::size_t leaf = leaves.begin; leaf < leaves.end; ++leaf) {
      const std::size_t first = layout.first_point(leaf);
      const std::size_t count = layout.first_point(leaf + 1) - first;
      Scalar* block = coordinates_.data() + leaf * block_size * dim_;
      for (std::size_t lane = 0; lane < block_size; ++lane) {
        const std::size_t rank = first + (lane < count ? lane : count - 1);
        const Scalar* point = points.point(rank);
        for (std::size_t a = 0; a < dim_; ++a) block[a * block_size + lane] = point[a];
        ids_[leaf * block_size + lane] = lane < count ? points.id(rank) : no_point;
      }
    }
  }

  [[nodiscard]] const Scalar* block(std::size_t leaf) const noexcept {
    return coordinates_.data() + leaf * block_size * dim_;
  }
  [[nodiscard]] const PointId* ids(std::size_t leaf) const noexcept {
    return ids_.data() + leaf * block_size;
  }
  [[nodiscard]] std::size_t leaves() const noexcept { return ids_.size() / block_size; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return coordinates_.capacity() * sizeof(Scalar) + ids_.capacity() * sizeof(PointId);
  }

  /// Asks for what the scan of a leaf reads before its first look, and for the ids. Measured: asking for more
  /// holds up the requests of the next leaf.
  [[gnu::always_inline]] void prefetch(std::size_t leaf, std::size_t dim) const noexcept {
    const auto* bytes = reinterpret_cast<const char*>(coordinates_.data() + leaf * block_size * dim);
    const std::size_t lines = axes_to_look(dim) * block_size * sizeof(Scalar) / 64;
    for (std::size_t line = 0; line < lines; ++line) __builtin_prefetch(bytes + 64 * line);
    __builtin_prefetch(ids(leaf));
  }

  /// Offers every point of a leaf that is nearer than the collector's limit.
  template <class M, class C>
  [[gnu::always_inline]] void scan(std::size_t leaf, const Real* query, std::size_t dim, const M& metric,
                                   C& collector) const {
    Block<Real> sums{};
    const Scalar* numbers = coordinates_.data() + leaf * block_size * dim;
    for (std::size_t done = 0; done < dim;) {
      const std::size_t next = done + axes_to_look(dim - done);
      for (std::size_t a = done; a < next; ++a) {
        Block<Real> difference;
        load_block<Real>(numbers + a * block_size, difference);
        difference = query[a] - difference;
        accumulate_block<Real>(metric, sums, difference, a);
      }
      done = next;
      if (done < dim && mask_below<Real>(sums, static_cast<Real>(collector.limit())) == 0) return;
    }
    offer(sums, ids(leaf), collector);
  }

  /// Calls visit(id, row) for every point of some leaves; row is a span of dim numbers, valid during the
  /// call.
  template <class Visit>
  void for_each(const Range& leaves, Visit&& visit) const {
    std::vector<Scalar> row(dim_);
    for (std::size_t leaf = leaves.begin; leaf < leaves.end; ++leaf)
      for (std::size_t lane = 0; lane < block_size; ++lane) {
        if (ids(leaf)[lane] == no_point) continue;
        for (std::size_t a = 0; a < dim_; ++a) row[a] = block(leaf)[a * block_size + lane];
        visit(ids(leaf)[lane], std::span<const Scalar>(row));
      }
  }

private:
  /// Offers the points of a leaf that are nearer than the collector's limit; `sums` are their distances.
  template <class C>
  [[gnu::always_inline]] static void offer(Block<Real>& sums, const PointId* ids, C& collector) {
    // Of eight-byte numbers sixteen are too many for one vector: gcc 12 takes their comparisons apart.
    if constexpr (keeps_one<C> && sizeof(Real) == 4) {
      if constexpr (sifts<C>)
        if (collector.sifting())
          keep_lanes(sums, collector.live(mask_below<Real>(sums, static_cast<Real>(collector.limit())), ids));
      // Lanes that repeat the last point come after it, so the first of the nearest is a point.
      const Real nearest = smallest<Real>(sums);
      if (!(nearest < static_cast<Real>(collector.limit()))) return;
      const Block<std::int32_t> equal = sums == nearest;
      const auto lane = static_cast<std::size_t>(std::countr_zero(mask_of(equal)));
      taker_of(collector).offer(ids[lane], nearest);
    } else {
      unsigned mask = mask_below<Real>(sums, static_cast<Real>(collector.limit()));
      if constexpr (sifts<C>)
        if (collector.sifting()) mask = collector.live(mask, ids);
      for (; mask != 0; mask &= mask - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(mask));
        if (ids[lane] != no_point) taker_of(collector).offer(ids[lane], sums[lane]);
      }
    }
  }

  /// The collector that takes what another lets through.
  template <class C>
  [[gnu::always_inline]] static auto& taker_of(C& collector) noexcept {
    if constexpr (sifts<C>)
      return *collector.collector;
    else
      return collector;
  }

  static constexpr std::size_t stride = 16;  ///< axes between looks at whether all sixteen sums are too large

  /// Axes that are summed up before the next look, of those left.
  [[nodiscard]] static constexpr std::size_t axes_to_look(std::size_t left) noexcept {
    return left < 2 * stride ? left : stride;
  }

  std::size_t dim_ = 0;
  AlignedVector<Scalar> coordinates_;
  AlignedVector<PointId> ids_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
