// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The exact two nearest of a whole set of queries, without a tree: what matching one picture against another
/// or against a small map needs.
///
/// ```cpp
/// const cairn::PackedPoints map(descriptors);  // any PointSet
/// for (const auto& two : cairn::nearest_two(map, queries)) look_at(two);
/// for (const auto& match : cairn::match(map, queries, {.ratio = 1.25F}))  // or 0.8F: the same
///   look_at(match);
/// ```
///
/// |q - p|^2 = |q|^2 + |p|^2 - 2 q.p is computed for tiles of queries and sixteen points at a time, from
/// points that stay in the cache; that takes half the operations of differences, but cancels. So it only
/// decides, with a margin for its rounding error (Higham, "Accuracy and stability of numerical algorithms",
/// 2nd ed., (3.5)), whose distance is computed from differences, as a kd-tree does it. The answers are those
/// of BruteForce, the same for any number of threads. O(n) a query, with a small constant: docs/index.md says
/// where trees begin to win. Far from the origin, where |p| is a thousand times the distances, the margin
/// lets everything through and the speed is that of differences. Points are kept as floats: doubles are
/// rounded (KdTree keeps them).
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/parallel.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/core/sizes.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/metric.hpp>
#include <cairn/index/points.hpp>
#include <cairn/index/ratio_test.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Points of float coordinates packed for bulk matching under L2. Const methods may run at the same time.
class PackedPoints {
public:
  PackedPoints() = default;

  /// Copies the points, ids 0 ... n - 1. Throws Error, naming the point, for a coordinate that is not finite.
  template <class Points>
    requires(PointSet<Points> || detail::explain_points<Points>)
  explicit PackedPoints(const Points& points)
      : dim_(detail::dimension_of<dynamic_dim>(points)), count_(static_cast<std::size_t>(points.size())) {
    const auto rows = detail::copy_points<float>(points, dim_, "PackedPoints: point");
    const std::size_t blocks = count_ / detail::block_size + (count_ % detail::block_size != 0);
    coordinates_.resize(detail::room_for(blocks * detail::block_size, dim_, "PackedPoints"));
    squares_.resize(blocks * detail::block_size);
    for (std::size_t i = 0; i < blocks * detail::block_size; ++i) pack(rows, i);
  }

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return (coordinates_.capacity() + squares_.capacity()) * sizeof(float);
  }

  /// For the kernels: sixteen points coordinate by coordinate, their squared lengths, and the largest of all.
  [[nodiscard]] std::size_t blocks() const noexcept { return squares_.size() / detail::block_size; }
  [[nodiscard]] const float* block(std::size_t i) const noexcept {
    return coordinates_.data() + i * detail::block_size * dim_;
  }
  [[nodiscard]] const float* squares(std::size_t i) const noexcept {
    return squares_.data() + i * detail::block_size;
  }
  [[nodiscard]] float largest_square() const noexcept { return largest_square_; }

private:
  /// The last block repeats the last point, under numbers that are no points.
  void pack(const std::vector<float>& rows, std::size_t place) {
    const float* row = rows.data() + std::min(place, count_ - 1) * dim_;
    const std::size_t lane = place % detail::block_size;
    float* to = coordinates_.data() + (place - lane) * dim_ + lane;
    float square = 0;
    for (std::size_t a = 0; a < dim_; ++a) {
      to[a * detail::block_size] = row[a];
      square += row[a] * row[a];
    }
    squares_[place] = square;
    largest_square_ = std::max(largest_square_, square);
  }

  std::size_t dim_ = 0;
  ResetOnMove<std::size_t> count_;
  float largest_square_ = 0;
  detail::AlignedVector<float> coordinates_;
  detail::AlignedVector<float> squares_;
};

/// The nearest two points of one query, true distances; no_point and infinity where there are fewer.
struct TwoNearest {
  PointId id = no_point;
  PointId second_id = no_point;
  float first = std::numeric_limits<float>::infinity();
  float second = std::numeric_limits<float>::infinity();
  bool operator==(const TwoNearest&) const = default;
};

