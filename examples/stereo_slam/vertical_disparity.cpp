// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "vertical_disparity.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>

namespace stereo_slam {
namespace {

struct Sample {
  cairn::Vector<3> at;  // 1, x, y
  double distance;
};

std::vector<Sample> samples(const cairn::StereoRig& rig, std::span<const cairn::PixelPair> pairs) {
  const cairn::EpipolarConstraint constraint(rig);
  const double half_width = 0.5 * rig.left.width(), half_height = 0.5 * rig.left.height();
  std::vector<Sample> result;
  for (const cairn::PixelPair& pair : pairs) {
    const auto l = rig.left.normalise(pair.left), r = rig.right.normalise(pair.right);
    if (!l || !r) continue;
    const cairn::Vector<3> at(1, (pair.left(0) - half_width) / half_width,
                              (pair.left(1) - half_height) / half_height);
    result.push_back({at, constraint.distance(*l, *r)});
  }
  return result;
}

bool beyond_doubt(double value, double sigma) noexcept {
  return std::abs(value) > 0.1 && std::abs(value) > 5 * sigma;
}

}  // namespace

bool VerticalDisparity::shows() const noexcept {
  return beyond_doubt(offset, sigma_offset) || beyond_doubt(slope_x, sigma_x) ||
         beyond_doubt(slope_y, sigma_y);
}

VerticalDisparity vertical_disparity(const cairn::StereoRig& rig, std::span<const cairn::PixelPair> pairs) {
  constexpr std::size_t enough = 30;
  constexpr int rounds = 10;
  const std::vector<Sample> all = samples(rig, pairs);
  if (all.size() < enough || rig.left.width() == 0 || rig.left.height() == 0) return {};
  cairn::Vector<3> plane = cairn::Vector<3>::Zero();
  cairn::Matrix<3> information;
  double scale = 1;
  std::vector<double> sizes(all.size());
  for (int round = 0; round < rounds; ++round) {  // reweighted (Cauchy), its scale the residuals' own
    for (std::size_t i = 0; i < all.size(); ++i) sizes[i] = std::abs(all[i].distance - all[i].at.dot(plane));
    scale = std::max(1e-3, 1.4826 * cairn::median(sizes));
    information.setZero();
    cairn::Vector<3> gradient = cairn::Vector<3>::Zero();
    for (const Sample& s : all) {
      const double r = s.distance - s.at.dot(plane), x = r / (2.385 * scale), weight = 1 / (1 + x * x);
      information += weight * cairn::product_transposed(s.at, s.at);
      gradient += weight * r * s.at;
    }
    const cairn::Cholesky<3> factor(information);
    if (!factor.good()) return {};
    plane += factor.solve(gradient);
  }
  const cairn::Matrix<3> P = cairn::Cholesky<3>(information).inverse() * (scale * scale);
  return {plane(0),           plane(1),           plane(2),  std::sqrt(P(0, 0)),
          std::sqrt(P(1, 1)), std::sqrt(P(2, 2)), all.size()};
}

bool DisparityWatch::departs(const VerticalDisparity& seen) {
  constexpr std::size_t recent = 5, least = 10, most = 40;
  constexpr double pixels = 0.5, deviations = 6;
  if (seen.points == 0) return false;
  offsets_.push_back(seen.offset);
  if (offsets_.size() > most + recent) offsets_.pop_front();
  if (offsets_.size() < least + recent) return false;
  const auto since = offsets_.end() - recent;
  const double usual = cairn::median(std::vector<double>(offsets_.begin(), since));
  std::vector<double> sizes;
  std::transform(offsets_.begin(), since, std::back_inserter(sizes),
                 [&](double offset) { return std::abs(offset - usual); });
  const double enough = std::max(pixels, deviations * 1.4826 * cairn::median(std::move(sizes)));
  return std::all_of(since, offsets_.end(), [&](double offset) { return offset - usual > enough; }) ||
         std::all_of(since, offsets_.end(), [&](double offset) { return usual - offset > enough; });
}

}  // namespace stereo_slam
