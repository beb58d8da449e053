// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The examples in the headers of cairn/core, compiled and run: see CMakeLists.txt.
#include <array>
#include <cmath>
#include <span>

#include <doctest/doctest.h>

#include <cairn/core/ode.hpp>
#include <cairn/core/symmetric_eigen.hpp>

namespace docs_core_test {

TEST_CASE("docs: the example of symmetric_eigen.hpp finds both eigenvalues") {
#include "snippets/core/symmetric_eigen_1.inc"
  CHECK(values[0] == doctest::Approx(3));
  CHECK(values[1] == doctest::Approx(1));
}

TEST_CASE("docs: the pendulum of ode.hpp keeps its energy") {
#include "snippets/core/ode_1.inc"
  CHECK(arrived.arrived);
  CHECK(0.5 * y[1] * y[1] - std::cos(y[0]) == doctest::Approx(-std::cos(1.0)).epsilon(1e-8));
}

}  // namespace docs_core_test
