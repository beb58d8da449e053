// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Rao-Blackwellised particle filter of mapping: paths are sampled, and each particle carries the map
/// that is exact given its path.
///
///   p(x_1:t, m | z_1:t, u_1:t) = p(x_1:t | z_1:t, u_1:t) p(m | x_1:t, z_1:t)
/// (K. Murphy, "Bayesian map learning in dynamic environments", NIPS 1999; A. Doucet, N. de Freitas,
/// K. Murphy, S. Russell, UAI 2000.) A step proposes a pose in every particle, weighs, resamples where the
/// weights have degenerated, and only then takes the observation into the maps: copies of a particle share
/// what they have until they write. Which map, and how poses are proposed, are the user's: ConditionalMap and
/// Proposal. Particle i of step t draws from its own stream of random numbers, so that the result is the same
/// bit for bit for any number of threads.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/detail/path_tree.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// One particle's map: how likely an observation is at a pose, and the exact map after it.
template <class M>
concept ConditionalMap =
    std::copyable<M> && Manifold<typename M::Pose> &&
    requires(M& m, const M& c, const typename M::Pose& x, const typename M::Observation& z) {
      { c.log_likelihood(x, z) } -> std::convertible_to<double>;
      m.insert(x, z);
    };

/// The choice of a map that has none to make.
struct NoChoice {};

namespace detail {

template <class M>
struct ChoiceOf {
  using type = NoChoice;
};
template <class M>
  requires requires { typename M::Choice; }
struct ChoiceOf<M> {
  using type = typename M::Choice;
};

}  // namespace detail

/// What has to be decided of an observation besides the pose before a map can take it in: which landmark
/// each sighting is of, say. A map that has such a thing names it M::Choice, with
///   choose(x, z, random) -> Chosen<Choice>   and   insert(x, z, choice).
/// The choice is a part of the sampled state: it is made once a step and particle, by the proposal.
template <class M>
using ChoiceOf = typename detail::ChoiceOf<M>::type;

template <class M>
concept ChoosingMap =
    ConditionalMap<M> && std::default_initializable<ChoiceOf<M>> && std::copyable<ChoiceOf<M>> &&
    requires(M& m, const typename M::Pose& x, const typename M::Observation& z, const ChoiceOf<M>& c) {
      m.insert(x, z, c);
    };

/// A map that can make ready for being asked at several poses: prepared() has the map's log_likelihood, and
/// lives until a map is changed.
template <class M>
concept PreparingMap =
    ConditionalMap<M> && requires(const M& m, const typename M::Pose& x, const typename M::Observation& z) {
      { m.prepared().log_likelihood(x, z) } -> std::convertible_to<double>;
    };

/// A choice c that was made with probability q(c).
template <class C>
struct Chosen {
  C choice{};
  double log_likelihood = 0;   ///< log p(z, c | x, m)
  double log_probability = 0;  ///< log q(c); 0 where the likeliest is taken, which is no draw
};

/// A pose that was drawn from q, with the weight that makes up for the difference to what it stands for:
/// log_weight = log p(z | x, m) + log p(x | motion) - log q(x).
template <Manifold X, class C = NoChoice>
struct Proposed {
  X pose;
  Gaussian<X> drawn_from;  ///< q, or its moments; the motion where that was drawn from
  double log_weight = 0;
  double log_likelihood = 0;  ///< log p(z | x, m)
  std::size_t regime = 0;     ///< of the motion that the pose belongs to, where there are several
  [[no_unique_address]] C choice{};
};

/// What a proposal for maps of this kind returns.
template <class M>
using ProposedOf = Proposed<typename M::Pose, ChoiceOf<M>>;

/// How a pose is proposed from what the motion says and the observation.
template <class P, class M, class Motion>
concept Proposal = ConditionalMap<M> && requires(const P& propose, const M& map, const Motion& motion,
                                                 const typename M::Observation& z, Random& random) {
  { propose(map, motion, z, random) } -> std::same_as<ProposedOf<M>>;
};

