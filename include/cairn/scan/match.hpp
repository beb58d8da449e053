// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How likely a scan is at a pose, and the pose where it is likeliest, with the curvature there.
///
///   log p(z | x, m) = independence * sum_k log( (1 - e) exp(-d_k(x)^2 / (2 sigma^2)) + e )
/// d_k is the distance of end point k, put at x, from the obstacle that the distance field names: across the
/// line that it is part of, or to the point itself where there is no line; a point with no obstacle near has
/// e where the map is known and u where it is not. Distances across lines leave what
/// slides along them free, so that the curvature in a corridor is none along it. e is the share of beams that
/// end at what the map does not have. `independence` is the share of beams that are worth an independent one:
/// neighbours end at the same furniture and in the same cells. (A. Censi, "An ICP variant using a
/// point-to-line metric", ICRA 2008, for the distance; G. Grisetti, C. Stachniss, W. Burgard, T-RO 23, 2007,
/// for the use.)
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/grid/distance_field.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/scan/occupancy_grid.hpp>
#include <cairn/scan/scan.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The model of a scan's end points in a distance field.
struct EndPointModel {
  double sigma = 0.03;     ///< of an end point across a wall of the map, at least 1e-6 [m]
  double outliers = 0.05;  ///< e above, at least 1e-30
  /// u above: what an end point in a cell that no beam has entered is worth. Between e, by which scans would
  /// be drawn back to what is known, and 1, by which they would flee from it.
  double unknown = 0.4;
  double independence = 0.2;  ///< in (0, 1]

  [[nodiscard]] bool valid() const noexcept {
    return sigma >= 1e-6 && std::isfinite(sigma) && outliers >= 1e-30 && outliers < 1 &&
           unknown >= outliers && unknown <= 1 && independence > 0 && independence <= 1;
  }
};

/// What a scan says at one pose.
struct ScanLikelihood {
  double log_likelihood = 0;
  /// Of the points in what the map knows (but of a quarter of all at least) the share that is nearer to an
  /// obstacle than 3 sigma.
  double inliers = 0;
  double matched = 0;                       ///< the same share, of all points
  Vector<3> gradient = Vector<3>::Zero();   ///< of log_likelihood, by a step of the pose
  Matrix<3> curvature = Matrix<3>::Zero();  ///< Gauss-Newton's: what the points inform on the pose
};

namespace detail {

/// Four floats at once, on every target alike, so that results do not depend on the width of its registers.
using FourFloats = Lanes<float, 4>;
using FourInts = Lanes<std::int32_t, 4>;

/// e^x for x <= 0, to a few units in the last place; 0 far below.
[[gnu::always_inline]] inline FourFloats exp_of_negative(FourFloats x) noexcept {
  const FourFloats lowest = FourFloats{} - 80.0F;
  x = x < lowest ? lowest : x;
  const FourFloats doublings = x * 1.44269504F;
  const FourInts whole = __builtin_convertvector(doublings - 0.5F, FourInts);  // to the nearest
  const FourFloats r = (doublings - __builtin_convertvector(whole, FourFloats)) * 0.693147181F;
  FourFloats sum = 1 + r * (1.0F / 6);
  for (int k = 5; k > 0; --k) sum = 1 + r * (sum * (1.0F / static_cast<float>(k)));
  return sum * std::bit_cast<FourFloats>((whole + 127) << 23);
}

/// End points at one pose, a block at a time: what the field knows where they fall.
class PointBlock {
public:
  static constexpr std::size_t size = 64;
  using Numbers = std::array<float, size>;

  std::size_t count = 0;
  std::size_t unknown = 0;            // points where no beam has been
  alignas(16) Numbers alone;          // what a point without an obstacle near is worth, 0 where one is near
  alignas(16) Numbers dx, dy;         // to the obstacle, across its line if there is one [m], in the world
  alignas(16) Numbers pxx, pxy, pyy;  // what of a move the distance feels: a projection on the normal
  alignas(16) Numbers qx, qy;         // from the laser to the point [m], in the world

