// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Robots in a hall among known landmarks (mrclam.hpp).
#include "filter/mrclam.hpp"

#include <cmath>
#include <cstddef>
#include <filesystem>

#include <doctest/doctest.h>

#include <cairn/core/statistics.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "support/data.hpp"

namespace mrclam_test {
namespace {

using cairn::Gaussian;
using cairn::SE2;
using cairn::Status;
using cairn::Vector;

struct Outcome {
  double position_error = 0.0, heading_error = 0.0;  // root mean square
  double in_sight = 0.0;        // of the position, where a landmark was seen in the last second
  double odometry_error = 0.0;  // at the end, of the odometry alone
  double nees = 0.0;            // mean
  int sightings = 0, gated = 0;
};

constexpr double begin = cairn_test::MrclamRun::begin;

template <class Filter>
Outcome drive(const std::filesystem::path& folder, int robot, const Filter& filter) {
  cairn_test::MrclamRun run(folder, robot);
  // From sensors against truth: ranges err by 0.12 to 0.19 m, bearings by 0.01 to 0.08 rad, distance and turn
  // over 5 s by 0.04 m and 0.08 to 0.11 rad. These errors last, for seconds and longer, so that a reading is
  // worth less than its own sigma: about three times as much for all is what keeps NEES in its band.
  const cairn::Unicycle process{.speed_density = 3e-3, .slip_density = 1e-4, .turn_density = 1e-2};
  Gaussian<SE2> belief{run.truth_at(begin), Vector<3>(1e-3, 1e-3, 1e-3).asDiagonal()};
  SE2 dead = belief.mean;
  Vector<2> control = Vector<2>::Zero();
  double time = begin;
  const auto move = [&](double to) {
    if (to <= time) return;
    REQUIRE(filter.predict(belief, process, to - time, control) == Status::accepted);
    dead = process.propagate(dead, control, to - time);
    time = to;
  };
  Outcome out;
  cairn::RunningMoments position, heading, in_sight, nees;
  double last_sighting = 0.0;
  std::size_t next = 0;
  for (const auto& row : run.odometry) {
    for (; next < run.sightings.size() && run.sightings[next][0] <= row[0]; ++next) {
      const auto& seen = run.sightings[next];
      const auto subject = run.subject_of.find(static_cast<int>(seen[1]));
      if (seen[0] < begin || subject == run.subject_of.end() || run.landmarks.count(subject->second) == 0)
        continue;
      move(seen[0]);
      const cairn::RangeBearing sensor{
          .beacon = run.landmarks[subject->second], .range_sigma = 0.5, .bearing_sigma = 0.05};
      const auto in = filter.update(belief, sensor, cairn::RangeBearing::measurement(seen[2], seen[3]));
      REQUIRE((in.accepted() || in.status == Status::gated));
      ++out.sightings;
      last_sighting = time;
      out.gated += in.accepted() ? 0 : 1;
    }
    move(row[0]);
    control = Vector<2>(row[1], row[2]);
    if (row[0] < begin + 5.0) continue;
    const SE2 is = run.truth_at(time);
    const Vector<3> error = cairn::local(belief.mean, is);
    position.add(error.head<2>().squaredNorm());
    heading.add(error(2) * error(2));
    if (time - last_sighting < 1.0) in_sight.add(error.head<2>().squaredNorm());
    nees.add(cairn::nees(belief, is));
  }
  out.position_error = std::sqrt(position.mean());
  out.heading_error = std::sqrt(heading.mean());
  const Vector<3> drift = cairn::local(dead, run.truth_at(time));
  out.in_sight = std::sqrt(in_sight.mean());
  out.odometry_error = drift.head<2>().norm();
  out.nees = nees.mean();
  return out;
}

TEST_SUITE("mrclam") {
  TEST_CASE(
      "extended and unscented: robots among known landmarks, on the true way and aware of their error") {
    const auto folder = cairn_test::real_data("mrclam_7");
    if (!folder) return;
    const double gate = cairn::chi_square_quantile(0.999, 2);
    for (const int robot : {1, 2, 3}) {
      const Outcome extended = drive(*folder, robot, cairn::Extended{.gate = gate});
      const Outcome unscented = drive(*folder, robot, cairn::Unscented{.gate = gate});
      for (const Outcome& o : {extended, unscented}) {
        // a third of the time no landmark is in sight, for up to 39 s
        MESSAGE("robot ", robot, ": ", o.position_error, " m (", o.in_sight, " m with a landmark in sight), ",
                o.heading_error, " rad, NEES ", o.nees, ", odometry alone ", o.odometry_error, " m, ",
                o.gated, " of ", o.sightings, " gated");
        CHECK(o.position_error < 0.25);
        CHECK(o.in_sight < 0.2);
        CHECK(o.heading_error < 0.2);
        CHECK(o.odometry_error > 1.0);
        CHECK(o.nees > 0.75);  // of 3
        CHECK(o.nees < 5.0);
        CHECK(o.gated < o.sightings / 20);
        CHECK(o.sightings > 300);
      }
      CHECK(std::abs(extended.position_error - unscented.position_error) < 0.01);
    }
  }
}

}  // namespace
}  // namespace mrclam_test
