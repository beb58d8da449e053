// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Which landmarks the sightings along a path are of, and what else they may be of.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <cairn/manifold/se2.hpp>
#include <cairn/slam/landmark_map.hpp>

#include "landmark_log.hpp"

namespace fastslam {

/// A path as it is gone frame by frame: its map, and what the particles' own model says of it so far,
/// log p(x_1:t, n_1:t, z_1:t).
struct Walk {
  Map map;  ///< empty, before the first frame
  double log_density = 0;
  std::size_t frames = 0;
  cairn::SE2 pose{};  ///< the newest, or the start

  /// What the next frame's sightings are likeliest of, seen from this pose.
  [[nodiscard]] cairn::Association likeliest(const LandmarkLog& log, const cairn::SE2& next) const;
  void go_on(const LandmarkLog& log, const cairn::SE2& next, const cairn::Association& association);
};

/// All the way along a path whose sightings are of these landmarks.
[[nodiscard]] Walk walked(const LandmarkLog& log, const std::vector<cairn::SE2>& poses,
                          const std::vector<cairn::Association>& associations, const Map& empty);

/// A path with what its sightings are of, and how likely that is.
struct Reading {
  std::vector<cairn::SE2> poses;
  std::vector<cairn::Association> associations;
  double log_density = 0;
};

/// Which landmarks the sightings along a path are of: by their names, or the likeliest at each pose in turn.
/// Names that `believed` has lost are of nothing.
[[nodiscard]] std::vector<cairn::Association> associations_along(const LandmarkLog& log,
                                                                 const LandmarkLog& believed,
                                                                 const std::vector<cairn::SE2>& poses,
                                                                 const Map& empty);

/// What the sightings along a path whose landmarks have been named so are of by what is known of these at its
/// end, numbered as a map would; no others are begun. Along the path a landmark that has been seen once is
/// easily taken for its neighbour.
[[nodiscard]] std::vector<cairn::Association> reassigned(const LandmarkLog& log,
                                                         const std::vector<cairn::SE2>& poses,
                                                         const std::vector<cairn::Association>& associations,
                                                         const Map& empty);

/// Names the sightings of the log's first frames by these associations, as a map numbers its landmarks.
[[nodiscard]] LandmarkLog named(const LandmarkLog& log, const std::vector<cairn::Association>& associations);

/// The associations with all that was of landmark b said to be of landmark a, numbered as a map would;
/// nothing where both were seen at once.
[[nodiscard]] std::optional<std::vector<cairn::Association>> merged(
    std::vector<cairn::Association> associations, std::uint32_t a, std::uint32_t b);

/// After each of the widest gaps, by how uncertain the motion over them is: the rest of the path moved so
/// that one or two of the first things that were seen then are landmarks that were seen before, any that the
/// motion allows, and then laid onto the landmarks by all that was seen in the next hundred frames. The
/// `most` likeliest, the path otherwise as it was. Particles come back from a gap where their own draws put
/// them, and once all of them have taken one post for its neighbour, none will ever tell. O(gaps landmarks^2
/// (frames log landmarks + landmarks)) at most. The same for any number of threads.
[[nodiscard]] std::vector<Reading> rereadings(const LandmarkLog& log, const std::vector<cairn::SE2>& poses,
                                              const Map& empty, unsigned threads, std::size_t most);

}  // namespace fastslam