/// Logarithm of a Gaussian's density at x, by steps from its mean; -infinity where the covariance is not
/// positive definite.
template <Manifold X>
[[nodiscard]] double log_density(const Gaussian<X>& belief, const X& x) {
  const Cholesky<dof<X>, ScalarOf<X>> root(belief.covariance);
  if (!root.good()) return -std::numeric_limits<double>::infinity();
  const Tangent<X> d = local(belief.mean, x);
  return static_cast<double>(-0.5 * (root.whiten(d).squaredNorm() + root.log_determinant() +
                                     static_cast<double>(d.size()) * std::log(2 * std::numbers::pi)));
}

/// A motion under one of several regimes (forwards, backwards, slipping, ...): the share of each, given the
/// particle's past, and what it does to the pose. The shares sum to 1. The regime is a part of the sampled
/// state and stays with the particle: a jump Markov system.
template <Manifold X>
struct RegimeMotion {
  struct Mode {
    std::size_t regime = 0;
    double share = 1;
    Gaussian<X> motion;
  };
  std::vector<Mode> modes;
};

/// Poses drawn from the motion and weighed by the likelihood: the bootstrap filter. Of several draws a
/// particle keeps one by its likelihood, and weighs their mean: as unbiased as one draw, and steadier. Throws
/// Error where the motion's covariance is none; it may be singular.
struct FromMotion {
  std::size_t draws = 1;  ///< at least 1

  template <ConditionalMap M>
  [[nodiscard]] ProposedOf<M> operator()(const M& map, const Gaussian<typename M::Pose>& motion,
                                         const typename M::Observation& z, Random& random) const {
    CAIRN_EXPECTS(draws > 0, "FromMotion needs at least one draw");
    if constexpr (PreparingMap<M> && !ChoosingMap<M>) {
      auto prepared = map.prepared();
      return best_of<M>(prepared, motion, z, random);
    } else {
      return best_of<M>(map, motion, z, random);
    }
  }
  /// The regime is drawn by its share first.
  template <ConditionalMap M>
  [[nodiscard]] ProposedOf<M> operator()(const M& map, const RegimeMotion<typename M::Pose>& motion,
                                         const typename M::Observation& z, Random& random) const {
    CAIRN_EXPECTS(!motion.modes.empty(), "FromMotion needs a motion of at least one regime");
    double left = random.uniform();
    std::size_t chosen = 0;
    while (chosen + 1 < motion.modes.size() && left >= motion.modes[chosen].share)
      left -= motion.modes[chosen++].share;
    auto proposed = (*this)(map, motion.modes[chosen].motion, z, random);
    proposed.regime = motion.modes[chosen].regime;
    return proposed;
  }

private:
  /// `map` is one, or what one has prepared.
  template <ConditionalMap M>
  [[nodiscard]] ProposedOf<M> best_of(auto& map, const Gaussian<typename M::Pose>& motion,
                                      const typename M::Observation& z, Random& random) const {
    if (draws == 1) return draw<M>(map, motion, z, random);
    std::vector<ProposedOf<M>> drawn;
    std::vector<double> log_weights;
    for (std::size_t k = 0; k < draws; ++k) {
      drawn.push_back(draw<M>(map, motion, z, random));
      log_weights.push_back(drawn.back().log_weight);
    }
    const double total = log_sum_exp(log_weights);
    std::size_t chosen = 0;
    for (double left = random.uniform(); chosen + 1 < draws; ++chosen) {
      const double share = std::exp(log_weights[chosen] - total);
      if (!(left >= share)) break;  // also where no draw has a likelihood
      left -= share;
    }
    drawn[chosen].log_weight = total - std::log(static_cast<double>(draws));
    return std::move(drawn[chosen]);
  }

  template <ConditionalMap M>
  [[nodiscard]] static ProposedOf<M> draw(auto& map, const Gaussian<typename M::Pose>& motion,
                                          const typename M::Observation& z, Random& random) {
    std::optional<typename M::Pose> drawn = detail::drawn_from(motion, random);
    if (!drawn)
      raise("FromMotion: expected a motion whose covariance is finite, symmetric and positive semi-definite");
    typename M::Pose& pose = *drawn;
    if constexpr (ChoosingMap<M>) {
      Chosen<ChoiceOf<M>> c = map.choose(pose, z, random);
      const double log_weight = c.log_likelihood - c.log_probability;
      return {std::move(pose), motion, log_weight, c.log_likelihood, 0, std::move(c.choice)};
    } else {
      const double log_likelihood = map.log_likelihood(pose, z);
      return {std::move(pose), motion, log_likelihood, log_likelihood, 0, {}};
    }
  }
};

