// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// An occupancy grid as the map of a particle, and the proposal that matches the scan to it.
///
/// The proposal of G. Grisetti, C. Stachniss, W. Burgard, "Improved techniques for grid mapping with
/// Rao-Blackwellized particle filters", T-RO 23, 2007, sec. IV, eq. 15-18, with draws (the paper's released
/// code takes the optimum) and with the weight that is exact for any density drawn from.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/grid/obstacle_rings.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/scan/match.hpp>
#include <cairn/scan/occupancy_grid.hpp>
#include <cairn/scan/scan.hpp>

#include "room.hpp"

namespace grid_slam {

/// ConditionalMap over occupancy grids. The pose is the laser's, the observation its end points.
struct OccupancyMap {
  using Pose = cairn::SE2;
  using Observation = std::vector<cairn::ScanPoint>;

  cairn::OccupancyGrid grid;
  cairn::EndPointModel model{};

  [[nodiscard]] double log_likelihood(const Pose& x, const Observation& z) const {
    return cairn::log_likelihood(grid, z, x, model);
  }
  /// Nothing where there is no room for it.
  void insert(const Pose& x, const Observation& z) {
    if (has_room_for(x, z)) grid.insert(x, z);
  }
  [[nodiscard]] bool has_room_for(const Pose& x, const Observation& z) const {
    double reach = 0;
    for (const cairn::ScanPoint& p : z) reach = std::max(reach, std::hypot(p.x, p.y));
    return has_room(grid.geometry(), grid.cells(), x, reach);
  }
};

/// Draws from a Gaussian fitted to likelihood times motion around their best pose: several poses, of which
/// one is kept by its weight. The likelihood of a scan is flatter than its curvature at the best pose says,
/// so that they are drawn wider than that; what is kept then has nearly the posterior's distribution, also
/// where only a part of a weight counts afterwards.
struct FromMatch {
  /// A search with a wider kernel, which bridges more and needs neither all points nor the last millimetre.
  struct Coarse {
    double width;    ///< of the kernel over the model's
    double settled;  ///< a step shorter than this ends it [m, rad]
  };
  cairn::MatchOptions match{};
  std::vector<Coarse> coarse{{4, 4e-3}, {2, 1e-3}};  ///< before the model's own
  double thinning = 0.1;                             ///< [m] of the points that coarse searches look at
  /// Motions of a smaller share are tried only where the others explain the scan badly, and taken only where
  /// they explain it well: where nothing does, it is the map that is wrong.
  double likely_share = 0.03;
  double explained_badly = 0.75;  ///< share of inliers below which the others are tried
  double explained_well = 0.75;   ///< share from which on they are taken
  double rare_share = 0.01;       ///< motions below this have to explain the scan still better
  double rare_explained = 0.88;
  /// Such a motion has to explain the scan better than the likely ones, by so much for each independent beam:
  /// where furniture was moved, a wrong place gains half a nat and now and then a whole one. A robot that
  /// drives the other way unseen makes the likely place wrong by two steps, which costs two.
  double rare_gain = 0.8, rare_change_gain = 1.3;
  /// As the filter's. Rare motions are drawn by as much of what they gain as counts: one that a single scan
  /// favours leaves some particles to the others, and the scans after it decide.
  double evidence_share = 1;
  double widened = 1.5;   ///< standard deviations of the draws over those fitted
  std::size_t draws = 4;  ///< at least 1

