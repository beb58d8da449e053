// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The rival of the shared kd-tree: points in the buckets of a plane of shared tiles. Buckets are squares of
/// a few metres, each counted of its own, so that the copy of a tile copies pointers.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include <cairn/core/counted.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>

namespace cairn_bench {

class SharedBuckets {
public:
  using Point = std::array<double, 2>;

  explicit SharedBuckets(double side = 6) : geometry_{.cell_size = side} {}

  void insert(const Point& point, std::uint32_t id) {
    tiles_.write(cell(point)).own().push_back({point, id});
  }
  bool erase(const Point& point, std::uint32_t id) {
    const auto is_it = [&](const Entry& e) { return e.id == id && e.point == point; };
    const std::vector<Entry>* held = tiles_.read(cell(point)).get();
    if (held == nullptr || std::none_of(held->begin(), held->end(), is_it)) return false;
    std::vector<Entry>& own = tiles_.write(cell(point)).own();
    own.erase(std::find_if(own.begin(), own.end(), is_it));
    return true;
  }
  template <class Visit>
  void for_each_in_box(const Point& low, const Point& high, Visit&& visit) const {
    const cairn::CellAddress first = cell(low), last = cell(high);
    for (std::int32_t row = first.row; row <= last.row; ++row)
      for (std::int32_t column = first.column; column <= last.column; ++column)
        if (const auto* bucket = tiles_.read({column, row}).get())
          for (const Entry& e : *bucket)
            if (low[0] <= e.point[0] && e.point[0] <= high[0] && low[1] <= e.point[1] &&
                e.point[1] <= high[1])
              visit(e.id, e.point);
  }

private:
  struct Entry {
    Point point;
    std::uint32_t id;
  };
  [[nodiscard]] cairn::CellAddress cell(const Point& p) const { return geometry_.cell_of(p[0], p[1]); }

  cairn::GridGeometry geometry_;
  cairn::SharedTiles<cairn::Counted<std::vector<Entry>>> tiles_;
};

/// Plain copies: all points in one vector.
class PlainPoints {
public:
  using Point = std::array<double, 2>;

  void insert(const Point& point, std::uint32_t id) { all_.push_back({point, id}); }
  bool erase(const Point& point, std::uint32_t id) {
    const auto at = std::find_if(all_.begin(), all_.end(),
                                 [&](const Entry& e) { return e.id == id && e.point == point; });
    if (at == all_.end()) return false;
    *at = all_.back();
    all_.pop_back();
    return true;
  }
  template <class Visit>
  void for_each_in_box(const Point& low, const Point& high, Visit&& visit) const {
    for (const Entry& e : all_)
      if (low[0] <= e.point[0] && e.point[0] <= high[0] && low[1] <= e.point[1] && e.point[1] <= high[1])
        visit(e.id, e.point);
  }

private:
  struct Entry {
    Point point;
    std::uint32_t id;
  };
  std::vector<Entry> all_;
};

}  // namespace cairn_bench
