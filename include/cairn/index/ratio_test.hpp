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

/// Keeps the nearest two. Where nothing within ratio * max_distance is left the verdict is known, so the
/// search may stop there.
template <class Real>
class RatioTestMatch {
public:
  /// `metric` turns the test's true distances into reduced ones (L2: squares).
  template <class M>
  RatioTestMatch(const RatioTest& test, const M& metric) noexcept
      : ratio_(metric.reduce(static_cast<Real>(test.ratio))),
        nearest_allowed_(metric.reduce(static_cast<Real>(test.max_distance))),
        limit_(std::min(std::numeric_limits<Real>::max(), ratio_ * nearest_allowed_)) {
    limit_ = std::nextafter(limit_, std::numeric_limits<Real>::infinity());
  }

  [[nodiscard]] Real limit() const noexcept { return limit_; }
  void offer(PointId id, Real reduced) noexcept {
    if (reduced < first_) {
      second_ = first_;
      first_ = reduced;
      id_ = id;
    } else if (reduced < second_) {
      second_ = reduced;
    } else {
      return;
    }
    limit_ = std::min(limit_, second_);
  }

  /// Whether the nearest is a match. Two points equally near are none unless the ratio is 1. second() is
  /// infinite where nothing within ratio * max_distance was met.
  [[nodiscard]] bool accepted() const noexcept {
    return id_ != no_point && first_ <= nearest_allowed_ && second_ >= ratio_ * first_ &&
           (second_ > first_ || ratio_ <= Real{1});
  }
  [[nodiscard]] PointId id() const noexcept { return id_; }
  [[nodiscard]] Real first() const noexcept { return first_; }
  [[nodiscard]] Real second() const noexcept { return second_; }

private:
  PointId id_ = no_point;
  Real ratio_;
  Real nearest_allowed_;
  Real limit_;
  Real first_ = std::numeric_limits<Real>::infinity();
  Real second_ = std::numeric_limits<Real>::infinity();
};

/// The verdict of RatioTestMatch and no more, for less work: a search stops as soon as nothing left can
/// change it. While the nearest two say "no match" only a point nearer than the first can; while they say
/// "match" only one within ratio times the first. Where the search is exact, accepted(), id() and first() are
/// those of RatioTestMatch, whatever the order of the points.
template <class Real>
class RatioTestVerdict {
public:
  template <class M>
  RatioTestVerdict(const RatioTest& test, const M& metric) noexcept
      : ratio_(metric.reduce(static_cast<Real>(test.ratio))),
        nearest_allowed_(metric.reduce(static_cast<Real>(test.max_distance))) {
    limit_ = std::nextafter(std::min(std::numeric_limits<Real>::max(), ratio_ * nearest_allowed_), infinity);
  }

  [[nodiscard]] Real limit() const noexcept { return limit_; }
  void offer(PointId id, Real reduced) noexcept {
    if (reduced < first_) {
      second_ = first_;
      first_ = reduced;
      id_ = id;
    } else if (reduced < second_) {
      second_ = reduced;
    } else {
      return;
    }
    if (first_ > nearest_allowed_)
      limit_ = std::min(limit_, second_);
    else if (accepted())  // a point as near as a first of 0 would still make it none
      limit_ = std::min(limit_, std::nextafter(ratio_ * first_, infinity));
    else
      limit_ = std::min(limit_, first_);
  }

  [[nodiscard]] bool accepted() const noexcept {
    return id_ != no_point && first_ <= nearest_allowed_ && second_ >= ratio_ * first_ &&
           (second_ > first_ || ratio_ <= Real{1});
  }
  [[nodiscard]] PointId id() const noexcept { return id_; }
  [[nodiscard]] Real first() const noexcept { return first_; }

private:
  static constexpr Real infinity = std::numeric_limits<Real>::infinity();

  PointId id_ = no_point;
  Real ratio_;
  Real nearest_allowed_;
  Real limit_;
  Real first_ = infinity;
  Real second_ = infinity;
};

}  // namespace cairn::inline CAIRN_ABI
