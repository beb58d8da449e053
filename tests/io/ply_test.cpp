// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/io/ply.hpp>

#include "support/folder.hpp"

TEST_SUITE("ply") {
  TEST_CASE("ply: header and bytes are what the format asks for") {
    const std::vector<float> x{1.0F, -2.5F};
    const std::vector<std::uint8_t> grey{7, 255};
    const std::vector<std::int32_t> age{-1, 65536};
    const std::vector<double> sigma{0.5, 1e-300};
    const std::vector<cairn::PlyProperty> properties{
        {"x", x}, {"grey", grey}, {"age", age}, {"sigma", sigma}};
    const std::vector<std::string> comments{"made by a test"};
    const std::string bytes = cairn::ply_bytes(properties, comments);
    const std::string header =
        "ply\nformat binary_little_endian 1.0\ncomment made by a test\nelement vertex 2\n"
        "property float x\nproperty uchar grey\nproperty int age\nproperty double sigma\nend_header\n";
    REQUIRE(bytes.size() == header.size() + 2 * (4 + 1 + 4 + 8));
    CHECK(bytes.substr(0, header.size()) == header);
    const unsigned char first[] = {0, 0, 0x80, 0x3f, 7, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0, 0, 0, 0xe0, 0x3f};
    CHECK(std::memcmp(bytes.data() + header.size(), first, sizeof first) == 0);
    const unsigned char second[] = {0, 0, 0x20, 0xc0, 255, 0, 0, 1, 0};
    CHECK(std::memcmp(bytes.data() + header.size() + sizeof first, second, sizeof second) == 0);
  }

  TEST_CASE("ply: an empty cloud is a valid file and the file holds the bytes") {
    const cairn_test::Folder folder;
    const std::vector<float> none;
    const std::vector<cairn::PlyProperty> properties{{"x", none}};
    cairn::write_ply(folder / "empty.ply", properties);
    CHECK(cairn::read_file(folder / "empty.ply") == cairn::ply_bytes(properties));
    CHECK(cairn::read_file(folder / "empty.ply").find("element vertex 0\n") != std::string::npos);
    CHECK(cairn_test::message_of([&] {
            cairn::write_ply(folder / "no" / "a.ply", properties);
          }).find("cannot write") != std::string::npos);
  }

  TEST_CASE("ply: a number that is not finite is refused by name, before anything is written") {
    const cairn_test::Folder folder;
    folder.put("old.ply", "of yesterday");
    const float inf = std::numeric_limits<float>::infinity();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::vector<float> fine{1, 2, 3}, broken{1, -inf, 3};
    const std::vector<double> worse{1, 2, nan};
    const auto refusal = [&](const std::vector<cairn::PlyProperty>& properties) {
      return cairn_test::message_of([&] { cairn::write_ply(folder / "old.ply", properties); });
    };
    CHECK(refusal({{"x", fine}, {"y", broken}}).find("property 'y' of point 1") != std::string::npos);
    CHECK(refusal({{"x", fine}, {"sigma", worse}}).find("property 'sigma' of point 2") != std::string::npos);
    CHECK(cairn::read_file(folder / "old.ply") == "of yesterday");
    CHECK(refusal({{"x", fine}}).empty());
  }

  TEST_CASE("ply: columns of unequal size and names with blanks are broken promises") {
    const auto previous = cairn::set_violation_handler(
        [](const cairn::Violation& violation) { throw std::logic_error(violation.sentence); });
    const std::vector<float> two(2), three(3);
    const std::vector<cairn::PlyProperty> unequal{{"x", two}, {"y", three}};
    const std::vector<cairn::PlyProperty> blank{{"my x", two}};
    CHECK_THROWS_AS(static_cast<void>(cairn::ply_bytes(unequal)), std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(cairn::ply_bytes(blank)), std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(cairn::ply_bytes({})), std::logic_error);
    cairn::set_violation_handler(previous);
  }
}
