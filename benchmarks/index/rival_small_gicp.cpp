// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// small_gicp's kd-tree, which takes points of four doubles and has no search within a radius.
#include <cmath>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_SMALL_GICP
#include <iostream>

#include <small_gicp/ann/kdtree.hpp>
#include <small_gicp/points/point_cloud.hpp>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_SMALL_GICP
std::unique_ptr<StaticRival> make_small_gicp(const std::vector<Point3>& points) {
  using Tree = small_gicp::UnsafeKdTree<small_gicp::PointCloud>;
  std::vector<Eigen::Vector3f> copies;
  for (const Point3& point : points) copies.emplace_back(point[0], point[1], point[2]);
  auto cloud = std::make_shared<small_gicp::PointCloud>(copies);
  auto tree = std::make_shared<std::unique_ptr<Tree>>();
  StaticRival rival;
  rival.name = "small_gicp";
  rival.build = [=] { *tree = std::make_unique<Tree>(*cloud); };
  rival.kth_distance = [=](const Point3& query, std::size_t k) {
    std::size_t ids[16];
    double squares[16];
    const Eigen::Vector4d point(query[0], query[1], query[2], 1.0);
    if (k == 1)
      (*tree)->nearest_neighbor_search(point, ids, squares);
    else
      (*tree)->knn_search(point, static_cast<int>(k), ids, squares);
    return static_cast<float>(std::sqrt(squares[k - 1]));
  };
  return std::make_unique<StaticRival>(std::move(rival));
}
#else
std::unique_ptr<StaticRival> make_small_gicp(const std::vector<Point3>&) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
