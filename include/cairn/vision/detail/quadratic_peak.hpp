// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The peak between samples of place and scale, by Newton's step on a quadratic from central differences.
///
/// The quadratic is fitted to the root of the response, which, like the second derivatives themselves, is
/// linear in contrast: its top is rounder than that of their product (measured: docs/vision.md). In the plane
/// the quadratic has its cross term; along the scale a parabola of its own. The cross terms of place and
/// scale, which Brown and Lowe (BMVC 2002) include, are left out: the filters grow by steps too coarse for
/// them, and with them the centre of a Gaussian blob comes out up to 0.17 pixels off, without them 0.02.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// The 27 responses around a sample: [layer][row][column].
using Neighbourhood = std::array<std::array<std::array<float, 3>, 3>, 3>;

/// Offset of the peak from the middle sample, in samples, and the response there, at the middle scale.
struct Peak {
  double x, y, layer, height;
};

/// Nothing where the curvature is not that of a maximum. Negative responses count as none.
inline std::optional<Peak> fit_peak(const Neighbourhood& n) noexcept {
  const auto root = [](float response) { return double{std::sqrt(std::max(response, 0.0F))}; };
  double plane[3][3];
  for (std::size_t j = 0; j < 3; ++j)
    for (std::size_t i = 0; i < 3; ++i) plane[j][i] = root(n[1][j][i]);
  const double centre = plane[1][1], finer = root(n[0][1][1]), coarser = root(n[2][1][1]);
  const double gx = 0.5 * (plane[1][2] - plane[1][0]);
  const double gy = 0.5 * (plane[2][1] - plane[0][1]);
  const double gs = 0.5 * (coarser - finer);
  const double xx = (plane[1][2] + plane[1][0]) - 2 * centre;
  const double yy = (plane[2][1] + plane[0][1]) - 2 * centre;
  const double ss = (coarser + finer) - 2 * centre;
  const double xy = 0.25 * ((plane[2][2] + plane[0][0]) - (plane[2][0] + plane[0][2]));
  const double determinant = xx * yy - xy * xy;
  if (!(xx < 0 && determinant > 0 && ss < 0)) return std::nullopt;
  Peak peak;
  peak.x = (xy * gy - yy * gx) / determinant;
  peak.y = (xy * gx - xx * gy) / determinant;
  peak.layer = -gs / ss;
  const double top = centre + 0.5 * (gx * peak.x + gy * peak.y);
  peak.height = top * top;
  return peak;
}

}}}  // namespace cairn::CAIRN_ABI::detail
