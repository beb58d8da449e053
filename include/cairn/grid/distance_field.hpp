// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// For every cell of a grid the way to the nearest obstacle, where one is near, and which way its wall faces.
///
/// An obstacle is a point in a cell, with the normal of the line that it and its neighbours make, if they
/// make one. A cell of the field holds the step from its centre to the nearest of these points, so that a
/// distance is known to a fortieth of a cell from one load of four bytes. The field is rebuilt tile by tile
/// from the obstacles in and around the tile: what is gone leaves no trace. O(obstacles * radius^2) a tile.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A point that stops beams, in cells from the lower corner of the tile that is being built; it may lie in a
/// neighbour. The normal is of length 1, or zero where no line was found.
struct Obstacle {
  float x = 0;
  float y = 0;
  float normal_x = 0;
  float normal_y = 0;
};

/// Cells [left, right) x [bottom, top) of a tile.
struct TilePart {
  int left = 0;
  int bottom = 0;
  int right = tile_side;
  int top = tile_side;

  [[nodiscard]] constexpr bool valid() const noexcept {
    return 0 <= left && left < right && right <= tile_side && 0 <= bottom && bottom < top && top <= tile_side;
  }
};

/// What the field knows at a cell, packed.
struct NearestObstacle {
  std::int8_t dx = none;  ///< from the cell's centre, in 1/20 of a cell
  std::int8_t dy = 0;
  std::int8_t normal_x = 0;  ///< in 1/127
  std::int8_t normal_y = 0;

  static constexpr std::int8_t none = -128;
  static constexpr int steps = 20;  ///< in a cell
  [[nodiscard]] bool found() const noexcept { return dx != none; }
  [[nodiscard]] bool has_line() const noexcept { return normal_x != 0 || normal_y != 0; }
  friend bool operator==(const NearestObstacle&, const NearestObstacle&) = default;
};

/// Ways to the nearest obstacles within a radius, as shared tiles: copies are cheap.
class DistanceField {
public:
  using Tile = SharedTiles<NearestObstacle>::Tile;
  static constexpr double largest_radius = 6;  ///< cells: what a packed step can say

  /// A field that looks `radius` cells far, above 0 and at most 6. Throws Error.
  explicit DistanceField(double radius = 5) : radius_(radius) {
    if (!(radius > 0 && radius <= largest_radius))
      raise("DistanceField: expected a radius above 0 and up to 6 cells");
  }

  /// The same with tiles of a field of this radius, as tiles() of another gave them.
  DistanceField(double radius, SharedTiles<NearestObstacle> tiles) : DistanceField(radius) {
    tiles_ = std::move(tiles);
  }

  [[nodiscard]] double radius() const noexcept { return radius_; }
  /// Cells that an obstacle's effect reaches beyond its own tile.
  [[nodiscard]] int apron() const noexcept { return static_cast<int>(std::ceil(radius_)); }

  [[nodiscard]] const NearestObstacle& read(CellAddress cell) const noexcept { return tiles_.read(cell); }
  [[nodiscard]] const Tile* tile(TileAddress address) const noexcept { return tiles_.tile(address); }
  [[nodiscard]] const SharedTiles<NearestObstacle>& tiles() const noexcept { return tiles_; }

  /// Makes the cells of a part of the tile what these obstacles make them; all that lie within radius() of
  /// the part have to be among them. Of several at the same distance the first wins. Throws Error as write of
  /// SharedTiles does.
  void rebuild(TileAddress address, const TilePart& part, std::span<const Obstacle> obstacles) {
    CAIRN_EXPECTS(part.valid(), "DistanceField::rebuild needs a part that lies in the tile");
    if (obstacles.empty() && tiles_.tile(address) == nullptr) return;
    Nearest nearest;
    for (int row = part.bottom; row < part.top; ++row) {
      std::fill_n(nearest.squared.data() + row * tile_side + part.left, part.right - part.left,
                  static_cast<float>(radius_ * radius_));
      std::fill_n(nearest.index.data() + row * tile_side + part.left, part.right - part.left, -1);
    }
    for (std::size_t i = 0; i < obstacles.size(); ++i)
      stamp(nearest, part, obstacles[i], static_cast<std::int32_t>(i));
    Tile& out = tiles_.writable_tile(address);
    for (int row = part.bottom; row < part.top; ++row)
      for (int column = part.left; column < part.right; ++column) {
        const auto place = static_cast<std::size_t>(row * tile_side + column);
        const std::int32_t found = nearest.index[place];
        out[place] =
            found < 0 ? NearestObstacle{} : packed(obstacles[static_cast<std::size_t>(found)], column, row);
      }
  }

private:
  struct Nearest {
    std::array<float, tile_cells> squared;  // [cells^2]
    std::array<std::int32_t, tile_cells> index;
  };

  void stamp(Nearest& nearest, const TilePart& part, const Obstacle& o, std::int32_t index) const noexcept {
    const auto r = static_cast<float>(radius_);
    const int left = std::max(part.left, static_cast<int>(o.x - r + 64) - 64);
    const int right = std::min(part.right, static_cast<int>(o.x + r + 1));
    const int bottom = std::max(part.bottom, static_cast<int>(o.y - r + 64) - 64);
    const int top = std::min(part.top, static_cast<int>(o.y + r + 1));
    for (int row = bottom; row < top; ++row) {
      const float dy = static_cast<float>(row) + 0.5F - o.y;
      float* squared = nearest.squared.data() + row * tile_side;
      std::int32_t* indices = nearest.index.data() + row * tile_side;
      for (int column = left; column < right; ++column) {
        const float dx = static_cast<float>(column) + 0.5F - o.x;
        const float d = dx * dx + dy * dy;
        const bool nearer = d < squared[column];
        squared[column] = nearer ? d : squared[column];
        indices[column] = nearer ? index : indices[column];
      }
    }
  }

  [[nodiscard]] static NearestObstacle packed(const Obstacle& o, int column, int row) noexcept {
    const auto whole = [](float value, float scale) {  // to the nearest; no call of the library
      return static_cast<std::int8_t>(static_cast<int>(value * scale + 128.5F) - 128);
    };
    constexpr float steps = NearestObstacle::steps;
    return {whole(o.x - static_cast<float>(column) - 0.5F, steps),
            whole(o.y - static_cast<float>(row) - 0.5F, steps), whole(o.normal_x, 127.0F),
            whole(o.normal_y, 127.0F)};
  }

  double radius_;
  SharedTiles<NearestObstacle> tiles_;
};

}}  // namespace cairn::CAIRN_ABI
