// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// nanoflann as Debian has it (1.4) or newer, by -DCAIRN_NANOFLANN_DIR; its index that balances itself while
// it grows came with 1.10.
#include <cmath>
#include <cstdint>
#include <utility>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_NANOFLANN
#include <nanoflann.hpp>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_NANOFLANN
namespace {

struct Cloud {
  const std::vector<Point3>* points;
  std::size_t visible = 0;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return visible; }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const { return (*points)[i][axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
#if NANOFLANN_VERSION >= 0x150
using Options = nanoflann::SearchParameters;
using Found = nanoflann::ResultItem<std::uint32_t, float>;
const Options unsorted(0, false);
#else
using Options = nanoflann::SearchParams;
using Found = std::pair<std::uint32_t, float>;
const Options unsorted(32, 0, false);
#endif
using Distance = nanoflann::L2_Simple_Adaptor<float, Cloud>;
using Static = nanoflann::KDTreeSingleIndexAdaptor<Distance, Cloud, 3, std::uint32_t>;
using Dynamic = nanoflann::KDTreeSingleIndexDynamicAdaptor<Distance, Cloud, 3, std::uint32_t>;

}  // namespace

std::unique_ptr<StaticRival> make_nanoflann(const std::vector<Point3>& points) {
  auto cloud = std::make_shared<Cloud>(Cloud{&points, points.size()});
  auto tree = std::make_shared<std::unique_ptr<Static>>();
  return std::make_unique<StaticRival>(StaticRival{
      "nanoflann",
      [=] {
        *tree = std::make_unique<Static>(3, *cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10));
        (*tree)->buildIndex();
      },
      [=](const Point3& query, std::size_t k) {
        std::uint32_t ids[16];
        float squares[16];
        (*tree)->knnSearch(query.data(), k, ids, squares);
        return std::sqrt(squares[k - 1]);
      },
      [=](const Point3& query, float radius) {
        std::vector<Found> found;
        return (*tree)->radiusSearch(query.data(), radius * radius, found, unsorted);
      }});
}

namespace {

template <class Tree>
std::unique_ptr<GrowingRival> growing(const std::string& name, std::shared_ptr<Cloud> cloud,
                                      std::shared_ptr<Tree> tree) {
  return std::make_unique<GrowingRival>(GrowingRival{name,
                                                     [=](std::size_t begin, std::size_t end) {
                                                       cloud->visible = end;
                                                       tree->addPoints(static_cast<std::uint32_t>(begin),
                                                                       static_cast<std::uint32_t>(end - 1));
                                                     },
                                                     [=](const Point3& query) {
                                                       std::size_t id = 0;
                                                       float square = 0;
                                                       nanoflann::KNNResultSet<float> result(1);
                                                       result.init(&id, &square);
                                                       tree->findNeighbors(result, query.data(), Options());
                                                       return std::sqrt(square);
                                                     }});
}

}  // namespace

std::unique_ptr<GrowingRival> make_nanoflann_dynamic(const std::vector<Point3>& points) {
  auto cloud = std::make_shared<Cloud>(Cloud{&points});
  auto tree =
      std::make_shared<Dynamic>(3, *cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10), points.size());
  return growing("nanoflann dynamic", std::move(cloud), std::move(tree));
}

std::unique_ptr<GrowingRival> make_nanoflann_incremental(const std::vector<Point3>& points) {
#if NANOFLANN_VERSION >= 0x10A00
  auto cloud = std::make_shared<Cloud>(Cloud{&points});
  auto tree =
      std::make_shared<nanoflann::KDTreeSingleIndexIncrementalAdaptor<Distance, Cloud, 3, std::uint32_t>>(
          3, *cloud);
  return growing("nanoflann incremental", std::move(cloud), std::move(tree));
#else
  static_cast<void>(points);
  return nullptr;
#endif
}
#else
std::unique_ptr<StaticRival> make_nanoflann(const std::vector<Point3>&) {
  return nullptr;
}
std::unique_ptr<GrowingRival> make_nanoflann_dynamic(const std::vector<Point3>&) {
  return nullptr;
}
std::unique_ptr<GrowingRival> make_nanoflann_incremental(const std::vector<Point3>&) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
