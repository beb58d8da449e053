// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Reading camera images: PNG of any kind, PGM, and JPEG where libjpeg-turbo was there when building.
#pragma once

#include <filesystem>
#include <string>

#include <cairn/vision/image.hpp>

namespace example {

/// The image as 8-bit grey; colour becomes luminance, 16 bits are rounded to 8, transparency is put on black.
/// Throws cairn::Error naming the file and what was expected when it is missing, none of these, damaged or
/// truncated.
[[nodiscard]] cairn::Image read_image(const std::filesystem::path& path);

/// The bytes of an 8-bit grey PNG file. Throws cairn::Error when libpng refuses the image (it has no pixels).
[[nodiscard]] std::string png_bytes(cairn::ImageView image);

/// Writes an 8-bit grey PNG, completely or not at all. Throws cairn::Error naming the path.
void write_png(const std::filesystem::path& path, cairn::ImageView image);

}  // namespace example
