// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A landmark given the keyframes that saw it.
///
/// With A_k what the sighting of keyframe k says of the point (whitened_sighting.hpp) and xi_k the error of
/// that keyframe's pose in the world:
///   S = (sum_k A_k)^-1,   F_k = S A_k,   d x = sum_k F_k [I, -skew(x)] xi_k + N(0, S)     (1)
/// The F_k add up to I: a landmark moves with the world that its keyframes make.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/slam/detail/whitened_sighting.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

inline constexpr std::size_t most_sightings = 6;

/// One entry of a landmark's list.
struct RecordedSighting {
  std::uint32_t keyframe = 0;
  double sigma = 1;  ///< [pixels], the robust weight it was used with included
  Vector<2> left = Vector<2>::Zero(), right = Vector<2>::Zero();
  WhitenedSighting whitened;
};

/// What a list says of its landmark, to first order about the point x.
struct LandmarkGeometry {
  Vector<3> x = Vector<3>::Zero();          ///< world [m]
  Matrix<3> S = Matrix<3>::Zero();          ///< its covariance if the keyframes were known [m^2]
  std::array<Matrix<3>, most_sightings> F;  ///< (1)
  Matrix<3, rig_numbers> B =
      Matrix<3, rig_numbers>::Zero();  ///< d x / d the rig's numbers, where those are estimated
  std::size_t count = 0;               ///< sightings in the list
};

struct KeyframeLandmark : LandmarkGeometry {
  std::uint32_t id = 0;
  std::array<RecordedSighting, most_sightings> sightings;
  std::size_t of_visit = 0;     ///< sightings recorded in the present visit
  std::uint64_t last_seen = 0;  ///< frame
  bool barred = false;          ///< a sighting that P knows of was struck: no more may be recorded
  std::uint64_t epoch = 0;      ///< of the map when the geometry was computed
  double chi_squared = 0;       ///< of the list, 4 count - 3 degrees of freedom

  /// x, S, F and, `with_rig`, B from the list: Gauss-Newton from the present x. view(keyframe) is where that
  /// one stands. False where a sighting cannot be of this point.
  template <class View>
  [[nodiscard]] bool solve(const View& view, bool with_rig = false) {
    constexpr int most_steps = 6;
    std::array<PointStatistics, most_sightings> seen;
    for (int step = 0; step < most_steps; ++step) {
      PointStatistics all;
      for (std::size_t i = 0; i < count; ++i) {
        seen[i] = {};
        if (!sightings[i].whitened.add(view(sightings[i].keyframe), x, seen[i])) return false;
        all.A += seen[i].A;
        all.b += seen[i].b;
        all.squares += seen[i].squares;
      }
      const Cholesky<3> factor(all.A);
      if (!factor.good() || !(factor.least_share() > 1e-12)) return false;
      const Vector<3> d = factor.solve(all.b);
      x += d;
      const double length = d.dot(all.b);  // in standard deviations, squared
      chi_squared = all.squares - length;
      if (length > 1e-4 && step + 1 < most_steps) continue;
      S = factor.inverse();
      for (std::size_t i = 0; i < count; ++i) F[i] = product(S, seen[i].A);
      return length < 1 && (!with_rig || solve_rig(view));
    }
    return false;
  }

  /// The geometry about another point `at`, and how far from there the list puts the landmark. Nothing where
  /// a sighting cannot be of that point.
  template <class View>
  [[nodiscard]] std::optional<Vector<3>> linearise(const View& view, const Vector<3>& at, bool with_rig,
                                                   LandmarkGeometry& result) const {
    PointStatistics all;
    RigStatistics rig{.only_E = true};
    std::array<Matrix<3>, most_sightings> A;
    for (std::size_t i = 0; i < count; ++i) {
      const RecordedSighting& s = sightings[i];
      PointStatistics seen;
      const RigView& from = view(s.keyframe);
      if (!(with_rig ? s.whitened.add(from, at, seen, rig) : s.whitened.add(from, at, seen)))
        return std::nullopt;
      A[i] = seen.A;
      all.A += seen.A;
      all.b += seen.b;
    }
    const Cholesky<3> factor(all.A);
    if (!factor.good() || !(factor.least_share() > 1e-12)) return std::nullopt;
    result.x = at;
    result.S = factor.inverse();
    result.count = count;
    for (std::size_t i = 0; i < count; ++i) result.F[i] = product(result.S, A[i]);
    if (with_rig) result.B = -product(result.S, rig.E);
    return factor.solve(all.b);
  }

  /// B = -S sum_k E_k: where the sightings' rig turns by c, their point moves by B c.
  template <class View>
  [[nodiscard]] bool solve_rig(const View& view) {
    PointStatistics unused;
    RigStatistics rig{.only_E = true};
    for (std::size_t i = 0; i < count; ++i)
      if (!sightings[i].whitened.add(view(sightings[i].keyframe), x, unused, rig)) return false;
    B = -product(S, rig.E);
    return true;
  }

  /// The list under another calibration. False where a pixel has no ray under it.
  [[nodiscard]] bool whiten(const StereoRig& rig) {
    for (std::size_t i = 0; i < count; ++i) {
      RecordedSighting& s = sightings[i];
      const auto whitened = WhitenedSighting::of(rig, s.left, s.right, s.sigma);
      if (!whitened) return false;
      s.whitened = *whitened;
    }
    return true;
  }

  /// The list without one of its entries.
  void strike(std::size_t entry) {
    for (std::size_t i = entry; i + 1 < count; ++i) sightings[i] = sightings[i + 1];
    --count;
  }
};

}}}  // namespace cairn::CAIRN_ABI::detail
