// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// LESSON 10  EKF-SLAM: the correlations are the map
//
// A robot without a map drives two rounds. It counts its wheels' turns, and sees range and bearing of posts
// that all look the same. One Gaussian holds its pose and every post it has met:
//   x = (pose r [m, m, rad], posts i [m, m] each), P its covariance of 3 + 2n rows, n the number of posts
//   predict   P_rr <- F P_rr F^T + Q,  P_ri <- F P_ri       the correlations move with the pose
//   who is it the post with the smallest NIS = v^T S^-1 v (v: seen z - expected h; S = H P H^T + R), if below
//             99.9 % of chi-square(2); a new one if all are above 99.9999 %; else nobody knows
//   update    K = P H^T S^-1,  x <- x + K v,  P <- P - K S K^T   one sighting moves ALL posts
//   new post  P_ni = G P_ri                                 born with the error of the pose that saw it
// F, H, G: derivatives of the motion, of h by pose and post, of a new place by the pose. Q: noise of the
// motion, R: of the sensor.
// (R. Smith, M. Self, P. Cheeseman, 1990; S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, table 10.2.)
//
// Look for: ellipses grow along the first round and shrink ALL AT ONCE when the first post comes into sight
// again; the heat map says why. Without correlations the map still looks like one: only the NEES turns red.
//
// Now change this (answers at the end): (1) --steps 95, just before the loop closes: which ellipses are
// large? (2) turn_density in support/landmark_world.hpp times ten: what breaks? (3) A gate of 0.5, not 0.999?
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <cairn/core/statistics.hpp>
#include <cairn/filter/joint_extended.hpp>

#include "support/landmark_world.hpp"
#include "support/lesson.hpp"

using cairn::Matrix, cairn::Vector, cairn::SE2, cairn::chi_square_quantile, example::Ink;

struct Slam {
  const example::Lesson& lesson;
  const example::LandmarkWorld& world;
  cairn::JointGaussian<SE2, Vector<2>> belief{};
  cairn::BlockId<SE2> robot =
      belief.add(world.start(), Matrix<3>::Zero()).id;  // here the map begins, exactly
  std::vector<cairn::BlockId<Vector<2>>> posts{};

  struct Transposed : cairn::Unicycle {
    Matrix<3> jacobian(const SE2& x, const Vector<2>& u, double dt) const {
      return cairn::Unicycle::jacobian(x, u, dt).transpose();
    }
  };

  void step(const example::WorldStep& now) {
    const cairn::JointExtended filter;
    const auto status = lesson.mistake("transposed")
                            ? filter.predict(belief, Transposed{world.motion}, world.dt, now.control, robot)
                            : filter.predict(belief, world.motion, world.dt, now.control, robot);
    if (status != cairn::Status::accepted) cairn::raise(cairn::explain(status));
    if (lesson.mistake("drop-correlations")) forget_correlations();
    const bool mixed_up = lesson.mistake("process-noise");  // standard deviations of a step
    const example::LandmarkSensor sensor{mixed_up ? 0.07 : world.range_sigma,
                                         mixed_up ? 0.005 : world.bearing_sigma};
    for (const example::LandmarkSighting& seen : now.sightings) {
      std::size_t nearest = posts.size();
      double nis = chi_square_quantile(1 - 1e-6, 2);
      for (std::size_t i = 0; i < posts.size(); ++i) {
        const double other = filter.innovation(belief, sensor, seen.z, robot, posts[i]).nis;
        if (other < nis) nearest = i, nis = other;
      }
      if (nearest == posts.size())
        posts.push_back(belief.augment(cairn::inverted(sensor), seen.z, robot).id);
      else if (nis < chi_square_quantile(0.999, 2))
        (void)filter.update(belief, sensor, seen.z, robot, posts[nearest]);
    }
  }

  void forget_correlations() {
    cairn::JointGaussian<SE2, Vector<2>> apart;
    const auto same_robot = apart.add(belief.marginal(robot)).id;
    for (auto& post : posts) post = apart.add(belief.marginal(post)).id;
    robot = same_robot;
    belief = apart;
  }
};

