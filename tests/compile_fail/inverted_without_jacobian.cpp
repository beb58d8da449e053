// words: cairn: this filter needs the model's jacobian(); numeric(model)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/joint_extended.hpp>

#include "blocks.hpp"

auto step(Blocks& belief, Robot robot) {
  return belief.augment(cairn::inverted(Bearing{}), cairn::SO2(0.1), robot);
}
