// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/eval/kitti_metric.hpp>
#include <cairn/io/trajectory.hpp>

#include "support/data.hpp"
#include "support/random.hpp"

using cairn::PosePair;
using cairn::SE3;
using cairn::SO3;
using cairn::Vector;

namespace kitti_metric_test {
namespace {

// A straight drive of one metre a frame, seen by an odometry that is `stretch` too long and turns by `turn`
// radians a metre about the vertical.
std::vector<PosePair> drive(std::size_t frames, double stretch, double turn) {
  const SE3 truth_step(SO3(), Vector<3>(0, 0, 1));
  const SE3 estimate_step(SO3::exp(Vector<3>(0, turn, 0)), Vector<3>(0, 0, 1 + stretch));
  std::vector<PosePair> pairs(1);
  for (std::size_t i = 1; i < frames; ++i)
    pairs.push_back(
        {static_cast<double>(i), pairs[i - 1].truth * truth_step, pairs[i - 1].estimate * estimate_step});
  return pairs;
}

// The definition, segment by segment, with plain loops and matrices.
cairn::SegmentError by_definition(const std::vector<PosePair>& pairs) {
  std::vector<double> path{0.0};
  for (std::size_t i = 1; i < pairs.size(); ++i)
    path.push_back(path.back() + (pairs[i].truth.translation() - pairs[i - 1].truth.translation()).norm());
  cairn::SegmentError sum;
  for (std::size_t i = 0; i < pairs.size(); i += 10)
    for (int length = 100; length <= 800; length += 100) {
      std::size_t j = i;
      while (j < pairs.size() && !(path[j] > path[i] + length)) ++j;
      if (j == pairs.size()) continue;
      const cairn::Matrix<4> estimate = pairs[i].estimate.inverse().matrix() * pairs[j].estimate.matrix();
      const cairn::Matrix<4> truth = pairs[i].truth.inverse().matrix() * pairs[j].truth.matrix();
      const cairn::Matrix<3> R = estimate.topLeftCorner<3, 3>();
      const Vector<3> t = R.transpose() * (truth.topRightCorner<3, 1>() - estimate.topRightCorner<3, 1>());
      const double trace = (R.transpose() * truth.topLeftCorner<3, 3>()).trace();
      sum.translation += t.norm() / length;
      sum.rotation += std::acos(std::min(1.0, std::max(-1.0, 0.5 * (trace - 1.0)))) / length;
      ++sum.segments;
    }
  sum.translation /= static_cast<double>(sum.segments);
  sum.rotation /= static_cast<double>(sum.segments);
  return sum;
}

}  // namespace

TEST_SUITE("kitti_metric") {
  TEST_CASE("kitti_metric: a scale error of 1 % is 1 % on segments that end where they should") {
    const auto error = cairn::kitti_error(drive(1000, 0.01, 0.0));
    REQUIRE(error.has_value());
    REQUIRE(error->by_length.size() == 8);
    // A segment of length L ends at the first frame beyond it, one metre on.
    for (const cairn::SegmentError& segment : error->by_length)
      CHECK(segment.translation ==
            doctest::Approx(0.01 * (segment.length + 1) / segment.length).epsilon(1e-9));
    CHECK(error->by_length[0].segments == 90);  // starts 0, 10, ..., 890: 898 + 101 = 999 is the last frame
    CHECK(error->overall.rotation < 1e-9);
  }

  TEST_CASE("kitti_metric: a constant turn shows as its rate") {
    const double rate = 0.25 / 100 * std::numbers::pi / 180;  // 0.25 deg per 100 m
    const auto error = cairn::kitti_error(drive(500, 0.0, rate), {{200, 400}, 1});
    REQUIRE(error.has_value());
    CHECK(error->by_length[0].rotation_degrees_per_100m() == doctest::Approx(0.25 * 201 / 200).epsilon(1e-7));
    CHECK(error->by_length[1].rotation_degrees_per_100m() == doctest::Approx(0.25 * 401 / 400).epsilon(1e-7));
  }

  TEST_CASE("kitti_metric: a winding drive has the figures of the definition by plain loops") {
    cairn::Random random(cairn_test::seed());
    std::vector<PosePair> pairs(1);
    for (std::size_t i = 1; i < 1300; ++i) {
      const SE3 step(SO3::exp(Vector<3>(0, 0.05 * random.normal(), 0)),
                     Vector<3>(0, 0, random.uniform(0.5, 1.5)));
      const SE3 slip(SO3::exp(Vector<3>(0, 1e-3 * random.normal(), 0)),
                     Vector<3>(0, 0, 0.02 * random.normal()));
      pairs.push_back(
          {static_cast<double>(i), pairs.back().truth * step, pairs.back().estimate * step * slip});
    }
    const auto error = cairn::kitti_error(pairs);
    REQUIRE(error.has_value());
    const cairn::SegmentError oracle = by_definition(pairs);
    CHECK(error->overall.segments == oracle.segments);
    CHECK(error->overall.translation == doctest::Approx(oracle.translation).epsilon(1e-9));
    CHECK(error->overall.rotation == doctest::Approx(oracle.rotation).epsilon(1e-6));
  }

  TEST_CASE("kitti_metric: a path shorter than every length has no figure") {
    CHECK_FALSE(cairn::kitti_error(drive(100, 0.01, 0.0)).has_value());
    CHECK_FALSE(cairn::kitti_error({}).has_value());
  }

  TEST_CASE("kitti_metric: poses that are not finite are refused by name, in pairs and in rows") {
    auto pairs = drive(1000, 0.01, 0.0);
    std::vector<cairn::KittiRow> truth(pairs.size()), estimate(pairs.size());
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      truth[i] = pairs[i].truth.matrix().topRows<3>();
      estimate[i] = pairs[i].estimate.matrix().topRows<3>();
    }
    REQUIRE(cairn::kitti_error(truth, estimate).has_value());
    estimate[20](1, 3) = std::nan("");
    pairs[20].estimate = cairn::SE3(cairn::SO3(), Vector<3>(0, std::nan(""), 0));
    CHECK_THROWS_WITH_AS((void)cairn::kitti_error(pairs), doctest::Contains("pair 20"), cairn::Error);
    CHECK_THROWS_WITH_AS((void)cairn::kitti_error(truth, estimate), doctest::Contains("row 20"),
                         cairn::Error);
    truth[7](0, 3) = INFINITY;
    CHECK_THROWS_WITH_AS((void)cairn::kitti_error(truth, estimate), doctest::Contains("row 7"), cairn::Error);
  }

