// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "geotiff.hpp"

#include <cairn/core/check.hpp>

#ifdef EXAMPLES_HAVE_TIFF

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <tiffio.h>

#include <cairn/io/text.hpp>

#include "degrees.hpp"

namespace correlation_navigation {

namespace {

using cairn::FieldGrid;
using cairn::GridFrame;
using Byte = unsigned char;

// Tags of GeoTIFF and of GDAL, which libtiff reads without knowing them.
constexpr std::uint32_t pixel_scale = 33550, tie_point = 33922, transformation = 34264, geo_keys = 34735,
                        no_data = 42113;

/// The first thing that libtiff found wrong with the file that this thread reads.
thread_local std::string complaint;

void complain(const char*, const char* format, std::va_list values) {
  std::array<char, 200> words{};
  std::vsnprintf(words.data(), words.size(), format, values);
  if (complaint.empty()) complaint = words.data();
}

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};

class GeoTiff {
public:
  explicit GeoTiff(const std::filesystem::path& path) : path_(path), size_(std::filesystem::file_size(path)) {
    TIFFSetErrorHandler(&complain);
    TIFFSetWarningHandler(nullptr);
    complaint.clear();
    tiff_.reset(TIFFOpen(path.c_str(), "rc"));  // c: strips as they are
    if (!tiff_) fail("a TIFF file");
  }

  [[noreturn]] void fail(const std::string& expected) const {
    cairn::raise(path_.string() + ": expected " + expected +
                 (complaint.empty() ? "" : " (" + complaint + ")"));
  }

  /// Of a tag of TIFF itself.
  template <class Number>
  [[nodiscard]] Number number(std::uint32_t tag) const {
    Number value{};
    if (TIFFGetFieldDefaulted(get(), tag, &value) != 1) fail("TIFF tag " + std::to_string(tag));
    return value;
  }

  /// Of any other tag; none where the file does not have it.
  template <class Number>
  [[nodiscard]] std::vector<Number> numbers(std::uint32_t tag, TIFFDataType type) const {
    std::uint32_t count = 0;
    const Number* values = nullptr;
    const TIFFField* field = TIFFFindField(get(), tag, TIFF_ANY);
    if (field == nullptr) return {};
    if (TIFFFieldDataType(field) != type) fail("TIFF tag " + std::to_string(tag) + " of its own type");
    std::vector<Number> result;
    if (TIFFGetField(get(), tag, &count, &values) == 1 && values != nullptr)
      for (std::uint32_t i = 0; i < count; ++i) result.push_back(values[i]);
    return result;
  }

