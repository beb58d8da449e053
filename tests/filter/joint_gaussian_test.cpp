// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/joint_extended.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/manifold/so3.hpp>
#include <cairn/models/linear.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "filter/dense_joint.hpp"
#include "filter/linear_problems.hpp"
#include "filter/planar_slam.hpp"
#include "support/random.hpp"

namespace joint_gaussian_test {
namespace {

using cairn::AnyBlockId;
using cairn::BlockId;
using cairn::Form;
using cairn::Gaussian;
using cairn::JointExtended;
using cairn::JointGaussian;
using cairn::Matrix;
using cairn::NoControl;
using cairn::Product;
using cairn::SE2;
using cairn::SE3;
using cairn::StackedMeasurement;
using cairn::Status;
using cairn::Vector;
using cairn_test::Dense;
using cairn_test::largest_difference;
using cairn_test::Sighting;

constexpr int d = cairn::dynamic;
using Slam = JointGaussian<SE2, Vector<2>>;

/// A robot, some landmarks seen from it, and some steps: everything is correlated.
struct Scene {
  Slam belief;
  BlockId<SE2> robot;
  std::vector<BlockId<Vector<2>>> landmarks;

  explicit Scene(int count, std::uint64_t seed = 7) {
    cairn::Random random(seed);
    robot = belief.add(SE2(1, 2, 0.3), 0.01 * Matrix<3>::Identity()).id;
    for (int i = 0; i < count; ++i) {
      const auto z = Sighting::measurement(random.uniform(2, 8), random.uniform(-2, 2));
      const auto added = belief.augment(cairn::inverted(Sighting{}), z, robot);
      REQUIRE(added.accepted());
      landmarks.push_back(added.id);
      REQUIRE(JointExtended{}.predict(belief, cairn::Unicycle{}, 0.3, Vector<2>(1, 0.2), robot) ==
              Status::accepted);
    }
  }
  [[nodiscard]] Sighting::Measurement seen(int i, double range_error = 0, double bearing_error = 0) const {
    const Sighting::State x(belief.mean(robot), belief.mean(landmarks[static_cast<std::size_t>(i)]));
    return cairn::retract(Sighting{}.predict(x), Vector<2>(range_error, bearing_error));
  }
};

/// All that can be seen of a belief, number by number.
std::vector<double> numbers(const Slam& belief) {
  std::vector<double> all{double(belief.size()), double(belief.dof())};
  for (const AnyBlockId id : belief.blocks()) {
    all.push_back(double(id.slot));
    all.push_back(double(id.generation));
    all.push_back(belief.considered(id) ? 1.0 : 0.0);
    if (const auto pose = belief.as<SE2>(id)) {
      const SE2& x = belief.mean(*pose);
      all.insert(all.end(), {x.x(), x.y(), x.angle()});
    } else {
      const Vector<2>& x = belief.mean(*belief.as<Vector<2>>(id));
      all.insert(all.end(), {x(0), x(1)});
    }
  }
  const Matrix<d> p = belief.covariance();
  all.insert(all.end(), p.data(), p.data() + p.size());
  return all;
}

// z = (a b c) x + noise over three blocks of 2, 3 and 1 numbers.
struct LinearTriple {
  using State = Product<Vector<2>, Vector<3>, Vector<1>>;
  using Measurement = Vector<2>;
  Matrix<2, 6> design;
  Matrix<2> covariance;
  [[nodiscard]] Vector<6> stacked(const State& x) const {
    return (Vector<6>() << x.part<0>(), x.part<1>(), x.part<2>()).finished();
  }
  [[nodiscard]] Vector<2> predict(const State& x) const { return design * stacked(x); }
  [[nodiscard]] const Matrix<2, 6>& jacobian(const State&) const { return design; }
  [[nodiscard]] const Matrix<2>& noise(const State&) const { return covariance; }
};

/// A pose, a landmark and a pose with this joint covariance.
std::tuple<BlockId<SE2>, BlockId<Vector<2>>, BlockId<SE2>> three_blocks(Slam& belief, const SE2& first,
                                                                        const Vector<2>& second,
                                                                        const SE2& third,
                                                                        const Matrix<8>& p) {
  const auto a = belief.add(first, p.topLeftCorner<3, 3>()).id;
  const std::array<AnyBlockId, 1> one{a};
  const auto b = belief.commit(one, Vector<d>::Zero(3), p.topLeftCorner<5, 5>(), second).id;
  const std::array<AnyBlockId, 2> two{a, b};
  return {a, b, belief.commit(two, Vector<d>::Zero(5), p, third).id};
}

/// Largest entry of |a - b|.
double difference(const Matrix<d>& a, const Dense& b) {
  double largest = a.rows() == b.rows && a.cols() == b.columns ? 0.0 : 1e300;
  for (int i = 0; largest < 1e300 && i < b.rows; ++i)
    for (int j = 0; j < b.columns; ++j) {
      const double error = std::abs(a(i, j) - static_cast<double>(b(i, j)));
      largest = std::isnan(error) ? 1e300 : std::max(largest, error);
    }
  return largest;
}
/// Some rows and columns.
Dense pick(const Dense& a, const std::vector<int>& rows, const std::vector<int>& columns) {
  Dense part(static_cast<int>(rows.size()), static_cast<int>(columns.size()));
  for (int i = 0; i < part.rows; ++i)
    for (int j = 0; j < part.columns; ++j)
      part(i, j) = a(rows[static_cast<std::size_t>(i)], columns[static_cast<std::size_t>(j)]);
  return part;
}

void check_same(const Matrix<d>& a, const Matrix<d>& b, double tolerance) {
  CHECK(largest_difference(a, b) < tolerance);
}

TEST_SUITE("joint_gaussian") {
  TEST_CASE("joint_gaussian: on linear models is exactly the Kalman filter of the joint state") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    JointGaussian<Vector<2>, Vector<3>, Vector<1>> belief;
    const auto a = belief.add(Vector<2>(1, 2), cairn_test::random_covariance<2>(random)).id;
    const auto b = belief.add(Vector<3>(3, 4, 5), cairn_test::random_covariance<3>(random)).id;
    const auto c = belief.add(Vector<1>(6), cairn_test::random_covariance<1>(random)).id;
    Gaussian<Vector<6>> joint{(Vector<6>() << 1, 2, 3, 4, 5, 6).finished(), belief.covariance()};
    for (int step = 0; step < 100; ++step) {
      const cairn::LinearModel<3> moves{cairn_test::random_matrix<3, 3>(random, 0.5),
                                        cairn_test::random_covariance<3>(random)};
      cairn::LinearModel<6> all{Matrix<6>::Identity(), Matrix<6>::Zero()};
      all.transition.block<3, 3>(2, 2) = moves.transition;
      all.covariance.block<3, 3>(2, 2) = moves.covariance;
      REQUIRE(JointExtended{}.predict(belief, moves, 1.0, b) == Status::accepted);
      REQUIRE(cairn::Kalman{}.predict(joint, all, 1.0) == Status::accepted);
      const LinearTriple sensor{cairn_test::random_matrix<2, 6>(random),
                                cairn_test::random_covariance<2>(random, 0.1)};
      const Vector<2> z = cairn_test::random_matrix<2, 1>(random);
      const auto in = JointExtended{}.update(belief, sensor, z, a, b, c);
      const auto expected =
          cairn::Kalman{}.update(joint, cairn::LinearSensor<2, 6>{sensor.design, sensor.covariance}, z);
      REQUIRE(in.accepted());
      REQUIRE(expected.accepted());
      CHECK((in.residual - expected.residual).norm() < 1e-12);
      CHECK((in.covariance - expected.covariance).norm() < 1e-12);
      CHECK(in.nis == doctest::Approx(expected.nis).epsilon(1e-11));
      check_same(belief.covariance(), joint.covariance, 1e-12);
      CHECK((sensor.stacked(LinearTriple::State(belief.mean(a), belief.mean(b), belief.mean(c))) - joint.mean)
                .norm() < 1e-11);
    }
  }

