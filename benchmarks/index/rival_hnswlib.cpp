// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// hnswlib's graph with the numbers its documentation starts from: M = 16, ef_construction = 200. A budget is
// its ef. Over floats, and over bytes in its own space of bytes, for points that are bytes.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_HNSWLIB
#include <hnswlib/hnswlib.h>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_HNSWLIB
namespace {

/// Coordinates as the graph keeps them.
template <class Coordinate>
std::vector<Coordinate> converted(const float* rows, std::size_t count) {
  std::vector<Coordinate> result(count);
  std::transform(rows, rows + count, result.begin(),
                 [](float number) { return static_cast<Coordinate>(number); });
  return result;
}

template <class Space, class Coordinate, class Distance>
struct Graph {
  Space space;
  std::unique_ptr<hnswlib::HierarchicalNSW<Distance>> graph;
  std::size_t size = 0;
  explicit Graph(std::size_t dim) : space(dim) {}

  void add(const float* rows, std::size_t count, std::size_t dim) {
    if (!graph) graph = std::make_unique<hnswlib::HierarchicalNSW<Distance>>(&space, count, 16, 200);
    if (size + count > graph->getMaxElements()) graph->resizeIndex(2 * (size + count));
    const auto points = converted<Coordinate>(rows, count * dim);
    for (std::size_t i = 0; i < count; ++i) graph->addPoint(points.data() + i * dim, size + i);
    size += count;
  }

  [[nodiscard]] std::vector<TwoNearest> search(const std::vector<float>& queries, std::size_t dim, int ef) {
    graph->setEf(static_cast<std::size_t>(ef));
    const auto points = converted<Coordinate>(queries.data(), queries.size());
    std::vector<TwoNearest> found;
    for (std::size_t i = 0; i < points.size(); i += dim) {
      auto two = graph->searchKnn(points.data() + i, 2);  // the farther one on top
      const float second = std::sqrt(static_cast<float>(two.top().first));
      two.pop();
      found.push_back({two.top().second, std::sqrt(static_cast<float>(two.top().first)), second});
    }
    return found;
  }
};

template <class G>
std::unique_ptr<DescriptorRival> rival_of(const char* name, std::size_t dim) {
  auto held = std::make_shared<G>(dim);
  return std::make_unique<DescriptorRival>(DescriptorRival{
      name, [=](const float* rows, std::size_t count) { held->add(rows, count, dim); },
      [=](const std::vector<float>& queries, int ef) { return held->search(queries, dim, ef); }});
}

}  // namespace

std::unique_ptr<DescriptorRival> make_hnswlib(std::size_t dim) {
  return rival_of<Graph<hnswlib::L2Space, float, float>>("HNSW", dim);
}
std::unique_ptr<DescriptorRival> make_hnswlib_of_bytes(std::size_t dim) {
  return rival_of<Graph<hnswlib::L2SpaceI, std::uint8_t, int>>("HNSW of bytes", dim);
}
#else
std::unique_ptr<DescriptorRival> make_hnswlib(std::size_t) {
  return nullptr;
}
std::unique_ptr<DescriptorRival> make_hnswlib_of_bytes(std::size_t) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
