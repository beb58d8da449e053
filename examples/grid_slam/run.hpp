// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// One run over one log, and everything that is to be said of it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <cairn/eval/relations.hpp>
#include <cairn/io/carmen.hpp>

#include "mapper.hpp"
#include "outputs.hpp"

namespace grid_slam {

/// Lets the mapper take the log. `on_scan` is called after every scan; what it returns, if anything, ends the
/// run and says why. Relations may be none. `frames` is how often a snapshot is taken, over the log and at
/// its end. A scan that cannot be mapped ends the run as well; throws cairn::Error where it is the first.
[[nodiscard]] Results run(Mapper& mapper, const cairn::CarmenLog& log,
                          const std::vector<cairn::PoseRelation>& relations,
                          const std::function<std::optional<std::string>()>& on_scan = {},
                          std::size_t frames = 0);

/// The same with a new mapper.
[[nodiscard]] Results run(const cairn::CarmenLog& log, const MapperOptions& options,
                          const std::vector<cairn::PoseRelation>& relations,
                          const std::function<std::optional<std::string>()>& on_scan = {});

/// Whether a snapshot is due after scan i of so many, where `frames` are spread over the log: the last of
/// them is of its end, which comes when the log or the run ends.
[[nodiscard]] constexpr bool is_film_frame(std::size_t i, std::size_t count, std::size_t frames) noexcept {
  return (i + 1) * frames / count != i * frames / count && i + 1 < count;
}
/// Ends a run at scan `next` of the log, which could not be mapped, and says which that is.
void end_of_data(Results& results, const cairn::CarmenLog& log, std::size_t next, const std::string& why);
/// What a reader of the results should know: a map without a picture, scans without beams.
void add_notes(Results& results, const std::vector<cairn::StampedScan>& scans);

}  // namespace grid_slam
