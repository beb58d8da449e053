// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/eval/trajectory_error.hpp>
#include <cairn/io/trajectory.hpp>

#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"
#include "support/violation.hpp"

using cairn::AlignBy;
using cairn::PosePair;
using cairn::SE3;
using cairn::SO3;
using cairn::Trajectory;
using cairn::Vector;

namespace trajectory_error_test {
namespace {

SE3 random_pose(cairn::Random& random, double metres) {
  return SE3(SO3::from_quaternion(random.normal(), random.normal(), random.normal(), random.normal()),
             metres * Vector<3>(random.normal(), random.normal(), random.normal()));
}

std::vector<PosePair> random_pairs(cairn::Random& random, std::size_t count) {
  std::vector<PosePair> pairs;
  for (std::size_t i = 0; i < count; ++i) {
    const SE3 truth = random_pose(random, 5.0);
    pairs.push_back({0.1 * static_cast<double>(i), truth, truth});
  }
  return pairs;
}

// The pairs seen from another world: p' = scale * R p + t.
std::vector<PosePair> moved(std::vector<PosePair> pairs, const SE3& T, double scale) {
  for (PosePair& pair : pairs)
    pair.estimate = SE3(T.rotation() * pair.estimate.rotation(),
                        scale * (T.rotation() * pair.estimate.translation()) + T.translation());
  return pairs;
}

}  // namespace

TEST_SUITE("trajectory_error") {
  TEST_CASE("trajectory_error: statistics equal their definitions") {
    const cairn::ErrorStatistics s = cairn::error_statistics({3.0, 1.0, 2.0, 6.0});
    CHECK(s.count == 4);
    CHECK(s.sum_of_squares == 50.0);
    CHECK(s.rmse == doctest::Approx(std::sqrt(12.5)));
    CHECK(s.mean == 3.0);
    CHECK(s.median == 2.5);
    CHECK(s.standard_deviation == doctest::Approx(std::sqrt(3.5)));
    CHECK(s.smallest == 1.0);
    CHECK(s.largest == 6.0);
    CHECK(cairn::error_statistics({}).rmse == 0.0);
  }

  TEST_CASE("trajectory_error: an estimate in another world has no error once it is aligned") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const std::vector<PosePair> pairs = random_pairs(random, 50);
    const SE3 T = random_pose(random, 100.0);
    const auto rigid = cairn::absolute_error(moved(pairs, T, 1.0), AlignBy::rigid);
    const auto first = cairn::absolute_error(moved(pairs, T, 1.0), AlignBy::first_pose);
    const auto scaled = cairn::absolute_error(moved(pairs, T, 0.25), AlignBy::similarity);
    const auto none = cairn::absolute_error(moved(pairs, T, 1.0), AlignBy::none);
    for (const auto& error : {rigid, first, scaled}) {
      REQUIRE(error.has_value());
      CHECK(error->translation.largest < 1e-11);
      REQUIRE(error->rotation.has_value());
      CHECK(error->rotation->largest < 1e-11);
    }
    CHECK(scaled->scale == doctest::Approx(4.0).epsilon(1e-12));
    REQUIRE(none.has_value());
    double squares = 0;
    for (const PosePair& pair : moved(pairs, T, 1.0))
      squares += (pair.estimate.translation() - pair.truth.translation()).squaredNorm();
    CHECK(none->translation.sum_of_squares == doctest::Approx(squares));
  }

