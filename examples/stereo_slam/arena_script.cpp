// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "arena_script.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>

namespace stereo_slam {
namespace {

using std::numbers::pi;

std::vector<Stance> turn() {
  constexpr int frames = 181;  // 2 degrees a frame; the last stands exactly like the first
  std::vector<Stance> stances;
  for (int i = 0; i < frames; ++i) stances.push_back({0, 0, 2 * pi * (i % (frames - 1)) / (frames - 1)});
  return stances;
}

// A straight of 9 cm a frame and a quarter circle of 3 degrees a frame, four times.
std::vector<Stance> lap() {
  constexpr double half_length = 2.5, half_width = 2.0, radius = 1.2;
  constexpr int curve_frames = 30;
  std::vector<Stance> stances;
  double x = -half_length + radius, y = -half_width, heading = 0;
  for (int side = 0; side < 4; ++side) {
    const double straight = 2 * ((side % 2 == 0 ? half_length : half_width) - radius);
    const auto steps = static_cast<int>(std::lround(straight / 0.09));
    for (int i = 0; i < steps; ++i)
      stances.push_back({x + straight * i / steps * std::cos(heading),
                         y + straight * i / steps * std::sin(heading), heading});
    x += straight * std::cos(heading);
    y += straight * std::sin(heading);
    const double centre_x = x - radius * std::sin(heading), centre_y = y + radius * std::cos(heading);
    for (int i = 0; i < curve_frames; ++i) {
      const double now = heading + pi / 2 * i / curve_frames;
      stances.push_back({centre_x + radius * std::sin(now), centre_y - radius * std::cos(now), now});
    }
    heading += pi / 2;
    x = centre_x + radius * std::sin(heading);
    y = centre_y - radius * std::cos(heading);
  }
  return stances;
}

std::vector<Stance> loop() {
  const std::vector<Stance> once = lap();
  std::vector<Stance> stances = once;
  stances.insert(stances.end(), once.begin(), once.end());
  stances.push_back(once.front());
  return stances;
}

// r = 0.5 m + 0.9 m a turn; each frame goes 9 cm or turns 3 degrees, whichever is less.
std::vector<Stance> spiral() {
  constexpr double start = 0.5, growth = 0.9 / (2 * pi), turns = 3;
  std::vector<Stance> stances;
  for (double angle = 0; angle <= 2 * pi * turns;) {
    const double r = start + growth * angle;
    stances.push_back({r * std::cos(angle), r * std::sin(angle), angle + std::atan2(r, growth)});
    angle += std::min(0.09 / std::hypot(r, growth), 3 * pi / 180);
  }
  return stances;
}

}  // namespace

std::vector<Stance> script_stances(const std::string& script) {
  if (script == "turn") return turn();
  if (script == "loop") return loop();
  if (script == "spiral") return spiral();
  cairn::raise("arena: there is no script '" + script + "'; expected turn, loop or spiral");
}

std::size_t loop_lap() {
  return lap().size();
}

cairn::SE3 left_camera_pose(const Stance& s, double baseline) {
  // Forward, left and up of the robot in the world; the camera's axes are right, down and forward.
  const double lift = 0.004 * std::sin(2.9 * s.x + 1.7 * s.y) * std::cos(2 * s.heading);
  const double pitch = (11 + 0.35 * std::sin(3.1 * s.x - 2.3 * s.y + 3 * s.heading)) * pi / 180;
  const double roll = 0.3 * std::sin(2.2 * s.x + 3.4 * s.y + 2 * s.heading) * pi / 180;
  cairn::Matrix<3> axes;
  axes << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const cairn::SO3 mount = cairn::SO3::from_matrix(axes);
  const cairn::SO3 turned = cairn::SO3::exp({0, 0, s.heading});
  const cairn::SO3 tilt = cairn::SO3::exp({-pitch, 0, 0}) * cairn::SO3::exp({0, 0, roll});
  const cairn::SO3 rotation = turned * mount * tilt;
  const cairn::Vector<3> middle(s.x, s.y, 0.5 + lift);
  return {rotation, middle + rotation * cairn::Vector<3>(-baseline / 2, 0, 0)};
}

}  // namespace stereo_slam
