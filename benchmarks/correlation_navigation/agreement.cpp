// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "agreement.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch_bucy.hpp>
#include <cairn/field/patch_filter.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/field/random_field.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/unscented.hpp>

double largest_disagreement(std::uint64_t seed, int frames) {
  using namespace cairn;
  using Belief = Gaussian<Vector<5>>;
  Random random(seed);
  const BsplineMap map(RandomField{1.0, 0.15}.draw(140, 80, {0, -40, 1, 1}, random));
  const PatchShape shape{4, 5, 4};
  const double factor = 1e-6, noise = 1e-6;
  Vector<5> sigma(1.0, 0.2, 0.02, 0.02, 0.02);
  sigma *= factor;
  const Belief start{Vector<5>(60.0, 10.0, 1.0, 1.0, 0.02), sigma.cwiseAbs2().asDiagonal()};
  std::array<Belief, 5> beliefs{start, start, start, start, start};
  const AlongTrackMotion motion{};
  const AlongTrackPlacement where{};
  const PatchSensor<AlongTrackPlacement, BsplineMap> sensor{where, &map, shape, noise * noise};
  const PatchNoise weights(noise * noise);
  PatchScratch scratch;
  Vector<5> truth = sample(start, random);
  double worst = 0;
  for (int k = 0; k < frames; ++k) {
    truth = motion.propagate(truth, {}, 0.1);
    bool good = true;
    for (Belief& belief : beliefs) good = Kalman{}.predict(belief, motion, 0.1) == Status::accepted && good;
    Vector<dynamic> z = sensor.predict(truth);
    for (double& value : z) value += noise * random.normal();
    const std::span<const double> samples(z.data(), shape.size());
    good = PatchFilter{.iterations = 1}
               .update(beliefs[0], where, map, shape, samples, weights, scratch)
               .accepted() &&
           good;
    good = Extended{}.update(beliefs[1], sensor, z).accepted() && good;
    good = Extended{.iterations = 5}.update(beliefs[2], sensor, z).accepted() && good;
    good = Unscented{}.update(beliefs[3], sensor, z).accepted() && good;
    good = PatchBucy{}.impulse(beliefs[4], where, map, shape, samples, noise * noise, scratch) ==
               PatchVerdict::accepted &&
           good;
    if (!good) return std::numeric_limits<double>::infinity();
    const Vector<5> s = beliefs[0].covariance.diagonal().cwiseSqrt();
    for (const Belief& other : beliefs) {
      const double mean = (other.mean - beliefs[0].mean).cwiseQuotient(s).cwiseAbs().maxCoeff();
      const Matrix<5> difference = other.covariance - beliefs[0].covariance;
      worst = std::max({worst, mean, difference.cwiseQuotient(s * s.transpose()).cwiseAbs().maxCoeff()});
    }
  }
  return worst;
}