  TEST_CASE("trajectory_error: no rigid motion near the alignment has a smaller error") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    std::vector<PosePair> pairs = random_pairs(random, 30);
    for (PosePair& pair : pairs)
      pair.estimate = SE3(SO3(), pair.truth.translation() +
                                     0.2 * Vector<3>(random.normal(), random.normal(), random.normal()));
    const auto best = cairn::absolute_error(pairs, AlignBy::rigid);
    REQUIRE(best.has_value());
    for (int i = 0; i < 6; ++i)
      for (const double size : {1e-3, -1e-3}) {
        Vector<6> d = Vector<6>::Zero();
        d(i) = size;
        const SE3 other = best->T_truth_estimate * SE3::exp(d);
        const auto error = cairn::absolute_error(moved(pairs, other, 1.0), AlignBy::none);
        CHECK(error->translation.sum_of_squares > best->translation.sum_of_squares);
      }
  }

  TEST_CASE("trajectory_error: nothing to align by is no figure, not a wrong one") {
    CHECK_FALSE(cairn::absolute_error({}, AlignBy::rigid).has_value());
    const std::vector<PosePair> still(5, PosePair{0.0, SE3(), SE3()});
    CHECK_FALSE(cairn::absolute_error(still, AlignBy::rigid).has_value());
    CHECK(cairn::absolute_error(still, AlignBy::first_pose)->translation.rmse == 0.0);
  }

  TEST_CASE("trajectory_error: a straight path is aligned") {
    std::vector<PosePair> line;
    for (int i = 0; i < 20; ++i)
      line.push_back({0.0, SE3(SO3(), Vector<3>(0, 0, i)), SE3(SO3(), Vector<3>(i, 7, 0))});
    const auto error = cairn::absolute_error(line, AlignBy::rigid);
    REQUIRE(error.has_value());
    CHECK(error->translation.rmse < 1e-12);
    for (const AlignBy by : {AlignBy::rigid, AlignBy::similarity})
      for (const std::size_t count : {2U, 3U, 20U})
        CHECK_FALSE(cairn::absolute_error(std::span(line).first(count), by)->rotation.has_value());
    for (const AlignBy by : {AlignBy::none, AlignBy::first_pose})
      CHECK(cairn::absolute_error(line, by)->rotation.has_value());
  }

  TEST_CASE(
      "trajectory_error: attitudes have an error where the path leaves its line by more than is wrong") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const SE3 T = random_pose(random, 100.0);
    for (const double bend : {0.0, 0.02, 0.5, 5.0})
      for (const double wrong : {0.0, 1e-4, 0.01}) {
        CAPTURE(bend);
        CAPTURE(wrong);
        std::vector<PosePair> pairs;
        for (int i = 0; i < 100; ++i) {
          const SE3 truth(SO3(), Vector<3>(i, bend * std::sin(0.1 * i), 0));
          const Vector<3> noise(random.normal(), random.normal(), random.normal());
          pairs.push_back({0.1 * i, truth, SE3(SO3(), truth.translation() + wrong * noise)});
        }
        for (const AlignBy by : {AlignBy::rigid, AlignBy::similarity}) {
          const auto error = cairn::absolute_error(moved(pairs, T, 1.0), by);
          REQUIRE(error.has_value());
          CHECK(error->translation.rmse < 2 * wrong + 1e-9);
          CHECK(error->rotation.has_value() == (bend > 10 * wrong));
          if (error->rotation) CHECK(error->rotation->largest < 0.1);
        }
      }
  }

  TEST_CASE("trajectory_error: pieces of published paths have attitudes after a fit where those are right") {
    const auto data = cairn_test::real_data("trajectories");
    if (!data) return;
    const double degree = std::acos(-1) / 180;
    const Trajectory kitti = cairn::read_kitti(*data / "KITTI_00_gt.txt");
    const auto orb = cairn::associate_by_index(kitti, cairn::read_kitti(*data / "KITTI_00_ORB.txt"));
    const std::span<const PosePair> straight = std::span(orb).first(40);
    CHECK_FALSE(cairn::absolute_error(straight, AlignBy::rigid)->rotation.has_value());
    CHECK(std::abs(cairn::absolute_error(straight, AlignBy::first_pose)->rotation->rmse - 1.3 * degree) <
          0.05 * degree);

    std::size_t determined = 0;
    double worst = 0;  // after a fit, beside that of the first pose
    for (const std::vector<PosePair>& whole :
         {orb, cairn::associate_by_index(kitti, cairn::read_kitti(*data / "KITTI_00_SPTAM.txt")),
          cairn::associate(cairn::read_tum(*data / "fr2_desk_groundtruth.txt"),
                           cairn::read_tum(*data / "fr2_desk_ORB.txt")),
          cairn::associate(cairn::read_euroc(*data / "V102_groundtruth.csv"),
                           cairn::read_tum(*data / "V102.txt"))}) {
      CHECK(cairn::absolute_error(whole, AlignBy::rigid)->rotation->rmse < 3 * degree);
      for (const std::size_t count : {10U, 20U, 40U, 80U, 160U, 320U, 640U})
        for (std::size_t i = 0; i + count <= whole.size(); i += count) {
          const std::span<const PosePair> piece = std::span(whole).subspan(i, count);
          const auto rigid = cairn::absolute_error(piece, AlignBy::rigid);
          REQUIRE(rigid.has_value());
          if (!rigid->rotation) continue;
          ++determined;
          const auto first = cairn::absolute_error(piece, AlignBy::first_pose);
          worst = std::max(worst, rigid->rotation->rmse - first->rotation->rmse);
        }
    }
    CHECK(determined > 500);
    CHECK(worst < 10.2 * degree);
  }

  TEST_CASE("relative_error: a constant slip per frame shows in frames and in metres") {
    const SE3 truth_step(SO3(), Vector<3>(1, 0, 0));
    const SE3 slip(SO3::exp(Vector<3>(0, 0, 0.01)), Vector<3>(0.02, 0, 0));
    std::vector<PosePair> pairs(1);
    for (int i = 1; i < 101; ++i)
      pairs.push_back({static_cast<double>(i), pairs.back().truth * truth_step,
                       pairs.back().estimate * truth_step * slip});
    const auto frames = cairn::relative_error(pairs);
    REQUIRE(frames.has_value());
    CHECK(frames->translation.count == 100);
    CHECK(frames->translation.rmse == doctest::Approx(0.02).epsilon(1e-9));
    CHECK(frames->rotation.rmse == doctest::Approx(0.01).epsilon(1e-9));
    const auto metres = cairn::relative_error(pairs, {.delta = 10, .unit = cairn::DeltaUnit::metres});
    REQUIRE(metres.has_value());
    CHECK(metres->rotation.count == 10);  // one after the other
    CHECK(metres->rotation.mean == doctest::Approx(0.1).epsilon(1e-9));
    const auto all =
        cairn::relative_error(pairs, {.delta = 10, .unit = cairn::DeltaUnit::metres, .all_pairs = true});
    REQUIRE(all.has_value());
    CHECK(all->rotation.count == 92);  // from 0..90, and 91 takes the end: 9 m are within 10 %
    const auto tens = cairn::relative_error(pairs, {.delta = 10, .all_pairs = true});
    CHECK(tens->rotation.count == 91);
    CHECK(tens->rotation.largest == doctest::Approx(0.1).epsilon(1e-9));
    CHECK_FALSE(cairn::relative_error(pairs, {.delta = 101}).has_value());
    CHECK_FALSE(cairn::relative_error(pairs, {.delta = 500, .unit = cairn::DeltaUnit::metres}).has_value());
  }

  TEST_CASE(
      "relative_error: a distance that is lost beside the path's own leads from each pose to the next") {
    std::vector<PosePair> pairs;
    for (int i = 0; i < 5; ++i) {
      const SE3 pose(SO3(), Vector<3>(1e6 * i, 0, 0));
      pairs.push_back({static_cast<double>(i), pose, pose});
    }
    pairs.insert(pairs.begin() + 2, pairs[2]);  // which stands still there
    for (const bool all : {false, true}) {
      const auto listed = cairn::detail::relative_pairs(
          pairs, {.delta = 1e-20, .unit = cairn::DeltaUnit::metres, .all_pairs = all, .tolerance = 1e30});
      REQUIRE(listed.size() == 5);
      for (std::size_t i = 0; i < 5; ++i) CHECK(listed[i] == std::pair(i, i + 1));
    }
    pairs[3].truth = SE3(SO3(), Vector<3>(std::nan(""), 0, 0));
    for (const auto& [i, j] :
         cairn::detail::relative_pairs(pairs, {.delta = 1, .unit = cairn::DeltaUnit::metres}))
      CHECK(i < j);
  }

  TEST_CASE("relative_error: poses anywhere have the error of the definition in matrices") {
    cairn::Random random(cairn_test::seed());
    std::vector<PosePair> pairs = random_pairs(random, 12);
    for (PosePair& pair : pairs) pair.estimate = random_pose(random, 5.0);
    double squares = 0, angles = 0;
    for (std::size_t i = 0; i + 3 < pairs.size(); ++i) {
      const cairn::Matrix<4> truth = pairs[i].truth.matrix().inverse() * pairs[i + 3].truth.matrix();
      const cairn::Matrix<4> estimate = pairs[i].estimate.matrix().inverse() * pairs[i + 3].estimate.matrix();
      const cairn::Matrix<4> E = truth.inverse() * estimate;
      squares += E.topRightCorner<3, 1>().squaredNorm();
      angles += std::acos(0.5 * (E.topLeftCorner<3, 3>().trace() - 1.0));
    }
    const auto error = cairn::relative_error(pairs, {.delta = 3, .all_pairs = true});
    REQUIRE(error.has_value());
    CHECK(error->translation.sum_of_squares == doctest::Approx(squares).epsilon(1e-9));
    CHECK(error->rotation.mean == doctest::Approx(angles / 9).epsilon(1e-6));
  }

  TEST_CASE("associate: what has no time belongs to nothing") {
    const double nan = std::nan("");
    const Trajectory good{{0.0, SE3()}, {1.0, SE3()}}, bad{{0.0, SE3()}, {nan, SE3()}};
    CHECK(cairn::associate(good, bad).size() == 1);
    CHECK(cairn::associate(Trajectory{{nan, SE3()}}, good).empty());
    CHECK(cairn::associate(good, good, {.offset = nan}).empty());
    CHECK(cairn::associate(good, good, {.largest_difference = nan}).empty());
    CHECK(cairn::associate(good, good).size() == 2);
    // One among others hides none of them.
    const Trajectory long_one{{nan, SE3()}, {0.0, SE3()}, {1.0, SE3()},
                              {nan, SE3()}, {2.0, SE3()}, {3.0, SE3()}};
    const auto pairs =
        cairn::associate(long_one, Trajectory{{0.0, SE3()}, {2.0, SE3()}, {nan, SE3()}, {3.0, SE3()}});
    REQUIRE(pairs.size() == 3);
    for (std::size_t i = 0; i < 3; ++i) CHECK(pairs[i].time == std::array{0.0, 2.0, 3.0}[i]);
    const Trajectory back{{1.0, SE3()}, {nan, SE3()}, {0.0, SE3()}};
    CHECK_FALSE(cairn_test::violation_of([&] { static_cast<void>(cairn::associate(back, good)); }).empty());
  }

  TEST_CASE(
      "trajectory_error: poses that are not finite are refused by name, an endless delta has no pairs") {
    const double infinity = std::numeric_limits<double>::infinity();
    std::vector<cairn::PosePair> pairs(4);
    for (int i = 0; i < 4; ++i)
      pairs[static_cast<std::size_t>(i)] = {double(i), SE3(cairn::SO3(), cairn::Vector<3>(i, 0, 0)),
                                            SE3(cairn::SO3(), cairn::Vector<3>(2 * i, 0, 0))};
    for (const bool all_pairs : {false, true})
      for (const auto unit : {cairn::DeltaUnit::frames, cairn::DeltaUnit::metres})
        CHECK_FALSE(cairn::relative_error(pairs, {.delta = infinity, .unit = unit, .all_pairs = all_pairs}));
    pairs[2].estimate = SE3(cairn::SO3(), cairn::Vector<3>(std::nan(""), 0, 0));
    for (const auto by : {cairn::AlignBy::none, cairn::AlignBy::first_pose, cairn::AlignBy::rigid})
      CHECK(cairn_test::message_of([&] {
              static_cast<void>(cairn::absolute_error(pairs, by));
            }).find("pair 2") != std::string::npos);
    CHECK(cairn_test::message_of([&] { static_cast<void>(cairn::relative_error(pairs)); }).find("pair 2") !=
          std::string::npos);
  }

  TEST_CASE("associate: the earlier of two equally near, the first of two that want the same") {
    const Trajectory seconds{{0.0, SE3()}, {1.0, SE3(SO3(), Vector<3>(1, 0, 0))}};
    const Trajectory between{{0.5, SE3()}};
    const cairn::AssociationOptions wide{.largest_difference = 1};
    REQUIRE(cairn::associate(seconds, between, wide).size() == 1);
    CHECK(cairn::associate(seconds, between, wide)[0].truth.translation()(0) == 0.0);
    const auto same = cairn::associate(between, seconds, wide);
    REQUIRE(same.size() == 1);
    CHECK(same[0].time == 0.0);
  }

  TEST_CASE("associate: the nearest in time, one to one, within the limit") {
    Trajectory truth, estimate;
    for (int i = 0; i < 10; ++i) truth.push_back({static_cast<double>(i), SE3(SO3(), Vector<3>(i, 0, 0))});
    for (const double time : {-0.005, 0.004, 0.96, 2.5, 4.008, 9.02, 30.0})
      estimate.push_back({time, SE3(SO3(), Vector<3>(time, 1, 0))});
    const auto pairs = cairn::associate(truth, estimate, {.largest_difference = 0.05});
    REQUIRE(pairs.size() == 4);
    CHECK(pairs[0].time == 0.004);  // nearer than -0.005
    CHECK(pairs[1].time == 0.96);
    CHECK(pairs[2].truth.translation()(0) == 4.0);
    CHECK(pairs[3].time == 9.02);
    CHECK(cairn::associate(truth, estimate).size() == 2);
    CHECK(cairn::associate(truth, estimate, {.largest_difference = 0.01, .offset = -0.02}).size() == 1);
    CHECK(cairn::associate({}, estimate).empty());
    CHECK(cairn::associate(truth, {}).empty());
    CHECK_THROWS_AS(static_cast<void>(cairn::associate_by_index(truth, estimate)), cairn::Error);
  }

  TEST_CASE("trajectory_error: published trajectories give published figures") {
    const auto data = cairn_test::real_data("trajectories");
    if (!data) return;
    const Trajectory kitti = cairn::read_kitti(*data / "KITTI_00_gt.txt");
    const auto ate = [](const std::vector<PosePair>& pairs, AlignBy by) {
      const auto error = cairn::absolute_error(pairs, by);
      REQUIRE(error.has_value());
      return error->translation.rmse;
    };
    const auto orb = cairn::associate_by_index(kitti, cairn::read_kitti(*data / "KITTI_00_ORB.txt"));
    CHECK(std::abs(ate(orb, AlignBy::rigid) - 1.303) < 0.0005);
    const auto sptam = cairn::associate_by_index(kitti, cairn::read_kitti(*data / "KITTI_00_SPTAM.txt"));
    CHECK(std::abs(ate(sptam, AlignBy::rigid) - 3.74) < 0.005);

    // ORB-SLAM2 gives 0.9 cm for fr2/desk, aligned rigidly (Mur-Artal, Tardos, T-RO 2017, table III).
    const auto desk = cairn::associate(cairn::read_tum(*data / "fr2_desk_groundtruth.txt"),
                                       cairn::read_tum(*data / "fr2_desk_ORB.txt"));
    CHECK(desk.size() == 2174);
    CHECK(std::abs(ate(desk, AlignBy::rigid) - 0.009) < 0.001);
    CHECK(ate(desk, AlignBy::similarity) < ate(desk, AlignBy::rigid));
    const auto v102 = cairn::associate(cairn::read_euroc(*data / "V102_groundtruth.csv"),
                                       cairn::read_tum(*data / "V102.txt"));
    CHECK(v102.size() == 794);
    CHECK(std::abs(ate(v102, AlignBy::rigid) - 0.092) < 0.0005);
    CHECK(ate(v102, AlignBy::similarity) < ate(v102, AlignBy::rigid));
  }
}

}  // namespace trajectory_error_test
