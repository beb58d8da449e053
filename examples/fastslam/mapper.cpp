// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "mapper.hpp"

#include <cmath>
#include <string>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/status.hpp>

#include "redrawing.hpp"
#include "scores.hpp"

namespace fastslam {

Mapper::Mapper(const LandmarkLog& log, const SlamOptions& options)
    : log_(log),
      options_(options),
      belief_(cairn::SE2(), Map(log.sensor, options.landmarks), options.particles),
      spread_(belief_),
      others_(log, options) {}

void Mapper::step() {
  const Frame& frame = log_.frames[steps_.size()];
  const cairn::ConditionalFilter filter{
      .resample_below = options_.resample_below, .seed = options_.seed, .threads = options_.threads};
  const auto motion = [&](const cairn::SE2& x, std::size_t) { return frame.motion_from(x); };
  const cairn::MappingStep did = options_.proposal == ProposalKind::motion
                                     ? filter.step(belief_, motion, cairn::FromMotion{}, frame.seen)
                                     : filter.step(belief_, motion, cairn::FromLandmarks{}, frame.seen);
  if (!did.accepted()) cairn::raise("frame " + std::to_string(steps_.size()) + ": " + explain(did.status));
  StepRecord& record = steps_.emplace_back();
  record.time = frame.time;
  record.effective_size = did.effective_size;
  record.resampled = did.resampled;
  record.sightings = frame.seen.size();
  if (redraws() && redraw_is_due(belief_, log_, spread_.step(), options_))
    redraw();
  else
    describe();
}

void Mapper::finish() {
  if (redraws() && !steps_.empty() && !steps_.back().redrawn) redraw();
}

void Mapper::redraw() {
  auto [belief, doubted] = redrawn(belief_, log_, options_, optimum_, others_);
  belief_ = std::move(belief);
  doubted_ = doubted;
  spread_.drawn(belief_);
  steps_.back().redrawn = belief_.particles().effective_size();
  describe();
}

void Mapper::describe() {
  StepRecord& s = steps_.back();
  s.landmarks = belief_[0].map.size();
  s.pose = redraws() ? spread_.pose(belief_) : belief_.pose();
  s.nees.reset();
  if (const cairn::StampedPose2* truth = log_.start ? last_until(log_.truth, s.time) : nullptr)
    if (const double nees = cairn::nees(s.pose, log_.start->inverse() * truth->pose);
        std::isfinite(nees))  // one particle that was drawn again has no covariance
      s.nees = nees;
}

}  // namespace fastslam
