// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How far the laser lags behind odometry, learnt from the turns that scans and odometry both measure.
///
/// A logger writes a scan with the newest odometry at hand, and the scan was taken before: by half a scan's
/// time on some robots, by one and a half on others. Driving straight, nobody notices; where a turn begins or
/// ends, odometry is wrong by the turn of that time, which on a robot that turns 15 degrees from one scan to
/// the next is more than the noise of any wheel.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <cairn/io/carmen.hpp>
#include <cairn/manifold/se2.hpp>

namespace grid_slam {

/// Odometry's pose of the laser when scan i was taken, if that was `delay` >= 0 scans before it was logged:
/// on the way between two scans, at a constant velocity. Before the log begins, where it begins.
[[nodiscard]] cairn::SE2 delayed_odometry(std::span<const cairn::StampedScan> scans, std::size_t i,
                                          double delay);

/// What odometry moved between two scans of that delay, from < to; or what it would have moved, had it taken
/// the one direction for the other.
[[nodiscard]] cairn::SE2 delayed_motion(std::span<const cairn::StampedScan> scans, std::size_t from,
                                        std::size_t to, double delay, bool forwards);

/// A distribution over delays from none to three scans, on a lattice.
class ScanDelay {
public:
  static constexpr double spacing = 0.25;  ///< [scans]
  static constexpr std::size_t count = 13;

  /// Small delays are the likelier ones.
  ScanDelay();

  /// [scans]
  [[nodiscard]] double mean() const { return mean_; }
  /// Standard deviation [scans], at least what the lattice cannot tell apart.
  [[nodiscard]] double spread() const { return spread_; }

  /// The laser turned by `turn` [rad] from one scan to another, with a standard deviation that holds the
  /// scans' and odometry's. One turn in twenty is taken to say nothing.
  void learn(std::span<const cairn::StampedScan> scans, std::size_t from, std::size_t to, double turn,
             double sigma);

  /// Whether the shares of all delays sum to one, as those of a file need not.
  [[nodiscard]] bool is_distribution() const;

  template <class Archive>
  friend void parts(Archive& archive, ScanDelay& d) {
    for (double& each : d.log_weights_) archive(each);
    if constexpr (Archive::reads) d.sum_up();
  }

private:
  void normalise();
  void sum_up();

  std::array<double, count> log_weights_{};
  double mean_ = 0, spread_ = 0;
};

}  // namespace grid_slam