/// One pose of a path.
template <Manifold X>
struct PathPose {
  X pose;                  ///< what the map was made with
  Gaussian<X> drawn_from;  ///< the proposal's moments
  X before;                ///< the pose of the step before, when this one was drawn
  X drawn;                 ///< this pose, when it was drawn: other than `pose` where the path was moved since
  std::uint64_t step = 0;  ///< 0 for the start
};

/// All of a belief but its maps, as plain values: for files.
template <Manifold X>
struct PathsRecord {
  struct Node {
    PathPose<X> pose;
    std::uint32_t parent;  ///< an earlier node, or 2^32 - 1
  };
  struct Particle {
    std::uint32_t node;
    double log_evidence, log_weight;
    std::size_t regime;
  };
  std::vector<Node> nodes;
  std::vector<Particle> particles;
  std::uint64_t step = 0;
};

/// Weighted particles, each with a pose, a map and the path that led there.
template <ConditionalMap M>
class MappedPaths {
public:
  using Pose = typename M::Pose;
  struct Particle {
    Pose pose;
    M map;
    std::uint32_t node;                          // of the path
    double log_evidence = 0;                     ///< sum of the log weights along the path
    std::size_t regime = 0;                      ///< of the newest motion
    [[no_unique_address]] ChoiceOf<M> choice{};  ///< of the newest observation
  };

  /// `count` equal particles at a pose that is taken for exact. Throws Error where there are none.
  MappedPaths(const Pose& start, const M& map, std::size_t count) {
    if (count == 0) raise("MappedPaths: expected at least one particle");
    std::vector<Particle> all;
    all.reserve(count);
    const CovarianceOf<Pose> none = CovarianceOf<Pose>::Zero(dof_of(start), dof_of(start));
    for (std::size_t i = 0; i < count; ++i)
      all.push_back(
          {start, map, paths_.extend(Tree::none, {start, {start, none}, start, start, 0}), 0, 0, {}});
    particles_ = Particles<Particle>::equal(std::move(all));
  }

