// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "image_io.hpp"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include <png.h>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>

namespace example {
namespace {

// libpng's control block, released on every way out.
struct Png {
  png_image image{};
  Png() { image.version = PNG_IMAGE_VERSION; }
  Png(const Png&) = delete;
  Png& operator=(const Png&) = delete;
  ~Png() { png_image_free(&image); }
};

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
  cairn::raise(path.string() + ": " + why + "; expected a whole PNG or PGM image");
}

cairn::Image decode_png(const std::filesystem::path& path, std::string_view bytes) {
  Png png;
  if (png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size()) == 0)
    refuse(path, std::string("damaged PNG (") + png.image.message + ")");
  constexpr std::uint64_t most_pixels = 1U << 28U;
  if (std::uint64_t{png.image.width} * png.image.height > most_pixels)
    refuse(path, "PNG of " + std::to_string(png.image.width) + " x " + std::to_string(png.image.height) +
                     " pixels is too large");
  png.image.format = PNG_FORMAT_GRAY;
  png.image.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;  // sixteen bits are grey levels like eight, not linear light
  cairn::Image image(static_cast<int>(png.image.width), static_cast<int>(png.image.height));
  const png_color black{0, 0, 0};
  // With PNG_IMAGE_WARNING libpng has read something, but not what the file once was.
  if (png_image_finish_read(&png.image, &black, image.row(0), image.width(), nullptr) == 0 ||
      (png.image.warning_or_error & PNG_IMAGE_ERROR) != 0)
    refuse(path, std::string("damaged PNG (") + png.image.message + ")");
  return image;
}

}  // namespace

cairn::Image read_image(const std::filesystem::path& path) {
  const std::string bytes = cairn::read_file(path, "a PNG or PGM image");
  constexpr std::string_view png_signature("\x89PNG\r\n\x1a\n", 8);
  if (bytes.empty()) refuse(path, "empty file");
  if (bytes.starts_with(png_signature)) return decode_png(path, bytes);
  if (bytes.starts_with("P5") || bytes.starts_with("P2")) return cairn::read_pgm(path);
  refuse(path, "neither PNG nor PGM");
}

std::string png_bytes(cairn::ImageView image) {
  Png png;
  png.image.width = static_cast<png_uint_32>(image.width());
  png.image.height = static_cast<png_uint_32>(image.height());
  png.image.format = PNG_FORMAT_GRAY;
  png.image.flags = PNG_IMAGE_FLAG_FAST;
  const auto stride = static_cast<png_int_32>(image.stride());
  png_alloc_size_t size = image.empty() ? 0 : PNG_IMAGE_PNG_SIZE_MAX(png.image);
  std::string bytes(size, '\0');
  if (image.empty() ||
      png_image_write_to_memory(&png.image, bytes.data(), &size, 0, image.row(0), stride, nullptr) == 0)
    cairn::raise("cannot make a PNG of " + std::to_string(image.width()) + " x " +
                 std::to_string(image.height()) + " pixels (" +
                 (image.empty() ? "it has none" : png.image.message) + ")");
  bytes.resize(size);
  return bytes;
}

void write_png(const std::filesystem::path& path, cairn::ImageView image) {
  try {
    cairn::write_file_atomically(path, png_bytes(image));
  } catch (const cairn::Error& error) {
    const std::string why = error.what();
    cairn::raise(why.starts_with(path.string()) ? why : path.string() + ": " + why);
  }
}

}  // namespace example
