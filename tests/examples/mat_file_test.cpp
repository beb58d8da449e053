// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Files that are put together here byte by byte, as the format's document has it. Logs that MATLAB wrote are
// read by the tests of filter and fastslam.
#include "support/mat_file.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/folder.hpp"
#include "support/matlab_file.hpp"

namespace mat_file_test {
namespace {

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}
std::string word(std::uint32_t value) {
  return bytes_of<std::uint32_t>({value});
}
std::string element(std::uint32_t type, std::string bytes) {
  const std::string head = word(type) + word(static_cast<std::uint32_t>(bytes.size()));
  if (type != 15) bytes.resize((bytes.size() + 7) / 8 * 8, '\0');
  return head + bytes;
}
/// In one word and another.
std::string small_element(std::uint32_t type, std::string bytes) {
  const std::string head = word(type | static_cast<std::uint32_t>(bytes.size() << 16U));
  bytes.resize(4, '\0');
  return head + bytes;
}
std::string array(const std::string& name, std::uint32_t flags, const std::vector<std::int32_t>& sizes,
                  const std::string& inside) {
  return element(14,
                 element(6, word(flags) + word(0)) + element(5, bytes_of(sizes)) + element(1, name) + inside);
}
std::string header() {
  std::string text = "MATLAB 5.0 MAT-file, for a test";
  text.resize(124, ' ');
  return text + std::string("\0\1IM", 4);
}

class Files {
public:
  example::MatFile of(const std::string& bytes) const {
    folder_.put("given.mat", bytes);
    return example::MatFile(folder_ / "given.mat");
  }
  /// What is said of such a file, or of its array x.
  std::string complaint(const std::string& bytes) const {
    try {
      static_cast<void>(of(bytes).finite("x"));
    } catch (const cairn::Error& error) {
      return error.what();
    }
    return "";
  }
  bool refused(const std::string& arrays, const std::string& words) const {
    const std::string said = complaint(header() + arrays);
    CAPTURE(said);
    CHECK(said.find("given.mat: expected") != std::string::npos);
    return said.find(words) != std::string::npos;
  }

private:
  cairn_test::Folder folder_;
};

constexpr std::uint32_t is_cell = 1, is_text = 4, is_double = 6, is_single = 7, is_complex = 0x800;

}  // namespace