  TEST_CASE("joint_gaussian: iterated, is the iterated filter of the joint state, tangent spaces and all") {
    // Two named blocks and a pose that is not: all move and are carried to their new tangent spaces.
    cairn::Random random(cairn_test::seed());
    for (const int iterations : {2, 3, 10})
      for (int k = 0; k < 20; ++k) {
        CAPTURE(iterations);
        const Matrix<8> p = 0.3 * cairn_test::random_covariance<8>(random);
        const SE2 pose(0, 0, 0.4), other(1, -1, 2);
        const Vector<2> point(4, 2);
        Slam belief;
        const auto [first, landmark, second] = three_blocks(belief, pose, point, other, p);
        check_same(belief.covariance(), p, 1e-13);
        const Sighting sensor{.range_sigma = 0.05, .bearing_sigma = 0.01};
        const auto z = Sighting::measurement(4.4 + 0.1 * random.normal(), 0.05 + 0.1 * random.normal());

        // B. Bell, F. Cathey 1993, (3.5): e <- K (z - h(x) + H e), on all numbers
        const Dense prior(p), r(sensor.noise(Sighting::State()));
        Dense e(8, 1), h(2, 8), gain;
        const auto part = [&](int row) {
          return Vector<3>(double(e(row, 0)), double(e(row + 1, 0)), double(e(row + 2, 0)));
        };
        const auto landmark_at = [&] {
          return Vector<2>(point(0) + double(e(3, 0)), point(1) + double(e(4, 0)));
        };
        const auto carry = [&] {  // of the tangent spaces, at e
          Dense t = Dense::identity(8);
          const auto block = [&](const SE2& from, int row) {
            const SE2 to = cairn::retract(from, part(row));
            for (int j = 0; j < 3; ++j) {
              const Vector<3> h_j = 1e-5 * Vector<3>::Unit(j);
              const Vector<3> ahead = cairn::local(to, cairn::retract(from, Vector<3>(part(row) + h_j)));
              const Vector<3> behind = cairn::local(to, cairn::retract(from, Vector<3>(part(row) - h_j)));
              for (int i = 0; i < 3; ++i) t(row + i, j + row) = (ahead(i) - behind(i)) / 2e-5;
            }
          };
          block(pose, 0);
          block(other, 5);
          return t;
        };
        for (int step = 0; step < iterations; ++step) {
          const Sighting::State x(cairn::retract(pose, part(0)), landmark_at());
          Dense by_x(2, 8);
          const Matrix<2, 5> jacobian = sensor.jacobian(x);
          for (int i = 0; i < 2; ++i)
            for (int j = 0; j < 5; ++j) by_x(i, j) = jacobian(i, j);
          h = by_x * carry();
          gain = prior * h.transposed() * (h * prior * h.transposed() + r).inverse();
          e = gain * (Dense(cairn::local(sensor.predict(x), z)) + h * e);
        }
        const Dense a = Dense::identity(8) - gain * h;
        const Dense t = carry();
        const Dense expected =
            t * (a * prior * a.transposed() + gain * r * gain.transposed()) * t.transposed();

        REQUIRE(JointExtended{.iterations = iterations, .settled = std::numeric_limits<double>::infinity()}
                    .update(belief, sensor, z, first, landmark)
                    .accepted());
        // where costs are compared, steps below the root of their rounding are not seen
        CHECK(cairn::local(belief.mean(first), cairn::retract(pose, part(0))).norm() < 1e-7);
        CHECK(cairn::local(belief.mean(second), cairn::retract(other, part(5))).norm() < 1e-7);
        CHECK((belief.mean(landmark) - landmark_at()).norm() < 1e-7);
        CHECK(difference(belief.covariance(), expected) < 1e-7);
      }
  }

  TEST_CASE("joint_gaussian: a stack of sightings is those sightings at one linearisation") {
    Scene scene(6);
    Slam in_turn = scene.belief, at_once = scene.belief;
    // linear sensors: in turn or at once, the same
    StackedMeasurement<> stack;
    cairn::Random random(3);
    for (int i = 0; i < 5; ++i) {
      const auto a = scene.landmarks[static_cast<std::size_t>(i)],
                 b = scene.landmarks[static_cast<std::size_t>(i + 1)];
      const Vector<2> z =
          cairn_test::Blend{}.predict(cairn_test::Blend::State(scene.belief.mean(a), scene.belief.mean(b))) +
          0.2 * Vector<2>(random.normal(), random.normal());
      REQUIRE(stack.add(at_once, cairn_test::Blend{}, z, a, b) == Status::accepted);
      REQUIRE(JointExtended{}.update(in_turn, cairn_test::Blend{}, z, a, b).accepted());
    }
    CHECK(stack.rows() == 10);
    const auto in = JointExtended{}.update(at_once, stack);
    REQUIRE(in.accepted());
    check_same(at_once.covariance(), in_turn.covariance(), 1e-12);
    for (const auto id : scene.landmarks) CHECK((at_once.mean(id) - in_turn.mean(id)).norm() < 1e-12);
    // a group's steps one after the other are not their sum
    CHECK(cairn::local(at_once.mean(scene.robot), in_turn.mean(scene.robot)).norm() < 1e-3);
    // whitened: chi-square of ten numbers, and gated as a whole
    Slam gated = scene.belief;
    CHECK(JointExtended{.gate = 0.5 * in.nis}.update(gated, stack).status == Status::gated);
    CHECK(numbers(gated) == numbers(scene.belief));
    stack.clear();
    REQUIRE(JointExtended{}.update(gated, stack).accepted());
    CHECK(numbers(gated) == numbers(scene.belief));
  }

  TEST_CASE("joint_gaussian: considered blocks are those of the Schmidt-Kalman filter") {
    // S. Schmidt 1966; with x estimated, c considered, z = H x + J c + v:
    //   K = (P_xx H^T + P_xc J^T) S^-1,  S = H P_xx H^T + H P_xc J^T + J P_cx H^T + J P_cc J^T + R
    //   P_xx' = (I - K H) P_xx - K J P_cx,  P_xc' = (I - K H) P_xc - K J P_cc,  P_cc' = P_cc
    cairn::Random random(cairn_test::seed());
    for (const bool through_joseph : {false, true})
      for (int k = 0; k < 50; ++k) {
        const Matrix<6> p = cairn_test::random_covariance<6>(random);
        JointGaussian<Vector<2>, Vector<3>, Vector<1>> belief;
        const auto a = belief.add(Vector<2>(1, 2), p.topLeftCorner<2, 2>()).id;
        const std::array<AnyBlockId, 1> first{a};
        const auto b =
            belief.commit(first, Vector<d>::Zero(2), p.topLeftCorner<5, 5>(), Vector<3>(3, 4, 5)).id;
        const std::array<AnyBlockId, 2> two{a, b};
        const auto c = belief.commit(two, Vector<d>::Zero(5), p, Vector<1>(6)).id;
        check_same(belief.covariance(), p, 1e-13);
        REQUIRE(belief.consider(b) == Status::accepted);  // rows 2, 3, 4
        CHECK(belief.considered(b));
        const LinearTriple sensor{cairn_test::random_matrix<2, 6>(random),
                                  cairn_test::random_covariance<2>(random, 0.1)};
        const Vector<2> z = cairn_test::random_matrix<2, 1>(random);
        const std::vector<int> x{0, 1, 5}, s{2, 3, 4}, z_rows{0, 1};
        const Dense all(p), design(sensor.design);
        const Dense xx = pick(all, x, x), xc = pick(all, x, s), cc = pick(all, s, s);
        const Dense H = pick(design, z_rows, x), J = pick(design, z_rows, s);
        const Dense HJ = H * xc * J.transposed();
        const Dense S = H * xx * H.transposed() + HJ + HJ.transposed() + J * cc * J.transposed() +
                        Dense(sensor.covariance);
        const Dense K = (xx * H.transposed() + xc * J.transposed()) * S.inverse();
        const Dense xx_next = xx - K * H * xx - K * J * xc.transposed();
        const Dense xc_next = xc - K * H * xc - K * J * cc;
        const Vector<2> residual =
            z - sensor.predict(LinearTriple::State(belief.mean(a), belief.mean(b), belief.mean(c)));
        const Dense step = K * Dense(residual);
        const Matrix<3> before = belief.covariance(b);

        const JointExtended filter{.form = through_joseph ? Form::joseph : Form::standard};
        REQUIRE(filter.update(belief, sensor, z, a, b, c).accepted());
        const Matrix<d> next = belief.covariance();
        const auto picked = [&](const std::vector<int>& rows, const std::vector<int>& columns,
                                const Dense& expected) {
          const Dense found = pick(Dense(next), rows, columns) - expected;
          for (const auto error : found.numbers) CHECK(std::abs(static_cast<double>(error)) < 1e-11);
        };
        picked(x, x, xx_next);
        picked(x, s, xc_next);
        CHECK(belief.covariance(b) == before);  // to the last bit
        CHECK(belief.mean(b) == Vector<3>(3, 4, 5));
        for (int i = 0; i < 2; ++i)
          CHECK(std::abs(belief.mean(a)(i) - 1 - i - static_cast<double>(step(i, 0))) < 1e-12);
        CHECK(std::abs(belief.mean(c)(0) - 6 - static_cast<double>(step(2, 0))) < 1e-12);
        CHECK(cairn::detail::is_valid_covariance<d, double>(next));
      }
  }

