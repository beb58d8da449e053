// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Codes of four bits for four coordinates, and the distances that they bound (product quantization: Jegou,
/// Douze, Schmid, "Product quantization for nearest neighbor search", IEEE PAMI 33, 2011, sections II and
/// III). What a query makes of them is in code_tables.hpp, how they lie in memory in code_blocks.hpp.
///
/// A point p of a cell with the mean m is kept as m + f c, where c is the codeword that is nearest to p - m
/// in each four coordinates, and f a number of the point; e = p - m - f c is what that misses. For a query q
/// and any origin o
///
///   |q - p|^2 = |q - m|^2 - 2 f (q - o).c + (|p - m|^2 + 2 f (m - o).c - 2 (p - m).e) - 2 (q - p).e
///
/// The first term is known from the choice of cells, the second one is a sum over sixteen-entry tables that a
/// query makes once for all cells (that is what o is for: it makes them small), the third one is a number of
/// the point. The last term is left out of the estimate, and |2 (q - p).e| <= 2 |q - p| |e| by Cauchy and
/// Schwarz: with |e| kept beside the point, whoever is nearer than a limit has an estimate below its square
/// and 2 limit |e|, proven. Directions being many, (q - p).e is mostly far smaller: its root mean square over
/// |q - p| |e| is measured where the codes are learnt (cell_codes.hpp), and a search looks first at whoever
/// is below its limit by some of those. f = |p - m|^2 / (p - m).c makes e stand at right angles to p - m:
/// else a point would be taken for nearer than it is the more of it its code misses (Gao, Long, "RaBitQ",
/// SIGMOD 2024).
///
/// The four coordinates of a group are no neighbours: ordered by how much points vary in them they are dealt
/// to the groups in turns, there and back, so that a codeword has about as much to tell in each.
///
/// All this is about bytes; that bytes are not their points is the caller's to allow for. Learning takes
/// O(rows dim) a round, coding a point O(16 dim).
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <vector>

#include <cairn/core/parallel.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/byte_kernels.hpp>
#include <cairn/index/detail/code_tables.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Sixteen codewords for each group of four coordinates.
class ProductCodebook {
public:
  ProductCodebook() = default;

  /// Learnt from `rows`, rows of dim differences between points and the means of their cells, at least one:
  /// Lloyd's algorithm in each group. O(rows dim).
  ProductCodebook(std::size_t dim, const std::vector<float>& origin, const std::vector<float>& rows,
                  unsigned threads)
      : dim_(dim), origin_(places(), 0.0F), words_(places() * codewords, 0.0F) {
    deal(rows);
    for (std::size_t a = 0; a < dim; ++a) origin_[place_of_[a]] = origin[a];
    parallel_for(groups(), threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t g = begin; g < end; ++g) learn_group(g, rows);
    });
    float squares = 0;
    for (std::size_t place = 0; place < places(); ++place) {
      float largest = 0;
      for (std::size_t k = 0; k < codewords; ++k)
        largest = std::max(largest, std::abs(words_[place * codewords + k]));
      squares += largest * largest;
    }
    longest_ = std::sqrt(squares) * 1.001F;
  }

  [[nodiscard]] bool empty() const noexcept { return dim_ == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  /// Of four coordinates, filled up to whole lines.
  [[nodiscard]] std::size_t groups() const noexcept {
    return (dim_ + lane_axes * codes_in_line - 1) / (lane_axes * codes_in_line) * codes_in_line;
  }
  /// Coordinates as the groups have them: those of group g are at places 4 g ... 4 g + 3. There may be places
  /// of none.
  [[nodiscard]] std::size_t places() const noexcept { return groups() * lane_axes; }
  [[nodiscard]] std::size_t place_of(std::size_t axis) const noexcept { return place_of_[axis]; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return (origin_.capacity() + words_.capacity()) * sizeof(float) +
           (place_of_.capacity() + axis_at_.capacity()) * sizeof(std::uint32_t);
  }

  /// The codeword of each group that is nearest to a difference of places() numbers.
  void encode(const float* difference, std::uint8_t* codes) const noexcept {
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t g = 0; g < groups(); ++g) codes[g] = nearest_word(g, difference + g * lane_axes);
    });
  }
  /// At a place, of the codeword `code` of its group.
  [[nodiscard]] float word(std::size_t place, std::uint8_t code) const noexcept {
    return words_[place * codewords + code];
  }
  /// By places.
  [[nodiscard]] const std::vector<float>& origin() const noexcept { return origin_; }

  /// Products -2 (q - origin).c of a query's bytes.
  void make_tables(const std::uint8_t* query, CodeTables& tables) const {
    tables.reset(groups());
    float squares = 0;
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t g = 0; g < groups(); ++g) {
        Block<float> products{};
        for (std::size_t i = 0; i < lane_axes; ++i) {
          const std::size_t place = g * lane_axes + i, axis = axis_at_[place];
          const float number = axis < dim_ ? -2 * (static_cast<float>(query[axis]) - origin_[place]) : 0.0F;
          squares += number * number;
          Block<float> words;
          load_block<float>(words_.data() + place * codewords, words);
          products += words * number;
        }
        tables.set_group(g, products);
      }
      tables.round_down();
    });
    tables.set_magnitude(std::sqrt(squares) * longest_ * 1.001F);
  }

