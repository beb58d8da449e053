// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_FLANN
#include <flann/flann.hpp>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_FLANN
namespace {

using Index = flann::Index<flann::L2<float>>;
using Floats = flann::Matrix<float>;

Floats matrix(const float* rows, std::size_t count, std::size_t dim) {
  return Floats(const_cast<float*>(rows), count, dim);
}

}  // namespace

std::unique_ptr<StaticRival> make_flann_single(const std::vector<Point3>& points) {
  using Single = flann::Index<flann::L2_Simple<float>>;
  auto tree = std::make_shared<std::unique_ptr<Single>>();
  const flann::SearchParams params(flann::FLANN_CHECKS_UNLIMITED, 0.0F, false);
  return std::make_unique<StaticRival>(
      StaticRival{"FLANN",
                  [=, &points] {
                    *tree = std::make_unique<Single>(matrix(points[0].data(), points.size(), 3),
                                                     flann::KDTreeSingleIndexParams(10));
                    (*tree)->buildIndex();
                  },
                  [=](const Point3& query, std::size_t k) {
                    int ids[16];
                    float squares[16];
                    flann::Matrix<int> id_matrix(ids, 1, k);
                    Floats square_matrix(squares, 1, k);
                    (*tree)->knnSearch(matrix(query.data(), 1, 3), id_matrix, square_matrix, k, params);
                    return std::sqrt(squares[k - 1]);
                  },
                  [=](const Point3& query, float radius) {
                    std::vector<std::vector<int>> ids;
                    std::vector<std::vector<float>> squares;
                    (*tree)->radiusSearch(matrix(query.data(), 1, 3), ids, squares, radius * radius, params);
                    return ids[0].size();
                  }});
}

std::unique_ptr<DescriptorRival> make_flann_trees(std::size_t dim, int trees) {
  auto rows_held =
      std::make_shared<std::vector<std::vector<float>>>();  // FLANN points into the caller's memory
  auto index = std::make_shared<std::unique_ptr<Index>>();
  return std::make_unique<DescriptorRival>(
      DescriptorRival{"FLANN " + std::to_string(trees) + " trees",
                      [=](const float* rows, std::size_t count) {
                        rows_held->emplace_back(rows, rows + count * dim);
                        const Floats added = matrix(rows_held->back().data(), count, dim);
                        if (*index) return (*index)->addPoints(added, 2.0F);
                        *index = std::make_unique<Index>(added, flann::KDTreeIndexParams(trees));
                        (*index)->buildIndex();
                      },
                      [=](const std::vector<float>& queries, int checks) {
                        const std::size_t count = queries.size() / dim;
                        std::vector<int> ids(2 * count);
                        std::vector<float> squares(2 * count);
                        flann::Matrix<int> id_matrix(ids.data(), count, 2);
                        Floats square_matrix(squares.data(), count, 2);
                        (*index)->knnSearch(matrix(queries.data(), count, dim), id_matrix, square_matrix, 2,
                                            flann::SearchParams(checks));
                        return two_nearest_of(ids, squares);
                      }});
}
#else
std::unique_ptr<StaticRival> make_flann_single(const std::vector<Point3>&) {
  return nullptr;
}
std::unique_ptr<DescriptorRival> make_flann_trees(std::size_t, int) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
