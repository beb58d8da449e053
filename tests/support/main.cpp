// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include "support/data.hpp"

namespace {
[[maybe_unused]] const bool folder_is_known = [] {
  cairn_test::default_data_folder = CAIRN_DEFAULT_DATA;
  return true;
}();
}  // namespace
