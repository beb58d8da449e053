// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "batch.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>

#include <Eigen/SparseCholesky>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/statistics.hpp>

#include "support/sparse_least_squares.hpp"

namespace fastslam {

namespace {

using cairn::Matrix;
using cairn::SE2;
using cairn::Vector;

using Factor = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>;

/// Of a sighting from where it should be seen, and its noise.
std::pair<Vector<2>, Matrix<2>> error_of(const PointSensor& sensor, const SE2& x, const Vector<2>& m,
                                         const Map::Sighting& sighting) {
  return {-cairn::local(sensor.predict(x, m), sighting.z), sensor.noise_at(sighting.z.part<0>()(0))};
}

/// Where a sighting is linearised: at the landmark, but no nearer than half of the distance that was
/// measured. A code that was read wrongly can have put its landmark where the robot stood, and the bearing's
/// derivative there, 1 / distance, would leave no digits for anything else.
Vector<2> linearised_at(const PointSensor& sensor, const SE2& x, const Vector<2>& m,
                        const Map::Sighting& sighting) {
  const Vector<2> to = m - x.translation();
  const double least = 0.5 * sighting.z.part<0>()(0), distance = to.norm();
  if (distance >= least) return m;
  if (distance > 0) return x.translation() + least / distance * to;
  return 0.5 * (x.translation() + sensor.initialise(x, sighting.z));
}

struct Estimate {
  std::vector<SE2> poses;
  std::map<std::uint32_t, Vector<2>> landmarks;
};

/// The least squares problem of a whole log: unknowns are steps of the poses, then of the landmarks.
class Problem {
public:
  Problem(const LandmarkLog& log, const std::map<std::uint32_t, Vector<2>>& landmarks) : log_(log) {
    rows_ = 3 * static_cast<int>(log.frames.size());
    for (const auto& [id, place] : landmarks) {
      row_of_[id] = rows_;
      rows_ += 2;
    }
  }

  [[nodiscard]] example::NormalEquations equations_at(const Estimate& at) const {
    example::NormalEquations equations(rows_);
    for (std::size_t k = 0; k < log_.frames.size(); ++k) {
      add_motion(equations, at, k);
      for (const auto& sighting : log_.frames[k].seen)
        if (sighting.identity) add_sighting(equations, at, k, sighting);
    }
    return equations;
  }
  [[nodiscard]] Estimate moved(const Estimate& at, const Eigen::VectorXd& d) const {
    Estimate next = at;
    for (std::size_t k = 0; k < next.poses.size(); ++k)
      next.poses[k] = cairn::retract(next.poses[k], Vector<3>(d.segment<3>(3 * static_cast<int>(k))));
    for (auto& [id, place] : next.landmarks) place += d.segment<2>(row_of_.at(id));
    return next;
  }

private:
  /// Adds J^T W J and J^T W e of two blocks of unknowns.
  template <int M, int A, int B>
  static void add(example::NormalEquations& to, const Vector<M>& e, const Matrix<M>& covariance, int a,
                  const Matrix<M, A>& by_a, int b, const Matrix<M, B>& by_b) {
    const cairn::Cholesky<M> root(covariance);
    if (!root.good()) cairn::raise("batch_optimum: expected covariances that are positive definite");
    const Vector<M> white = root.whiten(e);
    const Matrix<M, A> j_a = root.whiten(by_a);
    const Matrix<M, B> j_b = root.whiten(by_b);
    to.add_cost(0.5 * white.squaredNorm());
    to.add_block(b, b, Matrix<B>(j_b.transpose() * j_b));
    to.add_gradient(b, Vector<B>(j_b.transpose() * white));
    if (a < 0) return;
    to.add_block(a, a, Matrix<A>(j_a.transpose() * j_a));
    to.add_gradient(a, Vector<A>(j_a.transpose() * white));
    to.add_block(b, a, Matrix<B, A>(j_b.transpose() * j_a));
  }

  void add_motion(example::NormalEquations& to, const Estimate& at, std::size_t k) const {
    const SE2 before = k == 0 ? SE2() : at.poses[k - 1];
    const auto& moved = log_.frames[k].moved;
    const Vector<3> e = cairn::local(before * moved.mean, at.poses[k]);
    const Matrix<3> by_before = -(at.poses[k].inverse() * before).adjoint();
    const int row = 3 * static_cast<int>(k);
    add<3, 3, 3>(to, e, moved.covariance, row - 3, by_before, row, Matrix<3>::Identity());
  }

  void add_sighting(example::NormalEquations& to, const Estimate& at, std::size_t k,
                    const Map::Sighting& sighting) const {
    const SE2& x = at.poses[k];
    const Vector<2>& m = at.landmarks.at(*sighting.identity);
    const auto [e, noise] = error_of(log_.sensor, x, m, sighting);
    const Vector<2> at_least = linearised_at(log_.sensor, x, m, sighting);
    add<2, 3, 2>(to, e, noise, 3 * static_cast<int>(k), log_.sensor.state_jacobian(x, at_least),
                 row_of_.at(*sighting.identity), log_.sensor.part_jacobian(x, at_least));
  }

