// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The examples in the headers of cairn/io, compiled and run: see CMakeLists.txt.
#include <cstdint>
#include <string>

#include <doctest/doctest.h>

#include <cairn/io/binary_file.hpp>

namespace docs_io_test {

TEST_CASE("docs: the example of binary_file.hpp gets out what it put in") {
#include "snippets/io/binary_file_1.inc"
  CHECK(sum == 4);
}

}  // namespace docs_io_test
