// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "ground_stereo.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/random.hpp>

namespace gamma_slam {

namespace {

using cairn::Matrix;
using cairn::SO3;
using cairn::Vector;

/// Grey level between pixels, the border's outside.
float between(cairn::ImageView image, const Vector<2>& at) {
  const double x = std::clamp(at(0), 0.0, image.width() - 1.0),
               y = std::clamp(at(1), 0.0, image.height() - 1.0);
  const int column = std::min(static_cast<int>(x), image.width() - 2),
            row = std::min(static_cast<int>(y), image.height() - 2);
  const double right = x - column, down = y - row;
  const double above = (1 - right) * image(column, row) + right * image(column + 1, row);
  const double below = (1 - right) * image(column, row + 1) + right * image(column + 1, row + 1);
  return static_cast<float>((1 - down) * above + down * below);
}

/// A plane as the unit vector up from it and the camera's height: up . p = -height.
struct Plane {
  Vector<3> up;
  double height = 0;
  [[nodiscard]] double above(const Vector<3>& p) const { return up.dot(p) + height; }
};

std::optional<Plane> through(const Vector<3>& a, const Vector<3>& b, const Vector<3>& c) {
  Vector<3> up = cairn::skew(b - a) * (c - a);
  if (!(up.norm() > 1e-3)) return std::nullopt;
  up.normalize();
  if (up(1) > 0) up = -up;  // the camera's y axis points down
  return Plane{up, -up.dot(a)};
}

constexpr double on_plane = 0.06;  // [m]

/// Least squares for the points near the plane, by y as a function of x and z.
Plane refined(const Plane& plane, const std::vector<Vector<3>>& points) {
  Matrix<3> normal = Matrix<3>::Zero();
  Vector<3> right = Vector<3>::Zero();
  for (const Vector<3>& p : points) {
    if (std::abs(plane.above(p)) > on_plane) continue;
    const Vector<3> row(p(0), p(2), 1);
    normal += row * row.transpose();
    right += p(1) * row;
  }
  const cairn::Cholesky<3> root(normal);
  if (!root.good()) return plane;
  const Vector<3> s = root.solve(right);  // y = s0 x + s1 z + s2
  const double length = std::sqrt(1 + s(0) * s(0) + s(1) * s(1));
  return {Vector<3>(s(0), -1, s(1)) / length, s(2) / length};
}

/// The plane below the camera that most points lie on. (M. Fischler, R. Bolles, Comm. ACM 24, 1981.)
std::optional<Plane> ground_of(const std::vector<Vector<3>>& points, std::uint64_t seed) {
  constexpr int tries = 300;
  constexpr std::size_t enough = 50;
  constexpr double steepest = 0.35;  // [rad] from the camera's own vertical
  if (points.size() < enough) return std::nullopt;
  cairn::Random random(seed, 29);
  const auto any = [&] {
    return points[std::min(points.size() - 1,
                           static_cast<std::size_t>(random.uniform() * static_cast<double>(points.size())))];
  };
  std::optional<Plane> best;
  std::size_t most = enough - 1;
  for (int i = 0; i < tries; ++i) {
    const Vector<3> a = any(), b = any(), c = any();
    const auto plane = through(a, b, c);
    if (!plane || -plane->up(1) < std::cos(steepest) || !(plane->height > 0.3)) continue;
    const auto near = static_cast<std::size_t>(std::ranges::count_if(
        points, [&](const Vector<3>& p) { return std::abs(plane->above(p)) < on_plane; }));
    if (near <= most) continue;
    most = near;
    best = plane;
  }
  if (best)
    for (int round = 0; round < 2; ++round) best = refined(*best, points);
  return best;
}

}  // namespace

GroundStereo::GroundStereo(const cairn::StereoRig& rig, const GroundStereoOptions& options)
    : options_(options),
      width_(rig.left.width() / 2),
      height_(rig.left.height() / 2),
      focal_(0.5 * rig.left.fx()),
      baseline_(rig.baseline()) {
  if (options.every < 1 || options.half_window < 1 || !(options.nearest > 0) ||
      !(options.reach > options.nearest) || !(options.disparity_sigma > 0))
    cairn::raise("GroundStereo: expected options within their ranges");
  const Vector<3> along = rig.T_left_right.translation() / baseline_;
  if (!(std::abs(along(0)) > 0.7))
    cairn::raise("GroundStereo: expected cameras side by side, found a baseline along their view");
  const Vector<3> x = along(0) > 0 ? along : Vector<3>(-along);
  const Vector<3> y = (cairn::skew(Vector<3>(0, 0, 1)) * x).normalized();
  R_rows_left_.row(0) = x.transpose();
  R_rows_left_.row(1) = y.transpose();
  R_rows_left_.row(2) = (cairn::skew(x) * y).transpose();
  if (along(0) < 0) cairn::raise("GroundStereo: expected the right camera on the right");
  left_ = lookups(rig.left, R_rows_left_);
  right_ = lookups(rig.right, R_rows_left_ * rig.T_left_right.rotation().matrix());
}

GroundStereo::Lookups GroundStereo::lookups(const cairn::PinholeCamera& camera,
                                            const Matrix<3>& R_rows) const {
  Lookups all;
  for (int v = 0; v < height_; ++v)
    for (int u = 0; u < width_; ++u) {
      const Vector<3> ray((u + 0.5 - 0.5 * width_) / focal_, (v + 0.5 - 0.5 * height_) / focal_, 1);
      all.push_back(camera.project(Vector<3>(R_rows.transpose() * ray)).value_or(Vector<2>(-1, -1)));
    }
  return all;
}

GroundStereo::SmallImage GroundStereo::resampled(cairn::ImageView image, const Lookups& from) const {
  SmallImage small{width_, height_, {}};
  small.grey.reserve(from.size());
  for (const Vector<2>& at : from) {
    float sum = 0;  // of the four pixels that one of half the size covers
    for (const double dx : {-0.5, 0.5})
      for (const double dy : {-0.5, 0.5}) sum += between(image, {at(0) + dx, at(1) + dy});
    small.grey.push_back(0.25F * sum);
  }
  return small;
}

/// The partner of a window of `from` in the same row of `to`, which lies on the left of it (towards -1) or on
/// the right (+1).
std::optional<double> GroundStereo::disparity_at(const SmallImage& from, const SmallImage& to, int towards,
                                                 int x, int y) const {
  const int half = options_.half_window;
  const auto n = static_cast<float>((2 * half + 1) * (2 * half + 1));
  std::vector<float> window;
  float mean = 0;
  for (int v = -half; v <= half; ++v)
    for (int u = -half; u <= half; ++u) {
      window.push_back(from(x + u, y + v));
      mean += window.back();
    }
  mean /= n;
  float squares = 0;
  for (float& w : window) {
    w -= mean;
    squares += w * w;
  }
  if (squares < n * static_cast<float>(options_.least_contrast * options_.least_contrast))
    return std::nullopt;
  const int least = static_cast<int>(focal_ * baseline_ / options_.reach) - 1;
  const int room = towards < 0 ? x - half : width_ - 1 - half - x;
  const int most = std::min(static_cast<int>(focal_ * baseline_ / options_.nearest) + 1, room);
  if (most - least < 3 || least < 1) return std::nullopt;
  std::vector<float> scores;
  for (int d = least; d <= most; ++d) {
    float sum = 0, sum_squares = 0, product = 0;
    std::size_t k = 0;
    for (int v = -half; v <= half; ++v)
      for (int u = -half; u <= half; ++u) {
        const float r = to(x + towards * d + u, y + v);
        sum += r;
        sum_squares += r * r;
        product += r * window[k++];
      }
    const float spread = sum_squares - sum * sum / n;
    scores.push_back(spread > 0 ? product / std::sqrt(spread * squares) : 0);
  }
  const auto best = std::ranges::max_element(scores) - scores.begin();
  const auto count = static_cast<std::ptrdiff_t>(scores.size());
  if (best == 0 || best + 1 == count) return std::nullopt;
  const auto at = [&](std::ptrdiff_t k) { return static_cast<double>(scores[static_cast<std::size_t>(k)]); };
  if (at(best) < options_.least_correlation) return std::nullopt;
  for (std::ptrdiff_t k = 0; k < count; ++k)
    if (std::abs(k - best) > 2 && at(k) > at(best) - options_.clearly) return std::nullopt;
  const double bend = at(best - 1) - 2 * at(best) + at(best + 1);
  const double shift = bend < 0 ? 0.5 * (at(best - 1) - at(best + 1)) / bend : 0;
  return least + static_cast<double>(best) + std::clamp(shift, -0.5, 0.5);
}

std::vector<GroundStereo::Seen> GroundStereo::matched(const SmallImage& left, const SmallImage& right) const {
  std::vector<Seen> seen;
  const int half = options_.half_window;
  for (int y = height_ / 3; y < height_ - half; y += options_.every)
    for (int x = half; x < width_ - half; x += options_.every) {
      const auto disparity = disparity_at(left, right, -1, x, y);
      if (!disparity) continue;
      const auto back = disparity_at(right, left, 1, x - static_cast<int>(std::lround(*disparity)), y);
      if (!back || std::abs(*back - *disparity) > 1) continue;
      const double z = focal_ * baseline_ / *disparity;
      const Vector<3> rows((x + 0.5 - 0.5 * width_) * z / focal_, (y + 0.5 - 0.5 * height_) * z / focal_, z);
      seen.push_back({R_rows_left_.transpose() * rows, *disparity});
    }
  return seen;
}

std::optional<GroundView> GroundStereo::operator()(cairn::ImageView left, cairn::ImageView right,
                                                   std::uint64_t seed) const {
  const std::vector<Seen> seen = matched(resampled(left, left_), resampled(right, right_));
  std::vector<Vector<3>> near;
  constexpr double straight = 4;  // [m] to either side: the lane, not what stands beside it
  for (const Seen& s : seen)
    if (std::abs(s.point(0)) < straight && s.point(1) > 0) near.push_back(s.point);
  const auto plane = ground_of(near, seed);
  if (!plane) return std::nullopt;
  GroundView view;
  const Vector<3> z = plane->up, ahead(0, 0, 1);
  const Vector<3> x = (ahead - z.dot(ahead) * z).normalized(), y = cairn::skew(z) * x;
  Matrix<3> R;
  R.row(0) = x.transpose();
  R.row(1) = y.transpose();
  R.row(2) = z.transpose();
  view.R_level_camera = SO3::from_matrix(R);
  view.camera_height = plane->height;
  std::map<std::pair<int, int>, int> taken;
  for (const Seen& s : seen) {
    const Vector<3> p = R * s.point;
    const double height = p(2) + plane->height, range = std::hypot(p(0), p(1));
    const double along_ray = s.point.norm() / s.disparity * options_.disparity_sigma;
    const double grazing = std::abs(p(2)) / s.point.norm();
    if (range > options_.reach || height > options_.tallest || along_ray * grazing > options_.height_sigma)
      continue;
    const auto square = [](double at) { return static_cast<int>(std::floor(at / 0.2)); };
    if (taken[{square(p(0)), square(p(1))}]++ < options_.most_in_square)
      view.points.push_back({p(0), p(1), height});
  }
  return view;
}

}  // namespace gamma_slam
