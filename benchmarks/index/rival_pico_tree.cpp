// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <functional>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_PICO_TREE
#include <pico_tree/array_traits.hpp>
#include <pico_tree/kd_tree.hpp>
#include <pico_tree/vector_traits.hpp>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_PICO_TREE
std::unique_ptr<StaticRival> make_pico_tree(const std::vector<Point3>& points) {
  using Tree = pico_tree::kd_tree<std::reference_wrapper<const std::vector<Point3>>>;
  auto tree = std::make_shared<std::unique_ptr<Tree>>();
  const std::vector<Point3>* kept = &points;
  return std::make_unique<StaticRival>(StaticRival{
      "pico_tree", [=] { *tree = std::make_unique<Tree>(std::cref(*kept), pico_tree::max_leaf_size_t(10)); },
      [=](const Point3& query, std::size_t k) {
        Tree::neighbor_type found[16];
        (*tree)->search_knn(query, found, found + k);
        return std::sqrt(found[k - 1].distance);
      },
      [=](const Point3& query, float radius) {
        std::vector<Tree::neighbor_type> found;
        (*tree)->search_radius(query, radius * radius, found);
        return found.size();
      }});
}
#else
std::unique_ptr<StaticRival> make_pico_tree(const std::vector<Point3>&) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