  [[nodiscard]] TIFF* get() const { return tiff_.get(); }
  [[nodiscard]] std::uint64_t size() const { return size_; }

private:
  std::filesystem::path path_;
  std::uint64_t size_;
  std::unique_ptr<TIFF, CloseTiff> tiff_;
};

template <class Number>
double number_at(const Byte* place) {
  Number number;
  std::memcpy(&number, place, sizeof number);
  return static_cast<double>(number);
}

/// How heights are stored.
struct Samples {
  int columns, rows;
  double (*read)(const Byte*);
  std::size_t size;  ///< bytes of one
  bool single;       ///< a 32-bit float
  std::uint64_t most_bytes;
};

Samples samples_of(const GeoTiff& tiff) {
  constexpr std::uint32_t most_nodes_a_side = 1U << 16U;
  const auto columns = tiff.number<std::uint32_t>(TIFFTAG_IMAGEWIDTH),
             rows = tiff.number<std::uint32_t>(TIFFTAG_IMAGELENGTH);
  if (columns < 2 || rows < 2 || columns > most_nodes_a_side || rows > most_nodes_a_side)
    tiff.fail("between 2 and 65536 columns and rows");
  if (tiff.number<std::uint16_t>(TIFFTAG_SAMPLESPERPIXEL) != 1) tiff.fail("one band");
  struct Format {
    int format, bits;  // 1 unsigned, 2 signed, 3 floating
    double (*read)(const Byte*);
  };
  constexpr std::array<Format, 8> formats{{{1, 8, number_at<std::uint8_t>},
                                           {1, 16, number_at<std::uint16_t>},
                                           {1, 32, number_at<std::uint32_t>},
                                           {2, 8, number_at<std::int8_t>},
                                           {2, 16, number_at<std::int16_t>},
                                           {2, 32, number_at<std::int32_t>},
                                           {3, 32, number_at<float>},
                                           {3, 64, number_at<double>}}};
  const int format = tiff.number<std::uint16_t>(TIFFTAG_SAMPLEFORMAT),
            bits = tiff.number<std::uint16_t>(TIFFTAG_BITSPERSAMPLE);
  const auto* stored =
      std::ranges::find_if(formats, [&](const Format& f) { return f.format == format && f.bits == bits; });
  if (stored == formats.end())
    tiff.fail("8, 16 or 32-bit integers or 32 or 64-bit floats, found format " + std::to_string(format) +
              " of " + std::to_string(bits) + " bits");
  // Deflate makes up to 1032 bytes of one, LZW up to 1365.
  const bool compressed = tiff.number<std::uint16_t>(TIFFTAG_COMPRESSION) != COMPRESSION_NONE;
  const std::uint64_t most_expansion = compressed ? 2048 : 1;
  const Samples samples{
      static_cast<int>(columns),          static_cast<int>(rows),    stored->read,
      static_cast<std::size_t>(bits) / 8, format == 3 && bits == 32, tiff.size() * most_expansion};
  if (std::uint64_t{columns} * rows * samples.size > samples.most_bytes)
    tiff.fail(std::to_string(columns) + " x " + std::to_string(rows) + " heights, found a file of " +
              std::to_string(tiff.size()) + " bytes (truncated?)");
  return samples;
}

/// Calls use(column, row, place) on every sample, row 0 in the north.
template <class Use>
void for_each_sample(const GeoTiff& tiff, const Samples& samples, const Use& use) {
  const bool tiled = TIFFIsTiled(tiff.get()) != 0;
  const auto width = tiled ? tiff.number<std::uint32_t>(TIFFTAG_TILEWIDTH) : std::uint32_t(samples.columns),
             height = tiled ? tiff.number<std::uint32_t>(TIFFTAG_TILELENGTH) : 1U;
  constexpr std::uint32_t widest = 1U << 20U;
  const std::uint64_t size = std::uint64_t{width} * height * samples.size;
  if (width == 0 || height == 0 || width > widest || height > widest || size > samples.most_bytes ||
      (tiled ? TIFFTileSize64(tiff.get()) : TIFFScanlineSize64(tiff.get())) != size)
    tiff.fail("tiles that the file can hold, found " + std::to_string(width) + " x " +
              std::to_string(height));
  std::vector<Byte> block(static_cast<std::size_t>(size));
  const int across = static_cast<int>(width), down = static_cast<int>(height);
  for (int top = 0; top < samples.rows; top += down)
    for (int left = 0; left < samples.columns; left += across) {
      const auto x = static_cast<std::uint32_t>(left), y = static_cast<std::uint32_t>(top);
      if (tiled ? TIFFReadTile(tiff.get(), block.data(), x, y, 0, 0) < 0
                : TIFFReadScanline(tiff.get(), block.data(), y, 0) != 1)
        tiff.fail("heights at column " + std::to_string(left) + ", row " + std::to_string(top));
      for (int r = top; r < std::min(top + down, samples.rows); ++r)
        for (int c = left; c < std::min(left + across, samples.columns); ++c)
          use(c, r,
              block.data() +
                  (static_cast<std::size_t>(r - top) * width + static_cast<std::size_t>(c - left)) *
                      samples.size);
    }
}

/// Whether the file is in degrees, by GeoTIFF 1.1's keys GTModelType, GeogAngularUnits and ProjLinearUnits;
/// otherwise it is in metres. Refuses what is neither.
bool is_in_degrees(const GeoTiff& tiff) {
  constexpr int model = 1024, angular_unit = 2054, linear_unit = 3076;
  constexpr int geographic = 2, geocentric = 3, degrees = 9102, metres = 9001, by_user = 32767;
  bool result = false;
  const auto keys = tiff.numbers<std::uint16_t>(geo_keys, TIFF_SHORT);
  for (std::size_t i = 4; i + 3 < keys.size(); i += 4) {
    if (keys[i + 1] != 0) continue;  // the value stands in another tag
    const int key = keys[i], value = keys[i + 3];
    if (key == model && value == geographic) result = true;
    if ((key == model && value == geocentric) || (key == angular_unit && value != degrees) ||
        (key == linear_unit && value != metres && value != by_user))
      tiff.fail("a system in metres or degrees, found GeoTIFF's key " + std::to_string(key) + " = " +
                std::to_string(value));
  }
  return result;
}

GridFrame frame_of(const GeoTiff& tiff, const Samples& samples, double spacing) {
  const bool in_degrees = is_in_degrees(tiff);
  GridFrame frame{0, 0, spacing, spacing};
  const auto scale = tiff.numbers<double>(pixel_scale, TIFF_DOUBLE);
  if (scale.size() == 1 || (scale.empty() && !tiff.numbers<double>(transformation, TIFF_DOUBLE).empty()))
    tiff.fail("a pixel scale along x and y, not a transformation");
  if (!scale.empty()) frame = {0, 0, scale[0], scale[1]};
  if (in_degrees) {
    const auto tie = tiff.numbers<double>(tie_point, TIFF_DOUBLE);  // column, row, -, longitude, latitude, -
    if (scale.empty() || tie.size() < 6)
      tiff.fail("a pixel scale and a tie point where it is in degrees: the latitude makes them metres");
    const double latitude = tie[4] - (0.5 * samples.rows - tie[1]) * scale[1];
    constexpr double most_latitude = 89;
    if (!(std::abs(latitude) <= most_latitude)) tiff.fail("a latitude between -89 and 89 degrees");
    frame = frame_in_metres(scale[0], scale[1], latitude);
  }
  constexpr double least = 0.01, most = 1e6;
  if (!(frame.dx >= least && frame.dy >= least && frame.dx <= most && frame.dy <= most))
    tiff.fail("a spacing of 0.01 to 1e6 metres, by keys that say where it is in degrees");
  return frame;
}

/// The height that says that there is none.
std::optional<double> missing_height(const GeoTiff& tiff, const Samples& samples) {
  const auto letters = tiff.numbers<char>(no_data, TIFF_ASCII);
  const std::string text(letters.begin(), std::ranges::find(letters, '\0'));
  if (letters.empty()) return std::nullopt;
  const std::optional<double> value = cairn::parse_number(cairn::trimmed(text));
  if (!value) tiff.fail("a number as GDAL's no-data value, found '" + text.substr(0, 30) + "'");
  if (samples.single && std::abs(*value) <= double{std::numeric_limits<float>::max()})
    return double{static_cast<float>(*value)};  // fewer digits may be printed than a float has
  return value;
}

}  // namespace

FieldGrid read_geotiff(const std::filesystem::path& path, double spacing) {
  const GeoTiff tiff(path);
  const Samples samples = samples_of(tiff);
  const GridFrame frame = frame_of(tiff, samples, spacing);
  const std::optional<double> missing = missing_height(tiff, samples);
  FieldGrid grid(samples.columns, samples.rows, frame);
  for_each_sample(tiff, samples, [&](int c, int r, const Byte* place) {
    const double value = samples.read(place);
    const bool known = std::isfinite(value) && (!missing || value != *missing);
    grid(c, samples.rows - 1 - r) = known ? value : cairn::void_value;
  });
  return grid;
}

}  // namespace correlation_navigation

#else

cairn::FieldGrid correlation_navigation::read_geotiff(const std::filesystem::path& path, double) {
  cairn::raise(path.string() +
               ": expected .hgt or .pgm, this program was built without libtiff (Debian: libtiff-dev)");
}

#endif
