// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Lines seen by three cameras, as a sensor of landmarks.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/geometry/anchored_line.hpp>
#include <cairn/geometry/line.hpp>
#include <cairn/geometry/line_triangulation.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/slam/landmark_map.hpp>

#include "segments.hpp"

namespace line_slam {

/// A line and what has been seen of it: a landmark of four dimensions. The part that was seen is remembered
/// to tell lines apart that go on in each other, and to draw them.
struct MappedLine {
  cairn::AnchoredLine line{};
  double low = 0, high = 1;      ///< shares of the way between the anchor's two rays
  std::uint32_t edge = no_edge;  ///< of the sighting that it began with: to judge, not to estimate
  // World frame, as the numbers say: of what is looked at far more often than it changes.
  cairn::Vector<3> from = cairn::Vector<3>::Zero(), to = cairn::Vector<3>::Zero(),
                   direction = cairn::Vector<3>::Zero();

  /// Where the part that was seen ends. False where it is not in front of where it was first seen.
  bool place() {
    const auto a = line.point(low), b = line.point(high);
    if (!a || !b || !((*b - *a).norm() > 0)) return false;
    from = *a;
    to = *b;
    direction = (to - from).normalized();
    return true;
  }
  [[nodiscard]] cairn::Vector<3> middle() const { return 0.5 * (from + to); }
};

}  // namespace line_slam

template <>
struct cairn::manifold_traits<line_slam::MappedLine> {
  using Scalar = double;
  using Tangent = Vector<4>;
  static constexpr int dof = 4;
  static line_slam::MappedLine retract(const line_slam::MappedLine& x, const Tangent& d) {
    line_slam::MappedLine y = x;
    y.line = cairn::retract(x.line, d);
    return y;
  }
  static Tangent local(const line_slam::MappedLine& x, const line_slam::MappedLine& y) {
    return cairn::local(x.line, y.line);
  }
  static bool finite(const line_slam::MappedLine& x) { return manifold_traits<AnchoredLine>::finite(x.line); }
};

namespace line_slam {

/// The six distances of the ends of a sighting's segments from the projected line: zero but for noise.
struct EndsOfSighting {
  using State = cairn::SE3;
  using Part = MappedLine;
  using Measurement = cairn::Vector<6>;

  const Rig& rig;
  const LineSighting& sighting;
  double sigma;  ///< [pixels]

  [[nodiscard]] Measurement measured() const {
    Measurement zero = Measurement::Zero();
    for (const cairn::LineSegment& s : sighting.seen)  // what is not finite is not zero
      for (const cairn::Vector<2>* end : {&s.from, &s.to}) zero(0) += 0 * ((*end)(0) + (*end)(1));
    return zero;
  }
  [[nodiscard]] Measurement predict(const State& x, const Part& m) const {
    const InRig line(x, m);
    Measurement e;
    for (std::size_t c = 0; c < cameras; ++c)
      cairn::put(e, static_cast<int>(2 * c), 0,
                 rig[c].see(line.moment, line.direction, sighting.seen[c]).distance);
    return e;
  }
  [[nodiscard]] cairn::Matrix<6, 4> part_jacobian(const State& x, const Part& m) const {
    const InRig line(x, m);
    const cairn::Matrix<6, 4> by_numbers = m.line.pluecker_jacobian();
    cairn::Matrix<6, 4> turned;  // in the rig's frame
    for (int j = 0; j < 4; ++j) {
      const cairn::Vector<3> d = line.R.rotate(cairn::part_of<3, 1>(by_numbers, 3, j));
      cairn::put(turned, 0, j,
                 cairn::Vector<3>(line.R.rotate(cairn::part_of<3, 1>(by_numbers, 0, j)) +
                                  cairn::detail::cross<double>(line.t, d)));
      cairn::put(turned, 3, j, d);
    }
    cairn::Matrix<6, 4> J;
    for (std::size_t c = 0; c < cameras; ++c)
      cairn::put(J, static_cast<int>(2 * c), 0,
                 cairn::product(rig[c].see(line.moment, line.direction, sighting.seen[c]).J_line, turned));
    return J;
  }
  [[nodiscard]] cairn::Matrix<6> state_jacobian(const State& x, const Part& m) const {
    const InRig line(x, m);
    cairn::Matrix<6> J;
    for (std::size_t c = 0; c < cameras; ++c)
      cairn::put(J, static_cast<int>(2 * c), 0,
                 rig[c].see(line.moment, line.direction, sighting.seen[c]).J_pose);
    return J;
  }
  [[nodiscard]] cairn::Matrix<6> noise(const State&, const Part&) const {
    return sigma * sigma * cairn::Matrix<6>::Identity();
  }

private:
  /// The line's Pluecker coordinates in the rig's frame, and the motion that takes them there.
  struct InRig {
    cairn::SO3 R;
    cairn::Vector<3> t, moment, direction;
    InRig(const State& x, const Part& m) {
      const cairn::SE3 T = x.inverse() * m.line.anchor();
      const cairn::Vector<6> L = m.line.pluecker();
      R = T.rotation();
      t = T.translation();
      direction = R.rotate(cairn::part_of<3, 1>(L, 3, 0));
      moment = R.rotate(cairn::part_of<3, 1>(L, 0, 0)) + cairn::detail::cross<double>(t, direction);
    }
  };
};

/// LandmarkSensor of three cameras on a pose of six dimensions.
struct LineSensor {
  using State = cairn::SE3;
  using Part = MappedLine;
  using Measurement = LineSighting;

