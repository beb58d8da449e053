// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a search finds, and the collectors that decide what is kept: the one extension point of every search.
///
/// A search calls limit() and skips whatever is not nearer than that, and calls offer(id, reduced) for each
/// point that is. limit() never grows during a search. Reduced distances are the metric's (squared for L2)
/// and called so wherever they are shown; Neighbor and all else hold true ones. A collector that restores
/// distances by itself names their metric, Measure, and no search of another metric takes it. Gates, ratio
/// tests and counters are collectors of one's own.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <cairn/index/metric.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Number of a point in an index.
using PointId = std::uint32_t;
inline constexpr PointId no_point = 0xffffffffU;

/// A point found: its number and its true distance, in the units of the metric.
template <class Real>
struct Neighbor {
  PointId id = no_point;
  Real distance = std::numeric_limits<Real>::infinity();
  bool operator==(const Neighbor&) const = default;
};

/// Decides what a search keeps.
template <class C, class Real>
concept Collector = requires(C& collector, const C& fixed, PointId id, Real reduced) {
  { fixed.limit() } -> std::convertible_to<Real>;
  collector.offer(id, reduced);
};

namespace detail {

/// Whether a collector may be shown distances of the metric M: it must not take them for those of another.
template <class C, class M>
inline constexpr bool suits_metric = true;
template <class C, class M>
  requires requires { typename C::Measure; }
inline constexpr bool suits_metric<C, M> = std::derived_from<M, typename C::Measure>;

template <class C, class M>
constexpr void check_collector() noexcept {
  static_assert(suits_metric<C, M>,
                "the collector restores distances of another metric than the search's: name it in the "
                "collector's type, as in NearestTwo<float, L1>");
}

}  // namespace detail

/// What a search did. Deterministic, so tests and benchmarks compare it where times are noise.
struct Work {
  std::uint64_t nodes = 0;      ///< inner nodes whose children were looked at
  std::uint64_t leaves = 0;     ///< leaves scanned
  std::uint64_t distances = 0;  ///< distances to points computed

  Work& operator+=(const Work& other) noexcept {
    nodes += other.nodes;
    leaves += other.leaves;
    distances += other.distances;
    return *this;
  }
  bool operator==(const Work&) const = default;
};

/// How many leaves (of up to 16 points) a search may scan.
struct Budget {
  std::size_t leaves = std::numeric_limits<std::size_t>::max();
  [[nodiscard]] bool unlimited() const noexcept { return leaves == std::numeric_limits<std::size_t>::max(); }
};

/// What a search may cost, and where it says what it did cost: `{.budget = {.leaves = 24}, .work = &work}`.
struct SearchOptions {
  Budget budget{};
  Work* work = nullptr;  ///< what was done is added to it
};

/// Keeps the nearest point; of equally near ones the first offered.
template <class Real>
class Nearest {
public:
  /// Only points nearer than `limit` (reduced) count.
  explicit Nearest(Real limit = std::numeric_limits<Real>::infinity()) noexcept : reduced_(limit) {}

  [[nodiscard]] Real limit() const noexcept { return reduced_; }
  void offer(PointId id, Real reduced) noexcept {
    if (!(reduced < reduced_)) return;
    id_ = id;
    reduced_ = reduced;
  }
  [[nodiscard]] PointId id() const noexcept { return id_; }  ///< no_point where nothing was near enough
  [[nodiscard]] Real reduced() const noexcept { return reduced_; }

private:
  PointId id_ = no_point;
  Real reduced_;
};

namespace detail {

/// Whether a collector wants only the nearest point of a leaf, of equally near ones the first: then no other
/// is offered, which saves a branch for each point and those that processors predict wrongly.
template <class C>
inline constexpr bool keeps_one = false;
template <class Real>
inline constexpr bool keeps_one<Nearest<Real>> = true;

/// Whether a collector lets only some points through to another: OnlyLive (detail/forest_queries.hpp).
template <class C>
inline constexpr bool sifts = false;

}  // namespace detail

