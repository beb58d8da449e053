// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A run of the system as the program makes it, and where recorded drives are looked for.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "dataset.hpp"
#include "pipeline.hpp"
#include "summary.hpp"
#include "support/scoreboard.hpp"

namespace stereo_slam_bench {

struct Run {
  stereo_slam::RunRecord record;
  stereo_slam::Summary summary;
  double cpu_milliseconds = 0;  ///< of a pair, without reading it
};

/// Who else is shown each frame after the system has seen it: a rival, in turns with it.
using Beside = std::function<void(const stereo_slam::StereoFrame&)>;

/// All frames of the data set, one after the other.
[[nodiscard]] Run run(const stereo_slam::Dataset& frames, const stereo_slam::PipelineOptions& how,
                      const Beside& beside = {});
/// The same of the data set that is named; `and_back`: then backwards.
[[nodiscard]] Run run(const stereo_slam::DatasetOptions& what, const stereo_slam::PipelineOptions& how,
                      bool and_back = false);

/// CAIRN_DATA, else ../shared/data.
[[nodiscard]] std::filesystem::path data_folder();

/// A row of a drive, or why there is none.
void add(cairn_bench::Scoreboard& board, cairn_bench::Row row, const std::optional<double>& measured,
         bool data);

}  // namespace stereo_slam_bench
