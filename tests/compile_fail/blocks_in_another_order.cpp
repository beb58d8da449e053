// words: cairn: the blocks that a call ends with are together the model's State; BlocksMakeState<cairn::
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/joint_extended.hpp>

#include "blocks.hpp"

auto step(Blocks& belief, Robot robot, Landmark landmark) {
  return cairn::JointExtended{}.update(belief, cairn::numeric(Bearing{}), cairn::SO2(0.1), landmark, robot);
}
