// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Seeded random draws that replay: the same seed gives the same integers and uniforms on every platform.
///
/// The generator is xoshiro256++ (Blackman and Vigna, "Scrambled linear pseudorandom number generators", ACM
/// TOMS 47, 2021) seeded by splitmix64. std::normal_distribution and std::uniform_int_distribution are not
/// specified bit for bit, so the draws are defined here. normal() calls std::log and std::sqrt and is equal
/// across platforms to within the rounding of std::log.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A uniform random bit generator of 64 bits with a few draws of its own. Copy it to replay from a point.
/// Not safe for concurrent use: give each thread its own, by a different stream.
class Random {
public:
  using result_type = std::uint64_t;

  /// Generator for `seed`; different `stream`s of one seed are independent sequences.
  explicit Random(std::uint64_t seed = 0, std::uint64_t stream = 0) noexcept {
    std::uint64_t mix = seed + stream * 0xd1342543de82ef95ULL;
    for (std::uint64_t& word : state_) word = split_mix(mix);
  }

  [[nodiscard]] static constexpr result_type min() noexcept { return 0; }
  [[nodiscard]] static constexpr result_type max() noexcept {
    return std::numeric_limits<result_type>::max();
  }

  /// 64 random bits.
  result_type operator()() noexcept {
    const std::uint64_t result = std::rotl(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t shifted = state_[1] << 17U;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = std::rotl(state_[3], 45);
    return result;
  }

  /// Uniform on [0, 1), a multiple of 2^-53.
  double uniform() noexcept { return static_cast<double>((*this)() >> 11U) * 0x1.0p-53; }

  /// Uniform on [low, high).
  double uniform(double low, double high) noexcept { return low + (high - low) * uniform(); }

  /// Uniform on {0, ..., count - 1}, without bias (rejection); 0 where count is 0.
  std::uint64_t below(std::uint64_t count) noexcept {
    if (count == 0) return 0;
    const std::uint64_t rejected = (0 - count) % count;  // 2^64 mod count
    for (;;) {
      const std::uint64_t draw = (*this)();
      if (draw >= rejected) return draw % count;
    }
  }

  /// Standard normal (Marsaglia's polar method, one of each pair is kept for the next call).
  double normal() noexcept {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    for (;;) {
      const double u = uniform(-1.0, 1.0);
      const double v = uniform(-1.0, 1.0);
      const double s = u * u + v * v;
      if (s >= 1.0 || s == 0.0) continue;
      const double factor = std::sqrt(-2.0 * std::log(s) / s);
      spare_ = v * factor;
      has_spare_ = true;
      return u * factor;
    }
  }

  /// Normal with the given mean and standard deviation.
  double normal(double mean, double sigma) noexcept { return mean + sigma * normal(); }

private:
  static std::uint64_t split_mix(std::uint64_t& state) noexcept {
    std::uint64_t z = (state += 0x9e3779b97f4a7c15ULL);
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
  }

  std::uint64_t state_[4] = {};
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}}  // namespace cairn::CAIRN_ABI