  TEST_CASE("joint_gaussian: a considered bias keeps a filter honest that estimates nothing of it") {
    // A position seen again and again with the same bias. Estimated as white noise the deviation falls below
    // the bias; considered, it stays above.
    struct Seen {
      using State = Product<Vector<2>, Vector<1>>;
      using Measurement = Vector<1>;
      [[nodiscard]] Vector<1> predict(const State& x) const {
        return Vector<1>(x.part<0>()(0) + x.part<1>()(0));
      }
      [[nodiscard]] Matrix<1, 3> jacobian(const State&) const { return {1, 0, 1}; }
      [[nodiscard]] Matrix<1> noise(const State&) const { return Matrix<1>(0.01); }
    };
    cairn::Random random(cairn_test::seed());
    cairn::RunningMoments nees;
    for (int run = 0; run < 400; ++run) {
      JointGaussian<Vector<2>, Vector<1>> belief;
      const auto x = belief.add(Vector<2>(0, 0), 100 * Matrix<2>::Identity()).id;
      const auto bias = belief.add(Vector<1>(0), Matrix<1>(0.25)).id;
      REQUIRE(belief.consider(bias) == Status::accepted);
      const double truth = random.normal(0, 10), offset = random.normal(0, 0.5);
      for (int k = 0; k < 50; ++k)
        REQUIRE(JointExtended{}
                    .update(belief, Seen{}, Vector<1>(truth + offset + random.normal(0, 0.1)), x, bias)
                    .accepted());
      const double error = belief.mean(x)(0) - truth;
      nees.add(error * error / belief.covariance(x)(0, 0));
      CHECK(belief.covariance(x)(0, 0) > 0.25);
      CHECK(belief.mean(bias)(0) == 0.0);
    }
    const auto band = cairn::chi_square_mean_band(1, 400, 0.999);
    CHECK(band.contains(nees.mean()));
  }

  TEST_CASE("joint_gaussian: a clone is the same to the last bit until one of the two moves") {
    Scene scene(4);
    const auto clone = scene.belief.clone(scene.robot);
    REQUIRE(clone.accepted());
    const auto same = [&](const Slam& belief) {
      CHECK(belief.covariance(clone.id) == belief.covariance(scene.robot));
      CHECK(belief.cross_covariance(clone.id, scene.robot) == belief.covariance(scene.robot));
      for (const auto id : scene.landmarks)
        CHECK(belief.cross_covariance(id, clone.id) == belief.cross_covariance(id, scene.robot));
      CHECK(cairn::local(belief.mean(clone.id), belief.mean(scene.robot)).norm() < 1e-15);
    };
    same(scene.belief);
    // singular, and no step minds: of others, of the one, of both
    for (int i = 0; i < 4; ++i) {
      const auto z = scene.seen(i, 0.05, -0.01);
      REQUIRE(JointExtended{.gate = 30}
                  .update(scene.belief, Sighting{}, z, i < 2 ? scene.robot : clone.id,
                          scene.landmarks[static_cast<std::size_t>(i)])
                  .accepted());
      same(scene.belief);
    }
    REQUIRE(JointExtended{}
                .update(scene.belief, cairn_test::Passage{}, SE2(0.001, 0, 0), clone.id, scene.robot)
                .accepted());
    same(scene.belief);
    CHECK(scene.belief.marginal(clone.id, scene.robot).covariance.allFinite());
    // what the robot does from now on is between the two
    REQUIRE(JointExtended{}.predict(scene.belief, cairn::Unicycle{}, 1.0, Vector<2>(1, 0.5), scene.robot) ==
            Status::accepted);
    CHECK(scene.belief.covariance(clone.id) != scene.belief.covariance(scene.robot));
  }

  TEST_CASE("joint_gaussian: the way between a clone and now, as Roumeliotis and Burdick derive it") {
    // S = H_then P H_then^T + H_then P F^T H_now^T + (...)^T + H_now (F P F^T + Q) H_now^T + R
    const Matrix<3> p = (Matrix<3>() << 0.2, 0.05, 0.01, 0.05, 0.3, 0.02, 0.01, 0.02, 0.1).finished();
    const SE2 start(1, 2, 0.5);
    const Vector<2> u(1.0, 0.4);
    const cairn::Unicycle drive{};
    Slam belief;
    const auto now = belief.add(start, p).id;
    const auto then = belief.clone(now).id;
    REQUIRE(JointExtended{}.predict(belief, drive, 1.0, u, now) == Status::accepted);
    const cairn_test::Passage sensor{0.01 * Matrix<3>::Identity()};
    const cairn_test::Passage::State x(start, drive.propagate(start, u, 1.0));
    const Dense h(sensor.jacobian(x)), f(drive.jacobian(start, u, 1.0)),
        q(Matrix<3>(drive.noise(start, u, 1.0)));
    const Dense h_then = pick(h, {0, 1, 2}, {0, 1, 2}), h_now = pick(h, {0, 1, 2}, {3, 4, 5});
    const Dense start_p(p), r(sensor.covariance);
    const Dense cross = h_then * start_p * f.transposed() * h_now.transposed();
    const Dense expected = h_then * start_p * h_then.transposed() + cross + cross.transposed() +
                           h_now * (f * start_p * f.transposed() + q) * h_now.transposed() + r;
    const auto in = JointExtended{}.innovation(belief, sensor, sensor.predict(x), then, now);
    REQUIRE(in.accepted());
    CHECK(difference(in.covariance, expected) < 1e-14);
    // The motion is known in advance but for Q, so nothing else of the start's doubt is left in it.
    CHECK(difference(in.covariance, q + r) < 1e-12);
  }

  TEST_CASE("joint_gaussian: marginals are parts of the joint, and what is left does not feel what went") {
    Scene scene(5);
    const Matrix<d> whole = scene.belief.covariance();
    const auto pair = scene.belief.marginal(scene.landmarks[1], scene.robot);
    CHECK(largest_difference(pair.covariance.topLeftCorner(2, 2), whole.block(5, 5, 2, 2)) == 0.0);
    CHECK(largest_difference(pair.covariance.bottomRightCorner(3, 3), whole.block(0, 0, 3, 3)) == 0.0);
    CHECK(largest_difference(pair.covariance.topRightCorner(2, 3), whole.block(5, 0, 2, 3)) == 0.0);
    REQUIRE(scene.belief.marginalise(scene.landmarks[2]) == Status::accepted);
    Matrix<d> expected(11, 11);
    expected << whole.block(0, 0, 7, 7), whole.block(0, 9, 7, 4), whole.block(9, 0, 4, 7),
        whole.block(9, 9, 4, 4);
    CHECK(largest_difference(scene.belief.covariance(), expected) == 0.0);
  }

  TEST_CASE(
      "joint_gaussian: conditioned on blocks, the others have the conditional distribution, in any order") {
    Scene scene(5);
    const auto a = scene.landmarks[0], b = scene.landmarks[3];
    const Vector<2> at_a = scene.belief.mean(a) + Vector<2>(0.1, -0.05),
                    at_b = scene.belief.mean(b) + Vector<2>(-0.2, 0.1);
    const Matrix<d> p = scene.belief.covariance();  // rows of a: 3, 4; of b: 9, 10
    Slam one = scene.belief, two = scene.belief;
    const auto in = one.condition(a, at_a);
    REQUIRE(in.accepted());
    const Dense all(p), move(Vector<2>(0.1, -0.05));
    std::vector<int> every(static_cast<std::size_t>(all.rows));
    for (std::size_t i = 0; i < every.size(); ++i) every[i] = static_cast<int>(i);
    const Dense of_a = pick(all, every, {3, 4});
    const Dense inverse = pick(all, {3, 4}, {3, 4}).inverse();
    const Dense nis = move.transposed() * inverse * move;
    CHECK(in.nis == doctest::Approx(static_cast<double>(nis(0, 0))).epsilon(1e-9));
    CHECK(difference(one.covariance(), all - of_a * inverse * of_a.transposed()) < 1e-13);
    CHECK(one.covariance(a) == Matrix<2>::Zero());
    CHECK(one.mean(a) == at_a);
    const Dense step = of_a * inverse * move;
    const Vector<3> moved = cairn::local(scene.belief.mean(scene.robot), one.mean(scene.robot));
    for (int i = 0; i < 3; ++i) CHECK(std::abs(moved(i) - static_cast<double>(step(i, 0))) < 1e-12);
    REQUIRE(one.condition(b, at_b).accepted());
    REQUIRE(two.condition(b, at_b).accepted());
    REQUIRE(two.condition(a, at_a).accepted());
    check_same(one.covariance(), two.covariance(), 1e-13);
    CHECK((one.mean(scene.landmarks[1]) - two.mean(scene.landmarks[1])).norm() < 1e-12);
    // known already: the same value is accepted, another is a contradiction
    CHECK(one.condition(a, at_a).accepted());
    const auto before = numbers(one);
    CHECK(one.condition(a, Vector<2>(at_a + Vector<2>(1e-3, 0))).status == Status::not_positive_definite);
    CHECK(numbers(one) == before);
    // a block that is known serves as a beacon
    CHECK(JointExtended{.gate = 30}.update(one, Sighting{}, scene.seen(0), scene.robot, a).accepted());
    CHECK(one.covariance(a) == Matrix<2>::Zero());
  }

