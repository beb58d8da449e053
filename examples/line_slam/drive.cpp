// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "drive.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>

namespace line_slam {

namespace {

using cairn::SE3;
using cairn::Vector;

/// Standard deviations of a step of so many metres, in the camera's axes.
cairn::Matrix<6> noise_of(const DriveOptions& o, double metres) {
  const double slip = o.slip * metres, turn = o.turn * metres, tilt = o.tilt * metres;
  Vector<6> sigma;
  sigma << slip, slip / 3, slip, tilt, turn, tilt;  // the y axis is the vertical
  return sigma.cwiseAbs2().asDiagonal();
}

}  // namespace

Drive simulated_drive(const DriveOptions& o, const OnDrawn& on_drawn) {
  if (!(o.metres > 0 && o.metres <= 100000) || !(o.step >= 0.05 && o.step <= 5))
    cairn::raise("line_slam: expected a drive of up to 100 km in steps of 0.05 to 5 m");
  Drive drive{.options = o, .campus = Campus(o.seed)};
  drive.truth = Campus::drive(o.metres, o.step);
  const std::size_t count = drive.truth.size();
  drive.frames.resize(count);
  const auto draw = [&](std::size_t k) {
    cairn::Random random(o.seed, 1000 + k);
    Frame& frame = drive.frames[k];
    if (k > 0) {
      const SE3 moved = drive.truth[k - 1].inverse() * drive.truth[k];
      const cairn::Matrix<6> noise = noise_of(o, moved.translation().norm());
      const Vector<6> error = cairn::sample(cairn::Gaussian<Vector<6>>{Vector<6>::Zero(), noise}, random);
      frame.moved = {cairn::retract(moved, error), noise};
    } else {
      frame.moved = {SE3(), 1e-12 * cairn::Matrix<6>::Identity()};
    }
    frame.detections = o.detector_kind == DetectorKind::lsd
                           ? detect_in_pictures(drive.campus, drive.rig, drive.truth[k], o.detector)
                           : detect(drive.campus, drive.rig, drive.truth[k], o.detector, random);
    for (LineSighting& sighting : match(drive.rig, frame.detections, o.matching))
      frame.seen.push_back({std::move(sighting), {}});
  };
  // Two frames a thread at a time: to draw pictures and to find lines in them takes most of a second each.
  const std::size_t at_a_time = std::size_t{2} * std::max(1U, o.threads);
  for (std::size_t done = 0; done < count;) {
    const std::size_t from = done, now = std::min(at_a_time, count - done);
    cairn::parallel_for(now, o.threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) draw(from + k);
    });
    done += now;
    if (!on_drawn || on_drawn(done, count)) continue;
    drive.truth.resize(done);
    drive.frames.resize(done);
    break;
  }
  return drive;
}

}  // namespace line_slam
