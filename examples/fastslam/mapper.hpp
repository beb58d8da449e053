// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A log's frames mapped one after the other, and all that going on with it needs.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include <cairn/manifold/se2.hpp>

#include "landmark_log.hpp"
#include "names.hpp"
#include "slam.hpp"
#include "spread.hpp"

namespace fastslam {

struct SavedMapper;

class Mapper {
public:
  /// The log has to outlive it.
  Mapper(const LandmarkLog& log, const SlamOptions& options);

  [[nodiscard]] const LandmarkLog& log() const noexcept { return log_; }
  [[nodiscard]] const SlamOptions& options() const noexcept { return options_; }
  [[nodiscard]] const Belief& belief() const noexcept { return belief_; }
  [[nodiscard]] const std::vector<StepRecord>& steps() const noexcept { return steps_; }  ///< one a frame
  /// Names that were given and are not believed.
  [[nodiscard]] std::size_t doubted() const noexcept { return doubted_; }

  /// Whether all paths are drawn again at times.
  [[nodiscard]] bool redraws() const noexcept {
    return options_.redraw_below > 0 && options_.proposal == ProposalKind::landmarks;
  }
  [[nodiscard]] bool has_next() const noexcept { return steps_.size() < log_.frames.size(); }
  /// Maps the log's next frame, of which there is one. Throws cairn::Error where it cannot be mapped.
  void step();
  /// Draws the paths again, that path and map be what all of the log says. This one then is not to go on: it
  /// would be another than one that had been asked to finish later.
  void finish();

  /// Writes all that a mapper is. A file that is there is replaced as a whole or not at all. Throws
  /// cairn::Error where it cannot be written.
  void save(const std::filesystem::path& path) const;
  /// The mapper that was saved, to go on with a log that begins with the same frames: to the bit as though it
  /// had not been saved. Throws cairn::Error, naming the file, where it is none, is damaged or of another
  /// version, where a number cannot be, or the frames are not the log's.
  [[nodiscard]] static Mapper loaded(const std::filesystem::path& path, const LandmarkLog& log,
                                     unsigned threads);

private:
  Mapper(const LandmarkLog& log, SavedMapper saved);

  void redraw();
  void describe();  // the newest step

  const LandmarkLog& log_;
  SlamOptions options_;
  Belief belief_;
  Spread spread_;
  OtherNames others_;
  std::vector<cairn::SE2> optimum_;  // when paths were last drawn again
  std::vector<StepRecord> steps_;
  std::size_t doubted_ = 0;
};

/// What a saved mapper was made with, threads aside. Throws as Mapper::loaded() does.
[[nodiscard]] SlamOptions saved_options(const std::filesystem::path& path);

}  // namespace fastslam
