// words: cairn: the blocks that a call ends with are together the model's State; control stands before them
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/joint_extended.hpp>
#include <cairn/models/motion.hpp>

#include "blocks.hpp"

auto step(Blocks& belief, Robot robot) {
  return cairn::JointExtended{}.predict(belief, cairn::Unicycle{}, 0.1, robot);
}
