// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// 03 Robot and beacons: where am I, and which way do I look?
//
// STORY  A robot drives around a block. It knows what it was told to do, not how its wheels slipped. Now and
// then it sees one of three beacons, whose places it knows: how far it is, and in which direction.
//
//   T  pose believed             [m, m, rad]     r, b  range and bearing of a beacon         [m, rad]
//   u  speed and turn rate       [m/s, rad/s]    d     a small step of T: ahead, left, turn  [m, m, rad]
//   P  covariance of the d from estimate to truth: truth = T exp(d)     p  T^-1 beacon: as seen from T
//   z  a sighting (r, b), R its noise;   h  the same, expected;   H  the Jacobian of h by d, 2 x 3
//   G  the Jacobian of a motion (F in 02): the old pose's d, as seen from the new one;   Q  its noise
// EQUATIONS of the extended filter, u dt = (speed dt, 0, turn rate dt) (J. Sola, J. Deray, D. Atchuthan, "A
// micro Lie theory for state estimation in robotics", 2018)
//   T <- T exp(u dt),        P <- G P G' + Q,   G = Ad(exp(-u dt)): minus, as the old pose lies at -u dt
//   T <- T exp(K (z - h)),   P <- (1 - K H) P,  K = P H' (H P H' + R)^-1
//   h = (|p|, atan2(p_y, p_x));   z - h of bearings is the short way round: 2 from 179 to -179 degrees
// LOOK AT  the film at 1.5 s, by arrow keys to 3.5 s: the ellipse grows sideways, as a wrong heading
// becomes a wrong place; then a beacon shrinks it. Last plot: plain z - h (black, in the corners).
// CHANGE THIS (answers at the end of the file)
//   1. Change step % 4 == 3 into step % 20 == 3: seldom a beacon. NEES? And with Unscented as `filter`?
//   2. bearing_sigma = 10, in radians: ranges alone. Is the heading still known (film), and from what?
//   3. Start with a heading off by 1.5 rad or so (start's last variance 2.25). What becomes of NEES?
#include <cmath>

#include <cairn/core/random.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "support/lesson.hpp"

using cairn::SE2, cairn::Vector, cairn::chi_square_mean_band, example::column, example::Ink, example::Rows;
using Belief = cairn::Gaussian<SE2>;
constexpr double dt = 0.5;
constexpr cairn::Extended filter;  // or cairn::Unscented, of cairn/filter/unscented.hpp
const Vector<2> beacons[] = {{-3, -4}, {13, 3}, {4, -8}};
const Belief start{SE2(0, -4, 0), Vector<3>(0.04, 0.04, 0.0025).asDiagonal()};

struct Robot : cairn::Unicycle {
  bool transposed = false, exchanged = false;  // mistakes
  [[nodiscard]] cairn::Matrix<3> jacobian(const SE2& pose, const Vector<2>& u, double step) const {
    cairn::Matrix<3> g = cairn::Unicycle::jacobian(pose, u, step);
    if (exchanged) g.col(2).head<2>().reverseInPlace();
    return transposed ? cairn::Matrix<3>(g.transpose()) : g;
  }
};

struct PlainSensor : cairn::RangeBearing {  // a mistake: range and bearing as two plain numbers
  using Measurement = Vector<2>;
  [[nodiscard]] Vector<2> predict(const SE2& pose) const {
    const auto h = cairn::RangeBearing::predict(pose);
    return {h.part<0>()(0), h.part<1>().angle()};
  }
};

