// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Hessian of an image at many scales from box sums (the response of SURF's "fast Hessian").
///
/// A filter of side L = 3 l, l odd, stands for second derivatives of a Gaussian of sigma = 1.2 L / 9. Over
/// its centre pixel and b = (L - 1) / 2, h = (l - 1) / 2 (ends inclusive):
///   Dxx = box(columns -b..b, rows -(l-1)..l-1) - 3 box(columns -h..h, the same rows);  Dyy transposed
///   Dxy = the four l x l boxes in the quadrants, axes left out, signed like -x y (downwards y)
///   response = (Dxx Dyy - (0.9 Dxy)^2) / L^4,   laplacian = sign(Dxx + Dyy)
/// Bay, Ess, Tuytelaars and Van Gool, "Speeded-up robust features", CVIU 110(3), 2008, section 3.
///
/// A row of responses costs 20 reads a sample, whatever the scale. To keep them contiguous where only every
/// step-th column is sampled, ColumnPhases sorts the columns by their remainder.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/sizes.hpp>
#include <cairn/simd/processor.hpp>
#include <cairn/version.hpp>
#include <cairn/vision/detail/lanes.hpp>
#include <cairn/vision/integral_image.hpp>

// GCC vectorises at -O3 only; clang always does.
#if defined(__clang__)
#define CAIRN_VECTORISED inline
#define CAIRN_VECTORISED_FOR_AVX2 [[CAIRN_TARGET(AVX2)]] inline
#else
#define CAIRN_VECTORISED [[gnu::optimize("O3")]] inline
#define CAIRN_VECTORISED_FOR_AVX2 [[CAIRN_TARGET(AVX2), gnu::optimize("O3")]] inline
#endif

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// One filter size.
struct BoxFilter {
  int lobe = 3;  ///< l, odd

  [[nodiscard]] int side() const noexcept { return 3 * lobe; }
  [[nodiscard]] int border() const noexcept { return (3 * lobe - 1) / 2; }
  [[nodiscard]] float weight() const noexcept { return 1.0F / static_cast<float>(side() * side()); }
};

/// An integral image whose columns stand by remainder modulo `step`: at(column, row)[k] is
/// S(column + k step, row).
class ColumnPhases {
public:
  void assign(const IntegralImage& sums, int step) {
    prepare(sums, step);
    for (int y = 0; y <= sums.height(); ++y) fill_row(sums, y);
  }

  /// Makes room for all rows. Keeps a pointer to `sums` when step is 1, and there is nothing to fill.
  void prepare(const IntegralImage& sums, int step) {
    step_ = step;
    columns_ = sums.width() + 1;
    if (step == 1) {
      data_ = sums.row(0);
      row_stride_ = sums.row(1) - sums.row(0);
      return;
    }
    phase_stride_ = (columns_ + step - 1) / step + IntegralImage::readable_overrun;
    row_stride_ = phase_stride_ * step;
    copy_.resize(room_for(static_cast<std::size_t>(row_stride_), static_cast<std::size_t>(sums.height()) + 1,
                          "image"));
    data_ = copy_.data();
  }

  void fill_row(const IntegralImage& sums, int y) noexcept {
    if (step_ == 1) return;
    for (int phase = 0; phase < step_; ++phase) {
      std::uint32_t* to = phase_of(phase, y);
      for (int x = phase; x < columns_; x += step_) *to++ = sums.row(y)[x];
    }
  }

  /// The same from the row at half this step, whose phases fall apart into two each.
  void fill_row(const ColumnPhases& finer, int y) noexcept {
    for (int phase = 0; phase < finer.step_; ++phase)
      split(finer.at(phase, y), phase_of(phase, y), phase_of(phase + finer.step_, y),
            phase_stride_ - IntegralImage::readable_overrun);
  }

  /// Numbers of a row, of all phases.
  [[nodiscard]] std::ptrdiff_t line() const noexcept { return step_ == 1 ? columns_ : row_stride_; }

  [[nodiscard]] const std::uint32_t* at(int column, int row) const noexcept {
    const std::uint32_t* const line = data_ + row * row_stride_;
    return step_ == 1 ? line + column : line + column % step_ * phase_stride_ + column / step_;
  }

private:
  [[nodiscard]] std::uint32_t* phase_of(int phase, int y) noexcept {
    return copy_.data() + y * row_stride_ + phase * phase_stride_;
  }

  static void split(const std::uint32_t* from, std::uint32_t* __restrict even, std::uint32_t* __restrict odd,
                    std::ptrdiff_t count) noexcept {
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      even[k] = from[2 * k];
      odd[k] = from[2 * k + 1];
    }
  }

  int step_ = 1;
  int columns_ = 0;
  std::ptrdiff_t phase_stride_ = 0;
  std::ptrdiff_t row_stride_ = 0;
  const std::uint32_t* data_ = nullptr;
  std::vector<std::uint32_t> copy_;
};

/// The boxes of one row of responses: rows of the integral image that they lie between, and the places in
/// these at which they begin and end for the first sample.
struct HessianTaps {
  std::array<const std::uint32_t*, 2> xx_rows;           ///< top, bottom
  std::array<const std::uint32_t*, 4> yy_rows, xy_rows;  ///< of the outer and the inner box; of two boxes
  std::array<std::ptrdiff_t, 4> xx_places, xy_places;
  std::array<std::ptrdiff_t, 2> yy_places;
  std::ptrdiff_t line;  ///< numbers in a row

