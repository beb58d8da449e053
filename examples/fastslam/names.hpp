// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Names for all sightings of a log, weighed with the path integrated out, and better ones looked for.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <cairn/manifold/se2.hpp>
#include <cairn/slam/landmark_map.hpp>

#include "batch.hpp"
#include "landmark_log.hpp"
#include "naming.hpp"
#include "slam.hpp"

namespace fastslam {

/// Which landmarks were seen along a log's first frames, and the Gaussian about the path that this makes
/// likeliest.
struct Names {
  std::vector<cairn::Association> associations;
  PathDensity density;
  double log_share;  ///< log p(n_1:t, z_1:t), the path integrated out by Laplace's approximation
};

/// `part` has these names, and the optimum is its.
[[nodiscard]] Names weighed(const LandmarkLog& log, const LandmarkLog& part, BatchOptimum optimum,
                            std::vector<cairn::Association> associations, const Map& empty);
/// The same with the optimum that is found from these poses.
[[nodiscard]] Names weighed(const LandmarkLog& log, const std::vector<cairn::SE2>& start,
                            std::vector<cairn::Association> associations, const Map& empty);

/// Names that the particles no longer have. Once all of them have taken one post for its neighbour none will
/// ever tell, and a map with two of such errors has no better one next to it. But when the first was made,
/// the other reading was nearly as likely: what is next to the likeliest names is looked at each time that
/// paths are drawn again, and the likeliest that differ are kept until the next time, each gone on by a
/// filter of its own. Much likelier is a matter of 25 nats, and until then nothing is decided: the errors of
/// a camera's ranges belong together, which the model does not know. Taken for every nat, UTIAS' robots made
/// twenty landmarks of fifteen; for ten, one in ten was led astray.
class OtherNames {
public:
  /// The log has to outlive it.
  OtherNames(const LandmarkLog& log, const SlamOptions& options);
  /// One that goes on with what another kept().
  OtherNames(const LandmarkLog& log, const SlamOptions& options, std::vector<Reading> kept);

  /// Much likelier names of as many frames than these, which are the likeliest of the particles'; nothing
  /// where there are none. To be asked of ever more frames. O(frames log landmarks) for each move over a gap,
  /// and up to seven sparse least squares for each of some forty readings. The same for any number of
  /// threads.
  [[nodiscard]] std::optional<Names> much_likelier(const Names& names);

  [[nodiscard]] const std::vector<Reading>& kept() const noexcept { return kept_; }

private:
  [[nodiscard]] std::vector<Names> solved(std::vector<Reading> readings) const;
  [[nodiscard]] Names settled(Names names) const;
  [[nodiscard]] std::optional<Reading> gone_on(const Reading& kept, std::size_t until,
                                               std::size_t which) const;
  [[nodiscard]] std::vector<Reading> next_to(const Names& names) const;

  const LandmarkLog& log_;
  SlamOptions options_;
  Map empty_;
  std::vector<Reading> kept_;
};

}  // namespace fastslam
