// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/index/detail/code_blocks.hpp>
#include <cairn/index/detail/code_kernels.hpp>
#include <cairn/index/detail/code_tables.hpp>
#include <cairn/index/detail/product_codes.hpp>

#include "support/processors.hpp"
#include "support/random.hpp"

namespace detail = cairn::detail;

namespace product_codes_test {
namespace {

/// Bytes like real ones, like none, all the same, and at the ends of their range.
std::vector<std::uint8_t> drawn(const std::string& kind, std::size_t count, cairn::Random& random) {
  std::vector<std::uint8_t> bytes(count);
  for (std::uint8_t& byte : bytes) {
    double number = 100 + 12 * random.normal();
    if (kind == "uniform") number = static_cast<double>(random.below(256));
    if (kind == "equal") number = 77;
    if (kind == "ends") number = static_cast<double>(random.below(2) * 255);
    byte = static_cast<std::uint8_t>(std::clamp(number, 0.0, 255.0));
  }
  return bytes;
}

/// A cell with its codes, learnt from its points.
struct Cell {
  std::size_t dim;
  std::vector<std::uint8_t> points;
  std::vector<std::uint8_t> mean;
  detail::ProductCodebook codebook;
  detail::CodeBlocks blocks;
  std::vector<detail::CodedPoint> coded;
  float largest = 0;  ///< of their numbers

  [[nodiscard]] std::size_t count() const { return points.size() / dim; }

  Cell(const std::string& kind, std::size_t dimension, std::size_t count, cairn::Random& random)
      : dim(dimension), points(drawn(kind, count * dimension, random)), mean(drawn(kind, dimension, random)) {
    std::vector<float> differences, origin(dim, 90);
    for (std::size_t i = 0; i < points.size(); ++i)
      differences.push_back(static_cast<float>(points[i] - mean[i % dim]));
    codebook = detail::ProductCodebook(dim, origin, differences, 1);
    detail::CodeWriter writer(codebook);
    writer.mean = mean;
    float number = 0, missed = 0;
    for (std::size_t i = 0; i < count; ++i) {
      writer.encode(codebook, &points[i * dim]);
      coded.push_back(writer.point);
      number = std::max(number, std::abs(writer.point.number));
      missed = std::max(missed, writer.point.missed);
    }
    largest = number;
    // Half of the largest: some points have numbers that do not fit.
    blocks = detail::CodeBlocks(codebook.groups(), (count + 15) / 16, number / 2, 1.1F * missed);
    for (std::size_t i = 0; i < count; ++i) blocks.set(i, coded[i]);
  }

  /// Coordinate `axis` of what a point's code says it differs from the mean by.
  [[nodiscard]] double word(std::size_t point, std::size_t axis) const {
    const std::size_t place = codebook.place_of(axis);
    return double{coded[point].f()} * double{codebook.word(place, coded[point].codes[place / 4])};
  }
};

double square(const std::uint8_t* a, const std::uint8_t* b, std::size_t dim) {
  double sum = 0;
  for (std::size_t i = 0; i < dim; ++i) sum += std::pow(double(a[i]) - double(b[i]), 2);
  return sum;
}

/// Points that are below a limit by a hair and not possible, or estimates off by more than the formula's last
/// term and rounding.
std::size_t wrong_verdicts(const Cell& cell, const std::uint8_t* query) {
  detail::CodeTables tables;
  cell.codebook.make_tables(query, tables);
  const auto from_mean = static_cast<float>(square(query, cell.mean.data(), cell.dim));
  const std::size_t blocks = (cell.count() + 15) / 16;
  std::vector<float> estimates(blocks * 16);
  std::vector<detail::CodeVerdict> verdicts(blocks);
  const float rounding = cell.blocks.rounding(from_mean, tables);
  cell.blocks.estimates(0, blocks, tables, cell.blocks.scale(from_mean, tables), estimates.data());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < cell.count(); ++i) {
    const double true_square = square(query, &cell.points[i * cell.dim], cell.dim);
    const float below = (static_cast<float>(true_square) + 1) * 1.000001F;
    const float proven = 2 * std::sqrt(below) * 1.00001F;
    cell.blocks.verdicts(0, blocks, estimates.data(), {0.5F * proven, proven, rounding, below},
                         verdicts.data());
    wrong += (verdicts[i / 16].possible >> i % 16 & 1U) == 0;
    wrong += (verdicts[i / 16].likely & ~verdicts[i / 16].possible) != 0;
    // 2 (q - p).e, from what the codes miss.
    double last_term = 0, missed_square = 0;
    for (std::size_t a = 0; a < cell.dim; ++a) {
      const double point = cell.points[i * cell.dim + a];
      const double missed = point - cell.mean[a] - cell.word(i, a);
      last_term += 2 * (double(query[a]) - point) * missed;
      missed_square += missed * missed;
    }
    wrong += std::sqrt(missed_square) > double{cell.coded[i].missed};
    if (std::abs(cell.coded[i].number) < 0.4F * cell.largest)
      wrong += std::abs(double{estimates[i]} - last_term - true_square) > double{rounding};
  }
  return wrong;
}

}  // namespace

