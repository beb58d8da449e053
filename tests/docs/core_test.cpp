// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The examples in the headers of cairn/core, compiled and run: see CMakeLists.txt.
#include <array>
#include <span>

#include <doctest/doctest.h>

#include <cairn/core/symmetric_eigen.hpp>

namespace docs_core_test {

TEST_CASE("docs: the example of symmetric_eigen.hpp finds both eigenvalues") {
#include "snippets/core/symmetric_eigen_1.inc"
  CHECK(values[0] == doctest::Approx(3));
  CHECK(values[1] == doctest::Approx(1));
}

}  // namespace docs_core_test