  TEST_CASE("joint_gaussian: what is known of a clone's original is known of the clone") {
    Scene scene(3);
    const auto clone = scene.belief.clone(scene.robot).id;
    const SE2 at = cairn::retract(scene.belief.mean(scene.robot), Vector<3>(0.02, -0.01, 0.01));
    REQUIRE(scene.belief.condition(scene.robot, at).accepted());
    CHECK(scene.belief.covariance(clone) == Matrix<3>::Zero());
    CHECK(cairn::local(scene.belief.mean(clone), at).norm() < 1e-12);
    for (const auto id : scene.landmarks)
      CHECK(scene.belief.cross_covariance(id, clone) == Matrix<2, 3>::Zero());
    const Matrix<d> p = scene.belief.covariance();
    CHECK(cairn::detail::is_valid_covariance<d, double>(p));
    CHECK(p.diagonal().tail(3).norm() == 0.0);
  }

  TEST_CASE(
      "joint_gaussian: what a filter of a few blocks found is committed to all as if all had been there") {
    Scene scene(6);
    Slam direct = scene.belief, committed = scene.belief;
    const auto landmark = scene.landmarks[2];
    const auto z = scene.seen(2, 0.1, 0.02);
    REQUIRE(JointExtended{}.update(direct, Sighting{}, z, scene.robot, landmark).accepted());
    auto few = committed.marginal(scene.robot, landmark);
    const auto before = few.mean;
    REQUIRE(cairn::Extended{}.update(few, Sighting{}, z).accepted());
    const std::array<AnyBlockId, 2> named{scene.robot, landmark};
    REQUIRE(committed.commit(named, cairn::local(before, few.mean), few.covariance) == Status::accepted);
    check_same(committed.covariance(), direct.covariance(), 1e-13);
    for (const auto id : scene.landmarks) CHECK((committed.mean(id) - direct.mean(id)).norm() < 1e-12);
    // The blocks' own posterior is taken as it is.
    CHECK(largest_difference(committed.marginal(scene.robot, landmark).covariance, few.covariance) < 1e-16);
  }

  TEST_CASE(
      "joint_gaussian: commits to a window with a gauge and a clone in it, though their covariance is "
      "singular") {
    Slam belief;
    const auto gauge = belief.add(SE2(), Matrix<3>::Zero()).id;
    const auto robot = belief.add(SE2(1, 0, 0), 0.1 * Matrix<3>::Identity()).id;
    const auto clone = belief.clone(robot).id;
    const auto landmark =
        belief.augment(cairn::inverted(Sighting{}), Sighting::measurement(3, 0.2), robot).id;
    const std::array<AnyBlockId, 3> window{gauge, robot, clone};
    Matrix<d> posterior = Matrix<d>::Zero(9, 9);
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) posterior.block<3, 3>(3 + 3 * i, 3 + 3 * j) = 0.05 * Matrix<3>::Identity();
    Vector<d> step = Vector<d>::Zero(9);
    step.segment<3>(3) = step.segment<3>(6) = Vector<3>(0.1, 0, 0.02);
    const Matrix<2> before = belief.covariance(landmark);
    REQUIRE(belief.commit(window, step, posterior) == Status::accepted);
    CHECK((belief.covariance(robot) - 0.05 * Matrix<3>::Identity()).norm() < 1e-15);
    CHECK(belief.covariance(gauge) == Matrix<3>::Zero());
    CHECK((belief.cross_covariance(clone, landmark) - belief.cross_covariance(robot, landmark)).norm() <
          1e-15);
    // half of the pose's part of the landmark's doubt is gone
    const Dense g(cairn::inverted(Sighting{}).jacobian(SE2(1, 0, 0), Sighting::measurement(3, 0.2)));
    const Dense half(Matrix<3>(0.05 * Matrix<3>::Identity()));
    CHECK(difference(belief.covariance(landmark), Dense(before) - g * half * g.transposed()) < 1e-12);
    // the gauge cannot move, nor the clone by itself
    const auto kept = numbers(belief);
    step(0) = 0.1;
    CHECK(belief.commit(window, step, posterior) == Status::not_positive_definite);
    step(0) = 0;
    step(6) += 0.1;
    CHECK(belief.commit(window, step, posterior) == Status::not_positive_definite);
    CHECK(numbers(belief) == kept);
  }

  TEST_CASE("joint_gaussian: an inverted sensor is the limit of an update with a new block of no prior") {
    // 1e9 m^2: what is left of it is below 1e-6 of the answer.
    struct Stereo {  // four numbers for a landmark of two
      using State = Product<SE2, Vector<2>>;
      using Measurement = Vector<4>;
      [[nodiscard]] Vector<4> predict(const State& x) const {
        const Vector<2> p = x.part<0>().inverse() * x.part<1>();
        return {p(0), p(1), p(0) + 0.1 * p(1) * p(1), p(1) - 0.2 * p(0)};
      }
      [[nodiscard]] Matrix<4, 5> jacobian(const State& x) const {
        return cairn::numeric_jacobian([&](const State& s) { return predict(s); }, x);
      }
      [[nodiscard]] Matrix<4> noise(const State&) const {
        return (Matrix<4>() << 0.02, 0.005, 0, 0, 0.005, 0.01, 0, 0, 0, 0, 0.05, 0.01, 0, 0, 0.01, 0.03)
            .finished();
      }
      [[nodiscard]] Vector<2> initialise(const SE2& pose, const Vector<4>& z) const {
        return pose * Vector<2>(z(0), z(1));
      }
    };
    const auto compare = [](const auto& sensor, const auto& z, int iterations, double tolerance) {
      Scene added(2), updated(2);
      const auto id = added.belief.augment(cairn::inverted(sensor), z, added.robot);
      REQUIRE(id.accepted());
      const Vector<2> start = sensor.initialise(updated.belief.mean(updated.robot), z);
      const auto flat = updated.belief.add(start, 1e9 * Matrix<2>::Identity()).id;
      REQUIRE(JointExtended{.form = Form::joseph, .iterations = iterations}
                  .update(updated.belief, sensor, z, updated.robot, flat)
                  .accepted());
      CHECK((added.belief.mean(id.id) - updated.belief.mean(flat)).norm() < tolerance);
      check_same(added.belief.covariance(), updated.belief.covariance(), tolerance);
    };
    compare(Sighting{}, Sighting::measurement(4, 0.7), 1, 1e-6);
    compare(Stereo{}, Vector<4>(3.0, 1.5, 3.2251, 0.8999), 1, 1e-5);
    // its own Jacobian is that of what it computes
    const auto inverse = cairn::inverted(Sighting{});
    const auto z = Sighting::measurement(4, 0.7);
    const Matrix<2, 3> by_differences =
        cairn::numeric_jacobian([&](const SE2& x) { return inverse.initialise(x, z); }, SE2(1, 2, 0.3));
    CHECK((inverse.jacobian(SE2(1, 2, 0.3), z) - by_differences).norm() < 1e-8);
  }

  TEST_CASE("joint_gaussian: ids survive what happens to others, and copies; those of the dead are refused") {
    Scene scene(40);
    const Slam copy = scene.belief;
    std::vector<Vector<2>> means;
    for (const auto id : scene.landmarks) means.push_back(scene.belief.mean(id));
    // three of four go, gaps are closed on the way
    for (std::size_t i = 0; i < 40; ++i)
      if (i % 4 != 0) REQUIRE(scene.belief.marginalise(scene.landmarks[i]) == Status::accepted);
    CHECK(scene.belief.size() == 11);
    CHECK(scene.belief.dof() == 23);
    for (std::size_t i = 0; i < 40; ++i) {
      CHECK(copy.contains(scene.landmarks[i]));
      CHECK(scene.belief.contains(scene.landmarks[i]) == (i % 4 == 0));
      if (i % 4 != 0) continue;
      CHECK(scene.belief.mean(scene.landmarks[i]) == means[i]);
      for (std::size_t k = 0; k < 40; k += 4)
        CHECK(scene.belief.cross_covariance(scene.landmarks[i], scene.landmarks[k]) ==
              copy.cross_covariance(scene.landmarks[i], scene.landmarks[k]));
    }
    // a slot that is used again has another id
    const auto dead = scene.landmarks[1];
    const auto added = scene.belief.add(Vector<2>(0, 0), Matrix<2>::Identity());
    REQUIRE(added.accepted());
    CHECK_FALSE(scene.belief.contains(dead));
    CHECK(scene.belief.contains(added.id));
    CHECK_FALSE(copy.contains(added.id));
    CHECK_FALSE(scene.belief.as<SE2>(added.id).has_value());
    CHECK(scene.belief.as<Vector<2>>(added.id) == added.id);
    CHECK(JointExtended{}.update(scene.belief, Sighting{}, scene.seen(0), scene.robot, dead).status ==
          Status::unknown_block);
    CHECK(std::string(cairn::explain(Status::unknown_block)) ==
          "refused: a block that is named is not in the state, or is named twice");
  }