private:
  static constexpr int rounds = 10;

  [[gnu::always_inline]] [[nodiscard]] std::uint8_t nearest_word(std::size_t group,
                                                                 const float* numbers) const noexcept {
    Block<float> squares{};
    for (std::size_t i = 0; i < lane_axes; ++i) {
      Block<float> words;
      load_block<float>(words_.data() + (group * lane_axes + i) * codewords, words);
      const Block<float> difference = words - (Block<float>{} + numbers[i]);
      squares += difference * difference;
    }
    Block<std::int32_t> bits;  // squares compare like their bits
    std::memcpy(&bits, &squares, sizeof(bits));
    const std::int32_t least = smallest<std::int32_t>(bits);
    return static_cast<std::uint8_t>(std::countr_zero(mask_below<std::int32_t>(bits, least + 1)));
  }

  /// Of G groups, group g gets the coordinates that are the g-th, 2 G - 1 - g-th, 2 G + g-th, 4 G - 1 - g-th
  /// of those that vary most.
  void deal(const std::vector<float>& rows) {
    std::vector<double> squares(dim_, 0.0);
    for (std::size_t i = 0; i < rows.size(); ++i) squares[i % dim_] += double{rows[i]} * double{rows[i]};
    std::vector<std::uint32_t> order(dim_);
    std::iota(order.begin(), order.end(), 0U);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return squares[a] != squares[b] ? squares[a] > squares[b] : a < b;
    });
    place_of_.resize(dim_);
    axis_at_.assign(places(), static_cast<std::uint32_t>(dim_));
    for (std::size_t rank = 0; rank < dim_; ++rank) {
      const std::size_t turn = rank / groups(), within = rank % groups();
      const std::size_t group = turn % 2 == 0 ? within : groups() - 1 - within;
      place_of_[order[rank]] = static_cast<std::uint32_t>(group * lane_axes + turn);
      axis_at_[group * lane_axes + turn] = order[rank];
    }
  }

  void learn_group(std::size_t group, const std::vector<float>& rows) {
    const std::size_t count = rows.size() / dim_;
    std::vector<float> numbers(count * lane_axes, 0.0F);
    for (std::size_t a = 0; a < lane_axes; ++a)
      if (const std::size_t axis = axis_at_[group * lane_axes + a]; axis < dim_)
        for (std::size_t i = 0; i < count; ++i) numbers[i * lane_axes + a] = rows[i * dim_ + axis];
    float* words = words_.data() + group * lane_axes * codewords;
    for (std::size_t k = 0; k < codewords; ++k)
      for (std::size_t a = 0; a < lane_axes; ++a)
        words[a * codewords + k] = numbers[k * count / codewords * lane_axes + a];
    std::vector<std::uint8_t> code(count);
    for (int round = 0; round < rounds; ++round) {
      with_widest_lanes([&]() CAIRN_INLINED {
        for (std::size_t i = 0; i < count; ++i) code[i] = nearest_word(group, &numbers[i * lane_axes]);
      });
      float sums[codewords][lane_axes] = {};
      float sizes[codewords] = {};
      for (std::size_t i = 0; i < count; ++i) {
        ++sizes[code[i]];
        for (std::size_t a = 0; a < lane_axes; ++a) sums[code[i]][a] += numbers[i * lane_axes + a];
      }
      for (std::size_t k = 0; k < codewords; ++k)
        if (sizes[k] > 0)
          for (std::size_t a = 0; a < lane_axes; ++a) words[a * codewords + k] = sums[k][a] / sizes[k];
    }
  }

  ResetOnMove<std::size_t> dim_;
  std::vector<std::uint32_t> place_of_;  ///< of each coordinate
  std::vector<std::uint32_t> axis_at_;   ///< of each place; dim_ where there is none
  std::vector<float> origin_;
  std::vector<float> words_;  ///< sixteen for each place
  float longest_ = 0;         ///< no combination of codewords is longer
};

