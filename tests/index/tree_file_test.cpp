// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/tree_file.hpp>

#include "index/generators.hpp"
#include "support/folder.hpp"
#include "support/made_up_file.hpp"
#include "support/random.hpp"

namespace tree_file_test {
namespace {

using Tree = cairn::KdTree<float, 3>;

template <class T>
std::string saved(const T& tree) {
  std::ostringstream out;
  cairn::save_tree(out, tree);
  return out.str();
}

template <class T = Tree>
std::string refusal(const std::string& bytes) {
  return cairn_test::message_of([&] {
    std::istringstream in(bytes);
    static_cast<void>(cairn::load_tree<T>(in, "a.tree"));
  });
}

/// The file with other numbers in it and the checksum that belongs to them.
std::string signed_anew(std::string bytes) {
  cairn_test::sign(bytes, 32);
  return bytes;
}
template <class Number>
std::string with(std::string bytes, std::size_t at, Number number) {
  std::memcpy(bytes.data() + at, &number, sizeof(number));
  return signed_anew(std::move(bytes));
}

Tree make_tree(std::size_t count) {
  cairn::Random random(7);
  const auto numbers = cairn_test::make_points<float>("uniform", count, 3, random);
  std::vector<cairn::PointId> ids;
  for (std::size_t i = 0; i < count; ++i) ids.push_back(static_cast<cairn::PointId>(3 * i + 5));
  return Tree(cairn::Rows<float>(numbers, 3), ids);
}

}  // namespace

TEST_SUITE("tree_file") {
  TEST_CASE("tree_file: a loaded tree answers with the ids and distances of the saved one") {
    for (const std::size_t count : {std::size_t{1}, std::size_t{17}, std::size_t{2000}}) {
      const Tree tree = make_tree(count);
      std::istringstream in(saved(tree));
      const Tree loaded = cairn::load_tree<Tree>(in, "memory");
      REQUIRE(loaded.size() == count);
      cairn::Random random(3);
      for (int i = 0; i < 50; ++i) {
        const auto query = cairn_test::make_points<float>("uniform", 1, 3, random);
        CHECK(loaded.nearest(query, 5) == tree.nearest(query, 5));
      }
    }
    std::istringstream in(saved(Tree()));
    CHECK(cairn::load_tree<Tree>(in, "memory").empty());
  }

  TEST_CASE("tree_file: any byte changed, or the file cut anywhere, is noticed") {
    const std::string bytes = saved(make_tree(40));
    for (std::size_t at = 0; at < bytes.size(); ++at) {
      CAPTURE(at);
      std::string damaged = bytes;
      for (const int flip : {0x10, 0x01, 0x80, 0xff}) {
        damaged[at] = static_cast<char>(bytes[at] ^ flip);
        CHECK(refusal(damaged).find("a.tree: ") == 0);
        CHECK(refusal<cairn::KdTree<float>>(damaged).find("a.tree: ") == 0);
      }
      CHECK(refusal(bytes.substr(0, at)).find("a.tree: ") == 0);
    }
  }

  TEST_CASE("tree_file: sizes that fit the bytes but are not those saved are noticed") {
    const std::string bytes = saved(make_tree(40));  // 40 (1 + 3) numbers
    std::string other = bytes;
    other[16] = 4;  // 32 (1 + 4) are as many
    other[24] = 32;
    CHECK(refusal<cairn::KdTree<float>>(other).find("the checksum is wrong") != std::string::npos);
  }

  TEST_CASE("tree_file: a file of random bytes behind a good beginning is refused, without much memory") {
    cairn::Random random(cairn_test::seed(91));
    const std::string bytes = saved(make_tree(40));
    for (int round = 0; round < 3000; ++round) {
      std::string damaged = bytes.substr(0, 12 + random.below(bytes.size() - 12));
      const std::size_t changes = 1 + random.below(20);
      for (std::size_t i = 0; i < changes; ++i) {
        const std::size_t at = 12 + random.below(damaged.size() + 40 - 12);
        const auto byte = static_cast<char>(random.below(256));
        if (at < damaged.size())
          damaged[at] = byte;
        else
          damaged.push_back(byte);
      }
      if (damaged == bytes) continue;
      REQUIRE(refusal<cairn::KdTree<float>>(damaged).find("a.tree: ") == 0);
    }
  }

  TEST_CASE(
      "tree_file: ids and coordinates that no tree can have are refused, though the checksum is right") {
    const std::string bytes = saved(make_tree(40));
    constexpr std::size_t ids = 40, rows = 40 + 4 * 40;
    std::uint32_t first = 0;
    std::memcpy(&first, bytes.data() + ids, 4);
    CHECK(refusal(signed_anew(bytes)).empty());
    CHECK(refusal(with(bytes, ids + 4 * 7, std::uint32_t{2})).empty());
    CHECK(refusal(with(bytes, ids + 4 * 7, cairn::no_point)) ==
          "a.tree: point 7 has the id 4294967295, expected one that no other point has and that is below "
          "4294967295");
    CHECK(refusal(with(bytes, ids + 4 * 39, first)).find("a.tree: point 39 has the id") == 0);
    const std::string sparse = with(bytes, ids, 4000000000U);
    CHECK(refusal(sparse).empty());
    CHECK(refusal(with(sparse, ids + 4 * 3, 4000000000U)).find("a.tree: point 3 has the id 4000000000") == 0);
    for (const float bad :
         {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1e30F})
      CHECK(refusal(with(bytes, rows + 4 * (3 * 9 + 2), bad)).find("a.tree: point 9, coordinate 2 is") == 0);
    const std::string of_dimension_0 = with(bytes.substr(0, rows), 16, std::uint64_t{0});
    CHECK(refusal<cairn::KdTree<float>>(of_dimension_0) == "a.tree: dimension 0, expected at least 1");
  }

  TEST_CASE("tree_file: trees of other coordinates come back too") {
    const std::vector<std::array<double, 2>> doubles{{691607.00, 5334762.00}, {691607.02, 5334762.00}};
    const std::vector<std::array<std::int16_t, 2>> words{{-32768, 32767}, {3, 4}};
    std::ostringstream out;
    cairn::save_tree(out, cairn::KdTree<double, 2>(doubles));
    cairn::save_tree(out, cairn::KdTree<std::int16_t, 2>(words));
    std::istringstream in(out.str());
    CHECK(cairn::load_tree<cairn::KdTree<double, 2>>(in, "memory").nearest(doubles[1])->id == 1);
    CHECK(cairn::load_tree<cairn::KdTree<std::int16_t, 2>>(in, "memory").nearest(words[0])->distance == 0);
  }

  TEST_CASE("tree_file: numbers of one kind are not read as those of another that has as many bytes") {
    const std::vector<std::array<int, 3>> points{{1, 2, 3}, {4, 5, 6}};
    const std::string floats = saved(cairn::KdTree<float, 3>(points));
    const std::string wholes = saved(cairn::KdTree<std::int32_t, 3>(points));
    const std::string naturals = saved(cairn::KdTree<std::uint32_t, 3>(points));
    CHECK(refusal<cairn::KdTree<float, 3>>(wholes) ==
          "a.tree: coordinates of 4 bytes (whole numbers), expected 4 bytes");
    CHECK(refusal<cairn::KdTree<std::int32_t, 3>>(naturals) ==
          "a.tree: coordinates of 4 bytes (whole numbers from 0 on), expected 4 bytes (whole numbers)");
    CHECK(refusal<cairn::KdTree<std::uint32_t, 3>>(floats) ==
          "a.tree: coordinates of 4 bytes, expected 4 bytes (whole numbers from 0 on)");
    CHECK(refusal<cairn::KdTree<std::int8_t>>(saved(cairn::KdTree<std::uint8_t>(points))) ==
          "a.tree: coordinates of 1 bytes (whole numbers from 0 on), expected 1 bytes (whole numbers)");
    CHECK(refusal<cairn::KdTree<std::uint32_t, 3>>(naturals).empty());
    CHECK(refusal<cairn::KdTree<std::int32_t, 3>>(wholes).empty());
  }

  // Else it meets nothing but the refusals at the beginning of a file.
  TEST_CASE("tree_file: the fuzz target begins with trees that are read") {
    const auto corpus = std::filesystem::path(__FILE__).parent_path().parent_path() / "fuzz/corpus/tree_file";
    const auto refused = [&]<class T>(const char* name, T) {
      std::ifstream in(corpus / name, std::ios::binary);
      in.get();  // which kind of tree
      std::ostringstream bytes;
      bytes << in.rdbuf();
      return refusal<T>(signed_anew(bytes.str()));
    };
    CHECK(refused("floats_of_3", cairn::KdTree<float, 3>()) == "");
    CHECK(refused("floats", cairn::KdTree<float>()) == "");
    CHECK(refused("doubles", cairn::KdTree<double>()) == "");
    CHECK(refused("bytes", cairn::KdTree<std::uint8_t>()) == "");
    CHECK(refused("shorts", cairn::KdTree<std::int16_t>()) == "");
    CHECK(refused("integers_of_2", cairn::KdTree<std::int32_t, 2>()) == "");
  }

  TEST_CASE("tree_file: what is foreign is refused by what it is") {
    const std::string bytes = saved(make_tree(40));
    CHECK(refusal("PLY").find("not a cairn tree file") != std::string::npos);
    std::string newer = bytes;
    newer[8] = 2;
    CHECK(refusal(newer).find("version 2 of the tree format, expected 1") != std::string::npos);
    CHECK(refusal<cairn::KdTree<double, 3>>(bytes).find("coordinates of 4 bytes, expected 8") !=
          std::string::npos);
    CHECK(refusal<cairn::KdTree<float, 2>>(bytes).find("dimension 3, expected 2") != std::string::npos);
    std::string promising = bytes.substr(0, 60);
    promising[27] = static_cast<char>(0x7f);  // two thousand million points, and 20 bytes of them
    CHECK(refusal(promising).find("ends early") != std::string::npos);
  }
}

}  // namespace tree_file_test
