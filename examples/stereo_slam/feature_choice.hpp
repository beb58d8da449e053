// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The interest points of a run, chosen at run time: cairn's SURF, or OpenCV's SIFT or ORB where OpenCV was
/// found when building.
#pragma once

#include <array>
#include <functional>

#include <cairn/vision/features.hpp>

#include "hidden_cells.hpp"

namespace stereo_slam {

enum class FeatureKind { surf, sift, orb };
inline constexpr std::array<const char*, 3> feature_names = {"surf", "sift", "orb"};

/// Whether make_extractor() has more than SURF to offer.
[[nodiscard]] bool built_with_opencv() noexcept;

/// Numbers a descriptor of this kind has.
[[nodiscard]] constexpr int dimension_of(FeatureKind kind) noexcept {
  return kind == FeatureKind::surf ? 64 : kind == FeatureKind::sift ? 128 : 256;
}

struct FeatureOptions {
  FeatureKind kind = FeatureKind::surf;
  int points = 2000;             ///< kept in an image
  float surf_threshold = 10.0F;  ///< least response of SURF [(grey levels)^2]
  bool oriented = false;         ///< SURF with orientation; the others always have one
  bool evenly = false;           ///< SURF all over the image, not where the strongest are
  unsigned threads = 1;          ///< of SURF; the points do not depend on it
};

/// Any FeatureExtractor behind one type.
using Extractor = std::function<const cairn::Features&(cairn::ImageView)>;
static_assert(cairn::FeatureExtractor<Extractor>);

/// Throws cairn::Error where the kind needs OpenCV and there is none. SURF keeps as many points outside of
/// what is hidden as it would of the whole image, and a tenth as many within.
[[nodiscard]] Extractor make_extractor(const FeatureOptions& options, HiddenCells hidden = {});

}  // namespace stereo_slam