  TEST_CASE(
      "joint_gaussian: put together anew from means and a covariance, is the same and learns the same") {
    Scene scene(5);
    REQUIRE(scene.belief.marginalise(scene.landmarks[1]) == Status::accepted);  // so that rows have a gap
    const Matrix<d, d> p = scene.belief.covariance();
    Slam other;
    std::vector<BlockId<Vector<2>>> landmarks;
    const auto robot = other.add(scene.belief.mean(scene.robot), Matrix<3>::Identity()).id;
    for (const std::size_t i : {0U, 2U, 3U, 4U})
      landmarks.push_back(other.add(scene.belief.mean(scene.landmarks[i]), Matrix<2>::Identity()).id);
    REQUIRE(other.set_covariance(p) == Status::accepted);
    CHECK(other.covariance() == p);
    const auto z = Sighting::measurement(3, 0.4);
    REQUIRE(JointExtended{}.update(other, Sighting{}, z, robot, landmarks[2]).accepted());
    REQUIRE(JointExtended{}.update(scene.belief, Sighting{}, z, scene.robot, scene.landmarks[3]).accepted());
    CHECK(largest_difference(other.covariance(), scene.belief.covariance()) < 1e-14);

    Matrix<d, d> bad = p;
    bad(0, 0) = -1;
    const Matrix<d, d> before = other.covariance();
    CHECK(other.set_covariance(bad) == Status::not_positive_definite);
    bad(0, 0) = std::numeric_limits<double>::quiet_NaN();
    CHECK(other.set_covariance(bad) == Status::not_finite);
    CHECK(other.set_covariance(p.topLeftCorner(4, 4)) == Status::size_mismatch);
    CHECK(other.covariance() == before);
  }

  TEST_CASE("joint_gaussian: rows of blocks that went are used again, so that a window takes no more room") {
    Slam belief;
    const auto robot = belief.add(SE2(), Matrix<3>::Zero()).id;
    std::vector<BlockId<SE2>> window;
    std::size_t bytes = 0;
    for (int step = 0; step < 500; ++step) {
      REQUIRE(JointExtended{}.predict(belief, cairn::Unicycle{}, 0.1, Vector<2>(1, 0.1), robot) ==
              Status::accepted);
      window.push_back(belief.clone(robot).id);
      if (window.size() <= 10) continue;
      REQUIRE(belief.marginalise(window.front()) == Status::accepted);
      window.erase(window.begin());
      if (step == 20) bytes = belief.bytes();
      if (step > 20) CHECK(belief.bytes() == bytes);
    }
    CHECK(belief.size() == 11);
    // and blocks appear in the order in which they were added
    CHECK(belief.blocks()[0] == robot);
    for (std::size_t i = 0; i < window.size(); ++i) CHECK(belief.blocks()[i + 1] == window[i]);
  }

  TEST_CASE("joint_gaussian: refuses bad numbers, sizes, noises, options and names, and keeps every bit") {
    Scene scene(3);
    const auto before = numbers(scene.belief);
    const auto robot = scene.robot;
    const auto landmark = scene.landmarks[0];
    const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
    const Vector<2> u(1, 0.1);
    const JointExtended filter{};
    Slam& belief = scene.belief;
    const auto z = scene.seen(0);

    struct Sized {  // of run-time size
      using State = SE2;
      using Control = NoControl;
      using Measurement = Vector<d>;
      int rows = 3, columns = 3, noisy = 3;
      [[nodiscard]] State propagate(const State& x, const Control&, double) const { return x; }
      [[nodiscard]] Matrix<d> jacobian(const State&, const Control&, double) const {
        return Matrix<d>::Identity(rows, columns);
      }
      [[nodiscard]] Matrix<d> noise(const State&, const Control&, double) const {
        return Matrix<d>::Identity(noisy, noisy);
      }
      [[nodiscard]] Vector<d> predict(const State&) const { return Vector<d>::Zero(rows); }
      [[nodiscard]] Matrix<d, 3> jacobian(const State&) const { return Matrix<d, 3>::Identity(rows, 3); }
      [[nodiscard]] Matrix<d> noise(const State&) const { return Matrix<d>::Identity(noisy, noisy); }
    };
    CHECK(filter.predict(belief, Sized{.rows = 2}, 1.0, robot) == Status::size_mismatch);
    CHECK(filter.predict(belief, Sized{.columns = 4}, 1.0, robot) == Status::size_mismatch);
    CHECK(filter.predict(belief, Sized{.noisy = 2}, 1.0, robot) == Status::size_mismatch);
    CHECK(filter.update(belief, Sized{.noisy = 2}, Vector<d>::Zero(3), robot).status ==
          Status::size_mismatch);
    CHECK(filter.update(belief, Sized{.rows = 2, .noisy = 2}, Vector<d>::Zero(3), robot).status ==
          Status::size_mismatch);

    CHECK(filter.predict(belief, cairn::Unicycle{}, -1.0, u, robot) == Status::bad_time_step);
    CHECK(filter.predict(belief, cairn::Unicycle{}, nan, u, robot) == Status::bad_time_step);
    CHECK(filter.predict(belief, cairn::Unicycle{}, 1.0, Vector<2>(nan, 0), robot) == Status::not_finite);
    CHECK(filter.predict(belief, cairn::Unicycle{.speed_density = -1}, 1.0, u, robot) ==
          Status::not_positive_definite);
    CHECK(filter.predict(belief, cairn::Unicycle{.speed_density = infinity}, 1.0, u, robot) ==
          Status::not_finite);
    CHECK(JointExtended{.fading = 0.9}.predict(belief, cairn::Unicycle{}, 1.0, u, robot) ==
          Status::bad_option);
    CHECK(JointExtended{.stabilising_noise = -1}.predict(belief, cairn::Unicycle{}, 1.0, u, robot) ==
          Status::bad_option);
    CHECK(filter.predict(belief, cairn::Unicycle{}, 1.0, u, BlockId<SE2>{}) == Status::unknown_block);
    CHECK(filter.predict(belief, cairn::Unicycle{}, 1.0, u, BlockId<SE2>{landmark}) == Status::unknown_block);

    struct Convoy {
      using State = Product<SE2, SE2>;
      using Control = NoControl;
      [[nodiscard]] State propagate(const State& x, const Control&, double) const { return x; }
      [[nodiscard]] cairn::Identity<6> jacobian(const State&, const Control&, double) const { return {}; }
      [[nodiscard]] cairn::Identity<6> noise(const State&, const Control&, double) const { return {}; }
    };
    CHECK(filter.predict(belief, Convoy{}, 1.0, robot, robot) == Status::unknown_block);

    const auto status = [&](const auto& options, const auto& sensor, const auto& seen) {
      const auto said = options.innovation(belief, sensor, seen, robot, landmark).status;
      const auto done = options.update(belief, sensor, seen, robot, landmark).status;
      CHECK(said == done);
      return done;
    };
    CHECK(status(filter, Sighting{}, Sighting::measurement(nan, 0)) == Status::not_finite);
    CHECK(status(filter, Sighting{.range_sigma = nan}, z) == Status::not_finite);
    CHECK(status(JointExtended{.gate = 1e-6}, Sighting{}, scene.seen(0, 1, 1)) == Status::gated);
    CHECK(status(JointExtended{.gate = 0}, Sighting{}, z) == Status::bad_option);
    CHECK(status(JointExtended{.gate = nan}, Sighting{}, z) == Status::bad_option);
    CHECK(status(JointExtended{.form = Form::sequential}, Sighting{}, z) == Status::bad_option);
    CHECK(status(JointExtended{.iterations = 0}, Sighting{}, z) == Status::bad_option);
    CHECK(status(JointExtended{.iterations = 3, .tolerance = std::nan("")}, Sighting{}, z) ==
          Status::bad_option);
    CHECK(status(JointExtended{.iterations = 3, .settled = -1}, Sighting{}, z) == Status::bad_option);
    CHECK(filter.update(belief, Sighting{}, z, robot, BlockId<Vector<2>>{}).status == Status::unknown_block);
    CHECK(filter.innovation(belief, Sighting{}, z, robot, BlockId<Vector<2>>{robot}).status ==
          Status::unknown_block);
    struct Indefinite : Sighting {  // H P H^T makes up for it
      [[nodiscard]] Matrix<2> noise(const State&) const { return Vector<2>(-1e-9, 1).asDiagonal(); }
    };
    CHECK(status(filter, Indefinite{}, z) == Status::not_positive_definite);
    CHECK(status(JointExtended{.iterations = 3}, Indefinite{}, z) == Status::not_positive_definite);

    StackedMeasurement<> stack;
    REQUIRE(stack.add(belief, Sighting{}, scene.seen(1), robot, scene.landmarks[1]) == Status::accepted);
    CHECK(stack.add(belief, Sighting{}, Sighting::measurement(nan, 0), robot, landmark) ==
          Status::not_finite);
    CHECK(stack.add(belief, Indefinite{}, z, robot, landmark) == Status::not_positive_definite);
    CHECK(stack.add(belief, Sighting{}, z, robot, BlockId<Vector<2>>{}) == Status::unknown_block);
    const std::array<StackedMeasurement<>::Term, 1> term{{{robot, Matrix<d>::Identity(2, 2)}}};
    CHECK(stack.add(belief, Vector<d>::Zero(2), Matrix<d>::Identity(2, 2), term) == Status::size_mismatch);
    CHECK(stack.add(belief, Vector<d>::Zero(3), Matrix<d>::Identity(2, 2), term) == Status::size_mismatch);
    CHECK(stack.rows() == 2);
    CHECK(JointExtended{.iterations = 2}.update(belief, stack).status == Status::bad_option);
    CHECK(JointExtended{.gate = -1}.update(belief, stack).status == Status::bad_option);
    Slam without = belief;
    REQUIRE(without.marginalise(scene.landmarks[1]) == Status::accepted);
    CHECK(filter.update(without, stack).status == Status::unknown_block);

    CHECK(belief.add(SE2(), -Matrix<3>::Identity()).status == Status::not_positive_definite);
    CHECK(belief.add(SE2(nan, 0, 0), Matrix<3>::Identity()).status == Status::not_finite);
    CHECK(belief.add(SE2(), Matrix<3>::Constant(nan)).status == Status::not_finite);
    CHECK(belief.add(SE2(), Matrix<d>::Identity(2, 2)).status == Status::size_mismatch);
    CHECK(belief.clone(BlockId<SE2>{}).status == Status::unknown_block);
    const auto inverse = cairn::inverted(Sighting{});
    CHECK(belief.augment(inverse, Sighting::measurement(nan, 0), robot).status == Status::not_finite);
    CHECK(belief.augment(inverse, Sighting::measurement(2, 0), BlockId<SE2>{}).status ==
          Status::unknown_block);
    struct BearingAlone {  // does not determine the landmark
      using State = Product<SE2, Vector<2>>;
      using Measurement = cairn::SO2;
      [[nodiscard]] cairn::SO2 predict(const State& x) const { return Sighting{}.predict(x).part<1>(); }
      [[nodiscard]] Matrix<1, 5> jacobian(const State& x) const { return Sighting{}.jacobian(x).row(1); }
      [[nodiscard]] Matrix<1> noise(const State&) const { return Matrix<1>(1e-4); }
      [[nodiscard]] Vector<2> initialise(const SE2& x, const cairn::SO2& z) const {
        return x * Vector<2>(std::cos(z.angle()), std::sin(z.angle()));
      }
    };
    CHECK(belief.augment(cairn::inverted(BearingAlone{}), cairn::SO2(0.1), robot).status ==
          Status::not_finite);

    const std::array<AnyBlockId, 2> twice{landmark, landmark}, both{robot, landmark},
        unknown{robot, BlockId<SE2>{}};
    CHECK(belief.marginalise(BlockId<SE2>{}) == Status::unknown_block);
    CHECK(belief.marginalise(twice) == Status::unknown_block);
    CHECK(belief.marginalise(unknown) == Status::unknown_block);
    CHECK(belief.reorder(both) == Status::unknown_block);
    CHECK(belief.consider(BlockId<SE2>{}) == Status::unknown_block);
    CHECK(belief.condition(BlockId<SE2>{}, SE2()).status == Status::unknown_block);
    CHECK(belief.condition(robot, SE2(nan, 0, 0)).status == Status::not_finite);
    const Matrix<d> five = belief.covariance(both);
    CHECK(belief.commit(twice, Vector<d>::Zero(4), Matrix<d>::Identity(4, 4)) == Status::unknown_block);
    CHECK(belief.commit(both, Vector<d>::Zero(4), five) == Status::size_mismatch);
    CHECK(belief.commit(both, Vector<d>::Zero(5), Matrix<d>::Identity(4, 5)) == Status::size_mismatch);
    CHECK(belief.commit(both, Vector<d>::Constant(5, nan), five) == Status::not_finite);
    CHECK(belief.commit(both, Vector<d>::Zero(5), -five) == Status::not_positive_definite);
    CHECK(belief.commit(both, Vector<d>::Zero(5), five, SE2(nan, 0, 0)).status == Status::not_finite);
    CHECK(belief.commit(both, Vector<d>::Zero(5), five, SE2()).status == Status::size_mismatch);

    CHECK(numbers(scene.belief) == before);
  }

