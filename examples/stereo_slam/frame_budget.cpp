// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "frame_budget.hpp"

#include <algorithm>
#include <cmath>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>

namespace stereo_slam {
namespace {

constexpr double memory = 0.25;   // of a new number in a running mean
constexpr double patience = 0.9;  // what was left out is tried again: its cost may have been a hiccup
constexpr double step = 0.05;     // a smaller change of the number of points is none
constexpr double aim = 0.9;       // of the budget: frames differ

}  // namespace

FrameBudget::FrameBudget(const FrameBudgetOptions& options, int points)
    : options_(options), most_points_(points), points_(points), wish_(points) {
  if (on() && !(*options.milliseconds > 0 && std::isfinite(*options.milliseconds)))
    cairn::raise("budget of a frame: expected a positive number of milliseconds, found " +
                 cairn::shortest(*options.milliseconds));
  options_.least_points = std::min(options.least_points, points);
}

bool FrameBudget::allows(Shed work, double spent) {
  if (!on()) return true;
  const auto kind = static_cast<std::size_t>(work);
  if (spent + expected_[kind] <= *options_.milliseconds) return true;
  left_out_.set(kind);
  expected_[kind] *= patience;
  return false;
}

void FrameBudget::took(Shed work, double milliseconds) {
  double& expected = expected_[static_cast<std::size_t>(work)];
  expected = std::max(milliseconds, expected + memory * (milliseconds - expected));
}

ShedSet FrameBudget::finish(int points, int wanted, double spent) {
  ShedSet left_out = left_out_;
  left_out_.reset();
  if (!on()) return left_out;
  left_out.set(static_cast<std::size_t>(Shed::points), wanted < most_points_);
  double whole = spent;
  for (std::size_t kind = 0; kind < shed_names.size(); ++kind)
    if (left_out[kind]) whole += expected_[kind];
  if (points > 0 && whole > 0) {
    const double wish = points * aim * *options_.milliseconds / whole;
    wish_ += memory * (std::min<double>(wish, most_points_) - wish_);
    wish_ = std::clamp<double>(wish_, options_.least_points, most_points_);
  }
  const bool at_an_end = wish_ == options_.least_points || wish_ > (1 - step / 2) * most_points_;
  if (at_an_end || std::abs(wish_ - points_) > step * points_)
    points_ = wish_ > (1 - step / 2) * most_points_ ? most_points_ : static_cast<int>(std::lround(wish_));
  return left_out;
}

}  // namespace stereo_slam
