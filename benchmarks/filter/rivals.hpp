// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a contender offers: run `steps` predict-update steps of one problem. Empty where it has none, or is
/// not installed (CMakeLists.txt says how rivals are given). One translation unit a library.
#pragma once

#include <functional>
#include <string>

namespace cairn_bench {

/// Runs steps and returns the trace of the covariance it ends with, so that answers can be compared.
using Run = std::function<double(int steps)>;

struct Rival {
  std::string name;
  Run kalman_6_3{};
  Run landmark_3_3{};
  Run extended_5_2{};
  Run extended_15_6{};
  Run unscented_5_2{};
  Run unscented_9_3{};
  Run factored_6_3{};  ///< square root or UD form
  Run factored_15_6{};
};

Rival ours();
Rival ours_unscented();
Rival ours_factored();
/// Means over the landmarks of a batch of 1000 that is stepped together.
double batch_of_1000(int rounds);

Rival hand_written();
Rival openkf();
Rival tinyekf();
Rival mherb();
Rival opencv();
Rival bfl();

}  // namespace cairn_bench
