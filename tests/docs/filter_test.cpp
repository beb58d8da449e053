// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The examples in the headers of cairn/filter and in docs/filters.md, compiled and, but for the models that
// say what a filter asks for, run: see CMakeLists.txt.
#include <iostream>
#include <map>
#include <optional>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/statistics.hpp>
#include <cairn/filter/diagnosis.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/filter/joint_extended.hpp>
#include <cairn/filter/joint_gaussian.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/kalman_bucy.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/rao_blackwell.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/filter/timeline.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/filter/vectorised.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "filter/planar_slam.hpp"

namespace docs_filter_test {

namespace model {
#include "snippets/filter/model_1.inc"
static_assert(cairn::LinearisedProcess<Unicycle> && cairn::LinearisedMeasurement<Compass>);
}  // namespace model

namespace driven {
#include "snippets/filter/model_2.inc"
static_assert(cairn::DrivenProcess<Driven> && cairn::DrivenMeasurement<Echo>);
}  // namespace driven

namespace rao_blackwell {
#include "snippets/filter/rao_blackwell_1.inc"
static_assert(cairn::ConditionalMeasurement<Sighting>);
}  // namespace rao_blackwell

namespace kalman_bucy {
#include "snippets/filter/kalman_bucy_1.inc"
static_assert(cairn::ContinuousProcess<Drifting>);
}  // namespace kalman_bucy

namespace differentiate {
#include "snippets/filter/differentiate_2.inc"
using Differentiated = decltype(cairn::automatic(Pendulum{}));
static_assert(cairn::LinearisedProcess<Differentiated>);
}  // namespace differentiate

namespace joint {
#include "snippets/filter/joint_extended_1.inc"
static_assert(cairn::LinearisedMeasurement<LandmarkSighting>);
#include "snippets/filter/joint_gaussian_2.inc"
static_assert(cairn::InverseModel<Place>);
}  // namespace joint

namespace filter {
#include "snippets/filter/filter_1.inc"
}  // namespace filter

const cairn::Gaussian<cairn::SE2> planar_prior{cairn::SE2(), 0.01 * cairn::Matrix<3>::Identity()};
const cairn::RangeBearing beacon{.beacon = {5, 1}};
const cairn::Compass compass;

TEST_CASE("docs: the example of filter.hpp steps any filter") {
  const cairn::Gaussian<cairn::Vector<2>> prior{cairn::Vector<2>::Zero(), cairn::Matrix<2>::Identity()};
  auto ud = cairn::UDGaussian<cairn::Vector<2>>::from(prior);
  auto plain = prior;
  const cairn::ConstantVelocity<1> process;
  const cairn::PositionSensor<1, 2> sensor{.covariance = cairn::Matrix<1>(0.25)};
  CHECK(filter::step(cairn::UDFilter{}, ud, process, 0.1, sensor, cairn::Vector<1>(1.0)));
  CHECK(filter::step(cairn::Kalman{}, plain, process, 0.1, sensor, cairn::Vector<1>(1.0)));
  CHECK(ud.mean.isApprox(plain.mean));
}

TEST_CASE("docs: the example of smoother.hpp smooths a record") {
  using State = cairn::Vector<2>;
  const cairn::ConstantVelocity<1> process;
  const cairn::PositionSensor<1, 2> sensor{.covariance = cairn::Matrix<1>(0.25)};
  const cairn::Gaussian<State> prior{State::Zero(), cairn::Matrix<2>::Identity()};
  const std::vector<cairn::Vector<1>> measurements(3, cairn::Vector<1>(1.0));
  const double dt = 0.1;
  cairn::Status status{};
  cairn::Innovation<1> innovation;
#include "snippets/filter/smoother_1.inc"
  CHECK(status == cairn::Status::accepted);
  CHECK(innovation.accepted());
  REQUIRE(path.size() == 4);
  CHECK(path[0].covariance(0, 0) < 1);
  CHECK(path[3].mean == recorder.belief().mean);
}

/// x' = x + u dt, and its square is measured.
struct Walker {
  using State = cairn::Vector<1>;
  using Control = cairn::Vector<1>;
  using Measurement = cairn::Vector<1>;
  template <class T>
  cairn::Vector<1, T> propagate(const cairn::Vector<1, T>& x, const Control& u, double dt) const {
    return cairn::Vector<1, T>(x[0] + u[0] * dt);
  }
  [[nodiscard]] cairn::Matrix<1> noise(const State&, const Control&, double) const {
    return cairn::Matrix<1>(1.0);
  }
  template <class T>
  cairn::Vector<1, T> predict(const cairn::Vector<1, T>& x) const {
    return cairn::Vector<1, T>(x[0] * x[0]);
  }
  [[nodiscard]] cairn::Matrix<1> noise(const State&) const { return cairn::Matrix<1>(1.0); }
};

TEST_CASE("docs: the example of vectorised.hpp predicts") {
  const Walker vehicle;
  const cairn::Unscented unscented;
  const Walker::Control u(3.0);
  const double dt = 0.5;
  cairn::Gaussian<cairn::Vector<1>> belief{cairn::Vector<1>(2.0), cairn::Matrix<1>(1.0)};
#include "snippets/filter/vectorised_1.inc"
  CHECK(status == cairn::Status::accepted);
  CHECK(belief.mean[0] == doctest::Approx(3.5));
  CHECK(belief.covariance(0, 0) == doctest::Approx(2.0));
}

TEST_CASE("docs: the first example of diagnosis.hpp says nothing of a measurement that is taken") {
  const cairn::Kalman filter;
  const cairn::PositionSensor<2, 4> gps;
  const cairn::Vector<2> z(3.0, 4.0);
  cairn::Gaussian<cairn::Vector<4>> belief{cairn::Vector<4>::Zero(), cairn::Matrix<4>::Identity()};
#include "snippets/filter/diagnosis_1.inc"
  CHECK(innovation.accepted());
}

TEST_CASE("docs: the first example of differentiate.hpp differentiates") {
  const Walker radar;
  const cairn::Extended extended;
  const cairn::Vector<1> z(5.0);
  cairn::Gaussian<cairn::Vector<1>> belief{cairn::Vector<1>(2.0), cairn::Matrix<1>(1.0)};
#include "snippets/filter/differentiate_1.inc"
  CHECK(innovation.accepted());
  CHECK(innovation.covariance(0, 0) == doctest::Approx(17.0));
}

TEST_CASE("docs: the examples of structured.hpp are the matrices they look like") {
  const double dt = 0.5;
#include "snippets/filter/structured_1.inc"
  CHECK(cairn::Matrix<3>(F) == (cairn::Matrix<3>() << 1, 0, dt, 0, 1, 0, 0, 0, 1).finished());
  CHECK(cairn::Matrix<3>(H_landmark) == cairn::Matrix<3>::Identity());
  const cairn::Matrix<2, 6> position = H_position;
  CHECK(position.sum() == 2);
  CHECK(position(0, 0) == 1);
  CHECK(position(1, 2) == 1);
}

TEST_CASE("docs: the example of timeline.hpp takes a late measurement in") {
  const auto& prior = planar_prior;
  const cairn::Vector<2> u(1.0, 0.0), turning(1.0, 0.1);
  const cairn::SO2 heading;
  const auto z = cairn::RangeBearing::measurement(4.0, 0.2);
  cairn::Status status{};
#include "snippets/filter/timeline_1.inc"
  CHECK(status == cairn::Status::accepted);
  CHECK(newest.accepted());
  CHECK(late.accepted());
  REQUIRE(later);
  CHECK(timeline.size() == 3);
}

TEST_CASE("docs: the first example of docs/filters.md predicts and updates") {
  const cairn::SE2 start;
  const cairn::Matrix<3> covariance = 0.01 * cairn::Matrix<3>::Identity();
  const cairn::Vector<2> control(1.0, 0.0), b(5.0, 1.0);
  const double dt = 0.1;
  const auto z = cairn::RangeBearing::measurement(5.0, 0.2);
#include "snippets/docs/filters_1.inc"
  CHECK(innovation.accepted());
}

TEST_CASE("docs: the second example of docs/filters.md takes a late measurement in") {
  const auto& belief = planar_prior;
  const cairn::Vector<2> control(1.0, 0.0);
  const cairn::SO2 heading;
  const auto z = cairn::RangeBearing::measurement(4.0, 0.2);
#include "snippets/docs/filters_2.inc"
  CHECK(newest.accepted());
  CHECK(late.accepted());
  CHECK(timeline.time() == 1.4);
}

/// Two landmarks seen from a robot that drives at 1 m/s, the first twice.
struct Entry {
  cairn::Vector<2> control;
  std::map<int, cairn_test::Sighting::Measurement> sightings;
};
const std::vector<Entry> log{
    {{1.0, 0.0}, {{3, cairn_test::Sighting::measurement(4.0, 0.5)}}},
    {{1.0, 0.0},
     {{3, cairn_test::Sighting::measurement(3.2, 0.65)}, {7, cairn_test::Sighting::measurement(2.0, -1.0)}}}};

int slam_with(const cairn_test::Sighting& sighting, double dt, int& used, std::size_t& blocks) {
#include "snippets/filter/joint_gaussian_1.inc"
  blocks = landmarks.size();
  return pose.x() > 1.5 && both.norm() > 0 ? 0 : 2;
}

TEST_CASE("docs: the first example of joint_gaussian.hpp is EKF-SLAM") {
  int used = 0;
  std::size_t blocks = 0;
  CHECK(slam_with({.range_sigma = 0.2}, 1.0, used, blocks) == 0);
  CHECK(used == 1);
  CHECK(blocks == 2);
}

TEST_CASE("docs: the second example of joint_extended.hpp names the blocks of its steps") {
  const cairn_test::Sighting sighting;
  const cairn::Vector<2> control(1.0, 0.0);
  const double dt = 0.1;
  const auto z = cairn_test::Sighting::measurement(4.0, 0.5);
  cairn::JointGaussian<cairn::SE2, cairn::Vector<2>> belief;
  const auto robot = belief.add(cairn::SE2(), cairn::Matrix<3>::Zero()).id;
  const auto landmark = belief.augment(cairn::inverted(sighting), z, robot).id;
#include "snippets/filter/joint_extended_2.inc"
  CHECK(moved == cairn::Status::accepted);
  CHECK(distance < 2.0);
  CHECK(seen.accepted());
}

TEST_CASE("docs: the third example of docs/filters.md grows and forgets") {
  const cairn_test::Sighting sighting;
  const cairn::Vector<2> control(1.0, 0.0);
  const double dt = 0.1;
  const auto z = cairn_test::Sighting::measurement(4.0, 0.5);
#include "snippets/docs/filters_3.inc"
  CHECK(moved == cairn::Status::accepted);
  CHECK(distance < 2.0);
  CHECK(seen.accepted());
  CHECK(counts == cairn::Status::accepted);
  CHECK(gone == cairn::Status::accepted);
  CHECK(belief.dof() == 5);
}

}  // namespace docs_filter_test