/// A point as its codes, with the numbers of the formula above.
struct CodedPoint {
  std::vector<std::uint8_t> codes;
  std::uint8_t factor = 0;  ///< what f is more than one by, in factor_unit
  float number = 0;         ///< |p - m|^2 + 2 f (m - o).c - 2 (p - m).e
  float missed = 0;         ///< |e|, rounded up
  [[nodiscard]] float f() const noexcept { return 1 + static_cast<float>(factor) * factor_unit; }
};

/// Codes points, one after the other.
class CodeWriter {
public:
  CodeWriter() = default;
  explicit CodeWriter(const ProductCodebook& codebook)
      : mean(codebook.dimension()), left_(codebook.places(), 0.0F) {
    point.codes.resize(codebook.groups());
  }

  std::vector<std::uint8_t> mean;  ///< of the cell, written by the caller
  CodedPoint point;                ///< written by encode()
  /// e, by places.
  [[nodiscard]] const std::vector<float>& missed() const noexcept { return left_; }

  void encode(const ProductCodebook& codebook, const std::uint8_t* row) noexcept {
    std::fill(left_.begin(), left_.end(), 0.0F);
    double square = 0, own = 0, of_mean = 0, missed = 0;
    for (std::size_t a = 0; a < mean.size(); ++a) {
      const int difference = row[a] - mean[a];
      left_[codebook.place_of(a)] = static_cast<float>(difference);
      square += difference * difference;
    }
    codebook.encode(left_.data(), point.codes.data());
    for (std::size_t a = 0; a < mean.size(); ++a) {
      const std::size_t place = codebook.place_of(a);
      const double word = double{codebook.word(place, point.codes[place / lane_axes])};
      own += double{left_[place]} * word;
      of_mean += (mean[a] - double{codebook.origin()[place]}) * word;
    }
    const double wished = own > 0 ? (square / own - 1) / double{factor_unit} : 0;
    point.factor = static_cast<std::uint8_t>(std::clamp(wished + 0.5, 0.0, 255.0));
    const auto f = double{point.f()};
    for (std::size_t place = 0; place < left_.size(); ++place) {
      const double left =
          double{left_[place]} - f * double{codebook.word(place, point.codes[place / lane_axes])};
      missed += left * left;
      left_[place] = static_cast<float>(left);
    }
    point.number = static_cast<float>(2 * f * (of_mean + own) - square);
    point.missed = static_cast<float>(std::sqrt(missed) * 1.00001);
  }

private:
  std::vector<float> left_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