  void take(OccupancyGrid::Field& field, const GridGeometry& geometry, const EndPointModel& model,
            const SE2& pose, std::span<const ScanPoint> points) noexcept {
    count = points.size();
    unknown = 0;
    const double c = std::cos(pose.angle()), s = std::sin(pose.angle()), scale = 1 / geometry.cell_size;
    const double x0 = (pose.x() - geometry.origin_x) * scale, y0 = (pose.y() - geometry.origin_y) * scale;
    std::array<double, size> column, row;
    for (std::size_t i = 0; i < count; ++i) {
      const double x = c * points[i].x - s * points[i].y, y = s * points[i].x + c * points[i].y;
      qx[i] = static_cast<float>(x);
      qy[i] = static_cast<float>(y);
      column[i] = x0 + scale * x;
      row[i] = y0 + scale * y;
    }
    for (std::size_t i = 0; i < count; ++i) look_up(i, column[i], row[i], field, geometry, model);
    for (std::size_t i = count; i % 4 != 0; ++i) {  // what fills the last four changes nothing
      alone[i] = 1;
      dx[i] = dy[i] = pxx[i] = pxy[i] = pyy[i] = qx[i] = qy[i] = 0;
    }
  }
  /// Fours of points.
  [[nodiscard]] std::size_t fours() const noexcept { return (count + 3) / 4; }
  [[nodiscard]] static FourFloats four(const Numbers& numbers, std::size_t k) noexcept {
    return load<FourFloats>(numbers.data() + 4 * k);
  }

private:
  void look_up(std::size_t i, double column, double row, OccupancyGrid::Field& field,
               const GridGeometry& geometry, const EndPointModel& model) noexcept {
    dx[i] = dy[i] = pxx[i] = pxy[i] = pyy[i] = 0;
    constexpr double far = farthest_cell;
    if (!(std::abs(column) < far && std::abs(row) < far)) {
      ++unknown;
      alone[i] = static_cast<float>(model.unknown);
      qx[i] = qy[i] = 0;  // which may be no numbers
      return;
    }
    const CellAddress cell{floor_of(column), floor_of(row)};
    const NearestObstacle& o = field.at(cell);
    if (!o.found) {
      const bool known = field.cell(cell).known();
      unknown += known ? 0 : 1;
      alone[i] = static_cast<float>(known ? model.outliers : model.unknown);
      return;
    }
    alone[i] = 0;
    const auto size_of_cell = static_cast<float>(geometry.cell_size);
    const float x = size_of_cell * (o.dx + static_cast<float>(cell.column + 0.5 - column));
    const float y = size_of_cell * (o.dy + static_cast<float>(cell.row + 0.5 - row));
    const bool line = o.has_line();
    pxx[i] = line ? o.normal_x * o.normal_x : 1;
    pxy[i] = line ? o.normal_x * o.normal_y : 0;
    pyy[i] = line ? o.normal_y * o.normal_y : 1;
    dx[i] = pxx[i] * x + pxy[i] * y;
    dy[i] = pxy[i] * x + pyy[i] * y;
  }
  [[nodiscard]] static std::int32_t floor_of(double x) noexcept {  // less a call
    const auto whole = static_cast<std::int32_t>(x);
    return whole - (x < whole ? 1 : 0);
  }
};

/// Sum of logarithms of numbers of at most 1: one logarithm for many, before their product is too small.
class SumOfLogs {
public:
  void add(FourFloats factors) noexcept {
    product_ *= static_cast<double>(factors[0]) * static_cast<double>(factors[1]) *
                (static_cast<double>(factors[2]) * static_cast<double>(factors[3]));
    if (product_ < 1e-150) flush();
  }
  [[nodiscard]] double value() noexcept {
    flush();
    return sum_;
  }

private:
  void flush() noexcept {
    sum_ += std::log(product_);
    product_ = 1;
  }
  double sum_ = 0, product_ = 1;
};

/// Sums over the points of a scan, in the world's directions: the likelihood, and with `Slopes` its gradient
/// and curvature.
template <bool Slopes>
struct PointSums {
  SumOfLogs logs;
  FourFloats inliers{};
  FourFloats gx{}, gy{}, ga{};                    // gradient
  FourFloats xx{}, xy{}, yy{}, xa{}, ya{}, aa{};  // curvature

