// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Elevation models from GeoTIFF, read by libtiff.
#pragma once

#include <filesystem>

#include <cairn/field/grid.hpp>

namespace correlation_navigation {

/// The first image of a GeoTIFF, as read_terrain() gives it. Throws cairn::Error, also where the program was
/// built without libtiff.
///
/// Heights of 8, 16 or 32-bit integers or 32 or 64-bit floats, in strips or tiles, of one band, compressed as
/// libtiff knows it or not. Of GeoTIFF 1.1 the model's pixel scale is taken, in metres of a projected system
/// or in degrees of latitude and longitude, which are metres as in the middle of the file (degrees.hpp); feet
/// and transformations are refused. So is GDAL's no-data value. A file that says nothing of its scale has its
/// heights `spacing` metres apart. Memory is taken for what the file can hold: as many bytes, 2048 times as
/// many where it is compressed.
[[nodiscard]] cairn::FieldGrid read_geotiff(const std::filesystem::path& path, double spacing);

}  // namespace correlation_navigation
