// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <iterator>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_CGAL
#include <CGAL/Fuzzy_sphere.h>
#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits_3.h>
#include <CGAL/Simple_cartesian.h>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_CGAL
std::unique_ptr<StaticRival> make_cgal(const std::vector<Point3>& points) {
  using Kernel = CGAL::Simple_cartesian<float>;
  using Traits = CGAL::Search_traits_3<Kernel>;
  using Search = CGAL::Orthogonal_k_neighbor_search<Traits>;
  using Tree = Search::Tree;
  const auto to_point = [](const Point3& p) { return Kernel::Point_3(p[0], p[1], p[2]); };
  auto tree = std::make_shared<std::unique_ptr<Tree>>();
  return std::make_unique<StaticRival>(StaticRival{
      "CGAL",
      [=, &points] {
        *tree = std::make_unique<Tree>();
        for (const Point3& point : points) (*tree)->insert(to_point(point));
        (*tree)->build();
      },
      [=](const Point3& query, std::size_t k) {
        const Search search(**tree, to_point(query), static_cast<unsigned>(k));
        float last = 0;
        for (const auto& hit : search) last = hit.second;
        return std::sqrt(last);
      },
      [=](const Point3& query, float radius) {
        std::vector<Kernel::Point_3> found;
        (*tree)->search(std::back_inserter(found), CGAL::Fuzzy_sphere<Traits>(to_point(query), radius));
        return found.size();
      }});
}
#else
std::unique_ptr<StaticRival> make_cgal(const std::vector<Point3>&) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