/// A query that passed the ratio test, and its point.
struct Match {
  std::size_t query = 0;
  PointId id = no_point;
  float distance = 0;
  bool operator==(const Match&) const = default;
};

namespace detail {

/// One query being answered.
struct BulkQuery {
  const float* row = nullptr;
  float square = 0;
  float margin = 0;  ///< twice what rounding can move |p|^2 - 2 q.p
  NearestTwo<float> two{};

  /// Points whose |p|^2 - 2 q.p is not below this are surely not nearer than the second.
  [[nodiscard]] float threshold() const noexcept { return two.limit() - square + margin; }
};

/// Distances from differences of the points of a block, and the bookkeeping.
[[gnu::always_inline]] inline void offer_block(const PackedPoints& points, std::size_t block,
                                               BulkQuery& query) {
  Block<float> sums{};
  const float* numbers = points.block(block);
  for (std::size_t a = 0; a < points.dimension(); ++a) {
    Block<float> difference;
    load_block<float>(numbers + a * block_size, difference);
    difference = query.row[a] - difference;
    L2::accumulate(sums, difference, a);
  }
  for (unsigned mask = mask_below<float>(sums, query.two.limit()); mask != 0; mask &= mask - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(mask));
    if (block * block_size + lane < points.size())
      query.two.offer(static_cast<PointId>(block * block_size + lane), sums[lane]);
  }
}

/// A tile of queries against a block of points: the products in registers. `packed` holds the coordinates of
/// the tile's queries side by side.
template <std::size_t... Q>
[[gnu::always_inline]] inline void match_tile(const PackedPoints& points, std::size_t block,
                                              const float* packed, std::span<BulkQuery> queries,
                                              std::index_sequence<Q...>) {
  const std::size_t dim = points.dimension();
  const float* numbers = points.block(block);
  Block<float> products[sizeof...(Q)] = {};
  for (std::size_t a = 0; a < dim; ++a) {
    Block<float> coordinate;
    load_block<float>(numbers + a * block_size, coordinate);
    ((products[Q] = products[Q] + packed[a * sizeof...(Q) + Q] * coordinate), ...);
  }
  Block<float> squares;
  load_block<float>(points.squares(block), squares);
  unsigned near = 0;  // bit q: some point may be nearer than the second of query q
  const auto finish = [&](std::size_t q, const Block<float>& product) CAIRN_INLINED {
    if (q >= queries.size()) return;
    const Block<float> estimate = squares - 2.0F * product;
    near |= static_cast<unsigned>(mask_below<float>(estimate, queries[q].threshold()) != 0) << q;
  };
  (finish(Q, products[Q]), ...);
  for (; near != 0; near &= near - 1)
    offer_block(points, block, queries[static_cast<std::size_t>(std::countr_zero(near))]);
}

/// All points for a group of queries: panels of points that fit the second-level cache, tiles of queries.
/// `packed` has room for the group's coordinates, filled up to whole tiles.
template <std::size_t Tile>
[[gnu::always_inline]] inline void match_group(const PackedPoints& points, std::span<BulkQuery> queries,
                                               float* packed) {
  constexpr std::size_t panel_bytes = 256 * 1024;
  const std::size_t dim = points.dimension();
  const std::size_t panel = std::max<std::size_t>(1, panel_bytes / (block_size * sizeof(float)) / dim);
  for (std::size_t q = 0; q < (queries.size() + Tile - 1) / Tile * Tile; ++q)
    for (std::size_t a = 0; a < dim; ++a)
      packed[q / Tile * Tile * dim + a * Tile + q % Tile] = queries[std::min(q, queries.size() - 1)].row[a];
  for (std::size_t begin = 0; begin < points.blocks(); begin += panel) {
    const std::size_t end = std::min(points.blocks(), begin + panel);
    for (std::size_t q = 0; q < queries.size(); q += Tile)
      for (std::size_t block = begin; block < end; ++block)
        match_tile(points, block, packed + q * dim, queries.subspan(q, std::min(Tile, queries.size() - q)),
                   std::make_index_sequence<Tile>());
  }
}

