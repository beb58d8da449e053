// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A frame linearised at a placement: a thousand samples as one Gram matrix of nine columns.
///
/// The columns are the six of patch_model.hpp, (f_x, f_y, a f_x, a f_y, b f_x, b f_y), one for a bias, the
/// map's value h for a gain, and z - h. An unknown gain and bias, z = g h + d + noise with no prior, are
/// eliminated from it exactly; the slopes are then g times the map's, with g as fitted at the placement. The
/// filter (patch_filter.hpp), its continuous twin and the fix of a search all start from this matrix.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include <cairn/core/linalg.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/field/patch_noise.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Memory that updates reuse. One per thread.
struct PatchScratch {
  PatchSamples samples;
  Matrix<dynamic, 9> columns;
};

/// A frame linearised at a placement, gain and bias eliminated where asked for.
struct PatchGram {
  Matrix<6> information = Matrix<6>::Zero();  ///< of the placement's six numbers
  Vector<6> gradient = Vector<6>::Zero();     ///< W^T C^-1 (z - h)
  double squares = 0;                         ///< (z - h)^T C^-1 (z - h)
  double gain = 1;                            ///< fitted where free_gain, otherwise 1
  std::size_t samples = 0;

  /// J^T information J and J^T gradient, for numbers by which the placement has the derivative J.
  template <int N>
  [[nodiscard]] Matrix<N> information_by(const Matrix<6, N>& J) const {
    return transposed_product(J, product(information, J));
  }
  template <int N>
  [[nodiscard]] Vector<N> gradient_by(const Matrix<6, N>& J) const {
    return transposed_product(J, gradient);
  }
};

/// How a frame is linearised; holds no state.
struct PatchLinearisation {
  bool free_bias = false;       ///< eliminate an unknown bias of the sensor
  bool free_gain = false;       ///< eliminate an unknown gain (and the bias with it)
  double smallest_share = 0.5;  ///< of the samples that must lie inside the map

  /// The frame's Gram matrix at a placement, or why there is none: outside, flat, of another size than the
  /// shape, or of numbers so large that their squares overflow (not_finite). z may be empty when only the
  /// information is wanted (the gradient is then that of a perfect frame: zero). O(samples).
  template <FieldInterpolant Map>
  PatchVerdict gram(const Map& map, const PatchShape& shape, const PatchPlacement& at,
                    std::span<const double> z, const PatchNoise& noise, PatchScratch& scratch,
                    PatchGram& result) const {
    if (!z.empty() && z.size() != shape.size()) return PatchVerdict::size_mismatch;
    PatchSamples& f = scratch.samples;
    sample_patch(map, shape, at, f);
    result.samples = f.count_inside;
    const double needed = std::max(1.0, smallest_share * static_cast<double>(shape.size()));
    if (static_cast<double>(f.count_inside) < needed) return PatchVerdict::outside;
    double mean = 0;  // of h: subtracted from the gain's column, which leaves the span of both as it is
    for (const double value : f.value) mean += value;
    mean /= static_cast<double>(f.count_inside);
    if (free_gain && !has_contrast(f, mean)) return PatchVerdict::flat;
    fill_columns(shape, f, mean, z, scratch.columns);
    Matrix<9> all = noise.weigh<9>(scratch.columns, f.count_inside == shape.size());
    if (!all_finite(all)) return PatchVerdict::not_finite;
    if (!eliminate_sensor(all, result)) return PatchVerdict::flat;
    return all_finite(result.information) && all_finite(result.gradient) ? PatchVerdict::accepted
                                                                         : PatchVerdict::not_finite;
  }

private:
  static bool has_contrast(const PatchSamples& f, double mean) {
    double contrast = 0;
    for (std::size_t k = 0; k < f.value.size(); ++k) contrast += f.inside[k] * std::pow(f.value[k] - mean, 2);
    constexpr double rounding = 1e-11;  // of an interpolated value, relative: with room for its sums
    return contrast > std::pow(rounding * mean, 2) * static_cast<double>(f.count_inside);
  }

  static void fill_columns(const PatchShape& shape, const PatchSamples& f, double mean,
                           std::span<const double> z, Matrix<dynamic, 9>& columns) {
    const std::size_t stride = shape.size();
    columns.resize(static_cast<Eigen::Index>(stride), 9);
    std::size_t i = 0;
    for (int b = shape.half_width; b >= -shape.half_width; --b)
      for (int a = -shape.behind; a <= shape.ahead; ++a, ++i) {
        double* row = columns.data() + i;
        const double inside = f.inside[i];
        row[0] = f.dx[i];
        row[stride] = f.dy[i];
        row[2 * stride] = a * f.dx[i];
        row[3 * stride] = a * f.dy[i];
        row[4 * stride] = b * f.dx[i];
        row[5 * stride] = b * f.dy[i];
        row[6 * stride] = inside;
        row[7 * stride] = inside * (f.value[i] - mean);
        row[8 * stride] = z.empty() ? 0.0 : inside * (z[i] - f.value[i]);
      }
  }

  /// Eliminates row and column k. False when what is left of its diagonal is rounding.
  static bool eliminate(Matrix<9>& gram, int k, double original_diagonal) {
    if (!(gram(k, k) > 1e-12 * original_diagonal)) return false;
    double column[9];
    for (int i = 0; i < 9; ++i) column[i] = gram(i, k) / std::sqrt(gram(k, k));
    for (int j = 0; j < 9; ++j)
      for (int i = 0; i < 9; ++i) gram(i, j) -= column[i] * column[j];
    return true;
  }

  bool eliminate_sensor(Matrix<9>& all, PatchGram& result) const {
    const double value_diagonal = all(7, 7);
    result.gain = 1.0;
    if ((free_bias || free_gain) && !eliminate(all, 6, all(6, 6))) return false;
    if (free_gain) {
      const double excess = all(7, 8) / all(7, 7);
      if (!eliminate(all, 7, value_diagonal)) return false;
      result.gain = 1.0 + excess;
    }
    result.information = (result.gain * result.gain) * part_of<6, 6>(all, 0, 0);
    result.gradient = result.gain * part_of<6, 1>(all, 0, 8);
    result.squares = all(8, 8);
    return true;
  }
};

}}  // namespace cairn::CAIRN_ABI