  [[nodiscard]] cairn::Proposed<cairn::SE2> operator()(const OccupancyMap& map,
                                                       const cairn::RegimeMotion<cairn::SE2>& motion,
                                                       const OccupancyMap::Observation& z,
                                                       cairn::Random& random) const {
    std::vector<Peak> peaks;
    Looked looked{map.grid.field(), cairn::thinned(z, thinning)};
    double inliers = 0;
    for (const bool likely : {true, false}) {
      if (!likely && inliers >= explained_badly) break;
      for (const auto& mode : motion.modes)
        if ((mode.share >= likely_share) == likely)
          inliers = std::max(inliers, add_peak(peaks, map, looked, mode, z));
    }
    drop_unfounded(peaks, map.model.independence * static_cast<double>(z.size()));
    if (peaks.empty()) return cairn::FromMotion{}(map, motion, z, random);
    // Likely motions by all of their evidence, rare ones by what counts of what they gain over those.
    const double likely = likely_evidence(peaks).value_or(peaks.front().log_evidence);
    std::vector<double> shares;  // of the motions, once the scan is seen: logarithms
    for (const Peak& peak : peaks) {
      const double counts = peak.mode->share >= likely_share ? 1 : evidence_share;
      shares.push_back(std::log(peak.mode->share) + counts * (peak.log_evidence - likely));
    }
    const double total = cairn::log_sum_exp(shares);
    const std::size_t chosen = one_by_weight(shares, total, random);
    const Peak& peak = peaks[chosen];
    const Kept kept = drawn(map, looked, peak, z, random);
    return {kept.pose, peak.q, likely + total / evidence_share + kept.log_weight - peak.log_evidence,
            kept.log_likelihood, peak.mode->regime};
  }

  /// The Gaussian fitted under one motion, if the scan fits there at all.
  [[nodiscard]] std::optional<cairn::Gaussian<cairn::SE2>> found(const OccupancyMap& map,
                                                                 const cairn::Gaussian<cairn::SE2>& motion,
                                                                 const OccupancyMap::Observation& z) const {
    std::vector<Peak> peaks;
    Looked looked{map.grid.field(), cairn::thinned(z, thinning)};
    const Mode mode{0, 1, motion};
    add_peak(peaks, map, looked, mode, z);
    return peaks.empty() ? std::nullopt : std::optional(peaks.front().q);
  }

private:
  using Mode = cairn::RegimeMotion<cairn::SE2>::Mode;
  struct Peak {
    const Mode* mode;
    cairn::Gaussian<cairn::SE2> q;
    double log_evidence;  // Laplace's: the integral of likelihood times motion, if that were q's shape
  };

  /// What all searches of one particle share.
  struct Looked {
    cairn::OccupancyGrid::Field field;
    std::vector<cairn::ScanPoint> few;
  };

  /// One of several poses, kept by its weight, and the logarithm of the mean of their weights: as unbiased as
  /// that of one draw, and steadier.
  struct Kept {
    cairn::SE2 pose;
    double log_likelihood, log_weight;
  };
  [[nodiscard]] Kept drawn(const OccupancyMap& map, Looked& looked, const Peak& peak,
                           const OccupancyMap::Observation& z, cairn::Random& random) const {
    CAIRN_EXPECTS(draws > 0, "FromMatch needs at least one draw");
    const cairn::Gaussian<cairn::SE2> wide{peak.q.mean, widened * widened * peak.q.covariance};
    std::vector<Kept> all;
    std::vector<double> log_weights;
    for (std::size_t k = 0; k < draws; ++k) {
      const cairn::SE2 x = cairn::sample(wide, random);
      const double l = cairn::log_likelihood(map.grid, looked.field, z, x, map.model);
      log_weights.push_back(l + cairn::log_density(peak.mode->motion, x) - cairn::log_density(wide, x));
      all.push_back({x, l, 0});
    }
    const double total = cairn::log_sum_exp(log_weights);
    const std::size_t chosen = draws == 1 ? 0 : one_by_weight(log_weights, total, random);
    all[chosen].log_weight = total - std::log(static_cast<double>(draws));
    return all[chosen];
  }

  /// An index, drawn; `total` is the logarithm of the weights' sum.
  [[nodiscard]] static std::size_t one_by_weight(const std::vector<double>& log_weights, double total,
                                                 cairn::Random& random) {
    std::size_t chosen = 0;
    for (double left = random.uniform(); chosen + 1 < log_weights.size(); ++chosen) {
      const double share = std::exp(log_weights[chosen] - total);
      if (!(left >= share)) break;
      left -= share;
    }
    return chosen;
  }

