// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the study inserts: points, clustered descriptors, and descriptors of real and rendered pictures.
#pragma once

#include <cstddef>
#include <optional>

#include "study/drive.hpp"

namespace cairn_study {

/// `count` uniform points of three numbers.
Stream uniform_points(std::size_t count, std::size_t steps);
/// `count` descriptors of 64 numbers in clusters.
Stream clustered(std::size_t count, std::size_t steps);
/// Up to `count` of the 99,000 SIFT descriptors below CAIRN_DATA; nothing where they are missing.
std::optional<Stream> sift_descriptors(std::size_t count, std::size_t steps);
/// SURF descriptors of the left pictures of a drive through the rendered arena, in the order of the drive;
/// nothing where the program was built without the stereo_slam example.
std::optional<Stream> arena_descriptors(std::size_t frames, std::size_t steps);

}  // namespace cairn_study
