// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "naming.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include <cairn/core/parallel.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/gaussian.hpp>

#include "scores.hpp"

namespace fastslam {

namespace {

using cairn::Matrix;
using cairn::SE2;
using cairn::Vector;

/// A frame before which the motion is so uncertain that a landmark can be mistaken for its neighbour.
struct Gap {
  std::size_t frame = 0;
  double metres = 0, radians = 0;  ///< deviations
};

/// The most uncertain ones, by their frames.
std::vector<Gap> widest_gaps(const LandmarkLog& log, std::size_t frames) {
  constexpr std::size_t most = 12;
  constexpr double least = 0.2;
  std::vector<Gap> gaps;
  for (std::size_t k = 1; k < frames; ++k) {
    const Matrix<3>& covariance = log.frames[k].moved.covariance;
    const double metres = std::sqrt(covariance(0, 0) + covariance(1, 1));
    if (metres > least) gaps.push_back({k, metres, std::sqrt(covariance(2, 2))});
  }
  std::ranges::sort(gaps, std::greater<>{}, [](const Gap& g) { return std::pair(g.metres, g.frame); });
  if (gaps.size() > most) gaps.resize(most);
  std::ranges::sort(gaps, {}, &Gap::frame);
  return gaps;
}

/// Where the first things, a metre and more from each other, were seen from a frame of the path on.
std::vector<Vector<2>> first_seen(const LandmarkLog& log, const std::vector<SE2>& poses, std::size_t from) {
  constexpr std::size_t most = 3;
  std::vector<Vector<2>> places;
  for (std::size_t k = from; k < poses.size() && places.size() < most; ++k)
    for (const auto& sighting : log.frames[k].seen) {
      const Vector<2> place = log.sensor.initialise(poses[k], sighting.z);
      if (std::ranges::all_of(places, [&](const auto& other) { return (other - place).norm() > 1; }))
        places.push_back(place);
    }
  return places;
}

/// How the rest of the path may be moved to take what was seen for landmarks of the map: one thing for one,
/// without a turn, or two for two that are as far apart.
std::vector<SE2> moves_onto(const Map& map, const std::vector<Vector<2>>& places, const Gap& gap) {
  std::vector<Vector<2>> landmarks;
  map.for_each([&](std::uint32_t, const auto& landmark) { landmarks.push_back(landmark.belief.mean); });
  std::vector<SE2> moves;
  const auto add = [&](const SE2& move) {
    const double by = (move * places[0] - places[0]).norm(), turn = std::abs(move.rotation().angle());
    if (by > 3 * gap.metres + 2 || turn > 3 * gap.radians || (by < 1 && turn < 0.2)) return;
    const auto differs = [&](const SE2& other) {
      return (other * places[0] - move * places[0]).norm() > 0.5 ||
             std::abs((other.rotation().inverse() * move.rotation()).angle()) > 0.15;
    };
    if (std::ranges::all_of(moves, differs)) moves.push_back(move);
  };
  for (const Vector<2>& m : landmarks)
    for (const Vector<2>& place : places) add(SE2(cairn::SO2(), m - place));
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      for (const Vector<2>& m : landmarks)
        for (const Vector<2>& n : landmarks) {
          const Vector<2> seen = places[i] - places[j], is = m - n;
          if (std::abs(seen.norm() - is.norm()) > 0.7) continue;
          const cairn::SO2 turn(std::atan2(is(1), is(0)) - std::atan2(seen(1), seen(0)));
          add({turn, Vector<2>(0.5 * (m + n) - turn * Vector<2>(0.5 * (places[i] + places[j])))});
        }
  return moves;
}

/// What was seen from the gap on is laid onto the landmarks that it is nearest to, again and again: a move
/// that three sightings gave is a tenth of a radian off, and what is seen five metres on then fits nothing.
SE2 refined(const Map& map, const std::vector<Vector<2>>& places, SE2 move) {
  constexpr double near = 1;  // [m]
  constexpr int rounds = 5;
  for (int round = 0; round < rounds; ++round) {
    std::vector<Vector<2>> from, to;
    for (const Vector<2>& place : places) {
      const Vector<2> moved = move * place;
      double least = near;
      std::optional<Vector<2>> nearest;
      map.for_each([&](std::uint32_t, const auto& landmark) {
        if (const double apart = (landmark.belief.mean - moved).norm(); apart < least)
          least = apart, nearest = landmark.belief.mean;
      });
      if (!nearest) continue;
      from.push_back(place);
      to.push_back(*nearest);
    }
    if (2 * from.size() < places.size()) break;  // it is of something else
    move = rigid_fit(from, to);
  }
  return move;
}

/// The places of all that was seen along the path from one frame to before another.
std::vector<Vector<2>> places_seen(const LandmarkLog& log, const std::vector<SE2>& poses, std::size_t from,
                                   std::size_t until) {
  std::vector<Vector<2>> places;
  for (std::size_t k = from; k < until; ++k)
    for (const auto& sighting : log.frames[k].seen)
      places.push_back(log.sensor.initialise(poses[k], sighting.z));
  return places;
}

}  // namespace

cairn::Association Walk::likeliest(const LandmarkLog& log, const SE2& next) const {
  return map.likeliest(map.candidates({next, Matrix<3>::Zero()}, log.frames[frames].seen)).choice;
}

void Walk::go_on(const LandmarkLog& log, const SE2& next, const cairn::Association& association) {
  const Frame& frame = log.frames[frames++];
  log_density +=
      cairn::log_density(frame.motion_from(pose), next) + map.log_likelihood(next, frame.seen, association);
  map.insert(next, frame.seen, association);
  pose = next;
}

Walk walked(const LandmarkLog& log, const std::vector<SE2>& poses,
            const std::vector<cairn::Association>& associations, const Map& empty) {
  Walk walk{empty};
  for (std::size_t k = 0; k < poses.size(); ++k) walk.go_on(log, poses[k], associations[k]);
  return walk;
}

std::vector<cairn::Association> associations_along(const LandmarkLog& log, const LandmarkLog& believed,
                                                   const std::vector<SE2>& poses, const Map& empty) {
  std::vector<cairn::Association> all;
  Walk walk{empty};
  for (std::size_t k = 0; k < poses.size(); ++k) {
    all.push_back(walk.likeliest(log, poses[k]));
    const auto& seen = log.frames[k].seen;
    for (std::size_t i = 0; i < seen.size(); ++i)
      if (seen[i].identity && !believed.frames[k].seen[i].identity) all.back()[i] = cairn::no_landmark;
    walk.go_on(log, poses[k], all.back());
  }
  return all;
}

std::vector<cairn::Association> reassigned(const LandmarkLog& log, const std::vector<SE2>& poses,
                                           const std::vector<cairn::Association>& associations,
                                           const Map& empty) {
  constexpr std::uint32_t unnumbered = cairn::no_landmark;
  const Map map = walked(log, poses, associations, empty).map;
  std::uint32_t numbers = 0, begun = 0;
  std::vector<std::uint32_t> number_of(map.size(), unnumbered);  // by that in the map
  std::vector<cairn::Association> all;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    cairn::Association before = associations[k];
    for (std::uint32_t& n : before)
      if (n == cairn::new_landmark) n = numbers++;
    auto& now = all.emplace_back(
        map.likeliest(map.candidates({poses[k], Matrix<3>::Zero()}, log.frames[k].seen)).choice);
    if (std::ranges::any_of(now, [&](std::uint32_t n) { return n >= map.size(); })) now = std::move(before);
    for (std::uint32_t& n : now) {
      if (n == cairn::no_landmark) continue;
      std::uint32_t& number = number_of[n];
      const bool is_new = number == unnumbered;
      if (is_new) number = begun++;
      n = is_new ? cairn::new_landmark : number;
    }
  }
  return all;
}

