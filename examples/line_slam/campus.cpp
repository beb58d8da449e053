// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "campus.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>

#include <cairn/core/random.hpp>

namespace line_slam {

namespace {

using cairn::SE3;
using cairn::SO3;
using cairn::Vector;

// The way is a rectangle with round corners about the origin.
constexpr double half_length = 38, half_width = 23, corner = 8;  // [m]
constexpr double camera_height = 1.5;                            // [m]

/// A place of the way and its heading, so many metres along it.
std::pair<Vector<2>, double> place_at(double along) {
  constexpr double quarter = corner * std::numbers::pi / 2;
  const double straight[] = {2 * (half_length - corner), 2 * (half_width - corner)};
  const Vector<2> start[] = {{-half_length + corner, -half_width},
                             {half_length, -half_width + corner},
                             {half_length - corner, half_width},
                             {-half_length, half_width - corner}};
  const double around = 2 * (straight[0] + straight[1]) + 4 * quarter;
  along = std::fmod(along, around);
  for (int side = 0;; side = (side + 1) % 4) {
    const double heading = side * std::numbers::pi / 2, length = straight[side % 2];
    const Vector<2> ahead(std::cos(heading), std::sin(heading)), left(-ahead(1), ahead(0));
    if (along < length) return {start[side] + along * ahead, heading};
    along -= length;
    if (along < quarter) {
      const double turn = along / corner;
      return {start[side] + length * ahead + corner * (std::sin(turn) * ahead + (1 - std::cos(turn)) * left),
              heading + turn};
    }
    along -= quarter;
  }
}

}  // namespace

Vector<3> Block::inside(const Vector<3>& p) const {
  const Vector<3> d = p - centre;
  return {cosine * d(0) + sine * d(1), -sine * d(0) + cosine * d(1), d(2)};
}
Vector<3> Block::outside(const Vector<3>& p) const {
  return centre + Vector<3>(cosine * p(0) - sine * p(1), sine * p(0) + cosine * p(1), p(2));
}

std::optional<Block::Entry> Block::entry(const Vector<3>& from, const Vector<3>& direction,
                                         double less) const {
  const Vector<3> p = inside(from), d = inside(centre + direction);
  Entry in{-std::numeric_limits<double>::infinity(), 0};
  double out = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double reach = half(axis) - less;
    if (d(axis) == 0) {
      if (std::abs(p(axis)) >= reach) return std::nullopt;
      continue;
    }
    const double a = (-reach - p(axis)) / d(axis), b = (reach - p(axis)) / d(axis);
    if (std::min(a, b) > in.t) in = {std::min(a, b), axis};
    out = std::min(out, std::max(a, b));
  }
  if (!(in.t < out) || !(in.t > 0)) return std::nullopt;
  return in;
}

Campus::Campus(std::uint64_t seed) {
  cairn::Random random(seed, 1);
  const auto vary = [&](double by) { return random.uniform(-by, by); };
  const auto building = [&](double x, double y, double along, double across) {
    const double height = random.uniform(3, 7);
    add_building({x + vary(0.5), y + vary(0.5), height}, {along + vary(1), across + vary(0.5), height},
                 vary(0.06));
  };
  // Within the way two rows of three, outside of it as many as there is room for.
  for (const double x : {-22.0, 0.0, 22.0})
    for (const double y : {-9.5, 9.5}) building(x, y, 7.5, 5.5);
  for (const double x : {-45.0, -22.0, 0.0, 22.0, 45.0})
    for (const double y : {-35.0, 35.0}) building(x, y, 8, 5);
  for (const double x : {-51.0, 51.0})
    for (const double y : {-11.0, 11.0}) building(x, y, 5.5, 7.5);
  // Posts, benches and tubs beside the way.
  for (double along = 3; along < 229; along += 4) {
    const auto [place, heading] = place_at(along);
    const double side = random.uniform() < 0.5 ? -1 : 1, turned = heading + vary(0.5);
    const Vector<2> at =
        place + side * random.uniform(2.6, 4) * Vector<2>(-std::sin(heading), std::cos(heading));
    const double kind = random.uniform(),
                 height = kind < 0.4 ? random.uniform(0.6, 2) : random.uniform(0.2, 0.6);
    const double length = kind < 0.4 ? 0.2 : random.uniform(0.5, 1);
    add_block({{at(0), at(1), height},
               {length, kind < 0.4 ? 0.2 : 0.3, height},
               std::cos(turned),
               std::sin(turned)});
  }
}

void Campus::add_block(const Block& block) {
  blocks_.push_back(block);
  blocks_.back().radius = block.half.norm();
  const Vector<3>& h = block.half;
  for (int axis = 0; axis < 3; ++axis)
    for (const double i : {-1.0, 1.0})
      for (const double j : {-1.0, 1.0}) {
        Vector<3> a, b;
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        a(axis) = -h(axis);
        b(axis) = h(axis);
        a(u) = b(u) = i * h(u);
        a(v) = b(v) = j * h(v);
        edges_.push_back({block.outside(a), block.outside(b)});
      }
}

