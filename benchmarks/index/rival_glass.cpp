// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// pyglass: its HNSW of degree 32 and ef of construction 200 over its own eight-bit codes, which its examples
// take. A budget is its ef. It finds ids by codes; the nearest ten of them are ranked here by true distances,
// as its own refining does. Compiled for this processor: it has no other way.
#include "rivals.hpp"

#ifdef CAIRN_BENCH_GLASS
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <span>
#include <utility>

#include <fcntl.h>
#include <glass/hnsw/hnsw.hpp>
#include <glass/searcher/graph_searcher.hpp>
#include <unistd.h>
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_GLASS
namespace {

/// Standard output goes nowhere for as long as this lives: the library reports its progress there.
class Silence {
public:
  Silence() : kept_(0) {
    std::fflush(stdout);
    kept_ = dup(STDOUT_FILENO);
    const int nowhere = open("/dev/null", O_WRONLY);
    dup2(nowhere, STDOUT_FILENO);
    close(nowhere);
  }
  ~Silence() {
    std::fflush(stdout);
    dup2(kept_, STDOUT_FILENO);
    close(kept_);
  }

private:
  int kept_;
};

struct Glass {
  std::unique_ptr<glass::GraphSearcherBase> searcher;
  std::vector<float> rows;
  std::size_t dim;
  explicit Glass(std::size_t dimension) : dim(dimension) {}

  void build(const float* from, std::size_t count) {
    rows.assign(from, from + count * dim);
    const Silence silence;
    const auto n = static_cast<std::int32_t>(count);
    const auto d = static_cast<std::int32_t>(dim);
    auto graph = glass::create_hnsw("L2", "SQ8U", 32, 200)->Build(rows.data(), n, d);
    searcher = glass::create_searcher(std::move(graph), "L2", "SQ8U");
    searcher->SetData(rows.data(), n, d);
    searcher->Optimize(1);
  }

  [[nodiscard]] float square(const float* query, std::int32_t id) const {
    const float* row = &rows[static_cast<std::size_t>(id) * dim];
    float sum = 0;
    for (std::size_t a = 0; a < dim; ++a) sum += (query[a] - row[a]) * (query[a] - row[a]);
    return sum;
  }

  [[nodiscard]] std::vector<TwoNearest> search(const std::vector<float>& queries, int ef) {
    constexpr std::size_t most = 10;
    searcher->SetEf(ef);
    const std::size_t asked = std::clamp<std::size_t>(static_cast<std::size_t>(ef), 2, most);
    std::vector<TwoNearest> found(queries.size() / dim);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const float* query = &queries[i * dim];
      std::array<std::int32_t, most> ids;
      searcher->Search(query, static_cast<std::int32_t>(asked), ids.data());
      std::array<std::pair<float, std::int32_t>, most> ranked;
      for (std::size_t k = 0; k < asked; ++k) ranked[k] = {square(query, ids[k]), ids[k]};
      std::partial_sort(ranked.begin(), ranked.begin() + 2,
                        ranked.begin() + static_cast<std::ptrdiff_t>(asked));
      found[i] = {static_cast<std::size_t>(ranked[0].second), std::sqrt(ranked[0].first),
                  std::sqrt(ranked[1].first)};
    }
    return found;
  }
};

}  // namespace

std::unique_ptr<DescriptorRival> make_glass(std::size_t dim) {
  auto held = std::make_shared<Glass>(dim);
  return std::make_unique<DescriptorRival>(
      DescriptorRival{"pyglass", [=](const float* rows, std::size_t count) { held->build(rows, count); },
                      [=](const std::vector<float>& queries, int ef) { return held->search(queries, ef); }});
}
#else
std::unique_ptr<DescriptorRival> make_glass(std::size_t) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
