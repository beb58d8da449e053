// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

/// Largest difference between five filters on the same frames in the linear regime (initial errors of a
/// millionth of the prior's usual sigmas): of the means in posterior sigmas, and of the covariances relative
/// to the products of the sigmas. The filters: PatchFilter (information form), Extended, iterated Extended,
/// Unscented, and PatchBucy (Kalman-Bucy, each frame an impulse).
double largest_disagreement(std::uint64_t seed, int frames);