  /// The belief that record() described, with its particles' maps in their order. Throws Error where the two
  /// do not fit each other, a path has not one pose a step, or a weight is none.
  MappedPaths(const PathsRecord<Pose>& record, std::vector<M> maps) : step_(record.step) {
    if (record.particles.empty() || record.particles.size() != maps.size())
      raise("MappedPaths: expected as many maps as particles, and at least one");
    std::vector<std::uint64_t> steps;  // before each node
    for (std::size_t i = 0; i < record.nodes.size(); ++i) {
      const auto& [pose, parent] = record.nodes[i];
      if (parent != Tree::none && parent >= i) raise("MappedPaths: expected parents before their children");
      steps.push_back(parent == Tree::none ? 0 : steps[parent] + 1);
      paths_.extend(parent, pose);
    }
    std::vector<Particle> all;
    std::vector<double> log_weights;
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const auto& [node, log_evidence, log_weight, regime] = record.particles[i];
      if (node >= record.nodes.size()) raise("MappedPaths: expected particles at nodes that there are");
      if (steps[node] != step_) raise("MappedPaths: expected paths of one pose a step");
      const double most = std::numeric_limits<double>::max();
      if (!(log_evidence <= most && log_weight <= most))
        raise("MappedPaths: expected weights that are numbers");
      paths_.hold(node);
      all.push_back({paths_.at(node).pose, std::move(maps[i]), node, log_evidence, regime});
      log_weights.push_back(log_weight);
    }
    for (std::size_t i = 0; i < record.nodes.size(); ++i) paths_.release(static_cast<std::uint32_t>(i));
    particles_ = Particles<Particle>::equal(std::move(all));
    particles_.log_weights = std::move(log_weights);
  }
  /// What makes this belief again, together with the maps.
  [[nodiscard]] PathsRecord<Pose> record() const {
    PathsRecord<Pose> record{.nodes = {}, .particles = {}, .step = step_};
    std::vector<std::uint32_t> number;  // of a node of the tree in the record
    const auto numbered = [&](std::uint32_t node) {
      std::vector<std::uint32_t> fresh;
      number.resize(std::max<std::size_t>(number.size(), paths_.slots()), Tree::none);
      for (; node != Tree::none && number[node] == Tree::none; node = paths_.parent(node))
        fresh.push_back(node);
      for (; !fresh.empty(); fresh.pop_back()) {
        const std::uint32_t parent = paths_.parent(fresh.back());
        number[fresh.back()] = static_cast<std::uint32_t>(record.nodes.size());
        record.nodes.push_back({paths_.at(fresh.back()), parent == Tree::none ? Tree::none : number[parent]});
      }
    };
    for (std::size_t i = 0; i < size(); ++i) {
      const Particle& p = (*this)[i];
      numbered(p.node);
      record.particles.push_back({number[p.node], p.log_evidence, particles_.log_weights[i], p.regime});
    }
    return record;
  }

  [[nodiscard]] std::size_t size() const noexcept { return particles_.size(); }
  [[nodiscard]] const Particle& operator[](std::size_t i) const { return particles_.states[i]; }
  [[nodiscard]] const Particles<Particle>& particles() const noexcept { return particles_; }
  [[nodiscard]] std::uint64_t steps() const noexcept { return step_; }

  /// The particle with the largest sum of log weights along its ancestry: one path and the map of that path.
  [[nodiscard]] std::size_t best() const {
    std::size_t best = 0;
    for (std::size_t i = 1; i < size(); ++i)
      if ((*this)[i].log_evidence > (*this)[best].log_evidence) best = i;
    return best;
  }
  /// The path of a particle from the start.
  [[nodiscard]] std::vector<PathPose<Pose>> path(std::size_t particle) const {
    return paths_.path_to((*this)[particle].node);
  }
  /// The last pose of that path. Until the belief changes.
  [[nodiscard]] const PathPose<Pose>& newest(std::size_t particle) const {
    return paths_.at((*this)[particle].node);
  }
  /// The pose of that path at a step. Until the belief changes. O(steps since).
  [[nodiscard]] const PathPose<Pose>& ancestor(std::size_t particle, std::uint64_t step) const {
    CAIRN_EXPECTS(step <= step_, "ancestor needs a step that was");
    std::uint32_t node = (*this)[particle].node;
    for (std::uint64_t back = step_; back > step; --back) node = paths_.parent(node);
    return paths_.at(node);
  }
  /// Leaves `survivors` particles, drawn by their weights, each copied as often as the others: for what is
  /// too dear to be done to all. Returns for each particle the first of the same copies, itself or one before
  /// it.
  std::vector<std::size_t> concentrate(std::size_t survivors, Random& random) {
    CAIRN_EXPECTS(survivors > 0, "concentrate needs at least one survivor");
    survivors = std::min(survivors, size());
    const std::vector<std::size_t> drawn =
        resampled_indices(particles_.weights(), survivors, Resampling::systematic, random);
    std::vector<std::size_t> chosen, first;
    for (std::size_t i = 0; i < size(); ++i) {
      chosen.push_back(drawn[i * survivors / size()]);
      first.push_back(i > 0 && chosen[i] == chosen[i - 1] ? first.back() : i);
    }
    choose(chosen);
    return first;
  }

  /// Puts a particle on another path, whose map this is: a move of the path that leaves its distribution what
  /// it should be is the caller's to make. As long as the old path; its last pose is the particle's.
  void move(std::size_t particle, std::vector<PathPose<Pose>> path, M map) {
    CAIRN_EXPECTS(path.size() == step_ + 1, "move needs a path of as many poses as the particle's");
    std::uint32_t node = Tree::none;
    for (PathPose<Pose>& pose : path) {
      const std::uint32_t before = node;
      node = paths_.extend(before, std::move(pose));
      paths_.release(before);
    }
    put(particle, node, std::move(map));
  }
  /// Puts a particle on the path and the map of another.
  void copy_path(std::size_t from, std::size_t to) {
    paths_.hold((*this)[from].node);
    put(to, (*this)[from].node, (*this)[from].map);
  }

  /// Effective number of the ancestors that the particles had at a step: one over the sum of the squares of
  /// what weight each one's descendants have together. What is uncertain since before that step is held by so
  /// many draws, however many particles there are. O(particles and poses stored since).
  [[nodiscard]] double effective_ancestors(std::uint64_t step) const {
    CAIRN_EXPECTS(step <= step_, "effective_ancestors needs a step that was");
    const std::vector<double> weights = particles_.weights();
    struct Descent {
      std::uint32_t node;
      std::size_t first;  // of the particles below it, in whose order sums do not depend on nodes' numbers
      double weight;
    };
    std::vector<Descent> lines;
    for (std::size_t i = 0; i < size(); ++i) lines.push_back({(*this)[i].node, i, weights[i]});
    for (std::uint64_t back = step_;; --back) {
      std::ranges::sort(lines, {}, [](const Descent& line) { return std::pair(line.node, line.first); });
      std::size_t kept = 0;
      for (std::size_t i = 1; i < lines.size(); ++i) {
        if (lines[i].node == lines[kept].node)
          lines[kept].weight += lines[i].weight;
        else
          lines[++kept] = lines[i];
      }
      lines.resize(kept + 1);
      if (back == step) break;
      for (Descent& line : lines) line.node = paths_.parent(line.node);
    }
    std::ranges::sort(lines, {}, &Descent::first);
    double squares = 0;
    for (const Descent& line : lines) squares += line.weight * line.weight;
    return 1 / squares;
  }

  /// Poses stored for all paths together.
  [[nodiscard]] std::size_t stored_poses() const noexcept { return paths_.size(); }

  /// Weighted mean and covariance of the newest poses; within a particle the pose is taken to be as uncertain
  /// as the density it was drawn from.
  [[nodiscard]] Gaussian<Pose> pose() const {
    Particles<Pose> poses;
    for (const Particle& p : particles_.states) poses.states.push_back(paths_.at(p.node).drawn_from.mean);
    poses.log_weights = particles_.log_weights;
    Gaussian<Pose> result = moments(poses);
    const std::vector<double> weights = particles_.weights();
    for (std::size_t i = 0; i < size(); ++i)
      result.covariance += weights[i] * paths_.at((*this)[i].node).drawn_from.covariance;
    return result;
  }

