// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include <cairn/field/correlation.hpp>
#include <cairn/field/patch.hpp>

#include "support/explained.hpp"

namespace explain_test {
namespace {

TEST_CASE("every status has a sentence of its own") {
  CHECK(cairn_test::sentences<cairn::PatchVerdict>() ==
        static_cast<int>(cairn::PatchVerdict::size_mismatch) + 1);
  CHECK(cairn_test::sentences<cairn::FixVerdict>() == static_cast<int>(cairn::FixVerdict::at_rim) + 1);
}

}  // namespace
}  // namespace explain_test
