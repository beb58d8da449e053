// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Parts of the image that ride along: the bonnet of the car, a robot's own chassis, a mount, dirt, a vehicle
/// that keeps its distance.
///
/// What is seen there stands still in both images however the rig moves, is found again in every frame, and
/// so outvotes a scene of which half the points are new: the rig then seems to stand, and nothing
/// contradicts. No single point can tell. But a scene that stands leaves no rest, and where the points that
/// have moved agree on a motion that would have moved the others as well, one of the two is no part of the
/// world: the one that reaches less far over the image. (Not the one with fewer points, nor the one on less
/// of the image: textured dirt had 1230 of 1340 matches of a drive, in three times as many cells as the
/// rest.) A lorry that passes a rig that stands reaches less far than the street behind it.
///
/// A decision stands as long as the rest agrees on a motion: what a frame's motion was told by is suspected
/// in the next, however far it reaches. Cells of an image in which points keep standing still against the
/// motion, in three frames more than most of them moved, are left out from then on, until something else is
/// seen there for eight frames in a row.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/vision/features.hpp>

namespace stereo_slam {

/// Cells of one image that are left out; none where it was not given a size.
class HiddenCells {
public:
  HiddenCells() = default;
  /// Of an image of that size [pixels].
  HiddenCells(int width, int height);

  /// Whether a point there is left out; what lies beyond the rim counts to the cell nearest to it. O(1).
  [[nodiscard]] bool hides(double x, double y) const noexcept {
    return !cells_.empty() && cells_[cell_of(x, y)] != 0;
  }
  [[nodiscard]] std::size_t cell_of(double x, double y) const noexcept;
  [[nodiscard]] std::size_t size() const noexcept { return cells_.size(); }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] bool hidden(std::size_t cell) const noexcept { return cells_[cell] != 0; }
  void set(std::size_t cell, bool hidden) noexcept;
  /// Cells that are hidden in one and not in the other, of images of one size.
  [[nodiscard]] std::size_t unlike(const HiddenCells& other) const;

private:
  int side_ = 1, columns_ = 0, rows_ = 0;  // of a cell [pixels], of the grid [cells]
  std::size_t count_ = 0;
  std::vector<std::uint8_t> cells_;
};

/// Of the left and the right image.
using HiddenParts = std::array<HiddenCells, 2>;

/// What of one image rides along.
class RidingAlong {
public:
  /// Of images of that size [pixels].
  RidingAlong(int width, int height);

  [[nodiscard]] const HiddenCells& hidden() const noexcept { return hidden_; }
  /// Part of the image that is left out, 0 to 1.
  [[nodiscard]] double share() const noexcept;

  /// Whether most points stood still there, against the motion, when it was judged last.
  [[nodiscard]] bool suspects(const cairn::Vector<2>& pixel) const {
    return cells_[hidden_.cell_of(pixel(0), pixel(1))].score > 0;
  }

  /// What a frame's motion says: points that stood still against it, and points that it moved.
  void judge(std::span<const cairn::Vector<2>> still, std::span<const cairn::Vector<2>> moved);
  /// The points of a frame, those that are left out among them. Cells that show others than they did are
  /// given back.
  void watch(const cairn::Features& points);

private:
  struct Remembered {
    float x, y;
    std::vector<float> descriptor;
  };
  struct Cell {
    int score = 0;    // frames in which most of its points stood still, less those in which most moved
    int age = 0;      // of what is remembered [frames]
    int strange = 0;  // frames in a row that showed something else
    std::vector<Remembered> remembered;
  };
  [[nodiscard]] bool shows_again(const cairn::Keypoint& point, std::span<const float> descriptor) const;

  HiddenCells hidden_;
  std::vector<Cell> cells_;
};

/// How far these points reach over the image: width times height of the rectangle that leaves a twentieth of
/// them out on each side [pixels^2].
[[nodiscard]] double reach(std::span<const cairn::Vector<2>> pixels);

}  // namespace stereo_slam
