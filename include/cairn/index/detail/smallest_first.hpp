// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A priority list: whole numbers in ascending order, one at a time, for as long as somebody asks. Here the
/// squared distances of the means of all cells, of which a search looks at the nearest few.
///
///   keys     sixteen to a block, by place:  k0 ... k15 | k16 ... k31 | ...
///   minima   the smallest of each block:        m0     |     m1      | ...
///
/// When what was sorted has run out, a bound is found that at least ten keys do not exceed, from the minima
/// alone: sixteen minima of as many parts of the list, lane by lane, and the tenth smallest of those. (Up to
/// 256 keys have no more minima than lanes; then the parts are lanes of the keys themselves: neighbours in
/// the list are alike, so their minima would take twice as many keys, and of fewer than ten blocks all.)
/// Blocks whose minimum is within the bound give up all keys that are, and these are sorted by counting how
/// many come before each: sixteen numbers at a time, and hardly a branch that depends on what they are.
///
/// O(count) for reset(), O(count / 256 + t log t) each time t numbers run out, with t a few dozen.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include <cairn/index/detail/block_lanes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Whole numbers in ascending order, one at a time, as many as are asked for; equal ones by their place.
class SmallestFirst {
public:
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  static constexpr std::int32_t taken = std::numeric_limits<std::int32_t>::max();

  /// Room for `count` numbers, all below `taken`, to be written to keys() before reset(). Up to a multiple of
  /// sixteen more may be written, and are forgotten.
  void resize(std::size_t count) {
    const std::size_t blocks = (count + block_size - 1) / block_size;
    keys_.resize(blocks * block_size);
    minima_.assign((blocks + block_size - 1) / block_size * block_size, taken);
    taken_keys_.resize(keys_.size() + block_size, 0);
    taken_places_.resize(keys_.size() + block_size);
    sorted_.resize(keys_.size());
    count_ = count;
  }
  [[nodiscard]] std::int32_t* keys() noexcept { return keys_.data(); }

  void reset() noexcept {
    for (std::size_t i = count_; i < keys_.size(); ++i) keys_[i] = taken;
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t b = 0; b < keys_.size() / block_size; ++b) minima_[b] = smallest_of(keys_, b);
    });
    sorted_count_ = 0;
    given_ = 0;
  }

  struct Item {
    std::size_t place;
    std::int32_t key;
  };
  /// The next; place is none where all were given. O(count / 256) and the share of a sort.
  [[nodiscard]] Item next() noexcept {
    if (given_ == sorted_count_) sort_some();
    if (given_ == sorted_count_) return {none, taken};
    return sorted_[given_++];
  }

