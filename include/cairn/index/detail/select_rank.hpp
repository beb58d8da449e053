// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Putting the element of a given rank in its place, smaller ones before and larger ones behind, as
/// std::nth_element does, but on records that are moved whole and without unpredictable branches.
///
/// The pivot is taken from a small sample, a little beyond the wanted rank, so that nearly always the larger
/// part is dropped (the idea of Floyd and Rivest, "Expected time bounds for selection", CACM 18, 1975).
/// Partitioning writes unconditionally and counts, and few records are compared all with all, so random keys
/// cost no mispredicted branch. Expected O(n); after an unlucky run of pivots std::nth_element takes over.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include <cairn/core/sizes.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Counts of records, as wide as their keys.
template <class Scalar>
using RankOf = std::conditional_t<sizeof(Scalar) == 1, std::int8_t,
                                  std::conditional_t<sizeof(Scalar) == 2, std::int16_t, BitsOf<Scalar>>>;

/// Few enough to be compared all with all.
inline constexpr std::size_t few_keys = 48;
static_assert(few_keys % block_size == 0 && few_keys < 128,
              "ranks are counted in whole blocks, perhaps in bytes");

/// ranks[i]: how many of the `count` keys come before key i, of equals the earlier ones first. Both arrays
/// have room for whole blocks.
template <class Scalar>
[[gnu::always_inline]] inline void count_ranks(const Scalar* keys, std::size_t count,
                                               RankOf<Scalar>* ranks) noexcept {
  using Ranks = Block<RankOf<Scalar>>;
  Ranks lanes;
  for (std::size_t i = 0; i < block_size; ++i) lanes[i] = static_cast<RankOf<Scalar>>(i);
  for (std::size_t begin = 0; begin < count; begin += block_size) {
    Block<Scalar> own;
    load_block<Scalar>(keys + begin, own);
    Ranks before{};
    const std::size_t end = std::min(begin + block_size, count);
    for (std::size_t j = 0; j < begin; ++j) before -= Block<Scalar>{} + keys[j] <= own;
    for (std::size_t j = begin; j < end; ++j)
      before -= (Block<Scalar>{} + keys[j] < own) |
                ((Block<Scalar>{} + keys[j] == own) & (lanes > static_cast<RankOf<Scalar>>(j - begin)));
    for (std::size_t j = end; j < count; ++j) before -= Block<Scalar>{} + keys[j] < own;
    std::memcpy(ranks + begin, &before, sizeof(before));
  }
}

/// The same for the widest vectors at hand, compiled once for all who count.
template <class Scalar>
void count_ranks_widely(const Scalar* keys, std::size_t count, RankOf<Scalar>* ranks) noexcept {
  with_widest_lanes([=]() CAIRN_INLINED { count_ranks(keys, count, ranks); });
}

/// select_rank() of up to few_keys records, without a branch on their keys.
template <class Record, class Key>
void select_rank_of_few(Record* begin, Record* middle, Record* end, Key key) {
  using Scalar = std::remove_cvref_t<decltype(key(*begin))>;
  const auto count = static_cast<std::size_t>(end - begin);
  const auto wanted = static_cast<RankOf<Scalar>>(middle - begin);
  Scalar keys[few_keys] = {};
  RankOf<Scalar> ranks[few_keys];
  Record records[few_keys];
  for (std::size_t i = 0; i < count; ++i) {
    records[i] = begin[i];
    keys[i] = key(begin[i]);
  }
  count_ranks_widely(keys, count, ranks);
  Record* below = begin;
  Record* above = middle + 1;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_below = ranks[i] < wanted;
    const bool is_above = ranks[i] > wanted;
    *(is_below ? below : is_above ? above : middle) = records[i];
    below += is_below;
    above += is_above;
  }
}

/// Records are moved whole, in one register where they fit: taken apart and stored in pieces, the next load
/// of one would wait for all of them.
template <class Record>
struct WholeOf {
  using Type = Record;
};
template <class Record>
  requires(sizeof(Record) == 8 || sizeof(Record) == 16 || sizeof(Record) == 32)
struct WholeOf<Record> {
  using Type = Lanes<unsigned char, sizeof(Record)>;
};

/// Moves the records for which goes_left(record) holds to the front; returns the first of the others.
template <class Record, class GoesLeft>
Record* partition_by_counting(Record* begin, Record* end, GoesLeft goes_left) {
  Record* boundary = begin;
  for (Record* at = begin; at != end; ++at) {
    const bool left = goes_left(*at);
    typename WholeOf<Record>::Type here, there;
    std::memcpy(&here, at, sizeof(Record));
    std::memcpy(&there, boundary, sizeof(Record));
    std::memcpy(static_cast<void*>(at), &there, sizeof(Record));
    std::memcpy(static_cast<void*>(boundary), &here, sizeof(Record));
    boundary += left;
  }
  return boundary;
}

/// A key near rank `wanted` of `count` records, on its far side as seen from the nearer end.
template <class Record, class Key>
auto sampled_pivot(const Record* begin, std::size_t count, std::size_t wanted, Key key) {
  using Scalar = std::remove_cvref_t<decltype(key(*begin))>;
  const std::size_t size = count > 4000 ? few_keys : count > 400 ? 24 : 9;
  Scalar sample[few_keys] = {};
  for (std::size_t i = 0; i < size; ++i) sample[i] = key(begin[share(count, 2 * i + 1, 2 * size)]);
  const double expected =
      static_cast<double>(wanted) / static_cast<double>(count) * static_cast<double>(size);
  const double margin = 0.4 * std::sqrt(static_cast<double>(size));
  const bool early = wanted <= count - wanted;
  const double aim = std::clamp(expected + (early ? margin : -margin), 0.0, static_cast<double>(size - 1));
  const auto rank = static_cast<RankOf<Scalar>>(aim);
  RankOf<Scalar> ranks[few_keys];
  count_ranks_widely(sample, size, ranks);
  return sample[std::find(ranks, ranks + size - 1, rank) - ranks];
}

/// Afterwards key(begin[i]) <= key(*middle) for all i before middle, >= for all behind.
template <class Record, class Key>
void select_rank(Record* begin, Record* middle, Record* end, Key key) {
  constexpr auto few = static_cast<std::ptrdiff_t>(few_keys);
  for (int rounds = 0; end - begin > few && rounds < 64; ++rounds) {
    const auto pivot = sampled_pivot(begin, static_cast<std::size_t>(end - begin),
                                     static_cast<std::size_t>(middle - begin), key);
    Record* boundary = partition_by_counting(begin, end, [&](const Record& r) { return key(r) < pivot; });
    if (boundary == begin) {  // the pivot is the smallest: set all its equals apart
      boundary = partition_by_counting(begin, end, [&](const Record& r) { return !(pivot < key(r)); });
      if (middle < boundary) return;
    }
    (middle < boundary ? end : begin) = boundary;
  }
  if (end - begin <= few) return select_rank_of_few(begin, middle, end, key);
  std::nth_element(begin, middle, end, [&](const Record& a, const Record& b) { return key(a) < key(b); });
}

}}}  // namespace cairn::CAIRN_ABI::detail
