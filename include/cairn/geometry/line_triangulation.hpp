// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A line of space from the segments that two or more cameras of a rig saw of it, with its covariance.
///
/// A segment and its camera's centre span a plane. Two planes meet in a line; where it is held against what
/// all cameras saw, each of the 2 k ends of k segments is a distance e (3) of line.hpp from the projected
/// line, and Gauss-Newton minimises sum e^2 over the line's four numbers. Ends are no points of the line that
/// two cameras have in common: only what lies across the line counts. Two cameras beside each other are blind
/// to lines along their baseline, whose planes are equal; a third above them is not (M. Dailey, M.
/// Parnichkun, "Simultaneous localization and mapping with stereo vision", ICARCV 2006, use three).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/geometry/line.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What a camera saw of a line: two places on it, in pixels without distortion (straight_pixel()).
struct LineSegment {
  Vector<2> from = Vector<2>::Zero();
  Vector<2> to = Vector<2>::Zero();

  [[nodiscard]] Vector<2> middle() const { return 0.5 * (from + to); }
  [[nodiscard]] double length() const { return (to - from).norm(); }
};

/// How far a segment's ends are from where a line is projected [pixels], and how that changes.
struct SegmentDistance {
  Vector<2> distance = Vector<2>::Zero();
  Matrix<2, 4> J_line = Matrix<2, 4>::Zero();  ///< by a step of the line
  Matrix<2, 6> J_pose = Matrix<2, 6>::Zero();  ///< by a step of the rig's pose in the line's frame
};

/// The same of a line in Pluecker coordinates of any common length.
struct PlueckerDistance {
  Vector<2> distance = Vector<2>::Zero();
  Matrix<2, 6> J_line = Matrix<2, 6>::Zero();  ///< by moment, then direction
  Matrix<2, 6> J_pose = Matrix<2, 6>::Zero();  ///< by a step of the rig's pose in the line's frame
};

/// A camera of a rig, prepared for lines. Immutable.
class LineCamera {
public:
  LineCamera(const PinholeCamera& camera, const SE3& T_rig_camera)
      : camera_(camera),
        T_rig_camera_(T_rig_camera),
        projection_(product_transposed(line_projection(camera), T_rig_camera.rotation().matrix())) {}

  [[nodiscard]] const PinholeCamera& camera() const noexcept { return camera_; }
  [[nodiscard]] const SE3& T_rig_camera() const noexcept { return T_rig_camera_; }
  [[nodiscard]] const Vector<3>& centre() const noexcept { return T_rig_camera_.translation(); }

  /// The image line of a line of the rig's frame, (2) of line.hpp.
  [[nodiscard]] Vector<3> image(const Line& line) const {
    return product(projection_, line.moment(centre()));
  }
  /// Direction of the ray of a straight pixel, rig frame; not of length 1.
  [[nodiscard]] Vector<3> ray(const Vector<2>& pixel) const {
    return T_rig_camera_.rotation().rotate(
        {(pixel(0) - camera_.cx()) / camera_.fx(), (pixel(1) - camera_.cy()) / camera_.fy(), 1});
  }
  /// Normal of length 1 of the plane of a segment, rig frame; zero where its ends are one.
  [[nodiscard]] Vector<3> plane(const LineSegment& segment) const {
    const Vector<3> n = detail::cross<double>(ray(segment.from), ray(segment.to));
    const double length = n.norm();
    return length > 0 ? Vector<3>(n / length) : Vector<3>(Vector<3>::Zero());
  }
  /// Distance along the camera's axis of a point of the rig's frame.
  [[nodiscard]] double depth(const Vector<3>& point) const { return (T_rig_camera_.inverse() * point)(2); }

