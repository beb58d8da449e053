// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Summed-area table: the sum of any upright box of pixels in four reads.
///
///   S(x, y) = sum of I(i, j) over i < x, j < y          0 <= x <= width, 0 <= y <= height
///   box [x0, x1) x [y0, y1) = S(x1, y1) - S(x0, y1) - S(x1, y0) + S(x0, y0)
///
/// Crow, "Summed-area tables for texture mapping", SIGGRAPH 1984. Entries are 32-bit and wrap around;
/// differences are taken modulo 2^32, so a box sum is exact whenever it is below 2^32 itself (16.8 million
/// white pixels), however large the image is. Read between its entries by linear interpolation, S is the
/// exact integral of the image whose pixels are unit squares: pixel (x, y) covers [x, x + 1) x [y, y + 1) in
/// coordinates of S, so its centre, (x, y) of a keypoint, is at (x + 1/2, y + 1/2).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/sizes.hpp>
#include <cairn/version.hpp>
#include <cairn/vision/image.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The table of one image; assign() reuses its memory for the next one. Const functions are safe
/// concurrently.
class IntegralImage {
public:
  /// Entries behind the last one of every row that may be read (their values mean nothing).
  static constexpr int readable_overrun = 16;

  IntegralImage() = default;
  explicit IntegralImage(ImageView image) { assign(image); }

  /// Replaces the table. O(pixels); allocates only when the image is larger than all before.
  void assign(ImageView image) {
    width_ = image.width();
    height_ = image.height();
    stride_ = static_cast<std::ptrdiff_t>(width_) + 1 + readable_overrun;
    sums_.resize(
        detail::room_for(static_cast<std::size_t>(stride_), static_cast<std::size_t>(height_) + 1, "image"));
    std::fill_n(sums_.data(), stride_, 0U);
    for (int y = 0; y < height_; ++y) add_row(image.row(y), row_at(y), row_at(y + 1));
  }

  /// Size of the image, one less than that of the table.
  [[nodiscard]] int width() const noexcept { return width_; }
  [[nodiscard]] int height() const noexcept { return height_; }

  /// S(0, y), S(1, y), ..., S(width(), y) for 0 <= y <= height().
  [[nodiscard]] const std::uint32_t* row(int y) const noexcept { return sums_.data() + y * stride_; }

  /// Sum over columns [x0, x1) and rows [y0, y1), which must lie in the image; modulo 2^32.
  [[nodiscard]] std::uint32_t box(int x0, int y0, int x1, int y1) const noexcept {
    CAIRN_ASSERT(0 <= x0 && x0 <= x1 && x1 <= width_ && 0 <= y0 && y0 <= y1 && y1 <= height_,
                 "a box must lie in the image");
    const std::uint32_t* const top = row(y0);
    const std::uint32_t* const bottom = row(y1);
    return bottom[x1] - bottom[x0] - top[x1] + top[x0];
  }

private:
  [[nodiscard]] std::uint32_t* row_at(int y) noexcept { return sums_.data() + y * stride_; }

  void add_row(const std::uint8_t* pixels, const std::uint32_t* above, std::uint32_t* sums) const noexcept {
    std::uint32_t sum = 0;
    sums[0] = 0;
    for (int x = 0; x < width_; ++x) {
      sum += pixels[x];
      sums[x + 1] = above[x + 1] + sum;
    }
    std::fill_n(sums + width_ + 1, readable_overrun, 0U);
  }

  int width_ = 0;
  int height_ = 0;
  std::ptrdiff_t stride_ = 0;
  std::vector<std::uint32_t> sums_;
};

}}  // namespace cairn::CAIRN_ABI
