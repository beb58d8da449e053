// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The landmark store of a run, chosen at run time: one kd-tree rebuilt every step, or a growing forest.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <cairn/index/landmark_store.hpp>

#include "landmarks.hpp"

namespace stereo_slam {

enum class StoreKind { multi, single };

struct StoreOptions {
  StoreKind kind = StoreKind::multi;
  int dimension = 64;             ///< numbers of a descriptor: 64, 128 or 256
  double ratio = 1.25;            ///< second best over best distance that a match needs
  double max_distance = 0.45;     ///< largest distance of unit descriptors
  std::size_t leaves = 32;        ///< budget of a search; what it misses the second look finds
  cairn::Probation probation{};   ///< when a landmark becomes a base one, and when it is dropped
  cairn::MultiTreeShape shape{};  ///< n1 and q of the forest
};

/// What a landmark looks like.
struct Look {
  std::span<const float> descriptor;
  std::int8_t sign;
};

struct StoreMatch {
  LandmarkId id;
  float distance;
};

class LandmarkStore {
public:
  LandmarkStore() = default;
  LandmarkStore(const LandmarkStore&) = delete;
  LandmarkStore& operator=(const LandmarkStore&) = delete;
  virtual ~LandmarkStore() = default;

  /// A new landmark; it can be matched from the next step on.
  [[nodiscard]] virtual LandmarkId add(const Look& look) = 0;
  virtual void sighted(LandmarkId id) = 0;
  /// A landmark of an earlier run: base from the next step on.
  virtual void trust(LandmarkId id) = 0;
  [[nodiscard]] virtual bool is_base(LandmarkId id) const = 0;
  /// `twin` is the same as `kept`: it goes, and its sightings are kept's.
  virtual void merge(LandmarkId kept, LandmarkId twin) = 0;
  /// Removes a landmark, where it is there.
  virtual void erase(LandmarkId id) = 0;
  /// Ends the step; returns the landmarks that ran out of time.
  virtual std::vector<LandmarkId> advance() = 0;
  [[nodiscard]] virtual std::vector<std::optional<StoreMatch>> match(std::span<const Look> looks,
                                                                     unsigned threads) const = 0;
};

/// Throws cairn::Error where there is no store for the dimension.
[[nodiscard]] std::unique_ptr<LandmarkStore> make_landmark_store(const StoreOptions& options);

}  // namespace stereo_slam
