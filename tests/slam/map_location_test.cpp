// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include <cairn/slam/map_location.hpp>

#include "support/explained.hpp"

namespace map_location_test {

TEST_SUITE("map_location") {
  TEST_CASE("map_location: every status says something else, and nothing is good by itself") {
    CHECK(cairn_test::sentences<cairn::MapLocationStatus>() == 3);
    CHECK_FALSE(cairn::MapLocation().good());
    CHECK(cairn::MapLocation().covariance.isZero(0));
  }
}

}  // namespace map_location_test