int main(int argc, char** argv) {
  example::Lesson lesson(
      {"10_ekf_slam",
       "10 EKF-SLAM: the correlations are the map",
       "Who moves one post moves them all.",
       250,
       60,
       1000,
       {{"drop-correlations", "pose and posts are independent after each step (PythonRobotics until #973)"},
        {"transposed", "predicts with F^T P F (PythonRobotics, ekf_slam.py)"},
        {"process-noise", "noise of the motion in the place of the sensor's (PythonRobotics, ekf_slam.py)"}}},
      argc, argv);
  const example::LandmarkWorld world;
  constexpr std::size_t runs = 20;
  std::vector<double> steps(lesson.steps()), nees(steps.size());
  double mean = 0, surplus = 0;
  example::PlaneFilm film{"Map and path of the first run", "", {"east", "m"}, {"north", "m"}, {"step"}};
  film.caption = "Ellipses of 2 sigma. Soon after step 100 the first posts come into sight again.";
  for (std::size_t run = 0; run < runs; ++run) {
    cairn::Random random(lesson.seed(), run);
    const auto landmarks = world.landmarks(random);
    const auto log = world.drive(landmarks, lesson.steps(), random);
    Slam slam{lesson, world};
    example::PlaneCurve truth{.name = "true path", .ink = Ink::truth}, path{.name = "estimated path"};
    for (std::size_t k = 0; k < log.size(); ++k) {
      slam.step(log[k]);
      const auto pose = slam.belief.marginal(slam.robot);
      nees[k] += cairn::nees(pose, log[k].truth) / runs;
      steps[k] = static_cast<double>(k + 1);
      extend(truth, log[k].truth.translation());
      extend(path, pose.mean.translation());
      if (run > 0 || k % 5 != 4) continue;
      film.frames.push_back({steps[k],
                             std::to_string(slam.posts.size()) + " posts in the map",
                             {truth, path, ellipse_of("robot", Ink::teal, pose)}});
      for (const auto& post : slam.posts)
        film.frames.back().curves.push_back(
            ellipse_of("posts", Ink::belief, slam.belief.mean(post), slam.belief.covariance(post)));
    }
    surplus += static_cast<double>(slam.posts.size()) - static_cast<double>(landmarks_met(log));
    if (run > 0) continue;
    film.still = {dots_of("true posts", Ink::truth, landmarks)};
    lesson.add(film);
    lesson.add(example::correlations_of(slam.belief.covariance()));
  }
  const cairn::ConsistencyBand band = cairn::chi_square_mean_band(3, runs, 0.999);
  std::vector<std::vector<double>> rows;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    rows.push_back({steps[k], nees[k]});
    mean += nees[k] / static_cast<double>(steps.size());
  }
  lesson.verdict("pose NEES", mean, band.low, band.high, "mean of 20 runs; 3 where the covariance is right");
  lesson.verdict("posts too many", surplus / runs, -0.5, 1,
                 "in the map, less those that were seen; mean of 20 runs");
  example::LinePlot plot{"Does the filter know how wrong it is?", "", {"step"}, {"NEES"}, steps};
  plot.caption = "NEES of the pose, mean of 20 runs. Without a mistake 99.9 % of such means lie in the band.";
  plot.curves = {{"NEES", Ink::belief, nees}};
  plot.bands = {{"band", Ink::grey, std::vector<double>(rows.size(), band.low),
                 std::vector<double>(rows.size(), band.high)}};
  lesson.add(plot);
  lesson.csv("nees", {"step", "nees"}, rows);
  return lesson.finish();
}

// Answers. (1) Those met last: each was born with the error of the pose that saw it. (2) The NEES, to 11: not
// the noise breaks the filter but straight lines through a bent h and f at headings that are off (S. Julier,
// J. Uhlmann, ICRA 2001). (3) NEES 6: what contradicts is thrown away, and the filter believes itself.
