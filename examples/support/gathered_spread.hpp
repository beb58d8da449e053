// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How uncertain the newest pose is of particles in the plane that have come to share an ancestor.
///
/// Particles that are drawn from a motion and resampled soon descend from one: their spread then says how far
/// the steps since differ, and nothing of the way before, which they have in common. Two parts make up for
/// it.
///
/// GatheredSpread: what is seen tells of steps near by, so which lines died out was chance as far as the way
/// before is concerned, and any pose that particles had at a mark goes with any motion since. The covariances
/// of both add up; the mark moves on while enough lines are left to say what the second one is.
///
/// spread_of_poses: where ground is met again, all that is between the visits is held to what was seen first:
/// the newest scan is compared, about the pose that is told, with the map as a path left it behind. The
/// second moment of what that leaves is how far the one visit may be off the other, whether or not the
/// particles found the best place. The older visit has a spread of its own, made the same way.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/manifold/se2.hpp>

namespace example {

/// What a path has gathered up to a pose, as covariances of steps on the left of it: they only grow. Between
/// two marks nothing finer is known.
struct Gathered {
  std::vector<cairn::Matrix<3>> before;  ///< up to the last mark until each pose
  std::vector<cairn::Matrix<3>> after;   ///< up to the first mark from each pose on; of the newest, all
};

class GatheredSpread {
public:
  /// To be called after every step of the filter. O(particles times the steps since the mark).
  template <class Map>
  void take(const cairn::MappedPaths<Map>& belief) {
    if (belief.effective_ancestors(marks_.back().step) >= 0.5 * static_cast<double>(belief.size())) return;
    marks_.push_back({belief.steps(), on_the_left(pose(belief))});
  }

  /// Weighted mean of the newest poses as they were drawn, and how far it may be off. O(as above).
  template <class Map>
  [[nodiscard]] cairn::Gaussian<cairn::SE2> pose(const cairn::MappedPaths<Map>& belief) const {
    cairn::Particles<cairn::SE2> poses, motions;  // the motions since the mark
    poses.log_weights = motions.log_weights = belief.particles().log_weights;
    const Mark& mark = marks_.back();
    for (std::size_t i = 0; i < belief.size(); ++i) {
      poses.states.push_back(belief[i].pose);
      motions.states.push_back(belief.ancestor(i, mark.step).pose.inverse() * belief[i].pose);
    }
    cairn::Gaussian<cairn::SE2> result = cairn::moments(poses);
    const cairn::Matrix<3> back = result.mean.inverse().adjoint();
    // Moments of as many draws as lines are left fall short by one of these.
    const double lines = belief.effective_ancestors(mark.step);
    result.covariance = (lines > 2 ? lines / (lines - 1) : 1) * cairn::moments(motions).covariance +
                        back * mark.gathered * back.transpose();
    return result;
  }

  /// Up to every pose of a path but the start, the last of them the one that is told.
  [[nodiscard]] Gathered along(std::uint64_t steps, const cairn::Gaussian<cairn::SE2>& told) const {
    Gathered all;
    auto next = marks_.begin();
    for (std::uint64_t step = 1; step <= steps; ++step) {
      while (next != marks_.end() && next->step < step) ++next;
      const bool is_mark = next != marks_.end() && next->step == step;
      all.before.push_back(is_mark ? next->gathered : (next - 1)->gathered);
      all.after.push_back(next != marks_.end() && step < steps ? next->gathered : on_the_left(told));
    }
    return all;
  }

private:
  struct Mark {
    std::uint64_t step = 0;
    cairn::Matrix<3> gathered = cairn::Matrix<3>::Zero();
  };
  static cairn::Matrix<3> on_the_left(const cairn::Gaussian<cairn::SE2>& pose) {
    const cairn::Matrix<3> ahead = pose.mean.adjoint();
    return ahead * pose.covariance * ahead.transpose();
  }