void Campus::add_opening(const Opening& o) {
  openings_.push_back(o);
  const Block& block = blocks_[o.block];
  const auto at = [&](double along, double up) {
    Vector<3> p;
    p(o.axis) = o.side * block.half(o.axis);
    p(1 - o.axis) = along;
    p(2) = up;
    return block.outside(p);
  };
  edges_.push_back({at(o.low, o.bottom), at(o.low, o.top)});
  edges_.push_back({at(o.high, o.bottom), at(o.high, o.top)});
  edges_.push_back({at(o.low, o.top), at(o.high, o.top)});
  if (o.bottom > -block.half(2)) edges_.push_back({at(o.low, o.bottom), at(o.high, o.bottom)});
}

/// Walls with two rows of windows, a door in one of them and two steps before it.
void Campus::add_building(const Vector<3>& centre, const Vector<3>& half, double yaw) {
  const auto number = static_cast<std::uint32_t>(blocks_.size());
  const Block building{centre, half, std::cos(yaw), std::sin(yaw)};
  add_block(building);
  for (int axis = 0; axis < 2; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const double length = 2 * half(1 - axis);
      const int windows = static_cast<int>(length / 4);
      for (int w = 0; w < windows; ++w) {
        const double middle = -length / 2 + length * (w + 0.5) / windows;
        const bool door = axis == 1 && w == windows / 2;
        if (door)
          add_opening({number, axis, side, middle - 0.6, middle + 0.6, -half(2), -half(2) + 2.3});
        else
          add_opening({number, axis, side, middle - 0.8, middle + 0.8, -half(2) + 1.1, -half(2) + 2.6});
        add_opening({number, axis, side, middle - 0.8, middle + 0.8, -half(2) + 4.1, -half(2) + 5.4});
        if (!door) continue;
        for (const double depth : {0.4, 0.8}) {
          const double rise = depth < 0.6 ? 0.2 : 0.1;
          const Vector<3> step(middle, side * (half(1) + depth / 2), -half(2) + rise);
          add_block({building.outside(step), {1.2, depth / 2, rise}, building.cosine, building.sine});
        }
      }
    }
}

std::vector<SE3> Campus::drive(double metres, double step) {
  std::vector<SE3> poses;
  for (double along = 0; along <= metres; along += step) {
    const auto [place, heading] = place_at(along);
    cairn::Matrix<3> axes;  // of the camera, in the world: right, down, ahead
    axes << std::sin(heading), 0, std::cos(heading), -std::cos(heading), 0, std::sin(heading), 0, -1, 0;
    poses.emplace_back(SO3::from_matrix(axes), Vector<3>(place(0), place(1), camera_height));
  }
  return poses;
}

bool Campus::sees(const Vector<3>& from, const Vector<3>& to) const {
  constexpr double less = 0.01;  // an edge is no hindrance to itself
  const Vector<3> way = to - from;
  const double length = way.norm();
  return std::ranges::none_of(blocks_, [&](const Block& block) {
    const double reach = length + block.radius;
    if ((block.centre - from).squaredNorm() > reach * reach) return false;
    const auto entry = block.entry(from, way, less);
    return entry && entry->t < 1;
  });
}

std::uint8_t Campus::grey_of(std::uint32_t number, const Block::Entry& entry, const Vector<3>& at) const {
  const Block& block = blocks_[number];
  const Vector<3> p = block.inside(at);
  if (entry.axis < 2)
    for (const Opening& o : openings_) {
      const double along = p(1 - entry.axis);
      if (o.block == number && o.axis == entry.axis && o.side * p(entry.axis) > 0 && along > o.low &&
          along < o.high && p(2) > o.bottom && p(2) < o.top)
        return 50;
    }
  const double faces[] = {p(0) > 0 ? 205.0 : 120.0, p(1) > 0 ? 175.0 : 145.0, 230.0};
  return static_cast<std::uint8_t>(faces[entry.axis] - static_cast<double>(number * 7 % 24));
}

cairn::Image Campus::picture(const cairn::LineCamera& camera, const SE3& rig) const {
  cairn::Image image(camera.camera().width(), camera.camera().height());
  const Vector<3> from = rig * camera.centre();
  // A ray enters a ball that it does not begin in where it is within the ball's cone.
  std::vector<Vector<3>> towards;
  std::vector<double> cosines;
  for (const Block& block : blocks_) {
    const Vector<3> way = block.centre - from;
    const double away = way.norm(), sine = block.radius / away;
    towards.push_back(way / away);
    cosines.push_back(sine < 1 ? std::sqrt(1 - sine * sine) - 1e-9 : -1.0);
  }
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) {
      const Vector<3> ray = rig.rotation().rotate(camera.ray({x, y}));
      const double length = ray.norm();
      double nearest = std::numeric_limits<double>::infinity();
      std::uint8_t grey = 245;  // sky
      if (ray(2) < 0) {
        nearest = -from(2) / ray(2);
        grey = 90;
      }
      for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
        if (ray.dot(towards[b]) < cosines[b] * length) continue;
        const auto entry = blocks_[b].entry(from, ray);
        if (!entry || entry->t >= nearest) continue;
        nearest = entry->t;
        grey = grey_of(b, *entry, from + entry->t * ray);
      }
      image(x, y) = grey;
    }
  return image;
}

}  // namespace line_slam