  void add(const PointBlock& points, const EndPointModel& model) noexcept {
    const auto information = static_cast<float>(1 / (model.sigma * model.sigma));
    const auto share = static_cast<float>(1 - model.outliers), outliers = static_cast<float>(model.outliers);
    const FourFloats zero{}, one = zero + 1.0F;
    for (std::size_t k = 0; k < points.fours(); ++k) {
      const FourFloats alone = PointBlock::four(points.alone, k);
      const FourFloats dx = PointBlock::four(points.dx, k), dy = PointBlock::four(points.dy, k);
      const FourFloats squared = (dx * dx + dy * dy) * information;
      const FourFloats near = alone == zero ? share * exp_of_negative(-0.5F * squared) : zero;
      const FourFloats factor = alone == zero ? near + outliers : alone;
      logs.add(factor);
      if constexpr (!Slopes) continue;
      const FourFloats matched = squared < zero + 9.0F ? one : zero;
      inliers += alone == zero ? matched : zero;
      const FourFloats weight = near / factor * information;  // probability of no outlier
      const FourFloats qx = PointBlock::four(points.qx, k), qy = PointBlock::four(points.qy, k);
      const FourFloats pxx = PointBlock::four(points.pxx, k), pxy = PointBlock::four(points.pxy, k),
                       pyy = PointBlock::four(points.pyy, k);
      gx += weight * dx;
      gy += weight * dy;
      ga += weight * (dy * qx - dx * qy);
      const FourFloats tx = pxy * qx - pxx * qy, ty = pyy * qx - pxy * qy;  // felt of a turn
      xx += weight * pxx;
      xy += weight * pxy;
      yy += weight * pyy;
      xa += weight * tx;
      ya += weight * ty;
      aa += weight * (ty * qx - tx * qy);
    }
  }
};

template <bool Slopes>
ScanLikelihood evaluated(const OccupancyGrid& map, OccupancyGrid::Field& field,
                         std::span<const ScanPoint> points, const SE2& pose, const EndPointModel& model) {
  PointSums<Slopes> sums;
  PointBlock block;
  std::size_t unknown = 0;
  for (std::size_t i = 0; i < points.size(); i += PointBlock::size) {
    block.take(field, map.geometry(), model, pose,
               points.subspan(i, std::min(PointBlock::size, points.size() - i)));
    sums.add(block, model);
    unknown += block.unknown;
  }
  ScanLikelihood out;
  out.log_likelihood = model.independence * sums.logs.value();
  if constexpr (Slopes) {
    const auto total = [&](const FourFloats& f) {
      return model.independence * (static_cast<double>(f[0] + f[1]) + static_cast<double>(f[2] + f[3]));
    };
    Matrix<3> turn = Matrix<3>::Identity();  // steps of the pose are along the laser's axes
    turn(0, 0) = turn(1, 1) = std::cos(pose.angle());
    turn(1, 0) = std::sin(pose.angle());
    turn(0, 1) = -turn(1, 0);
    Matrix<3> curvature;
    curvature(0, 0) = total(sums.xx);
    curvature(0, 1) = curvature(1, 0) = total(sums.xy);
    curvature(1, 1) = total(sums.yy);
    curvature(0, 2) = curvature(2, 0) = total(sums.xa);
    curvature(1, 2) = curvature(2, 1) = total(sums.ya);
    curvature(2, 2) = total(sums.aa);
    out.gradient = turn.transpose() * Vector<3>(total(sums.gx), total(sums.gy), total(sums.ga));
    out.curvature = turn.transpose() * curvature * turn;
    const double inliers = total(sums.inliers) / model.independence;
    const std::size_t known = std::max(points.size() - unknown, points.size() / 4);
    out.inliers = known == 0 ? 0 : inliers / static_cast<double>(known);
    if (!points.empty()) out.matched = inliers / static_cast<double>(points.size());
  }
  return out;
}

}  // namespace detail

/// log p(z | x, m) of the points at a pose. O(points), and the field's searches where it is new.
[[nodiscard]] inline double log_likelihood(const OccupancyGrid& map, OccupancyGrid::Field& field,
                                           std::span<const ScanPoint> points, const SE2& pose,
                                           const EndPointModel& model) {
  return detail::evaluated<false>(map, field, points, pose, model).log_likelihood;
}
[[nodiscard]] inline double log_likelihood(const OccupancyGrid& map, std::span<const ScanPoint> points,
                                           const SE2& pose, const EndPointModel& model) {
  auto field = map.field();
  return log_likelihood(map, field, points, pose, model);
}

