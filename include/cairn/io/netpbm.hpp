// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Netpbm images: PGM (P2, P5) and PPM (P3, P6) with 8 or 16 bits a sample, as in the format's manual pages.
///
/// read_netpbm keeps every sample; read_pgm gives the 8-bit grey image that vision/ works on. Sixteen-bit
/// samples are big-endian in the file. Files are checked completely before memory is taken for them. A file
/// holds one image and nothing else: bytes after it are refused, also a further image, which the raw formats
/// allow; blanks and comments may follow the samples of the plain ones.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>
#include <cairn/version.hpp>
#include <cairn/vision/image.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// An image as its file has it: rows from the top, samples of a pixel side by side.
struct Netpbm {
  int width = 0;
  int height = 0;
  int channels = 1;                    ///< 1 grey, 3 red-green-blue
  int largest = 255;                   ///< the sample value that means white, 1..65535
  std::vector<std::uint16_t> samples;  ///< width * height * channels, each at most `largest`
};

namespace detail {

/// Reads header tokens and samples of one netpbm file that is already in memory.
class NetpbmParser {
public:
  NetpbmParser(std::string name, std::string_view bytes) : name_(std::move(name)), bytes_(bytes) {}

  [[nodiscard]] Netpbm parse() {
    const std::string_view magic = bytes_.substr(0, 2);
    const bool grey = magic == "P2" || magic == "P5";
    if ((!grey && magic != "P3" && magic != "P6") || !blank_or_comment(2))
      fail("a PGM or PPM image (P2, P3, P5 or P6 and a blank at its start)");
    const bool plain = magic == "P2" || magic == "P3";
    position_ = 2;
    Netpbm image;
    image.width = integer("the width", 1, most_pixels_a_side);
    image.height = integer("the height", 1, most_pixels_a_side);
    image.largest = integer("the largest sample value", 1, 65535);
    image.channels = grey ? 1 : 3;
    const std::size_t count = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height) *
                              static_cast<std::size_t>(image.channels);
    const std::size_t sample_bytes = !plain && image.largest > 255 ? 2 : 1;
    if (!plain) {  // a single blank between header and samples, and no comment
      if (position_ < bytes_.size() && !is_blank(bytes_[position_]))
        fail("a blank after the largest sample value, at byte " + std::to_string(position_));
      ++position_;
    }
    const std::size_t left = bytes_.size() - std::min(position_, bytes_.size());
    if (left / sample_bytes < count)  // a plain sample takes at least one byte as well
      fail(std::to_string(count * sample_bytes) + " bytes of samples, found " + std::to_string(left));
    image.samples.resize(count);
    for (std::uint16_t& sample : image.samples)
      sample = plain ? static_cast<std::uint16_t>(integer("a sample", 0, image.largest))
                     : raw(sample_bytes, image.largest);
    if (plain) skip_blanks_and_comments();
    if (position_ < bytes_.size())
      fail("the end of the file after one image, found " + std::to_string(bytes_.size() - position_) +
           " bytes more");
    return image;
  }

private:
  static constexpr int most_pixels_a_side = 1 << 20;

  [[noreturn]] void fail(const std::string& expected) const { raise(name_ + ": expected " + expected); }

  static constexpr std::string_view blanks = " \t\r\n";
  [[nodiscard]] static bool is_blank(char letter) { return blanks.find(letter) != std::string_view::npos; }
  [[nodiscard]] bool blank_or_comment(std::size_t place) const {
    return place >= bytes_.size() || bytes_[place] == '#' || is_blank(bytes_[place]);
  }

  // Digits alone: a sign, as '+5', is none of the format's.
  int integer(const char* what, int low, int high) {
    skip_blanks_and_comments();
    std::size_t end = position_;
    while (!blank_or_comment(end)) ++end;
    const std::string_view token = bytes_.substr(position_, end - position_);
    const std::optional<int> value = token.starts_with('+') ? std::nullopt : parse_number<int>(token);
    if (!value || *value < low || *value > high)
      fail(std::string(what) + " between " + std::to_string(low) + " and " + std::to_string(high) +
           " at byte " + std::to_string(position_) + ", found '" + std::string(token.substr(0, 20)) + "'");
    position_ = end;
    return *value;
  }

