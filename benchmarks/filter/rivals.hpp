// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a rival offers: run `steps` predict-update steps of one problem. Empty where it is not installed
/// (-DCAIRN_RIVAL_OPENKF=<folder of its sources>, -DCAIRN_RIVAL_TINYEKF=<folder of tinyekf.h>).
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
};

Rival openkf();
Rival tinyekf();

}  // namespace cairn_bench