  TEST_CASE("joint_gaussian: what is moved from is empty, and may be used again") {
    Scene scene(9);
    Slam belief = scene.belief;
    REQUIRE(belief.consider(scene.landmarks[0]) == Status::accepted);
    REQUIRE(belief.marginalise(scene.landmarks[1]) == Status::accepted);  // leaves a gap
    const Slam before = belief;
    Slam moved = std::move(belief);
    CHECK(numbers(moved) == numbers(before));
    for (const bool by_assignment : {false, true}) {
      CAPTURE(by_assignment);
      if (by_assignment) {
        belief = std::move(moved);
        std::swap(belief, moved);
      }
      CHECK(belief.empty());
      CHECK(belief.dof() == 0);
      CHECK(belief.covariance().size() == 0);
      CHECK_FALSE(belief.contains(scene.robot));
      const auto first = belief.add(Vector<2>(1, 2), Matrix<2>(Matrix<2>::Identity()));
      REQUIRE(first.accepted());
      CHECK(belief.dof() == 2);
      const auto second = belief.clone(first.id);
      REQUIRE(second.accepted());
      const cairn::LinearSensor<2, 2> sensor{Matrix<2>::Identity(), Matrix<2>(Matrix<2>::Identity())};
      REQUIRE(JointExtended{}.update(belief, sensor, Vector<2>(3, 2), second.id).accepted());
      CHECK(belief.mean(first.id)(0) == doctest::Approx(2));
      CHECK(belief.covariance(first.id)(1, 1) == doctest::Approx(0.5));
      CHECK(belief.covariance().rows() == 4);
      REQUIRE(belief.marginalise(belief.blocks()) == Status::accepted);
    }
  }

  TEST_CASE("joint_gaussian: blocks do not become vaguer beside considered ones that were known by them") {
    Slam belief;
    const auto a = belief.add(Vector<2>(1, 2), Matrix<2>(Matrix<2>::Identity())).id;
    const auto b = belief.clone(a).id;
    REQUIRE(belief.consider(b) == Status::accepted);
    const std::array<AnyBlockId, 1> named{a};
    const Vector<d> none = Vector<d>::Zero(2);
    const auto posterior = [](double first, double second) {
      Matrix<d, d> p = Matrix<d, d>::Zero(2, 2);
      p(0, 0) = first;
      p(1, 1) = second;
      return p;
    };
    const auto before = numbers(belief);
    // By the formula the two would vary with each other by 4, where one varies by 4 and the other by 1.
    CHECK(belief.commit(named, none, posterior(4, 4)) == Status::not_positive_definite);
    CHECK(belief.commit(named, none, posterior(0.5, 1.5)) == Status::not_positive_definite);
    CHECK(numbers(belief) == before);
    CHECK(belief.commit(named, none, posterior(1, 1)) == Status::accepted);
    CHECK(belief.commit(named, none, posterior(0.5, 1)) == Status::accepted);
    CHECK(belief.covariance(b) == Matrix<2>::Identity());
    REQUIRE(belief.consider(b, false) == Status::accepted);
    REQUIRE(belief.commit(named, none, posterior(2, 4)) == Status::accepted);
    CHECK(belief.covariance(b)(1, 1) == doctest::Approx(4));
  }

  TEST_CASE("joint_gaussian: a variance that rounding leaves below zero is no number that is not finite") {
    cairn::Random random(cairn_test::seed());
    int refused = 0;
    for (int trial = 0; trial < 300; ++trial) {
      const Vector<2> along(random.normal(), random.normal());
      Slam belief;
      const auto id =
          belief.add(Vector<2>(0, 0), cairn::symmetrised(Matrix<2>(along * along.transpose()))).id;
      cairn::LinearModel<2> process{Matrix<2>::Identity(), Matrix<2>::Zero()};
      process.transition << along(1), -along(0), 0, 1;  // of nothing but rounding in its first row
      const Status status = JointExtended{}.predict(belief, process, 1, id);
      CHECK(status != Status::not_finite);
      refused += status == Status::not_positive_definite ? 1 : 0;
    }
    CHECK(refused > 10);
  }