LandmarkLog named(const LandmarkLog& log, const std::vector<cairn::Association>& associations) {
  LandmarkLog part{.name = log.name, .sensor = log.sensor};
  std::uint32_t numbers = 0;
  for (std::size_t k = 0; k < associations.size(); ++k) {
    Frame& frame = part.frames.emplace_back(log.frames[k]);
    for (std::size_t i = 0; i < frame.seen.size(); ++i) {
      auto& identity = frame.seen[i].identity;
      const std::uint32_t n = associations[k][i];
      if (n == cairn::no_landmark) identity.reset();
      if (identity || n == cairn::no_landmark) continue;
      identity = n == cairn::new_landmark ? numbers++ : n;
    }
  }
  return part;
}

std::optional<std::vector<cairn::Association>> merged(std::vector<cairn::Association> associations,
                                                      std::uint32_t a, std::uint32_t b) {
  constexpr std::uint32_t unnumbered = cairn::no_landmark;
  std::vector<std::uint32_t> number_of;  // by the number before
  std::uint32_t begun = 0;
  for (cairn::Association& frame : associations) {
    bool saw_a = false, saw_b = false;
    for (std::uint32_t& n : frame) {
      if (n == cairn::no_landmark) continue;
      if (n == cairn::new_landmark) {
        n = static_cast<std::uint32_t>(number_of.size());
        number_of.push_back(unnumbered);
      }
      saw_a = saw_a || n == a;
      saw_b = saw_b || n == b;
      const std::uint32_t is = n == b ? a : n;
      if (is >= number_of.size()) return std::nullopt;
      std::uint32_t& number = number_of[is];
      const bool is_new = number == unnumbered;
      if (is_new) number = begun++;
      n = is_new ? cairn::new_landmark : number;
    }
    if (saw_a && saw_b) return std::nullopt;
  }
  return associations;
}

