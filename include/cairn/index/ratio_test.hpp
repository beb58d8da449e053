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

#include <cairn/index/neighbors.hpp>

namespace cairn::inline CAIRN_ABI {

/// Accept when second >= ratio * first and first <= max_distance, in true distances. ratio >= 1.
struct RatioTest {
  float ratio = 2.0F;
  float max_distance = std::numeric_limits<float>::infinity();
};

namespace detail {

/// The nearest two that were offered, and what the ratio test makes of them.
template <class Real>
class RatioTestState {
public:
  /// `metric` turns the test's true distances into reduced ones (L2: squares).
  template <class M>
  RatioTestState(const RatioTest& test, const M& metric) noexcept
      : ratio_(metric.reduce(static_cast<Real>(test.ratio))),
        nearest_allowed_(metric.reduce(static_cast<Real>(test.max_distance))),
        limit_(std::nextafter(std::min(std::numeric_limits<Real>::max(), ratio_ * nearest_allowed_),
                              infinity)) {}

  /// Points as far as this or farther change nothing.
  [[nodiscard]] Real limit() const noexcept { return limit_; }

  /// Whether the nearest is a match. Two points equally near are none unless the ratio is 1.
  [[nodiscard]] bool accepted() const noexcept {
    return id_ != no_point && first_ <= nearest_allowed_ && second_ >= ratio_ * first_ &&
           (second_ > first_ || ratio_ <= Real{1});
  }
  [[nodiscard]] PointId id() const noexcept { return id_; }
  [[nodiscard]] Real first() const noexcept { return first_; }

protected:
  static constexpr Real infinity = std::numeric_limits<Real>::infinity();

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

  PointId id_ = no_point;
  Real ratio_;
  Real nearest_allowed_;
  Real limit_;
  Real first_ = infinity;
  Real second_ = infinity;
};

}  // namespace detail

/// Keeps the nearest two. Where nothing within ratio * max_distance is left the verdict is known, so the
/// search may stop there.
template <class Real>
class RatioTestMatch : public detail::RatioTestState<Real> {
public:
  using detail::RatioTestState<Real>::RatioTestState;

  void offer(PointId id, Real reduced) noexcept {
    if (this->keep(id, reduced)) this->lower_limit(this->second_);
  }
  /// Infinite where nothing within ratio * max_distance was met.
  [[nodiscard]] Real second() const noexcept { return this->second_; }
};

/// The verdict of RatioTestMatch and no more, for less work: a search stops as soon as nothing left can
/// change it. While the nearest two say "no match" only a point nearer than the first can; while they say
/// "match" only one within ratio times the first. Where the search is exact, accepted(), id() and first() are
/// those of RatioTestMatch, whatever the order of the points.
template <class Real>
class RatioTestVerdict : public detail::RatioTestState<Real> {
public:
  using detail::RatioTestState<Real>::RatioTestState;

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

}  // namespace cairn::inline CAIRN_ABI
