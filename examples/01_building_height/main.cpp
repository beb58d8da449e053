// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// 01 Building height: how much to believe a new number.
//
// STORY  You measure the height of a building with a poor altimeter, ten times. The building does not change.
// After each reading a filter knows the best height so far, and how far off it may be, and keeps no old ones.
//
//   x   height of the building, as believed       [m]      z   one reading of the altimeter           [m]
//   p   variance of that belief                   [m^2]    r   variance of a reading's error, (5 m)^2 [m^2]
//   k   gain: share of the surprise z - x believed [1]     n   number of readings so far              [1]
//
// EQUATIONS
//   mean of n readings      x_n = (z_1 + ... + z_n) / n
//   the same, recursively   x_n = x_{n-1} + 1/n (z_n - x_{n-1})
//   Kalman filter           k = p / (p + r),   x <- x + k (z - x),   p <- (1 - k) p
// (R. E. Kalman, "A New Approach to Linear Filtering and Prediction Problems", 1960, for one state that
// stays.) The recursive mean gives reading n the weight 1/n. The filter's gain is a ratio of doubts: doubt
// about the belief over all doubt, so that whoever is surer counts more; p falls, since two readings know
// more than one. A first guess is then like one poor reading. Readings and results are A. Becker's,
// https://www.kalmanfilter.net/kalman1d.html: guess (60 +- 15) m; at the end 49.57 m, variance 2.47 m^2.
//
// LOOK AT  the blue funnel: it closes fast at first, then slowly. The black line should lie outside one time
// in twenty, so hardly in ten. The gain falls like 1/n. The last plot tries a thousand other buildings.
//
// CHANGE THIS, one at a time (answers at the end of the file). The two published figures then turn red.
//   1. guess_variance = 1: you are sure of your wrong guess. Where does the estimate end?
//   2. guess_variance = 1e9: you know nothing. Which other curve of the first plots does the filter become?
//   3. Append 500 to `readings`, a bird in the beam. What would have had to notice?
#include <cmath>
#include <numbers>

#include <cairn/core/random.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/models/sensor.hpp>

#include "support/lesson.hpp"

using example::column;
using example::Ink;
using Height = cairn::Vector<1>;
using Belief = cairn::Gaussian<Height>;

constexpr double guess = 60, guess_variance = 15 * 15, sigma = 5;

