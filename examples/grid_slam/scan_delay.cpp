// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "scan_delay.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/manifold/so2.hpp>

namespace grid_slam {

namespace {

using cairn::SE2;
using cairn::Vector;

/// A place between scans: after scan `index` by a share of the way to the next.
struct Instant {
  std::size_t index = 0;
  double share = 0;
};

Instant taken(std::size_t i, double delay) {
  const double at = std::max(0.0, static_cast<double>(i) - delay);
  const auto index = static_cast<std::size_t>(at);
  return {index, at - static_cast<double>(index)};
}

/// The steps of odometry from one scan to the next.
Vector<3> step_after(std::span<const cairn::StampedScan> scans, std::size_t i) {
  return (scans[i].T_odom_laser.inverse() * scans[i + 1].T_odom_laser).log();
}

}  // namespace

SE2 delayed_odometry(std::span<const cairn::StampedScan> scans, std::size_t i, double delay) {
  CAIRN_EXPECTS(i < scans.size(), "delayed_odometry needs a scan of the log");
  const auto [index, share] = taken(i, delay);
  const SE2& before = scans[index].T_odom_laser;
  return share == 0 ? before : before * SE2::exp(Vector<3>(share * step_after(scans, index)));
}

SE2 delayed_motion(std::span<const cairn::StampedScan> scans, std::size_t from, std::size_t to, double delay,
                   bool forwards) {
  CAIRN_EXPECTS(from < to && to < scans.size(), "delayed_motion needs two scans of the log, in order");
  const Instant begin = taken(from, delay), end = taken(to, delay);
  SE2 moved;
  for (std::size_t i = begin.index; i <= end.index; ++i) {
    const double first = i == begin.index ? begin.share : 0, last = i == end.index ? end.share : 1;
    if (!(last > first)) continue;
    Vector<3> step = (last - first) * step_after(scans, i);
    if (!forwards) step.head<2>() = -step.head<2>();
    moved = moved * SE2::exp(step);
  }
  return moved;
}

ScanDelay::ScanDelay() {
  for (std::size_t k = 0; k < count; ++k) log_weights_[k] = -spacing * static_cast<double>(k);
  normalise();
  sum_up();
}

void ScanDelay::learn(std::span<const cairn::StampedScan> scans, std::size_t from, std::size_t to,
                      double turn, double sigma) {
  constexpr double says_nothing = 0.05;
  for (std::size_t k = 0; k < count; ++k) {
    const double delay = spacing * static_cast<double>(k);
    const double error =
        cairn::SO2(turn - delayed_motion(scans, from, to, delay, true).angle()).angle() / sigma;
    const double likely = std::exp(-0.5 * error * error) / (std::sqrt(2 * std::numbers::pi) * sigma);
    log_weights_[k] += std::log((1 - says_nothing) * likely + says_nothing / (2 * std::numbers::pi));
  }
  normalise();
  sum_up();
}

bool ScanDelay::is_distribution() const {
  return std::abs(cairn::log_sum_exp(log_weights_)) < 1e-6;
}

void ScanDelay::normalise() {
  const double total = cairn::log_sum_exp(log_weights_);
  for (double& each : log_weights_) each -= total;
}

void ScanDelay::sum_up() {
  double squares = 0;
  mean_ = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double delay = spacing * static_cast<double>(k), share = std::exp(log_weights_[k]);
    mean_ += share * delay;
    squares += share * delay * delay;
  }
  spread_ = std::sqrt(std::max(squares - mean_ * mean_, spacing * spacing / 12));
}

}  // namespace grid_slam