  const LandmarkLog& log_;
  std::map<std::uint32_t, int> row_of_;
  int rows_ = 0;
};

}  // namespace

BatchOptimum batch_optimum(const LandmarkLog& log, const std::vector<SE2>& start) {
  if (start.size() != log.frames.size())
    cairn::raise("batch_optimum: expected " + std::to_string(log.frames.size()) + " poses, found " +
                 std::to_string(start.size()));
  Estimate first{start, {}};
  for (std::size_t k = 0; k < start.size(); ++k)
    for (const auto& sighting : log.frames[k].seen)
      if (sighting.identity)
        first.landmarks.try_emplace(*sighting.identity, log.sensor.initialise(start[k], sighting.z));
  const Problem problem(log, first.landmarks);
  auto best = example::levenberg(
      std::move(first), [&](const Estimate& at) { return problem.equations_at(at); },
      [&](const Estimate& at, const Eigen::VectorXd& d) { return problem.moved(at, d); });
  return {std::move(best.at.poses), std::move(best.at.landmarks), best.cost, best.iterations, best.converged};
}

namespace {

/// An optimum without the names that it contradicts, and what both are worth together: less is likelier.
struct Doubting {
  BatchOptimum optimum;
  double cost = 0;
  std::size_t last = 0;  ///< frame beyond the last one with a name that is doubted; 0: none is
};

Doubting doubting(LandmarkLog& log, const std::vector<SE2>& start) {
  static const double most_off = cairn::chi_square_quantile(1 - 1e-7, 2);
  constexpr int most_rounds = 50;
  Doubting result{batch_optimum(log, start)};
  BatchOptimum& optimum = result.optimum;
  for (int round = 0; round < most_rounds; ++round) {
    struct Off {
      double squared;  // in sigmas
      Map::Sighting* sighting;
      std::size_t frame;
    };
    std::vector<Off> off;
    double worst = 0;
    for (std::size_t k = 0; k < log.frames.size(); ++k)
      for (auto& sighting : log.frames[k].seen) {
        if (!sighting.identity) continue;
        const auto& [e, noise] =
            error_of(log.sensor, optimum.poses[k], optimum.landmarks.at(*sighting.identity), sighting);
        const double squared = cairn::Cholesky<2>(noise).whiten(e).squaredNorm();
        if (squared > most_off) off.push_back({squared, &sighting, k});
        worst = std::max(worst, squared);
      }
    if (off.empty()) break;
    for (const auto& [squared, sighting, frame] : off) {
      if (squared < worst / 4) continue;
      sighting->identity.reset();
      result.cost += 0.5 * most_off;
      result.last = std::max(result.last, frame + 1);
    }
    // What was read wrongly may have bent the path: from the start as well.
    optimum = batch_optimum(log, optimum.poses);
    if (BatchOptimum again = batch_optimum(log, start); again.cost < optimum.cost) optimum = std::move(again);
  }
  result.cost += optimum.cost;
  return result;
}

/// Adds frames of a log to its first ones, and poses by odometry to theirs.
void grow(LandmarkLog& part, std::vector<SE2>& poses, const std::vector<Frame>& frames, std::size_t by) {
  const std::size_t end = std::min(part.frames.size() + std::max<std::size_t>(1, by), frames.size());
  for (std::size_t k = part.frames.size(); k < end; ++k) {
    part.frames.push_back(frames[k]);
    const SE2& moved = frames[k].moved.mean;
    poses.push_back(poses.empty() ? moved : poses.back() * moved);
  }
}

}  // namespace

BatchOptimum doubting_batch_optimum(LandmarkLog& log, const std::vector<SE2>& start, std::size_t settled) {
  constexpr std::size_t by = 25;
  const std::vector<Frame> as_said = log.frames;
  Doubting best = doubting(log, start);
  if (settled > 0 && best.last > settled) {
    const auto count = static_cast<std::ptrdiff_t>(settled);
    LandmarkLog part{.name = log.name, .sensor = log.sensor};
    part.frames.assign(as_said.begin(), as_said.begin() + count);
    std::vector<SE2> poses(start.begin(), start.begin() + count);
    while (part.frames.size() < as_said.size()) {
      grow(part, poses, as_said, by);
      poses = doubting(part, poses).optimum.poses;
    }
    part.frames = as_said;
    if (Doubting grown = doubting(part, poses); grown.cost < best.cost) {
      best = std::move(grown);
      log.frames = std::move(part.frames);
    }
  }
  return std::move(best.optimum);
}

BatchOptimum growing_batch_optimum(const LandmarkLog& log, std::size_t by) {
  LandmarkLog part{.name = log.name, .sensor = log.sensor};
  BatchOptimum best;
  while (part.frames.size() < log.frames.size()) {
    grow(part, best.poses, log.frames, by);
    best = batch_optimum(part, best.poses);
  }
  return best;
}

struct PathDensity::Equations {
  BatchOptimum at;
  std::vector<SE2> moved;            // odometry
  std::vector<Vector<3>> residuals;  // of the motions at the optimum
  /// The optimum's pose k as seen from the one before, inverted, turns a step of that one into a step of k.
  std::vector<Matrix<3>> carried;
  Eigen::SparseMatrix<double> h;
  Factor root;
  Eigen::VectorXd sigmas;      // D^-1/2
  double log_determinant = 0;  // of the poses' marginal information

