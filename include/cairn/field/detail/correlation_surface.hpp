// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Normalised cross-correlation of a patch with a map at every shift of a window: the surface that
/// correlation.hpp looks for peaks in.
///
///   c(p) = sum (f_p - mean f_p)(z - mean z) / (n s_f s_z)
/// summed over the samples inside the map, with n s_z^2 the energy of the whole patch: samples that the map
/// does not know count as unexplained, so that a place with fewer of them is not favoured. The sums over f
/// alone are differences of running sums, those with z are sliding products by FFT (J. P. Lewis, "Fast
/// normalized cross-correlation", 1995); where the map has voids or ends, the mean of z depends on the shift
/// as well (D. Padfield, "Masked object registration in the Fourier domain", IEEE T-IP 21(5), 2012).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <span>

#include <cairn/core/linalg.hpp>
#include <cairn/field/detail/fft.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Running sums over rectangles: sum of of(value) over columns [c, c + w), rows [r, r + h).
class BoxSums {
public:
  template <class Of>
  BoxSums(const Plane& plane, const Of& of) : sums_(plane.columns + 1, plane.rows + 1) {
    for (int r = 0; r < plane.rows; ++r) {
      double row = 0;
      for (int c = 0; c < plane.columns; ++c) {
        row += of(plane(c, r));
        sums_(c + 1, r + 1) = sums_(c + 1, r) + row;
      }
    }
  }
  [[nodiscard]] double operator()(int c, int r, int w, int h) const noexcept {
    return sums_(c + w, r + h) - sums_(c, r + h) - sums_(c + w, r) + sums_(c, r);
  }

private:
  Plane sums_;
};

/// The map on the sensor's lattice: values less their mean, zeros outside, and the mask of what is known.
struct MapWindow {
  Plane value, known;
  bool complete = true;
};

template <FieldInterpolant Map>
MapWindow map_window(const Map& map, const PatchShape& shape, const PatchPlacement& at, int reach_along,
                     int reach_across) {
  MapWindow window{Plane(shape.along() + 2 * reach_along, shape.across() + 2 * reach_across),
                   Plane(shape.along() + 2 * reach_along, shape.across() + 2 * reach_across)};
  double sum = 0, count = 0;
  double *value = window.value.values.data(), *known = window.known.values.data();
  for (int r = 0; r < window.value.rows; ++r)
    for (int c = 0; c < window.value.columns; ++c, ++value, ++known) {
      const int a = c - reach_along - shape.behind, b = shape.half_width + reach_across - r;
      const auto f = map.at(at.x + a * at.along_x + b * at.across_x, at.y + a * at.along_y + b * at.across_y);
      *known = f ? 1.0 : 0.0;
      *value = f ? f->value : 0.0;
      sum += *value;
      count += *known;
    }
  window.complete = count == static_cast<double>(window.value.values.size());
  const double mean = count > 0.0 ? sum / count : 0.0;
  for (std::size_t i = 0; i < window.value.values.size(); ++i)
    window.value.values[i] = (window.value.values[i] - mean) * window.known.values[i];
  return window;
}

/// (1) at every shift; `nothing` where too few samples are known or the map is flat.
inline constexpr double nothing = -2.0;

inline Plane correlation_surface(const MapWindow& window, const Plane& patch, double smallest_share) {
  const int w = patch.columns, h = patch.rows;
  const double whole = static_cast<double>(patch.values.size());
  double patch_energy = 0;
  for (const double v : patch.values) patch_energy += v * v;
  const Plane cross = sliding_products(window.value, patch);
  const BoxSums values(window.value, std::identity{});
  const BoxSums energy(window.value, [](double v) { return v * v; });
  const Plane nowhere;
  const BoxSums known(window.complete ? nowhere : window.known, std::identity{});
  const Plane patch_sum = window.complete ? nowhere : sliding_products(window.known, patch);
  const double flat = 1e-12 * energy(0, 0, window.value.columns, window.value.rows) /
                      static_cast<double>(window.value.values.size());
  Plane surface(cross.columns, cross.rows, nothing);
  for (int r = 0; r < surface.rows; ++r)
    for (int c = 0; c < surface.columns; ++c) {
      const double n = window.complete ? whole : std::round(known(c, r, w, h));
      if (n < std::max(2.0, smallest_share * whole)) continue;
      const double sz = window.complete ? 0.0 : patch_sum(c, r);
      const double sf = values(c, r, w, h);
      const double energy_f = energy(c, r, w, h) - sf * sf / n;
      if (!(energy_f > flat * n)) continue;
      surface(c, r) = std::clamp((cross(c, r) - sf * sz / n) / std::sqrt(energy_f * patch_energy), -1.0, 1.0);
    }
  return surface;
}

/// The patch less its mean, or an empty plane when it has no variance.
inline Plane centred_patch(const PatchShape& shape, std::span<const double> z) {
  Plane patch(shape.along(), shape.across());
  double mean = 0, squares = 0, deviations = 0;
  for (const double v : z) mean += v / static_cast<double>(z.size());
  for (std::size_t i = 0; i < z.size(); ++i) {
    patch.values[i] = z[i] - mean;
    squares += z[i] * z[i];
    deviations += patch.values[i] * patch.values[i];
  }
  return deviations > 1e-20 * squares ? patch : Plane();
}

/// Vertex of the paraboloid through the 3 x 3 values around (c, r), by least squares; zero where it has no
/// maximum within a sample. A place to start from: three values do not know the shape of a peak, and the
/// vertex errs by a twentieth of a sample however good the data are.
inline Vector<2> paraboloid_vertex(const Plane& s, int c, int r) {
  double sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0, sum = 0;
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i) {
      const double f = s(c + i, r + j);
      if (f == nothing) return {0.0, 0.0};
      sx += i * f;
      sy += j * f;
      sxx += i * i * f;
      syy += j * j * f;
      sxy += i * j * f;
      sum += f;
    }
  const double cross = 0.25 * sxy, xx = sxx - 2.0 / 3.0 * sum, yy = syy - 2.0 / 3.0 * sum;
  const double determinant = xx * yy - cross * cross;
  if (!(xx < 0.0 && determinant > 0.0)) return {0.0, 0.0};
  const double x = -(yy * sx - cross * sy) / (6.0 * determinant);
  const double y = -(xx * sy - cross * sx) / (6.0 * determinant);
  return std::max(std::abs(x), std::abs(y)) <= 1.0 ? Vector<2>(x, y) : Vector<2>(0.0, 0.0);
}

}}}  // namespace cairn::CAIRN_ABI::detail
