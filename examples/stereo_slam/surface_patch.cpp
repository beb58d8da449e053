// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "surface_patch.hpp"

#include <algorithm>
#include <cmath>

#include "grey_level.hpp"

namespace stereo_slam {
namespace {

constexpr int half = SurfacePatch::half;
constexpr int across = 2 * half + 1;
constexpr int pixels = across * across;
using Grey = Eigen::Array<float, pixels, 1>;

double determinant(const cairn::Matrix<2>& m) {
  return m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0);
}

cairn::Matrix<2> inverse(const cairn::Matrix<2>& m) {
  cairn::Matrix<2> result;
  result << m(1, 1), -m(0, 1), -m(1, 0), m(0, 0);
  return result / determinant(m);
}

float centre(Grey& grey) {
  grey -= grey.mean();
  return std::sqrt(grey.square().sum());
}

/// The patch as it was, and what its grey levels do when it moves.
struct Reference {
  Grey grey, slope_x, slope_y;
  float norm = 0;
  cairn::Matrix<2, 2, float> inverse;  // of the normal equations
};

std::optional<Reference> reference_of(const SurfacePatch& patch) {
  Reference result;
  const cairn::ImageView kept(patch.grey.data(), SurfacePatch::side, SurfacePatch::side);
  // What is kept begins half + 1 before the whole part of the centre.
  const float x = static_cast<float>(patch.pixel(0) - std::floor(patch.pixel(0))) + half + 1;
  const float y = static_cast<float>(patch.pixel(1) - std::floor(patch.pixel(1))) + half + 1;
  constexpr int wide = across + 2;
  std::array<float, static_cast<std::size_t>(wide * wide)> grey{};
  for (int v = 0, i = 0; v < wide; ++v)
    for (int u = 0; u < wide; ++u, ++i)
      grey[static_cast<std::size_t>(i)] =
          grey_level(kept, x + static_cast<float>(u - half - 1), y + static_cast<float>(v - half - 1));
  for (int v = 0, i = 0; v < across; ++v)
    for (int u = 0; u < across; ++u, ++i) {
      const float* at = grey.data() + (v + 1) * wide + u + 1;
      result.grey(i) = *at;
      result.slope_x(i) = 0.5F * (at[1] - at[-1]);
      result.slope_y(i) = 0.5F * (at[wide] - at[-wide]);
    }
  result.norm = centre(result.grey);
  centre(result.slope_x);
  centre(result.slope_y);
  const float xx = result.slope_x.square().sum(), yy = result.slope_y.square().sum(),
              xy = (result.slope_x * result.slope_y).sum();
  const float determinant = xx * yy - xy * xy;
  // The weaker of the two directions: below 2 grey levels a pixel noise decides.
  const float weaker = 0.5F * (xx + yy) - std::sqrt(0.25F * (xx - yy) * (xx - yy) + xy * xy);
  if (!(weaker >= 4.0F * pixels) || !(determinant > 0)) return std::nullopt;
  result.inverse << yy, -xy, -xy, xx;
  result.inverse /= determinant;
  return result;
}

/// Where an image shows offset o of the patch: (1), and what the camera makes of it, whose distortion is
/// taken as it is in the middle. Of the three coordinates the third divides the others.
struct Warp {
  cairn::Vector<3> middle, right, down;
  [[nodiscard]] cairn::Vector<3> undivided(double x, double y) const { return middle + x * right + y * down; }
  [[nodiscard]] cairn::Vector<2> operator()(const cairn::Vector<2>& o) const {
    const cairn::Vector<3> p = undivided(o(0), o(1));
    return p.head<2>() / p(2);
  }
};

std::optional<Warp> warp_of(const SurfacePatch& patch, const cairn::PinholeCamera& camera,
                            const cairn::SE3& T_now_then, double inverse_depth) {
  const auto ray = camera.normalise_with_jacobian(patch.pixel);
  if (!ray) return std::nullopt;
  const cairn::Matrix<2> J = inverse(ray->J_pixel);
  const cairn::Vector<3> t = inverse_depth * T_now_then.translation();
  const cairn::Matrix<3> R = T_now_then.rotation().matrix();
  const auto turned = [&](const cairn::Vector<2>& n, double one) {
    return cairn::Vector<3>(R * cairn::Vector<3>(n(0), n(1), one));
  };
  const cairn::Vector<3> middle = turned(ray->normalised, 1) + t;
  constexpr double nearest = 0.1;  // of the depth then: much nearer it is a blur, and no camera is in it
  if (!(middle(2) > nearest)) return std::nullopt;
  const cairn::Vector<2> at = middle.head<2>() / middle(2);
  cairn::Matrix<3> to_pixels;
  to_pixels << camera.distortion_jacobian(at), camera.distort(at) - camera.distortion_jacobian(at) * at, 0, 0,
      1;
  return Warp{to_pixels * middle, to_pixels * (turned(J.col(0), 0) + patch.slope(0) * t),
              to_pixels * (turned(J.col(1), 0) + patch.slope(1) * t)};
}

/// The pixels that the patch has around offset o, as the image shows them.
bool look(const Warp& warp, const cairn::Vector<2>& o, cairn::ImageView image, Grey& grey) {
  // What is in front of the camera is shown between what its corners are.
  const double right = image.width() - 2, bottom = image.height() - 2;
  for (const int v : {-half, half})
    for (const int u : {-half, half}) {
      const cairn::Vector<3> p = warp.undivided(o(0) + u, o(1) + v);
      if (!(p(2) > 0 && p(0) >= 0 && p(1) >= 0 && p(0) < right * p(2) && p(1) < bottom * p(2))) return false;
    }
  for (int v = -half, i = 0; v <= half; ++v) {
    const cairn::Vector<3> row = warp.undivided(o(0) - half, o(1) + v);
    std::array<float, static_cast<std::size_t>(across)> x{}, y{};
    for (std::size_t u = 0; u < x.size(); ++u) {
      const auto steps = static_cast<double>(static_cast<int>(u));
      const double scale = 1 / (row(2) + steps * warp.right(2));
      x[u] = static_cast<float>((row(0) + steps * warp.right(0)) * scale);
      y[u] = static_cast<float>((row(1) + steps * warp.right(1)) * scale);
    }
    for (std::size_t u = 0; u < x.size(); ++u, ++i) grey(i) = grey_level(image, x[u], y[u]);
  }
  return true;
}

}  // namespace

