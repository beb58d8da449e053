// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// EKF-SLAM as a composition: does it know how wrong it is, and where do it and real robots end.
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/joint_extended.hpp>
#include <cairn/models/motion.hpp>

#include "filter/mrclam.hpp"
#include "filter/planar_slam.hpp"
#include "support/data.hpp"
#include "support/random.hpp"

namespace ekf_slam_test {
namespace {

using cairn::AnyBlockId;
using cairn::BlockId;
using cairn::JointExtended;
using cairn::JointGaussian;
using cairn::Matrix;
using cairn::SE2;
using cairn::Status;
using cairn::Vector;
using cairn_test::Sighting;

using Slam = JointGaussian<SE2, Vector<2>>;

enum class Mistake { none, no_correlations };

struct Nees {
  double pose = 0.0, all = 0.0;  // at the end of one run
  int numbers = 0;
};

// A robot drives a circle of 4 m twice among landmarks. Its heading stays known to about a degree: where it
// does not, EKF-SLAM turns optimistic whatever is done (S. Julier, J. Uhlmann, "A counter example to the
// theory of simultaneous localization and map building", ICRA 2001; T. Bailey et al., IROS 2006).
Nees drive(cairn::Random& random, Mistake mistake) {
  const cairn::Unicycle process{.speed_density = 4e-4, .slip_density = 1e-5, .turn_density = 1e-5};
  const Sighting sensor{.range_sigma = 0.05, .bearing_sigma = 0.02};
  const JointExtended filter{};
  std::vector<Vector<2>> truth;
  for (int i = 0; i < 10; ++i) truth.emplace_back(random.uniform(-8, 8), random.uniform(-4, 12));
  SE2 is(0, 0, 0);
  Slam belief;
  const auto robot = belief.add(is, Matrix<3>::Zero()).id;
  std::map<std::size_t, BlockId<Vector<2>>> landmarks;
  const Vector<2> u(1.0, 0.25);
  const double dt = 0.5;
  for (int step = 0; step < 100; ++step) {
    REQUIRE(filter.predict(belief, process, dt, u, robot) == Status::accepted);
    const Matrix<3> q = process.noise(is, u, dt);
    Vector<3> w;
    for (int i = 0; i < 3; ++i) w(i) = random.normal(0, std::sqrt(q(i, i)));
    is = cairn::retract(process.propagate(is, u, dt), w);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const Sighting::State x(is, truth[i]);
      auto z = sensor.predict(x);
      if (z.part<0>()(0) > 7 || z.part<0>()(0) < 0.5) continue;
      const double range_error = random.normal(0, sensor.range_sigma);
      z = cairn::retract(z, Vector<2>(range_error, random.normal(0, sensor.bearing_sigma)));
      if (const auto known = landmarks.find(i); known != landmarks.end()) {
        REQUIRE(filter.update(belief, sensor, z, robot, known->second).accepted());
      } else {
        const auto added = belief.augment(cairn::inverted(sensor), z, robot);
        REQUIRE(added.accepted());
        landmarks[i] = added.id;
      }
    }
    if (mistake == Mistake::no_correlations)
      for (auto& [i, id] : landmarks) {
        const cairn::Gaussian<Vector<2>> alone = belief.marginal(id);
        REQUIRE(belief.marginalise(id) == Status::accepted);
        id = belief.add(alone).id;
      }
  }
  Nees result;
  result.pose = cairn::nees(belief.marginal(robot), is);
  Vector<cairn::dynamic> error(belief.dof());
  std::vector<AnyBlockId> blocks{robot};
  error.head<3>() = cairn::local(belief.mean(robot), is);
  result.numbers = 3;
  for (const auto& [i, id] : landmarks) {
    blocks.push_back(id);
    error.segment<2>(result.numbers) = truth[i] - belief.mean(id);
    result.numbers += 2;
  }
  result.all = belief.nees(blocks, error);
  return result;
}

/// The motion that brings points nearest to others, least squares in the plane.
SE2 rigid_fit(const std::vector<Vector<2>>& from, const std::vector<Vector<2>>& to) {
  Vector<2> a = Vector<2>::Zero(), b = Vector<2>::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    a += from[i] / double(from.size());
    b += to[i] / double(from.size());
  }
  double sine = 0.0, cosine = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vector<2> p = from[i] - a, q = to[i] - b;
    cosine += p(0) * q(0) + p(1) * q(1);
    sine += p(0) * q(1) - p(1) * q(0);
  }
  const cairn::SO2 turn(std::atan2(sine, cosine));
  return SE2(turn, Vector<2>(b - turn * a));
}
double rms(const std::vector<Vector<2>>& from, const std::vector<Vector<2>>& to, const SE2& by) {
  double sum = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) sum += (by * from[i] - to[i]).squaredNorm();
  return std::sqrt(sum / double(from.size()));
}

struct Outcome {
  double path = 0.0, fitted_path = 0.0, landmarks = 0.0, fitted_landmarks = 0.0, odometry = 0.0;  // m, rms
  double nees = 0.0;  // of the pose, mean
  int sightings = 0, gated = 0, found = 0;
};

