// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Grey images of 8 bits a pixel: Image owns its pixels, ImageView looks at somebody else's.
///
/// Pixels lie row by row from the top; (x, y) is column and row, and the centre of a pixel has integer
/// coordinates. Functions that only read take an ImageView by value; an Image converts to one by itself, and
/// so does the buffer of any other library:
/// ```cpp
/// const cairn::ImageView view(mat.data, mat.cols, mat.rows, mat.step);
/// ```
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/sizes.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// The longest side of an image: far beyond cameras, and small enough that sums of sides are ints.
inline constexpr int longest_image_side = 1 << 20;

inline void check_image_size(int width, int height) {
  if (width < 0 || height < 0 || width > longest_image_side || height > longest_image_side)
    raise("image: expected sides between 0 and " + std::to_string(longest_image_side) + " pixels, found " +
          std::to_string(width) + " x " + std::to_string(height));
}

}  // namespace detail

/// Pixels that belong to somebody else, who must keep them alive and still. As cheap to copy as a pointer.
class ImageView {
public:
  constexpr ImageView() noexcept = default;

  /// `data` is the top left pixel, `stride` the distance of two rows in bytes. Throws Error when a side is
  /// negative or too long, a row is longer than the stride, or pixels are promised at a null pointer.
  ImageView(const std::uint8_t* data, int width, int height, std::ptrdiff_t stride)
      : data_(data), stride_(stride), width_(width), height_(height) {
    detail::check_image_size(width, height);
    if (stride < width)
      raise("image: expected a stride of at least the width " + std::to_string(width) + ", found " +
            std::to_string(stride));
    if (data == nullptr && !empty()) raise("image: expected pixels, found a null pointer");
  }

  /// Rows without gaps between them.
  ImageView(const std::uint8_t* data, int width, int height) : ImageView(data, width, height, width) {}

  [[nodiscard]] constexpr int width() const noexcept { return width_; }
  [[nodiscard]] constexpr int height() const noexcept { return height_; }
  [[nodiscard]] constexpr std::ptrdiff_t stride() const noexcept { return stride_; }
  [[nodiscard]] constexpr bool empty() const noexcept { return width_ == 0 || height_ == 0; }

  /// First pixel of row y, 0 <= y < height().
  [[nodiscard]] constexpr const std::uint8_t* row(int y) const noexcept { return data_ + y * stride_; }
  [[nodiscard]] constexpr std::uint8_t operator()(int x, int y) const noexcept { return row(y)[x]; }

private:
  const std::uint8_t* data_ = nullptr;
  std::ptrdiff_t stride_ = 0;
  int width_ = 0;
  int height_ = 0;
};

/// A grey image that owns its pixels: a regular value, rows without gaps. A moved-from image is empty.
class Image {
public:
  Image() noexcept = default;

  /// width x height pixels of value `fill`. Throws Error when a side is negative or longer than 2^20.
  Image(int width, int height, std::uint8_t fill = 0)
      : width_(checked(width, height)), height_(height), pixels_(area(width, height), fill) {}

  /// A copy of the pixels seen.
  explicit Image(ImageView view) : Image(view.width(), view.height()) {
    for (int y = 0; y < height_; ++y) std::copy_n(view.row(y), width_, row(y));
  }

  Image(const Image&) = default;
  Image& operator=(const Image&) = default;
  ~Image() = default;
  Image(Image&& other) noexcept { swap(other); }
  Image& operator=(Image&& other) noexcept {
    Image taken(std::move(other));
    swap(taken);
    return *this;
  }

  [[nodiscard]] int width() const noexcept { return width_; }
  [[nodiscard]] int height() const noexcept { return height_; }
  [[nodiscard]] bool empty() const noexcept { return pixels_.empty(); }

  /// First pixel of row y, 0 <= y < height().
  [[nodiscard]] std::uint8_t* row(int y) noexcept { return pixels_.data() + offset(y); }
  [[nodiscard]] const std::uint8_t* row(int y) const noexcept { return pixels_.data() + offset(y); }
  [[nodiscard]] std::uint8_t& operator()(int x, int y) noexcept { return row(y)[x]; }
  [[nodiscard]] std::uint8_t operator()(int x, int y) const noexcept { return row(y)[x]; }

  /// Valid until the image is destroyed, assigned or moved from.
  operator ImageView() const { return {pixels_.data(), width_, height_}; }  // NOLINT(google-explicit-*)

  friend bool operator==(const Image&, const Image&) = default;

  void swap(Image& other) noexcept {
    std::swap(width_, other.width_);
    std::swap(height_, other.height_);
    pixels_.swap(other.pixels_);
  }

private:
  static int checked(int width, int height) {
    detail::check_image_size(width, height);
    return width;
  }
  static std::size_t area(int width, int height) {
    return detail::room_for(static_cast<std::size_t>(width), static_cast<std::size_t>(height), "image");
  }
  [[nodiscard]] std::ptrdiff_t offset(int y) const noexcept {
    return static_cast<std::ptrdiff_t>(y) * width_;
  }

  int width_ = 0;
  int height_ = 0;
  std::vector<std::uint8_t> pixels_;
};

}}  // namespace cairn::CAIRN_ABI
