// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The navigator: search, then track; search again after a loss. The composition that a user would write.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include <cairn/core/linalg.hpp>
#include <cairn/field/correlation.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch_filter.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/field/patch_noise.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kalman.hpp>

namespace correlation_navigation {

enum class Mode { searching, tracking };

/// What one frame did.
struct NavigatorStep {
  Mode mode = Mode::searching;
  bool searched = false;                                     ///< a correlation search ran at this frame
  bool fixed = false;                                        ///< and its fix was accepted
  cairn::PatchVerdict frame = cairn::PatchVerdict::outside;  ///< of the filter, where it ran
};

struct NavigatorOptions {
  cairn::PatchFilter filter{.iterations = 6, .free_bias = true, .free_gain = true, .gate = 4.0};
  cairn::CorrelationSearchOptions search{};
  int frames_until_lost = 3;              ///< refused in a row
  double sigma_until_lost = 90;           ///< of the position, where Gauss-Newton steps no longer reach [m]
  double smallest_radius = 400;           ///< of a search [m]
  double velocity_sigma_after_loss = 10;  ///< added to the belief [m/s]
  double widen_fix = 3;  ///< a fix's sigmas: its frame goes through the filter too, and must not count twice
};

/// State [x, y, v_x, v_y, L_x, L_y, psi]; see patch_model.hpp.
class Navigator {
public:
  using Belief = cairn::Gaussian<cairn::Vector<7>>;

  /// Starts lost, with this belief: its position's sigmas say how far to search.
  Navigator(const cairn::BsplineMap& map, const cairn::PatchShape& shape, const cairn::PatchNoise& noise,
            const cairn::PlanarMotion& motion, const Belief& start, NavigatorOptions options = {})
      : map_(map),
        shape_(shape),
        noise_(noise),
        motion_(motion),
        belief_(start),
        options_(std::move(options)) {}

  /// Moves by dead reckoning: ground velocity u for dt seconds.
  void predict(const cairn::Vector<2>& u, double dt) {
    static_cast<void>(cairn::Kalman{}.predict(belief_, motion_, dt, u));
  }

  /// Takes in a frame seen with this believed heading.
  NavigatorStep update(std::span<const double> z, double heading) {
    NavigatorStep step;
    if (mode_ == Mode::tracking &&
        (refused_ >= options_.frames_until_lost || sigma() > options_.sigma_until_lost))
      lose();
    if (mode_ == Mode::searching) search(z, heading, step);
    if (mode_ == Mode::tracking) {
      step.frame =
          options_.filter.update(belief_, cairn::PlanarPlacement{heading}, map_, shape_, z, noise_, scratch_)
              .verdict;
      refused_ = step.frame == cairn::PatchVerdict::accepted ? 0 : refused_ + 1;
    }
    step.mode = mode_;
    return step;
  }

  [[nodiscard]] const Belief& belief() const noexcept { return belief_; }
  /// The larger standard deviation of the position along the axes.
  [[nodiscard]] double sigma() const {
    return std::sqrt(std::max(belief_.covariance(0, 0), belief_.covariance(1, 1)));
  }

private:
  /// Frames that do not fit mean that something happened which the models do not know: a gust, a manoeuvre.
  /// The velocity is trusted less from here on, so that the search looks where the vehicle may have got to.
  void lose() {
    mode_ = Mode::searching;
    const double variance = options_.velocity_sigma_after_loss * options_.velocity_sigma_after_loss;
    belief_.covariance.block<2, 2>(2, 2) += variance * cairn::Matrix<2>::Identity();
  }

  void search(std::span<const double> z, double heading, NavigatorStep& step) {
    cairn::CorrelationSearchOptions options = options_.search;
    options.radius = std::max(options_.smallest_radius, 3.0 * sigma());
    const cairn::Vector<7> s = belief_.covariance.diagonal().cwiseSqrt();
    options.scale_sigma = std::max(s(4) / belief_.mean(4), s(5) / belief_.mean(5));
    options.heading_sigma = s(6);
    const cairn::Fix fix = cairn::correlation_search(
        map_, shape_, z, cairn::PlanarPlacement{heading}.placement(belief_.mean), options);
    step.searched = true;
    step.fixed = fix.accepted();
    if (!fix.accepted()) return;
    // The fix replaces what was believed of the position; nothing else is known to go with it.
    belief_.mean(0) = fix.placement.x;
    belief_.mean(1) = fix.placement.y;
    belief_.covariance.topRows<2>().setZero();
    belief_.covariance.leftCols<2>().setZero();
    belief_.covariance.topLeftCorner<2, 2>() = options_.widen_fix * options_.widen_fix * fix.covariance;
    mode_ = Mode::tracking;
    refused_ = 0;
  }

  const cairn::BsplineMap& map_;
  cairn::PatchShape shape_;
  cairn::PatchNoise noise_;
  cairn::PlanarMotion motion_;
  Belief belief_;
  NavigatorOptions options_;
  cairn::PatchScratch scratch_;
  Mode mode_ = Mode::searching;
  int refused_ = 0;
};

}  // namespace correlation_navigation
