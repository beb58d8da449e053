// words: deleted; associate() them
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/eval/association.hpp>
#include <cairn/eval/trajectory_error.hpp>

auto error(const cairn::Trajectory& truth, const cairn::Trajectory& estimate) {
  return cairn::absolute_error(truth, estimate);
}