  /// Of the likely motions that explain the scan at all, the best one's.
  [[nodiscard]] std::optional<double> likely_evidence(const std::vector<Peak>& peaks) const {
    std::optional<double> best;
    for (const Peak& peak : peaks)
      if (peak.mode->share >= likely_share)
        best = std::max(best.value_or(peak.log_evidence), peak.log_evidence);
    return best;
  }

  /// Rare motions go that do not gain enough over the likely ones; the first of all is the likeliest.
  void drop_unfounded(std::vector<Peak>& peaks, double beams) const {
    const std::optional<double> likely = likely_evidence(peaks);
    if (!likely) return;
    const std::size_t regime = peaks.front().mode->regime;
    std::erase_if(peaks, [&](const Peak& peak) {
      const double gain = peak.mode->regime == regime ? rare_gain : rare_change_gain;
      return peak.mode->share < rare_share && peak.log_evidence < *likely + gain * beams;
    });
  }

  /// Returns the share of points that the best pose of this motion explains.
  double add_peak(std::vector<Peak>& peaks, const OccupancyMap& map, Looked& looked, const Mode& mode,
                  const OccupancyMap::Observation& z) const {
    const cairn::Cholesky<3> motion(mode.motion.covariance);
    if (!motion.good() || !(mode.share > 0)) return 0;
    cairn::MatchOptions options = match;
    options.model = map.model;
    cairn::SE2 start = best_start(map, looked, mode.motion);
    for (const Coarse& search : coarse) {
      options.model.sigma = search.width * map.model.sigma;
      options.settled = search.settled;
      start =
          cairn::match(map.grid, looked.field, looked.few, start, mode.motion.mean, motion.inverse(), options)
              .pose;
    }
    options.model = map.model;
    options.settled = match.settled;
    const cairn::MatchResult found =
        cairn::match(map.grid, looked.field, z, start, mode.motion.mean, motion.inverse(), options);
    const cairn::Cholesky<3> information(found.information);
    if (found.status == cairn::MatchStatus::few_inliers || !information.good()) return found.inliers;
    const double enough = mode.share < rare_share ? rare_explained : explained_well;
    if (mode.share < likely_share && found.inliers < enough) return found.inliers;
    peaks.push_back({&mode,
                     {found.pose, information.inverse()},
                     found.log_likelihood + found.log_prior -
                         0.5 * (motion.log_determinant() + information.log_determinant())});
    return found.inliers;
  }

  /// The best of a lattice of poses over two standard deviations of the motion, no finer than what the widest
  /// kernel bridges; the mean itself where the motion is no wider. All are ranked by how near to obstacles
  /// the points fall, and the first of them looked at.
  [[nodiscard]] cairn::SE2 best_start(const OccupancyMap& map, Looked& looked,
                                      const cairn::Gaussian<cairn::SE2>& motion) const {
    constexpr double reach = 0.15, turn = 0.08;               // [m], [rad] between neighbours
    constexpr double farthest = 3, round = std::numbers::pi;  // [m], [rad]: beyond, odometry says nothing
    const auto count = [](double variance, double most, double spacing) {
      return static_cast<int>(std::min(2 * std::sqrt(variance), most) / spacing);
    };
    const int nx = count(motion.covariance(0, 0), farthest, reach);
    const int ny = count(motion.covariance(1, 1), farthest, reach);
    const int na = count(motion.covariance(2, 2), round, turn);
    if (nx + ny + na == 0) return motion.mean;
    cairn::EndPointModel wide = map.model;
    wide.sigma *= coarse.empty() ? 1 : coarse.front().width;
    const std::vector<cairn::ScanPoint> points = cairn::thinned(looked.few, 2 * thinning);
    FirstFew first;
    Ranking ranking(map.grid, wide, points);
    for (int a = -na; a <= na; ++a) {
      ranking.turn(motion.mean.angle() + turn * a);
      for (int y = -ny; y <= ny; ++y)
        for (int x = -nx; x <= nx; ++x) {
          const cairn::SE2 pose =
              cairn::retract(motion.mean, cairn::Vector<3>(reach * x, reach * y, turn * a));
          first.add({ranking.worth(pose, first.least()), pose});
        }
    }
    cairn::SE2 best = motion.mean;
    double most = cairn::log_likelihood(map.grid, looked.field, points, best, wide);
    for (const Ranked& each : first.all) {
      const double l = cairn::log_likelihood(map.grid, looked.field, points, each.pose, wide);
      if (l > most) {
        most = l;
        best = each.pose;
      }
    }
    return best;
  }