std::optional<SurfacePatch> SurfacePatch::of(cairn::ImageView image, const cairn::Vector<2>& pixel,
                                             const cairn::Vector<2>& slope, std::size_t keyframe) {
  constexpr int before = half + 1;  // of the pixels kept, so many precede the one that the place is in
  const double left = std::floor(pixel(0)) - before, top = std::floor(pixel(1)) - before;
  if (!(left >= 0 && top >= 0 && left + side <= image.width() && top + side <= image.height()))
    return std::nullopt;
  SurfacePatch patch{pixel, slope, keyframe, {}};
  for (int y = 0; y < side; ++y)
    std::copy_n(image.row(static_cast<int>(top) + y) + static_cast<int>(left), side,
                patch.grey.data() + y * side);
  return patch;
}

std::optional<FoundPatch> find_patch(const SurfacePatch& patch, const cairn::PinholeCamera& camera,
                                     const cairn::SE3& T_now_then, double inverse_depth,
                                     cairn::ImageView image, const cairn::Vector<2>& expected) {
  constexpr int most_steps = 10;
  constexpr double farthest = 2, settled = 0.005;  // [pixels of the patch]
  const auto warp = warp_of(patch, camera, T_now_then, inverse_depth);
  if (!warp) return std::nullopt;  // before what expects a place that is one
  const auto reference = reference_of(patch);
  if (!reference) return std::nullopt;
  const cairn::Vector<2> x(0.5, 0), y(0, 0.5);
  cairn::Matrix<2> J;  // d pixel / d offset
  J << (*warp)(x) - (*warp)(-x), (*warp)(y) - (*warp)(-y);
  // A piece seen from behind has a negative area; of one seen on its edge, or from four times as far, too few
  // pixels are left to compare.
  constexpr double least_area = 1.0 / 16;
  if (!(determinant(J) > least_area)) return std::nullopt;
  cairn::Vector<2> d = inverse(J) * (expected - (*warp)({0, 0}));
  Grey grey;
  for (int step = 0; step < most_steps; ++step) {
    // On its way it may go farther than it may end.
    if (!(d.norm() <= farthest + 1) || !look(*warp, d, image, grey)) return std::nullopt;
    const float norm = centre(grey);
    if (!(norm > 0)) return std::nullopt;
    const Grey difference = grey * (reference->norm / norm) - reference->grey;
    const cairn::Vector<2, float> gradient((reference->slope_x * difference).sum(),
                                           (reference->slope_y * difference).sum());
    const cairn::Vector<2> change = (reference->inverse * gradient).cast<double>();
    d -= change;
    if (change.norm() > settled) continue;
    if (d.norm() > farthest) return std::nullopt;
    const float squares = difference.square().sum();
    FoundPatch found;
    found.pixel = (*warp)(d);
    found.correlation = 1 - 0.5 * squares / (reference->norm * reference->norm);
    const cairn::Matrix<2> covariance = J * reference->inverse.cast<double>() * J.transpose();
    // Four numbers were fitted: where it is, gain and offset.
    found.sigma = std::sqrt(squares / (pixels - 4) * 0.5 * covariance.trace());
    return found;
  }
  return std::nullopt;
}

}  // namespace stereo_slam
