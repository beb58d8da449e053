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

/// (1): where the other camera sees offset o, up to the third coordinate.
struct Sight {
  cairn::Vector<3> middle, right, down;
  [[nodiscard]] cairn::Vector<3> operator()(double x, double y) const {
    return middle + x * right + y * down;
  }
};

std::optional<Sight> sight_of(const SurfacePatch& patch, const cairn::PinholeCamera& camera,
                              const cairn::SE3& T_now_then, double inverse_depth) {
  const auto ray = camera.normalise_with_jacobian(patch.pixel);
  if (!ray) return std::nullopt;
  const cairn::Matrix<2> J = inverse(ray->J_pixel);
  const cairn::Vector<3> t = inverse_depth * T_now_then.translation();
  const cairn::Matrix<3> R = T_now_then.rotation().matrix();
  const auto moved = [&](const cairn::Vector<2>& n, double one) {
    return cairn::Vector<3>(R * cairn::Vector<3>(n(0), n(1), one));
  };
  return Sight{moved(ray->normalised, 1) + t, moved(J.col(0), 0) + patch.slope(0) * t,
               moved(J.col(1), 0) + patch.slope(1) * t};
}

/// Pixels of the image for offsets: the camera's distortion is taken as it is in the middle.
class Warp {
public:
  Warp(const Sight& sight, const cairn::PinholeCamera& camera, const cairn::Vector<2>& normalised)
      : sight_(sight),
        at_(normalised),
        pixel_(camera.distort(normalised)),
        J_(camera.distortion_jacobian(normalised)) {}
  [[nodiscard]] cairn::Vector<2> operator()(double x, double y) const {
    const cairn::Vector<3> q = sight_(x, y);
    return pixel_ + J_ * (q.head<2>() / q(2) - at_);
  }

private:
  Sight sight_;
  cairn::Vector<2> at_, pixel_;
  cairn::Matrix<2> J_;
};

/// The patch as the image has it when its offsets are shifted by d.
bool look(const Warp& warp, const cairn::Vector<2>& d, cairn::ImageView image, Grey& grey) {
  const double right = image.width() - 2, bottom = image.height() - 2;
  for (int v = -half, i = 0; v <= half; ++v)
    for (int u = -half; u <= half; ++u, ++i) {
      const cairn::Vector<2> p = warp(u + d(0), v + d(1));
      if (!(p(0) >= 0 && p(1) >= 0 && p(0) < right && p(1) < bottom)) return false;
      grey(i) = grey_level(image, static_cast<float>(p(0)), static_cast<float>(p(1)));
    }
  return true;
}

}  // namespace

std::optional<SurfacePatch> SurfacePatch::of(cairn::ImageView image, const cairn::Vector<2>& pixel,
                                             const cairn::Vector<2>& slope, std::size_t keyframe) {
  SurfacePatch patch{pixel, slope, keyframe, {}};
  const int left = static_cast<int>(std::floor(pixel(0))) - half - 1;
  const int top = static_cast<int>(std::floor(pixel(1))) - half - 1;
  if (left < 0 || top < 0 || left + side > image.width() || top + side > image.height()) return std::nullopt;
  for (int y = 0; y < side; ++y) std::copy_n(image.row(top + y) + left, side, patch.grey.data() + y * side);
  return patch;
}

std::optional<FoundPatch> find_patch(const SurfacePatch& patch, const cairn::PinholeCamera& camera,
                                     const cairn::SE3& T_now_then, double inverse_depth,
                                     cairn::ImageView image, const cairn::Vector<2>& expected) {
  constexpr int most_steps = 10;
  constexpr double farthest = 2, settled = 0.005;
  const auto reference = reference_of(patch);
  const auto sight = sight_of(patch, camera, T_now_then, inverse_depth);
  if (!reference || !sight || !(sight->middle(2) > 0.1)) return std::nullopt;
  const cairn::Vector<2> normalised = sight->middle.head<2>() / sight->middle(2);
  const Warp warp(*sight, camera, normalised);
  cairn::Matrix<2> J;  // d pixel / d offset
  J << warp(0.5, 0) - warp(-0.5, 0), warp(0, 0.5) - warp(0, -0.5);
  if (!(determinant(J) > 0)) return std::nullopt;  // seen from behind
  cairn::Vector<2> d = inverse(J) * (expected - warp(0, 0));
  Grey grey;
  for (int step = 0; step < most_steps; ++step) {
    if (!(d.norm() <= farthest + 1) || !look(warp, d, image, grey)) return std::nullopt;
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
    found.pixel = warp(d(0), d(1));
    found.correlation = 1 - 0.5 * squares / (reference->norm * reference->norm);
    const cairn::Matrix<2> covariance = J * reference->inverse.cast<double>() * J.transpose();
    found.sigma = std::sqrt(squares / (pixels - 4) * 0.5 * covariance.trace());
    return found;
  }
  return std::nullopt;
}

}  // namespace stereo_slam
