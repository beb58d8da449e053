// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// SymphonyQG of RaBitQ-Library with the degree that its documentation starts from, 32. A budget is its ef. It
// gives ids; the distances are made here, as its own programs do where they need them. Compiled for this
// processor: it has no other way.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <sstream>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_RABITQ
#include <rabitqlib/index/symqg/qg.hpp>
#include <rabitqlib/index/symqg/qg_builder.hpp>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_RABITQ
namespace {

struct QuantizedGraph {
  std::unique_ptr<rabitqlib::symqg::QuantizedGraph<float>> graph;
  std::vector<float> rows;
  std::size_t dim;
  std::size_t ef_of_construction;
  QuantizedGraph(std::size_t dimension, std::size_t ef) : dim(dimension), ef_of_construction(ef) {}

  void build(const float* from, std::size_t count) {
    rows.assign(from, from + count * dim);
    std::ostringstream silent;  // it reports its progress
    std::streambuf* const out = std::cout.rdbuf(silent.rdbuf());
    graph = std::make_unique<rabitqlib::symqg::QuantizedGraph<float>>(count, dim, 32, rabitqlib::METRIC_L2);
    rabitqlib::symqg::QGBuilder(*graph, ef_of_construction, rows.data(), 1).build();
    std::cout.rdbuf(out);
  }

  [[nodiscard]] std::vector<TwoNearest> search(const std::vector<float>& queries, int ef) {
    graph->set_ef(static_cast<std::size_t>(ef));
    std::vector<TwoNearest> found(queries.size() / dim);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const float* query = queries.data() + i * dim;
      rabitqlib::PID ids[2];
      graph->search(query, 2, ids);
      float distances[2];
      for (int k = 0; k < 2; ++k) {
        float sum = 0;
        for (std::size_t a = 0; a < dim; ++a)
          sum += (query[a] - rows[ids[k] * dim + a]) * (query[a] - rows[ids[k] * dim + a]);
        distances[k] = std::sqrt(sum);
      }
      const bool swapped = distances[1] < distances[0];
      found[i] = {ids[swapped ? 1 : 0], distances[swapped ? 1 : 0], distances[swapped ? 0 : 1]};
    }
    return found;
  }
};

}  // namespace

std::unique_ptr<DescriptorRival> make_symphony_qg(std::size_t dim, std::size_t ef) {
  auto held = std::make_shared<QuantizedGraph>(dim, ef);
  return std::make_unique<DescriptorRival>(
      DescriptorRival{"SymphonyQG ef " + std::to_string(ef),
                      [=](const float* rows, std::size_t count) { held->build(rows, count); },
                      [=](const std::vector<float>& queries, int ef) { return held->search(queries, ef); }});
}
#else
std::unique_ptr<DescriptorRival> make_symphony_qg(std::size_t, std::size_t) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
