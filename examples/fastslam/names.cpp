// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "names.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <tuple>
#include <utility>

#include <cairn/core/parallel.hpp>
#include <cairn/filter/conditional.hpp>

namespace fastslam {

namespace {

using cairn::SE2;

/// The nearest pairs of landmarks that were never seen at once, each said to be one.
std::vector<Reading> mergings(const Names& names) {
  constexpr double farthest = 2;  // [m]
  constexpr std::size_t most = 4;
  const auto& [poses, landmarks, cost, iterations, converged] = names.density.optimum();
  std::vector<std::tuple<double, std::uint32_t, std::uint32_t>> pairs;
  for (auto b = landmarks.begin(); b != landmarks.end(); ++b)
    for (auto a = landmarks.begin(); a != b; ++a)
      if (const double apart = (a->second - b->second).norm(); apart < farthest)
        pairs.emplace_back(apart, a->first, b->first);
  std::ranges::sort(pairs);
  std::vector<Reading> all;
  for (const auto& [apart, a, b] : pairs)
    if (all.size() < most)
      if (auto one = merged(names.associations, a, b)) all.push_back({poses, std::move(*one)});
  return all;
}

/// Whether two names put the robot at the same places, but for what is not another thing there.
bool alike(const Names& a, const Names& b) {
  const std::vector<SE2>& p = a.density.optimum().poses;
  const std::vector<SE2>& q = b.density.optimum().poses;
  for (std::size_t k = 0; k < p.size(); ++k)
    if ((p[k].translation() - q[k].translation()).norm() > 1 ||
        std::abs((p[k].rotation().inverse() * q[k].rotation()).angle()) > 0.2)
      return false;
  return true;
}

}  // namespace

Names weighed(const LandmarkLog& log, const LandmarkLog& part, BatchOptimum optimum,
              std::vector<cairn::Association> associations, const Map& empty) {
  PathDensity density(part, std::move(optimum));
  const std::vector<SE2>& poses = density.optimum().poses;
  const double log_share = walked(log, poses, associations, empty).log_density - density.log_density(poses);
  return {std::move(associations), std::move(density), log_share};
}

Names weighed(const LandmarkLog& log, const std::vector<SE2>& start,
              std::vector<cairn::Association> associations, const Map& empty) {
  const LandmarkLog part = named(log, associations);
  return weighed(log, part, batch_optimum(part, start), std::move(associations), empty);
}

OtherNames::OtherNames(const LandmarkLog& log, const SlamOptions& options) : OtherNames(log, options, {}) {}

OtherNames::OtherNames(const LandmarkLog& log, const SlamOptions& options, std::vector<Reading> kept)
    : log_(log), options_(options), empty_(log.sensor, options.landmarks), kept_(std::move(kept)) {}

std::optional<Names> OtherNames::much_likelier(const Names& names) {
  constexpr double margin = 25;
  constexpr int most_looked_next_to = 3;
  constexpr std::size_t most_kept = 8;
  struct Seen {
    const Names* names;
    bool was_looked_next_to = false;
  };
  std::deque<Names> others;
  std::vector<Seen> all{{&names}};  // the likeliest first
  const auto add = [&](std::vector<Reading> readings) {
    std::erase_if(readings, [&](const Reading& r) {
      return std::ranges::any_of(all, [&](const Seen& s) { return s.names->associations == r.associations; });
    });
    for (Names& other : solved(std::move(readings))) all.push_back({&others.emplace_back(std::move(other))});
    std::ranges::stable_sort(all, std::greater<>{}, [](const Seen& s) { return s.names->log_share; });
  };
  std::vector<Reading> readings;
  for (std::size_t i = 0; i < kept_.size(); ++i)
    if (auto reading = gone_on(kept_[i], names.associations.size(), i))
      readings.push_back(std::move(*reading));
  add(std::move(readings));
  for (int i = 0; i < most_looked_next_to; ++i) {
    const auto next = std::ranges::find_if(all, [&](const Seen& s) {
      return std::ranges::none_of(all, [&](const Seen& other) {
        return other.was_looked_next_to &&
               (other.names == s.names ||
                (alike(*other.names, *s.names) && s.names->log_share <= other.names->log_share + margin));
      });
    });
    if (next == all.end()) break;
    next->was_looked_next_to = true;
    add(next_to(*next->names));
  }
  kept_.clear();
  std::vector<const Names*> kept;
  for (const Seen& s : all) {
    if (kept.size() == most_kept) break;
    if (std::ranges::any_of(kept, [&](const Names* other) { return alike(*other, *s.names); })) continue;
    kept.push_back(s.names);
    kept_.push_back({s.names->density.optimum().poses, s.names->associations});
  }
  if (all[0].names->log_share > names.log_share + margin)
    for (Names& other : others)
      if (&other == all[0].names) return std::move(other);
  return std::nullopt;
}

std::vector<Names> OtherNames::solved(std::vector<Reading> readings) const {
  std::vector<std::optional<Names>> all(readings.size());
  cairn::parallel_for(readings.size(), options_.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      all[i].emplace(settled(weighed(log_, readings[i].poses, std::move(readings[i].associations), empty_)));
  });
  std::vector<Names> result;
  for (auto& names : all) result.push_back(std::move(*names));
  return result;
}

/// What is likeliest along their optimum where that is better, and then what is by the landmarks there, as
/// long as it is better.
Names OtherNames::settled(Names names) const {
  constexpr int most_rounds = 6;
  for (int round = 0; round < most_rounds; ++round) {
    const std::vector<SE2> path = names.density.optimum().poses;
    auto other = round == 0 ? associations_along(log_, log_, path, empty_)
                            : reassigned(log_, path, names.associations, empty_);
    if (other != names.associations) {
      Names better = weighed(log_, path, std::move(other), empty_);
      if (better.log_share > names.log_share) {
        names = std::move(better);
        continue;
      }
    }
    if (round > 0) break;
  }
  return names;
}

/// By the likeliest of some particles that begin where it ends; nothing where they cannot go on.
std::optional<Reading> OtherNames::gone_on(const Reading& kept, std::size_t until, std::size_t which) const {
  constexpr std::size_t particles = 20;
  const std::size_t begin = kept.poses.size();
  Walk walk = walked(log_, kept.poses, kept.associations, empty_);
  Belief belief(walk.pose, walk.map, particles);
  const cairn::ConditionalFilter filter{.resample_below = options_.resample_below,
                                        .seed = ~options_.seed + (std::uint64_t{begin} << 32U) + which,
                                        .threads = options_.threads};
  for (std::size_t k = begin; k < until; ++k) {
    const Frame& frame = log_.frames[k];
    const auto motion = [&](const SE2& x, std::size_t) { return frame.motion_from(x); };
    if (!filter.step(belief, motion, cairn::FromLandmarks{}, frame.seen).accepted()) return std::nullopt;
  }
  Reading reading = kept;
  const auto path = belief.path(belief.best());
  for (std::size_t k = begin; k < until; ++k) {
    reading.poses.push_back(path[k - begin + 1].drawn_from.mean);  // the first is the start
    reading.associations.push_back(walk.likeliest(log_, reading.poses.back()));
    walk.go_on(log_, reading.poses.back(), reading.associations.back());
  }
  return reading;
}

/// Other readings of the sightings after gaps, and landmarks that were begun twice made one.
std::vector<Reading> OtherNames::next_to(const Names& names) const {
  std::vector<Reading> readings =
      rereadings(log_, names.density.optimum().poses, empty_, options_.threads, 8);
  for (Reading& one : mergings(names)) readings.push_back(std::move(one));
  return readings;
}

}  // namespace fastslam
