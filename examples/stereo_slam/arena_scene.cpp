// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "arena_scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <cairn/core/random.hpp>

#include "arena_ground.hpp"
#include "arena_script.hpp"

namespace stereo_slam {
namespace {

using std::numbers::pi;

int texels(double metres) {
  return static_cast<int>(std::lround(metres * ArenaScene::texels_per_metre));
}

// Distance from (x, y) to the nearest place that any script drives over.
double clearance(double x, double y) {
  static const std::vector<Stance> driven = [] {
    std::vector<Stance> all;
    for (const char* script : {"turn", "loop", "spiral"}) {
      const std::vector<Stance> stances = script_stances(script);
      all.insert(all.end(), stances.begin(), stances.end());
    }
    return all;
  }();
  double nearest = 1e9;
  for (const Stance& s : driven) nearest = std::min(nearest, std::hypot(s.x - x, s.y - y));
  return nearest;
}

// Boxes at random where no script drives, apart from each other and from the fence.
std::vector<Box> place_boxes(std::uint64_t seed) {
  constexpr std::size_t wanted = 14;
  constexpr int most_trials = 4000;
  cairn::Random random(seed, 0x626f78);
  std::vector<Box> boxes;
  for (int trial = 0; trial < most_trials && boxes.size() < wanted; ++trial) {
    Box box;
    box.length = random.uniform(0.22, 0.7);
    box.width = random.uniform(0.18, 0.45);
    box.height = random.uniform(0.12, 0.42);
    box.heading = random.uniform(0, pi);
    const double radius = std::hypot(box.length, box.width) / 2;
    const double room = ArenaScene::side / 2 - 0.1 - radius;
    box.x = random.uniform(-room, room);
    box.y = random.uniform(-room, room);
    const bool apart = std::all_of(boxes.begin(), boxes.end(), [&](const Box& other) {
      return std::hypot(other.x - box.x, other.y - box.y) >
             radius + std::hypot(other.length, other.width) / 2 + 0.3;
    });
    if (apart && clearance(box.x, box.y) > radius + 0.3) boxes.push_back(box);
  }
  return boxes;
}

// Distance from the floor point (x, y) to the outline of the box; negative inside.
double distance_to(const Box& box, double x, double y) {
  const double c = std::cos(box.heading), s = std::sin(box.heading);
  const double along = std::abs(c * (x - box.x) + s * (y - box.y)) - box.length / 2;
  const double across = std::abs(c * (y - box.y) - s * (x - box.x)) - box.width / 2;
  return std::hypot(std::max(along, 0.0), std::max(across, 0.0)) + std::min(std::max(along, across), 0.0);
}

// Less sky is seen from the foot of a wall: darkens what lies near it.
double occlusion(double distance) {
  return 1 - 0.55 * std::exp(-std::max(distance, 0.0) / 0.07);
}

void darken(std::uint8_t& grey, double factor) {
  grey = static_cast<std::uint8_t>(static_cast<double>(grey) * factor + 0.5);
}

void darken_around(const std::vector<Box>& boxes, Texels& floor) {
  for (const Box& box : boxes) {
    const double reach = std::hypot(box.length, box.width) / 2 + 0.35;
    const int centre_x = texels(box.x + ArenaScene::side / 2);
    const int centre_y = texels(ArenaScene::side / 2 - box.y);
    for (int y = std::max(0, centre_y - texels(reach)); y < std::min(floor.height, centre_y + texels(reach));
         ++y)
      for (int x = std::max(0, centre_x - texels(reach)); x < std::min(floor.width, centre_x + texels(reach));
           ++x)
        darken(floor.at(x, y),
               occlusion(distance_to(box, (x + 0.5) / ArenaScene::texels_per_metre - ArenaScene::side / 2,
                                     ArenaScene::side / 2 - (y + 0.5) / ArenaScene::texels_per_metre)));
  }
}

void darken_rim(Texels& floor) {
  const int reach = texels(0.35);
  std::vector<double> factor;
  for (int i = 0; i < reach; ++i) factor.push_back(occlusion((i + 0.5) / ArenaScene::texels_per_metre));
  for (int y = 0; y < floor.height; ++y)
    for (int x = 0; x < floor.width; ++x) {
      const int rim = std::min({x, y, floor.width - 1 - x, floor.height - 1 - y});
      if (rim < reach) darken(floor.at(x, y), factor[static_cast<std::size_t>(rim)]);
    }
}

void darken_foot(Texels& wall) {
  for (int y = 0; y < wall.height; ++y)
    for (int x = 0; x < wall.width; ++x)
      darken(wall.at(x, y), occlusion((wall.height - 1 - y) / ArenaScene::texels_per_metre));
}

// How the lamp of the hall lights a wall that faces `direction` [rad].
float wall_light(double direction) {
  return static_cast<float>(1.0 + 0.22 * std::cos(direction - 0.7));
}

}  // namespace

ArenaScene::ArenaScene(std::uint64_t seed, unsigned threads) : boxes_(place_boxes(seed)) {
  add_floor(seed, threads);
  add_fence(seed, threads);
  add_boxes(seed, threads);
}

void ArenaScene::add_floor(std::uint64_t seed, unsigned threads) {
  GroundOptions ground{.width = texels(side), .height = texels(side), .texels_per_metre = texels_per_metre};
  ground.seed = seed * 3;
  ground.crater_density = 0.26;
  Texels picture = moon_ground(ground, threads);
  darken_around(boxes_, picture);
  darken_rim(picture);
  textures_.push_back(std::make_unique<Texture>(std::move(picture)));
  panels_.push_back({.origin = {-side / 2, -side / 2, 0},
                     .along = {1, 0, 0},
                     .up = {0, 1, 0},
                     .width = side,
                     .height = side,
                     .texture = textures_.back().get()});
}

void ArenaScene::add_fence(std::uint64_t seed, unsigned threads) {
  GroundOptions ground{
      .width = texels(4 * side), .height = texels(fence_height), .texels_per_metre = texels_per_metre};
  ground.seed = seed * 3 + 1;
  ground.largest_crater = 0.5;
  ground.albedo = 0.5;
  Texels picture = moon_ground(ground, threads);
  darken_foot(picture);
  textures_.push_back(std::make_unique<Texture>(std::move(picture)));
  for (int wall = 0; wall < 4; ++wall) {  // seen from inside, one after the other to the right
    const double out = -pi / 2 * wall;    // from the centre to this wall
    const cairn::Vector<3> outward(std::cos(out), std::sin(out), 0);
    const cairn::Vector<3> right(std::sin(out), -std::cos(out), 0);
    panels_.push_back({.origin = side / 2 * (outward - right),
                       .along = right,
                       .up = {0, 0, 1},
                       .width = side,
                       .height = fence_height,
                       .texture = textures_.back().get(),
                       .texture_u = wall * side * texels_per_metre,
                       .light = wall_light(out + pi)});
  }
}

void ArenaScene::add_boxes(std::uint64_t seed, unsigned threads) {
  double length = 0;  // of the strip of wall paper that covers all boxes
  for (const Box& box : boxes_) length += 2 * (box.length + box.width) + box.length;
  GroundOptions ground{
      .width = texels(std::max(length, 1.0)), .height = texels(0.5), .texels_per_metre = texels_per_metre};
  ground.seed = seed * 3 + 2;
  ground.largest_crater = 0.25;
  ground.crater_density = 0.22;
  ground.albedo = 0.6;
  textures_.push_back(std::make_unique<Texture>(moon_ground(ground, threads)));
  double used = 0;
  const auto add = [&](Panel panel) {
    panel.texture = textures_.back().get();
    panel.texture_u = used * texels_per_metre;
    used += panel.width;
    panels_.push_back(panel);
  };
  for (const Box& box : boxes_) {
    const cairn::Vector<3> ahead(std::cos(box.heading), std::sin(box.heading), 0);
    const cairn::Vector<3> left(-ahead(1), ahead(0), 0);
    const cairn::Vector<3> centre(box.x, box.y, 0);
    const std::array<cairn::Vector<3>, 4> outward{ahead, left, -ahead, -left};
    for (int face = 0; face < 4; ++face) {
      const cairn::Vector<3>& out = outward[static_cast<std::size_t>(face)];
      const cairn::Vector<3> along(-out(1), out(0), 0);
      const double depth = face % 2 == 0 ? box.length : box.width;
      const double span = face % 2 == 0 ? box.width : box.length;
      add({.origin = centre + depth / 2 * out - span / 2 * along,
           .along = along,
           .up = {0, 0, 1},
           .width = span,
           .height = box.height,
           .light = 0.9F * wall_light(std::atan2(out(1), out(0)))});
    }
    add({.origin =
             centre - box.length / 2 * ahead - box.width / 2 * left + cairn::Vector<3>(0, 0, box.height),
         .along = ahead,
         .up = left,
         .width = box.length,
         .height = box.width,
         .light = 1.15F});
  }
}

}  // namespace stereo_slam