  std::shared_ptr<const Rig> rig = std::make_shared<const Rig>(three_cameras());
  double sigma = 0.5;                          ///< of a segment's ends across it [pixels]
  double farthest = 30;                        ///< what the cameras see, and what is compared [m]
  double surest = 0.25;                        ///< a line begins where its distance is known to this share
  double reach_turn = 0.1, reach_shift = 0.5;  ///< a line is a candidate within these [rad, m] and 4 sigma

  [[nodiscard]] EndsOfSighting of(const Measurement& z) const { return {*rig, z, sigma}; }

  /// Not finite where the line is not in front of the middle camera.
  [[nodiscard]] Part initialise(const State& x, const Measurement& z) const {
    const cairn::PinholeCamera& camera = (*rig)[0].camera();
    const cairn::LineSegment normalised{*camera.normalise(z.seen[0].from), *camera.normalise(z.seen[0].to)};
    const auto line = cairn::AnchoredLine::at(x, normalised, z.line.line);
    MappedLine m;
    m.edge = z.edge;
    if (line) m.line = *line;
    if (!line || !m.place())
      m.line = m.line.with(cairn::Vector<4>::Constant(std::numeric_limits<double>::quiet_NaN()));
    return m;
  }
  [[nodiscard]] bool determines(const Measurement& z) const {
    return z.depth < surest * z.line.line.point().norm();
  }
  /// Some of it is near enough to be seen.
  [[nodiscard]] bool in_reach(const State& x, const Part& m) const {
    const double length = (m.to - m.from).norm();
    const double at = std::clamp(m.direction.dot(x.translation() - m.from), 0.0, length);
    return (m.from + at * m.direction - x.translation()).squaredNorm() < farthest * farthest;
  }
  /// The line runs about where the sighting does and was seen beside it: no line of another wall needs more
  /// than this look. What is farther off than motion and noise allow is no candidate.
  [[nodiscard]] bool may_be(const State& x, const Measurement& z, const Part& m) const {
    const double turn = reach_turn + 4 * z.tilt;
    if (turn < 1.5) {
      const double cosine = x.rotation().rotate(z.line.line.direction()).dot(m.direction);
      if (std::abs(cosine) < std::cos(turn)) return false;
    }
    const cairn::Vector<3> arm = x * z.line.line.point() - m.from;
    const cairn::Vector<3> off = arm - m.direction.dot(arm) * m.direction;
    const double reach = reach_shift + 4 * z.depth;
    if (off.squaredNorm() > reach * reach) return false;
    const double a = m.direction.dot(x * z.line.line.at(z.line.low) - m.from),
                 b = m.direction.dot(x * z.line.line.at(z.line.high) - m.from);
    const double length = (m.to - m.from).norm();
    const double common = std::min(std::max(a, b), length) - std::max(std::min(a, b), 0.0);
    return common + 2 * z.depth > least_overlap * std::min(std::abs(b - a), length);
  }
  /// What was seen of the line grows by where the rays of the ends pass it, where they cross it well.
  void note(Part& m, const State& x, const Measurement& z) const {
    if (!m.place()) return;
    const cairn::Line line = x.inverse() * cairn::Line::along(m.from, m.direction);
    for (std::size_t c = 0; c < cameras; ++c)
      for (const cairn::Vector<2>* end : {&z.seen[c].from, &z.seen[c].to}) {
        if (std::abs((*rig)[c].ray(*end).normalized().dot(line.direction())) > 0.95) continue;
        const auto at = (*rig)[c].coordinate(line, *end);
        const auto share = at ? m.line.share(x * line.at(*at)) : std::nullopt;
        if (!share || !m.line.point(*share)) continue;
        m.low = std::min(m.low, *share);
        m.high = std::max(m.high, *share);
      }
    static_cast<void>(m.place());
  }

private:
  static constexpr double least_overlap = 0.3;
};

using Map = cairn::LandmarkMap<LineSensor, cairn::Unscented>;
using Belief = cairn::MappedPaths<Map>;

}  // namespace line_slam