  std::vector<Mark> marks_{Mark{}};  // the start
};

/// Second moments about zero of a deviation d with density N(d; 0, prior) exp(log_likelihood(d)), by draws
/// from a Gaussian that follows while the likelihood's power grows to 1, each time so far that enough of the
/// draws are left as an effective number (tempering as of R. Neal, "Annealed importance sampling", Statistics
/// and Computing 11, 2001). The prior where the draws do not get there. O(rounds times 100 likelihoods).
template <class LogLikelihood>
[[nodiscard]] cairn::Matrix<3> moments_about_zero(const cairn::Matrix<3>& prior,
                                                  const LogLikelihood& log_likelihood,
                                                  cairn::Random& random) {
  constexpr std::size_t draws = 100;
  constexpr int most_rounds = 30;
  const cairn::Cholesky<3> prior_root(prior);
  if (!prior_root.good()) return prior;
  cairn::Matrix<3> moments = prior;
  double power = 0;
  for (int round = 0; round < most_rounds; ++round) {
    const cairn::Cholesky<3> root(moments);
    if (!root.good()) return prior;
    std::vector<cairn::Vector<3>> deviations;
    std::vector<double> drawn, seen;  // logarithms: of the prior over what was drawn from; of the likelihood
    for (std::size_t i = 0; i < draws; ++i) {
      const double a = random.normal(), b = random.normal(), c = random.normal();
      const cairn::Vector<3> white(a, b, c);
      deviations.emplace_back(root.lower() * white);
      drawn.push_back(0.5 * (white.squaredNorm() - prior_root.whiten(deviations.back()).squaredNorm()));
      seen.push_back(log_likelihood(deviations.back()));
    }
    const auto shares = [&](double next) {
      std::vector<double> w;
      for (std::size_t i = 0; i < draws; ++i)
        w.push_back(drawn[i] + (next > 0 ? next * seen[i] : 0));  // also where one is -infinity
      const double total = cairn::log_sum_exp(w);
      for (double& each : w) each = std::exp(each - total);
      return w;
    };
    const auto effective = [&](double next) {
      double squares = 0;
      for (const double w : shares(next)) squares += w * w;
      return 1 / squares;
    };
    const double least = std::min(0.25 * draws, 0.5 * effective(power));
    double high = 1;
    if (effective(1) >= least) power = 1;
    for (int i = 0; i < 30 && power < 1; ++i) {
      const double middle = 0.5 * (power + high);
      (effective(middle) >= least ? power : high) = middle;
    }
    const std::vector<double> w = shares(power);
    moments.setZero();
    for (std::size_t i = 0; i < draws; ++i) moments += w[i] * deviations[i] * deviations[i].transpose();
    if (power == 1) return cairn::symmetrised(moments);
  }
  return prior;
}

/// Covariances, on the right, of the poses of a path that are asked for, from where the path begins: by what
/// it has gathered, and by the ground that was met again. What a scan sees of the map that the path made up
/// to `farther` metres before it, if that is a tenth of what it sees at all, was first seen by an older scan,
/// the median of these: its pose's covariance, and what the comparison leaves of the way since.
///
/// `ground` begins empty and is a place for scans of numbers k, at poses:
///   ground.insert(k, pose)                 in their order
///   ground.for_each_cell(k, pose, visit)   visit(CellAddress) of what is solid in scan k
///   ground.evidence(k)                     what gives the logarithm of scan k's likelihood at a pose
/// O(scans inserted, and a few thousand likelihoods for each pose asked for and each older one that leads
/// to).
template <class Ground>
[[nodiscard]] std::vector<cairn::Matrix<3>> spread_of_poses(Ground ground,
                                                            const std::vector<cairn::SE2>& path,
                                                            const Gathered& gathered,
                                                            const std::vector<std::size_t>& asked,
                                                            double farther, std::uint64_t seed) {
  cairn::SharedTiles<std::uint32_t> first_seen;  // by scan k - 1
  std::vector<std::size_t> old;                  // scans that lie so far behind each
  std::vector<double> length{0};
  for (std::size_t k = 0; k < path.size(); ++k) {
    if (k > 0) length.push_back(length.back() + (path[k].translation() - path[k - 1].translation()).norm());
    old.push_back(k == 0 ? 0 : old.back());
    while (length[k] - length[old[k]] >= farther) ++old[k];
    ground.for_each_cell(k, path[k], [&](cairn::CellAddress cell) {
      if (auto& first = first_seen.write(cell); first == 0) first = static_cast<std::uint32_t>(k + 1);
    });
  }
  std::map<std::size_t, std::size_t> older;  // who saw first what these scans see
  std::set<std::size_t> todo(asked.begin(), asked.end());
  while (!todo.empty()) {
    const std::size_t k = *todo.begin();
    todo.erase(todo.begin());
    std::vector<std::size_t> seen_by;
    std::size_t all = 0;
    ground.for_each_cell(k, path[k], [&](cairn::CellAddress cell) {
      ++all;
      if (const std::size_t first = first_seen.read(cell); first > 0 && first <= old[k])
        seen_by.push_back(first - 1);
    });
    if (seen_by.empty() || 10 * seen_by.size() < all) continue;
    const auto middle = seen_by.begin() + static_cast<std::ptrdiff_t>(seen_by.size() / 2);
    std::ranges::nth_element(seen_by, middle);
    older.emplace(k, *middle);
    if (!older.contains(*middle)) todo.insert(*middle);
  }
  std::map<std::size_t, cairn::Matrix<3>> spread;  // of steps on the left
  const auto spread_at = [&](std::size_t k) {
    const auto met = spread.find(k);
    return met == spread.end() ? gathered.after[k] : met->second;
  };
  std::size_t inserted = 0;
  for (const auto& [k, first] : older) {  // older ones before those that ask for them
    for (; inserted < old[k]; ++inserted) ground.insert(inserted, path[inserted]);
    const cairn::Matrix<3> ahead = path[k].adjoint(), back = path[k].inverse().adjoint();
    auto evidence = ground.evidence(k);
    cairn::Random random(seed, (std::uint64_t{31} << 32U) + k);
    const cairn::Matrix<3> between = moments_about_zero(
        back * (gathered.after[k] - gathered.before[first]) * back.transpose(),
        [&](const cairn::Vector<3>& d) { return evidence(cairn::retract(path[k], d)); }, random);
    spread.emplace(k, spread_at(first) + ahead * between * ahead.transpose());
  }
  std::vector<cairn::Matrix<3>> result;
  for (const std::size_t k : asked) {
    const cairn::Matrix<3> back = path[k].inverse().adjoint();
    result.push_back(cairn::symmetrised(cairn::Matrix<3>(back * spread_at(k) * back.transpose())));
  }
  return result;
}

}  // namespace example