TEST_SUITE("examples/mat_file") {
  TEST_CASE("mat file: numbers of every type, column by column, are read as they were written") {
    const Files files;
    const auto numbers = [&](const std::string& inside, std::int32_t count) {
      return files.of(header() + array("x", is_double, {count, 1}, inside))["x"].numbers;
    };
    CHECK(numbers(element(1, bytes_of<std::int8_t>({-3, 100})), 2) == std::vector<double>{-3, 100});
    CHECK(numbers(small_element(2, bytes_of<std::uint8_t>({200, 7, 9})), 3) ==
          std::vector<double>{200, 7, 9});
    CHECK(numbers(small_element(3, bytes_of<std::int16_t>({-300})), 1) == std::vector<double>{-300});
    CHECK(numbers(element(4, bytes_of<std::uint16_t>({60000, 1, 2})), 3) == std::vector<double>{60000, 1, 2});
    CHECK(numbers(element(5, bytes_of<std::int32_t>({-70000})), 1) == std::vector<double>{-70000});
    CHECK(numbers(element(6, bytes_of<std::uint32_t>({4000000000U})), 1) == std::vector<double>{4e9});
    CHECK(numbers(element(7, bytes_of<float>({0.5F, -2})), 2) == std::vector<double>{0.5, -2});
    CHECK(numbers(element(9, bytes_of<double>({1e-300, 3})), 2) == std::vector<double>{1e-300, 3});
    CHECK(numbers(element(12, bytes_of<std::int64_t>({-5000000000})), 1) == std::vector<double>{-5e9});
    CHECK(numbers(element(13, bytes_of<std::uint64_t>({5000000000U})), 1) == std::vector<double>{5e9});
    CHECK(numbers(element(9, ""), 0).empty());
    const example::MatFile file = files.of(
        header() + array("first", is_single, {2, 3}, element(9, bytes_of<double>({1, 2, 3, 4, 5, 6}))) +
        array("x", is_double, {1, 1}, small_element(5, word(8))));
    CHECK(file["first"].sizes == std::vector<std::size_t>{2, 3});
    CHECK(file["first"](1, 2) == 6);
    CHECK(file["first"](0, 1) == 3);
    CHECK(file["x"].numbers == std::vector<double>{8});
    CHECK(files.of(cairn_test::matlab_file({{"a", {1, 2}}, {"b", {}}})).finite("a") ==
          std::vector<double>{1, 2});
  }

  TEST_CASE("mat file: cells are their numbers in turn; texts and complex numbers are passed over") {
    const Files files;
    const std::string one = array("", is_double, {1, 2}, element(9, bytes_of<double>({1, 2}))),
                      two = array("", is_double, {1, 1}, element(9, bytes_of<double>({3})));
    const std::string text = array("t", is_text, {1, 2}, element(16, "ab"));
    const std::string complex = array("z", is_double | is_complex, {1, 1},
                                      element(9, bytes_of<double>({1})) + element(9, bytes_of<double>({2})));
    const example::MatFile file = files.of(header() + text + array("c", is_cell, {1, 2}, one + two) +
                                           complex + array("mixed", is_cell, {1, 2}, one + text));
    CHECK(file["c"].numbers == std::vector<double>{1, 2, 3});
    CHECK(file["c"].sizes == std::vector<std::size_t>{1, 2});
    for (const char* none : {"t", "z", "mixed"}) CHECK_THROWS_AS(static_cast<void>(file[none]), cairn::Error);
    const auto nested = [&](int depth) {
      std::string inside = two;
      for (int i = 0; i < depth; ++i) inside = array("x", is_cell, {1, 1}, inside);
      return inside;
    };
    CHECK(files.of(header() + nested(8))["x"].numbers == std::vector<double>{3});
    CHECK(files.refused(nested(9), "eight deep"));
  }

#ifdef EXAMPLES_HAVE_ZLIB
  TEST_CASE("mat file: deflated arrays are those that were deflated") {
    const Files files;
    std::vector<double> many(5000, 7);  // shrinks to less than an eighth
    many[4999] = -1;
    const auto deflated = [](const std::string& plain) {
      std::string bytes(compressBound(plain.size()), '\0');
      uLongf size = bytes.size();
      REQUIRE(compress(reinterpret_cast<Bytef*>(bytes.data()), &size,
                       reinterpret_cast<const Bytef*>(plain.data()), plain.size()) == Z_OK);
      return element(15, bytes.substr(0, size));
    };
    const std::string plain = array("x", is_double, {5000, 1}, element(9, bytes_of(many)));
    const example::MatFile file = files.of(
        header() + deflated(plain) + deflated(array("y", is_double, {1, 1}, small_element(5, word(2)))));
    CHECK(file["x"].numbers == many);
    CHECK(file["y"].numbers == std::vector<double>{2});
    CHECK(files.refused(element(15, "neither this nor that"), "can be inflated"));
    CHECK(files.refused(deflated("short"), "elements that end"));
    const std::string whole = deflated(plain);
    CHECK(files.refused(element(15, whole.substr(8, 20)), "can be inflated"));
  }
#endif

  TEST_CASE("mat file: what is no such file is refused in words that say what was expected") {
    const Files files;
    CHECK(files.complaint("").find("given.mat: expected a MATLAB file of level 5") != std::string::npos);
    std::string other = header();
    std::swap(other[126], other[127]);  // big-endian
    CHECK(files.complaint(other).find("little-endian") != std::string::npos);
    CHECK(files.refused("", "an array x"));
    CHECK(files.refused("abc", "elements that end"));
    CHECK(files.refused(element(9, bytes_of<double>({1})), "arrays and nothing else"));
    const std::string good = array("x", is_double, {2, 1}, element(9, bytes_of<double>({1, 2})));
    for (std::size_t size = 1; size < good.size(); ++size)
      CHECK_FALSE(files.complaint(header() + good.substr(0, size)).empty());
    CHECK(files.complaint(header() + good) == "");
    CHECK(files.refused(array("x", is_double, {3, 1}, element(9, bytes_of<double>({1, 2}))), "sizes say"));
    CHECK(
        files.refused(array("x", is_double, {-2, 1}, element(9, bytes_of<double>({1, 2}))), "not negative"));
    CHECK(files.refused(array("x", is_double, {1, 1}, element(9, "1234")), "whole numbers of bytes"));
    CHECK(files.refused(array("x", is_double, {1, 1}, element(77, "12345678")), "of a type"));
    CHECK(
        files.refused(array("x", is_double, {1, 1}, element(9, bytes_of<double>({NAN}))), "finite numbers"));
    CHECK(files.refused(element(14, element(6, "")), "flags of an array"));
    CHECK(files.refused(array("x", is_double, {1, 1}, word(9U | (5U << 16U)) + word(0)), "up to four bytes"));
    CHECK(files.refused(array("x", is_cell, {1, 1}, element(9, bytes_of<double>({1}))), "nothing else"));
  }
}

}  // namespace mat_file_test
