// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// faiss's inverted lists: points lie in cells around means and keep their floats. A budget is its nprobe, the
// cells looked into. faiss advises 4 sqrt(n) to 16 sqrt(n) cells: for 99 % of the matches among 99,000 SIFT
// descriptors 4, 8 and 16 took 330, 140 and 160 us a query and 11, 23 and 53 s to build (AVX-512, busy
// machine). Debian compiles its distances for one number at a time; a faiss compiled for the processor, given
// by path, searched in half to two thirds of the time.
#include <algorithm>
#include <cmath>

#include "rivals.hpp"

#ifdef CAIRN_BENCH_FAISS
#include <faiss/IndexFlat.h>
#include <faiss/IndexIVFFlat.h>
#include <omp.h>

extern "C" void openblas_set_num_threads(int);
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_FAISS
namespace {

/// All contenders run alone. OpenBLAS may have threads of its own.
void one_thread() {
  omp_set_num_threads(1);
  openblas_set_num_threads(1);
}

struct Lists {
  std::unique_ptr<faiss::IndexFlatL2> means;
  std::unique_ptr<faiss::IndexIVFFlat> index;  // refers to the means

  void add(const float* rows, std::size_t count, std::size_t dim) {
    one_thread();
    const auto size = static_cast<faiss::Index::idx_t>(count);
    if (!index) {
      const double share = count <= 200000 ? 8 : 4;  // a million around 8000 means take minutes to build
      const auto cells = std::max(1L, std::lround(share * std::sqrt(static_cast<double>(count))));
      means = std::make_unique<faiss::IndexFlatL2>(static_cast<faiss::Index::idx_t>(dim));
      index = std::make_unique<faiss::IndexIVFFlat>(means.get(), dim, static_cast<std::size_t>(cells));
      index->cp.max_points_per_centroid = 39;  // what faiss calls enough; of more it takes a sample
      index->cp.min_points_per_centroid = 1;   // or it would warn of 10^4 points, 12 a cell
      index->train(size, rows);
    }
    index->add(size, rows);
  }
};

}  // namespace

std::unique_ptr<DescriptorRival> make_faiss_ivf(std::size_t dim) {
  auto lists = std::make_shared<Lists>();
  return std::make_unique<DescriptorRival>(DescriptorRival{
      "faiss IVF", [=](const float* rows, std::size_t count) { lists->add(rows, count, dim); },
      [=](const std::vector<float>& queries, int probes) {
        one_thread();
        const std::size_t count = queries.size() / dim;
        std::vector<faiss::Index::idx_t> ids(2 * count);
        std::vector<float> squares(2 * count);
        lists->index->nprobe = static_cast<std::size_t>(probes);
        lists->index->search(static_cast<faiss::Index::idx_t>(count), queries.data(), 2, squares.data(),
                             ids.data());
        return two_nearest_of(ids, squares);
      }});
}
#else
std::unique_ptr<DescriptorRival> make_faiss_ivf(std::size_t) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
