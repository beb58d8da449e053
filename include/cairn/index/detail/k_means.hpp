// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Points of bytes in cells around means: the halves of a kd-tree, then a few rounds of Lloyd's algorithm
/// ("Least squares quantization in PCM", IEEE Trans. Information Theory 28, 1982).
///
/// A point only moves to one of the cells whose means are nearest to its own cell's mean, so a round costs
/// O(n + cells^2) and not O(n cells). The same cells for any number of threads.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/parallel.hpp>
#include <cairn/index/detail/byte_blocks.hpp>
#include <cairn/index/detail/byte_kernels.hpp>
#include <cairn/index/detail/kd_split.hpp>
#include <cairn/index/detail/smallest_first.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Cell c holds the points order[first[c]] ... order[first[c + 1] - 1] and has the mean means[c * dim ...].
/// None is empty.
struct KMeans {
  std::vector<std::uint32_t> order;
  std::vector<std::size_t> first;
  std::vector<std::uint8_t> means;
  [[nodiscard]] std::size_t size() const noexcept { return first.size() - 1; }
};

class KMeansBuilder {
public:
  /// Rows of `dim` bytes, at least one; they must outlive this.
  KMeansBuilder(const std::vector<std::uint8_t>& rows, std::size_t dim, unsigned threads)
      : rows_(rows), dim_(dim), threads_(threads) {}

  /// About 2^depth cells after some rounds.
  [[nodiscard]] KMeans build(unsigned depth, unsigned rounds) {
    halve(depth);
    find_means();
    for (unsigned round = 0; round < rounds; ++round) {
      regroup(nearest_cells());
      find_means();
    }
    return std::move(cells_);
  }

private:
  static constexpr std::size_t neighbours = 64;  ///< cells that a point may move to, its own among them

  [[nodiscard]] std::size_t count() const noexcept { return rows_.size() / dim_; }
  [[nodiscard]] const std::uint8_t* row(std::size_t point) const noexcept {
    return rows_.data() + point * dim_;
  }

  /// Splits at the median of the most varying coordinate, `depth` times.
  void halve(unsigned depth) {
    NumberedPoints<std::uint8_t> points(dim_);
    points.take(rows_, {}, threads_);
    std::vector<std::size_t> first{0, count()};
    for (unsigned level = 0; level < depth; ++level) {
      std::vector<std::size_t> halves(2 * first.size() - 1);
      parallel_for(first.size() - 1, threads_, [&](std::size_t begin, std::size_t end) {
        NumberedPoints<std::uint8_t>::Scratch scratch(dim_);
        for (std::size_t cell = begin; cell < end; ++cell) {
          const std::size_t middle = first[cell] + (first[cell + 1] - first[cell]) / 2;
          points.split(first[cell], middle, first[cell + 1], scratch);
          halves[2 * cell] = first[cell];
          halves[2 * cell + 1] = middle;
        }
      });
      halves.back() = count();
      first = std::move(halves);
    }
    cells_.first = std::move(first);
    cells_.order.resize(count());
    for (std::size_t rank = 0; rank < count(); ++rank) cells_.order[rank] = points.id(rank);
  }

  void find_means() {
    cells_.means.resize(cells_.size() * dim_);
    parallel_for(cells_.size(), threads_, [&](std::size_t begin, std::size_t end) {
      std::vector<std::uint64_t> sums(dim_);
      for (std::size_t cell = begin; cell < end; ++cell) {
        std::fill(sums.begin(), sums.end(), 0U);
        for (const std::uint32_t point : members(cell))
          for (std::size_t a = 0; a < dim_; ++a) sums[a] += row(point)[a];
        const std::uint64_t size = members(cell).size();
        for (std::size_t a = 0; a < dim_; ++a)
          cells_.means[cell * dim_ + a] = static_cast<std::uint8_t>((sums[a] + size / 2) / size);
      }
    });
  }

  [[nodiscard]] std::span<const std::uint32_t> members(std::size_t cell) const noexcept {
    return std::span(cells_.order).subspan(cells_.first[cell], cells_.first[cell + 1] - cells_.first[cell]);
  }

  /// For each point the cell whose mean is nearest, of those near its own; of equals its own.
  [[nodiscard]] std::vector<std::uint32_t> nearest_cells() const {
    const auto mean_of = [this](std::size_t cell) { return &cells_.means[cell * dim_]; };
    const ByteBlocks means = ByteBlocks::of_rows(dim_, cells_.size(), mean_of);
    std::vector<std::uint32_t> result(count());
    parallel_for(cells_.size(), threads_, [&](std::size_t begin, std::size_t end) {
      ByteQuery query;
      SmallestFirst nearest;
      for (std::size_t cell = begin; cell < end; ++cell) {
        query.set(&cells_.means[cell * dim_], dim_);
        nearest.resize(cells_.size());
        means.distances(0, means.blocks(), query, nearest.keys());
        nearest.keys()[cell] = -1;  // the cell itself comes first
        nearest.reset();
        assign(cell, nearest, result);
      }
    });
    return result;
  }

  void assign(std::size_t cell, SmallestFirst& nearest, std::vector<std::uint32_t>& result) const {
    const std::size_t candidates = std::min(neighbours, cells_.size());
    std::uint32_t number[neighbours];
    for (std::size_t i = 0; i < candidates; ++i) number[i] = static_cast<std::uint32_t>(nearest.next().place);
    const auto mean_of = [&](std::size_t i) { return &cells_.means[number[i] * dim_]; };
    const ByteBlocks means = ByteBlocks::of_rows(dim_, candidates, mean_of);
    ByteQuery query;
    std::int32_t distances[neighbours];
    for (const std::uint32_t point : members(cell)) {
      query.set(row(point), dim_);
      means.distances(0, means.blocks(), query, distances);
      result[point] = number[std::min_element(distances, distances + candidates) - distances];
    }
  }

  /// Puts the points in the order of their new cells; drops cells without points.
  void regroup(const std::vector<std::uint32_t>& cell_of) {
    std::vector<std::size_t> first(cells_.size() + 1, 0);
    for (const std::uint32_t cell : cell_of) ++first[cell + 1];
    for (std::size_t cell = 0; cell < cells_.size(); ++cell) first[cell + 1] += first[cell];
    std::vector<std::size_t> next(first.begin(), first.end() - 1);
    for (std::size_t point = 0; point < cell_of.size(); ++point)
      cells_.order[next[cell_of[point]]++] = static_cast<std::uint32_t>(point);
    first.erase(std::unique(first.begin(), first.end()), first.end());
    cells_.first = std::move(first);
  }

  const std::vector<std::uint8_t>& rows_;
  std::size_t dim_;
  unsigned threads_;
  KMeans cells_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
