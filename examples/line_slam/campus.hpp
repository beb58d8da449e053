// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A campus of buildings, gate posts and steps on flat ground: what is there of edges, what hides them, and
/// what a camera's picture of it looks like.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/line_triangulation.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/vision/image.hpp>

namespace line_slam {

/// A straight edge of something.
struct Edge {
  cairn::Vector<3> from = cairn::Vector<3>::Zero(), to = cairn::Vector<3>::Zero();
};

/// A block on the ground, turned about the vertical.
struct Block {
  cairn::Vector<3> centre = cairn::Vector<3>::Zero(), half = cairn::Vector<3>::Ones();
  double cosine = 1, sine = 0;
  double radius = 0;  ///< of the ball around it

  /// Into the block's axes, its centre at zero; and back.
  [[nodiscard]] cairn::Vector<3> inside(const cairn::Vector<3>& p) const;
  [[nodiscard]] cairn::Vector<3> outside(const cairn::Vector<3>& p) const;
  /// Where the ray from + t direction enters the block, shrunk by `less` on every side: t and the axis of the
  /// face. Nothing where it does not, or begins within.
  struct Entry {
    double t = 0;
    int axis = 0;
  };
  [[nodiscard]] std::optional<Entry> entry(const cairn::Vector<3>& from, const cairn::Vector<3>& direction,
                                           double less = 0) const;
};

/// A window or a door on a wall.
struct Opening {
  std::uint32_t block = 0;
  int axis = 0;                                   ///< of the wall's normal, in the block's axes
  double side = 1;                                ///< -1 or 1
  double low = 0, high = 0, bottom = 0, top = 0;  ///< along the other axis and upwards, in the block's axes
};

class Campus {
public:
  /// 120 x 80 m with a way around its middle. Another seed is another campus.
  explicit Campus(std::uint64_t seed);

  [[nodiscard]] const std::vector<Edge>& edges() const noexcept { return edges_; }
  [[nodiscard]] const std::vector<Block>& blocks() const noexcept { return blocks_; }
  [[nodiscard]] const std::vector<Opening>& openings() const noexcept { return openings_; }

  /// Poses of a camera that follows the way, so many metres of it, one every `step`: a little more than once
  /// around for 250 m. Axes as a camera's: x right, y down, z ahead.
  [[nodiscard]] static std::vector<cairn::SE3> drive(double metres, double step);

  /// Whether nothing stands between.
  [[nodiscard]] bool sees(const cairn::Vector<3>& from, const cairn::Vector<3>& to) const;
  /// The picture that a camera takes from a pose of the rig: walls by how the light falls, ground and sky.
  [[nodiscard]] cairn::Image picture(const cairn::LineCamera& camera, const cairn::SE3& rig) const;

private:
  void add_building(const cairn::Vector<3>& centre, const cairn::Vector<3>& half, double yaw);
  void add_block(const Block& block);
  void add_opening(const Opening& opening);
  [[nodiscard]] std::uint8_t grey_of(std::uint32_t block, const Block::Entry& entry,
                                     const cairn::Vector<3>& at) const;

  std::vector<Edge> edges_;
  std::vector<Block> blocks_;
  std::vector<Opening> openings_;
};

}  // namespace line_slam
