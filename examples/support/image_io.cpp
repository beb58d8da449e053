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
#ifdef EXAMPLES_HAVE_JPEG
#include <turbojpeg.h>
#endif

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>

namespace example {
namespace {

constexpr std::uint64_t most_pixels = 1U << 28U;

// libpng's control block, released on every way out.
struct Png {
  png_image image{};
  Png() { image.version = PNG_IMAGE_VERSION; }
  Png(const Png&) = delete;
  Png& operator=(const Png&) = delete;
  ~Png() { png_image_free(&image); }
};

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
  cairn::raise(path.string() + ": " + why + "; expected a whole PNG, JPEG or PGM image");
}

cairn::Image decode_png(const std::filesystem::path& path, std::string_view bytes) {
  Png png;
  if (png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size()) == 0)
    refuse(path, std::string("damaged PNG (") + png.image.message + ")");
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

#ifdef EXAMPLES_HAVE_JPEG

// libjpeg-turbo's decoder, released on every way out.
struct Jpeg {
  tjhandle handle = tjInitDecompress();
  Jpeg() = default;
  Jpeg(const Jpeg&) = delete;
  Jpeg& operator=(const Jpeg&) = delete;
  ~Jpeg() {
    if (handle != nullptr) tjDestroy(handle);
  }
};

cairn::Image decode_jpeg(const std::filesystem::path& path, std::string_view bytes) {
  const Jpeg jpeg;
  if (jpeg.handle == nullptr) refuse(path, "no JPEG decoder");
  const auto* const data = reinterpret_cast<const unsigned char*>(bytes.data());
  const auto size = static_cast<unsigned long>(bytes.size());
  const auto damaged = [&] {
    refuse(path, std::string("damaged JPEG (") + tjGetErrorStr2(jpeg.handle) + ")");
  };
  int width = 0, height = 0, subsampling = 0, colours = 0;
  if (tjDecompressHeader3(jpeg.handle, data, size, &width, &height, &subsampling, &colours) != 0) damaged();
  if (std::uint64_t{static_cast<unsigned>(width)} * static_cast<unsigned>(height) > most_pixels)
    refuse(path,
           "JPEG of " + std::to_string(width) + " x " + std::to_string(height) + " pixels is too large");
  if (colours == TJCS_CMYK || colours == TJCS_YCCK) refuse(path, "JPEG in the colours of a printer");
  cairn::Image image(width, height);
  // A warning (a torn file, say) is a failure here: what is missing would be grey.
  if (tjDecompress2(jpeg.handle, data, size, image.row(0), width, width, height, TJPF_GRAY,
                    TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING) != 0)
    damaged();
  return image;
}

#endif

}  // namespace

cairn::Image read_image(const std::filesystem::path& path) {
  const std::string bytes = cairn::read_file(path, "a PNG, JPEG or PGM image");
  constexpr std::string_view png_signature("\x89PNG\r\n\x1a\n", 8);
  if (bytes.empty()) refuse(path, "empty file");
  if (bytes.starts_with(png_signature)) return decode_png(path, bytes);
  if (bytes.starts_with("\xFF\xD8\xFF")) {
#ifdef EXAMPLES_HAVE_JPEG
    return decode_jpeg(path, bytes);
#else
    refuse(path, "JPEG, and this program was built without libjpeg-turbo (Debian: libturbojpeg0-dev)");
#endif
  }
  if (bytes.starts_with("P5") || bytes.starts_with("P2")) return cairn::read_pgm(path);
  refuse(path, "neither PNG nor JPEG nor PGM");
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
  bytes.shrink_to_fit();  // the room was for the worst image: of a floor plan it is ten times the file
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
