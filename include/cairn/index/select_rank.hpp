// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Putting the element of a given rank in its place, smaller ones before and larger ones behind, as
/// std::nth_element does, but on records that are moved whole and without unpredictable branches.
///
/// The pivot is taken from a small sample, a little beyond the wanted rank, so that nearly always the larger
/// part is dropped (the idea of Floyd and Rivest, "Expected time bounds for selection", CACM 18, 1975).
/// Partitioning writes unconditionally and counts, so random keys cost no mispredicted branch. Expected O(n);
/// after an unlucky run of pivots std::nth_element takes over.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI::detail {

/// Moves the records for which goes_left(record) holds to the front; returns the first of the others.
template <class Record, class GoesLeft>
Record* partition_by_counting(Record* begin, Record* end, GoesLeft goes_left) {
  Record* boundary = begin;
  for (Record* at = begin; at != end; ++at) {
    const Record record = *at;
    const bool left = goes_left(record);
    *at = *boundary;
    *boundary = record;
    boundary += left;
  }
  return boundary;
}

/// A key near rank `wanted` of `count` records, on its far side as seen from the nearer end.
template <class Record, class Key>
auto sampled_pivot(const Record* begin, std::size_t count, std::size_t wanted, Key key) {
  constexpr std::size_t most = 64;
  const std::size_t size = count > 4000 ? most : count > 400 ? 24 : 9;
  decltype(key(*begin)) sample[most];
  for (std::size_t i = 0; i < size; ++i) sample[i] = key(begin[count * (2 * i + 1) / (2 * size)]);
  const double expected =
      static_cast<double>(wanted) / static_cast<double>(count) * static_cast<double>(size);
  const double margin = 0.4 * std::sqrt(static_cast<double>(size));
  const bool early = 2 * wanted <= count;
  const double aim = std::clamp(expected + (early ? margin : -margin), 0.0, static_cast<double>(size - 1));
  const auto rank = static_cast<std::ptrdiff_t>(aim);
  std::nth_element(sample, sample + rank, sample + size);
  return sample[rank];
}

/// Afterwards key(begin[i]) <= key(*middle) for all i before middle, >= for all behind.
template <class Record, class Key>
void select_rank(Record* begin, Record* middle, Record* end, Key key) {
  constexpr std::ptrdiff_t small = 48;
  for (int rounds = 0; end - begin > small && rounds < 64; ++rounds) {
    const auto pivot = sampled_pivot(begin, static_cast<std::size_t>(end - begin),
                                     static_cast<std::size_t>(middle - begin), key);
    Record* boundary = partition_by_counting(begin, end, [&](const Record& r) { return key(r) < pivot; });
    if (boundary == begin) {  // the pivot is the smallest: set all its equals apart
      boundary = partition_by_counting(begin, end, [&](const Record& r) { return !(pivot < key(r)); });
      if (middle < boundary) return;
    }
    (middle < boundary ? end : begin) = boundary;
  }
  std::nth_element(begin, middle, end, [&](const Record& a, const Record& b) { return key(a) < key(b); });
}

}  // namespace cairn::inline CAIRN_ABI::detail