  TEST_CASE("kitti_metric: the published figures of KITTI 00, and the definition by plain loops") {
    const auto data = cairn_test::real_data("trajectories");
    if (!data) return;
    const cairn::Trajectory truth = cairn::read_kitti(*data / "KITTI_00_gt.txt");
    const std::vector<cairn::KittiRow> rows = cairn::read_kitti_rows(*data / "KITTI_00_gt.txt");
    struct Published {
      const char* file;
      double percent, degrees;
    };
    for (const Published& published :
         {Published{"KITTI_00_ORB.txt", 0.6997, 0.2536}, Published{"KITTI_00_SPTAM.txt", 1.487, 0.558}}) {
      CAPTURE(published.file);
      const auto printed = cairn::kitti_error(rows, cairn::read_kitti_rows(*data / published.file));
      REQUIRE(printed.has_value());
      const double half_a_digit = published.percent < 1.0 ? 0.00005 : 0.0005;
      CHECK(std::abs(printed->overall.translation_percent() - published.percent) < half_a_digit);
      CHECK(std::abs(printed->overall.rotation_degrees_per_100m() - published.degrees) < half_a_digit);

      const auto pairs = cairn::associate_by_index(truth, cairn::read_kitti(*data / published.file));
      const auto error = cairn::kitti_error(pairs);
      REQUIRE(error.has_value());
      const cairn::SegmentError oracle = by_definition(pairs);
      CHECK(error->overall.segments == oracle.segments);
      CHECK(error->overall.translation == doctest::Approx(oracle.translation).epsilon(1e-10));
      CHECK(error->overall.rotation == doctest::Approx(oracle.rotation).epsilon(1e-6));
      // Normalising the printed digits moves the mean angle by less than a thousandth of a degree.
      CHECK(std::abs(error->overall.translation_percent() - published.percent) < half_a_digit);
      CHECK(std::abs(error->overall.rotation_degrees_per_100m() - published.degrees) < 0.0005);
    }
  }
}

}  // namespace kitti_metric_test
