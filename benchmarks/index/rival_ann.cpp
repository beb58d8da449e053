// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// ANN's kd-tree (sliding midpoint), which computes in double.
#include <cmath>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_ANN
#include <ANN/ANN.h>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_ANN
namespace {

struct Cloud {
  std::vector<double> numbers;
  std::vector<double*> rows;
  std::unique_ptr<ANNkd_tree> tree;
};

}  // namespace

std::unique_ptr<StaticRival> make_ann(const std::vector<Point3>& points) {
  auto cloud = std::make_shared<Cloud>();
  for (const Point3& p : points) cloud->numbers.insert(cloud->numbers.end(), p.begin(), p.end());
  for (std::size_t i = 0; i < points.size(); ++i) cloud->rows.push_back(&cloud->numbers[3 * i]);
  return std::make_unique<StaticRival>(StaticRival{
      "ANN",
      [=] {
        cloud->tree =
            std::make_unique<ANNkd_tree>(cloud->rows.data(), static_cast<int>(cloud->rows.size()), 3, 10);
      },
      [=](const Point3& query, std::size_t k) {
        double at[] = {query[0], query[1], query[2]}, squares[16];
        int ids[16];
        cloud->tree->annkSearch(at, static_cast<int>(k), ids, squares);
        return static_cast<float>(std::sqrt(squares[k - 1]));
      },
      [=](const Point3& query, float radius) {
        double at[] = {query[0], query[1], query[2]};
        return static_cast<std::size_t>(cloud->tree->annkFRSearch(at, double(radius) * radius));
      }});
}
#else
std::unique_ptr<StaticRival> make_ann(const std::vector<Point3>&) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
