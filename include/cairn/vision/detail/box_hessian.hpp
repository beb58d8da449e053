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
/// A row of responses costs 32 reads of the integral image a sample, whatever the scale. To keep them
/// contiguous where only every step-th column is sampled, ColumnPhases sorts the columns by their remainder.
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
#define CAIRN_VECTORISE_FOR_AVX2 [[CAIRN_TARGET(AVX2)]]
#else
#define CAIRN_VECTORISE_FOR_AVX2 [[CAIRN_TARGET(AVX2), gnu::optimize("O3")]]
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
  /// Keeps a pointer to `sums` when step is 1, a copy otherwise.
  void assign(const IntegralImage& sums, int step) {
    step_ = step;
    if (step == 1) {
      data_ = sums.row(0);
      row_stride_ = sums.row(1) - sums.row(0);
      return;
    }
    const int columns = sums.width() + 1;
    phase_stride_ = (columns + step - 1) / step + IntegralImage::readable_overrun;
    row_stride_ = phase_stride_ * step;
    copy_.resize(room_for(static_cast<std::size_t>(row_stride_), static_cast<std::size_t>(sums.height()) + 1,
                          "image"));
    data_ = copy_.data();
    for (int y = 0; y <= sums.height(); ++y) {
      const std::uint32_t* const from = sums.row(y);
      for (int phase = 0; phase < step; ++phase) {
        std::uint32_t* to = copy_.data() + y * row_stride_ + phase * phase_stride_;
        for (int x = phase; x < columns; x += step) *to++ = from[x];
      }
    }
  }

  [[nodiscard]] const std::uint32_t* at(int column, int row) const noexcept {
    const std::uint32_t* const line = data_ + row * row_stride_;
    return step_ == 1 ? line + column : line + column % step_ * phase_stride_ + column / step_;
  }

private:
  int step_ = 1;
  std::ptrdiff_t phase_stride_ = 0;
  std::ptrdiff_t row_stride_ = 0;
  const std::uint32_t* data_ = nullptr;
  std::vector<std::uint32_t> copy_;
};

/// Corners of two boxes: top left, top right, bottom left, bottom right of one, then of the other.
using BoxPair = std::array<const std::uint32_t*, 8>;

/// The boxes of one row of responses, at its first sample: Dxx, Dyy and the two halves of Dxy.
struct HessianTaps {
  BoxPair xx, yy, above, below;

  /// Taps for samples centred on (x, y), (x + step, y), ...
  HessianTaps(const ColumnPhases& sums, BoxFilter filter, int x, int y) noexcept {
    const int l = filter.lobe;
    const int b = filter.border();
    const int h = (l - 1) / 2;
    const auto pair = [&](int left, int right, int top, int bottom, int left2, int right2, int top2,
                          int bottom2) {
      return BoxPair{sums.at(x + left, y + top),      sums.at(x + right, y + top),
                     sums.at(x + left, y + bottom),   sums.at(x + right, y + bottom),
                     sums.at(x + left2, y + top2),    sums.at(x + right2, y + top2),
                     sums.at(x + left2, y + bottom2), sums.at(x + right2, y + bottom2)};
    };
    xx = pair(-b, b + 1, -l + 1, l, -h, h + 1, -l + 1, l);
    yy = pair(-l + 1, l, -b, b + 1, -l + 1, l, -h, h + 1);
    above = pair(1, l + 1, -l, 0, -l, 0, -l, 0);
    below = pair(1, l + 1, 1, l + 1, -l, 0, 1, l + 1);
  }
};

/// First box - Weight * second box at the samples k, ..., k + 3.
template <int Weight>
[[nodiscard, gnu::always_inline]] inline Unsigned4 box_difference(const BoxPair& taps, int k) noexcept {
  const auto corner = [&](std::size_t i) { return load<Unsigned4>(taps[i] + k); };
  const Unsigned4 first = (corner(3) - corner(2)) - (corner(1) - corner(0));
  const Unsigned4 second = (corner(7) - corner(6)) - (corner(5) - corner(4));
  return Weight == 3 ? first - (second + second + second) : first - second;
}

/// Four lanes, on every processor. Pass by pass, so that each loop's eight pointers fit the registers.
inline void hessian_row_narrow(const HessianTaps& taps, float weight, int count, float* out,
                               std::uint32_t* scratch) noexcept {
  const int room = (count + 3) / 4 * 4;
  for (int k = 0; k < count; k += 4) store(box_difference<3>(taps.xx, k), scratch + k);
  for (int k = 0; k < count; k += 4) store(box_difference<3>(taps.yy, k), scratch + room + k);
  for (int k = 0; k < count; k += 4) store(box_difference<1>(taps.above, k), scratch + 2 * room + k);
  for (int k = 0; k < count; k += 4) {
    const Unsigned4 below = box_difference<1>(taps.below, k);
    const Float4 dxx = to_float(load<Unsigned4>(scratch + k)) * weight;
    const Float4 dyy = to_float(load<Unsigned4>(scratch + room + k)) * weight;
    const Float4 dxy = to_float(load<Unsigned4>(scratch + 2 * room + k) - below) * (0.9F * weight);
    store(dxx * dyy - dxy * dxy, out + k);
  }
}

#if defined(__x86_64__)
/// The same bits (no fused multiply-add), eight at a time by AVX2, left to the compiler's vectoriser.
CAIRN_VECTORISE_FOR_AVX2 inline void hessian_row_wide(const HessianTaps& taps, float weight, int count,
                                                      float* out) noexcept {
  const BoxPair xx = taps.xx, yy = taps.yy, above = taps.above, below = taps.below;
  const float cross_weight = 0.9F * weight;
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    const std::uint32_t xx_whole = (xx[3][k] - xx[2][k]) - (xx[1][k] - xx[0][k]);
    const std::uint32_t xx_middle = (xx[7][k] - xx[6][k]) - (xx[5][k] - xx[4][k]);
    const std::uint32_t yy_whole = (yy[3][k] - yy[2][k]) - (yy[1][k] - yy[0][k]);
    const std::uint32_t yy_middle = (yy[7][k] - yy[6][k]) - (yy[5][k] - yy[4][k]);
    const std::uint32_t right_above = (above[3][k] - above[2][k]) - (above[1][k] - above[0][k]);
    const std::uint32_t left_above = (above[7][k] - above[6][k]) - (above[5][k] - above[4][k]);
    const std::uint32_t right_below = (below[3][k] - below[2][k]) - (below[1][k] - below[0][k]);
    const std::uint32_t left_below = (below[7][k] - below[6][k]) - (below[5][k] - below[4][k]);
    const float dxx = static_cast<float>(static_cast<std::int32_t>(xx_whole - 3 * xx_middle)) * weight;
    const float dyy = static_cast<float>(static_cast<std::int32_t>(yy_whole - 3 * yy_middle)) * weight;
    const float dxy = static_cast<float>(static_cast<std::int32_t>((right_above - left_above) -
                                                                   (right_below - left_below))) *
                      cross_weight;
    out[k] = dxx * dyy - dxy * dxy;
  }
}
#endif

/// `count` responses into `out`, which has room for three more; `scratch` has room for 3 (count + 3). Reads
/// up to three entries behind the last tap.
inline void hessian_row(const HessianTaps& taps, float weight, int count, float* out,
                        std::uint32_t* scratch) noexcept {
#if defined(__x86_64__)
  if (processor() >= Processor::avx2) return hessian_row_wide(taps, weight, count, out);
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
