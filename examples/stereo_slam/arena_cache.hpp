// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rendered pairs on disk: one PGM a pair, the left image above the right, with a checksum in its comment.
///
/// A file that is missing, damaged or of another size is no entry: it is rendered again. Files are written
/// beside their place and renamed, so that several runs may share a folder.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include <cairn/vision/image.hpp>

#include "arena.hpp"

namespace stereo_slam {

using ImagePair = std::pair<cairn::Image, cairn::Image>;

/// The pairs of one set of options. Const methods are safe concurrently.
class ArenaCache {
public:
  explicit ArenaCache(const ArenaOptions& options);

  [[nodiscard]] std::optional<ImagePair> find(std::size_t frame) const;

  /// Keeps a pair; a disk that is full or read-only is no error, the pair is then not kept.
  void keep(std::size_t frame, const ImagePair& pair) const;

  /// Where the pairs of these options are.
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

private:
  [[nodiscard]] std::filesystem::path file(std::size_t frame) const;

  bool enabled_;
  int width_;
  int height_;
  std::filesystem::path folder_;
};

}  // namespace stereo_slam
