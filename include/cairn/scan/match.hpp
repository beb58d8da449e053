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
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/grid/distance_field.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/scan/occupancy_grid.hpp>
#include <cairn/scan/scan.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The model of a scan's end points in a distance field.
struct EndPointModel {
  double sigma = 0.03;     ///< of an end point across a wall of the map [m]
  double outliers = 0.05;  ///< e above
  /// u above: what an end point in a cell that no beam has entered is worth. Between e, by which scans would
  /// be drawn back to what is known, and 1, by which they would flee from it.
  double unknown = 0.4;
  double independence = 0.2;  ///< in (0, 1]

  [[nodiscard]] bool valid() const noexcept {
    return sigma > 0 && std::isfinite(sigma) && outliers > 0 && outliers < 1 && unknown >= outliers &&
           unknown <= 1 && independence > 0 && independence <= 1;
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

/// Sum of logarithms of numbers of at most 1: one logarithm for many, before their product is too small.
class SumOfLogs {
public:
  void add(double factor) noexcept {
    product_ *= factor;
    if (product_ < 1e-200) flush();
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

/// Looks cells of the field up; neighbouring points mostly lie in the same tile.
class FieldReader {
public:
  explicit FieldReader(const OccupancyGrid& map) : map_(map) {}

  /// Whether a beam has entered the cell.
  [[nodiscard]] bool known(double column, double row) const noexcept {
    return map_.cells().read(cell_at(column, row)).known();
  }

  /// The step [cells] from (column, row) to the nearest obstacle and its normal; false where none is near.
  bool find(double column, double row, float step[2], float normal[2]) noexcept {
    const CellAddress cell = cell_at(column, row);
    const TileAddress address = tile_of(cell);
    if (!looked_ || address != address_) {
      tile_ = map_.field().tile(address);
      address_ = address;
      looked_ = true;
    }
    if (tile_ == nullptr) return false;
    const NearestObstacle& o = (*tile_)[place_in_tile(cell)];
    if (!o.found()) return false;
    constexpr float unit = 1.0F / NearestObstacle::steps;
    step[0] = static_cast<float>(o.dx) * unit + static_cast<float>(cell.column + 0.5 - column);
    step[1] = static_cast<float>(o.dy) * unit + static_cast<float>(cell.row + 0.5 - row);
    normal[0] = static_cast<float>(o.normal_x) * (1.0F / 127);
    normal[1] = static_cast<float>(o.normal_y) * (1.0F / 127);
    return true;
  }

private:
  [[nodiscard]] static CellAddress cell_at(double column, double row) noexcept {
    const auto c = static_cast<std::int32_t>(column),
               r = static_cast<std::int32_t>(row);  // floor, less a call
    return {c - (column < c ? 1 : 0), r - (row < r ? 1 : 0)};
  }

  const OccupancyGrid& map_;
  const DistanceField::Tile* tile_ = nullptr;
  TileAddress address_{};
  bool looked_ = false;
};

/// One end point at a pose: distance d and its derivative by a step of the pose, for one or two directions.
struct PointResidual {
  int count = 0;  // 0: nothing near; 1: across a line; 2: to a point
  double squared = 0;
  double d[2] = {0, 0};
  Vector<3> slope[2];
};

/// Evaluates end points at one pose.
class EndPoints {
public:
  EndPoints(const OccupancyGrid& map, const SE2& pose)
      : reader_(map),
        geometry_(map.geometry()),
        pose_(pose),
        cosine_(std::cos(pose.angle())),
        sine_(std::sin(pose.angle())) {}

  /// What a point without an obstacle near is worth.
  double alone(const ScanPoint& p, const EndPointModel& model) const noexcept {
    const double x = pose_.x() + cosine_ * p.x - sine_ * p.y, y = pose_.y() + sine_ * p.x + cosine_ * p.y;
    const bool known = geometry_.contains(x, y) && reader_.known(geometry_.column_of(x), geometry_.row_of(y));
    return known ? model.outliers : model.unknown;
  }

  /// Squared distance [m^2] of a point, negative where no obstacle is near.
  double squared_distance(const ScanPoint& p) noexcept {
    float step[2], normal[2];
    if (!find(p, step, normal)) return -1;
    const double size = geometry_.cell_size, dx = static_cast<double>(step[0]),
                 dy = static_cast<double>(step[1]);
    if (normal[0] == 0 && normal[1] == 0) return size * size * (dx * dx + dy * dy);
    const double across = size * (dx * static_cast<double>(normal[0]) + dy * static_cast<double>(normal[1]));
    return across * across;
  }

  PointResidual residual(const ScanPoint& p) noexcept {
    PointResidual r;
    float step[2], normal[2];
    if (!find(p, step, normal)) return r;
    const bool line = normal[0] != 0 || normal[1] != 0;
    r.count = line ? 1 : 2;
    for (int k = 0; k < r.count; ++k) {
      const double nx = line ? static_cast<double>(normal[0]) : k == 0 ? 1.0 : 0.0;
      const double ny = line ? static_cast<double>(normal[1]) : k == 0 ? 0.0 : 1.0;
      r.d[k] = geometry_.cell_size * (nx * static_cast<double>(step[0]) + ny * static_cast<double>(step[1]));
      const double u = nx * cosine_ + ny * sine_,
                   v = ny * cosine_ - nx * sine_;  // the normal, seen by the laser
      r.slope[k] = Vector<3>(-u, -v, u * p.y - v * p.x);
      r.squared += r.d[k] * r.d[k];
    }
    return r;
  }

private:
  bool find(const ScanPoint& p, float step[2], float normal[2]) noexcept {
    const double x = pose_.x() + cosine_ * p.x - sine_ * p.y, y = pose_.y() + sine_ * p.x + cosine_ * p.y;
    if (!geometry_.contains(x, y)) return false;
    return reader_.find(geometry_.column_of(x), geometry_.row_of(y), step, normal);
  }

  FieldReader reader_;
  const GridGeometry& geometry_;
  SE2 pose_;
  double cosine_, sine_;
};

}  // namespace detail

/// log p(z | x, m) of the points at a pose.
[[nodiscard]] inline double log_likelihood(const OccupancyGrid& map, std::span<const ScanPoint> points,
                                           const SE2& pose, const EndPointModel& model) {
  detail::EndPoints at(map, pose);
  const double scale = -0.5 / (model.sigma * model.sigma);
  detail::SumOfLogs sum;
  for (const ScanPoint& p : points) {
    const double squared = at.squared_distance(p);
    sum.add(squared < 0 ? at.alone(p, model)
                        : (1 - model.outliers) * std::exp(scale * squared) + model.outliers);
  }
  return model.independence * sum.value();
}

/// The same with gradient and curvature.
[[nodiscard]] inline ScanLikelihood evaluate(const OccupancyGrid& map, std::span<const ScanPoint> points,
                                             const SE2& pose, const EndPointModel& model) {
  ScanLikelihood out;
  detail::EndPoints at(map, pose);
  const double information = 1 / (model.sigma * model.sigma);
  std::size_t inliers = 0, unknown = 0;
  detail::SumOfLogs sum;
  for (const ScanPoint& p : points) {
    const detail::PointResidual r = at.residual(p);
    if (r.count == 0) {
      const double worth = at.alone(p, model);
      if (worth > model.outliers) ++unknown;
      sum.add(worth);
      continue;
    }
    const double near = (1 - model.outliers) * std::exp(-0.5 * information * r.squared);
    const double weight = near / (near + model.outliers) * information;  // probability of no outlier
    sum.add(near + model.outliers);
    if (r.squared * information < 9) ++inliers;
    for (int k = 0; k < r.count; ++k) {
      out.gradient -= weight * r.d[k] * r.slope[k];
      out.curvature += weight * r.slope[k] * r.slope[k].transpose();
    }
  }
  out.log_likelihood = model.independence * sum.value();
  out.gradient *= model.independence;
  out.curvature *= model.independence;
  const std::size_t known = std::max(points.size() - unknown, points.size() / 4);
  out.inliers = known == 0 ? 0 : static_cast<double>(inliers) / static_cast<double>(known);
  if (!points.empty()) out.matched = static_cast<double>(inliers) / static_cast<double>(points.size());
  return out;
}

/// How a match ended.
enum class MatchStatus {
  converged,
  not_converged,  ///< the best pose of all steps is given
  few_inliers,    ///< less than the share asked for
};

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
/// symmetric and positive semi-definite. The result is never worse than the start.
[[nodiscard]] inline MatchResult match(const OccupancyGrid& map, std::span<const ScanPoint> points,
                                       const SE2& start, const SE2& prior_mean,
                                       const Matrix<3>& prior_information, const MatchOptions& options = {}) {
  CAIRN_EXPECTS(options.model.valid(), "match needs a model within its ranges");
  const auto prior_cost = [&](const SE2& x) {
    const Vector<3> d = local(prior_mean, x);
    return 0.5 * d.dot(prior_information * d);
  };
  MatchResult best;
  best.pose = start;
  ScanLikelihood at = evaluate(map, points, start, options.model);
  double cost = prior_cost(start) - at.log_likelihood, damping = 1e-4;
  while (best.steps < options.most_steps) {
    ++best.steps;
    const Vector<3> slope = at.gradient - prior_information * local(prior_mean, best.pose);
    Matrix<3> a = at.curvature + prior_information;
    for (int i = 0; i < 3; ++i) a(i, i) += damping * a(i, i) + 1e-9;
    const Vector<3> step = Cholesky<3>(a).solve(slope);
    if (!all_finite(step)) break;
    const SE2 next = retract(best.pose, step);
    const ScanLikelihood there = evaluate(map, points, next, options.model);
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

}}  // namespace cairn::CAIRN_ABI
