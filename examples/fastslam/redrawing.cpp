// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "redrawing.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/conditional.hpp>

#include "batch.hpp"
#include "naming.hpp"

namespace fastslam {

namespace {

using cairn::Matrix;
using cairn::SE2;

/// Whether all sightings of the first frames have names that are believed: no path then says otherwise.
bool all_named(const LandmarkLog& log, std::uint64_t frames, const cairn::LandmarkOptions& options) {
  if (options.gate_of_named < 1) return false;
  for (std::uint64_t k = 0; k < frames; ++k)
    for (const auto& sighting : log.frames[k].seen)
      if (!sighting.identity) return false;
  return true;
}

std::size_t unnamed_in(const LandmarkLog& log) {
  std::size_t count = 0;
  for (const Frame& frame : log.frames)
    for (const auto& sighting : frame.seen) count += !sighting.identity;
  return count;
}

/// A path and what it was like to go along it.
struct Replayed {
  std::vector<SE2> poses;
  Walk walk;
};

/// A path that is being moved: the numbers that PathDensity makes it of, and how it is weighed.
struct Moving {
  std::size_t names;  ///< of its sightings: which of those that are looked at
  std::vector<double> white;
  std::shared_ptr<const Replayed> replayed;
  double log_ratio = 0;  ///< of the particles' own model over what names and path were drawn from
};

/// How far a power of the ratios may go on from here with `least` of them left as an effective number.
double next_power(const std::vector<Moving>& all, double power, double least) {
  const auto effective_size = [&](double next) {
    std::vector<double> log_weights, twice;
    for (const Moving& m : all) {
      log_weights.push_back((next - power) * m.log_ratio);
      twice.push_back(2 * log_weights.back());
    }
    return std::exp(2 * cairn::log_sum_exp(log_weights) - cairn::log_sum_exp(twice));
  };
  if (effective_size(1) >= least) return 1;
  double low = power, high = 1;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (effective_size(middle) >= least ? low : high) = middle;
  }
  return low;
}

/// Of one time.
class Redrawing {
public:
  Redrawing(const Belief& belief, const LandmarkLog& log, const SlamOptions& options,
            std::vector<SE2>& optimum, OtherNames& others)
      : log_(log),
        options_(options),
        frames_(belief.steps()),
        empty_(log.sensor, options.landmarks),
        names_(names_of(belief, optimum, others)),
        all_(belief.size()) {
    optimum = std::ranges::max_element(names_, {}, &Names::log_share)->density.optimum().poses;
  }

  /// Names that were given and are not believed.
  [[nodiscard]] std::size_t doubted() const { return doubted_; }

  [[nodiscard]] Belief redrawn() {
    const std::vector<std::size_t> drawn = drawn_names();
    each([&](std::size_t i, cairn::Random& random) {
      std::vector<double> white(names_[drawn[i]].density.size());
      for (double& v : white) v = random.normal(0, 1);
      all_[i] = moving(drawn[i], std::move(white));
    });
    constexpr int most_powers = 400;
    double power = 0;
    for (int powers = 1;; ++powers) {
      const double next =
          powers < most_powers ? next_power(all_, power, 0.5 * static_cast<double>(all_.size())) : 1;
      std::vector<double> log_weights;
      for (const Moving& m : all_) log_weights.push_back((next - power) * m.log_ratio);
      power = next;
      if (power == 1) return belief_of(log_weights);
      resample(log_weights);
      move(power);
    }
  }

private:
  /// log_share is then that among all names that are looked at.
  std::vector<Names> names_of(const Belief& belief, std::vector<SE2> start, OtherNames& others) {
    const bool is_named = all_named(log_, frames_, options_.landmarks);
    const std::size_t asked = is_named ? 1 : 16;
    const std::vector<SE2> best = means_of(belief, belief.best());
    const std::size_t settled = start.size();
    for (std::size_t k = settled; k < frames_; ++k)
      start.push_back(k == 0 ? best[0] : start[k - 1] * best[k - 1].inverse() * best[k]);
    cairn::Random choice(~options_.seed, (frames_ << 32U) + belief.size());
    std::optional<LandmarkLog> believed;
    std::optional<BatchOptimum> best_of_believed;
    if (is_named) {
      const auto end = log_.frames.begin() + static_cast<std::ptrdiff_t>(frames_);
      believed = LandmarkLog{.name = log_.name, .sensor = log_.sensor, .frames = {log_.frames.begin(), end}};
      best_of_believed = doubting_batch_optimum(*believed, start, settled);
      doubted_ = unnamed_in(*believed);
    }
    std::vector<std::vector<cairn::Association>> seen;
    auto particles =
        cairn::resampled_indices(belief.particles().weights(), asked, cairn::Resampling::systematic, choice);
    particles.erase(std::unique(particles.begin(), particles.end()), particles.end());  // they ascend
    for (const std::size_t i : particles) {
      std::vector<SE2> poses;
      for (const auto& each : belief.path(i)) poses.push_back(each.pose);
      poses.erase(poses.begin());  // the start
      auto associations = associations_along(log_, believed ? *believed : log_, poses, empty_);
      if (std::find(seen.begin(), seen.end(), associations) == seen.end())
        seen.push_back(std::move(associations));
    }
    std::vector<std::optional<Names>> all(seen.size());
    cairn::parallel_for(seen.size(), options_.threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        all[i].emplace(
            is_named ? weighed(log_, *believed, std::move(*best_of_believed), std::move(seen[i]), empty_)
                     : weighed(log_, start, std::move(seen[i]), empty_));
    });
    if (!log_.has_identities(frames_)) {
      const auto log_share = [](const std::optional<Names>& names) { return names->log_share; };
      if (auto better = others.much_likelier(**std::ranges::max_element(all, {}, log_share)))
        all.push_back(std::move(better));
    }
    std::vector<double> log_evidence;
    for (const auto& names : all) log_evidence.push_back(names->log_share);
    const double total = cairn::log_sum_exp(log_evidence);
    std::vector<Names> result;
    for (auto& names : all) {
      names->log_share -= total;
      result.push_back(std::move(*names));
    }
    return result;
  }
  /// For each path, by their shares.
  std::vector<std::size_t> drawn_names() {
    std::vector<double> shares;
    for (const Names& names : names_) shares.push_back(std::exp(names.log_share));
    cairn::Random random(~options_.seed, (frames_ << 32U) + ++rounds_ * (all_.size() + 1));
    return cairn::resampled_indices(shares, all_.size(), cairn::Resampling::systematic, random);
  }

