// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// hnswlib's graph with the numbers its documentation starts from: M = 16, ef_construction = 200. A budget is
// its ef.
#include <cmath>
#include <cstdint>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_HNSWLIB
#include <hnswlib/hnswlib.h>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_HNSWLIB
namespace {

struct Graph {
  hnswlib::L2Space space;
  std::unique_ptr<hnswlib::HierarchicalNSW<float>> graph;
  std::size_t size = 0;
  explicit Graph(std::size_t dim) : space(dim) {}

  void add(const float* rows, std::size_t count, std::size_t dim) {
    if (!graph) graph = std::make_unique<hnswlib::HierarchicalNSW<float>>(&space, count, 16, 200);
    if (size + count > graph->getMaxElements()) graph->resizeIndex(2 * (size + count));
    for (std::size_t i = 0; i < count; ++i) graph->addPoint(rows + i * dim, size + i);
    size += count;
  }
};

}  // namespace

std::unique_ptr<DescriptorRival> make_hnswlib(std::size_t dim) {
  auto held = std::make_shared<Graph>(dim);
  return std::make_unique<DescriptorRival>(
      DescriptorRival{"HNSW", [=](const float* rows, std::size_t count) { held->add(rows, count, dim); },
                      [=](const std::vector<float>& queries, int ef) {
                        held->graph->setEf(static_cast<std::size_t>(ef));
                        std::vector<TwoNearest> found;
                        for (std::size_t i = 0; i < queries.size(); i += dim) {
                          auto two = held->graph->searchKnn(queries.data() + i, 2);  // the farther one on top
                          const float second = std::sqrt(two.top().first);
                          two.pop();
                          found.push_back({two.top().second, std::sqrt(two.top().first), second});
                        }
                        return found;
                      }});
}
#else
std::unique_ptr<DescriptorRival> make_hnswlib(std::size_t) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
