// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/image_io.hpp"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <png.h>
#ifdef EXAMPLES_HAVE_JPEG
#include <turbojpeg.h>
#endif

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace image_io_test {
namespace {

cairn::Image random_image(int width, int height, cairn::Random& random) {
  cairn::Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image(x, y) = static_cast<std::uint8_t>(random.below(256));
  return image;
}

// A PNG of another format than the program writes.
template <class Sample>
void write_foreign_png(const std::filesystem::path& path, unsigned width, unsigned height, unsigned format,
                       const std::vector<Sample>& samples) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = width;
  image.height = height;
  image.format = format;
  REQUIRE(png_image_write_to_file(&image, path.c_str(), 0, samples.data(), 0, nullptr) != 0);
}

// The message with which a file is refused; empty where it is read.
std::string refusal(const std::filesystem::path& path) {
  try {
    static_cast<void>(example::read_image(path));
  } catch (const cairn::Error& error) {
    return error.what();
  }
  return {};
}

bool names(const std::string& message, const std::string& words) {
  return message.find(words) != std::string::npos;
}

}  // namespace

TEST_SUITE("image_io") {
  TEST_CASE("image_io: what is written as PNG or PGM reads back pixel for pixel") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn_test::Folder folder;
    for (const int width : {1, 2, 33, 640}) {
      const cairn::Image image = random_image(width, 480 / width + 1, random);
      example::write_png(folder / "image.png", image);
      CHECK(example::read_image(folder / "image.png") == image);
      cairn::write_pgm(folder / "image.pgm", image);
      CHECK(example::read_image(folder / "image.pgm") == image);
    }
  }

  TEST_CASE("image_io: the bytes of a PNG take no more room than they are") {
    const std::string plain = example::png_bytes(cairn::Image(800, 600, 205));
    CHECK(plain.size() < 10000);
    CHECK(plain.capacity() < 2 * plain.size());
  }

  TEST_CASE("image_io: colour becomes luminance and grey stays grey") {
    const cairn_test::Folder folder;
    const std::vector<std::uint8_t> rgb{255, 0, 0, 0, 255, 0, 0, 0, 255, 90, 90, 90};
    write_foreign_png(folder / "rgb.png", 4, 1, PNG_FORMAT_RGB, rgb);
    const cairn::Image image = example::read_image(folder / "rgb.png");
    REQUIRE(image.width() == 4);
    CHECK(image(1, 0) > image(0, 0));  // green is bright, blue is dark
    CHECK(image(0, 0) > image(2, 0));
    CHECK(image(2, 0) > 0);
    CHECK(int(image(3, 0)) == 90);
  }

  TEST_CASE("image_io: sixteen bits become the eight above") {
    const cairn_test::Folder folder;
    // Written raw: the simplified writer takes 16-bit samples for linear light.
    std::vector<std::uint8_t> samples;
    for (int grey = 0; grey < 256; ++grey)
      samples.insert(samples.end(), {std::uint8_t(grey), std::uint8_t(grey)});
    std::FILE* file = std::fopen((folder / "deep.png").c_str(), "wb");
    REQUIRE(file != nullptr);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_init_io(png, file);
    png_set_IHDR(png, info, 256, 1, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    png_write_row(png, samples.data());
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    std::fclose(file);
    const cairn::Image image = example::read_image(folder / "deep.png");
    REQUIRE(image.width() == 256);
    for (int grey = 0; grey < 256; ++grey) CHECK(int(image(grey, 0)) == grey);
  }

  TEST_CASE("image_io: a file that is missing, a folder, empty or no image is refused by name") {
    const cairn_test::Folder folder;
    CHECK(names(refusal(folder / "none.png"), "none.png: no such file; expected a PNG, JPEG or PGM image"));
    CHECK(names(refusal(folder.path()), "is a folder"));
    cairn::write_file_atomically(folder / "empty.png", "");
    CHECK(names(refusal(folder / "empty.png"), "empty.png: empty file"));
    cairn::write_file_atomically(folder / "text.png", "this is a text\n");
    CHECK(names(refusal(folder / "text.png"),
                "text.png: neither PNG nor JPEG nor PGM; expected a whole PNG, JPEG or PGM"));
    cairn::write_file_atomically(folder / "photo.gif", "GIF89a");
    CHECK(names(refusal(folder / "photo.gif"), "neither PNG nor JPEG nor PGM"));
    cairn::write_file_atomically(folder / "photo.jpg", std::string("\xff\xd8\xff\xe0 JFIF"));
    CHECK(names(refusal(folder / "photo.jpg"), "photo.jpg: "));
    CHECK(names(refusal(folder / "photo.jpg"), "JPEG"));
  }

#ifdef EXAMPLES_HAVE_JPEG
  TEST_CASE("image_io: a JPEG reads back as the grey levels it was made of, cut off anywhere it is refused") {
    const cairn_test::Folder folder;
    const int width = 37, height = 21;
    std::vector<unsigned char> grey, colour;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        grey.push_back(static_cast<unsigned char>(40 + 3 * x + 2 * y));
        colour.insert(colour.end(), 3, grey.back());
      }
    for (const bool coloured : {false, true}) {
      CAPTURE(coloured);
      tjhandle handle = tjInitCompress();
      unsigned char* bytes = nullptr;
      unsigned long size = 0;
      REQUIRE(tjCompress2(handle, coloured ? colour.data() : grey.data(), width, 0, height,
                          coloured ? TJPF_RGB : TJPF_GRAY, &bytes, &size, coloured ? TJSAMP_420 : TJSAMP_GRAY,
                          100, 0) == 0);
      const std::string file(reinterpret_cast<const char*>(bytes), size);
      tjFree(bytes);
      tjDestroy(handle);
      cairn::write_file_atomically(folder / "a.jpg", file);
      const cairn::Image image = example::read_image(folder / "a.jpg");
      REQUIRE(image.width() == width);
      REQUIRE(image.height() == height);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          CHECK(std::abs(image(x, y) - grey[static_cast<std::size_t>(y * width + x)]) <= 3);
      for (std::size_t length = 3; length + 2 < size; length += 7) {
        CAPTURE(length);
        cairn::write_file_atomically(folder / "torn.jpg", file.substr(0, length));
        CHECK(names(refusal(folder / "torn.jpg"), "torn.jpg: damaged JPEG"));
      }
    }
  }
