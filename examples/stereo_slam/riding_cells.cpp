// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "riding_cells.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "descriptor_distance.hpp"

namespace stereo_slam {
namespace {

constexpr int sure = 3;             // frames
constexpr int strange_frames = 8;   // in a row, after which a cell is given back
constexpr int longest_memory = 30;  // frames: light changes what a body looks like

}  // namespace

RidingCells::RidingCells(int width, int height) : hidden_(width, height), cells_(hidden_.size()) {}

double RidingCells::share() const noexcept {
  return static_cast<double>(hidden_.count()) / static_cast<double>(hidden_.size());
}

void RidingCells::judge(std::span<const cairn::Vector<2>> still, std::span<const cairn::Vector<2>> moved) {
  std::vector<int> votes(cells_.size(), 0);
  for (const cairn::Vector<2>& pixel : still) ++votes[hidden_.cell_of(pixel(0), pixel(1))];
  for (const cairn::Vector<2>& pixel : moved) --votes[hidden_.cell_of(pixel(0), pixel(1))];
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    if (hidden_.hidden(i) || votes[i] == 0) continue;
    int& score = cells_[i].score;
    score = std::clamp(score + (votes[i] > 0 ? 1 : -1), -sure, sure);
    if (score == sure) hidden_.set(i, true);
  }
}

/// Whether a cell around the point remembers one like it at its place.
bool RidingCells::shows_again(const cairn::Keypoint& point, std::span<const float> descriptor) const {
  constexpr float near = 2.5F;            // [pixels]
  constexpr float alike = 0.45F * 0.45F;  // of unit descriptors, squared
  for (const float dx : {-near, near})
    for (const float dy : {-near, near})
      for (const Remembered& before : cells_[hidden_.cell_of(point.x + dx, point.y + dy)].remembered)
        if (std::max(std::abs(before.x - point.x), std::abs(before.y - point.y)) < near &&
            squared_distance(before.descriptor, descriptor) < alike)
          return true;
  return false;
}

void RidingCells::watch(const cairn::Features& points) {
  if (hidden_.count() == 0) return;
  struct Count {
    int seen = 0, again = 0;
  };
  std::vector<Count> counts(cells_.size());
  std::vector<std::vector<Remembered>> now(cells_.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const cairn::Keypoint& point = points.keypoints[i];
    if (!hidden_.hides(point.x, point.y)) continue;
    const std::span<const float> descriptor = points.descriptor(i);
    const std::size_t cell = hidden_.cell_of(point.x, point.y);
    ++counts[cell].seen;
    counts[cell].again += shows_again(point, descriptor) ? 1 : 0;
    now[cell].push_back({point.x, point.y, {descriptor.begin(), descriptor.end()}});
  }
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    Cell& cell = cells_[i];
    if (counts[i].seen == 0) continue;
    ++cell.age;
    const bool strange = !cell.remembered.empty() && 4 * counts[i].again < counts[i].seen;
    cell.strange = strange ? cell.strange + 1 : 0;
    if (cell.strange >= strange_frames) {
      cell = {};
      hidden_.set(i, false);
    } else if (cell.remembered.empty() || (!strange && cell.age > longest_memory)) {
      cell.remembered = std::move(now[i]);
      cell.age = 0;
    }
  }
}

}  // namespace stereo_slam
