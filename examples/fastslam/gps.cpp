// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "landmark_log.hpp"
#include "support/mat_file.hpp"

namespace fastslam {

namespace {

/// Metres that the wheels have turned until each of the times, as a share of all.
std::vector<double> shares_of_way(const example::MatFile& wheels, const std::vector<double>& times) {
  const auto &time = wheels.finite("time"), &speed = wheels.finite("speed");
  if (time.empty() || time.size() != speed.size()) wheels.fail("as many speeds as times, and at least one");
  if (!std::ranges::is_sorted(time)) wheels.fail("times that do not fall");
  std::vector<double> way{0};
  for (std::size_t i = 1; i < time.size(); ++i)
    way.push_back(way.back() + std::abs(speed[i - 1]) * (time[i] - time[i - 1]));
  if (!(way.back() > 0 && std::isfinite(way.back()))) wheels.fail("wheels that turn");
  std::vector<double> shares;
  for (const double t : times) {
    const auto after = static_cast<std::size_t>(std::ranges::upper_bound(time, t) - time.begin());
    if (after == 0 || after == time.size()) {
      shares.push_back(after == 0 ? 0 : 1);
      continue;
    }
    const double part = (t - time[after - 1]) / (time[after] - time[after - 1]);
    shares.push_back((way[after - 1] + part * (way[after] - way[after - 1])) / way.back());
  }
  return shares;
}

}  // namespace

void read_gps(LandmarkLog& log, const std::filesystem::path& fixes, const std::filesystem::path& wheels) {
  const example::MatFile file(fixes);
  const auto &time = file.finite("timeGps"), &east = file.finite("Lo_m"), &north = file.finite("La_m");
  if (time.size() != east.size() || time.size() != north.size()) file.fail("as many places as times");
  const std::vector<double> shares = shares_of_way(example::MatFile(wheels), time);
  // The graph has no times: the same share of the way is the same moment.
  std::vector<double> way, moment;
  cairn::SE2 last;
  std::size_t next = 0;
  const auto gone = [&](double t, const cairn::SE2& step) {
    way.push_back((way.empty() ? 0 : way.back()) + step.translation().norm());
    moment.push_back(t);
  };
  for (std::size_t k = 0; k < log.frames.size(); ++k) {
    gone(log.frames[k].time, last.inverse() * log.frames[k].moved.mean);
    last = {};
    for (; next < log.between.size() && log.between[next].frame == k; ++next) {
      gone(log.between[next].time, last.inverse() * log.between[next].moved);
      last = log.between[next].moved;
    }
  }
  if (way.empty()) return;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double gone_then = shares[i] * way.back();
    auto at = static_cast<std::size_t>(std::ranges::lower_bound(way, gone_then) - way.begin());
    at = std::min(at, way.size() - 1);
    if (at > 0 && gone_then - way[at - 1] < way[at] - gone_then) --at;
    log.gps.push_back({moment[at], {east[i], north[i]}});
  }
}

}  // namespace fastslam
