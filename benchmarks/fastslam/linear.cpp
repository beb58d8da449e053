// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "linear.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "support/linear_slam.hpp"

namespace {

using namespace cairn_test::linear_slam;
constexpr std::uint64_t first_seed = 101, seeds = 5;

/// Largest difference of the two weights of FastSLAM 2.0, and of both from Kalman's evidence.
double difference_of_weights(std::uint64_t seed) {
  Random random(seed);
  const Map::Observation first = seen_from(Plane::Zero(), random), second = seen_from(Plane(0.8, 0), random);
  Joint exact;
  for (const auto& s : first) exact.see(*s.identity, s.z, Relative{}.covariance);
  exact.move();
  for (const auto& s : second) exact.see(*s.identity, s.z, Relative{}.covariance);
  Map map({}, keep_all);
  map.insert(Plane::Zero(), first);
  double most = 0;
  for (const auto weight : {cairn::FromLandmarks::Weight::exact, cairn::FromLandmarks::Weight::evidence}) {
    const cairn::FromLandmarks proposal{.weight = weight};
    const double log_weight = proposal(map, motion(Plane::Zero(), 0), second, random).log_weight;
    most = std::max(most, std::abs(log_weight - exact.log_evidence));
  }
  return most;
}

}  // namespace

void add_linear(cairn_bench::Scoreboard& board) {
  std::vector<double> slopes;
  double difference = 0;
  for (std::uint64_t seed = first_seed; seed < first_seed + seeds; ++seed) {
    slopes.push_back(slope_of_error(drive(seed), seed));
    difference = std::max(difference, difference_of_weights(seed));
  }
  std::ranges::sort(slopes);
  const auto note =
      "least and largest of 5 seeds " + std::to_string(slopes.front()) + ", " + std::to_string(slopes.back());
  board.add({.name = "linear case: slope of the error against M, off -1/2",
             .measured = std::abs(slopes[slopes.size() / 2] + 0.5),
             .unit = "",
             .must = 0.1,
             .note = "slope: " + note});
  board.add({.name = "linear case: logarithms of both weights of 2.0, off Kalman's evidence",
             .measured = difference,
             .unit = "",
             .must = 1e-12,
             .note = "worst of 5 seeds"});
}