  /// Distances of a segment's ends from a line of the rig's frame.
  [[nodiscard]] Vector<2> distance(const Line& line, const LineSegment& segment) const {
    const Vector<3> l = image(line);
    return {distance_to(l, segment.from).distance, distance_to(l, segment.to).distance};
  }
  /// The same with Jacobians.
  [[nodiscard]] SegmentDistance see(const Line& line, const LineSegment& segment) const {
    const Matrix<3> frame = line.frame().matrix();
    const Vector<3> e1 = frame.col(0), e2 = frame.col(1), d = frame.col(2), arm = line.point() - centre();
    // n = (p - c) x d: a turn moves d by w2 e1 - w1 e2, a shift moves p by a e1 + b e2
    Matrix<3, 4> by_line;
    put(by_line, 0, 0, Vector<3>(-detail::cross<double>(arm, e2)));
    put(by_line, 0, 1, detail::cross<double>(arm, e1));
    put(by_line, 0, 2, Vector<3>(-e2));
    put(by_line, 0, 3, e1);
    // a step (rho, w) of the rig moves p by -rho - w x p and d by -w x d
    const Matrix<3> D = skew(d);
    Matrix<3, 6> by_pose;
    put(by_pose, 0, 0, D);
    put(by_pose, 0, 3, Matrix<3>(product(skew(arm), D) - product(D, skew(line.point()))));
    const Vector<3> l = product(projection_, detail::cross<double>(arm, d));
    SegmentDistance result;
    for (int end = 0; end < 2; ++end) {
      const LineDistance e = distance_to(l, end == 0 ? segment.from : segment.to);
      const Vector<3> by_normal = transposed_product(projection_, e.J_line);
      result.distance(end) = e.distance;
      put(result.J_line, end, 0, transposed_product(by_normal, by_line));
      put(result.J_pose, end, 0, transposed_product(by_normal, by_pose));
    }
    return result;
  }

  /// Distances of a segment's ends from the line of moment m and direction d, rig frame.
  [[nodiscard]] PlueckerDistance see(const Vector<3>& m, const Vector<3>& d,
                                     const LineSegment& segment) const {
    // n = m - c x d; a step (rho, w) of the rig moves d by -w x d and m by -w x m - rho x d
    const Matrix<3> D = skew(d), C = skew(centre());
    Matrix<3, 6> by_pose;
    put(by_pose, 0, 0, D);
    put(by_pose, 0, 3, Matrix<3>(skew(m) - product(C, D)));
    const Vector<3> l = product(projection_, Vector<3>(m - product(C, d)));
    PlueckerDistance result;
    for (int end = 0; end < 2; ++end) {
      const LineDistance e = distance_to(l, end == 0 ? segment.from : segment.to);
      const Vector<3> by_normal = transposed_product(projection_, e.J_line);
      result.distance(end) = e.distance;
      put(result.J_line, end, 0, transposed(by_normal));
      put(result.J_line, end, 3, Matrix<1, 3>(-transposed_product(by_normal, C)));
      put(result.J_pose, end, 0, transposed_product(by_normal, by_pose));
    }
    return result;
  }

  /// Where along a line of the rig's frame it passes the ray of a pixel most closely; nothing where that is
  /// behind the camera, or they are parallel.
  [[nodiscard]] std::optional<double> coordinate(const Line& line, const Vector<2>& pixel) const {
    const Vector<3> r = ray(pixel).normalized(), d = line.direction(), w = line.point() - centre();
    const double k = d.dot(r), rest = 1 - k * k;
    if (!(rest > 1e-12)) return std::nullopt;
    const double along = (k * r.dot(w) - d.dot(w)) / rest;
    if (!(r.dot(w) + along * k > 0)) return std::nullopt;
    return along;
  }

private:
  PinholeCamera camera_;
  SE3 T_rig_camera_;
  Matrix<3> projection_;  // K_l R_camera_rig
};

enum class LineStatus {
  good,
  parallel,       ///< no two planes meet at an angle that tells where
  behind,         ///< the line that comes out is not in front of the cameras
  not_converged,  ///< the least squares found no line: the segments are of different ones
};

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(LineStatus status) noexcept {
  switch (status) {
    case LineStatus::good:
      return "good";
    case LineStatus::parallel:
      return "refused: the planes of the segments are too near each other to meet in a line";
    case LineStatus::behind:
      return "refused: the line is not in front of the cameras";
    case LineStatus::not_converged:
      return "refused: no line fits the segments";
  }
  return "unknown status";
}

struct LineTriangulationOptions {
  double sigma = 0.5;       ///< of a segment's ends across the line [pixels]
  double min_angle = 0.01;  ///< between the two planes that differ most [rad]
  int most_steps = 10;      ///< of Gauss-Newton
};

