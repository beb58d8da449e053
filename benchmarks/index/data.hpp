// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The point sets of the index benchmarks, seeded, and real SIFT descriptors where they are at hand.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace cairn_bench {

using Point3 = std::array<float, 3>;

/// "uniform" in the unit cube, "scan" (rings of a turning 64-beam scanner in a street), "line", "equal",
/// "lattice" (16^3 places), "duplicates" (each place holds about a thousand points).
std::vector<Point3> points_like(const std::string& shape, std::size_t count, std::uint64_t seed);

/// Descriptors of 64 numbers and unit length in clusters, as those of real images are.
std::vector<float> clustered_descriptors(std::size_t count, std::uint64_t seed);

/// Each of `of` (64 numbers) with noise; the rest of the queries, one in two, are new descriptors.
std::vector<float> noisy_copies(const std::vector<float>& of, std::size_t count, std::uint64_t seed);

struct Descriptors {
  std::size_t dim;
  std::vector<float> base;
  std::vector<float> queries;
};
/// Like learned features: unit vectors of `dim` numbers, thirty hidden ones through a random map, rectified,
/// with noise. Half of the 500 queries are points with noise, half are new.
Descriptors features(std::size_t count, std::size_t dim, std::uint64_t seed);
/// 99,000 SIFT descriptors and 1,000 queries.
std::optional<Descriptors> sift();
/// SURF of the pictures of two drives through streets and of the stereo pairs, as many as there are but at
/// most `most`, 64 numbers each, queries from every twentieth picture, which gives none to the set. Nothing
/// without the pictures or what reads them.
std::optional<Descriptors> surf_of_pictures(std::size_t most, std::size_t queries);

}  // namespace cairn_bench