/// The same with gradient and curvature. `field` is the map's, kept from one pose to the next.
[[nodiscard]] inline ScanLikelihood evaluate(const OccupancyGrid& map, OccupancyGrid::Field& field,
                                             std::span<const ScanPoint> points, const SE2& pose,
                                             const EndPointModel& model) {
  return detail::evaluated<true>(map, field, points, pose, model);
}
[[nodiscard]] inline ScanLikelihood evaluate(const OccupancyGrid& map, std::span<const ScanPoint> points,
                                             const SE2& pose, const EndPointModel& model) {
  auto field = map.field();
  return evaluate(map, field, points, pose, model);
}

/// How a match ended.
enum class MatchStatus {
  converged,
  not_converged,  ///< the best pose of all steps is given
  few_inliers,    ///< less than the share asked for
};

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(MatchStatus status) noexcept {
  switch (status) {
    case MatchStatus::converged:
      return "converged";
    case MatchStatus::not_converged:
      return "not converged: the best pose of all steps is given";
    case MatchStatus::few_inliers:
      return "few inliers: too few points of the scan lie where the map has obstacles";
  }
  return "unknown status";
}

/// Options of match().
struct MatchOptions {
  EndPointModel model{};
  int most_steps = 12;
  double enough_inliers = 0.3;
  double settled = 1e-4;  ///< a step shorter than this ends the search [m, rad]
};

/// The pose where likelihood times prior is largest, and the information (inverse covariance) there, the
/// prior's included, for steps retract(pose, d).
struct MatchResult {
  SE2 pose;
  Matrix<3> information = Matrix<3>::Zero();
  double log_likelihood = 0;
  double log_prior = 0;  ///< -1/2 of the squared Mahalanobis distance from the prior's mean
  double inliers = 0;    ///< as in ScanLikelihood
  double matched = 0;
  int steps = 0;
  MatchStatus status = MatchStatus::not_converged;
};

/// Levenberg-Marquardt from `start` under a Gaussian prior with the given mean and information, which must be
/// symmetric and positive semi-definite. The result is never worse than the start. `field` is the map's, kept
/// from one match to the next.
[[nodiscard]] inline MatchResult match(const OccupancyGrid& map, OccupancyGrid::Field& field,
                                       std::span<const ScanPoint> points, const SE2& start,
                                       const SE2& prior_mean, const Matrix<3>& prior_information,
                                       const MatchOptions& options = {}) {
  CAIRN_EXPECTS(options.model.valid(), "match needs a model within its ranges");
  const auto prior_cost = [&](const SE2& x) {
    const Vector<3> d = local(prior_mean, x);
    return 0.5 * d.dot(prior_information * d);
  };
  MatchResult best;
  best.pose = start;
  ScanLikelihood at = evaluate(map, field, points, start, options.model);
  double cost = prior_cost(start) - at.log_likelihood, damping = 1e-4;
  while (best.steps < options.most_steps) {
    ++best.steps;
    const Vector<3> slope = at.gradient - prior_information * local(prior_mean, best.pose);
    Matrix<3> a = at.curvature + prior_information;
    for (int i = 0; i < 3; ++i) a(i, i) += damping * a(i, i) + 1e-9;
    const Vector<3> step = Cholesky<3>(a).solve(slope);
    if (!all_finite(step)) break;
    const SE2 next = retract(best.pose, step);
    const ScanLikelihood there = evaluate(map, field, points, next, options.model);
    const double next_cost = prior_cost(next) - there.log_likelihood;
    const bool settled = step.cwiseAbs().maxCoeff() < options.settled;
    if (next_cost <= cost) {
      best.pose = next;
      at = there;
      cost = next_cost;
      damping = std::max(1e-6, 0.2 * damping);
    } else {
      damping = std::max(1e-3, 10 * damping);
    }
    if (settled) {
      best.status = MatchStatus::converged;
      break;
    }
  }
  best.information = at.curvature + prior_information;
  best.log_likelihood = at.log_likelihood;
  best.log_prior = -prior_cost(best.pose);
  best.inliers = at.inliers;
  best.matched = at.matched;
  if (at.inliers < options.enough_inliers) best.status = MatchStatus::few_inliers;
  return best;
}
[[nodiscard]] inline MatchResult match(const OccupancyGrid& map, std::span<const ScanPoint> points,
                                       const SE2& start, const SE2& prior_mean,
                                       const Matrix<3>& prior_information, const MatchOptions& options = {}) {
  auto field = map.field();
  return match(map, field, points, start, prior_mean, prior_information, options);
}

}}  // namespace cairn::CAIRN_ABI
