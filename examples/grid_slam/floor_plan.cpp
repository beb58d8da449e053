// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "floor_plan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <cairn/core/random.hpp>

namespace grid_slam {

namespace {

using cairn::SE2;
using cairn::Vector;

void add_box(std::vector<Wall>& walls, double x0, double y0, double x1, double y1) {
  walls.push_back({x0, y0, x1, y0});
  walls.push_back({x1, y0, x1, y1});
  walls.push_back({x1, y1, x0, y1});
  walls.push_back({x0, y1, x0, y0});
}

/// A wall along x with doors left open, each with its frame; `depth` is the room behind.
void add_front(std::vector<Wall>& walls, double x0, double x1, double y, double depth,
               cairn::Random& random) {
  double x = x0;
  while (x < x1) {
    const double room = std::min(x1 - x, random.uniform(2.5, 5.0));
    const double door = random.uniform(0.8, 1.1),
                 before = random.uniform(0.3, std::max(0.4, room - door - 0.3));
    if (room < 2) {
      walls.push_back({x, y, x1, y});
    } else {
      walls.push_back({x, y, x + before, y});
      walls.push_back({x + before + door, y, x + room, y});
      walls.push_back({x + room, y, x + room, y + depth});
      walls.push_back({x, y + depth, x + room, y + depth});
    }
    x += room;
  }
}

/// 24 x 16 m: outer wall, a corridor 2 m wide, rooms inside and outside of it, a few cupboards and columns.
std::vector<Wall> floor_of(cairn::Random& random) {
  std::vector<Wall> walls;
  add_box(walls, -4, -4, 28, 20);
  add_front(walls, 0, 24, 0, -3, random);  // south of the corridor
  add_front(walls, 0, 24, 16, 3, random);  // north of it
  add_front(walls, 2, 22, 2, 4, random);   // the inner block
  add_front(walls, 2, 22, 14, -4, random);
  walls.push_back({0, 0, 0, 16});
  walls.push_back({24, 0, 24, 16});
  walls.push_back({2, 2, 2, 14});
  walls.push_back({22, 2, 22, 14});
  for (int i = 0; i < 12; ++i) {  // what stands along the corridor's walls
    const double along = random.uniform(3, 21), width = random.uniform(0.3, 0.9),
                 depth = random.uniform(0.15, 0.4);
    if (i % 2 == 0)
      add_box(walls, along, 0, along + width, depth);
    else
      add_box(walls, along, 16 - depth, along + width, 16);
  }
  for (int i = 0; i < 6; ++i) {
    const double along = random.uniform(3, 12), width = random.uniform(0.3, 0.9),
                 depth = random.uniform(0.15, 0.4);
    if (i % 2 == 0)
      add_box(walls, 0, along, depth, along + width);
    else
      add_box(walls, 24 - depth, along, 24, along + width);
  }
  return walls;
}

/// Poses 0.1 m or 0.1 rad apart along the middle of the corridor.
std::vector<SE2> drive_around(int laps) {
  const std::vector<Vector<2>> corners{{1, 1}, {23, 1}, {23, 15}, {1, 15}};
  std::vector<SE2> poses;
  const std::size_t legs = 4 * static_cast<std::size_t>(laps) + 1;
  for (std::size_t leg = 0; leg < legs; ++leg) {
    const Vector<2> from = corners[leg % 4], to = corners[(leg + 1) % 4];
    const double length = (to - from).norm(), heading = std::atan2(to(1) - from(1), to(0) - from(0));
    for (double at = 0; at < length; at += 0.1) {
      const double sway = 0.15 * std::sin(at);  // nobody drives straight
      const Vector<2> side(-std::sin(heading), std::cos(heading));
      const Vector<2> place = from + at / length * (to - from) + sway * side;
      poses.emplace_back(place(0), place(1), heading + std::atan(0.15 * std::cos(at)));
    }
    for (double turned = 0.1; turned < std::numbers::pi / 2; turned += 0.1)
      poses.emplace_back(to(0), to(1), heading + turned);
  }
  return poses;
}

cairn::LaserScan scan_at(const std::vector<Wall>& walls, const SE2& pose, double sigma,
                         cairn::Random& random) {
  cairn::LaserScan scan{.first_angle = -std::numbers::pi / 2, .angle_step = std::numbers::pi / 180};
  for (int beam = 0; beam < 181; ++beam) {
    const double r =
        range_to_wall(walls, pose.x(), pose.y(), pose.angle() + scan.angle(static_cast<std::size_t>(beam)));
    scan.range.push_back(static_cast<float>(std::isfinite(r) ? r + sigma * random.normal() : 81.91));
  }
  return scan;
}

}  // namespace

double range_to_wall(const std::vector<Wall>& walls, double x, double y, double angle) {
  const double dx = std::cos(angle), dy = std::sin(angle);
  double nearest = std::numeric_limits<double>::infinity();
  for (const Wall& wall : walls) {
    const double wx = wall.x1 - wall.x0, wy = wall.y1 - wall.y0;
    const double across = dx * wy - dy * wx;
    if (across == 0) continue;
    const double px = wall.x0 - x, py = wall.y0 - y;
    const double range = (px * wy - py * wx) / across, share = (px * dy - py * dx) / across;
    if (range > 0 && share >= 0 && share <= 1) nearest = std::min(nearest, range);
  }
  return nearest;
}

Drive simulated_drive(const DriveOptions& options) {
  cairn::Random random(options.seed, 17);
  cairn::Random plan(5);  // the building is the same for every drive
  Drive drive;
  drive.walls = floor_of(plan);
  drive.truth = drive_around(options.laps);
  const double scale = 1 + options.odometry_scale * random.normal();
  SE2 odometry = drive.truth.front();
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    if (i > 0) {
      Vector<3> step = cairn::local(drive.truth[i - 1], drive.truth[i]);
      const double length = step.head<2>().norm();
      step.head<2>() *= scale;
      step(2) += options.turn_noise * std::sqrt(std::abs(step(2))) * random.normal() +
                 options.drift * std::numbers::pi / 180 * std::sqrt(length) * random.normal();
      odometry = cairn::retract(odometry, step);
    }
    drive.log.scans.push_back({0.2 * static_cast<double>(i), odometry, odometry,
                               scan_at(drive.walls, drive.truth[i], options.range_sigma, random)});
  }
  return drive;
}

std::vector<cairn::PoseRelation> true_relations(const Drive& drive, std::size_t spacing) {
  std::vector<cairn::PoseRelation> relations;
  const auto relate = [&](std::size_t i, std::size_t k) {
    relations.push_back(
        {drive.log.scans[i].time, drive.log.scans[k].time, drive.truth[i].inverse() * drive.truth[k]});
  };
  for (std::size_t i = 0; i + spacing < drive.truth.size(); i += spacing) {
    relate(i, i + spacing);
    for (std::size_t k = i + 20 * spacing; k < drive.truth.size(); k += spacing)
      if ((drive.truth[i].translation() - drive.truth[k].translation()).norm() < 1) relate(i, k);
  }
  return relations;
}

}  // namespace grid_slam
