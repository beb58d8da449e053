// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Seeds of random tests: printed on failure, replayed with CAIRN_SEED.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <string>

#include <cairn/core/random.hpp>

namespace cairn_test {

/// The seed of a random test: CAIRN_SEED where set, otherwise `usual`. Put it into CAPTURE so that a failure
/// prints it.
inline std::uint64_t seed(std::uint64_t usual = 1) {
  const char* text = std::getenv("CAIRN_SEED");
  return text != nullptr ? std::stoull(text) : usual;
}

/// The level of a statistical band that has to hold under any seed: all tests together look at a few hundred
/// numbers a seed, so that one seed in some thousands is red by chance.
inline constexpr double almost_sure = 1 - 1e-6;

}  // namespace cairn_test
