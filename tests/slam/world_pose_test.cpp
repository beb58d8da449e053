// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/slam/world_pose.hpp>

#include "support/random.hpp"

namespace world_pose_test {

using cairn::SE3;
using cairn::Vector;
using cairn::WorldPose;

Vector<6> step(cairn::Random& random, double size) {
  Vector<6> d;
  for (int i = 0; i < 6; ++i) d(i) = size * random.normal();
  return d;
}

TEST_SUITE("world_pose") {
  static_assert(cairn::Manifold<WorldPose>);

  TEST_CASE("world_pose: the step between two poses leads from one to the other") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int i = 0; i < 100; ++i) {
      const WorldPose x{SE3::exp(step(random, 0.7))};
      const Vector<6> d = step(random, 0.3);
      const WorldPose y = cairn::retract(x, d);
      CHECK((cairn::local(x, y) - d).norm() < 1e-12);
      CHECK((y.T_world_body.matrix() - (SE3::exp(d) * x.T_world_body).matrix()).norm() < 1e-12);
    }
  }

  TEST_CASE("world_pose: points move with a step of the world as its derivative says") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int i = 0; i < 100; ++i) {
      const Vector<3> x(random.normal(), 5 * random.normal(), 3 * random.normal());
      const Vector<6> xi = step(random, 1e-6);
      const Vector<3> moved = SE3::exp(xi) * x - x;
      CHECK((moved - cairn::moved_with_world(x, xi.data())).norm() < 1e-9 * (1 + x.norm()));
    }
  }

  TEST_CASE("world_pose: a covariance seen from the body is that of right steps, by sampling") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const SE3 T = SE3::exp(step(random, 1));
    cairn::Matrix<6> root;
    for (int j = 0; j < 6; ++j)
      for (int i = 0; i < 6; ++i) root(i, j) = 1e-4 * random.normal();
    const cairn::Matrix<6> expected = cairn::seen_from_body(cairn::product_transposed(root, root), T);
    cairn::Matrix<6> sum = cairn::Matrix<6>::Zero();
    constexpr int samples = 20000;
    for (int i = 0; i < samples; ++i) {
      const SE3 drawn = SE3::exp(cairn::product(root, step(random, 1))) * T;
      const Vector<6> right = cairn::local(T, drawn);
      sum += cairn::product_transposed(right, right) / samples;
    }
    CHECK((sum - expected).norm() < 0.05 * expected.norm());
  }
}

}  // namespace world_pose_test
