// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A grid as a picture that ROS' map_server reads.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include <cairn/grid/tile.hpp>
#include <cairn/vision/image.hpp>

namespace grid_slam {

inline constexpr std::uint8_t free_grey = 254, occupied_grey = 0, unknown_grey = 205;

/// A map as a picture: 254 free, 0 occupied, 205 unknown, north up, as map_server has it.
struct MapImage {
  cairn::Image image;
  double cell_size = 0;         ///< [m] a pixel
  double left = 0, bottom = 0;  ///< of the lower left pixel's lower left corner [m]
  /// Of the map [cells]. Where one is above `most`, there is no picture: `image` is empty.
  std::int64_t columns = image.width(), rows = image.height();

  static constexpr int most = 30000;
  [[nodiscard]] bool has_picture() const noexcept { return image.width() > 0; }
};

/// Why a map has no picture, and what there is to do.
[[nodiscard]] inline std::string why_no_picture(const MapImage& map) {
  const double needed = map.cell_size * static_cast<double>(std::max(map.columns, map.rows)) / MapImage::most;
  constexpr double coarsest = 1;  // [m], of --resolution
  char advice[96];
  if (needed < coarsest)
    std::snprintf(advice, sizeof advice, "--resolution %.2f makes it small enough",
                  std::min(coarsest, std::ceil(100 * needed + 1) / 100));
  else
    std::snprintf(advice, sizeof advice, "no --resolution makes it small enough, is the odometry right?");
  return "no map.pgm and map.yaml: the map of " + std::to_string(map.columns) + " x " +
         std::to_string(map.rows) + " cells is larger than a picture of " + std::to_string(MapImage::most) +
         " x " + std::to_string(MapImage::most) + "; " + advice;
}

/// A map as runs of equal pixels, row by row: a floor of a million cells in a tenth of the bytes or less, so
/// that the maps of a film can be kept while the filter still runs.
class PackedMap {
public:
  PackedMap() = default;
  explicit PackedMap(const MapImage& map)
      : cell_size(map.cell_size),
        left(map.left),
        bottom(map.bottom),
        width(map.image.width()),
        height(map.image.height()) {
    for (int row = 0; row < height; ++row)
      for (int column = 0; column < width; ++column) {
        const std::uint8_t grey = map.image(column, row);
        if (runs_.empty() || runs_.back().grey != grey || runs_.back().pixels == most)
          runs_.push_back({grey, 0});
        ++runs_.back().pixels;
      }
    runs_.shrink_to_fit();
  }

  double cell_size = 0, left = 0, bottom = 0;  ///< as of a MapImage
  int width = 0, height = 0;

  [[nodiscard]] MapImage unpacked() const {
    MapImage map{cairn::Image(width, height, unknown_grey), cell_size, left, bottom};
    int row = 0, column = 0;
    for (const Run& run : runs_)
      for (std::uint32_t i = 0; i < run.pixels; ++i) {
        map.image(column, row) = run.grey;
        if (++column == width) {
          column = 0;
          ++row;
        }
      }
    return map;
  }
  [[nodiscard]] bool has_picture() const noexcept { return width > 0; }
  [[nodiscard]] std::size_t bytes() const noexcept { return runs_.capacity() * sizeof(Run); }

private:
  static constexpr std::uint32_t most = (1U << 24U) - 1;
  struct Run {
    std::uint32_t grey : 8;
    std::uint32_t pixels : 24;
  };
  std::vector<Run> runs_;
};

/// Of all cells of shared tiles, or of a tree of ancestors, whose grey(cell) is not unknown, with a margin of
/// one; one unknown pixel where there is none. No picture where it would be too large.
template <class Cells, class Grey>
[[nodiscard]] MapImage image_of(const cairn::GridGeometry& geometry, const Cells& cells, const Grey& grey) {
  using cairn::CellAddress;
  constexpr auto far = std::numeric_limits<std::int32_t>::max();
  CellAddress low{far, far}, high{-far, -far};
  const auto for_each_known = [&](const auto& visit) {
    cells.for_each_tile([&](cairn::TileAddress address, const auto& tile) {
      const CellAddress corner = cairn::corner_of(address);
      for (int i = 0; i < cairn::tile_cells; ++i)
        if (const std::uint8_t g = grey(tile[static_cast<std::size_t>(i)]); g != unknown_grey)
          visit(CellAddress{corner.column + i % cairn::tile_side, corner.row + i / cairn::tile_side}, g);
    });
  };
  for_each_known([&](CellAddress at, std::uint8_t) {
    low = {std::min(low.column, at.column), std::min(low.row, at.row)};
    high = {std::max(high.column, at.column), std::max(high.row, at.row)};
  });
  if (low.column == far) low = high = {0, 0};
  low = {low.column - 1, low.row - 1};
  const auto width = static_cast<std::int64_t>(high.column) + 2 - low.column;
  const auto height = static_cast<std::int64_t>(high.row) + 2 - low.row;
  MapImage map{{},
               geometry.cell_size,
               geometry.origin_x + low.column * geometry.cell_size,
               geometry.origin_y + low.row * geometry.cell_size,
               width,
               height};
  if (width > MapImage::most || height > MapImage::most) return map;
  map.image = cairn::Image(static_cast<int>(width), static_cast<int>(height), unknown_grey);
  for_each_known([&](CellAddress at, std::uint8_t g) {
    map.image(at.column - low.column, static_cast<int>(height) - 1 - (at.row - low.row)) = g;
  });
  return map;
}

}  // namespace grid_slam
