// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "levelled_rig.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <cairn/geometry/rig_correction.hpp>

#include "vertical_disparity.hpp"

namespace stereo_slam {
namespace {

std::vector<cairn::PixelPair> agreeing_pixels(std::span<const PointPair> pairs) {
  std::vector<cairn::PixelPair> result;
  for (const PointPair& pair : pairs)
    if (pair.refined) result.push_back({pair.left_pixel, pair.right_pixel});
  return result;
}

cairn::StereoRig pitched(const cairn::StereoRig& rig, double angle) {
  return cairn::RigCorrection(rig).rig(cairn::Vector<5>(angle * cairn::Vector<5>::Unit(0)));
}

}  // namespace

std::optional<LevelledRig> levelled(const cairn::StereoRig& rig, const StereoMatcherOptions& options,
                                    const StereoFrame& frame, const FramePoints& points,
                                    std::span<const PointPair> pairs, unsigned threads) {
  // Of level rigs 69 to 84 in a hundred agree; of three whose rows are 2.3 to 2.9 pixels apart 40 to 60.
  const std::size_t before = agreeing_pixels(pairs).size();
  if (!options.refine || 3 * before >= 2 * pairs.size()) return std::nullopt;
  const auto found_by = [&](const cairn::StereoRig& by, double band) {
    StereoMatcherOptions within = options;
    within.band = band;
    return agreeing_pixels(
        StereoMatcher(by, within)(frame.left, points.left, frame.right, points.right, threads));
  };
  constexpr double share_of_height = 0.05;
  const auto far = found_by(rig, std::max(options.band, share_of_height * frame.left.height()));
  const double rows = vertical_disparity(rig, far).offset;
  if (!(std::abs(rows) > 0.5 * options.band)) return std::nullopt;
  double angle = 0, beyond = rows;
  for (int round = 0; round < 3; ++round) {  // Newton's: what is left of it is linear but for distortion
    constexpr double step = 1e-4;
    const double slope = (vertical_disparity(pitched(rig, angle + step), far).offset - beyond) / step;
    angle -= beyond / slope;
    if (!(std::abs(angle) < largest_pitch)) return std::nullopt;
    beyond = vertical_disparity(pitched(rig, angle), far).offset;
  }
  const LevelledRig result{pitched(rig, angle), angle, rows};
  constexpr std::size_t enough = 40;
  const std::size_t more = found_by(result.rig, options.band).size();
  if (more < enough || 2 * more < 3 * before) return std::nullopt;
  return result;
}

}  // namespace stereo_slam
