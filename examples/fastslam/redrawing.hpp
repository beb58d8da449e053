// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// All paths drawn again, from the distribution that the filter is of.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/manifold/se2.hpp>

#include "landmark_log.hpp"
#include "names.hpp"
#include "slam.hpp"

namespace fastslam {

struct Redrawn {
  Belief belief;
  std::size_t doubted = 0;  ///< names that were given and are not believed
};

/// All paths drawn again: from the Gaussian about the optimum of the log so far, and led from there to what
/// the particles' own model says of them, which is the filter's distribution. The filter never goes back:
/// with that alone a bend between two visits stays, and where no particle came back right, none ever will.
/// Weights of the model over the Gaussian alone would leave few paths of thousands of poses. So the ratio's
/// power grows from 0 to 1 by as much as leaves half of the paths as an effective number, they are resampled,
/// and each is moved by steps that keep the Gaussian as it is and are taken with the probability that makes
/// up for the ratio (P. Del Moral, A. Doucet, A. Jasra, "Sequential Monte Carlo samplers", JRSS B 68, 2006;
/// the step of S. Cotter, G. Roberts, A. Stuart, D. White, Statistical Science 28, 2013, whose length does
/// not depend on how many numbers a path has). O(M frames log landmarks) for each power, and a sparse least
/// squares. Where sightings have no names, sixteen particles are asked for theirs, and each path is drawn
/// with those of one of them: as often as they are likely when the path that they go with is integrated out,
/// by Laplace's approximation, for what a particle's weight says of its names is blurred by the chance bends
/// of its own path. The ratio is over both, and so makes up for what the approximation errs by. `optimum` is
/// where the last one was, and then where that of the likeliest names is. Names that are given are believed
/// but where all else contradicts them: a step of the filter has to, for its map may have drifted, and only
/// the whole log tells.
[[nodiscard]] Redrawn redrawn(const Belief& belief, const LandmarkLog& log, const SlamOptions& options,
                              std::vector<cairn::SE2>& optimum, OtherNames& others);

/// What is uncertain since before the paths were last drawn is held by the particles' ancestors of then, and
/// resampling leaves fewer of them with every step: a covariance of few draws is too small, and the paths
/// that are left bend as the ones that were right by chance. Names are another matter: drawing decides what
/// the ancestors leave open, and a hundred frames tell more of it than ten.
/// `last` is the step when they were.
[[nodiscard]] bool redraw_is_due(const Belief& belief, const LandmarkLog& log, std::uint64_t last,
                                 const SlamOptions& options);

/// Means of the densities that a particle's poses were drawn from: without the jitter of the draws.
[[nodiscard]] std::vector<cairn::SE2> means_of(const Belief& belief, std::size_t particle);

}  // namespace fastslam
