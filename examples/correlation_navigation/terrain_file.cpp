// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "terrain_file.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/io/text.hpp>

namespace correlation_navigation {

namespace {

using cairn::FieldGrid;
using cairn::GridFrame;

/// Numbers of either byte order at places of a file that is in memory.
class Bytes {
public:
  Bytes(std::string name, std::string_view bytes) : name_(std::move(name)), bytes_(bytes) {}

  [[noreturn]] void fail(const std::string& expected) const {
    cairn::raise(name_ + ": expected " + expected);
  }

  void set_big_endian(bool big) { big_ = big; }

  template <class Number>
  [[nodiscard]] Number at(std::size_t offset) const {
    if (offset > bytes_.size() || bytes_.size() - offset < sizeof(Number))
      fail("at least " + std::to_string(offset + sizeof(Number)) + " bytes, found " +
           std::to_string(bytes_.size()) + " (truncated)");
    char raw[sizeof(Number)];
    std::memcpy(raw, bytes_.data() + offset, sizeof raw);
    if (big_ != (std::endian::native == std::endian::big)) std::reverse(raw, raw + sizeof raw);
    Number number;
    std::memcpy(&number, raw, sizeof raw);
    return number;
  }

  [[nodiscard]] std::string_view text(std::size_t offset, std::size_t count) const {
    if (offset > bytes_.size() || bytes_.size() - offset < count) fail("a tag inside the file (truncated)");
    return bytes_.substr(offset, count);
  }

private:
  std::string name_;
  std::string_view bytes_;
  bool big_ = false;
};

/// One directory of a TIFF file (Adobe, "TIFF Revision 6.0", 1992; tags of GeoTIFF 1.1 and of GDAL).
class Tiff {
public:
  explicit Tiff(Bytes bytes) : bytes_(std::move(bytes)) {
    const std::string_view order = bytes_.text(0, 2);
    if (order != "II" && order != "MM") bytes_.fail("a TIFF file (II or MM at its start)");
    bytes_.set_big_endian(order == "MM");
    if (bytes_.at<std::uint16_t>(2) != 42) bytes_.fail("a TIFF file (42 after the byte order)");
    const std::size_t directory = bytes_.at<std::uint32_t>(4);
    const std::size_t count = bytes_.at<std::uint16_t>(directory);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t entry = directory + 2 + 12 * i;
      tags_[bytes_.at<std::uint16_t>(entry)] = entry;
    }
  }

  [[nodiscard]] bool has(int tag) const { return tags_.count(tag) != 0; }

  [[nodiscard]] std::size_t count(int tag) const { return bytes_.at<std::uint32_t>(entry(tag) + 4); }

  [[nodiscard]] double number(int tag, std::size_t index = 0) const {
    const std::size_t where = entry(tag);
    const int type = bytes_.at<std::uint16_t>(where + 2);
    const std::size_t size = type == 3 ? 2 : type == 4 ? 4 : type == 12 ? 8 : 1;
    const std::size_t place =
        (size * count(tag) <= 4 ? where + 8 : bytes_.at<std::uint32_t>(where + 8)) + size * index;
    if (index >= count(tag)) bytes_.fail("more values in tag " + std::to_string(tag));
    switch (type) {
      case 1:
        return bytes_.at<std::uint8_t>(place);
      case 3:
        return bytes_.at<std::uint16_t>(place);
      case 4:
        return bytes_.at<std::uint32_t>(place);
      case 12:
        return bytes_.at<double>(place);
      default:
        bytes_.fail("a number in tag " + std::to_string(tag));
    }
  }

  [[nodiscard]] double number_or(int tag, double otherwise) const {
    return has(tag) ? number(tag) : otherwise;
  }

  [[nodiscard]] std::string text(int tag) const {
    const std::size_t where = entry(tag);
    const std::size_t size = count(tag);
    return std::string(bytes_.text(size <= 4 ? where + 8 : bytes_.at<std::uint32_t>(where + 8), size));
  }

  /// The sample of `bits` bits in the given format (1 unsigned, 2 signed, 3 floating) at a place of the file.
  [[nodiscard]] double sample(std::size_t place, int bits, int format) const {
    switch (1000 * format + bits) {
      case 1008:
        return bytes_.at<std::uint8_t>(place);
      case 1016:
        return bytes_.at<std::uint16_t>(place);
      case 1032:
        return bytes_.at<std::uint32_t>(place);
      case 2008:
        return bytes_.at<std::int8_t>(place);
      case 2016:
        return bytes_.at<std::int16_t>(place);
      case 2032:
        return bytes_.at<std::int32_t>(place);
      case 3032:
        return static_cast<double>(bytes_.at<float>(place));
      case 3064:
        return bytes_.at<double>(place);
      default:
        bytes_.fail("8, 16 or 32-bit integers or 32 or 64-bit floats, found format " +
                    std::to_string(format) + " of " + std::to_string(bits) + " bits");
    }
  }

  void expect(bool good, const std::string& what) const {
    if (!good) bytes_.fail(what);
  }

private:
  [[nodiscard]] std::size_t entry(int tag) const {
    const auto found = tags_.find(tag);
    if (found == tags_.end()) bytes_.fail("TIFF tag " + std::to_string(tag));
    return found->second;
  }