private:
  using Numbers = AlignedVector<std::int32_t>;
  static constexpr std::size_t some = 10;
  static constexpr std::size_t four = 4;

  [[gnu::always_inline]] static std::int32_t smallest_of(const Numbers& numbers, std::size_t block) noexcept {
    Block<std::int32_t> here;
    load_block<std::int32_t>(numbers.data() + block * block_size, here);
    return smallest<std::int32_t>(here);
  }

  /// Takes out all numbers up to one that at least `some` do not exceed, if so many are left: of the minima
  /// of sixteen parts the one of that rank. Fifteen to a few dozen as a rule.
  void sort_some() noexcept {
    sorted_count_ = 0;
    given_ = 0;
    with_widest_lanes([&]() CAIRN_INLINED {
      Block<std::int32_t> low = Block<std::int32_t>{} + taken;
      const Numbers& parts = minima_.size() <= block_size ? keys_ : minima_;
      for (std::size_t g = 0; g < parts.size(); g += block_size) {
        Block<std::int32_t> here;
        load_block<std::int32_t>(parts.data() + g, here);
        low = here < low ? here : low;
      }
      Block<std::int32_t> below{};  // how many of the parts are below each
      std::int32_t part[block_size];
      std::memcpy(part, &low, sizeof(low));
      for (std::size_t i = 0; i < block_size; ++i) below -= Block<std::int32_t>{} + part[i] < low;
      const Block<std::int32_t> candidates =
          below < Block<std::int32_t>{} + static_cast<std::int32_t>(some) ? low : Block<std::int32_t>{} - 1;
      const std::int32_t most = std::min(-smallest<std::int32_t>(-candidates), taken - 1);
      for (std::size_t g = 0; g < minima_.size(); g += block_size) {
        Block<std::int32_t> here;
        load_block<std::int32_t>(minima_.data() + g, here);
        for (unsigned mask = mask_below<std::int32_t>(here, most + 1); mask != 0; mask &= mask - 1)
          take(g + static_cast<std::size_t>(std::countr_zero(mask)), most);
      }
      sort_taken();
    });
  }
  /// Four at a time, whether there are so many or not: who would ask after each is told wrong too often.
  [[gnu::always_inline]] void take(std::size_t block, std::int32_t most) noexcept {
    std::int32_t* const keys = keys_.data() + block * block_size;
    Block<std::int32_t> here;
    load_block<std::int32_t>(keys, here);
    const unsigned below = mask_below<std::int32_t>(here, most + 1);
    std::size_t to = sorted_count_;
    for (unsigned left = below; left != 0;)
      for (std::size_t i = 0; i < four; ++i, ++to, left &= left - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(left)) % block_size;
        taken_keys_[to] = keys[lane];
        taken_places_[to] = static_cast<std::uint32_t>(block * block_size + lane);
      }
    sorted_count_ += static_cast<std::size_t>(std::popcount(below));
    here = here < Block<std::int32_t>{} + (most + 1) ? Block<std::int32_t>{} + taken : here;
    std::memcpy(keys, &here, sizeof(here));
    minima_[block] = smallest<std::int32_t>(here);
  }
  /// By counting for each who comes before it, sixteen at a time and without a branch: they are few.
  [[gnu::always_inline]] void sort_taken() noexcept {
    if (sorted_count_ > 16 * block_size) {
      for (std::size_t i = 0; i < sorted_count_; ++i) sorted_[i] = {taken_places_[i], taken_keys_[i]};
      const auto before = [](const Item& a, const Item& b) {
        return a.key != b.key ? a.key < b.key : a.place < b.place;
      };
      std::sort(sorted_.begin(), sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_count_), before);
      return;
    }
    Block<std::int32_t> numbers;
    for (std::size_t i = 0; i < block_size; ++i) numbers[i] = static_cast<std::int32_t>(i);
    for (std::size_t begin = 0; begin < sorted_count_; begin += block_size) {
      Block<std::int32_t> keys, ranks{};
      load_block<std::int32_t>(taken_keys_.data() + begin, keys);
      // Of equals the one that was taken out first, whose place is lower.
      for (std::size_t j = 0; j < begin; ++j) ranks -= Block<std::int32_t>{} + taken_keys_[j] <= keys;
      for (std::size_t j = begin; j < std::min(begin + block_size, sorted_count_); ++j) {
        const Block<std::int32_t> later =
            numbers > Block<std::int32_t>{} + static_cast<std::int32_t>(j - begin);
        const Block<std::int32_t> key = Block<std::int32_t>{} + taken_keys_[j];
        ranks -= (key < keys) | (later & (key == keys));
      }
      for (std::size_t j = begin + block_size; j < sorted_count_; ++j)
        ranks -= Block<std::int32_t>{} + taken_keys_[j] < keys;
      std::int32_t rank[block_size];
      std::memcpy(rank, &ranks, sizeof(ranks));
      const std::size_t size = std::min(block_size, sorted_count_ - begin);
      for (std::size_t i = 0; i < size; ++i)
        sorted_[static_cast<std::size_t>(rank[i])] = {taken_places_[begin + i], taken_keys_[begin + i]};
    }
  }

  std::size_t count_ = 0;
  Numbers keys_;
  Numbers minima_;      ///< of sixteen keys each
  Numbers taken_keys_;  ///< by place
  AlignedVector<std::uint32_t> taken_places_;
  std::vector<Item> sorted_;  ///< the same by key
  std::size_t sorted_count_ = 0;
  std::size_t given_ = 0;  ///< of them
};

}}}  // namespace cairn::CAIRN_ABI::detail
