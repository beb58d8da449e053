// words: cairn: jacobian(x) of a placement; Expected<6, 5, double>; Found<5, 6, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch_filter.hpp>

#include "models.hpp"

struct Broken : cairn::AlongTrackPlacement {
  cairn::Matrix<5, 6> jacobian(const State&) const { return {}; }
};

auto step(cairn::Gaussian<cairn::Vector<5>>& belief, const Broken& where, const cairn::BsplineMap& map,
          std::span<const double> z, const cairn::PatchNoise& noise, cairn::PatchScratch& scratch) {
  return cairn::PatchFilter{}.update(belief, where, map, cairn::PatchShape{}, z, noise, scratch);
}
