// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "runs.hpp"

#include <cstddef>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <utility>

#include "there_and_back.hpp"

namespace stereo_slam_bench {

Run run(const stereo_slam::Dataset& frames, const stereo_slam::PipelineOptions& how, const Beside& beside) {
  std::cout << "running " << frames.name() << ", seed " << how.seed << std::endl;
  stereo_slam::Pipeline pipeline(frames.rig(), how);
  double cpu = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const stereo_slam::StereoFrame frame = frames.frame(i);
    const std::clock_t start = std::clock();
    pipeline.step(frame);
    cpu += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    if (beside) beside(frame);
  }
  Run result{pipeline.record(), {}, 1e3 * cpu / static_cast<double>(frames.size())};
  result.summary = stereo_slam::summarise(result.record);
  return result;
}

Run run(const stereo_slam::DatasetOptions& what, const stereo_slam::PipelineOptions& how, bool and_back) {
  auto frames = stereo_slam::open_dataset(what);
  if (and_back) frames = stereo_slam::there_and_back(std::move(frames));
  return run(*frames, how);
}

std::filesystem::path data_folder() {
  const char* data = std::getenv("CAIRN_DATA");
  return data != nullptr ? data : "../shared/data";
}

void add(cairn_bench::Scoreboard& board, cairn_bench::Row row, const std::optional<double>& measured,
         bool data) {
  row.measured = measured;
  if (!measured) row.note = data ? "no value" : "no data";
  board.add(std::move(row));
}

}  // namespace stereo_slam_bench
