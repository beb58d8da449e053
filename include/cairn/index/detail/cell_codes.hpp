// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Product codes (product_codes.hpp) for all points of cells around means: learnt from a sample of how points
/// differ from their means, with what a search expects of them, measured.
///
/// The codebook is learnt from up to 4096 differences, evenly spread over the points. What is usual of
/// estimates is asked of points of 64 cells against the members of the nearest other cell, as a query that is
/// near two cells would meet them. O(n dim), of which coding all points is nearly all.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <cairn/core/parallel.hpp>
#include <cairn/index/detail/byte_blocks.hpp>
#include <cairn/index/detail/byte_kernels.hpp>
#include <cairn/index/detail/code_blocks.hpp>
#include <cairn/index/detail/product_codes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// What is learnt from points, and all of them in those terms.
struct LearntCodes {
  ProductCodebook codebook;
  CodeBlocks codes;
  ByteRows rows;
  float spread = 1;  ///< root mean square of (q - p).e over |q - p| |e|
};

/// What points meet in the nearest cell that is not theirs.
struct CodeSpread {
  float of_products = 1;     ///< root mean square of (q - p).e over |q - p| |e|
  float largest_number = 1;  ///< and half as much again
  float largest_missed = 1;
};

/// row_of(place, scratch) gives the bytes of a point of the cells.
template <class Cells, class RowOf>
[[nodiscard]] CodeSpread measure_spread(const Cells& cells, const ProductCodebook& codebook,
                                        const RowOf& row_of) {
  const std::size_t dim = cells.dimension();
  const ByteBlocks& means = cells.means();
  constexpr std::size_t queries = 64;
  CodeWriter writer(codebook);
  ByteQuery query;
  std::vector<std::uint8_t> row(dim), bytes(dim);
  std::vector<std::int32_t> keys(means.blocks() * block_size);
  double sum = 0, terms = 0;
  CodeSpread spread;
  for (std::size_t i = 0; i < std::min(queries, cells.size()); ++i) {
    const std::size_t own = i * cells.size() / std::min(queries, cells.size());
    const std::uint8_t* point = row_of(cells.first_place(own), row.data());
    query.set(point, dim);
    means.distances(0, means.blocks(), query, keys.data());
    if (cells.size() > 1) keys[own] = std::numeric_limits<std::int32_t>::max();
    const auto next = static_cast<std::size_t>(
        std::min_element(keys.begin(), keys.begin() + static_cast<std::ptrdiff_t>(cells.size())) -
        keys.begin());
    means.get(next, writer.mean.data());
    for (std::size_t k = 0; k < cells.members_of(next).size(); ++k) {
      const std::uint8_t* other = row_of(cells.first_place(next) + k, bytes.data());
      writer.encode(codebook, other);
      spread.largest_number = std::max(spread.largest_number, 1.5F * std::abs(writer.point.number));
      spread.largest_missed = std::max(spread.largest_missed, 1.5F * writer.point.missed);
      double product = 0, square = 0;
      for (std::size_t a = 0; a < dim; ++a) {
        const double apart = point[a] - other[a];
        product += apart * double{writer.missed()[codebook.place_of(a)]};
        square += apart * apart;
      }
      const double both = square * double{writer.point.missed} * double{writer.point.missed};
      if (both > 0) sum += product * product / both;
      terms += both > 0;
    }
  }
  if (terms > 0) spread.of_products = static_cast<float>(std::sqrt(sum / terms));
  return spread;
}

/// Codes of all points, at their places. The same for any number of threads.
template <class Cells, class RowOf>
[[nodiscard]] LearntCodes learn_codes(const Cells& cells, const RowOf& row_of, unsigned threads) {
  const std::size_t dim = cells.dimension();
  const ByteBlocks& means = cells.means();
  constexpr std::size_t most = 4096;  // differences to learn from
  std::size_t points = 0;
  for (std::size_t c = 0; c < cells.size(); ++c) points += cells.members_of(c).size();
  const std::size_t step = std::max<std::size_t>(1, points / most);
  std::vector<float> origin(dim, 0), sample;
  std::vector<std::uint8_t> mean(dim), scratch(dim);
  std::size_t counted = 0;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    means.get(c, mean.data());
    for (std::size_t a = 0; a < dim; ++a)
      origin[a] += static_cast<float>(mean[a]) / static_cast<float>(cells.size());
    for (std::size_t i = 0; i < cells.members_of(c).size(); ++i)
      if (counted++ % step == 0) {
        const std::uint8_t* row = row_of(cells.first_place(c) + i, scratch.data());
        for (std::size_t a = 0; a < dim; ++a) sample.push_back(static_cast<float>(row[a] - mean[a]));
      }
  }
  ProductCodebook codebook(dim, origin, sample, threads);
  const CodeSpread spread = measure_spread(cells, codebook, row_of);
  CodeBlocks codes(codebook.groups(), cells.blocks(), spread.largest_number, spread.largest_missed);
  ByteRows rows(dim, cells.blocks() * block_size);
  parallel_for(cells.size(), threads, [&](std::size_t begin, std::size_t end) {
    CodeWriter mine(codebook);
    std::vector<std::uint8_t> bytes(dim);
    for (std::size_t c = begin; c < end; ++c) {
      means.get(c, mine.mean.data());
      for (std::size_t i = 0; i < cells.members_of(c).size(); ++i) {
        const std::size_t place = cells.first_place(c) + i;
        const std::uint8_t* row = row_of(place, bytes.data());
        mine.encode(codebook, row);
        codes.set(place, mine.point);
        rows.set(place, row);
      }
    }
  });
  return {std::move(codebook), std::move(codes), std::move(rows), spread.of_products};
}

}}}  // namespace cairn::CAIRN_ABI::detail
