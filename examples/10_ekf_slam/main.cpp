// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// LESSON 10  EKF-SLAM: the correlations are the map
//
// A robot without a map drives two rounds. It counts its wheels' turns, and sees range and bearing of posts
// that all look the same. One Gaussian holds its pose and every post it has met:
//   x = (pose r [m, m, rad], posts i [m, m] each), P its covariance of 3 + 2n rows
//   predict   P_rr <- F P_rr F^T + Q,  P_ri <- F P_ri       the correlations move with the pose
//   who is it z is of the post with the smallest NIS = v^T S^-1 v (v: seen - expected; S = H P H^T + R) if
//   that
//             is below 99.9 % of chi-square(2); of a new one if all are above 99.9999 %; else nobody knows
//   update    K = P H^T S^-1,  x <- x + K v,  P <- P - K S K^T   one sighting moves ALL posts
//   new post  P_ni = G P_ri                                 born with the error of the pose that saw it
// (R. Smith, M. Self, P. Cheeseman, 1990; S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, table 10.2.)
//
// Look for: ellipses grow along the first round and shrink ALL AT ONCE when the first post comes into sight
// again; the heat map says why. A planted bug leaves a map that looks as good: only the NEES turns red.
//
// Now change this (answers at the end): (1) --steps 110, just before the loop closes: which ellipses are
// large? (2) turn_density of the world times ten: what breaks? (3) Gate at 50 % in place of 99.9 %: and now?
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
      return Unicycle::jacobian(x, u, dt).transpose();
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

example::HeatMap correlations_of(const Slam& slam) {
  const auto p = slam.belief.covariance();
  const auto n = static_cast<std::size_t>(p.rows());
  example::HeatMap map{
      .title = "Correlations at the end",
      .caption =
          "Of all numbers of the first run: the pose's three, then two a post in the order of "
          "meeting. Nearly all is coloured: who moves one post moves them all.",
      .x = {"number of the state", ""},
      .y = {"number of the state", ""},
      .value = {"correlation", ""},
      .columns = n,
      .rows = n,
      .diverging = true};
  for (int i = 0; i < p.rows(); ++i)
    for (int j = 0; j < p.rows(); ++j) map.values.push_back(p(i, j) / std::sqrt(p(i, i) * p(j, j)));
  return map;
}

int main(int argc, char** argv) {
  example::Lesson lesson(
      {.name = "10_ekf_slam",
       .title = "EKF-SLAM: the correlations are the map",
       .sentence = "A robot without a map drives two rounds among posts that all look the same.",
       .steps = 250,
       .least_steps = 140,
       .most_steps = 1000,
       .mistakes = {{"drop-correlations",
                     "pose and posts are taken for independent after each step (PythonRobotics until #973)"},
                    {"transposed", "predicts with F^T P F (PythonRobotics, ekf_slam.py)"},
                    {"process-noise",
                     "the motion's noise stands where the sensor's belongs (PythonRobotics, ekf_slam.py)"}}},
      argc, argv);
  const example::LandmarkWorld world;
  constexpr std::size_t runs = 20;
  std::vector<double> steps(lesson.steps()), nees(steps.size()), sigma(steps.size()), error(steps.size());
  cairn::RunningMoments surplus;
  example::PlaneFilm film{.title = "Map and path of the first run",
                          .caption =
                              "Ellipses hold 86 % (2 sigma). Move the slider past step 115, where the robot "
                              "sees its first post again.",
                          .x = {"east", "m"},
                          .y = {"north", "m"},
                          .slider = {"step", ""}};
  for (std::size_t run = 0; run < runs; ++run) {
    cairn::Random random(lesson.seed(), run);
    const auto landmarks = world.landmarks(random);
    const auto log = world.drive(landmarks, lesson.steps(), random);
    Slam slam{lesson, world};
    example::PlaneCurve truth{.name = "true path", .ink = Ink::truth},
        path{.name = "estimated path", .ink = Ink::belief};
    for (std::size_t k = 0; k < log.size(); ++k) {
      slam.step(log[k]);
      const auto pose = slam.belief.marginal(slam.robot);
      nees[k] += cairn::nees(pose, log[k].truth) / runs;
      if (run > 0) continue;
      steps[k] = static_cast<double>(k + 1);
      extend(truth, log[k].truth.translation());
      extend(path, pose.mean.translation());
      const Vector<2> off = pose.mean.translation() - log[k].truth.translation();
      error[k] = std::hypot(off(0), off(1));
      sigma[k] = 2 * std::sqrt(pose.covariance(0, 0) + pose.covariance(1, 1));
      if (k % 5 != 4) continue;
      film.frames.push_back({steps[k],
                             std::to_string(slam.posts.size()) + " posts",
                             {truth, path, ellipse_of("robot", Ink::teal, pose)}});
      for (const auto& post : slam.posts)
        film.frames.back().curves.push_back(
            example::ellipse("posts", Ink::belief, slam.belief.mean(post), slam.belief.covariance(post)));
    }
    std::vector<bool> met(landmarks.size());
    for (const auto& step : log)
      for (const auto& seen : step.sightings) met[static_cast<std::size_t>(seen.landmark)] = true;
    surplus.add(static_cast<double>(slam.posts.size()) -
                static_cast<double>(std::count(met.begin(), met.end(), true)));
    if (run > 0) continue;
    film.still = {dots_of("true posts", Ink::truth, landmarks)};
    lesson.add(film);
    lesson.add(correlations_of(slam));
  }
  const cairn::ConsistencyBand band = cairn::chi_square_mean_band(3, runs, 0.999);
  lesson.add(
      example::LinePlot{.title = "Does the filter know how wrong it is?",
                        .caption = "NEES of the pose, mean of 20 runs, and the band that holds 99.9 % of "
                                   "such means if the covariance is right.",
                        .x = {"step", ""},
                        .y = {"NEES", ""},
                        .x_values = steps,
                        .curves = {{"NEES", Ink::belief, nees},
                                   {"band", Ink::grey, std::vector<double>(steps.size(), band.low), true},
                                   {"band", Ink::grey, std::vector<double>(steps.size(), band.high), true}},
                        .logarithmic = true});
  lesson.add(example::LinePlot{.title = "Position of the first run",
                               .caption = "The error stays below 2 sigma; both fall where the loop closes.",
                               .x = {"step", ""},
                               .y = {"distance", "m"},
                               .x_values = steps,
                               .curves = {{"error", Ink::wrong, error}, {"2 sigma", Ink::belief, sigma}}});
  double mean = 0;
  for (const double value : nees) mean += value / static_cast<double>(nees.size());
  lesson.verdict("pose NEES, mean of 20 runs", mean, band.low, band.high, "3 where the covariance is right");
  lesson.verdict("posts too many, mean of 20 runs", surplus.mean(), -0.5, 1,
                 "posts in the map less posts that were seen");
  return lesson.finish();
}

// Answers. (1)
