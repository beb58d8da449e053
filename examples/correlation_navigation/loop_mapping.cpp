// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "loop_mapping.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <Eigen/LU>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/field/correlation.hpp>
#include <cairn/field/field_map.hpp>

namespace correlation_navigation {

namespace {

using cairn::FieldGrid;
using cairn::Matrix;
using cairn::PatchPlacement;
using cairn::Vector;

/// State of dead reckoning: error of the position and of the velocity.
struct Reckoning {
  Matrix<4> covariance;
  Matrix<4> since_start = Matrix<4>::Identity();  ///< transition from the start
};

struct Seen {
  LoopFrame frame;
  double heading;
  std::vector<double> z;
  Reckoning reckoning;
};

/// What was seen, put on the field's grid at the nearest nodes, averaged.
FieldGrid compose(const FieldGrid& like, const cairn::PatchShape& shape, const std::vector<Seen>& flight,
                  std::size_t count, bool corrected, double spacing) {
  FieldGrid sum(like.columns(), like.rows(), like.frame()), weight = sum;
  for (std::size_t k = 0; k < count; ++k) {
    const LoopFrame& f = flight[k].frame;
    const PatchPlacement at =
        PatchPlacement::of(corrected ? f.after_x : f.before_x, corrected ? f.after_y : f.before_y, spacing,
                           spacing, flight[k].heading);
    for (std::size_t i = 0; i < flight[k].z.size(); ++i) {
      const double x = at.x + shape.a(i) * at.along_x + shape.b(i) * at.across_x;
      const double y = at.y + shape.a(i) * at.along_y + shape.b(i) * at.across_y;
      const double column = std::round((x - like.frame().x0) / like.frame().dx);
      const double row = std::round((y - like.frame().y0) / like.frame().dy);
      if (!(column >= 0 && column < like.columns() && row >= 0 && row < like.rows())) continue;
      sum(static_cast<int>(column), static_cast<int>(row)) += flight[k].z[i];
      weight(static_cast<int>(column), static_cast<int>(row)) += 1.0;
    }
  }
  for (std::size_t i = 0; i < sum.values().size(); ++i)
    sum.values()[i] = weight.values()[i] > 0.0 ? sum.values()[i] / weight.values()[i] : cairn::void_value;
  return sum;
}

/// Void where either is.
FieldGrid difference(FieldGrid map, const FieldGrid& field) {
  for (std::size_t i = 0; i < map.values().size(); ++i) map.values()[i] -= field.values()[i];
  return map;
}

/// Over what is not void.
double rms(const FieldGrid& grid) {
  double squares = 0, count = 0;
  for (const double value : grid.values()) {
    if (std::isnan(value)) continue;
    squares += value * value;
    count += 1.0;
  }
  return count > 0.0 ? std::sqrt(squares / count) : 0.0;
}

/// Holes of single nodes between averaged samples would make most of a B-spline map void.
FieldGrid with_small_holes_filled(const FieldGrid& map) {
  FieldGrid filled = map;
  for (int r = 1; r + 1 < map.rows(); ++r)
    for (int c = 1; c + 1 < map.columns(); ++c) {
      if (!std::isnan(map(c, r))) continue;
      double sum = 0, count = 0;
      for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
          if (!std::isnan(map(c + x, r + y))) {
            sum += map(c + x, r + y);
            count += 1.0;
          }
      if (count >= 4.0) filled(c, r) = sum / count;
    }
  return filled;
}

/// Dead reckoning whose velocity drifts: what it errs by, and what is known of that.
class DeadReckoning {
public:
  DeadReckoning(const LoopFlight& flight, cairn::Random& random) : random_(random) {
    const double variance = flight.drift_sigma * flight.drift_sigma;
    state_.covariance = Vector<4>(1e-6, 1e-6, variance, variance).asDiagonal();
    drift_ = {flight.drift_sigma * random_.normal(), flight.drift_sigma * random_.normal()};  // {}: in order
    F_(0, 2) = F_(1, 3) = interval_ = flight.interval;
    Q_(2, 2) = Q_(3, 3) = flight.drift_density * flight.interval;
  }