/// Keeps the nearest and the second nearest: what a ratio test needs. `M` is the metric of the search.
template <class Real, class M = L2>
class NearestTwo {
public:
  using Measure = M;

  NearestTwo() = default;
  explicit NearestTwo(M metric) noexcept : metric_(std::move(metric)) {}

  [[nodiscard]] Real limit() const noexcept { return second_; }
  void offer(PointId id, Real reduced) noexcept {
    if (reduced < first_) {
      second_ = first_;
      second_id_ = id_;
      first_ = reduced;
      id_ = id;
    } else if (reduced < second_) {
      second_ = reduced;
      second_id_ = id;
    }
  }
  [[nodiscard]] PointId id() const noexcept { return id_; }
  [[nodiscard]] PointId second_id() const noexcept { return second_id_; }
  /// Their true distances; infinity where there is no such point.
  [[nodiscard]] Real first() const noexcept { return restored(first_); }
  [[nodiscard]] Real second() const noexcept { return restored(second_); }
  [[nodiscard]] Real first_reduced() const noexcept { return first_; }
  [[nodiscard]] Real second_reduced() const noexcept { return second_; }

private:
  static constexpr Real infinity = std::numeric_limits<Real>::infinity();

  [[nodiscard]] Real restored(Real reduced) const noexcept {
    return reduced < infinity ? static_cast<Real>(metric_.restore(reduced)) : infinity;
  }

  [[no_unique_address]] M metric_{};
  PointId id_ = no_point;
  PointId second_id_ = no_point;
  Real first_ = infinity;
  Real second_ = infinity;
};

/// Keeps the k nearest in the caller's memory, sorted; `found` must hold at least k. Allocates nothing.
template <class Real>
class KNearest {
public:
  KNearest(Neighbor<Real>* found, std::size_t k) noexcept : found_(found), k_(k) {}

  [[nodiscard]] Real limit() const noexcept { return limit_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  void offer(PointId id, Real reduced) noexcept {
    if (k_ == 0 || !(reduced < limit_)) return;
    std::size_t at = size_ < k_ ? size_++ : k_ - 1;
    for (; at > 0 && reduced < found_[at - 1].distance; --at) found_[at] = found_[at - 1];
    found_[at] = {id, reduced};
    if (size_ == k_) limit_ = found_[k_ - 1].distance;
  }

  /// Turns the reduced distances in `found` into true ones; ends the collecting.
  template <class M>
  void restore(const M& metric) noexcept {
    for (std::size_t i = 0; i < size_; ++i) found_[i].distance = metric.restore(found_[i].distance);
  }

private:
  Neighbor<Real>* found_;
  std::size_t k_;
  std::size_t size_ = 0;
  Real limit_ = std::numeric_limits<Real>::infinity();
};

/// Keeps everything at most `reduced_radius` away, in the order of the search.
template <class Real>
class Within {
public:
  Within(std::vector<Neighbor<Real>>& found, Real reduced_radius) noexcept
      : found_(&found), limit_(std::nextafter(reduced_radius, std::numeric_limits<Real>::infinity())) {}

  [[nodiscard]] Real limit() const noexcept { return limit_; }
  void offer(PointId id, Real reduced) {
    if (reduced < limit_) found_->push_back({id, reduced});
  }

private:
  std::vector<Neighbor<Real>>* found_;
  Real limit_;  ///< the next number above the radius: what is nearer than that is within
};

/// Order of answers: by distance, then by number, so that equal sets give equal answers.
template <class Real>
[[nodiscard]] bool nearer(const Neighbor<Real>& a, const Neighbor<Real>& b) noexcept {
  return a.distance < b.distance || (!(b.distance < a.distance) && a.id < b.id);
}

}}  // namespace cairn::CAIRN_ABI
