// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch_bucy.hpp>
#include <cairn/field/patch_filter.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/kalman_bucy.hpp>

#include "field/patch_support.hpp"
#include "support/random.hpp"

using namespace cairn;
using namespace cairn_test;

namespace patch_bucy_test {
namespace {

// The motion and the placement, told in other matrices. Of run-time size the motion may tell of another.
struct MotionAtRunTime : AlongTrackMotion {
  int states = 5;
  [[nodiscard]] Vector<dynamic> rate(const State& x, const Control& u) const {
    Vector<dynamic> all = Vector<dynamic>::Zero(states);
    all.head(std::min(states, 5)) = AlongTrackMotion::rate(x, u).head(std::min(states, 5));
    return all;
  }
  [[nodiscard]] Eigen::Matrix<double, 5, 5, Eigen::RowMajor> rate_jacobian(const State& x,
                                                                           const Control& u) const {
    return AlongTrackMotion::rate_jacobian(x, u);
  }
};
struct PlacementByRows : AlongTrackPlacement {
  [[nodiscard]] Eigen::Matrix<double, 6, 5, Eigen::RowMajor> jacobian(const State& x) const {
    return AlongTrackPlacement::jacobian(x);
  }
};

}  // namespace
}  // namespace patch_bucy_test

TEST_SUITE("patch_bucy") {
  TEST_CASE("patch_bucy: matrices told in other ways are the same, and sizes that do not fit are refused") {
    using patch_bucy_test::MotionAtRunTime;
    using patch_bucy_test::PlacementByRows;
    Random random(5);
    const BsplineMap map = ground(5);
    const std::vector<double> z = frame(map, small, AlongTrackPlacement{}, usual_state, 0.02, random);
    PatchScratch scratch;
    const auto run = [&](Gaussian<Vector<5>>& belief, const auto& motion, const auto& where,
                         const std::vector<double>& seen) {
      return PatchBucy{}.integrate(
          belief, motion, {}, where, map, small, [&](double) { return seen; }, 0.01, 0.0, 0.1, scratch);
    };
    Gaussian<Vector<5>> plain = prior(0.3), told = prior(0.3);
    REQUIRE(run(plain, AlongTrackMotion{{0.01, 1e-5, 1e-5}}, AlongTrackPlacement{}, z) ==
            PatchVerdict::accepted);
    REQUIRE(run(told, MotionAtRunTime{{{0.01, 1e-5, 1e-5}}}, PlacementByRows{}, z) == PatchVerdict::accepted);
    CHECK((told.mean == plain.mean));
    CHECK((told.covariance == plain.covariance));
    Gaussian<Vector<5>> filtered = prior(0.3), filtered_by_rows = prior(0.3);
    const PatchNoise noise(0.01);
    REQUIRE(PatchFilter{}.update(filtered, AlongTrackPlacement{}, map, small, z, noise, scratch).accepted());
    REQUIRE(
        PatchFilter{}.update(filtered_by_rows, PlacementByRows{}, map, small, z, noise, scratch).accepted());
    CHECK((filtered.covariance == filtered_by_rows.covariance));

    Gaussian<Vector<5>> belief = prior(0.3);
    for (const int states : {0, 4, 6})
      CHECK(run(belief, MotionAtRunTime{{}, states}, PlacementByRows{}, z) == PatchVerdict::size_mismatch);
    std::vector<double> shorter(z.begin(), z.end() - 1), longer = z;
    longer.push_back(0.0);
    for (const std::vector<double>& other : {shorter, longer, std::vector<double>{}}) {
      CHECK(run(belief, AlongTrackMotion{}, AlongTrackPlacement{}, other) == PatchVerdict::size_mismatch);
      CHECK(PatchBucy{}.impulse(belief, AlongTrackPlacement{}, map, small, other, 0.01, scratch) ==
            PatchVerdict::size_mismatch);
    }
    CHECK((belief.mean == prior(0.3).mean));
    CHECK((belief.covariance == prior(0.3).covariance));
  }

  TEST_CASE("patch_bucy: a constant slope has a closed form") {
    // f = x: only x_1 + ... is seen. With V known to be 0 the information about x grows as q t / S_0.
    FieldGrid ramp(140, 80, {0, -40, 1, 1});
    for (int r = 0; r < 80; ++r)
      for (int c = 0; c < 140; ++c) ramp(c, r) = ramp.x(c);
    const BilinearMap map(ramp);
    const AlongTrackPlacement where{};
    const PatchShape shape{0, 0, 0};  // one sample
    Gaussian<Vector<5>> belief{usual_state, Vector<5>(4.0, 1e-16, 1e-16, 1e-16, 1e-16).asDiagonal()};
    belief.mean(1) = 0.0;
    PatchScratch scratch;
    const double density = 0.5, duration = 3.0, seen = 61.0;
    const std::vector<double> z{seen};
    REQUIRE(PatchBucy{}.integrate(
                belief, AlongTrackMotion{}, {}, where, map, shape, [&](double) { return z; }, density, 1.0,
                1.0 + duration, scratch) == PatchVerdict::accepted);
    const double information = 1 / 4.0 + duration / density;
    CHECK(belief.covariance(0, 0) == doctest::Approx(1 / information).epsilon(1e-7));
    CHECK(belief.mean(0) == doctest::Approx(seen + (60.0 - seen) * (1 / 4.0) / information).epsilon(1e-9));
  }

  TEST_CASE(
      "patch_bucy: discrete frames approach the continuous filter as the interval falls, at first order") {
    Random random(12);
    const BsplineMap map = ground(12);
    const AlongTrackMotion motion{};
    const AlongTrackPlacement where{};
    const double density = 0.01, duration = 0.8;
    Vector<5> start = usual_state;
    start(0) = 60.2;
    start(1) = 10.1;
    const auto seen = [&](double t) {
      PatchSamples f;
      sample_patch(map, small, where.placement(motion.propagate(start, {}, t)), f);
      return f.value;
    };
    PatchScratch scratch;
    Gaussian<Vector<5>> continuous = prior(0.3);
    REQUIRE(PatchBucy{}.integrate(continuous, motion, {}, where, map, small, seen, density, 0.0, duration,
                                  scratch) == PatchVerdict::accepted);
    double errors[2];
    for (int level = 0; level < 2; ++level) {
      const int frames = level == 0 ? 200 : 400;
      const double dt = duration / frames;
      Gaussian<Vector<5>> discrete = prior(0.3);
      for (int k = 1; k <= frames; ++k) {
        REQUIRE(Kalman{}.predict(discrete, motion, dt) == Status::accepted);
        REQUIRE(PatchFilter{.iterations = 1}
                    .update(discrete, where, map, small, seen(k * dt), PatchNoise(density / dt), scratch)
                    .accepted());
      }
      errors[level] = distance(continuous, discrete);
    }
    CHECK(errors[1] < 0.03);
    CHECK(errors[0] / errors[1] == doctest::Approx(2.0).epsilon(0.15));
  }

  TEST_CASE("patch_bucy: a frame outside is refused, a flat one teaches nothing") {
    const BsplineMap map = ground(3);
    PatchScratch scratch;
    Gaussian<Vector<5>> belief = prior(1.0);
    belief.mean(0) = -500.0;
    const std::vector<double> z(small.size(), 0.0);
    CHECK(PatchBucy{}.impulse(belief, AlongTrackPlacement{}, map, small, z, 0.01, scratch) ==
          PatchVerdict::outside);
    CHECK(belief.mean(0) == -500.0);
    belief = prior(1.0);
    const BsplineMap flat(FieldGrid(140, 80, {0, -40, 1, 1}, 0.0));
    CHECK(PatchBucy{}.impulse(belief, AlongTrackPlacement{}, flat, small, z, 0.01, scratch) ==
          PatchVerdict::accepted);
    CHECK(distance(belief, prior(1.0)) < 1e-9);  // nothing learnt: the covariance stays honest
  }

  TEST_CASE("patch_bucy: equals the filter of filter/ on a frame that is held") {
    Random random(21);
    const BsplineMap map = ground(21);
    const PatchShape shape{1, 1, 1};
    const AlongTrackPlacement where{};
    const AlongTrackMotion motion{{0.01, 1e-5, 1e-5}};
    const double density = 0.02, duration = 0.1;
    const PatchSensor<AlongTrackPlacement, BsplineMap> sensor{where, &map, shape, density};
    const Vector<dynamic> z = sensor.predict(usual_state + Vector<5>(0.3, 0, 0, 0, 0));
    const std::vector<double> held(z.data(), z.data() + z.size());
    PatchScratch scratch;
    Gaussian<Vector<5>> ours = prior(0.3);
    auto information = InformationBelief<Vector<5>>::from(ours);
    REQUIRE(information.has_value());
    REQUIRE(PatchBucy{}.integrate(
                ours, motion, {}, where, map, shape, [&](double) { return held; }, density, 0.0, duration,
                scratch) == PatchVerdict::accepted);
    REQUIRE(KalmanBucy{.steps = 400}.filter(*information, motion, sensor, z, duration) == Status::accepted);
    const auto theirs = information->gaussian();
    REQUIRE(theirs.has_value());
    CHECK(distance(ours, *theirs) < 1e-7);
    std::vector<double> broken = held;
    broken[4] = std::nan("");
    const Gaussian<Vector<5>> before = ours;
    CHECK(PatchBucy{}.impulse(ours, where, map, shape, broken, density, scratch) == PatchVerdict::not_finite);
    CHECK((ours.mean == before.mean));
  }
}