private:
  friend struct ConditionalFilter;
  using Tree = detail::PathTree<PathPose<Pose>>;

  void put(std::size_t particle, std::uint32_t node, M map) {
    Particle& p = particles_.states[particle];
    paths_.release(p.node);
    p.node = node;
    p.pose = paths_.at(node).pose;
    p.map = std::move(map);
  }

  void extend(std::vector<ProposedOf<M>>& proposed, double evidence_share) {
    ++step_;
    for (std::size_t i = 0; i < size(); ++i) {
      Particle& p = particles_.states[i];
      const std::uint32_t before = p.node;
      const Pose from = p.pose;
      p.pose = proposed[i].pose;
      p.node = paths_.extend(before, {p.pose, std::move(proposed[i].drawn_from), from, p.pose, step_});
      paths_.release(before);
      p.log_evidence += evidence_share * proposed[i].log_weight;
      p.regime = proposed[i].regime;
      p.choice = std::move(proposed[i].choice);
    }
  }

  /// Another newest pose of the same density.
  void redraw(std::size_t particle, Random& random) {
    Particle& p = particles_.states[particle];
    PathPose<Pose> other = paths_.at(p.node);
    other.pose = other.drawn = sample(other.drawn_from, random);
    const std::uint32_t node = paths_.extend(paths_.parent(p.node), std::move(other));
    paths_.release(p.node);
    p.node = node;
    p.pose = paths_.at(node).pose;
  }

  void resample(Resampling scheme, Random& random) {
    choose(resampled_indices(particles_.weights(), size(), scheme, random));
  }

  void choose(const std::vector<std::size_t>& chosen) {
    std::vector<Particle> next;
    next.reserve(chosen.size());
    for (const std::size_t i : chosen) {
      next.push_back(particles_.states[i]);
      paths_.hold(next.back().node);
    }
    for (const Particle& p : particles_.states) paths_.release(p.node);
    particles_ = Particles<Particle>::equal(std::move(next));
  }

  Particles<Particle> particles_;
  Tree paths_;
  std::uint64_t step_ = 0;
};

/// What a step did.
struct [[nodiscard]] MappingStep {
  Status status = Status::accepted;
  double effective_size = 0;  ///< of the weights, before resampling
  bool resampled = false;

  [[nodiscard]] bool accepted() const noexcept { return status == Status::accepted; }
};