  TEST_CASE("joint_gaussian: sensors far better than the prior leave digits, or are refused") {
    // A follows from B, which is seen: by the inverse of sums of inverses, in long double.
    using Long = long double;
    struct Copy {
      using State = Vector<2>;
      using Measurement = Vector<1>;
      using New = Vector<2>;
      double variance;
      [[nodiscard]] New initialise(const State& x, const Measurement&) const { return x; }
      [[nodiscard]] Matrix<2> jacobian(const State&, const Measurement&) const {
        return Matrix<2>::Identity();
      }
      [[nodiscard]] Matrix<2> noise(const State&, const Measurement&) const {
        return variance * Matrix<2>::Identity();
      }
    };
    const auto inverse = [](const std::array<Long, 3>& a) {  // of a symmetric matrix: xx, xy, yy
      const Long det = a[0] * a[2] - a[1] * a[1];
      return std::array<Long, 3>{a[2] / det, -a[1] / det, a[0] / det};
    };
    const auto det = [](const Matrix<2>& m) { return std::abs(m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0)); };
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    int accepted = 0, refused = 0;
    for (int trial = 0; trial < 3000; ++trial) {
      const double r = std::pow(10.0, -1.0 - static_cast<double>(random.below(16)));
      Matrix<2> a, h;
      for (int i = 0; i < 4; ++i) {
        a.data()[i] = random.normal();
        h.data()[i] = random.normal();
      }
      const Matrix<2> p = cairn::symmetrised(Matrix<2>(a * a.transpose()));
      const bool beside = random.below(2) == 0;
      Slam belief;
      const auto seen = belief.add(Vector<2>(0, 0), p).id;
      const auto other = beside ? belief.augment(Copy{r}, Vector<1>(0.0), seen).id : seen;
      const cairn::LinearSensor<2, 2> sensor{h, r * Matrix<2>::Identity()};
      const Status status = JointExtended{}.update(belief, sensor, Vector<2>(0.1, 0.2), seen).status;
      (status == Status::accepted ? accepted : refused) += 1;
      if (!beside) REQUIRE(status == Status::accepted);
      if (r > 1e-7) REQUIRE(status == Status::accepted);
      if (status != Status::accepted) continue;
      std::array<Long, 3> information = inverse({p(0, 0), p(0, 1), p(1, 1)});
      for (int k = 0; k < 2; ++k) {
        information[0] += Long(h(k, 0)) * h(k, 0) / r;
        information[1] += Long(h(k, 0)) * h(k, 1) / r;
        information[2] += Long(h(k, 1)) * h(k, 1) / r;
      }
      const std::array<Long, 3> exact = inverse(information);
      for (int i = 0; i < 2; ++i) {
        const Long want = exact[static_cast<std::size_t>(2 * i)];
        CAPTURE(r);
        CHECK(std::abs(static_cast<double>(belief.covariance(seen)(i, i) / want - 1)) < 0.05);
        if (beside && det(a) > 0.3 && det(h) > 0.3)  // a prior that says what is asked of it
          CHECK(std::abs(static_cast<double>(belief.covariance(other)(i, i) / (want + r) - 1)) < 0.2);
      }
    }
    CHECK(accepted > 1000);
    CHECK(refused > 100);
  }

  TEST_CASE("joint_gaussian: a stack of blocks that all follow from one is taken in, with its rounding") {
    struct Follow {  // without noise: the joint covariance is singular
      using State = Vector<2>;
      using Measurement = Vector<1>;
      using New = Vector<2>;
      Matrix<2> by;
      [[nodiscard]] New initialise(const State& x, const Measurement&) const { return by * x; }
      [[nodiscard]] Matrix<2> jacobian(const State&, const Measurement&) const { return by; }
      [[nodiscard]] Matrix<2> noise(const State&, const Measurement&) const { return Matrix<2>::Zero(); }
    };
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const Form form : {Form::standard, Form::joseph})
      for (int trial = 0; trial < 200; ++trial) {
        CAPTURE(trial);
        const double r = std::pow(10.0, random.uniform(-8, -2));
        Slam belief;
        std::vector<BlockId<Vector<2>>> blocks{belief.add(Vector<2>(0, 0), Matrix<2>::Identity()).id};
        std::vector<Matrix<2>> by{Matrix<2>::Identity()};
        Matrix<2> information = Matrix<2>::Identity();
        StackedMeasurement<> stack;
        for (int i = 0; i < 6; ++i) {
          if (i > 0) {
            by.push_back(cairn_test::random_matrix<2, 2>(random));
            blocks.push_back(belief.augment(Follow{by.back()}, Vector<1>(0.0), blocks[0]).id);
          }
          const cairn::LinearSensor<2, 2> sensor{cairn_test::random_matrix<2, 2>(random),
                                                 r * Matrix<2>::Identity()};
          const Matrix<2> h = sensor.design * by.back();
          information += h.transpose() * h / r;
          REQUIRE(stack.add(belief, sensor, Vector<2>(0.1, 0.2), blocks.back()) == Status::accepted);
        }
        REQUIRE(JointExtended{.form = form}.update(belief, stack).accepted());
        const Matrix<2> left = cairn::Cholesky<2>(information).inverse();
        Matrix<d> p = belief.covariance();
        for (int i = 0; i < 12; ++i)
          for (int j = 0; j < 12; ++j) {
            const auto exact = [&](int k, int l) -> double {
              return by[static_cast<std::size_t>(k / 2)].row(k % 2) *
                     (left * by[static_cast<std::size_t>(l / 2)].row(l % 2).transpose());
            };
            CHECK(std::abs(p(i, j) - exact(i, j)) < 1e-6 * std::sqrt(exact(i, i) * exact(j, j)));
          }
        int order[12], rank = 0;
        double diagonal[12];
        CHECK(cairn::detail::pivoted_cholesky(p.data(), 12, order, diagonal, rank));
      }
  }

  TEST_CASE("joint_gaussian: steps too long for a rotation are refused") {
    struct Attitude {
      using State = cairn::SO3;
      using Measurement = Vector<3>;
      [[nodiscard]] Vector<3> predict(const State&) const { return Vector<3>::Zero(); }
      [[nodiscard]] Matrix<3> jacobian(const State&) const { return Matrix<3>::Identity(); }
      [[nodiscard]] Matrix<3> noise(const State&) const { return 1e307 * Matrix<3>::Identity(); }
    };
    JointGaussian<cairn::SO3> belief;
    const auto id = belief.add(cairn::SO3(), Matrix<3>(1e307 * Matrix<3>::Identity())).id;
    const auto twin = belief.clone(id).id;
    const Vector<3> far(1e155, 0, 0);
    CHECK(JointExtended{}.update(belief, Attitude{}, far, id).status == Status::not_finite);
    StackedMeasurement stack;
    REQUIRE(stack.add(belief, Attitude{}, far, id) == Status::accepted);
    CHECK(JointExtended{}.update(belief, stack).status == Status::not_finite);
    const std::array<AnyBlockId, 1> named{id};
    CHECK(belief.commit(named, far, Matrix<d, d>::Identity(3, 3)) != Status::accepted);
    CHECK(belief.mean(id).w() == 1);
    CHECK(belief.mean(twin).w() == 1);
    CHECK(JointExtended{}.update(belief, Attitude{}, Vector<3>(1, 0, 0), id).accepted());
  }

  TEST_CASE("joint_gaussian: reading a block that is not there goes to the violation handler") {
    Scene scene(2);
    REQUIRE(scene.belief.marginalise(scene.landmarks[0]) == Status::accepted);
    struct Broken {
      std::string sentence;
    };
    const auto previous =
        cairn::set_violation_handler([](const cairn::Violation& v) { throw Broken{v.sentence}; });
    CHECK_THROWS_AS(static_cast<void>(scene.belief.mean(scene.landmarks[0])), Broken);
    CHECK_THROWS_AS(static_cast<void>(scene.belief.covariance(scene.landmarks[0])), Broken);
    CHECK_THROWS_AS(static_cast<void>(scene.belief.marginal(scene.robot, scene.landmarks[0])), Broken);
    CHECK_THROWS_AS(static_cast<void>(scene.belief.mean(BlockId<SE2>{scene.landmarks[1]})), Broken);
    CHECK_THROWS_AS(static_cast<void>(scene.belief.considered(AnyBlockId{})), Broken);
    cairn::set_violation_handler(previous);
  }

  TEST_CASE(
      "joint_gaussian: takes what stands for a matrix: row-major, structured, expressions, run-time sizes") {
    struct Strange {
      using State = Product<SE2, Vector<2>>;
      using Measurement = Vector<3>;
      using RowMajor = Eigen::Matrix<double, 3, 5, Eigen::RowMajor>;
      RowMajor design;
      [[nodiscard]] Vector<3> predict(const State&) const { return Vector<3>::Zero(); }
      [[nodiscard]] const RowMajor& jacobian(const State&) const { return design; }
      [[nodiscard]] auto noise(const State&) const { return 2.0 * Matrix<3>::Identity(); }
    };
    struct Plain : Strange {
      [[nodiscard]] Matrix<3, 5> jacobian(const State&) const { return design; }
      [[nodiscard]] Matrix<d> noise(const State&) const { return 2.0 * Matrix<d>::Identity(3, 3); }
    };
    Scene scene(3);
    Slam other = scene.belief;
    Strange strange;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 5; ++j) strange.design(i, j) = i + 10 * j + (i == j ? 1 : 0);
    REQUIRE(JointExtended{}
                .update(scene.belief, strange, Vector<3>(1, 2, 3), scene.robot, scene.landmarks[1])
                .accepted());
    REQUIRE(JointExtended{}
                .update(other, Plain{{strange}}, Vector<3>(1, 2, 3), scene.robot, scene.landmarks[1])
                .accepted());
    CHECK(numbers(scene.belief) == numbers(other));
  }

  TEST_CASE(
      "joint_gaussian: where the difference has no digits left, the named rows are computed in Joseph's "
      "form") {
    // A prior a thousand kilometres wide and a fix of a millimetre: P - W W^T is rounding.
    struct Fix {
      using State = Vector<3>;
      using Measurement = Vector<3>;
      [[nodiscard]] Vector<3> predict(const State& x) const { return jacobian(x) * x; }
      [[nodiscard]] Matrix<3> jacobian(const State&) const {
        return (Matrix<3>() << 1, 0.3, 0.1, 0.2, 1, 0.4, 0.1, 0.5, 1).finished();
      }
      [[nodiscard]] Matrix<3> noise(const State&) const { return 1e-6 * Matrix<3>::Identity(); }
    };
    JointGaussian<Vector<3>> belief;
    const auto a = belief.add(Vector<3>(0, 0, 0), 1e12 * Matrix<3>::Identity()).id;
    const auto b = belief.add(Vector<3>(0, 0, 0), Matrix<3>::Identity()).id;
    REQUIRE(JointExtended{}.update(belief, Fix{}, Vector<3>(1, 2, 3), a).accepted());
    const Dense h(Fix{}.jacobian({}));
    const Dense gram = h.transposed() * h;  // the prior's 1e-12 is below rounding
    const Dense product = gram * Dense(Matrix<3>(1e6 * belief.covariance(a)));
    CHECK(difference(Matrix<3>::Identity(), product) < 1e-5);
    CHECK(belief.covariance(b) == Matrix<3>::Identity());
    // A landmark that hangs on it can be no better than the rounding of what it was; it is refused, not
    // negative.
    CHECK(cairn::detail::is_valid_covariance<d, double>(belief.covariance()));
  }

  TEST_CASE("joint_gaussian: stays a covariance over thousands of steps of a window of clones") {
    cairn::Random random(cairn_test::seed());
    for (const Form form : {Form::standard, Form::joseph}) {
      Scene scene(12);
      Slam& belief = scene.belief;
      const JointExtended filter{.form = form};
      std::vector<BlockId<SE2>> window;
      for (int step = 0; step < 2000; ++step) {
        REQUIRE(
            filter.predict(belief,
                           cairn::Unicycle{.speed_density = 1e-4, .slip_density = 1e-8, .turn_density = 1e-5},
                           0.02, Vector<2>(1, 0.3 * random.normal()), scene.robot) == Status::accepted);
        if (step % 5 == 0) {
          window.push_back(belief.clone(scene.robot).id);
          if (window.size() > 6) {
            REQUIRE(belief.marginalise(window.front()) == Status::accepted);
            window.erase(window.begin());
          }
        }
        const auto then = window[random.below(window.size())];
        const cairn_test::Passage passage{1e-6 * Matrix<3>::Identity()};
        const auto way =
            passage.predict(cairn_test::Passage::State(belief.mean(then), belief.mean(scene.robot)));
        REQUIRE(filter.update(belief, passage, way, then, scene.robot).accepted());
        const int i = static_cast<int>(random.below(12));
        REQUIRE(filter
                    .update(belief, Sighting{}, scene.seen(i), scene.robot,
                            scene.landmarks[static_cast<std::size_t>(i)])
                    .accepted());
        if (step % 100 == 0) REQUIRE(cairn::detail::is_valid_covariance<d, double>(belief.covariance()));
      }
    }
  }

  TEST_CASE("joint_gaussian: single precision, poses in space, and blocks that are products") {
    JointGaussian<cairn::SE2f, Vector<2, float>> small;
    const auto robot = small.add(cairn::SE2f(1, 2, 0.5F), 0.01F * Matrix<3, 3, float>::Identity()).id;
    const auto point = small.add(Vector<2, float>(4, 4), Matrix<2, 2, float>::Identity()).id;
    struct Offset {
      using State = Product<cairn::SE2f, Vector<2, float>>;
      using Measurement = Vector<2, float>;
      [[nodiscard]] Measurement predict(const State& x) const { return x.part<0>().inverse() * x.part<1>(); }
      [[nodiscard]] Matrix<2, 5, float> jacobian(const State& x) const {
        return cairn::automatic_jacobian(
            [](const auto& s) { return (s.template part<0>().inverse() * s.template part<1>()).eval(); }, x);
      }
      [[nodiscard]] Matrix<2, 2, float> noise(const State&) const {
        return 0.1F * Matrix<2, 2, float>::Identity();
      }
    };
    const float before = small.covariance(point).trace();
    REQUIRE(JointExtended{}.update(small, Offset{}, Vector<2, float>(3.5F, 0.3F), robot, point).accepted());
    CHECK(small.covariance(point).trace() < 0.3F * before);

    using Inertial = Product<SE3, Vector<3>>;  // a block of nine numbers
    JointGaussian<Inertial, SE3, Vector<3>> large;
    const auto body = large.add(Inertial(), Matrix<9>::Identity()).id;
    const auto clone = large.clone(body).id;
    const auto keyframe = large.add(SE3(), 0.1 * Matrix<6>::Identity()).id;
    CHECK(large.dof() == 24);
    CHECK(large.marginal(body, keyframe).covariance.trace() == doctest::Approx(9.6));
    CHECK(large.marginal(clone).covariance == Matrix<9>::Identity());
    const std::array<AnyBlockId, 2> two{keyframe, body};
    const Vector<d> error = Vector<d>::Constant(15, 0.1);
    CHECK(large.nees(two, error) == doctest::Approx(6 * 0.1 + 9 * 0.01));
  }

  TEST_CASE("joint: iterations that have not settled are refused, and the belief is left") {
    struct Cube {
      using State = Vector<1>;
      using Measurement = Vector<1>;
      double variance;
      [[nodiscard]] Vector<1> predict(const Vector<1>& x) const { return Vector<1>(x(0) * x(0) * x(0)); }
      [[nodiscard]] Matrix<1> jacobian(const Vector<1>& x) const { return Matrix<1>(3 * x(0) * x(0)); }
      [[nodiscard]] Matrix<1> noise(const Vector<1>&) const { return Matrix<1>(variance); }
    };
    for (const double variance : {1e-4, 0.0})  // measured exactly, too
      for (const int iterations : {2, 3, 30}) {
        CAPTURE(variance);
        CAPTURE(iterations);
        JointGaussian<Vector<1>> belief;
        const auto id = belief.add(Vector<1>(0.3), Matrix<1>(1.0)).id;
        const auto in =
            JointExtended{.iterations = iterations}.update(belief, Cube{variance}, Vector<1>(8.0), id);
        if (iterations < 10) {
          CHECK(in.status == Status::not_converged);
          CHECK(belief.mean(id)(0) == 0.3);
          CHECK(belief.covariance(id)(0, 0) == 1.0);
        } else {
          // Near 2, where the cube is 8 and its derivative 12: -(x - 0.3) = (x^3 - 8) 12 / variance.
          REQUIRE(in.accepted());
          CHECK(belief.mean(id)(0) == doctest::Approx(2 - variance * 1.7 / 144).epsilon(1e-9));
          const double sigma = std::sqrt(variance / 144);
          CHECK(std::abs(std::sqrt(belief.covariance(id)(0, 0)) - sigma) <= 1e-3 * sigma + 1e-12);
        }
      }
  }
}

}  // namespace
}  // namespace joint_gaussian_test
