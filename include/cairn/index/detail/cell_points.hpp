// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The points of all cells (byte_cells.hpp) by their places: as bytes, or as codes and bytes.
///
///   without codes   ByteBlocks: a block's bytes side by side, all of them measured together
///   with codes      CodeBlocks: estimates of a block together;  ByteRows: the bytes of whoever is picked out
///
/// A place is a block and one of its sixteen lanes. What stands at a place that nobody wrote means nothing.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/byte_blocks.hpp>
#include <cairn/index/detail/byte_kernels.hpp>
#include <cairn/index/detail/cell_codes.hpp>
#include <cairn/index/detail/code_blocks.hpp>
#include <cairn/index/detail/product_codes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// The points that stand at places, one a place.
class CellPoints {
public:
  CellPoints() = default;
  /// Room for some blocks of points without codes, not yet written.
  CellPoints(std::size_t dim, std::size_t blocks) : dim_(dim), members_(dim, blocks) {}
  /// Of points that have codes.
  CellPoints(std::size_t dim, LearntCodes learnt)
      : dim_(dim), learnt_(std::move(learnt)), writer_(learnt_.codebook) {}

  [[nodiscard]] bool coded() const noexcept { return !learnt_.codebook.empty(); }
  /// Where there are no codes.
  [[nodiscard]] const ByteBlocks& members() const noexcept { return members_; }
  /// These four where there are.
  [[nodiscard]] const ProductCodebook& codebook() const noexcept { return learnt_.codebook; }
  [[nodiscard]] const CodeBlocks& codes() const noexcept { return learnt_.codes; }
  [[nodiscard]] const ByteRows& rows() const noexcept { return learnt_.rows; }
  [[nodiscard]] float spread() const noexcept { return learnt_.spread; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return members_.bytes() + learnt_.codes.bytes() + learnt_.rows.bytes() + learnt_.codebook.bytes();
  }

  /// Reads the bytes of a point.
  void get(std::size_t place, std::uint8_t* row) const noexcept {
    if (coded())
      std::copy_n(rows().row(place), dim_, row);
    else
      members_.get(place, row);
  }
  /// Writes a point of the cell whose mean is point `cell` of `means`.
  void set(std::size_t place, const std::uint8_t* row, const ByteBlocks& means, std::size_t cell) noexcept {
    if (coded()) {
      learnt_.rows.set(place, row);
      means.get(cell, writer_.mean.data());
      writer_.encode(learnt_.codebook, row);
      learnt_.codes.set(place, writer_.point);
    } else {
      members_.set(place, row);
    }
  }
  void copy(std::size_t from, std::size_t to) noexcept {
    if (coded()) {
      learnt_.codes.copy_from(learnt_.codes, from, to);
      learnt_.rows.set(to, learnt_.rows.row(from));
    } else {
      members_.copy(from, to);
    }
  }

  /// Memory for so many blocks, so that a resize() to them cannot throw.
  void reserve(std::size_t blocks) {
    if (coded()) {
      learnt_.codes.reserve(blocks);
      learnt_.rows.reserve(blocks * block_size);
    } else {
      members_.reserve(blocks);
    }
  }
  void resize(std::size_t blocks) {
    if (coded()) {
      learnt_.codes.resize(blocks);
      learnt_.rows.resize(blocks * block_size);
    } else {
      members_.resize(blocks);
    }
  }

  /// Other blocks, so many, in the place of these: each(copy) is called once they are there and copies every
  /// point that is to stay by copy(from, to). A call that throws changes nothing, if each() does not throw.
  template <class Each>
  void rearrange(std::size_t blocks, const Each& each) {
    ByteBlocks members(dim_, coded() ? 0 : blocks);
    CodeBlocks codes = learnt_.codes.of_size(coded() ? blocks : 0);
    ByteRows rows(dim_, coded() ? blocks * block_size : 0);
    each([&](std::size_t from, std::size_t to) {
      if (coded()) {
        codes.copy_from(learnt_.codes, from, to);
        rows.set(to, learnt_.rows.row(from));
      } else {
        members.copy_from(members_, from, to);
      }
    });
    members_ = std::move(members);
    learnt_.codes = std::move(codes);
    learnt_.rows = std::move(rows);
  }

  /// Squared distances of the points at `count` places from one that begins a block; `to` has room for whole
  /// blocks.
  void distances(std::size_t place, std::size_t count, const ByteQuery& query,
                 std::int32_t* to) const noexcept {
    if (!coded())
      return members_.distances(place / block_size, (count + block_size - 1) / block_size, query, to);
    for (std::size_t i = 0; i < count; ++i) {
      const auto here = static_cast<std::uint32_t>(place + i);
      learnt_.rows.distances(&here, 1, query, to + i);
    }
  }

private:
  std::size_t dim_ = 0;
  ByteBlocks members_;
  LearntCodes learnt_;
  CodeWriter writer_;  ///< what set() works with
};

}}}  // namespace cairn::CAIRN_ABI::detail
