// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Matching by the ratio test: the nearest point is a match where the second nearest is clearly farther
/// (Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 60, 2004, section 7.1).
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/metric.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Accept when the second is clearly farther than the first and first <= max_distance, in true distances.
///
/// The ratio may be written either way: from 1 on it is second / first, at least (1.25); below 1 it is
/// first / second, at most, as Lowe's paper and OpenCV's tutorials have it (0.8, which is the same test). At
/// 1 every nearest point passes. It must be positive, and max_distance not negative.
struct RatioTest {
  float ratio = 2.0F;
  float max_distance = std::numeric_limits<float>::infinity();

  /// The least second / first, whichever way the ratio was written.
  [[nodiscard]] float least_ratio() const noexcept { return ratio < 1 ? 1 / ratio : ratio; }
};

namespace detail {

/// Breaks off where no ratio test can be made of the numbers.
inline void check_ratio_test(const RatioTest& test) {
  CAIRN_EXPECTS(test.ratio >= 1e-6F && test.ratio <= 1e6F,
                "RatioTest: the ratio of distances must lie between 1e-6 and 1e6");
  CAIRN_EXPECTS(test.max_distance >= 0, "RatioTest: max_distance must not be negative");
}

/// The nearest two that were offered, and what the ratio test makes of them.
template <class Real, class M>
class RatioTestState {
  static_assert(is_homogeneous<M>,
                "ratios of reduced distances say nothing about those of true ones in this metric: "
                "collect NearestTwo and compare what it restores");

public:
  using Measure = M;

  /// `metric` turns the test's true distances into reduced ones (L2: squares).
  explicit RatioTestState(const RatioTest& test, M metric = {}) : metric_(std::move(metric)) {
    check_ratio_test(test);
    ratio_ = metric_.reduce(static_cast<Real>(test.least_ratio()));
    nearest_allowed_ = largest_reduced(metric_, static_cast<Real>(test.max_distance));
    limit_ = std::nextafter(std::min(std::numeric_limits<Real>::max(), ratio_ * nearest_allowed_), infinity);
  }

  /// Points as far as this or farther change nothing.
  [[nodiscard]] Real limit() const noexcept { return limit_; }

  /// Whether the nearest is a match. Two points equally near are none unless the ratio is 1.
  [[nodiscard]] bool accepted() const noexcept {
    return id_ != no_point && first_ <= nearest_allowed_ && second_ >= ratio_ * first_ &&
           (second_ > first_ || ratio_ <= Real{1});
  }
  [[nodiscard]] PointId id() const noexcept { return id_; }
  /// True distance of the nearest; infinite where there is none.
  [[nodiscard]] Real first() const noexcept { return restored(first_); }
  [[nodiscard]] Real first_reduced() const noexcept { return first_; }

protected:
  static constexpr Real infinity = std::numeric_limits<Real>::infinity();

  [[nodiscard]] Real restored(Real reduced) const noexcept {
    return reduced < infinity ? static_cast<Real>(metric_.restore(reduced)) : infinity;
  }

  /// Whether the point is now one of the two.
  bool keep(PointId id, Real reduced) noexcept {
    if (reduced < first_) {
      second_ = first_;
      first_ = reduced;
      id_ = id;
      return true;
    }
    if (!(reduced < second_)) return false;
    second_ = reduced;
    return true;
  }
  void lower_limit(Real reduced) noexcept { limit_ = std::min(limit_, reduced); }

  [[no_unique_address]] M metric_;
  PointId id_ = no_point;
  Real ratio_ = 1;
  Real nearest_allowed_ = infinity;
  Real limit_ = infinity;
  Real first_ = infinity;
  Real second_ = infinity;
};

}  // namespace detail

/// Keeps the nearest two. Where nothing within ratio * max_distance is left the verdict is known, so the
/// search may stop there. `M` is the metric of the search.
template <class Real, class M = L2>
class RatioTestMatch : public detail::RatioTestState<Real, M> {
public:
  using detail::RatioTestState<Real, M>::RatioTestState;

  void offer(PointId id, Real reduced) noexcept {
    if (this->keep(id, reduced)) this->lower_limit(this->second_);
  }
  /// True distance of the second; infinite where nothing within ratio * max_distance was met.
  [[nodiscard]] Real second() const noexcept { return this->restored(this->second_); }
  [[nodiscard]] Real second_reduced() const noexcept { return this->second_; }
};

/// The verdict of RatioTestMatch and no more, for less work: a search stops as soon as nothing left can
/// change it. While the nearest two say "no match" only a point nearer than the first can; while they say
/// "match" only one within ratio times the first. Where the search is exact, accepted(), id() and first() are
/// those of RatioTestMatch, whatever the order of the points.
template <class Real, class M = L2>
class RatioTestVerdict : public detail::RatioTestState<Real, M> {
public:
  using detail::RatioTestState<Real, M>::RatioTestState;

  void offer(PointId id, Real reduced) noexcept {
    if (!this->keep(id, reduced)) return;
    if (this->first_ > this->nearest_allowed_)
      this->lower_limit(this->second_);
    else if (this->accepted())  // a point as near as a first of 0 would still make it none
      this->lower_limit(std::nextafter(this->ratio_ * this->first_, this->infinity));
    else
      this->lower_limit(this->first_);
  }
};

}}  // namespace cairn::CAIRN_ABI
