// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The arena as a data set.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "arena_scene.hpp"
#include "arena_script.hpp"
#include "dataset.hpp"

namespace stereo_slam {

/// The arena as the options say; its ground is made when the first picture has to be rendered, unless
/// `scene` (of the same seed) is given. Throws cairn::Error for options that make no camera: an unknown
/// script, sizes, angles or a baseline out of range.
[[nodiscard]] std::unique_ptr<Dataset> open_arena(const ArenaOptions& options, std::size_t frames,
                                                  unsigned threads,
                                                  std::shared_ptr<const ArenaScene> scene = nullptr);

/// The arena of the options seen from other places than its script's; nothing is kept on disk.
[[nodiscard]] std::unique_ptr<Dataset> open_arena_views(const ArenaOptions& options,
                                                        std::vector<Stance> stances, unsigned threads);

}  // namespace stereo_slam
