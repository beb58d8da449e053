// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The page of report_page/, bundled into one file at build time.
#pragma once

#include <string_view>

namespace example {

/// The HTML with places for title and data; empty where the build had no npm. Defined by a generated source.
[[nodiscard]] std::string_view report_template() noexcept;

}  // namespace example
