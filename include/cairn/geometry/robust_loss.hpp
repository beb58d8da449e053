// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What large residuals count in a refinement.
#pragma once

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Weight of a residual of size x = chi / scale in the refinement.
enum class RobustLoss {
  none,   ///< 1
  huber,  ///< 1 below x = 1, then 1 / x
  cauchy  ///< 1 / (1 + x^2)
};

}}  // namespace cairn::CAIRN_ABI
