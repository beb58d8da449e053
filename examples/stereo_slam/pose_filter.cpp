// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "pose_filter.hpp"

#include <cmath>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/unscented.hpp>

namespace stereo_slam {
namespace {

/// What the filter of that name answers to `step`: the same for each.
template <class Step>
bool with_filter(Motion motion, double gate, const Step& step) {
  switch (motion) {
    case Motion::off:
      return false;
    case Motion::ekf:
      return step(cairn::Extended{.gate = gate});
    case Motion::iterated:
      return step(cairn::Extended{.gate = gate, .iterations = 10});
    case Motion::ukf:
      return step(cairn::Unscented{.gate = gate});
  }
  return false;
}

}  // namespace

double seconds_between(double from, double to) {
  constexpr double usual = 0.1;
  const double dt = to - from;
  return dt > 0 && std::isfinite(dt) ? dt : usual;
}

Moving SteadyTwist::propagate(const State& x, const Control&, double dt) const {
  const cairn::Vector<6> u = x.part<1>();
  return Moving(x.part<0>() * cairn::SE3::exp(dt * u), u);
}

/// T exp(d) exp(u dt) = T exp(u dt) exp(Ad(exp(-u dt)) d), and the right Jacobian for u.
cairn::Matrix<12> SteadyTwist::jacobian(const State& x, const Control&, double dt) const {
  const cairn::Vector<6> step = dt * x.part<1>();
  cairn::Matrix<12> F = cairn::Matrix<12>::Identity();
  F.topLeftCorner<6, 6>() = cairn::SE3::exp(-step).adjoint();
  F.topRightCorner<6, 6>() = dt * cairn::SE3::right_jacobian(step);
  return F;
}

cairn::Matrix<12> SteadyTwist::noise(const State&, const Control&, double dt) const {
  cairn::Matrix<12> Q = cairn::Matrix<12>::Zero();
  for (int i = 0; i < 6; ++i) {
    const double root = i < 3 ? acceleration : turning, density = root * root;
    Q(i, i) = density * dt * dt * dt / 3;
    Q(i, 6 + i) = Q(6 + i, i) = density * dt * dt / 2;
    Q(6 + i, 6 + i) = density * dt;
  }
  return Q;
}

cairn::Matrix<6, 12> LocatedPose::jacobian(const State&) const {
  return cairn::Matrix<6, 12>::Identity();
}

PoseFilter::PoseFilter(const MotionOptions& options)
    : options_(options), gate_(cairn::chi_square_quantile(1 - options.refused_probability, 6)) {}

void PoseFilter::begin(const cairn::SE3& T_world_camera, const cairn::Matrix<6>& covariance) {
  if (!on()) return;
  cairn::Matrix<12> P = cairn::Matrix<12>::Zero();
  P.topLeftCorner<6, 6>() = covariance;
  for (int i = 0; i < 6; ++i) {
    const double sigma = i < 3 ? options_.first_speed : options_.first_turn;
    P(6 + i, 6 + i) = sigma * sigma;
  }
  belief_ = {Moving(T_world_camera, cairn::Vector<6>::Zero()), P};
}

void PoseFilter::predict(double dt) {
  if (!belief_) return;
  const bool moved = with_filter(options_.filter, gate_, [&](const auto& filter) {
    return filter.predict(*belief_, options_.process, dt) == cairn::Status::accepted;
  });
  if (!moved) belief_.reset();
}

bool PoseFilter::update(const cairn::SE3& T_world_camera, const cairn::Matrix<6>& covariance) {
  if (!belief_) return false;
  return with_filter(options_.filter, gate_, [&](const auto& filter) {
    return filter.update(*belief_, LocatedPose{covariance}, T_world_camera).accepted();
  });
}

std::optional<cairn::Gaussian<cairn::SE3>> PoseFilter::pose() const {
  if (!belief_) return std::nullopt;
  return cairn::Gaussian<cairn::SE3>{belief_->mean.part<0>(), belief_->covariance.topLeftCorner<6, 6>()};
}

bool PoseFilter::knows() const {
  if (!belief_) return false;
  const cairn::Vector<6> variances = belief_->covariance.diagonal().head<6>();
  return variances.head<3>().maxCoeff() < options_.lost_position * options_.lost_position &&
         variances.tail<3>().maxCoeff() < options_.lost_angle * options_.lost_angle;
}

}  // namespace stereo_slam
