// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstdint>
#include <limits>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/io/binary_file.hpp>

namespace binary_file_test {

using cairn::BinaryReader;
using cairn::BinaryWriter;

TEST_SUITE("binary_file") {
  TEST_CASE("binary_file: the bytes are what the table says, worked out by hand") {
    BinaryWriter out;
    out.put(std::uint16_t{0x0201});
    const std::string bytes = out.file("hand    ", 7);
    REQUIRE(bytes.size() == 34);
    CHECK(bytes.substr(0, 16) == std::string("hand    \x07\0\0\0\0\0\0\0", 16));
    CHECK(bytes.substr(16, 8) == std::string("\x02\0\0\0\0\0\0\0", 8));
    CHECK(bytes.substr(32) == "\x01\x02");
    std::uint64_t hash = 14695981039346656037ULL;
    for (const char byte : bytes.substr(8, 16) + bytes.substr(32))
      hash = (hash ^ static_cast<std::uint8_t>(byte)) * 1099511628211ULL;
    for (unsigned i = 0; i < 8; ++i)
      CHECK(static_cast<std::uint8_t>(bytes[24 + i]) == (hash >> (8 * i) & 0xffU));
  }

  TEST_CASE("binary_file: numbers come out as they went in") {
    BinaryWriter out;
    out.put(-1.5);
    out.put(std::numeric_limits<std::int8_t>::min());
    out.put(2.5F);
    out.put(std::numeric_limits<std::uint64_t>::max());
    out.put(std::numeric_limits<double>::infinity());
    const std::string bytes = out.file("numbers ", 1);
    BinaryReader in(bytes, "numbers ", 1, "it");
    CHECK(in.finite() == -1.5);
    CHECK(in.get<std::int8_t>() == -128);
    CHECK(in.get<float>() == 2.5F);
    CHECK_THROWS_WITH_AS(in.expect_end(), "it: the file has more numbers than it says", cairn::Error);
    CHECK(in.get<std::uint64_t>() == std::numeric_limits<std::uint64_t>::max());
    CHECK_THROWS_WITH_AS(static_cast<void>(in.finite()), "it: a number is not finite", cairn::Error);
    in.expect_end();
    CHECK(in.left() == 0);
    CHECK_THROWS_WITH_AS(static_cast<void>(in.get<char>()), "it: the file has fewer numbers than it says",
                         cairn::Error);
  }

  TEST_CASE("binary_file: a count is no more than the rest can hold") {
    BinaryWriter out;
    out.put(std::uint32_t{2});
    out.put(std::int32_t{-1});
    out.put(std::uint32_t{1});
    out.put(std::uint32_t{0});
    const std::string bytes = out.file("counts  ", 1);
    BinaryReader in(bytes, "counts  ", 1, "it");
    CHECK(in.count<std::uint32_t>(6) == 2);
    CHECK_THROWS_WITH_AS(static_cast<void>(in.count<std::int32_t>(1)),
                         "it: the file promises more than it holds", cairn::Error);
    CHECK(in.count<std::uint32_t>(4) == 1);
    CHECK(in.count<std::uint32_t>(4) == 0);
  }

  TEST_CASE("binary_file: every bit counts") {
    BinaryWriter out;
    for (int i = 0; i < 10; ++i) out.put(0.1 * i);
    const std::string bytes = out.file("every   ", 1);
    for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
      std::string other = bytes;
      other[bit / 8] = static_cast<char>(other[bit / 8] ^ (1 << bit % 8));
      CHECK_THROWS_AS(BinaryReader(other, "every   ", 1, "it"), cairn::Error);
    }
    for (std::size_t size = 0; size < bytes.size(); ++size)
      CHECK_THROWS_AS(BinaryReader(bytes.substr(0, size), "every   ", 1, "it"), cairn::Error);
  }
}

}  // namespace binary_file_test
