// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A small flight over a random field, for the tests of the patch filters.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/field/random_field.hpp>
#include <cairn/filter/gaussian.hpp>

namespace cairn_test {

inline const cairn::PatchShape small{4, 5, 4};
inline const cairn::Vector<5> usual_state(60.0, 10.0, 1.0, 1.0, 0.02);

inline cairn::BsplineMap ground(std::uint64_t seed, double sigma = 1.0) {
  cairn::Random random(seed);
  return cairn::BsplineMap(cairn::RandomField{sigma, 0.15}.draw(140, 80, {0, -40, 1, 1}, random));
}

template <class Placement>
std::vector<double> frame(const cairn::BsplineMap& map, const cairn::PatchShape& shape,
                          const Placement& where, const typename Placement::State& x, double noise,
                          cairn::Random& random) {
  cairn::PatchSamples samples;
  cairn::sample_patch(map, shape, where.placement(x), samples);
  REQUIRE(samples.count_inside == shape.size());
  for (double& value : samples.value) value += noise * random.normal();
  return samples.value;
}

inline cairn::Gaussian<cairn::Vector<5>> prior(double factor) {
  const cairn::Vector<5> sigmas(1.0, 0.2, 0.02, 0.02, 0.02);
  return {usual_state, (factor * sigmas).cwiseAbs2().asDiagonal()};
}

/// Difference of two beliefs in standard deviations, and of their covariances relative to the diagonal.
inline double distance(const cairn::Gaussian<cairn::Vector<5>>& a,
                       const cairn::Gaussian<cairn::Vector<5>>& b) {
  const cairn::Vector<5> s = a.covariance.diagonal().cwiseSqrt();
  const double mean = (a.mean - b.mean).cwiseQuotient(s).cwiseAbs().maxCoeff();
  const double covariance =
      (a.covariance - b.covariance).cwiseQuotient(s * s.transpose()).cwiseAbs().maxCoeff();
  return std::max(mean, covariance);
}

}  // namespace cairn_test