  Moving moving(std::size_t names, std::vector<double> white) const {
    const auto& [associations, density, log_share] = names_[names];
    std::vector<SE2> poses = density.path(white);
    Walk walk = walked(log_, poses, associations, empty_);
    auto replay = std::make_shared<const Replayed>(Replayed{std::move(poses), std::move(walk)});
    const double log_ratio = replay->walk.log_density - density.log_density(replay->poses) - log_share;
    return {names, std::move(white), std::move(replay), log_ratio};
  }

  /// Calls visit(i, random) for all; none of these numbers are the filter's.
  template <class Visit>
  void each(const Visit& visit) {
    const std::uint64_t first = (frames_ << 32U) + ++rounds_ * (all_.size() + 1);
    cairn::parallel_for(all_.size(), options_.threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        cairn::Random random(~options_.seed, first + i);
        visit(i, random);
      }
    });
  }

  void resample(const std::vector<double>& log_weights) {
    const double total = cairn::log_sum_exp(log_weights);
    std::vector<double> weights;
    for (const double w : log_weights) weights.push_back(std::exp(w - total));
    cairn::Random random(~options_.seed, (frames_ << 32U) + ++rounds_ * (all_.size() + 1));
    std::vector<Moving> next;
    for (const std::size_t i :
         cairn::resampled_indices(weights, all_.size(), cairn::Resampling::systematic, random))
      next.push_back(all_[i]);
    all_ = std::move(next);
  }

  /// Moves until the steps that were taken are half of one that forgets, as a variance.
  void move(double power) {
    constexpr int most_sweeps = 3;
    double gone = 0;
    for (int sweep = 0; sweep < most_sweeps && gone < 0.5; ++sweep) {
      std::vector<char> taken(all_.size(), 0);
      each([&](std::size_t i, cairn::Random& random) {
        std::vector<double> white = all_[i].white;
        const double kept = std::sqrt(1 - length_ * length_);
        for (double& v : white) v = kept * v + random.normal(0, length_);
        Moving other = moving(all_[i].names, std::move(white));
        if (std::log(random.uniform()) >= power * (other.log_ratio - all_[i].log_ratio)) return;
        all_[i] = std::move(other);
        taken[i] = 1;
      });
      const double share =
          static_cast<double>(std::count(taken.begin(), taken.end(), 1)) / static_cast<double>(taken.size());
      gone += share * length_ * length_;
      length_ = std::clamp(length_ * std::exp(share - 0.4), 0.05, 1.0);
    }
  }

  Belief belief_of(const std::vector<double>& log_weights) const {
    const double total = cairn::log_sum_exp(log_weights);
    cairn::PathsRecord<SE2> record{.nodes = {}, .particles = {}, .step = frames_};
    std::vector<Map> maps;
    for (std::size_t i = 0; i < all_.size(); ++i) {
      std::uint32_t parent = 0xffffffffU;
      SE2 before;
      const auto add = [&](const SE2& pose, std::uint64_t step) {
        record.nodes.push_back({{pose, {pose, Matrix<3>::Zero()}, before, pose, step}, parent});
        parent = static_cast<std::uint32_t>(record.nodes.size() - 1);
        before = pose;
      };
      add(SE2(), 0);
      for (std::size_t k = 0; k < frames_; ++k) add(all_[i].replayed->poses[k], k + 1);
      const double log_weight = log_weights[i] - total;
      record.particles.push_back({parent, log_weight, log_weight, 0});
      maps.push_back(all_[i].replayed->walk.map);
    }
    return {record, std::move(maps)};
  }

  const LandmarkLog& log_;
  const SlamOptions& options_;
  std::uint64_t frames_;
  Map empty_;
  std::size_t doubted_ = 0;
  std::vector<Names> names_;
  std::vector<Moving> all_;
  std::uint64_t rounds_ = 0;
  double length_ = 0.7;  // of a step, of the Gaussian's own spread
};

}  // namespace

std::vector<SE2> means_of(const Belief& belief, std::size_t particle) {
  std::vector<SE2> poses;
  for (const auto& each : belief.path(particle)) poses.push_back(each.drawn_from.mean);
  poses.erase(poses.begin());  // the start
  return poses;
}

Redrawn redrawn(const Belief& belief, const LandmarkLog& log, const SlamOptions& options,
                std::vector<SE2>& optimum, OtherNames& others) {
  Redrawing redrawing(belief, log, options, optimum, others);
  return {redrawing.redrawn(), redrawing.doubted()};
}

bool redraw_is_due(const Belief& belief, const LandmarkLog& log, std::uint64_t last,
                   const SlamOptions& options) {
  const std::uint64_t since = belief.steps() - last;
  if (8 * since < last) return false;
  if (since < 100 && !all_named(log, belief.steps(), options.landmarks)) return false;
  return belief.effective_ancestors(last) < options.redraw_below * static_cast<double>(belief.size());
}

}  // namespace fastslam