int main(int argc, char** argv) {
  example::Lesson lesson(
      {.name = "01_building_height",
       .title = "01 Building height",
       .sentence = "The gain of a filter is a ratio of doubts: doubt about the belief over all doubt.",
       .steps = 1000,
       .least_steps = 100,
       .mistakes = {{"sigma-for-variance",
                     "deviation (5 m) in place of variance (25 m^2); paparazzi's hf_float.c (#3661)",
                     "The height is 9 cm off, its funnel too narrow: errors of 2 own sigmas are usual."},
                    {"variance-stays",
                     "the variance never falls, nor does the gain; jjviscomi/kalman-filter until PR #2",
                     "It follows the last reading to the end, and its funnel never closes."}}},
      argc, argv);

  // What the filter is told about a reading, and one reading taken in.
  const double r = lesson.mistake("sigma-for-variance") ? sigma : sigma * sigma;
  const cairn::PositionSensor<1, 1> altimeter{.covariance = cairn::Matrix<1>(r)};
  const auto take_in = [&](Belief& belief, double z) {
    const Belief before = belief;
    const auto innovation = cairn::Kalman{}.update(belief, altimeter, Height(z));
    if (lesson.mistake("variance-stays")) belief.covariance = before.covariance;
    return before.covariance(0, 0) / innovation.covariance(0, 0);  // the gain, p / (p + r)
  };

  // Ten readings of a building that is 50 m high.
  const std::vector<double> readings{48.54, 47.11, 55.01, 55.15, 49.89, 40.85, 46.72, 50.05, 51.27, 49.95};
  Belief belief{Height(guess), cairn::Matrix<1>(guess_variance)};
  double sum = 0, mean = 0;
  example::Rows table;
  for (const double z : readings) {
    const auto n = static_cast<double>(table.size() + 1);
    const double k = take_in(belief, z), x = belief.mean(0), deviation = std::sqrt(belief.covariance(0, 0));
    sum += z;
    mean += (z - mean) / n;
    table.push_back({n, z, mean, 1 / n, k, x, x - 2 * deviation, x + 2 * deviation, 50});
  }
  lesson.say("guess 60 m, then the readings: " + example::readable(belief.mean(0), 4) + " m; their mean " +
             example::readable(mean, 4) + " m; the truth 50 m");

  // Is the variance true? As many buildings as --steps says, as far from the guess as it promises.
  cairn::Random random(lesson.seed());
  const auto houses = static_cast<double>(lesson.steps());
  std::vector<double> in_sigmas, expected, found(41);  // a histogram of the errors, 5 bins a sigma
  double total = 0;
  for (std::size_t house = 0; house < lesson.steps(); ++house) {
    const double height = random.normal(guess, std::sqrt(guess_variance));
    Belief of_house{Height(guess), cairn::Matrix<1>(guess_variance)};
    for (int i = 0; i < 10; ++i) take_in(of_house, random.normal(height, sigma));
    total += cairn::nees(of_house, Height(height));
    const double error = (height - of_house.mean(0)) / std::sqrt(of_house.covariance(0, 0));
    if (std::abs(error) < 4) found[static_cast<std::size_t>(std::lround(5 * error) + 20)] += 5 / houses;
  }
  for (int bin = -20; bin <= 20; ++bin) {
    in_sigmas.push_back(0.2 * bin);
    expected.push_back(std::exp(-0.02 * bin * bin) / std::sqrt(2 * std::numbers::pi));
  }

  lesson.verdict("mean, recursive less direct", mean - sum / table.back()[0], -1e-12, 1e-12, "The same");
  lesson.verdict("height after ten readings", belief.mean(0), 49.565, 49.575, "Published: 49.57 m");
  lesson.verdict("its variance", belief.covariance(0, 0), 2.465, 2.475, "Published: 2.47 m^2");
  lesson.verdict("NEES", total / houses, cairn::chi_square_mean_band(1, houses, 0.99999),
                 "Mean squared error over its variance, 1 where the filter knows how wrong it is");

  lesson.add(example::LinePlot{
      .title = "The estimate after each reading",
      .caption =
          "Readings (dots) scatter to the end as they did at first, but move the filter less and less. Its "
          "funnel holds the truth; the guess of 60 m is all but forgotten with the first reading.",
      .x = {"readings"},
      .y = {"height", "m"},
      .x_values = column(table, 0),
      .curves = {{"truth", Ink::truth, column(table, 8), true},
                 {"reading", Ink::measurement, column(table, 1), false, true},
                 {"recursive mean", Ink::grey, column(table, 2), true},
                 {"filter", Ink::belief, column(table, 5)}},
      .wide = true,
      .bands = {{"2 sigma", Ink::belief, column(table, 6), column(table, 7)}}});
  lesson.add(example::LinePlot{
      .title = "Gain",
      .caption = "The share of the surprise taken over: 1/n by the mean, a little less by the filter, for "
                 "which the guess, of 15 m, is 5^2/15^2 of a reading.",
      .x = {"readings"},
      .y = {"gain"},
      .x_values = column(table, 0),
      .curves = {{"1 / n, of the mean", Ink::grey, column(table, 3), true},
                 {"filter", Ink::belief, column(table, 4)}}});
  lesson.add(example::LinePlot{
      .title = "Does it know how wrong it is?",
      .caption = "Errors over many buildings, each divided by the deviation that the filter gave for it. "
                 "A hill wider than the normal curve is a filter too sure of itself.",
      .x = {"error / own sigma"},
      .y = {"share per sigma"},
      .x_values = in_sigmas,
      .curves = {{"expected", Ink::truth, expected, true}, {"found", Ink::belief, found}}});
  lesson.csv("readings", {"n", "z", "mean", "one_over_n", "gain", "height", "low", "high", "truth"}, table);
  return lesson.finish();
}
// ANSWERS  1. At 57 m: the readings together have a variance of 25 / 10, the guess of 1; so it moves by
// 1 / (1 + 2.5) of the 10.5 m to their mean, and ends 8 own sigmas above the truth. NEES stays 1: the
// buildings of that test are as near the guess as guess_variance says, only this one is not.
// 2. The recursive mean: k = p / (p + r) is 1 at first and then 1/n, since p becomes r / n.
// 3. The surprise (or innovation), z - x: 450 m where sqrt(p + r) is 5 m. Unnoticed, it leaves you at 90 m,
// sure to 1.5 m (sigma). Kalman{.gate = 16} in take_in refuses what is beyond 4 sigma: green.
