// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// One frame of a sensor that sees a patch of the field: where its samples lie, and what a map says there.
///
/// A frame has N = behind + 1 + ahead samples along track and 2 half_width + 1 across, numbered row by row
/// from the upper left (0-based here): sample i of row r = i / N has the offsets from the sensor's axis
///   a = i mod N - behind  (along),     b = half_width - r  (across)                       (1)
/// and lies on the ground at
///   p = (x, y) + a * along + b * across                                                   (2)
/// with along = L_x (cos psi, sin psi), across = L_y (-sin psi, cos psi) for scales L_x, L_y and heading psi.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <cairn/core/explain.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The layout of a frame's samples.
struct PatchShape {
  int behind = 15;
  int ahead = 16;
  int half_width = 16;

  [[nodiscard]] int along() const noexcept { return behind + 1 + ahead; }
  [[nodiscard]] int across() const noexcept { return 2 * half_width + 1; }
  [[nodiscard]] std::size_t size() const noexcept {
    return static_cast<std::size_t>(along()) * static_cast<std::size_t>(across());
  }
  [[nodiscard]] int a(std::size_t sample) const noexcept {  // (1)
    return static_cast<int>(sample % static_cast<std::size_t>(along())) - behind;
  }
  [[nodiscard]] int b(std::size_t sample) const noexcept {
    return half_width - static_cast<int>(sample / static_cast<std::size_t>(along()));
  }
};

/// Where a frame lies on the ground, by (2).
struct PatchPlacement {
  double x = 0, y = 0;              ///< ground point of the sensor's axis
  double along_x = 1, along_y = 0;  ///< ground step of one sample along track
  double across_x = 0, across_y = 1;

  /// From scales and heading [rad].
  [[nodiscard]] static PatchPlacement of(double x, double y, double scale_along, double scale_across,
                                         double heading) noexcept {
    const double c = std::cos(heading), s = std::sin(heading);
    return {x, y, scale_along * c, scale_along * s, -scale_across * s, scale_across * c};
  }
};

/// What a map says at each sample of a frame. A sample outside the map, or in a void, has inside = 0 and
/// zeros.
struct PatchSamples {
  std::vector<double> value, dx, dy;
  std::vector<std::uint8_t> inside;
  std::size_t count_inside = 0;

  void resize(std::size_t size) {
    value.resize(size);
    dx.resize(size);
    dy.resize(size);
    inside.resize(size);
  }
};

/// Asks the map at every sample of the frame. Reuses the memory of `samples`.
template <FieldInterpolant Map>
void sample_patch(const Map& map, const PatchShape& shape, const PatchPlacement& at, PatchSamples& samples) {
  samples.resize(shape.size());
  samples.count_inside = 0;
  std::size_t i = 0;
  for (int b = shape.half_width; b >= -shape.half_width; --b)
    for (int a = -shape.behind; a <= shape.ahead; ++a, ++i) {
      const std::optional<FieldSample> f = map.at(at.x + a * at.along_x + b * at.across_x,
                                                  at.y + a * at.along_y + b * at.across_y);  // (2)
      samples.inside[i] = f ? 1 : 0;
      samples.value[i] = f ? f->value : 0.0;
      samples.dx[i] = f ? f->dx : 0.0;
      samples.dy[i] = f ? f->dy : 0.0;
      samples.count_inside += f ? 1 : 0;
    }
}

/// What became of a frame. Only `accepted` changes the belief.
enum class [[nodiscard]] PatchVerdict {
  accepted,
  flat,                   ///< the map has no slope under the frame, or no contrast to tell gain from bias
  outside,                ///< too few samples lie inside the map
  gated,                  ///< the residuals that are left are larger than the noise allows
  not_finite,             ///< NaN or infinity in the frame or the belief
  not_positive_definite,  ///< the belief's covariance
  size_mismatch,  ///< the frame has not one number a sample, or the motion's run-time sizes do not fit
};

/// The verdict as a sentence for a log.
[[nodiscard]] constexpr const char* explain(PatchVerdict verdict) noexcept {
  switch (verdict) {
    case PatchVerdict::accepted:
      return "accepted";
    case PatchVerdict::flat:
      return "refused: the map under the frame has no slope, or no contrast to tell gain from bias";
    case PatchVerdict::outside:
      return "refused: too few samples lie inside the map";
    case PatchVerdict::gated:
      return "refused: the residuals that are left are larger than the noise allows";
    case PatchVerdict::not_finite:
      return "refused: NaN or infinity in the frame or the belief";
    case PatchVerdict::not_positive_definite:
      return "refused: the covariance of the belief is not positive definite";
    case PatchVerdict::size_mismatch:
      return "refused: sizes of the frame, the shape and the motion differ";
  }
  return "unknown verdict";
}

}}  // namespace cairn::CAIRN_ABI