inline constexpr std::size_t bulk_group = 192;  ///< queries that share a pass over the points; whole tiles

/// With the tile that fits the registers of the processor.
inline void match_group(const PackedPoints& points, std::span<BulkQuery> queries, float* packed) {
#if defined(__x86_64__)
  if (processor() >= Processor::avx512) {
    auto body = [&]() CAIRN_INLINED { match_group<12>(points, queries, packed); };
    return with_avx512(body);
  }
#endif
  with_widest_lanes([&]() CAIRN_INLINED { match_group<4>(points, queries, packed); });
}

/// Rows of queries, and what was found for each.
struct BulkAnswers {
  std::vector<float> rows;
  std::vector<BulkQuery> queries;
};

template <PointSet Queries>
[[nodiscard]] BulkAnswers open_queries(const PackedPoints& points, const Queries& queries) {
  const std::size_t dim = points.dimension();
  BulkAnswers answers{copy_points<float>(queries, dim, "nearest_two: query"), {}};
  answers.queries.resize(static_cast<std::size_t>(queries.size()));
  for (std::size_t i = 0; i < answers.queries.size(); ++i) {
    BulkQuery& query = answers.queries[i];
    query.row = answers.rows.data() + i * dim;
    for (std::size_t a = 0; a < dim; ++a) query.square += query.row[a] * query.row[a];
    // Each sum is off by at most dim + 1 roundings of its size, and |2 q.p| <= |q|^2 + |p|^2; below the least
    // normal number roundings are of a size of their own.
    query.margin = 4 * static_cast<float>(dim + 4) * std::numeric_limits<float>::epsilon() *
                   (query.square + points.largest_square() + std::numeric_limits<float>::min());
  }
  return answers;
}

template <PointSet Queries>
[[nodiscard]] BulkAnswers answer_all(const PackedPoints& points, const Queries& queries, unsigned threads) {
  BulkAnswers answers = open_queries(points, queries);
  const std::size_t count = answers.queries.size();
  parallel_for((count + bulk_group - 1) / bulk_group, threads, [&](std::size_t begin, std::size_t end) {
    std::vector<float> packed(room_for(bulk_group, points.dimension(), "nearest_two"));
    for (std::size_t first = begin * bulk_group; first < std::min(count, end * bulk_group);
         first += bulk_group)
      match_group(points, std::span(answers.queries).subspan(first, std::min(bulk_group, count - first)),
                  packed.data());
  });
  return answers;
}

}  // namespace detail

/// The two nearest points of each query, as KdTree and BruteForce find them; of equally near ones the lower
/// ids. Queries are shared among `threads`. Throws Error where a query is not finite or of
/// another dimension.
template <PointSet Queries>
[[nodiscard]] std::vector<TwoNearest> nearest_two(const PackedPoints& points, const Queries& queries,
                                                  unsigned threads = 1) {
  std::vector<TwoNearest> found(static_cast<std::size_t>(queries.size()));
  if (points.empty()) return found;
  const auto answers = detail::answer_all(points, queries, threads);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto& two = answers.queries[i].two;
    found[i] = {two.id(), two.second_id(), two.first(), two.second()};
  }
  return found;
}

/// The queries that pass the ratio test, in their order, each with its nearest point. As nearest_two().
template <PointSet Queries>
[[nodiscard]] std::vector<Match> match(const PackedPoints& points, const Queries& queries,
                                       const RatioTest& test = {}, unsigned threads = 1) {
  detail::check_ratio_test(test);
  std::vector<Match> matches;
  if (points.empty()) return matches;
  const auto answers = detail::answer_all(points, queries, threads);
  for (std::size_t i = 0; i < answers.queries.size(); ++i) {
    const auto& two = answers.queries[i].two;
    RatioTestMatch<float> verdict(test, L2{});
    verdict.offer(two.id(), two.first_reduced());
    if (two.second_id() != no_point) verdict.offer(two.second_id(), two.second_reduced());
    if (verdict.accepted()) matches.push_back({i, two.id(), two.first()});
  }
  return matches;
}

}}  // namespace cairn::CAIRN_ABI
