// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch_bucy.hpp>
#include <cairn/field/patch_filter.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/unscented.hpp>

#include "field/patch_support.hpp"
#include "support/random.hpp"

using namespace cairn;
using namespace cairn_test;

TEST_SUITE("patch_model") {
  TEST_CASE_TEMPLATE("patch_model: jacobians of placements and sensors equal numeric ones", Placement,
                     AlongTrackPlacement, PlanarPlacement) {
    using State = typename Placement::State;
    constexpr int n = State::RowsAtCompileTime;
    const BsplineMap map = ground(1);
    Placement where{};
    State x = State::Constant(0.03);
    x(0) = 60.3;
    if constexpr (n == 5) {
      where.y = 2.7;
      x(2) = 1.1;
      x(3) = 0.9;
    } else {
      where.heading = 0.7;
      x(1) = 2.7;
      x(4) = 1.1;
      x(5) = 0.9;
    }
    const PatchSensor<Placement, BsplineMap> sensor{where, &map, small, 0.01};
    const auto H = sensor.jacobian(x);
    REQUIRE(sensor.predict(x).allFinite());
    for (int k = 0; k < n; ++k) {
      const double h = 1e-6;
      State up = x, down = x;
      up(k) += h;
      down(k) -= h;
      const Vector<dynamic> numeric = (sensor.predict(up) - sensor.predict(down)) / (2 * h);
      CHECK((numeric - H.col(k)).cwiseAbs().maxCoeff() < 1e-7);
    }
  }

  TEST_CASE("patch_model: the layout of a frame is the document's") {
    const PatchShape shape{2, 3, 1};  // N' = 2, N'' = 3, M = 1: N = 6, q = 18
    CHECK(shape.size() == 18);
    CHECK(shape.a(0) == -2);  // upper left
    CHECK(shape.b(0) == 1);
    CHECK(shape.a(5) == 3);
    CHECK(shape.a(6) == -2);
    CHECK(shape.b(6) == 0);
    for (int i = 1; i <= 18; ++i) {  // r = floor((i - 1) / N), a = -N' - 1 + i - N r, b = M - r
      const int r = (i - 1) / 6;
      CHECK(shape.a(static_cast<std::size_t>(i - 1)) == -2 - 1 + i - 6 * r);
      CHECK(shape.b(static_cast<std::size_t>(i - 1)) == 1 - r);
    }
  }

  TEST_CASE("patch_filter: five filters agree in the linear regime") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    const BsplineMap map = ground(seed);
    const double factor = 1e-6, noise = 3e-6;
    const AlongTrackMotion motion{};
    const AlongTrackPlacement where{};
    const PatchSensor<AlongTrackPlacement, BsplineMap> sensor{where, &map, small, noise * noise};
    const PatchNoise weights(noise * noise);
    PatchScratch scratch;
    Gaussian<Vector<5>> information = prior(factor), ekf = information, iekf = information, ukf = information,
                        bucy = information;
    Vector<5> truth = sample(information, random);
    for (int k = 0; k < 6; ++k) {
      truth = motion.propagate(truth, {}, 0.1);
      for (auto* belief : {&information, &ekf, &iekf, &ukf, &bucy})
        REQUIRE(Kalman{}.predict(*belief, motion, 0.1) == Status::accepted);
      const std::vector<double> z = frame(map, small, where, truth, noise, random);
      const Vector<dynamic> zv =
          Eigen::Map<const Vector<dynamic>>(z.data(), static_cast<Eigen::Index>(z.size()));
      REQUIRE(PatchFilter{.iterations = 1}
                  .update(information, where, map, small, z, weights, scratch)
                  .accepted());
      REQUIRE(Extended{}.update(ekf, sensor, zv).accepted());
      REQUIRE(Extended{.iterations = 5}.update(iekf, sensor, zv).accepted());
      REQUIRE(Unscented{}.update(ukf, sensor, zv).accepted());
      REQUIRE(PatchBucy{}.impulse(bucy, where, map, small, z, noise * noise, scratch) ==
              PatchVerdict::accepted);
      for (const auto* other : {&ekf, &iekf, &ukf, &bucy}) CHECK(distance(information, *other) < 1e-6);
    }
    CHECK(information.covariance(0, 0) < 0.8 * prior(factor).covariance(0, 0));  // 0.61 at most over 40 seeds
  }
}