  /// What landmarks have of H stands below the poses' rows, two by two.
  template <class Visit>
  void for_each_landmark(const Visit& visit) const {
    for (int row = 3 * static_cast<int>(at.poses.size()); row < h.rows(); row += 2) {
      Matrix<2> block;
      block << h.coeff(row, row), h.coeff(row + 1, row), h.coeff(row + 1, row), h.coeff(row + 1, row + 1);
      visit(row, cairn::Cholesky<2>(block));
    }
  }
};

PathDensity::PathDensity(const LandmarkLog& log, BatchOptimum at) {
  auto equations = std::make_unique<Equations>();
  equations->at = std::move(at);
  for (std::size_t k = 0; k < log.frames.size(); ++k) {
    const SE2 before = k == 0 ? SE2() : equations->at.poses[k - 1];
    equations->moved.push_back(log.frames[k].moved.mean);
    equations->residuals.push_back(cairn::local(before * equations->moved[k], equations->at.poses[k]));
    equations->carried.push_back((equations->at.poses[k].inverse() * before).adjoint());
  }
  const BatchOptimum& optimum = equations->at;
  equations->h = Problem(log, optimum.landmarks).equations_at({optimum.poses, optimum.landmarks}).matrix();
  equations->root.compute(equations->h);
  if (equations->root.info() != Eigen::Success || !(equations->root.vectorD().minCoeff() > 0))
    cairn::raise("PathDensity: expected a log that determines every pose");
  equations->sigmas = equations->root.vectorD().cwiseSqrt().cwiseInverse();
  equations->log_determinant = equations->root.vectorD().array().log().sum();
  equations->for_each_landmark([&](int, const cairn::Cholesky<2>& landmark) {
    equations->log_determinant -= landmark.log_determinant();
  });
  equations_ = std::move(equations);
}
PathDensity::PathDensity(PathDensity&&) noexcept = default;
PathDensity& PathDensity::operator=(PathDensity&&) noexcept = default;
PathDensity::~PathDensity() = default;

const BatchOptimum& PathDensity::optimum() const noexcept {
  return equations_->at;
}

std::size_t PathDensity::size() const noexcept {
  return static_cast<std::size_t>(equations_->h.rows());
}

// H = P^T L D L^T P: d = P^T L^-T D^-1/2 z has the covariance H^-1. What d says of each motion's residual is
// taken as the residual, and the motions are made one after the other.
std::vector<SE2> PathDensity::path(const std::vector<double>& white) const {
  CAIRN_EXPECTS(white.size() == size(), "path needs as many numbers as size() says");
  const auto& [at, moved, residuals, carried, h, root, sigmas, log_determinant] = *equations_;
  Eigen::VectorXd z = sigmas;
  for (int i = 0; i < z.size(); ++i) z(i) *= white[static_cast<std::size_t>(i)];
  const Eigen::VectorXd d = root.permutationPinv() * Eigen::VectorXd(root.matrixU().solve(z));
  std::vector<SE2> poses;
  Vector<3> before = Vector<3>::Zero();
  for (std::size_t k = 0; k < at.poses.size(); ++k) {
    const Vector<3> step = d.segment<3>(3 * static_cast<int>(k));
    const Vector<3> residual = residuals[k] + step - carried[k] * before;
    poses.push_back(cairn::retract((k == 0 ? SE2() : poses.back()) * moved[k], residual));
    before = step;
  }
  return poses;
}

std::vector<SE2> PathDensity::draw(cairn::Random& random) const {
  std::vector<double> white(size());
  for (double& v : white) v = random.normal(0, 1);
  return path(white);
}

// The marginal's information is H_xx - H_xm H_mm^-1 H_mx, and landmarks do not meet each other in H.
double PathDensity::log_density(const std::vector<SE2>& poses) const {
  const auto& [at, moved, residuals, carried, h, root, sigmas, log_determinant] = *equations_;
  Eigen::VectorXd e = Eigen::VectorXd::Zero(h.rows());
  Vector<3> step = Vector<3>::Zero();
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const Vector<3> residual = cairn::local((k == 0 ? SE2() : poses[k - 1]) * moved[k], poses[k]);
    step = residual - residuals[k] + carried[k] * step;
    e.segment<3>(3 * static_cast<int>(k)) = step;
  }
  const Eigen::VectorXd v = h.selfadjointView<Eigen::Lower>() * e;
  double squared = e.dot(v);
  equations_->for_each_landmark([&](int row, const cairn::Cholesky<2>& landmark) {
    squared -= landmark.whiten(Vector<2>(v.segment<2>(row))).squaredNorm();
  });
  return 0.5 * (log_determinant - squared);
}

}  // namespace fastslam
