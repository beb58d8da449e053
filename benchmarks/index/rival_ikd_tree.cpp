// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// ikd-Tree: one tree that is rebalanced in parts, large parts by a thread of its own. Its source is included,
// since it comes without a library, and needs the headers of PCL.
#include <cmath>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_IKD_TREE
#include <ikd_Tree.cpp>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_IKD_TREE
std::unique_ptr<GrowingRival> make_ikd_tree(const std::vector<Point3>& points) {
  using Tree = KD_TREE<ikdTree_PointType>;
  auto tree = std::make_shared<Tree>();
  const std::vector<Point3>* kept = &points;
  return std::make_unique<GrowingRival>(
      GrowingRival{"ikd-Tree",
                   [=](std::size_t begin, std::size_t end) {
                     Tree::PointVector added;
                     for (std::size_t i = begin; i < end; ++i)
                       added.emplace_back((*kept)[i][0], (*kept)[i][1], (*kept)[i][2]);
                     if (begin == 0)
                       tree->Build(added);
                     else
                       tree->Add_Points(added, false);
                   },
                   [=](const Point3& query) {
                     Tree::PointVector found;
                     std::vector<float> squares;
                     tree->Nearest_Search({query[0], query[1], query[2]}, 1, found, squares);
                     return std::sqrt(squares.front());
                   }});
}
#else
std::unique_ptr<GrowingRival> make_ikd_tree(const std::vector<Point3>&) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