  /// To the next frame.
  void advance() {
    error_ += interval_ * drift_;
    for (int i = 0; i < 2; ++i) drift_(i) += std::sqrt(Q_(2 + i, 2 + i)) * random_.normal();
    state_.covariance = (F_ * state_.covariance * F_.transpose() + Q_).eval();
    state_.since_start = (F_ * state_.since_start).eval();
  }

  [[nodiscard]] const Vector<2>& error() const { return error_; }
  [[nodiscard]] const Reckoning& state() const { return state_; }

private:
  cairn::Random& random_;
  Vector<2> drift_, error_ = Vector<2>::Zero();
  Reckoning state_;
  Matrix<4> F_ = Matrix<4>::Identity(), Q_ = Matrix<4>::Zero();
  double interval_ = 0;
};

/// Flies the circle and records what is seen and where dead reckoning puts it.
std::vector<Seen> fly(const FieldGrid& field, const LoopFlight& flight, double spacing, double noise) {
  const cairn::BsplineMap world(cairn::without_voids(field));
  const Vector<2> centre(0.5 * (field.frame().x0 + field.x_end()), 0.5 * (field.frame().y0 + field.y_end()));
  const std::size_t frames = frames_of(flight);
  cairn::Random random(flight.seed, 3);
  DeadReckoning reckoning(flight, random);
  std::vector<Seen> seen;
  cairn::PatchSamples samples;
  for (std::size_t k = 0; k < frames; ++k) {
    if (k > 0) reckoning.advance();
    const double time = static_cast<double>(k) * flight.interval;
    const double angle = time * flight.velocity / flight.radius;
    const double heading = angle + 0.5 * std::numbers::pi;
    const Vector<2> truth = centre + flight.radius * Vector<2>(std::cos(angle), std::sin(angle));
    cairn::sample_patch(world, flight.shape,
                        PatchPlacement::of(truth(0), truth(1), spacing, spacing, heading), samples);
    if (samples.count_inside < flight.shape.size())
      cairn::raise("loop: expected a field of at least " +
                   std::to_string(2.0 * flight.radius +
                                  2.0 * spacing * std::hypot(flight.shape.along(), flight.shape.half_width)) +
                   " m each way");
    for (double& value : samples.value) value += noise * random.normal();
    const Vector<2> believed = truth + reckoning.error();
    const Matrix<4>& P = reckoning.state().covariance;
    const double sigma = std::sqrt(P(0, 0) + P(1, 1));
    seen.push_back(
        {{time, truth(0), truth(1), believed(0), believed(1), believed(0), believed(1), sigma, sigma},
         heading,
         samples.value,
         reckoning.state()});
    if (flight.on_frame) flight.on_frame();
  }
  return seen;
}

/// Looks for the last frame in a map of the first ones.
cairn::Fix recognise_start(const FieldGrid& like, const LoopFlight& flight, const std::vector<Seen>& seen,
                           double spacing) {
  const FieldGrid start_map =
      with_small_holes_filled(compose(like, flight.shape, seen, flight.start_frames, false, spacing));
  const Seen& last = seen.back();
  return cairn::correlation_search(
      cairn::BilinearMap(start_map), flight.shape, last.z,
      PatchPlacement::of(last.frame.before_x, last.frame.before_y, spacing, spacing, last.heading),
      {.radius = std::max(10.0 * spacing, 3.0 * last.frame.sigma_before), .smallest_share = 0.5});
}

/// Conditions all frames on the fix of the last one: the covariance of frames k and n is P_k Phi(n, k)^T, so
/// frame k moves by P_k Phi^T H^T S^-1 (fix - position of n), as a smoother over the whole loop would do.
void correct(std::vector<Seen>& flight, const Vector<2>& fix, const Matrix<2>& fix_covariance) {
  const Seen& last = flight.back();
  const Vector<2> innovation = fix - Vector<2>(last.frame.before_x, last.frame.before_y);
  const Matrix<2> S = last.reckoning.covariance.topLeftCorner<2, 2>() + fix_covariance;
  const Matrix<4> to_last = last.reckoning.since_start;
  for (Seen& seen : flight) {
    // Phi(n, k) = Phi(n, 0) Phi(k, 0)^-1, and the inverse of [I, tI; 0, I] is [I, -tI; 0, I].
    Matrix<4> back = seen.reckoning.since_start;
    back.topRightCorner<2, 2>() *= -1.0;
    const Matrix<4, 2> cross = (seen.reckoning.covariance * (to_last * back).transpose()).leftCols<2>();
    const Matrix<4, 2> gain = cross * S.inverse();
    const Vector<4> step = gain * innovation;
    const Matrix<4> covariance = seen.reckoning.covariance - gain * cross.transpose();
    seen.frame.after_x = seen.frame.before_x + step(0);
    seen.frame.after_y = seen.frame.before_y + step(1);
    seen.frame.sigma_after = std::sqrt(std::max(0.0, covariance(0, 0) + covariance(1, 1)));
  }
}

/// Fills in what the maps before and after differ from the field by.
void compare_maps(const FieldGrid& field, const FieldGrid& before, const FieldGrid& after,
                  LoopResult& result) {
  cairn::RunningMoments mapped;
  for (std::size_t i = 0; i < before.values().size(); ++i)
    if (!std::isnan(before.values()[i]) && !std::isnan(field.values()[i])) mapped.add(field.values()[i]);
  result.field_deviation = mapped.standard_deviation();
  result.map_error_before = difference(before, field);
  result.map_error_after = difference(after, field);
  result.map_rms_before = rms(*result.map_error_before);
  result.map_rms_after = rms(*result.map_error_after);
}

/// Fills in the frames, and how far from the truth they were put.
void compare_placements(const std::vector<Seen>& seen, LoopResult& result) {
  double squares_before = 0, squares_after = 0;
  for (const Seen& s : seen) {
    const LoopFrame& f = s.frame;
    squares_before += std::pow(f.before_x - f.truth_x, 2) + std::pow(f.before_y - f.truth_y, 2);
    squares_after += std::pow(f.after_x - f.truth_x, 2) + std::pow(f.after_y - f.truth_y, 2);
    result.frames.push_back(f);
  }
  result.placement_rms_before = std::sqrt(squares_before / static_cast<double>(seen.size()));
  result.placement_rms_after = std::sqrt(squares_after / static_cast<double>(seen.size()));
}

}  // namespace

std::size_t frames_of(const LoopFlight& flight) {
  const double length = 2.0 * std::numbers::pi * flight.radius;
  return static_cast<std::size_t>(length / (flight.velocity * flight.interval)) + 3;
}

LoopResult fly_loop(const FieldGrid& field, const LoopFlight& flight) {
  cairn::RunningMoments moments;
  for (const double value : field.values())
    if (!std::isnan(value)) moments.add(value);
  const double spacing = std::max(field.frame().dx, field.frame().dy);
  std::vector<Seen> seen = fly(field, flight, spacing, flight.sensor_noise * moments.standard_deviation());

  LoopResult result;
  const cairn::Fix fix = recognise_start(field, flight, seen, spacing);
  result.closed = fix.accepted();
  const FieldGrid before = compose(field, flight.shape, seen, seen.size(), false, spacing);
  if (result.closed) {
    const LoopFrame& last = seen.back().frame;
    result.closing_error = std::hypot(fix.placement.x - last.truth_x, fix.placement.y - last.truth_y);
    // Besides its own covariance a fix against composed samples errs by where in its cell a sample fell.
    const double cell = spacing * spacing / 12.0;
    correct(seen, Vector<2>(fix.placement.x, fix.placement.y), fix.covariance + cell * Matrix<2>::Identity());
  }
  compare_maps(field, before, compose(field, flight.shape, seen, seen.size(), true, spacing), result);
  compare_placements(seen, result);
  return result;
}

}  // namespace correlation_navigation