#endif

  TEST_CASE("image_io: a PNG cut off anywhere before its last pixel is refused by name") {
    cairn::Random random(3);
    const cairn_test::Folder folder;
    example::write_png(folder / "whole.png", random_image(31, 17, random));
    const std::string bytes = cairn::read_file(folder / "whole.png");
    constexpr std::size_t end_chunk = 12;  // IEND, after all pixels
    for (std::size_t length = 1; length + end_chunk + 8 < bytes.size(); ++length) {
      cairn::write_file_atomically(folder / "cut.png", bytes.substr(0, length));
      CAPTURE(length);
      CHECK(names(refusal(folder / "cut.png"), "cut.png: "));
    }
  }

  TEST_CASE("image_io: a PNG with one wrong byte is refused or an image of sensible size, never a crash") {
    cairn::Random random(4);
    const cairn_test::Folder folder;
    const cairn::Image whole = random_image(23, 9, random);
    example::write_png(folder / "whole.png", whole);
    const std::string bytes = cairn::read_file(folder / "whole.png");
    int refused = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      std::string damaged = bytes;
      damaged[i] = static_cast<char>(damaged[i] ^ static_cast<char>(1 + random.below(255)));
      cairn::write_file_atomically(folder / "damaged.png", damaged);
      CAPTURE(i);
      const std::string message = refusal(folder / "damaged.png");
      refused += message.empty() ? 0 : 1;
      if (message.empty()) CHECK(example::read_image(folder / "damaged.png") == whole);
    }
    CHECK(refused > static_cast<int>(bytes.size()) * 9 / 10);
  }
}

}  // namespace image_io_test