std::vector<Reading> rereadings(const LandmarkLog& log, const std::vector<SE2>& poses, const Map& empty,
                                unsigned threads, std::size_t most) {
  struct Other {
    Walk walk;  // until the gap, then on
    SE2 move;
    std::vector<cairn::Association> after;  // the gap
  };
  std::vector<Other> others;
  Walk along{empty};
  std::vector<cairn::Association> associations;
  std::vector<double> log_densities;  // along the path as it stands, after each frame
  const auto stand_still = [&](std::size_t until) {
    while (along.frames < until) {
      const SE2& pose = poses[along.frames];
      associations.push_back(along.likeliest(log, pose));
      along.go_on(log, pose, associations.back());
      log_densities.push_back(along.log_density);
    }
  };
  const std::vector<Gap> gaps = widest_gaps(log, poses.size());
  for (std::size_t g = 0; g < gaps.size(); ++g) {
    constexpr std::size_t soon = 100;  // frames in which a path hardly bends
    const Gap& gap = gaps[g];
    stand_still(gap.frame);
    const std::vector<Vector<2>> places = first_seen(log, poses, gap.frame);
    if (places.empty()) continue;
    const std::size_t next = g + 1 < gaps.size() ? gaps[g + 1].frame : poses.size();
    const std::vector<Vector<2>> all = places_seen(log, poses, gap.frame, std::min(next, gap.frame + soon));
    for (const SE2& move : moves_onto(along.map, places, gap))
      others.push_back({along, refined(along.map, all, move), {}});
  }
  stand_still(poses.size());
  constexpr double hopeless = 60;  // so far behind the path as it stands, a reading is given up
  cairn::parallel_for(others.size(), threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      auto& [walk, move, after] = others[i];
      while (walk.frames < poses.size()) {
        const SE2 pose = move * poses[walk.frames];
        after.push_back(walk.likeliest(log, pose));
        walk.go_on(log, pose, after.back());
        if (walk.log_density < log_densities[walk.frames - 1] - hopeless) break;
      }
    }
  });
  std::erase_if(others, [&](const Other& o) { return o.walk.frames < poses.size(); });
  std::vector<std::pair<double, std::size_t>> best;
  for (std::size_t i = 0; i < others.size(); ++i) best.emplace_back(-others[i].walk.log_density, i);
  std::ranges::sort(best);
  std::vector<Reading> result;
  for (std::size_t i = 0; i < std::min(most, best.size()); ++i) {
    auto& [walk, move, after] = others[best[i].second];
    Reading& reading = result.emplace_back(Reading{poses, associations, walk.log_density});
    const std::size_t gap = poses.size() - after.size();
    for (std::size_t k = gap; k < poses.size(); ++k) {
      reading.poses[k] = move * poses[k];
      reading.associations[k] = std::move(after[k - gap]);
    }
  }
  return result;
}

}  // namespace fastslam