  Bytes bytes_;
  std::map<int, std::size_t> tags_;
};

constexpr int most_nodes_a_side = 1 << 16;

FieldGrid read_tiff(const Tiff& tiff) {
  const double width = tiff.number(256), height = tiff.number(257);
  tiff.expect(width >= 2 && height >= 2 && width <= most_nodes_a_side && height <= most_nodes_a_side,
              "between 2 and 65536 columns and rows");
  tiff.expect(tiff.number_or(259, 1) == 1,
              "an uncompressed TIFF (gdal_translate -co COMPRESS=NONE makes one)");
  tiff.expect(tiff.number_or(277, 1) == 1, "one band");
  const int columns = static_cast<int>(width), rows = static_cast<int>(height);
  const int bits = static_cast<int>(tiff.number(258)), format = static_cast<int>(tiff.number_or(339, 1));
  const bool tiled = tiff.has(322);
  const int block_width = tiled ? static_cast<int>(tiff.number(322)) : columns;
  const int block_height = tiled ? static_cast<int>(tiff.number(323))
                                 : static_cast<int>(std::min<double>(tiff.number_or(278, height), height));
  tiff.expect(block_width > 0 && block_height > 0 && bits > 0, "blocks of at least one sample");
  std::optional<double> missing;
  if (tiff.has(42113)) {
    std::string text = tiff.text(42113);
    text.resize(std::min(text.size(), text.find('\0')));
    missing = cairn::parse_number(cairn::trimmed(text));
  }
  GridFrame frame{0, 0, 30, 30};
  if (tiff.has(33550)) frame = {0, 0, tiff.number(33550, 0), tiff.number(33550, 1)};
  tiff.expect(frame.dx >= 0.01 && frame.dy >= 0.01, "a spacing in metres (a projected system, not degrees)");
  FieldGrid grid(columns, rows, frame);
  const int blocks_across = (columns + block_width - 1) / block_width;
  const int offsets = tiled ? 324 : 273;
  const auto bytes = static_cast<std::size_t>(bits) / 8;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const int block = r / block_height * blocks_across + c / block_width;
      const auto inside = static_cast<std::size_t>(r % block_height) * static_cast<std::size_t>(block_width) +
                          static_cast<std::size_t>(c % block_width);
      const auto start = static_cast<std::size_t>(tiff.number(offsets, static_cast<std::size_t>(block)));
      const double value = tiff.sample(start + inside * bytes, bits, format);
      const bool known = std::isfinite(value) && (!missing || value != *missing);
      grid(c, rows - 1 - r) = known ? value : cairn::void_value;  // files begin in the north
    }
  return grid;
}

FieldGrid read_hgt(Bytes bytes, std::size_t size, const std::string& stem) {
  const int side = size == std::size_t{2} * 1201 * 1201   ? 1201
                   : size == std::size_t{2} * 3601 * 3601 ? 3601
                                                          : 0;
  if (side == 0)
    bytes.fail("1201 x 1201 or 3601 x 3601 heights of 2 bytes, found " + std::to_string(size) + " bytes");
  bytes.set_big_endian(true);
  double latitude = 0;
  if (stem.size() >= 3 && (stem[0] == 'N' || stem[0] == 'S'))
    if (const auto degrees = cairn::parse_number(stem.substr(1, 2)))
      latitude = (stem[0] == 'N' ? 1.0 : -1.0) * *degrees + 0.5;
  constexpr double metres_a_degree = 6371008.8 * std::numbers::pi / 180.0;
  const double spacing = metres_a_degree / (side - 1);
  FieldGrid grid(side, side, {0, 0, spacing * std::cos(latitude * std::numbers::pi / 180.0), spacing});
  for (int r = 0; r < side; ++r)
    for (int c = 0; c < side; ++c) {
      const auto height = bytes.at<std::int16_t>(
          2 * (static_cast<std::size_t>(r) * static_cast<std::size_t>(side) + static_cast<std::size_t>(c)));
      grid(c, side - 1 - r) = height == -32768 ? cairn::void_value : height;
    }
  return grid;
}

FieldGrid read_pgm_terrain(const std::filesystem::path& path, double spacing) {
  const cairn::Netpbm image = cairn::read_netpbm(path);
  if (image.channels != 1) cairn::raise(path.string() + ": expected a grey image (PGM), found colours");
  FieldGrid grid(image.width, image.height, {0, 0, spacing, spacing});
  for (int r = 0; r < image.height; ++r)
    for (int c = 0; c < image.width; ++c)
      grid(c, image.height - 1 - r) =
          image.samples[static_cast<std::size_t>(r) * static_cast<std::size_t>(image.width) +
                        static_cast<std::size_t>(c)];
  return grid;
}

}  // namespace

FieldGrid read_terrain(const std::filesystem::path& path, double pgm_spacing) {
  std::string kind = path.extension().string();
  std::transform(kind.begin(), kind.end(), kind.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  const bool tiff = kind == ".tif" || kind == ".tiff";
  if (!tiff && kind != ".hgt" && kind != ".pgm")
    cairn::raise(path.string() + ": expected a terrain file: .tif, .hgt or .pgm");
  const auto read = [&] {
    if (kind == ".pgm") return read_pgm_terrain(path, pgm_spacing);
    const std::string bytes = cairn::read_file(path, "a terrain file");
    if (tiff) return read_tiff(Tiff(Bytes(path.string(), bytes)));
    return read_hgt(Bytes(path.string(), bytes), bytes.size(), path.stem().string());
  };
  FieldGrid grid = read();
  if (std::all_of(grid.values().begin(), grid.values().end(), [](double v) { return std::isnan(v); }))
    cairn::raise(path.string() + ": expected at least one valid height, found voids only");
  return grid;
}

}  // namespace correlation_navigation
