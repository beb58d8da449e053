// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "slam.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <memory>
#include <optional>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/conditional.hpp>

#include "batch.hpp"
#include "names.hpp"
#include "naming.hpp"
#include "scores.hpp"

namespace fastslam {

namespace {

using cairn::Matrix;
using cairn::SE2;
using cairn::StampedPose2;
using cairn::Vector;

cairn::MappingStep step(const cairn::ConditionalFilter& filter, Belief& belief, const Frame& frame,
                        ProposalKind kind) {
  const auto motion = [&](const SE2& x, std::size_t) { return frame.motion_from(x); };
  return kind == ProposalKind::motion ? filter.step(belief, motion, cairn::FromMotion{}, frame.seen)
                                      : filter.step(belief, motion, cairn::FromLandmarks{}, frame.seen);
}

/// Means of the densities that a particle's poses were drawn from: without the jitter of the draws.
std::vector<SE2> means_of(const Belief& belief, std::size_t particle) {
  std::vector<SE2> poses;
  for (const auto& each : belief.path(particle)) poses.push_back(each.drawn_from.mean);
  poses.erase(poses.begin());  // the start
  return poses;
}

bool has_identities(const LandmarkLog& log) {
  for (const Frame& frame : log.frames)
    for (const auto& sighting : frame.seen)
      if (sighting.identity) return true;
  return false;
}

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

/// All paths drawn again: from the Gaussian about the optimum of the log so far, and led from there to what
/// the particles' own model says of them, which is the filter's distribution. The filter never goes back:
/// with that alone a bend between two visits stays, and where no particle came back right, none ever will.
/// Weights of the model over the Gaussian alone would leave few paths of thousands of poses. So the ratio's
/// power grows from 0 to 1 by as much as leaves half of the paths as an effective number, they are resampled,
/// and each is moved by steps that keep the Gaussian as it is and are taken with the probability that makes
/// up for the ratio (P. Del Moral, A. Doucet, A. Jasra, "Sequential Monte Carlo samplers", JRSS B 68, 2006;
/// the step of S. Cotter, G. Roberts, A. Stuart, D. White, Statistical Science 28, 2013, whose length does
/// not depend on how many numbers a path has). O(M frames log landmarks) for each power, and a sparse least
/// squares. Where sightings have no names, sixteen particles are asked for theirs, and each path is drawn
/// with those of one of them: as often as they are likely when the path that they go with is integrated out,
/// by Laplace's approximation, for what a particle's weight says of its names is blurred by the chance bends
/// of its own path. The ratio is over both, and so makes up for what the approximation errs by. `optimum` is
/// where the last one was, and then where that of the likeliest names is. Names that are given are believed
/// but where all else contradicts them: a step of the filter has to, for its map may have drifted, and only
/// the whole log tells.
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
    if (!has_identities(log_)) {
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

/// What is uncertain since before the paths were last drawn is held by the particles' ancestors of then, and
/// resampling leaves fewer of them with every step: a covariance of few draws is too small, and the paths
/// that are left bend as the ones that were right by chance. Names are another matter: drawing decides what
/// the ancestors leave open, and a hundred frames tell more of it than ten.
bool redraw_is_due(const Belief& belief, const LandmarkLog& log, std::uint64_t last,
                   const SlamOptions& options) {
  const std::uint64_t since = belief.steps() - last;
  if (8 * since < last) return false;
  if (since < 100 && !all_named(log, belief.steps(), options.landmarks)) return false;
  return belief.effective_ancestors(last) < options.redraw_below * static_cast<double>(belief.size());
}

/// What is known of the newest pose, by the particles and, as their ancestors die out, by all that were
/// drawn.
///
/// What is uncertain since before the last drawing is held by the particles' ancestors of then. A weight is
/// as much of the chance bends of its particle's own path since then as of whether its ancestor was right, so
/// that after some tens of frames a few ancestors are left by chance, and the spread of their descendants
/// says next to nothing of where the truth is. So by as great a share as the effective ancestors have been
/// lost, every pose that was drawn is taken with every motion since, as though what was seen since did not
/// tell which was right: the moments of that mixture. And the covariance of n draws is a guess itself: the
/// truth is spread about their mean as Student's t of n - 1, whose covariance is (n + 1)(n - 1) / (n (n - 5))
/// of it for three numbers (A. Gelman et al., "Bayesian Data Analysis", 2013, section 3.6).
class Spread {
public:
  explicit Spread(const Belief& belief) { drawn(belief); }

  /// The particles are independent draws, each its own ancestor.
  void drawn(const Belief& belief) {
    step_ = belief.steps();
    drawn_ = belief.pose();
  }
  /// Of the last drawing.
  [[nodiscard]] std::uint64_t step() const { return step_; }

  [[nodiscard]] cairn::Gaussian<SE2> pose(const Belief& belief) const {
    const auto n = static_cast<double>(belief.size());
    cairn::Gaussian<SE2> result = belief.pose();
    const double lost = belief.steps() == step_ ? 0 : 1 - belief.effective_ancestors(step_) / n;
    if (lost > 0) result = mixed(result, crossed(belief), lost);
    if (n > 5) result.covariance *= (n + 1) * (n - 1) / (n * (n - 5));
    return result;
  }

private:
  /// Every pose that was drawn with every motion since.
  [[nodiscard]] cairn::Gaussian<SE2> crossed(const Belief& belief) const {
    cairn::Particles<SE2> motions;
    motions.log_weights = belief.particles().log_weights;
    const std::vector<double> weights = belief.particles().weights();
    Matrix<3> within = Matrix<3>::Zero();
    for (std::size_t i = 0; i < belief.size(); ++i) {
      const auto& density = belief.newest(i).drawn_from;
      motions.states.push_back(belief.ancestor(i, step_).pose.inverse() * density.mean);
      within += weights[i] * density.covariance;
    }
    const cairn::Gaussian<SE2> motion = cairn::moments(motions);
    const Matrix<3> back = motion.mean.inverse().adjoint();
    return {drawn_.mean * motion.mean,
            Matrix<3>(back * drawn_.covariance * back.transpose() + motion.covariance + within)};
  }
  static cairn::Gaussian<SE2> mixed(const cairn::Gaussian<SE2>& a, const cairn::Gaussian<SE2>& b,
                                    double share_of_b) {
    const Vector<3> apart = cairn::local(a.mean, b.mean), step = share_of_b * apart;
    return {cairn::retract(a.mean, step),
            cairn::symmetrised(Matrix<3>((1 - share_of_b) * a.covariance + share_of_b * b.covariance +
                                         share_of_b * (1 - share_of_b) * apart * apart.transpose()))};
  }

  std::uint64_t step_ = 0;
  cairn::Gaussian<SE2> drawn_{};
};

/// Weighted mean of all particles' paths, pose by pose.
std::vector<SE2> mean_path(const Belief& belief) {
  std::vector<SE2> mean = means_of(belief, belief.best());
  std::vector<cairn::Vector<3>> shift(mean.size(), cairn::Vector<3>::Zero());
  const std::vector<double> weights = belief.particles().weights();
  for (std::size_t i = 0; i < belief.size(); ++i) {
    const std::vector<SE2> path = means_of(belief, i);
    for (std::size_t k = 0; k < mean.size(); ++k) shift[k] += weights[i] * cairn::local(mean[k], path[k]);
  }
  for (std::size_t k = 0; k < mean.size(); ++k) mean[k] = cairn::retract(mean[k], shift[k]);
  return mean;
}

std::vector<FoundLandmark> landmarks_of(const Map& map) {
  std::vector<FoundLandmark> found;
  map.for_each([&](std::uint32_t number, const auto& landmark) {
    found.push_back({number, landmark.belief, landmark.sightings, landmark.log_odds});
  });
  return found;
}

/// Every so-manieth place of a particle's path, from the newest back.
std::vector<Vector<2>> thinned_path(const Belief& belief, std::size_t particle) {
  const auto path = belief.path(particle);
  const std::size_t every = path.size() / 150 + 1;
  std::vector<Vector<2>> places;
  for (std::size_t back = 0; back < path.size(); back += every)
    places.push_back(path[path.size() - 1 - back].pose.translation());
  return places;
}

Snapshot snapshot_of(const Belief& belief, double time) {
  constexpr std::size_t most_paths = 12;
  Snapshot s{time, {thinned_path(belief, belief.best())}, landmarks_of(belief[belief.best()].map)};
  for (std::size_t i = 1; i < belief.size() && s.paths.size() < most_paths; ++i)
    if (belief[i].node != belief[i - 1].node) s.paths.push_back(thinned_path(belief, i));
  return s;
}

}  // namespace

std::vector<StampedPose2> filled(const LandmarkLog& log, const std::vector<SE2>& poses) {
  std::vector<StampedPose2> all;
  std::size_t next = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    all.push_back({log.frames[k].time, poses[k]});
    for (; next < log.between.size() && log.between[next].frame == k; ++next) {
      const Between& b = log.between[next];
      SE2 pose = poses[k] * b.moved;
      if (k + 1 < poses.size()) {
        const double share = (b.time - log.frames[k].time) / (log.frames[k + 1].time - log.frames[k].time);
        const Vector<3> gap = cairn::local(poses[k] * log.frames[k + 1].moved.mean, poses[k + 1]);
        pose = cairn::retract(pose, Vector<3>(share * gap));
      }
      all.push_back({b.time, pose});
    }
  }
  return all;
}

Results run(const LandmarkLog& log, const SlamOptions& options,
            const std::function<std::optional<std::string>()>& on_frame) {
  Results r{.name = log.name,
            .seed = options.seed,
            .particles = options.particles,
            .threads = options.threads,
            .proposal = options.proposal,
            .identities_known = has_identities(log),
            .notes = log.notes};
  for (const auto& [id, place] : log.landmarks) r.true_landmarks.push_back(place);
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  Belief belief(SE2(), Map(log.sensor, options.landmarks), options.particles);
  const cairn::ConditionalFilter filter{
      .resample_below = options.resample_below, .seed = options.seed, .threads = options.threads};
  const bool redraws = options.redraw_below > 0 && options.proposal == ProposalKind::landmarks;
  Spread spread(belief);
  std::size_t doubted = 0;
  std::vector<SE2> odometry, optimum;
  OtherNames others(log, options);
  const std::size_t every = std::max<std::size_t>(1, log.frames.size() / 40);
  for (const Frame& frame : log.frames) {
    const cairn::MappingStep did = step(filter, belief, frame, options.proposal);
    if (!did.accepted())
      cairn::raise("frame " + std::to_string(odometry.size()) + ": " + explain(did.status));
    std::optional<double> redrawn_size;
    const bool is_last = belief.steps() == log.frames.size();  // the path and map that are handed over
    if (redraws && (is_last || redraw_is_due(belief, log, spread.step(), options))) {
      Redrawing redrawing(belief, log, options, optimum, others);
      belief = redrawing.redrawn();
      doubted = redrawing.doubted();
      redrawn_size = belief.particles().effective_size();
      spread.drawn(belief);
    }
    odometry.push_back(odometry.empty() ? frame.moved.mean : odometry.back() * frame.moved.mean);
    r.steps.push_back({frame.time,
                       did.effective_size,
                       did.resampled,
                       redrawn_size,
                       frame.seen.size(),
                       belief[0].map.size(),
                       redraws ? spread.pose(belief) : belief.pose(),
                       {}});
    if (const StampedPose2* truth = log.start ? last_until(log.truth, frame.time) : nullptr)
      if (const double nees = cairn::nees(r.steps.back().pose, log.start->inverse() * truth->pose);
          std::isfinite(nees))  // one particle that was drawn again has no covariance
        r.steps.back().nees = nees;
    if (on_frame) r.ended_early = on_frame();
    // The last is what is handed over: the film ends with it.
    if (odometry.size() % every == 0 || is_last || r.ended_early)
      r.snapshots.push_back(snapshot_of(belief, frame.time));
    if (r.ended_early) break;
  }
  r.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  r.cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  if (doubted > 0)
    r.notes.push_back(std::to_string(doubted) + (doubted == 1 ? " sighting is" : " sightings are") +
                      " not of what the name says: left out");
  r.odometry = filled(log, odometry);
  r.best = filled(log, means_of(belief, belief.best()));
  r.mean = filled(log, mean_path(belief));
  r.landmarks = landmarks_of(belief[belief.best()].map);
  r.node_copies = belief[belief.best()].map.node_copies();
  measure(r, log);
  return r;
}

}  // namespace fastslam
