// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Other libraries behind one face. Each maker returns null where the library was not found at configure
/// time; scipy's also where it is gone since.
#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "data.hpp"

namespace cairn_bench {

/// Exact search over 3-D points. Distances returned are true ones.
struct StaticRival {
  std::string name;
  std::function<void()> build;
  std::function<float(const Point3&, std::size_t k)> kth_distance;
  std::function<std::size_t(const Point3&, float radius)> count_within;
  /// The same for all queries in one call, by a rival for which a call is dear; it leaves the two above
  /// empty.
  std::function<std::vector<float>(const std::vector<Point3>&, std::size_t k)> kth_distances{};
  std::function<std::vector<std::size_t>(const std::vector<Point3>&, float radius)> counts_within{};
};
std::unique_ptr<StaticRival> make_nanoflann(const std::vector<Point3>& points);
std::unique_ptr<StaticRival> make_flann_single(const std::vector<Point3>& points);
std::unique_ptr<StaticRival> make_cgal(const std::vector<Point3>& points);
std::unique_ptr<StaticRival> make_ann(const std::vector<Point3>& points);
std::unique_ptr<StaticRival> make_pico_tree(const std::vector<Point3>& points);
std::unique_ptr<StaticRival> make_small_gicp(const std::vector<Point3>& points);
std::unique_ptr<StaticRival> make_scipy(const std::vector<Point3>& points);

/// A growing index of 3-D points: nearest one.
struct GrowingRival {
  std::string name;
  std::function<void(std::size_t begin, std::size_t end)> insert;  ///< points [begin, end) of the set
  std::function<float(const Point3&)> nearest;
};
std::unique_ptr<GrowingRival> make_nanoflann_dynamic(const std::vector<Point3>& points);
/// Null where nanoflann is older than 1.10 too.
std::unique_ptr<GrowingRival> make_nanoflann_incremental(const std::vector<Point3>& points);
std::unique_ptr<GrowingRival> make_ikd_tree(const std::vector<Point3>& points);

/// Two nearest descriptors with a budget of checks. Ids count from the first descriptor added.
struct TwoNearest {
  std::size_t id;
  float first;
  float second;
};
/// From two ids and two squared distances a query, one query after the other.
template <class Id>
std::vector<TwoNearest> two_nearest_of(const std::vector<Id>& ids, const std::vector<float>& squares) {
  std::vector<TwoNearest> found(ids.size() / 2);
  for (std::size_t i = 0; i < found.size(); ++i)
    found[i] = {static_cast<std::size_t>(ids[2 * i]), std::sqrt(squares[2 * i]),
                std::sqrt(squares[2 * i + 1])};
  return found;
}

struct DescriptorRival {
  std::string name;
  std::function<void(const float* rows, std::size_t count)> add;
  std::function<std::vector<TwoNearest>(const std::vector<float>& queries, int checks)> search;
  std::function<std::size_t()> bytes{};  ///< held beside the rows that were added; of our own ways
};
/// cairn's cells around means; refers to the rows. A budget is one of blocks.
std::unique_ptr<DescriptorRival> make_our_cells(std::size_t dim, bool with_codes);
std::unique_ptr<DescriptorRival> make_flann_trees(std::size_t dim, int trees);
std::unique_ptr<DescriptorRival> make_hnswlib(std::size_t dim);
/// Only for coordinates that are whole numbers from 0 to 255.
std::unique_ptr<DescriptorRival> make_hnswlib_of_bytes(std::size_t dim);
std::unique_ptr<DescriptorRival> make_faiss_ivf(std::size_t dim);
/// `ef` is that of its construction; 100 and 200 are asked, since neither is always the better.
std::unique_ptr<DescriptorRival> make_symphony_qg(std::size_t dim, std::size_t ef);
std::unique_ptr<DescriptorRival> make_glass(std::size_t dim);

}  // namespace cairn_bench
