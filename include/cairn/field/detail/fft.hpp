// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Sliding sums of products by the fast Fourier transform: what a correlation search spends its time on.
///
/// The transform is the one that comes with Eigen (unsupported/Eigen/FFT), the library's only dependency: a
/// search costs milliseconds and happens at the start and after a loss, so a faster transform would buy
/// nothing that is worth a second dependency. This header alone includes it.
#pragma once

#include <algorithm>
#include <complex>
#include <cstddef>
#include <vector>

#include <unsupported/Eigen/FFT>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// A rectangle of numbers, row by row.
struct Plane {
  int columns = 0, rows = 0;
  std::vector<double> values;

  Plane() = default;
  Plane(int width, int height, double value = 0.0)
      : columns(width),
        rows(height),
        values(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), value) {}
  [[nodiscard]] double& operator()(int column, int row) noexcept { return values[index(column, row)]; }
  [[nodiscard]] double operator()(int column, int row) const noexcept { return values[index(column, row)]; }

private:
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
};

/// The smallest product of 2, 3 and 5 that is at least n and 2 (Eigen has no transform of one number).
inline int fast_length(int n) noexcept {
  for (n = std::max(n, 2);; ++n) {
    int rest = n;
    for (const int factor : {2, 3, 5})
      while (rest % factor == 0) rest /= factor;
    if (rest == 1) return n;
  }
}

using Complex = std::complex<double>;

/// Transforms a plane of complex numbers in place: rows first, then columns.
inline void transform(std::vector<Complex>& plane, int columns, int rows, bool back) {
  Eigen::FFT<double> fft;
  const auto one = [&](std::vector<Complex>& to, const std::vector<Complex>& from) {
    back ? fft.inv(to, from) : fft.fwd(to, from);
  };
  std::vector<Complex> line, result;
  const auto width = static_cast<std::size_t>(columns), height = static_cast<std::size_t>(rows);
  line.resize(width);
  for (std::size_t r = 0; r < height; ++r) {
    std::copy_n(plane.begin() + static_cast<std::ptrdiff_t>(r * width), width, line.begin());
    one(result, line);
    std::copy_n(result.begin(), width, plane.begin() + static_cast<std::ptrdiff_t>(r * width));
  }
  line.resize(height);
  for (std::size_t c = 0; c < width; ++c) {
    for (std::size_t r = 0; r < height; ++r) line[r] = plane[r * width + c];
    one(result, line);
    for (std::size_t r = 0; r < height; ++r) plane[r * width + c] = result[r];
  }
}

/// result(s, t) = sum over (c, r) of big(s + c, t + r) small(c, r), for every shift at which the small plane
/// lies inside the big one: (big.columns - small.columns + 1) x (big.rows - small.rows + 1) sums. One
/// transform serves both planes, as real and imaginary part. O(n log n).
[[nodiscard]] inline Plane sliding_products(const Plane& big, const Plane& small) {
  CAIRN_EXPECTS(
      small.columns >= 1 && small.rows >= 1 && small.columns <= big.columns && small.rows <= big.rows,
      "sliding_products needs a small plane that fits into the big one");
  const int columns = fast_length(big.columns), rows = fast_length(big.rows);
  const auto width = static_cast<std::size_t>(columns), height = static_cast<std::size_t>(rows);
  std::vector<Complex> z(width * height);
  for (int r = 0; r < big.rows; ++r)
    for (int c = 0; c < big.columns; ++c)
      z[static_cast<std::size_t>(r) * width + static_cast<std::size_t>(c)].real(big(c, r));
  for (int r = 0; r < small.rows; ++r)
    for (int c = 0; c < small.columns; ++c)
      z[static_cast<std::size_t>(r) * width + static_cast<std::size_t>(c)].imag(small(c, r));
  transform(z, columns, rows, false);
  // With Z = B + i S of real planes: B = (Z(k) + conj Z(-k)) / 2, S = (Z(k) - conj Z(-k)) / 2i.
  std::vector<Complex> product(z.size());
  for (std::size_t r = 0; r < height; ++r)
    for (std::size_t c = 0; c < width; ++c) {
      const Complex ahead = z[r * width + c];
      const Complex mirror = std::conj(z[(height - r) % height * width + (width - c) % width]);
      const Complex difference = ahead - mirror;
      product[r * width + c] =
          0.25 * (ahead + mirror) * std::conj(Complex(difference.imag(), -difference.real()));
    }
  transform(product, columns, rows, true);
  Plane result(big.columns - small.columns + 1, big.rows - small.rows + 1);
  for (int r = 0; r < result.rows; ++r)
    for (int c = 0; c < result.columns; ++c)
      result(c, r) = product[static_cast<std::size_t>(r) * width + static_cast<std::size_t>(c)].real();
  return result;
}

}}}  // namespace cairn::CAIRN_ABI::detail