TEST_SUITE("product_codes") {
  TEST_CASE("product_codes: no point below a limit is ruled out, whatever the bytes and the processor") {
    const std::uint64_t seed = cairn_test::seed(91);
    CAPTURE(seed);
    cairn::Random random(seed);
    cairn_test::for_each_processor([&] {
      for (const std::string kind : {"normal", "uniform", "equal", "ends"})
        for (const std::size_t dim : {1U, 3U, 4U, 5U, 31U, 32U, 33U, 64U, 100U, 128U, 130U})
          for (const std::size_t count : {1U, 15U, 16U, 50U}) {
            CAPTURE(kind);
            CAPTURE(dim);
            CAPTURE(count);
            const Cell cell(kind, dim, count, random);
            for (const std::string of : {"normal", "uniform", "ends"})
              CHECK(wrong_verdicts(cell, drawn(of, dim, random).data()) == 0);
            CHECK(wrong_verdicts(cell, cell.mean.data()) == 0);
            CHECK(wrong_verdicts(cell, cell.points.data()) == 0);
          }
      const Cell large("uniform", 3000, 20, random);  // entries of tables become coarse
      CHECK(wrong_verdicts(large, drawn("uniform", 3000, random).data()) == 0);
    });
  }

  TEST_CASE("product_codes: a code is the nearest codeword, and learning beats any sixteen points") {
    cairn::Random random(cairn_test::seed(92));
    const std::size_t dim = 8, count = 500;
    const Cell cell("normal", dim, count, random);
    double of_words = 0, of_points = 0;
    for (std::size_t g = 0; g < 2; ++g) {
      std::vector<std::size_t> axes;  // of the group
      for (std::size_t a = 0; a < dim; ++a)
        if (cell.codebook.place_of(a) / 4 == g) axes.push_back(a);
      for (std::size_t i = 0; i < count; ++i) {
        const auto missed = [&](std::uint8_t code) {
          double sum = 0;
          for (const std::size_t a : axes)
            sum += std::pow(cell.points[i * dim + a] - cell.mean[a] -
                                double{cell.codebook.word(cell.codebook.place_of(a), code)},
                            2);
          return sum;
        };
        double least = missed(0), least_point = 1e30;
        for (std::uint8_t code = 1; code < 16; ++code) least = std::min(least, missed(code));
        REQUIRE(missed(cell.coded[i].codes[g]) == doctest::Approx(least).epsilon(1e-5));
        for (std::size_t k = 0; k < 16; ++k) {
          double sum = 0;
          for (const std::size_t a : axes)
            sum += std::pow(double(cell.points[i * dim + a]) - double(cell.points[k * 30 * dim + a]), 2);
          least_point = std::min(least_point, sum);
        }
        of_words += least;
        of_points += least_point;
      }
    }
    CHECK(of_words < 0.8 * of_points);
  }

  TEST_CASE("product_codes: every coordinate has a place, and groups share those that vary most") {
    cairn::Random random(cairn_test::seed(95));
    for (const std::size_t dim : {1U, 5U, 32U, 40U, 64U, 130U}) {
      CAPTURE(dim);
      std::vector<float> rows;
      for (std::size_t i = 0; i < 400 * dim; ++i)  // the first ones vary most
        rows.push_back((random.below(2) == 0 ? 1.0F : -1.0F) * static_cast<float>(dim - i % dim));
      const detail::ProductCodebook codebook(dim, std::vector<float>(dim, 90), rows, 1);
      std::vector<std::size_t> of_group(codebook.groups(), 0), taken(codebook.places(), 0);
      for (std::size_t a = 0; a < dim; ++a) {
        REQUIRE(codebook.place_of(a) < codebook.places());
        ++taken[codebook.place_of(a)];
        if (a < codebook.groups()) ++of_group[codebook.place_of(a) / 4];
      }
      CHECK(*std::max_element(taken.begin(), taken.end()) == 1);
      CHECK(*std::max_element(of_group.begin(), of_group.end()) == 1);
    }
  }

  TEST_CASE("product_codes: a near point is not taken for farther, nor a far one for nearer, than it is") {
    // Codes of half a byte for four coordinates miss a good part of a point. As estimates go by f, that part
    // cancels: for queries beside a point and for those far from it they err as often to either side.
    cairn::Random random(cairn_test::seed(96));
    const std::size_t dim = 64;
    const Cell cell("normal", dim, 400, random);
    double near_error = 0, far_error = 0, missed = 0;
    for (std::size_t i = 0; i < 400; ++i) {
      std::vector<std::uint8_t> query(&cell.points[i * dim], &cell.points[i * dim] + dim);
      for (std::uint8_t& byte : query) byte = static_cast<std::uint8_t>(byte + random.below(3));
      const auto error = [&](const std::vector<std::uint8_t>& from) {
        detail::CodeTables tables;
        cell.codebook.make_tables(from.data(), tables);
        const auto from_mean = static_cast<float>(square(from.data(), cell.mean.data(), dim));
        float estimates[16];
        cell.blocks.estimates(i / 16, 1, tables, cell.blocks.scale(from_mean, tables), estimates);
        return double{estimates[i % 16]} - square(from.data(), &cell.points[i * dim], dim);
      };
      if (std::abs(cell.coded[i].number) > cell.largest / 2) continue;  // it has none
      near_error += error(query);
      for (std::size_t a = 0; a < dim; ++a)  // on any side of the mean
        query[a] = static_cast<std::uint8_t>(std::clamp(cell.mean[a] + 12 * random.normal(), 0.0, 255.0));
      far_error += error(query);
      missed += std::pow(double{cell.coded[i].missed}, 2);
    }
    CHECK(missed > 0);
    CHECK(std::abs(near_error) < 0.1 * missed);
    CHECK(std::abs(far_error) < 0.2 * missed);
  }

  TEST_CASE("product_codes: blocks are copied whole, lane by lane") {
    cairn::Random random(cairn_test::seed(93));
    const Cell cell("uniform", 40, 32, random);
    detail::CodeBlocks turned = cell.blocks.of_size(2);
    for (std::size_t i = 0; i < 32; ++i) turned.copy_from(cell.blocks, i, 31 - i);
    detail::CodeTables tables;
    const auto query = drawn("uniform", 40, random);
    cell.codebook.make_tables(query.data(), tables);
    const auto scale = cell.blocks.scale(1000, tables);
    std::vector<float> there(32), back(32);
    cell.blocks.estimates(0, 2, tables, scale, there.data());
    turned.estimates(0, 2, tables, scale, back.data());
    const auto reversed = [](std::uint32_t bits) {
      std::uint32_t result = 0;
      for (unsigned i = 0; i < 16; ++i) result |= (bits >> i & 1U) << (15 - i);
      return result;
    };
    // Verdicts also hang on what each code misses: some points are possible, by some limits.
    std::size_t possible = 0;
    for (float below = 1; below < 1e7F; below *= 1.25F) {
      const float proven = 2 * std::sqrt(below);
      std::array<detail::CodeVerdict, 2> of_there{}, of_back{};
      cell.blocks.verdicts(0, 2, there.data(), {0.5F * proven, proven, 0, below}, of_there.data());
      turned.verdicts(0, 2, back.data(), {0.5F * proven, proven, 0, below}, of_back.data());
      for (std::size_t block = 0; block < 2; ++block) {
        CHECK(of_there[block].possible == reversed(of_back[1 - block].possible));
        CHECK(of_there[block].likely == reversed(of_back[1 - block].likely));
        possible += static_cast<std::size_t>(std::popcount(unsigned{of_there[block].possible}));
      }
    }
    CHECK(possible > 0);
    std::reverse(back.begin(), back.end());
    CHECK(there == back);
  }
}

}  // namespace product_codes_test
