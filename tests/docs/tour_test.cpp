// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <iostream>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/statistics.hpp>
#include <cairn/filter/diagnosis.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

namespace docs_tour_test {

TEST_CASE("docs: the tour's first filter, and what it refuses") {
#include "snippets/docs/tour_1.inc"
  CHECK(moved == cairn::Status::accepted);
  CHECK(seen.accepted());
  CHECK(belief.mean(0) > 97);
  CHECK(belief.mean(0) < 98);
#include "snippets/docs/tour_2.inc"
  CHECK(outlier.status == cairn::Status::gated);
  CHECK(cairn::explain(backwards, belief, motion, -1.0) ==
        "refused: the time step is negative or not finite: dt is -1");
}

#include "snippets/docs/tour_3.inc"

TEST_CASE("docs: the tour's compass goes the short way round") {
#include "snippets/docs/tour_4.inc"
  CHECK(turned.residual(0) == doctest::Approx(2 * 3.14159265358979 - 6.2));
}

TEST_CASE("docs: the tour's trees") {
#include "snippets/docs/tour_5.inc"
  CHECK(nearest->id == 1);
  CHECK(two.size() == 2);
  CHECK(close.size() == 2);
#include "snippets/docs/tour_6.inc"
  CHECK(map.size() == 4);
  CHECK(map.nearest(here)->id == 1);
}

}  // namespace docs_tour_test