  /// Taps for samples centred on (x, y), (x + step, y), ...
  HessianTaps(const ColumnPhases& sums, BoxFilter filter, int x, int y) noexcept : line(sums.line()) {
    const int l = filter.lobe;
    const int b = filter.border();
    const int h = (l - 1) / 2;
    const auto row = [&](int down) { return sums.at(0, y + down); };
    const auto place = [&](int right) { return sums.at(x + right, 0) - sums.at(0, 0); };
    xx_rows = {row(-l + 1), row(l)};
    xx_places = {place(-b), place(-h), place(h + 1), place(b + 1)};
    yy_rows = {row(-b), row(-h), row(h + 1), row(b + 1)};
    yy_places = {place(-l + 1), place(l)};
    xy_rows = {row(-l), row(0), row(1), row(l + 1)};
    xy_places = {place(-l), place(0), place(1), place(l + 1)};
  }
};

/// What the rows of the boxes differ by, at every column: of Dxx, Dyy and Dxy.
[[gnu::always_inline]] inline void subtract_rows(const HessianTaps& taps, std::uint32_t* __restrict xx,
                                                 std::uint32_t* __restrict yy,
                                                 std::uint32_t* __restrict xy) noexcept {
  const std::uint32_t *const x0 = taps.xx_rows[0], *const x1 = taps.xx_rows[1];
  const std::uint32_t *const y0 = taps.yy_rows[0], *const y1 = taps.yy_rows[1], *const y2 = taps.yy_rows[2],
                             *const y3 = taps.yy_rows[3];
  const std::uint32_t *const c0 = taps.xy_rows[0], *const c1 = taps.xy_rows[1], *const c2 = taps.xy_rows[2],
                             *const c3 = taps.xy_rows[3];
  for (std::ptrdiff_t k = 0, end = taps.line; k < end; ++k) {
    xx[k] = x1[k] - x0[k];
    yy[k] = (y3[k] - y0[k]) - 3 * (y2[k] - y1[k]);
    xy[k] = (c1[k] - c0[k]) - (c3[k] - c2[k]);
  }
}

/// The boxes of a derivative share rows, so these are subtracted once, for all columns, and then columns of
/// what is left: 10 reads and 10 more, where each corner by itself would be 32. Sums modulo 2^32 are the same
/// in any order.
[[gnu::always_inline]] inline void respond(const HessianTaps& taps, float weight, int count,
                                           float* __restrict out, std::uint32_t* scratch) noexcept {
  std::uint32_t *const xx = scratch, *const yy = xx + taps.line, *const xy = yy + taps.line;
  subtract_rows(taps, xx, yy, xy);
  const std::uint32_t *const x0 = xx + taps.xx_places[0], *const x1 = xx + taps.xx_places[1],
                             *const x2 = xx + taps.xx_places[2], *const x3 = xx + taps.xx_places[3];
  const std::uint32_t *const y0 = yy + taps.yy_places[0], *const y1 = yy + taps.yy_places[1];
  const std::uint32_t *const c0 = xy + taps.xy_places[0], *const c1 = xy + taps.xy_places[1],
                             *const c2 = xy + taps.xy_places[2], *const c3 = xy + taps.xy_places[3];
  const float cross_weight = 0.9F * weight;
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    const std::uint32_t in_xx = (x3[k] - x0[k]) - 3 * (x2[k] - x1[k]);
    const std::uint32_t in_yy = y1[k] - y0[k];
    const std::uint32_t in_xy = (c3[k] - c2[k]) - (c1[k] - c0[k]);
    const float dxx = static_cast<float>(static_cast<std::int32_t>(in_xx)) * weight;
    const float dyy = static_cast<float>(static_cast<std::int32_t>(in_yy)) * weight;
    const float dxy = static_cast<float>(static_cast<std::int32_t>(in_xy)) * cross_weight;
    out[k] = dxx * dyy - dxy * dxy;
  }
}

/// For every processor.
CAIRN_VECTORISED void hessian_row_narrow(const HessianTaps& taps, float weight, int count, float* out,
                                         std::uint32_t* scratch) noexcept {
  respond(taps, weight, count, out, scratch);
}
#if defined(__x86_64__)
/// The same bits (no fused multiply-add), eight at a time.
CAIRN_VECTORISED_FOR_AVX2 void hessian_row_wide(const HessianTaps& taps, float weight, int count, float* out,
                                                std::uint32_t* scratch) noexcept {
  respond(taps, weight, count, out, scratch);
}
#endif

/// `count` responses into `out`; `scratch` has room for three lines of the phases.
inline void hessian_row(const HessianTaps& taps, float weight, int count, float* out,
                        std::uint32_t* scratch) noexcept {
#if defined(__x86_64__)
  if (processor() >= Processor::avx2) return hessian_row_wide(taps, weight, count, out, scratch);
#endif
  hessian_row_narrow(taps, weight, count, out, scratch);
}

/// Dxx + Dyy at one pixel, in grey levels. The filter must fit: border() <= x < width - border(), y alike.
[[nodiscard]] inline float hessian_trace(const IntegralImage& sums, BoxFilter filter, int x, int y) noexcept {
  const int l = filter.lobe;
  const int b = filter.border();
  const int h = (l - 1) / 2;
  const auto box = [&](int left, int right, int top, int bottom) {
    return sums.box(x + left, y + top, x + right, y + bottom);
  };
  const std::uint32_t xx = box(-b, b + 1, -l + 1, l) - 3 * box(-h, h + 1, -l + 1, l);
  const std::uint32_t yy = box(-l + 1, l, -b, b + 1) - 3 * box(-l + 1, l, -h, h + 1);
  return static_cast<float>(static_cast<std::int32_t>(xx + yy)) * filter.weight();
}

}}}  // namespace cairn::CAIRN_ABI::detail
