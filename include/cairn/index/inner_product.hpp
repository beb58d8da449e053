// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The points of the largest inner products with a query, by an index of distances.
///
/// ```cpp
/// const cairn::InnerProductPoints lifted(descriptors);       // refers to them
/// const cairn::DescriptorIndex index(lifted);
/// for (const auto& hit : cairn::largest_products(index, lifted, query, 5, {.leaves = 64}))
///   use(hit.id, hit.product);
/// ```
///
/// A point p gets one coordinate more, sqrt(M^2 - |p|^2), where M is the norm of the longest, and a query one
/// that is zero: |q - p|^2 becomes |q|^2 + M^2 - 2 q.p, so that the nearest point is that of the largest
/// product (Bachrach et al., "Speeding up the Xbox recommender system using a Euclidean transformation for
/// inner-product spaces", RecSys 2014, theorem 1). Products of what is found are taken from the points
/// themselves. Points of one length (learned features as a rule) need nothing of this: their order by
/// distance is that by product.
///
/// Distances of points lifted far above their own spread say little: where |p| differs a lot, an index visits
/// more for the same answer. Two products closer to each other than rounding at M^2 may come in either order.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Points with one coordinate more. Refers to the set, which must live as long; what joins it afterwards is
/// seen after extend().
template <class Points>
  requires(PointSet<Points> || detail::explain_points<Points>)
class InnerProductPoints {
public:
  /// One point, seen so; valid as long as the set's point is.
  class View {
  public:
    using size_type = std::size_t;
    [[nodiscard]] std::size_t size() const noexcept { return lifted_->dimension(); }
    [[nodiscard]] float operator[](std::size_t axis) const {
      return axis < lifted_->dim_ ? detail::coordinate<float>((*lifted_->points_)[i_], axis)
                                  : lifted_->heights_[i_];
    }

  private:
    friend class InnerProductPoints;
    View(const InnerProductPoints* lifted, std::size_t i) : lifted_(lifted), i_(i) {}
    const InnerProductPoints* lifted_;
    std::size_t i_;
  };

  /// `longest`: no point that joins later may be longer; 0: the longest of those that are there. Throws
  /// Error, naming the point, where one is longer than that, not finite, or of another dimension. O(n dim).
  explicit InnerProductPoints(const Points& points, float longest = 0) : points_(&points), longest_(longest) {
    if (!(longest >= 0 && longest < std::numeric_limits<float>::infinity()))
      raise("InnerProductPoints: the longest point is " + std::to_string(longest) +
            " long, expected a finite number that is not negative");
    if (longest == 0)
      for (const double square : squares_from(0).squares) longest_ = std::max(longest_, norm_of(square));
    extend();
  }
  explicit InnerProductPoints(const Points&&, float = 0) = delete;  ///< would be gone

  /// Takes notice of points that have joined the set. Throws as the constructor, and has changed nothing
  /// then.
  void extend() {
    const std::size_t first = heights_.size();
    const auto [dim, squares] = squares_from(first);
    std::vector<float> heights(heights_);
    const double most = double{longest_} * double{longest_};
    for (std::size_t i = 0; i < squares.size(); ++i) {
      if (norm_of(squares[i]) > longest_)
        raise("InnerProductPoints: point " + std::to_string(first + i) + " is " +
              std::to_string(norm_of(squares[i])) + " long, expected at most " + std::to_string(longest_));
      heights.push_back(static_cast<float>(std::sqrt(std::max(0.0, most - squares[i]))));
    }
    dim_ = dim;
    heights_ = std::move(heights);
  }

  [[nodiscard]] std::size_t size() const noexcept { return heights_.size(); }
  /// One more than the points'.
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_ + 1; }
  [[nodiscard]] View operator[](std::size_t i) const& { return View(this, i); }
  View operator[](std::size_t) const&& = delete;  ///< the view would refer to what is gone
  [[nodiscard]] float longest() const noexcept { return longest_; }

  /// A query with its zero. Throws Error where it is not finite or of another dimension than the points.
  template <QueryPoint Query>
  [[nodiscard]] std::vector<float> lifted(const Query& query) const {
    std::vector<float> row(dim_ + 1, 0.0F);
    detail::copy_point<float>(query, dim_, row.data(), {"InnerProductPoints: query", 0});
    return row;
  }
  /// q.p for a query from lifted(), summed in double.
  [[nodiscard]] float product(const std::vector<float>& query, PointId id) const {
    double sum = 0;
    for (std::size_t a = 0; a < dim_; ++a)
      sum += double{query[a]} * double{detail::coordinate<float>((*points_)[id], a)};
    return static_cast<float>(sum);
  }

private:
  /// The smallest float that is no less than the norm.
  [[nodiscard]] static float norm_of(double square) noexcept {
    const double norm = std::sqrt(square);
    const auto rounded = static_cast<float>(norm);
    return double{rounded} < norm ? std::nextafter(rounded, std::numeric_limits<float>::infinity()) : rounded;
  }

  /// Squared norms of points, and how many coordinates these have.
  struct Squares {
    std::size_t dim;
    std::vector<double> squares;
  };
  [[nodiscard]] Squares squares_from(std::size_t first) const {
    const auto count = static_cast<std::size_t>(points_->size());
    detail::check_count(count, "InnerProductPoints: point");
    Squares found{dim_ == 0 && count > 0 ? detail::dimension_of<dynamic_dim>(*points_) : dim_, {}};
    if (found.dim == 0 && count > 0)
      raise("InnerProductPoints: point: a point needs at least one coordinate");
    std::vector<float> row(found.dim);
    for (std::size_t i = first; i < count; ++i) {
      detail::copy_point<float>((*points_)[i], row.size(), row.data(), {"InnerProductPoints: point", i});
      double sum = 0;
      for (const float number : row) sum += double{number} * double{number};
      found.squares.push_back(sum);
    }
    return found;
  }

  const Points* points_;
  std::size_t dim_ = 0;
  float longest_ = 0;
  std::vector<float> heights_;
};

/// A point and its inner product with the query.
struct ProductHit {
  PointId id = no_point;
  float product = 0;
  bool operator==(const ProductHit&) const = default;
};

/// The k points of the largest products with the query, largest first, of equal ones the smaller id: of all
/// or, under a budget, of those that the search meets. `index` is one over `points`. Throws as lifted().
template <class Index, PointSet Points, QueryPoint Query>
[[nodiscard]] std::vector<ProductHit> largest_products(const Index& index,
                                                       const InnerProductPoints<Points>& points,
                                                       const Query& query, std::size_t k,
                                                       Budget budget = {}) {
  if (index.size() == 0) return {};
  const std::vector<float> row = points.lifted(query);
  std::vector<ProductHit> hits;
  for (const auto& neighbour : index.nearest(row, k, budget))
    hits.push_back({neighbour.id, points.product(row, neighbour.id)});
  std::sort(hits.begin(), hits.end(), [](const ProductHit& a, const ProductHit& b) {
    return a.product != b.product ? a.product > b.product : a.id < b.id;
  });
  return hits;
}

}}  // namespace cairn::CAIRN_ABI