/// Result. Where status is not good the rest has no meaning.
struct TriangulatedLine {
  Line line{};                                   ///< rig frame, held in the middle of what was seen
  Matrix<4> covariance = Matrix<4>::Identity();  ///< of the line's step
  double low = 0, high = 0;  ///< what was seen of it, by all cameras together, as coordinates [m]
  double chi2 = 0;           ///< sum of the squared distances over sigma^2; 2 k - 4 degrees of freedom
  LineStatus status = LineStatus::good;
  [[nodiscard]] bool good() const noexcept { return status == LineStatus::good; }
};

/// What one camera of the rig saw.
struct LineView {
  const LineCamera* camera = nullptr;  ///< never null
  LineSegment segment{};
};

namespace detail {

/// The line in which the two planes meet that differ most; nothing where all are nearly one.
[[nodiscard]] inline std::optional<Line> meeting_of_planes(std::span<const LineView> views,
                                                           double min_angle) {
  std::pair<std::size_t, std::size_t> pair{0, 0};
  double widest = std::sin(min_angle);
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const double sine =
          cross<double>(views[i].camera->plane(views[i].segment), views[j].camera->plane(views[j].segment))
              .norm();
      if (sine > widest) {
        widest = sine;
        pair = {i, j};
      }
    }
  if (pair.first == pair.second) return std::nullopt;
  const LineView &a = views[pair.first], &b = views[pair.second];
  const Vector<3> n = a.camera->plane(a.segment), m = b.camera->plane(b.segment);
  const Vector<3> d = cross<double>(n, m);
  const double reach_n = n.dot(a.camera->centre()), reach_m = m.dot(b.camera->centre());
  // the point of both planes that is nearest to the origin of the rig
  const Vector<3> p = (reach_n * cross<double>(m, d) + reach_m * cross<double>(d, n)) / d.squaredNorm();
  if (!all_finite(p)) return std::nullopt;
  return Line::along(p, d);
}

/// What was seen along the line; nothing where an end is behind its camera.
[[nodiscard]] inline std::optional<std::pair<double, double>> seen_along(std::span<const LineView> views,
                                                                         const Line& line) {
  std::pair<double, double> range{std::numeric_limits<double>::infinity(),
                                  -std::numeric_limits<double>::infinity()};
  for (const LineView& view : views)
    for (const Vector<2>& end : {view.segment.from, view.segment.to}) {
      const auto at = view.camera->coordinate(line, end);
      if (!at) return std::nullopt;
      range.first = std::min(range.first, *at);
      range.second = std::max(range.second, *at);
    }
  return range;
}

}  // namespace detail

/// The line that two or more cameras saw, by least squares. O(k) a step.
[[nodiscard]] inline TriangulatedLine triangulate_line(std::span<const LineView> views,
                                                       const LineTriangulationOptions& options = {}) {
  CAIRN_EXPECTS(options.sigma > 0, "triangulate_line: pixel noise must be positive");
  TriangulatedLine result;
  const auto refuse = [&](LineStatus status) {
    result.status = status;
    return result;
  };
  const auto start = detail::meeting_of_planes(views, options.min_angle);
  if (!start) return refuse(LineStatus::parallel);
  auto range = detail::seen_along(views, *start);
  if (!range) return refuse(LineStatus::behind);
  result.line = start->held_at((range->first + range->second) / 2);
  const double weight = 1 / (options.sigma * options.sigma);
  bool converged = false;
  for (int step = 0; step <= options.most_steps; ++step) {
    Matrix<4> information = Matrix<4>::Zero();
    Vector<4> gradient = Vector<4>::Zero();
    double chi2 = 0;
    for (const LineView& view : views) {
      const SegmentDistance e = view.camera->see(result.line, view.segment);
      add_transposed_product(information, e.J_line, e.J_line, weight);
      add_transposed_product(gradient, e.J_line, e.distance, weight);
      chi2 += weight * e.distance.squaredNorm();
    }
    const Cholesky<4> root(information);
    if (!root.good()) return refuse(LineStatus::parallel);
    result.covariance = root.inverse();
    result.chi2 = chi2;
    if (converged) break;
    const Vector<4> change = -root.solve(gradient);
    result.line = retract(result.line, Vector<4>(change));
    converged = root.whiten(gradient).squaredNorm() < 1e-12;  // in standard deviations, squared
  }
  if (!converged) return refuse(LineStatus::not_converged);
  range = detail::seen_along(views, result.line);
  if (!range) return refuse(LineStatus::behind);
  result.low = range->first;
  result.high = range->second;
  return result;
}

}}  // namespace cairn::CAIRN_ABI
