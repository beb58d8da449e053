// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "board_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace board_calibration_test {
namespace {

using namespace calibrate_stereo;

constexpr int columns = 9, rows = 6;
constexpr double square = 0.025;

cairn::PinholeCamera camera(double f, double cx, double k1) {
  cairn::PinholeParameters p;
  p.fx = f;
  p.fy = 1.01 * f;
  p.cx = cx;
  p.cy = 242;
  p.k1 = k1;
  p.k2 = 0.08;
  p.p1 = 6e-4;
  p.p2 = -4e-4;
  p.width = 640;
  p.height = 480;
  return cairn::PinholeCamera(p);
}

cairn::StereoRig true_rig() {
  return {camera(535, 331, -0.27), camera(538, 325, -0.28),
          cairn::SE3::exp((cairn::Vector<6>() << 0.083, 0.001, -0.0006, 0.005, -0.008, 0.004).finished())};
}

struct Scene {
  std::vector<cairn::SE3> T_left_board;
  std::vector<BoardView> views;
};

/// Views of the board with normal noise on every coordinate; `tilt`: how far it is turned [rad].
Scene scene(cairn::Random& random, std::size_t count, double noise, double tilt = 0.5) {
  const cairn::StereoRig rig = true_rig();
  const auto board = board_points(columns, rows, square);
  Scene result;
  while (result.views.size() < count) {
    cairn::Vector<6> d;
    d << random.uniform(-0.15, 0.05), random.uniform(-0.12, 0.0), random.uniform(0.25, 0.5),
        random.uniform(-tilt, tilt), random.uniform(-tilt, tilt), random.uniform(-tilt, tilt);
    const cairn::SE3 T(cairn::SO3::exp(cairn::Vector<3>(d.tail<3>())), d.head<3>());
    BoardView view{"view " + std::to_string(result.views.size()), {}, {}};
    bool inside = true;
    for (const cairn::Vector<3>& point : board) {
      const auto pixels = rig.project(T * point);
      inside =
          inside && pixels && rig.left.contains(pixels->head<2>()) && rig.right.contains(pixels->tail<2>());
      if (!inside) break;
      view.left.push_back(pixels->head<2>() + noise * cairn::Vector<2>(random.normal(), random.normal()));
      view.right.push_back(pixels->tail<2>() + noise * cairn::Vector<2>(random.normal(), random.normal()));
    }
    if (!inside) continue;
    result.T_left_board.push_back(T);
    result.views.push_back(std::move(view));
  }
  return result;
}

/// A start that is off by as much as a rough calibration.
cairn::StereoRig rough_rig() {
  cairn::StereoRig rig = true_rig();
  rig.left = camera(520, 325, -0.2);
  rig.right = camera(550, 330, -0.2);
  rig.T_left_right = rig.T_left_right * cairn::SE3::exp(cairn::Vector<6>::Constant(0.01));
  return rig;
}

std::array<double, 9> numbers_of(const cairn::PinholeCamera& c) {
  const auto& p = c.parameters();
  return {p.fx, p.fy, p.cx, p.cy, p.k1, p.k2, p.p1, p.p2, p.k3};
}

}  // namespace

