// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "scores.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include <cairn/core/statistics.hpp>

namespace fastslam {

namespace {

using cairn::SE2;
using cairn::StampedPose2;
using cairn::Vector;

void measure_path(Results& r, const LandmarkLog& log) {
  if (log.truth.empty()) return;
  std::vector<Vector<2>> is, path, odometry;
  for (std::size_t k = 0; k < r.mean.size(); ++k)
    if (const StampedPose2* truth = last_until(log.truth, r.mean[k].time)) {
      is.push_back(truth->pose.translation());
      path.push_back(r.mean[k].pose.translation());
      odometry.push_back(r.odometry[k].pose.translation());
      r.truth.push_back({r.mean[k].time, truth->pose});
    }
  if (is.empty()) return;
  r.path_error = rms(path, is, rigid_fit(path, is));
  r.odometry_error = rms(odometry, is, rigid_fit(odometry, is));
}

/// Half of what a true landmark is away from the nearest other, in the median: a found one that is nearer to
/// a true one than this is hardly of its neighbour.
double half_spacing(const std::vector<Vector<2>>& truth) {
  std::vector<double> spacing(truth.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < truth.size(); ++i)
    for (std::size_t j = 0; j < truth.size(); ++j)
      if (i != j) spacing[i] = std::min(spacing[i], (truth[i] - truth[j]).norm());
  std::ranges::nth_element(spacing, spacing.begin() + std::ssize(spacing) / 2);
  return 0.5 * spacing[spacing.size() / 2];
}

const Vector<2>& nearest_to(const Vector<2>& place, const std::vector<Vector<2>>& truth) {
  return *std::ranges::min_element(truth, {}, [&](const Vector<2>& t) { return (t - place).squaredNorm(); });
}

/// Sum over the places, moved, of the squared distance to the nearest true one, each at most limit^2; more
/// than `enough` where it is at least that.
double misfit(const std::vector<Vector<2>>& found, const std::vector<Vector<2>>& truth, const SE2& by,
              double limit, double enough) {
  double sum = 0;
  for (std::size_t i = 0; i < found.size() && sum < enough; ++i) {
    const Vector<2> place = by * found[i];
    sum += std::min((nearest_to(place, truth) - place).squaredNorm(), limit * limit);
  }
  return sum;
}

/// The places that the pairs of the first four make likely are tried, and the motion refined by who is
/// nearest.
std::optional<SE2> fit_to_nearest(const std::vector<Vector<2>>& found, const std::vector<Vector<2>>& truth) {
  const double limit = half_spacing(truth);
  double least = std::numeric_limits<double>::infinity();
  std::optional<SE2> best;
  const std::size_t first = std::min<std::size_t>(4, found.size());
  for (std::size_t a = 0; a < first; ++a)
    for (std::size_t b = a + 1; b < first; ++b)
      for (const Vector<2>& p : truth)
        for (const Vector<2>& q : truth) {
          const double apart = (q - p).norm();
          if (apart == 0 || std::abs(apart - (found[b] - found[a]).norm()) > limit) continue;
          const SE2 by = rigid_fit({found[a], found[b]}, {p, q});
          const double sum = misfit(found, truth, by, limit, least);
          if (sum < least) least = sum, best = by;
        }
  for (int round = 0; best && round < 20; ++round) {
    std::vector<Vector<2>> near, is;
    for (const Vector<2>& place : found)
      if (const Vector<2>& nearest = nearest_to(*best * place, truth);
          (*best * place - nearest).norm() < limit) {
        near.push_back(place);
        is.push_back(nearest);
      }
    if (near.size() < 2) break;
    best = rigid_fit(near, is);
  }
  return best;
}

void measure_unnamed_landmarks(Results& r) {
  if (r.landmarks.size() < 2 || r.true_landmarks.size() < 2) return;
  std::vector<FoundLandmark> by_sightings = r.landmarks;
  std::ranges::stable_sort(by_sightings, std::ranges::greater{}, &FoundLandmark::sightings);
  std::vector<Vector<2>> found, is;
  for (const FoundLandmark& l : by_sightings) found.push_back(l.belief.mean);
  const std::optional<SE2> fit = fit_to_nearest(found, r.true_landmarks);
  if (!fit) return;
  for (const Vector<2>& place : found) is.push_back(nearest_to(*fit * place, r.true_landmarks));
  r.landmark_error = rms(found, is, *fit);
  r.T_truth_landmarks = fit;
}

void measure_landmarks(Results& r, const LandmarkLog& log) {
  if (!r.identities_known) return measure_unnamed_landmarks(r);
  std::vector<Vector<2>> found, is;
  for (const FoundLandmark& l : r.landmarks)
    if (const auto truth = log.landmarks.find(l.number); truth != log.landmarks.end()) {
      found.push_back(l.belief.mean);
      is.push_back(truth->second);
    }
  if (found.size() < 2) return;
  r.T_truth_landmarks = rigid_fit(found, is);
  r.landmark_error = rms(found, is, *r.T_truth_landmarks);
}

/// A path with the way gone at each of its places.
struct Track {
  std::vector<Vector<2>> places{};
  std::vector<double> way{};  ///< [m]
};
Track track_of(const std::vector<StampedPose2>& path) {
  Track track{places_of(path), {0}};
  for (std::size_t i = 1; i < track.places.size(); ++i)
    track.way.push_back(track.way.back() + (track.places[i] - track.places[i - 1]).norm());
  return track;
}
/// The point nearest to p of what is driven up to `reach` metres before and after a place of the track.
Vector<2> nearest_about(const Track& track, std::size_t place, const Vector<2>& p, double reach) {
  Vector<2> nearest = track.places[place];
  const auto from = std::ranges::lower_bound(track.way, track.way[place] - reach) - track.way.begin();
  for (auto i = static_cast<std::size_t>(from);
       i + 1 < track.places.size() && track.way[i + 1] <= track.way[place] + reach; ++i) {
    const Vector<2> step = track.places[i + 1] - track.places[i];
    const double length2 = step.squaredNorm();
    const double share = length2 > 0 ? (p - track.places[i]).dot(step) / length2 : 0;
    const Vector<2> at = track.places[i] + std::clamp(share, 0.0, 1.0) * step;
    if ((at - p).squaredNorm() < (nearest - p).squaredNorm()) nearest = at;
  }
  return nearest;
}

/// GPS beside the path. When a fix was taken is known by how far the wheels had turned, which slip: it is
/// held against what is driven within 30 m of there, once all lie on those places as well as they can. The
/// receiver of such a car jumps by tens of metres: the motion is fitted to the fixes that are nearest to the
/// path, four fifths of them, ten times over for either.
void measure_gps(Results& r, const LandmarkLog& log) {
  constexpr double reach = 30;
  const Track track = track_of(r.mean);
  std::vector<Vector<2>> fixes, path;
  std::vector<std::size_t> places;
  for (const GpsFix& fix : log.gps)
    if (const StampedPose2* pose = last_until(r.mean, fix.time);
        pose != nullptr && fix.time <= r.mean.back().time) {
      fixes.push_back(fix.place);
      places.push_back(static_cast<std::size_t>(pose - r.mean.data()));
      path.push_back(track.places[places.back()]);
    }
  if (fixes.size() < 4) return;
  std::vector<std::size_t> order(fixes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  SE2 fit = rigid_fit(fixes, path);
  std::vector<double> distance(fixes.size());
  for (int round = 0; round <= 20; ++round) {
    for (std::size_t i = 0; i < fixes.size(); ++i) {
      if (round >= 10) path[i] = nearest_about(track, places[i], fit * fixes[i], reach);
      distance[i] = (fit * fixes[i] - path[i]).norm();
    }
    std::ranges::sort(order, {}, [&](std::size_t i) { return std::pair(distance[i], i); });
    if (round == 20) break;
    std::vector<Vector<2>> from, to;
    for (std::size_t k = 0; k < order.size() * 4 / 5; ++k) {
      from.push_back(fixes[order[k]]);
      to.push_back(path[order[k]]);
    }
    fit = rigid_fit(from, to);
  }
  r.gps_median = distance[order[order.size() / 2]];
  for (const Vector<2>& fix : fixes) r.gps.emplace_back(fit * fix);
}

}  // namespace

const StampedPose2* last_until(const std::vector<StampedPose2>& path, double time) {
  const auto after = std::upper_bound(path.begin(), path.end(), time,
                                      [](double t, const StampedPose2& p) { return t < p.time; });
  return after == path.begin() ? nullptr : &*std::prev(after);
}

SE2 rigid_fit(const std::vector<Vector<2>>& from, const std::vector<Vector<2>>& to) {
  Vector<2> a = Vector<2>::Zero(), b = Vector<2>::Zero();
  const auto count = static_cast<double>(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    a += from[i] / count;
    b += to[i] / count;
  }
  double sine = 0, cosine = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vector<2> p = from[i] - a, q = to[i] - b;
    cosine += p(0) * q(0) + p(1) * q(1);
    sine += p(0) * q(1) - p(1) * q(0);
  }
  const cairn::SO2 turn(std::atan2(sine, cosine));
  return {turn, Vector<2>(b - turn * a)};
}

double rms(const std::vector<Vector<2>>& from, const std::vector<Vector<2>>& to, const SE2& by) {
  double sum = 0;
  for (std::size_t i = 0; i < from.size(); ++i) sum += (by * from[i] - to[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(from.size()));
}

std::vector<Vector<2>> places_of(const std::vector<StampedPose2>& path) {
  std::vector<Vector<2>> places;
  for (const StampedPose2& p : path) places.push_back(p.pose.translation());
  return places;
}

void measure(Results& r, const LandmarkLog& log) {
  measure_path(r, log);
  std::vector<double> nees;
  for (const StepRecord& step : r.steps)
    if (step.nees) nees.push_back(*step.nees);
  if (!nees.empty()) r.median_nees = cairn::median(std::move(nees));
  measure_landmarks(r, log);
  measure_gps(r, log);
}

}  // namespace fastslam
