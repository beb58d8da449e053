// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Elevation models from files: GeoTIFF, SRTM .hgt and PGM.
#pragma once

#include <filesystem>

#include <cairn/field/grid.hpp>

namespace correlation_navigation {

/// The terrain of a file as a grid in metres, x to the east and y to the north, the south-west corner at (0,
/// 0).
///
///   .tif, .tiff  GeoTIFF in metres or degrees, where the program was built with libtiff (geotiff.hpp)
///   .hgt         SRTM: 1201 or 3601 squared big-endian 16-bit heights, about 90 or 30 m apart;
///                the name (N34W118.hgt) gives the latitude that shortens the east-west spacing
///   .pgm         grey values
/// Voids are the file's no-data value, numbers that are not finite, and what is no height of the Earth, also
/// where the file does not name it: -9999, and all below -12 km or from 1e30 on.
/// A .pgm, and a .tif that does not say it, has its heights `spacing` metres apart.
/// Throws cairn::Error naming the file and what was expected: another format, a truncated file, no valid
/// height.
[[nodiscard]] cairn::FieldGrid read_terrain(const std::filesystem::path& path, double spacing = 30.0);

}  // namespace correlation_navigation