  void skip_blanks_and_comments() {
    while (position_ < bytes_.size()) {
      if (bytes_[position_] == '#')
        position_ = std::min(bytes_.find('\n', position_), bytes_.size());
      else if (!is_blank(bytes_[position_]))
        return;
      else
        ++position_;
    }
  }

  std::uint16_t raw(std::size_t sample_bytes, int largest) {
    unsigned value = static_cast<unsigned char>(bytes_[position_++]);
    if (sample_bytes == 2) value = value << 8U | static_cast<unsigned char>(bytes_[position_++]);
    if (value > static_cast<unsigned>(largest))
      fail("samples of at most " + std::to_string(largest) + ", found " + std::to_string(value) +
           " at byte " + std::to_string(position_ - sample_bytes));
    return static_cast<std::uint16_t>(value);
  }

  std::string name_;
  std::string_view bytes_;
  std::size_t position_ = 0;
};

}  // namespace detail

/// The image of a netpbm file. Throws Error naming the file and what was expected where.
[[nodiscard]] inline Netpbm read_netpbm(const std::filesystem::path& path) {
  const std::string bytes = read_file(path, "a PGM or PPM image");
  return detail::NetpbmParser(path.string(), bytes).parse();
}

/// The image as 8-bit grey: samples rescaled to 0..255 with rounding, colours weighted 0.299, 0.587, 0.114
/// (ITU-R BT.601). Throws as read_netpbm.
[[nodiscard]] inline Image read_pgm(const std::filesystem::path& path) {
  const Netpbm file = read_netpbm(path);
  Image image(file.width, file.height);
  const std::uint16_t* sample = file.samples.data();
  for (int y = 0; y < file.height; ++y)
    for (int x = 0; x < file.width; ++x, sample += file.channels) {
      const double grey =
          file.channels == 1 ? sample[0] : 0.299 * sample[0] + 0.587 * sample[1] + 0.114 * sample[2];
      image(x, y) = static_cast<std::uint8_t>(grey * 255.0 / file.largest + 0.5);
    }
  return image;
}

/// Writes a P5 file of 8 bits, completely or not at all. Throws Error naming the path.
inline void write_pgm(const std::filesystem::path& path, ImageView image) {
  CAIRN_EXPECTS(!image.empty(), "write_pgm needs an image with pixels");
  std::string bytes =
      "P5\n" + std::to_string(image.width()) + " " + std::to_string(image.height()) + "\n255\n";
  for (int y = 0; y < image.height(); ++y)
    bytes.append(reinterpret_cast<const char*>(image.row(y)), static_cast<std::size_t>(image.width()));
  write_file_atomically(path, bytes);
}

/// Writes P5 or P6 of 8 or 16 bits as the image says, completely or not at all. Throws Error naming the path,
/// before anything is written where a sample is above `largest`.
inline void write_netpbm(const std::filesystem::path& path, const Netpbm& image) {
  CAIRN_EXPECTS(image.width > 0 && image.height > 0 && (image.channels == 1 || image.channels == 3) &&
                    image.largest > 0 && image.largest < 65536 &&
                    image.samples.size() == static_cast<std::size_t>(image.width) *
                                                static_cast<std::size_t>(image.height) *
                                                static_cast<std::size_t>(image.channels),
                "write_netpbm needs 1 or 3 channels and width * height * channels samples");
  std::string bytes = std::string(image.channels == 1 ? "P5" : "P6") + "\n" + std::to_string(image.width) +
                      " " + std::to_string(image.height) + "\n" + std::to_string(image.largest) + "\n";
  for (const std::uint16_t sample : image.samples) {
    if (sample > image.largest)
      raise(path.string() + ": not written, expected samples of at most " + std::to_string(image.largest) +
            ", found " + std::to_string(sample));
    if (image.largest > 255) bytes.push_back(static_cast<char>(sample >> 8U));
    bytes.push_back(static_cast<char>(sample & 255U));
  }
  write_file_atomically(path, bytes);
}

}}  // namespace cairn::CAIRN_ABI
