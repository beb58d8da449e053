// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "riding_along.hpp"

#include <algorithm>
#include <utility>

#include <cairn/core/statistics.hpp>

#include "descriptor_distance.hpp"

namespace stereo_slam {
namespace {

constexpr int sure = 3;             // frames
constexpr int strange_frames = 8;   // in a row, after which a cell is given back
constexpr int longest_memory = 30;  // frames: light changes what a body looks like

}  // namespace

HiddenCells::HiddenCells(int width, int height)
    : side_(std::max(8, std::min(width, height) / 12)),
      columns_(width / side_ + 1),
      rows_(height / side_ + 1),
      cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0) {}

std::size_t HiddenCells::cell_of(double x, double y) const noexcept {
  const int column = std::clamp(static_cast<int>(x) / side_, 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(y) / side_, 0, rows_ - 1);
  return static_cast<std::size_t>(row * columns_ + column);
}

void HiddenCells::set(std::size_t cell, bool hidden) noexcept {
  if (hidden != (cells_[cell] != 0)) count_ = hidden ? count_ + 1 : count_ - 1;
  cells_[cell] = hidden ? 1 : 0;
}

std::size_t HiddenCells::unlike(const HiddenCells& other) const {
  std::size_t result = 0;
  for (std::size_t i = 0; i < cells_.size(); ++i) result += cells_[i] != other.cells_[i] ? 1 : 0;
  return result;
}

RidingAlong::RidingAlong(int width, int height) : hidden_(width, height), cells_(hidden_.size()) {}

double RidingAlong::share() const noexcept {
  return static_cast<double>(hidden_.count()) / static_cast<double>(hidden_.size());
}

void RidingAlong::judge(std::span<const cairn::Vector<2>> still, std::span<const cairn::Vector<2>> moved) {
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
bool RidingAlong::shows_again(const cairn::Keypoint& point, std::span<const float> descriptor) const {
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

void RidingAlong::watch(const cairn::Features& points) {
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

double reach(std::span<const cairn::Vector<2>> pixels) {
  double result = 1;
  for (const int axis : {0, 1}) {
    std::vector<double> values;
    for (const cairn::Vector<2>& pixel : pixels) values.push_back(pixel(axis));
    result *= cairn::quantile(values, 0.95) - cairn::quantile(values, 0.05);
  }
  return result;
}

}  // namespace stereo_slam
