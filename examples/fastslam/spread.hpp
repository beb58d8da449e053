// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How far the newest pose may be from where it is believed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/manifold/se2.hpp>

#include "point_sensor.hpp"

namespace fastslam {

/// Of fewer draws the guess that a covariance is has itself no covariance.
inline constexpr std::size_t least_particles_of_a_spread = 6;

/// What is known of the newest pose, by the particles and, as their ancestors die out, by all that were
/// drawn.
///
/// What is uncertain since before the last drawing is held by the particles' ancestors of then. A weight is
/// as much of the chance bends of its particle's own path since then as of whether its ancestor was right, so
/// that after some tens of frames a few ancestors are left by chance, and the spread of their descendants
/// says next to nothing of where the truth is. So by as great a share as the effective ancestors have been
/// lost, every pose that was drawn is taken with every motion since, as though what was seen since did not
/// tell which was right: the moments of that mixture. And the covariance of n draws is a guess itself: the
/// truth is spread about their mean as Student's t of n - 1, whose covariance is (n + 1)(n - 1) / (n (n - 5))
/// of it for three numbers (A. Gelman et al., "Bayesian Data Analysis", 2013, section 3.6).
class Spread {
public:
  explicit Spread(const Belief& belief) { drawn(belief); }
  /// As of a drawing at this step, which said this of the pose.
  Spread(std::uint64_t step, const cairn::Gaussian<cairn::SE2>& drawn) : step_(step), drawn_(drawn) {}

  /// The particles are independent draws, each its own ancestor.
  void drawn(const Belief& belief) {
    step_ = belief.steps();
    drawn_ = belief.pose();
  }
  /// Of the last drawing.
  [[nodiscard]] std::uint64_t step() const { return step_; }
  [[nodiscard]] const cairn::Gaussian<cairn::SE2>& drawn() const { return drawn_; }

  [[nodiscard]] cairn::Gaussian<cairn::SE2> pose(const Belief& belief) const {
    const auto n = static_cast<double>(belief.size());
    cairn::Gaussian<cairn::SE2> result = belief.pose();
    const double lost = belief.steps() == step_ ? 0 : 1 - belief.effective_ancestors(step_) / n;
    if (lost > 0) result = mixed(result, crossed(belief), lost);
    if (belief.size() >= least_particles_of_a_spread) result.covariance *= (n + 1) * (n - 1) / (n * (n - 5));
    return result;
  }

private:
  /// Every pose that was drawn with every motion since.
  [[nodiscard]] cairn::Gaussian<cairn::SE2> crossed(const Belief& belief) const {
    cairn::Particles<cairn::SE2> motions;
    motions.log_weights = belief.particles().log_weights;
    const std::vector<double> weights = belief.particles().weights();
    cairn::Matrix<3> within = cairn::Matrix<3>::Zero();
    for (std::size_t i = 0; i < belief.size(); ++i) {
      const auto& density = belief.newest(i).drawn_from;
      motions.states.push_back(belief.ancestor(i, step_).pose.inverse() * density.mean);
      within += weights[i] * density.covariance;
    }
    const cairn::Gaussian<cairn::SE2> motion = cairn::moments(motions);
    const cairn::Matrix<3> back = motion.mean.inverse().adjoint();
    return {drawn_.mean * motion.mean,
            cairn::Matrix<3>(back * drawn_.covariance * back.transpose() + motion.covariance + within)};
  }
  static cairn::Gaussian<cairn::SE2> mixed(const cairn::Gaussian<cairn::SE2>& a,
                                           const cairn::Gaussian<cairn::SE2>& b, double share_of_b) {
    const cairn::Vector<3> apart = cairn::local(a.mean, b.mean), step = share_of_b * apart;
    return {cairn::retract(a.mean, step),
            cairn::symmetrised(cairn::Matrix<3>((1 - share_of_b) * a.covariance + share_of_b * b.covariance +
                                                share_of_b * (1 - share_of_b) * apart * apart.transpose()))};
  }

  std::uint64_t step_ = 0;
  cairn::Gaussian<cairn::SE2> drawn_{};
};

}  // namespace fastslam
