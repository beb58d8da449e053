// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How costs grow: exponents, and where one curve comes to lie below another.
#pragma once

#include <optional>
#include <span>

namespace cairn_bench {

/// The b of y = a x^b through points with x, y > 0, by least squares of the logarithms; others are left out.
/// NaN where fewer than two different x remain.
double exponent_of(std::span<const double> x, std::span<const double> y);

/// The first x from which on `lower` is at most `upper` up to the end; nothing where it is above at the end.
std::optional<double> crossing(std::span<const double> x, std::span<const double> lower,
                               std::span<const double> upper);

}  // namespace cairn_bench
