// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "terrain_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <system_error>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/io/text.hpp>

#include "degrees.hpp"
#include "geotiff.hpp"

namespace correlation_navigation {

namespace {

using cairn::FieldGrid;

/// The middle of a tile of one degree that is called by its south-western corner: N34W118 [degrees].
std::optional<double> latitude_of(const std::string& stem) {
  if (stem.size() < 3 || (stem[0] != 'N' && stem[0] != 'S')) return std::nullopt;
  const std::optional<unsigned> degrees = cairn::parse_number<unsigned>(stem.substr(1, 2));
  if (!degrees || *degrees >= 90) return std::nullopt;
  return (stem[0] == 'N' ? 1.0 : -1.0) * *degrees + 0.5;
}

FieldGrid read_hgt(const std::filesystem::path& path) {
  const std::string bytes = cairn::read_file(path, "a terrain file");
  const int side = bytes.size() == std::size_t{2} * 1201 * 1201   ? 1201
                   : bytes.size() == std::size_t{2} * 3601 * 3601 ? 3601
                                                                  : 0;
  if (side == 0)
    cairn::raise(path.string() + ": expected 1201 x 1201 or 3601 x 3601 heights of 2 bytes, found " +
                 std::to_string(bytes.size()) + " bytes");
  const double latitude = latitude_of(path.stem().string()).value_or(0.0);
  const double degrees = 1.0 / (side - 1);
  FieldGrid grid(side, side, frame_in_metres(degrees, degrees, latitude));
  std::size_t place = 0;
  for (int r = 0; r < side; ++r)
    for (int c = 0; c < side; ++c, place += 2) {  // the high byte first
      const int high = static_cast<signed char>(bytes[place]),
                low = static_cast<unsigned char>(bytes[place + 1]);
      grid(c, side - 1 - r) = high * 256 + low;  // files begin in the north
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

/// Whether a number can be the height of ground. Files do not always name their no-data value, and as heights
/// such holes are cliffs that no place resembles. No ground of the Earth lies 12 km deep (SRTM's -32768 and
/// -32767, the lowest float); -9999 m lies in a few trenches, where a lost node is no harm.
bool is_height(double value) {
  constexpr double deepest = -12000, beyond_all = 1e30, usual_mark = -9999;
  return value > deepest && value < beyond_all && value != usual_mark;
}

}  // namespace

FieldGrid read_terrain(const std::filesystem::path& path, double spacing) {
  std::string kind = path.extension().string();
  std::transform(kind.begin(), kind.end(), kind.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  if (kind != ".tif" && kind != ".tiff" && kind != ".hgt" && kind != ".pgm")
    cairn::raise(path.string() + ": expected a terrain file: .tif, .hgt or .pgm");
  std::error_code unknown;
  if (!std::filesystem::is_regular_file(path, unknown))
    cairn::raise(path.string() + ": no such file; expected a terrain file");
  FieldGrid grid = kind == ".pgm"   ? read_pgm_terrain(path, spacing)
                   : kind == ".hgt" ? read_hgt(path)
                                    : read_geotiff(path, spacing);
  for (int r = 0; r < grid.rows(); ++r)
    for (int c = 0; c < grid.columns(); ++c)
      if (!is_height(grid(c, r))) grid(c, r) = cairn::void_value;
  if (std::all_of(grid.values().begin(), grid.values().end(), [](double v) { return std::isnan(v); }))
    cairn::raise(path.string() + ": expected at least one valid height, found voids only");
  return grid;
}

}  // namespace correlation_navigation