  struct Ranked {
    float worth;
    cairn::SE2 pose;
  };
  /// The first of many, the best first; of equals those that came first.
  struct FirstFew {
    static constexpr std::size_t most = 12;
    std::vector<Ranked> all;
    /// What is worth no more is not among them.
    [[nodiscard]] float least() const {
      return all.size() < most ? -std::numeric_limits<float>::infinity() : all.back().worth;
    }
    void add(const Ranked& next) {
      if (!(next.worth > least())) return;
      if (all.size() == most) all.pop_back();
      const auto place = std::ranges::upper_bound(all, next.worth, std::ranges::greater{}, &Ranked::worth);
      all.insert(place, next);
    }
  };
  /// What poses are worth by the rings of obstacles that the points fall into.
  class Ranking {
  public:
    Ranking(const cairn::OccupancyGrid& grid, const cairn::EndPointModel& model,
            const std::vector<cairn::ScanPoint>& points)
        : geometry_(grid.geometry()), rings_(grid.cells()), points_(points) {
      using Rings = cairn::ObstacleRings<cairn::OccupancyCell>;
      worth_[0] = static_cast<float>(std::log(model.outliers));
      for (std::size_t k = 0; k < Rings::rings; ++k) {
        const double d = Rings::distance[k] * geometry_.cell_size / model.sigma;
        worth_[Rings::rings - k] =
            static_cast<float>(std::log((1 - model.outliers) * std::exp(-0.5 * d * d) + model.outliers));
      }
      turned_.resize(points.size());
    }
    /// The heading of the poses that follow.
    void turn(double angle) {
      const double scale = 1 / geometry_.cell_size, c = scale * std::cos(angle), s = scale * std::sin(angle);
      for (std::size_t i = 0; i < points_.size(); ++i)
        turned_[i] = {c * points_[i].x - s * points_[i].y, s * points_[i].x + c * points_[i].y};
    }
    /// What a pose is worth; of one worth no more than `least`, some number that is no more than that either:
    /// each point takes away from it.
    [[nodiscard]] float worth(const cairn::SE2& pose, float least) {
      const double column = geometry_.column_of(pose.x()), row = geometry_.row_of(pose.y());
      float sum = 0;
      for (const cairn::ScanPoint& p : turned_) {
        const double x = column + p.x, y = row + p.y;
        const bool has_cell = std::abs(x) < cairn::farthest_cell && std::abs(y) < cairn::farthest_cell;
        sum += worth_[has_cell ? static_cast<std::size_t>(rings_.around({whole(x), whole(y)})) : 0];
        if (!(sum > least)) break;
      }
      return sum;
    }

  private:
    [[nodiscard]] static std::int32_t whole(double x) noexcept {
      const auto towards_zero = static_cast<std::int32_t>(x);
      return towards_zero - (x < towards_zero ? 1 : 0);
    }
    cairn::GridGeometry geometry_;
    cairn::ObstacleRings<cairn::OccupancyCell> rings_;
    const std::vector<cairn::ScanPoint>& points_;
    std::vector<cairn::ScanPoint> turned_;  // [cells]
    std::array<float, 4> worth_{};          // by the number of rings around
  };
};

}  // namespace grid_slam