/// The filter. Options only.
struct ConditionalFilter {
  Resampling scheme = Resampling::systematic;
  double resample_below = 0.5;  ///< resample when the effective number falls below this share; 0 never
  /// How much of a step's log weight counts. 1 is the model as it is written; less where the model errs in
  /// the same way at every step, so that evidence of many steps is not worth as many times one.
  double evidence_share = 1;
  /// Copies of a particle that resampling makes draw poses of their own from what the first was drawn from:
  /// as many different poses as particles. Right where a weight does not depend on which pose was drawn, such
  /// as FromLandmarks::Weight::evidence.
  bool redraw = false;
  bool insert = true;  ///< false localises in maps that stay as they are
  std::uint64_t seed = 0;
  unsigned threads = 1;

  /// One step: `motion(pose, regime)` gives what is known of a particle's next pose before z is seen,
  /// `proposal` draws from it and z. Refused, and nothing changed, where no particle is left with a weight,
  /// one is no number, or an option is out of range. What map or proposal throw comes through, and the belief
  /// is then not to be used.
  template <ConditionalMap M, class Motion, class P>
    requires Proposal<P, M, std::invoke_result_t<const Motion&, const typename M::Pose&, std::size_t>>
  MappingStep step(MappedPaths<M>& belief, const Motion& motion, const P& proposal,
                   const typename M::Observation& z) const {
    if (!(resample_below >= 0 && resample_below <= 1) || !(evidence_share > 0 && evidence_share <= 1))
      return {.status = Status::bad_option};
    std::vector<ProposedOf<M>> proposed(belief.size());
    parallel_for(belief.size(), threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Random random(seed, stream(belief.steps() + 1, i));
        proposed[i] = proposal(belief[i].map, motion(belief[i].pose, belief[i].regime), z, random);
      }
    });
    std::vector<double> log_weights(belief.size());
    for (std::size_t i = 0; i < belief.size(); ++i) log_weights[i] = evidence_share * proposed[i].log_weight;
    MappingStep result;
    result.status = belief.particles_.reweigh(log_weights);
    if (!result.accepted()) return result;
    belief.extend(proposed, evidence_share);
    result.effective_size = belief.particles_.effective_size();
    if (result.effective_size < resample_below * static_cast<double>(belief.size())) {
      Random random(seed, stream(belief.steps(), all_particles));
      belief.resample(scheme, random);
      if (redraw) redraw_copies(belief);
      result.resampled = true;
    }
    if (insert) insert_in_all(belief, z);
    return result;
  }

private:
  /// Of the copies that resampling made of one particle, which follow each other, all but the first.
  template <ConditionalMap M>
  void redraw_copies(MappedPaths<M>& belief) const {
    std::uint32_t shared = belief[0].node;
    for (std::size_t i = 1; i < belief.size(); ++i) {
      if (belief[i].node != shared) {
        shared = belief[i].node;
        continue;
      }
      Random own(seed, stream(belief.steps(), belief.size() + i));
      belief.redraw(i, own);
    }
  }

  /// Copies that resampling made of one particle, which follow each other, take the observation in once and
  /// go on sharing their map.
  template <ConditionalMap M>
  void insert_in_all(MappedPaths<M>& belief, const typename M::Observation& z) const {
    auto& all = belief.particles_.states;
    std::vector<std::size_t> first, of;  // of the same copies
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (i == 0 || all[i].node != all[i - 1].node) first.push_back(i);
      of.push_back(first.back());
      if constexpr (std::default_initializable<M>)
        if (of[i] != i) all[i].map = M{};  // so that nothing is copied that the first one writes
    }
    parallel_for(first.size(), threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        auto& particle = all[first[k]];
        if constexpr (ChoosingMap<M>)
          particle.map.insert(particle.pose, z, particle.choice);
        else
          particle.map.insert(particle.pose, z);
      }
    });
    for (std::size_t i = 0; i < all.size(); ++i)
      if (of[i] != i) all[i].map = all[of[i]].map;
  }

  static constexpr std::uint64_t all_particles = 0xffffffffU;
  static constexpr std::uint64_t stream(std::uint64_t step, std::uint64_t slot) noexcept {
    return (step << 32U) + slot;
  }
};

}}  // namespace cairn::CAIRN_ABI