TEST_SUITE("board_calibration") {
  TEST_CASE("board_calibration: without noise the true rig comes out, from a rough start") {
    cairn::Random random(1);
    Scene s = scene(random, 8, 0);
    for (cairn::SE3& T : s.T_left_board) T = T * cairn::SE3::exp(cairn::Vector<6>::Constant(0.005));
    const auto board = board_points(columns, rows, square);
    const BoardCalibration c = calibrate(board, s.views, rough_rig(), s.T_left_board);
    CHECK(c.rms < 1e-6);
    const cairn::StereoRig truth = true_rig();
    for (const auto& [a, b] : {std::pair(&truth.left, &c.rig.rig.left), {&truth.right, &c.rig.rig.right}}) {
      const auto m = numbers_of(*a), n = numbers_of(*b);
      for (std::size_t i = 0; i < m.size(); ++i) CHECK(n[i] == doctest::Approx(m[i]).epsilon(1e-5));
    }
    CHECK((c.rig.rig.T_left_right.matrix() - truth.T_left_right.matrix()).cwiseAbs().maxCoeff() < 1e-7);
    for (const HeldOut& one : leave_one_out(board, columns, s.views, c)) {
      CHECK(one.epipolar < 1e-5);
      CHECK(std::abs(one.length) < 1e-6);
    }
  }

  TEST_CASE("board_calibration: errors are as large as the sigmas say, over many calibrations") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const auto board = board_points(columns, rows, square);
    constexpr int runs = 24;
    constexpr double noise = 0.2;
    const cairn::StereoRig truth = true_rig();
    double squares = 0, count = 0, sigma = 0;
    for (int run = 0; run < runs; ++run) {
      cairn::Random random(seed, static_cast<std::uint64_t>(run));
      const Scene s = scene(random, 10, noise);
      const BoardCalibration c = calibrate(board, s.views, true_rig(), s.T_left_board);
      sigma += c.pixel_sigma / runs;
      const auto add = [&](double error, double of) {
        squares += error * error / (of * of);
        ++count;
      };
      for (const bool left : {true, false}) {
        const auto m = numbers_of(left ? truth.left : truth.right),
                   n = numbers_of(left ? c.rig.rig.left : c.rig.rig.right);
        const example::CameraSigmas& of = left ? c.rig.left : c.rig.right;
        for (std::size_t i = 0; i < 9; ++i)
          add(n[i] - m[i], i < 4 ? (*of.intrinsics)[i] : (*of.distortion)[i - 4]);
      }
      const cairn::Vector<6> off = cairn::local(truth.T_left_right, c.rig.rig.T_left_right);
      const cairn::Vector<3> place = c.rig.rig.T_left_right.translation() - truth.T_left_right.translation();
      for (int i = 0; i < 3; ++i) {
        add(off(3 + i), (*c.rig.rotation_sigma)(i));
        add(place(i), (*c.rig.translation_sigma)(i));
      }
      add(c.rig.rig.baseline() - truth.baseline(), c.baseline_sigma);
    }
    CHECK(sigma == doctest::Approx(noise).epsilon(0.02).scale(0));
    // 600 squares of mean 1, those of a run correlated: its scatter is below 0.25.
    CHECK(squares / count > 0.6);
    CHECK(squares / count < 1.5);
  }

  TEST_CASE("board_calibration: a lens of two numbers leaves the others alone") {
    cairn::Random random(2);
    const Scene s = scene(random, 6, 0.1);
    cairn::StereoRig start = true_rig();
    const auto board = board_points(columns, rows, square);
    const BoardCalibration c = calibrate(board, s.views, start, s.T_left_board, {.distortion = 2});
    CHECK(c.rig.rig.left.parameters().p1 == start.left.parameters().p1);
    CHECK(c.rig.rig.left.parameters().k1 != start.left.parameters().k1);
    CHECK((*c.rig.left.distortion)[2] == 0);
    CHECK((*c.rig.left.distortion)[0] > 0);
    CHECK(largest_difference(c, c.rig.rig) == 0);
    cairn::StereoRig moved = c.rig.rig;  // by two of the standard deviations
    moved.T_left_right =
        moved.T_left_right *
        cairn::SE3(cairn::SO3::exp({0, 2 * (*c.rig.rotation_sigma)(1), 0}), cairn::Vector<3>::Zero());
    CHECK(largest_difference(c, moved) == doctest::Approx(2).epsilon(1e-6));
  }

  TEST_CASE("board_calibration: what makes no calibration is refused in words") {
    cairn::Random random(3);
    const auto board = board_points(columns, rows, square);
    const Scene good = scene(random, 4, 0.1), flat = scene(random, 6, 0.1, 0);
    const auto refusal = [&](const Scene& s, const cairn::StereoRig& start) {
      return cairn_test::message_of(
          [&] { static_cast<void>(calibrate(board, s.views, start, s.T_left_board)); });
    };
    CHECK(refusal(good, true_rig()).empty());
    Scene bad = good;
    bad.views.resize(2);
    bad.T_left_board.resize(2);
    CHECK(refusal(bad, true_rig()).starts_with("2 views of the board; expected three"));
    bad = good;
    bad.views[1].right.pop_back();
    CHECK(refusal(bad, true_rig()).starts_with("view 1: expected all 54 points"));
    bad = good;
    bad.views[2].left[5](0) = std::numeric_limits<double>::quiet_NaN();
    CHECK(refusal(bad, true_rig()).starts_with("view 2: a point of the board is not finite"));
    bad = good;
    bad.T_left_board[0] = cairn::SE3({}, {0, 0, -1});
    CHECK(refusal(bad, true_rig()).find("where no camera sees it") != std::string::npos);
    // All boards parallel to the left images: focal length and distance can hardly be told apart, by the
    // right camera's turn alone. That is refused, or said by the focal length's sigma.
    const auto focal_sigma = [&](const Scene& s) {
      try {
        return calibrate(board, s.views, true_rig(), s.T_left_board).rig.left.intrinsics.value()[0];
      } catch (const cairn::Error& error) {
        CHECK(std::string(error.what()).find("the views do not determine") != std::string::npos);
        return std::numeric_limits<double>::infinity();
      }
    };
    CHECK(focal_sigma(flat) > 5 * focal_sigma(scene(random, 6, 0.1)));
  }
}

}  // namespace board_calibration_test
