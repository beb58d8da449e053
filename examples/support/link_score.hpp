// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How well a mapper links what it sees to what it knows, judged by which landmark each sighting was of; and
/// its map as a picture. For the lesson on data association, whose rules see nothing of this.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/index/landmark_ledger.hpp>

#include "support/landmark_world.hpp"
#include "support/report.hpp"

namespace example {

/// A place of the map; which landmark it was born from is for scores alone.
struct MappedPlace {
  cairn::Gaussian<cairn::Vector<2>> place;
  int born_of = nothing_real;
};

struct LinkScore {
  double right = 0;                    ///< links to the place of the landmark that was seen
  double wrong = 0;                    ///< links to another one
  double missed = 0;                   ///< sightings of a landmark in the map that were not linked
  double pairs = 0;                    ///< sightings of a landmark in the map
  double in_gate = 0;                  ///< those of them whose NIS with its place is below the gate
  std::vector<PlaneCurve> lines = {};  ///< of this step: from the robot to what it sees

  [[nodiscard]] double precision() const { return right / (right + wrong); }
  [[nodiscard]] double recall() const { return right / (right + wrong + missed); }
  [[nodiscard]] cairn::Vector<2> recall_and_precision() const { return {recall(), precision()}; }

  /// Counts one sighting. `linked_to`: the place that it was linked to, null where it was not; `nis`: that
  /// with the place of its landmark, infinite where the map has none.
  void count(const LandmarkSighting& seen, const MappedPlace* linked_to, double nis, double gate,
             const cairn::Vector<2>& from, const cairn::Vector<2>& to) {
    const bool real = seen.landmark != nothing_real;
    const bool in_map = real && nis < std::numeric_limits<double>::infinity();
    pairs += in_map ? 1 : 0;
    in_gate += in_map && nis < gate ? 1 : 0;
    if (linked_to == nullptr) {
      missed += in_map ? 1 : 0;
      lines.push_back({"no link", Ink::measurement});
    } else if (real && linked_to->born_of == seen.landmark) {
      ++right;
      lines.push_back({"right link", Ink::teal});
    } else {
      ++wrong;
      lines.push_back({"wrong link", Ink::wrong});
    }
    extend(lines.back(), from);
    extend(lines.back(), to);
  }
};

/// What the map that counts amounts to. A ghost is a place of no landmark, or of one that has another place.
struct MapScore {
  double ghosts = 0;
  double covered = 0;                     ///< share of the others whose landmark is in their 99 % ellipse
  cairn::RunningMoments nees = {};        ///< of the places that are no ghosts
  std::vector<PlaneCurve> ellipses = {};  ///< of 2 sigma; where those are too small to see, a circle of 0.2 m

  /// Of the places that are base; their numbers are those of the ledger.
  MapScore(const std::vector<MappedPlace>& places, const cairn::LandmarkLedger& ledger,
           const std::vector<cairn::Vector<2>>& landmarks) {
    std::set<int> met{nothing_real};
    for (cairn::LandmarkId id = 0; id < places.size(); ++id) {
      if (!ledger.is_base(id)) continue;
      const auto& [place, born_of] = places[id];
      const bool ghost = !met.insert(born_of).second;
      const cairn::Matrix<2> visible = place.covariance + 0.01 * cairn::Matrix<2>::Identity();
      ellipses.push_back(
          ellipse_of(ghost ? "ghost" : "map", ghost ? Ink::wrong : Ink::belief, place.mean, visible));
      if (ghost) {
        ++ghosts;
        continue;
      }
      const double error = cairn::nees(place, landmarks[static_cast<std::size_t>(born_of)]);
      nees.add(error);
      covered += error < cairn::chi_square_quantile(0.99, 2) ? 1 : 0;
    }
    covered /= static_cast<double>(nees.count());
  }
};

}  // namespace example
