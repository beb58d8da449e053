// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Which cells of one image show what rides along.
///
/// Cells in which points keep standing still against the motion, in three frames more than most of them
/// moved, are left out from then on, until something else is seen there for eight frames in a row.
#pragma once

#include <span>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/vision/features.hpp>

#include "hidden_cells.hpp"

namespace stereo_slam {

/// What of one image rides along.
class RidingCells {
public:
  /// Of images of that size [pixels].
  RidingCells(int width, int height);

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

}  // namespace stereo_slam