// The log of mrclam_test.cpp, but nothing is known of the landmarks but who they are.
Outcome map_the_hall(const std::filesystem::path& folder, int robot_number) {
  constexpr double begin = cairn_test::MrclamRun::begin;
  cairn_test::MrclamRun run(folder, robot_number);
  // the same noise as there
  const cairn::Unicycle process{.speed_density = 3e-3, .slip_density = 1e-4, .turn_density = 1e-2};
  const Sighting sensor{.range_sigma = 0.5, .bearing_sigma = 0.05};
  const JointExtended filter{.gate = cairn::chi_square_quantile(0.999, 2)};
  Slam belief;
  const SE2 start = run.truth_at(begin);
  const auto robot = belief.add(start, 1e-6 * Matrix<3>::Identity()).id;
  SE2 dead = start;
  std::map<int, BlockId<Vector<2>>> landmarks;
  Vector<2> control = Vector<2>::Zero();
  double time = begin;
  const auto move = [&](double to) {
    if (to <= time) return;
    REQUIRE(filter.predict(belief, process, to - time, control, robot) == Status::accepted);
    dead = process.propagate(dead, control, to - time);
    time = to;
  };
  Outcome out;
  cairn::RunningMoments nees;
  std::vector<Vector<2>> path, true_path, dead_path;
  std::size_t next = 0;
  for (const auto& row : run.odometry) {
    for (; next < run.sightings.size() && run.sightings[next][0] <= row[0]; ++next) {
      const auto& seen = run.sightings[next];
      const auto subject = run.subject_of.find(static_cast<int>(seen[1]));
      if (seen[0] < begin || subject == run.subject_of.end() || run.landmarks.count(subject->second) == 0)
        continue;
      move(seen[0]);
      const auto z = Sighting::measurement(seen[2], seen[3]);
      ++out.sightings;
      if (const auto known = landmarks.find(subject->second); known != landmarks.end()) {
        const auto in = filter.update(belief, sensor, z, robot, known->second);
        REQUIRE((in.accepted() || in.status == Status::gated));
        out.gated += in.accepted() ? 0 : 1;
      } else {
        const auto added = belief.augment(cairn::inverted(sensor), z, robot);
        REQUIRE(added.accepted());
        landmarks[subject->second] = added.id;
      }
    }
    move(row[0]);
    control = Vector<2>(row[1], row[2]);
    if (row[0] < begin + 5.0) continue;
    const SE2 is = run.truth_at(time);
    path.push_back(belief.mean(robot).translation());
    true_path.push_back(is.translation());
    dead_path.push_back(dead.translation());
    nees.add(cairn::nees(belief.marginal(robot), is));
  }
  std::vector<Vector<2>> map, true_map;
  for (const auto& [subject, id] : landmarks) {
    map.push_back(belief.mean(id));
    true_map.push_back(run.landmarks[subject]);
  }
  const SE2 fit = rigid_fit(path, true_path);
  out.path = rms(path, true_path, SE2());
  out.fitted_path = rms(path, true_path, fit);
  out.landmarks = rms(map, true_map, SE2());
  out.fitted_landmarks = rms(map, true_map, rigid_fit(map, true_map));
  out.odometry = rms(dead_path, true_path, rigid_fit(dead_path, true_path));
  out.nees = nees.mean();
  out.found = belief.size() - 1;
  return out;
}

TEST_SUITE("ekf_slam") {
  TEST_CASE("ekf_slam: is consistent where headings stay known, and is not where correlations are dropped") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    for (const Mistake mistake : {Mistake::none, Mistake::no_correlations}) {
      cairn::Random random(seed);
      constexpr int runs = 100;
      double pose = 0.0, all = 0.0, numbers = 0.0;
      for (int run = 0; run < runs; ++run) {
        const Nees nees = drive(random, mistake);
        pose += nees.pose;
        all += nees.all;
        numbers += nees.numbers;
      }
      const auto band = cairn::chi_square_mean_band(3, runs, 0.999);
      const auto whole = cairn::chi_square_mean_band(numbers, 1, 0.999);  // of a sum
      MESSAGE("NEES of the pose ", pose / runs, " of 3 (", band.low, " to ", band.high, "), of everything ",
              all, " of ", numbers, " (", whole.low, " to ", whole.high, ")");
      if (mistake == Mistake::none) {
        CHECK(band.contains(pose / runs));
        CHECK(whole.contains(all));
      } else {
        CHECK(all > 3 * whole.high);
      }
    }
  }

  TEST_CASE("ekf_slam: maps a hall with real robots (MRCLAM 7), who is who being known") {
    const auto folder = cairn_test::real_data("mrclam_7");
    if (!folder) return;
    for (const int robot : {1, 2, 3}) {
      const Outcome o = map_the_hall(*folder, robot);
      MESSAGE("robot ", robot, ": path ", o.path, " m, after a rigid fit ", o.fitted_path, "; ", o.found,
              " landmarks ", o.landmarks, ", after one of their own ", o.fitted_landmarks,
              "; odometry alone, fitted, ", o.odometry, "; NEES of the pose ", o.nees, " of 3; ", o.gated,
              " of ", o.sightings, " gated");
      // In the first minute robot 1's gyro is off by a degree a second, and a map that is born then is turned
      // as a whole.
      CHECK(o.fitted_path < 0.25);
      CHECK(o.fitted_path < 0.6 * o.odometry);
      CHECK(o.fitted_landmarks < 0.15);
      CHECK(o.found == 15);
      CHECK(o.gated < o.sightings / 100);
    }
  }
}

}  // namespace
}  // namespace ekf_slam_test
