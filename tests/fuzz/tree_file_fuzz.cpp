// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Tree files: whatever the bytes, there is a tree that can be trusted or an Error. The first byte says which
// kind of tree is wanted, and whether the checksum is made right first, so that what stands behind it is met.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/axis_metrics.hpp>
#include <cairn/index/tree_file.hpp>

#include "fuzz/scratch.hpp"
#include "support/made_up_file.hpp"

namespace {

void require(bool condition, const char* sentence) {
  if (condition) return;
  std::fprintf(stderr, "tree_file_fuzz: %s\n", sentence);
  std::abort();
}

template <class Tree>
std::string saved(const Tree& tree) {
  std::ostringstream out;
  cairn::save_tree(out, tree);
  return out.str();
}

/// Every point once, with a number of its own and coordinates that can be searched.
template <class Tree>
void check_points(const Tree& tree) {
  std::set<cairn::PointId> ids;
  tree.for_each([&](cairn::PointId id, std::span<const typename Tree::Coordinate> row) {
    require(id != cairn::no_point && ids.insert(id).second, "an id that is none, or twice");
    require(row.size() == tree.dimension(), "a point of another dimension");
    for (const auto number : row) require(std::isfinite(static_cast<double>(number)), "not a finite number");
  });
  require(ids.size() == tree.size(), "points are missing");
}

/// The nearest point to the first, under the plain Euclidean metric.
template <class Tree>
void check_search(const Tree& tree) {
  std::vector<std::vector<typename Tree::Real>> rows;
  tree.for_each([&](cairn::PointId, std::span<const typename Tree::Coordinate> row) {
    rows.emplace_back(row.begin(), row.end());
  });
  if (rows.empty()) return;
  const auto hit = tree.nearest(rows.front());
  require(hit && hit->distance == 0, "a point is not found where it is");
  const auto all = tree.within(rows.front(), std::numeric_limits<typename Tree::Real>::infinity());
  require(all.size() == rows.size(), "not all are within infinity");
}

template <class Tree>
void load(const std::string& bytes, typename Tree::Measure metric = {}) {
  std::istringstream in(bytes);
  const Tree tree = [&] {
    try {
      return cairn::load_tree<Tree>(in, "input", metric);
    } catch (const cairn::Error& error) {
      require(std::string_view(error.what()).substr(0, 7) == "input: ", "an Error without the name");
      cairn_fuzz::refused();
      return Tree();
    }
  }();
  check_points(tree);
  if constexpr (!cairn::detail::HasPeriods<typename Tree::Measure>) check_search(tree);
  const std::string written = saved(tree);
  std::istringstream again(written);
  const Tree copy = cairn::load_tree<Tree>(again, "written", metric);
  check_points(copy);
  require(copy.size() == tree.size(), "a written tree reads back with other points");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if ((data[0] & 128U) != 0) cairn_test::sign(bytes, 32);
  switch (data[0] & 7U) {
    case 0:
      load<cairn::KdTree<float, 3>>(bytes);
      break;
    case 1:
      load<cairn::KdTree<float>>(bytes);
      break;
    case 2:
      load<cairn::KdTree<double>>(bytes);
      break;
    case 3:
      load<cairn::KdTree<std::uint8_t>>(bytes);
      break;
    case 4:
      load<cairn::KdTree<std::int16_t>>(bytes);
      break;
    case 5:
      load<cairn::KdTree<std::int32_t, 2>>(bytes);
      break;
    default: {
      using Pose = cairn::Circular<cairn::L2, 2>;
      load<cairn::KdTree<float, 2, Pose>>(bytes, Pose{{cairn::straight, 6.2831853F}});
    }
  }
  return 0;
}
