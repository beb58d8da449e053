// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/brute_force.hpp>
#include <cairn/index/descriptor_file.hpp>

#include "index/generators.hpp"
#include "support/folder.hpp"
#include "support/made_up_file.hpp"
#include "support/random.hpp"

namespace descriptor_file_test {
namespace {

constexpr std::size_t dim = 5;
using Points = cairn::Rows<float>;
using Index = cairn::DescriptorIndex<Points>;

std::string saved(const Index& index) {
  std::ostringstream out;
  cairn::save_tree(out, index);
  return out.str();
}
Index loaded(const std::string& bytes, const Points& points,
             const cairn::DescriptorIndexOptions& options = {}) {
  std::istringstream in(bytes);
  return cairn::load_tree<Index>(in, "a.index", points, options);
}
std::string refusal(const std::string& bytes, const Points& points) {
  return cairn_test::message_of([&] { static_cast<void>(loaded(bytes, points)); });
}

/// The file with another number in it and the checksum that belongs to it.
template <class Number>
std::string with(std::string bytes, std::size_t at, Number number) {
  std::memcpy(bytes.data() + at, &number, sizeof(number));
  cairn_test::sign(bytes, 48);
  return bytes;
}

std::vector<float> numbers_of(std::size_t count) {
  cairn::Random random(11);
  return cairn_test::make_points<float>("uniform", count, dim, random);
}

}  // namespace

TEST_SUITE("descriptor_file") {
  TEST_CASE("descriptor_file: a loaded index answers as the saved one, under budgets too, and grows on") {
    const auto numbers = numbers_of(3000);
    const Points half{std::span(numbers).first(1500 * dim), dim}, all(numbers, dim);
    for (const int variant : {0, 1, 2}) {
      const bool changed = variant == 1;
      const auto codes = variant == 2 ? cairn::DescriptorCodes::on : cairn::DescriptorCodes::off;
      Points set = half;
      Index index(set, {.points_in_cell = 24, .codes = codes});
      if (changed) {
        set = Points(std::span(numbers).first(2000 * dim), dim);
        index.insert(1500, 500);
        for (cairn::PointId id = 0; id < 300; ++id) REQUIRE(index.erase(3 * id));
      }
      Index again = loaded(saved(index), all, {.codes = codes});
      REQUIRE(again.coded() == (variant == 2));
      REQUIRE(again.size() == index.size());
      REQUIRE(again.cells() == index.cells());
      cairn::Random random(cairn_test::seed(5));
      for (int i = 0; i < 50; ++i) {
        const auto query = cairn_test::make_points<float>("uniform", 1, dim, random);
        for (const std::size_t leaves : {std::size_t{1}, std::size_t{8}, std::size_t{100000}})
          CHECK(again.nearest(query, 5, {.leaves = leaves}) == index.nearest(query, 5, {.leaves = leaves}));
      }
      again.insert(2000, 1000);
      if (changed) CHECK_FALSE(again.erase(3));
      CHECK(again.nearest(all[2999])->id == 2999);
    }
    const std::vector<float> none;
    const Points nothing(none, dim);
    CHECK(loaded(saved(Index(nothing)), nothing).empty());
  }

  TEST_CASE("descriptor_file: any byte changed, or the file cut anywhere, is noticed") {
    const auto numbers = numbers_of(40);
    const Points points(numbers, dim);
    const std::string bytes = saved(Index(points, {.points_in_cell = 8}));
    for (std::size_t at = 0; at < bytes.size(); ++at) {
      CAPTURE(at);
      for (const int flip : {0x01, 0x80, 0xff}) {
        std::string damaged = bytes;
        damaged[at] = static_cast<char>(bytes[at] ^ flip);
        CHECK(refusal(damaged, points).find("a.index: ") == 0);
      }
      CHECK(refusal(bytes.substr(0, at), points).find("a.index: ") == 0);
    }
  }

  TEST_CASE("descriptor_file: other points are refused, and fewer, and those that are not finite") {
    auto numbers = numbers_of(40);
    const Points points(numbers, dim);
    const std::string bytes = saved(Index(points));
    const Points fewer(std::span<const float>(numbers).first(20 * dim), dim);
    CHECK(refusal(bytes, fewer).find("is none of a set of 20") != std::string::npos);
    const float old = std::exchange(numbers[7], 0.5F * numbers[7] + 1);
    CHECK(refusal(bytes, points) == "a.index: the points are not those of the file");
    numbers[7] = std::numeric_limits<float>::quiet_NaN();
    CHECK(refusal(bytes, points).find("a.index: point 1, coordinate 2 is nan") == 0);
    numbers[7] = old;
    CHECK(refusal(bytes, points).empty());
    const Points wider(numbers, 2 * dim);
    CHECK(refusal(bytes, wider).find("expected 5") != std::string::npos);
  }

  TEST_CASE("descriptor_file: what no index can have is refused though the checksum is right") {
    const auto numbers = numbers_of(40);
    const Points points(numbers, dim);
    const Index index(points, {.points_in_cell = 8});
    const std::string bytes = saved(index);
    const std::size_t sizes = 56 + 4 * dim, ids = sizes + 4 * index.cells(), means = ids + 4 * 40;
    CHECK(refusal("PLY", points) == "a.index: not a cairn file of a descriptor index");
    CHECK(refusal(with(bytes, 8, std::uint32_t{2}), points).find("version 2") != std::string::npos);
    CHECK(refusal(with(bytes, 12, std::numeric_limits<float>::quiet_NaN()), points).find("step is worth") !=
          std::string::npos);
    CHECK(refusal(with(bytes, 12, -1.0F), points).find("step is worth") != std::string::npos);
    CHECK(refusal(with(bytes, 56, std::numeric_limits<float>::infinity()), points).find("not finite") !=
          std::string::npos);
    CHECK(refusal(with(bytes, sizes, std::uint32_t{0}), points).find("none of them empty") !=
          std::string::npos);
    CHECK(refusal(with(bytes, ids, std::uint32_t{4294967295U}), points).find("has the id 4294967295") !=
          std::string::npos);
    CHECK(refusal(with(bytes, 32, std::uint64_t{0}), points).find("cannot be") != std::string::npos);
    CHECK(refusal(with(bytes, 16, std::uint64_t{1} << 40), points).find("at most 16384") !=
          std::string::npos);
    std::string promising = with(bytes, 24, std::uint64_t{4000000000U});
    CHECK(refusal(promising, points).find("ends early") != std::string::npos);

    // A mean somewhere else costs time, not answers.
    const Index strange = loaded(with(bytes, means, std::uint8_t{0}), points);
    const cairn::BruteForce<float> brute(points);
    for (std::size_t i = 0; i < 40; ++i)
      CHECK(strange.nearest(points[i], 3)[2].distance ==
            doctest::Approx(brute.nearest(points[i], 3)[2].distance).epsilon(1e-5));
  }
}

}  // namespace descriptor_file_test
