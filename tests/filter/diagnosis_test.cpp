// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <limits>
#include <string>

#include <doctest/doctest.h>

#include <cairn/filter/diagnosis.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

namespace diagnosis_test {
namespace {

using cairn::Matrix;
using cairn::Status;
using cairn::Vector;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

bool says(const std::string& sentence, const std::string& words) {
  CAPTURE(sentence);
  return sentence.find(words) != std::string::npos;
}

struct World {
  cairn::Gaussian<Vector<4>> belief{Vector<4>::Zero(), 100 * Matrix<4>::Identity()};
  cairn::ConstantVelocity<2> motion{.density = 0.1};
  cairn::PositionSensor<2, 4> gps{.covariance = 4 * Matrix<2>::Identity()};
  Vector<2> z{3, 4};

  std::string updated_by(const cairn::Kalman& filter) {
    const auto innovation = filter.update(belief, gps, z);
    CHECK_FALSE(innovation.accepted());
    return cairn::explain(innovation.status, belief, gps, z);
  }
  std::string predicted(double dt) {
    const Status status = cairn::Kalman{}.predict(belief, motion, dt);
    CHECK(status != Status::accepted);
    return cairn::explain(status, belief, motion, dt);
  }
};

TEST_CASE("diagnosis: says which covariance of an update is none") {
  World world;
  world.gps.covariance << 4, 0, 0, -1;
  world.belief.covariance.setZero();
  CHECK(says(world.updated_by({}), "R, noise(x) of the sensor: the variance in row 1 is negative: -1"));
  world = {};
  world.belief.covariance(1, 1) = -2000;
  CHECK(says(world.updated_by({}), "P, the covariance of the belief: the variance in row 1 is negative"));
}

TEST_CASE(
    "diagnosis: a zero R is named where the belief has no variance either, and where a form divides by it") {
  World world;
  world.gps.covariance.setZero();
  world.belief.covariance.setZero();
  CHECK(says(world.updated_by({}), "R, noise(x) of the sensor: the variance in row 0 is zero"));

  world = {};
  world.gps.covariance.setZero();
  auto information = cairn::InformationBelief<Vector<4>>::from(world.belief);
  REQUIRE(information);
  const auto result = cairn::InformationFilter{}.update(*information, world.gps, world.z);
  REQUIRE_FALSE(result.accepted());
  const auto again = information->gaussian();
  REQUIRE(again);
  CHECK(says(cairn::explain(result.status, *again, world.gps, world.z),
             "refused: a covariance is not positive definite: R, noise(x) of the sensor: the variance in row "
             "0 is zero"));
}

TEST_CASE("diagnosis: a covariance that has an inverse in its rows but not along a diagonal is found") {
  World world;
  world.gps.covariance << 4, 4, 4, 4;
  CHECK(says(cairn::explain(Status::not_positive_definite, world.belief, world.gps, world.z),
             "R, noise(x) of the sensor: it has no variance in some direction"));
  world.gps.covariance << 4, 5, 5, 4;
  CHECK(says(cairn::explain(Status::not_positive_definite, world.belief, world.gps, world.z),
             "R, noise(x) of the sensor: it has a negative variance in some direction"));
  world.gps.covariance << 4, 1, 0, 4;
  CHECK(says(cairn::explain(Status::not_positive_definite, world.belief, world.gps, world.z),
             "R, noise(x) of the sensor: it is not symmetric: 0 and 1"));
}

TEST_CASE("diagnosis: says what is not finite") {
  World world;
  world.z(1) = nan;
  CHECK(says(world.updated_by({}), "the measurement"));
  world = {};
  world.belief.mean(2) = nan;
  CHECK(says(world.updated_by({}), "the mean of the belief"));
  world = {};
  world.belief.covariance(3, 2) = world.belief.covariance(2, 3) = nan;
  CHECK(says(world.predicted(0.1), "P, the covariance of the belief: row 2, column 3 is nan"));
  world = {};
  world.gps.covariance(0, 0) = nan;
  CHECK(says(world.updated_by({}), "R, noise(x) of the sensor: row 0, column 0 is nan"));
}

TEST_CASE("diagnosis: says what a process got wrong, and the time step") {
  World world;
  world.motion.density = -1;
  world.belief.covariance.setZero();
  CHECK(says(world.predicted(0.1), "Q, noise(x, u, dt) of the process"));
  world = {};
  CHECK(says(world.predicted(-0.5), "dt is -0.5"));
}

TEST_CASE(
    "diagnosis: asks a process for the noise that the filters asked for, at the state before the step") {
  struct Walk {
    using State = Vector<1>;
    using Control = cairn::NoControl;
    [[nodiscard]] State propagate(const State& x, const Control&, double) const { return State(x(0) - 10); }
    [[nodiscard]] Matrix<1> jacobian(const State&, const Control&, double) const { return Matrix<1>(1.0); }
    [[nodiscard]] Matrix<1> noise(const State& x, const Control&, double) const { return Matrix<1>(x(0)); }
  };
  cairn::Gaussian<Vector<1>> belief{Vector<1>(-3.0), Matrix<1>(1.0)};
  const Status status = cairn::Extended{}.predict(belief, Walk{}, 1);
  CHECK(says(cairn::explain(status, belief, Walk{}, 1), "the variance in row 0 is negative: -3"));
}

TEST_CASE("diagnosis: adds nothing where there is nothing to add") {
  World world;
  CHECK(cairn::explain(Status::gated, world.belief, world.gps, world.z) == cairn::explain(Status::gated));
  CHECK(cairn::explain(Status::accepted, world.belief, world.motion, 0.1) ==
        cairn::explain(Status::accepted));
}

}  // namespace
}  // namespace diagnosis_test
