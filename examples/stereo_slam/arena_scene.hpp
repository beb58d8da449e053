// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What stands in the arena: floor, fence and boxes, all of them textured rectangles.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <cairn/core/linalg.hpp>

#include "arena_texture.hpp"

namespace stereo_slam {

/// A rectangle: origin + a * along + b * up for a in [0, width], b in [0, height] [m]. It is seen from the
/// side that `along x up` points to. Texels start at (texture_u, texture_v); v grows against `up`.
struct Panel {
  cairn::Vector<3> origin;
  cairn::Vector<3> along;
  cairn::Vector<3> up;
  double width = 0;
  double height = 0;
  const Texture* texture = nullptr;
  double texture_u = 0;
  double texture_v = 0;
  float light = 1;  ///< factor on the grey of the texture
};

/// A box on the floor.
struct Box {
  double x = 0, y = 0, heading = 0;          ///< centre [m], direction of its length [rad]
  double length = 0, width = 0, height = 0;  ///< [m]
};

/// The arena of one seed. It costs about a second and 100 MB to make. Const methods are safe concurrently.
class ArenaScene {
public:
  ArenaScene(std::uint64_t seed, unsigned threads);

  static constexpr double side = 10;           ///< of the square floor [m]
  static constexpr double fence_height = 0.5;  ///< [m]
  static constexpr double texels_per_metre = 512;

  [[nodiscard]] const std::vector<Panel>& panels() const { return panels_; }
  [[nodiscard]] const std::vector<Box>& boxes() const { return boxes_; }

private:
  void add_floor(std::uint64_t seed, unsigned threads);
  void add_fence(std::uint64_t seed, unsigned threads);
  void add_boxes(std::uint64_t seed, unsigned threads);

  std::vector<Box> boxes_;
  std::vector<std::unique_ptr<Texture>> textures_;
  std::vector<Panel> panels_;
};

}  // namespace stereo_slam