int main(int argc, char** argv) {
  example::Lesson lesson(
      {.name = "03_robot_and_beacons",
       .title = "03 Robot and beacons",
       .sentence = "States live on manifolds: a heading is no plain number, and a filter has to know.",
       .steps = 200,
       .least_steps = 50,
       .mistakes = {{"transposed", "P <- G' P G; PythonRobotics' EKF-SLAM, as of PR #258",
                     "The way looks fair, its ellipse is a line: errors of 14 own sigmas."},
                    {"exchanged", "two numbers of G, a sine and a cosine; SLAM-Course-Solutions #5",
                     "The way looks fair; only NEES, NIS and the check of G tell."},
                    {"plain-bearings", "z - h the long way round; PX4's GNSS heading until PR #21287",
                     "The way jumps where a beacon is right behind: NIS counts a whole turn."}}},
      argc, argv);
  const cairn::Unicycle world{.speed_density = 0.005, .slip_density = 1e-4, .turn_density = 0.001};
  const Robot robot{world, lesson.mistake("transposed"), lesson.mistake("exchanged")};
  cairn::Random random(lesson.seed());
  cairn::RunningMoments nees, nis;
  Rows rows, bearings;  // of the last drive, of the first twenty
  for (std::size_t run = 0; run < lesson.steps(); ++run) {
    Belief belief = start;
    SE2 truth = sample(start, random), reckoned = start.mean;
    for (int step = 0; step < 120; ++step) {
      const Vector<2> u(1.0, step % 36 < 20 ? 0.0 : 0.3927);  // straight on, or half around
      truth = sample(Belief{world.propagate(truth, u, dt), world.noise(truth, u, dt).dense()}, random);
      reckoned = world.propagate(reckoned, u, dt);
      if (filter.predict(belief, robot, dt, u) != cairn::Status::accepted) cairn::raise("not predicted");
      Vector<2> seen(NAN, NAN);
      if (step % 4 == 3) {
        const PlainSensor plain{{.beacon = beacons[step / 4 % 3], .range_sigma = 0.2, .bearing_sigma = 0.03}};
        const cairn::RangeBearing& sensor = plain;
        const Vector<2> real = plain.predict(truth);
        const double range = random.normal(real(0), 0.2);
        const double bearing = cairn::wrapped(random.normal(real(1), 0.03));
        const double expected = plain.predict(belief.mean)(1);
        if (run < 20) bearings.push_back({expected, bearing - expected, cairn::wrapped(bearing - expected)});
        nis.add(lesson.mistake("plain-bearings")
                    ? filter.update(belief, plain, Vector<2>(range, bearing)).nis
                    : filter.update(belief, sensor, sensor.measurement(range, bearing)).nis);
        seen = belief.mean * Vector<2>(range * std::cos(bearing), range * std::sin(bearing));
      }
      if (run + 1 < lesson.steps()) continue;
      const cairn::Matrix<2> turn = belief.mean.rotation().matrix();  // from ahead and left to x and y
      const cairn::Matrix<2> place = turn * belief.covariance.topLeftCorner<2, 2>() * turn.transpose();
      rows.push_back({step * dt, truth.x(), truth.y(), belief.mean.x(), belief.mean.y(), reckoned.x(),
                      reckoned.y(), place(0, 0), place(0, 1), place(1, 1), seen(0), seen(1),
                      std::sqrt(belief.covariance(2, 2))});
    }
    nees.add(cairn::nees(belief, truth));
  }
  lesson.verdict("NEES", nees.mean(), chi_square_mean_band(3, double(nees.count()), 0.99999), "At the end");
  lesson.verdict("NIS", nis.mean(), chi_square_mean_band(2, double(nis.count()), 0.99999), "All sightings");
  lesson.verdict("G less numeric G", check_jacobian(robot, start.mean, {1, 0.4}, dt).worst, 0, 1e-6);
  lesson.verdict("H less numeric H", check_jacobian(cairn::RangeBearing{}, start.mean).worst, 0, 1e-6);
  example::PlaneFilm film{.title = "The last drive",
                          .caption = "Ellipse: where the filter says it is. Sightings end near a beacon.",
                          .x = {"x", "m"},
                          .y = {"y", "m"},
                          .slider = {"time", "s"},
                          .still = {{"truth", Ink::truth, column(rows, 1), column(rows, 2)}},
                          .wide = true};
  for (const auto& b : beacons)
    film.still.push_back(example::ellipse("beacon", Ink::violet, {b(0), b(1)}, {0.01, 0, 0.01}));
  Rows so_far;
  for (const auto& row : rows) {
    so_far.push_back(row);
    const auto spot = example::ellipse("2 sigma", Ink::belief, {row[3], row[4]}, {row[7], row[8], row[9]});
    film.frames.push_back({row[0],
                           "heading known to " + example::readable(row[12]) + " rad (sigma)",
                           {{"dead reckoning", Ink::grey, column(so_far, 5), column(so_far, 6)},
                            {"estimate", Ink::belief, column(so_far, 3), column(so_far, 4)},
                            {"sighting", Ink::measurement, {row[3], row[10]}, {row[4], row[11]}},
                            spot}});
  }
  lesson.add(film);
  lesson.add(example::PlanePlot{
      .title = "Is z - h small?",
      .caption = "Plainly subtracted, the bearing of a beacon right behind is often a whole turn off.",
      .x = {"bearing expected, h", "rad"},
      .y = {"seen less expected, z - h", "rad"},
      .curves = {{"plain", Ink::truth, column(bearings, 0), column(bearings, 1), true},
                 {"short way round", Ink::measurement, column(bearings, 0), column(bearings, 2), true}},
      .equal_scale = false});
  lesson.csv("bearings", {"expected_rad", "plain_rad", "wrapped_rad"}, bearings);
  return lesson.finish();
}
// ANSWERS  1. 18 here, 10 to 97 with other seeds: so long an ellipse ought to bend, and the extended filter
// does not know it (next lesson). Unscented does: 3.3, green. 2. To 0.063 rad at the end, not 0.030, from the
// way between two ranges. NEES stays 3, NIS falls to 1: no bearing surprises by 10 rad. 3. NEES is 3.3 at the
// end, but 12 with --seed 4: one drive of 200 (NEES 1800) never finds back. NIS is 3.5: surprises at first.
