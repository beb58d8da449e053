// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// cairn.hpp: all folders in one file, used side by side.
#include <array>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/cairn.hpp>

namespace everything_cairn_test {

TEST_SUITE("cairn") {
  TEST_CASE("cairn.hpp: one include line is enough for every folder") {
    const cairn::ConstantVelocity<2> motion{.density = 0.1};
    const cairn::PositionSensor<2, 4> gps{.covariance = cairn::Matrix<2>::Identity()};
    cairn::Gaussian<cairn::Vector<4>> belief{cairn::Vector<4>::Zero(), cairn::Matrix<4>::Identity()};
    const cairn::Kalman filter{.gate = cairn::chi_square_quantile(0.999, 2)};
    REQUIRE(filter.predict(belief, motion, 0.1) == cairn::Status::accepted);
    const auto innovation = filter.update(belief, gps, cairn::Vector<2>(1.0, 0.5));
    CHECK(innovation.accepted());
    CHECK(
        cairn::automatic_jacobian([](const auto& x) { return x; }, cairn::Vector<2>(1.0, 2.0)).isIdentity());

    const std::vector<std::array<float, 2>> points{{0, 0}, {1, 0}, {0, 2}};
    CHECK(cairn::KdTree<float, 2>(points).nearest(std::array{0.9F, 0.1F}, 1).at(0).id == 1);
    const cairn::FieldGrid grid(8, 8, {}, 3.0);
    CHECK(cairn::BilinearMap(grid).at(2.5, 2.5)->value == doctest::Approx(3.0));

    const cairn::PinholeCamera camera({.fx = 400, .fy = 400, .cx = 320, .cy = 240});
    const cairn::StereoRig rig(camera, camera, cairn::SE3(cairn::SO3(), cairn::Vector<3>(0.2, 0, 0)));
    const cairn::Vector<3> seen(0.1, -0.2, 4);
    const auto pixels = rig.project(seen);
    REQUIRE(pixels);
    CHECK(pixels->rows() == 4);
    const cairn::Image black(8, 8, 0);
    CHECK(cairn::IntegralImage(black).width() == 8);
    CHECK(cairn::parse_number<int>("12") == 12);
  }
}

}  // namespace everything_cairn_test
