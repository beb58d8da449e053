// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include <cairn/filter/status.hpp>

#include "support/explained.hpp"

namespace status_test {
namespace {

TEST_CASE("every status has a sentence of its own") {
  CHECK(cairn_test::sentences<cairn::Status>() == static_cast<int>(cairn::Status::unknown_block) + 1);
}

}  // namespace
}  // namespace status_test
