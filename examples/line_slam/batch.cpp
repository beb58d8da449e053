// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "batch.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

#include <Eigen/SparseCholesky>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>

namespace line_slam {

namespace {

using cairn::Matrix;
using cairn::SE3;
using cairn::Vector;

struct SightingOfLine {
  std::size_t frame, index, line;
};
struct Estimate {
  std::vector<SE3> poses;
  std::vector<MappedLine> lines;
};

/// Which lines were seen along a path, and where the map of that path has them.
std::vector<SightingOfLine> associated(const Drive& drive, Estimate& estimate, Map map) {
  std::vector<SightingOfLine> all, kept;
  cairn::Random none(1);  // the likeliest are no draw
  std::uint32_t numbers = 0;
  for (std::size_t k = 0; k < estimate.poses.size(); ++k) {
    const auto& seen = drive.frames[k].seen;
    const cairn::Association choice = map.choose(estimate.poses[k], seen, none).choice;
    for (std::size_t i = 0; i < choice.size(); ++i) {
      const bool is_new = choice[i] == cairn::new_landmark;
      if (choice[i] != cairn::no_landmark)
        all.push_back({k, i, is_new ? seen[i].identity.value_or(numbers) : choice[i]});
      numbers += is_new;
    }
    map.insert(estimate.poses[k], seen, choice);
  }
  std::map<std::size_t, std::size_t> place;  // of a line of the map among the estimate's
  for (SightingOfLine s : all) {
    const auto* landmark = map.find(static_cast<std::uint32_t>(s.line));
    if (landmark == nullptr) continue;
    const auto [at, is_new] = place.try_emplace(s.line, estimate.lines.size());
    if (is_new) estimate.lines.push_back(landmark->belief.mean);
    s.line = at->second;
    kept.push_back(s);
  }
  return kept;
}

/// The normal equations at an estimate: unknowns are steps of the poses, then of the lines.
class NormalEquations {
public:
  NormalEquations(const Drive& drive, const LineSensor& sensor, const std::vector<SightingOfLine>& sightings,
                  const Estimate& at)
      : poses_(6 * static_cast<int>(at.poses.size())),
        gradient_(Eigen::VectorXd::Zero(poses_ + 4 * static_cast<int>(at.lines.size()))) {
    for (std::size_t k = 0; k < at.poses.size(); ++k)
      add_motion(drive.frames[k].moved, k == 0 ? drive.truth.front() : at.poses[k - 1], at.poses[k], k);
    for (const SightingOfLine& s : sightings)
      add_sighting(sensor.of(drive.frames[s.frame].seen[s.index].z), at, s);
  }

  /// Not finite where a line has left the cameras' front.
  [[nodiscard]] double cost() const { return cost_; }
  [[nodiscard]] const Eigen::VectorXd& gradient() const { return gradient_; }
  /// H + damping diag H, its lower triangle.
  [[nodiscard]] Eigen::SparseMatrix<double> damped(double damping) const {
    Eigen::SparseMatrix<double> h(gradient_.size(), gradient_.size());
    h.setFromTriplets(entries_.begin(), entries_.end());
    for (int i = 0; i < gradient_.size(); ++i) h.coeffRef(i, i) *= 1 + damping;
    return h;
  }
  [[nodiscard]] Estimate moved(const Estimate& at, const Eigen::VectorXd& d) const {
    Estimate next = at;
    for (std::size_t k = 0; k < next.poses.size(); ++k)
      next.poses[k] = cairn::retract(next.poses[k], Vector<6>(d.segment<6>(6 * static_cast<int>(k))));
    for (std::size_t n = 0; n < next.lines.size(); ++n)
      next.lines[n] =
          cairn::retract(next.lines[n], Vector<4>(d.segment<4>(poses_ + 4 * static_cast<int>(n))));
    return next;
  }

private:
  template <int R, int C>
  void put(int row, int column, const Matrix<R, C>& m) {
    for (int i = 0; i < R; ++i)
      for (int j = 0; j < C; ++j)
        if (row + i >= column + j) entries_.emplace_back(row + i, column + j, m(i, j));
  }

  /// The steps of a drive err in each direction by itself.
  void add_motion(const cairn::Gaussian<SE3>& moved, const SE3& before, const SE3& pose, std::size_t k) {
    const Vector<6> information = moved.covariance.diagonal().cwiseInverse();
    const Vector<6> e = cairn::local(before * moved.mean, pose);
    const Matrix<6> by_before = -(pose.inverse() * before).adjoint();
    const Matrix<6> weighed = information.asDiagonal() * by_before;
    const int row = 6 * static_cast<int>(k);
    cost_ += 0.5 * e.dot(information.cwiseProduct(e));
    put(row, row, Matrix<6>(information.asDiagonal()));
    gradient_.segment<6>(row) += information.cwiseProduct(e);
    if (k == 0) return;
    put(row, row - 6, weighed);
    put(row - 6, row - 6, Matrix<6>(by_before.transpose() * weighed));
    gradient_.segment<6>(row - 6) += weighed.transpose() * e;
  }

  /// Half of c^2 chi^2 / (c^2 + chi^2) is what one that is wrong may cost at most: half of c^2.
  void add_sighting(const EndsOfSighting& model, const Estimate& at, const SightingOfLine& s) {
    constexpr double c_squared = 9;
    const SE3& x = at.poses[s.frame];
    const MappedLine& line = at.lines[s.line];
    const Vector<6> e = model.predict(x, line) / model.sigma;
    const double chi_squared = e.squaredNorm(), share = c_squared / (c_squared + chi_squared);
    cost_ += 0.5 * share * chi_squared;
    const Matrix<6> by_pose = share * model.state_jacobian(x, line) / model.sigma;
    const Matrix<6, 4> by_line = share * model.part_jacobian(x, line) / model.sigma;
    const int row = 6 * static_cast<int>(s.frame), line_row = poses_ + 4 * static_cast<int>(s.line);
    put(row, row, Matrix<6>(by_pose.transpose() * by_pose));
    put(line_row, line_row, Matrix<4>(by_line.transpose() * by_line));
    put(line_row, row, Matrix<4, 6>(by_line.transpose() * by_pose));
    gradient_.segment<6>(row) += share * by_pose.transpose() * e;
    gradient_.segment<4>(line_row) += share * by_line.transpose() * e;
  }

  int poses_;
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::VectorXd gradient_;
  double cost_ = 0;
};

}  // namespace

std::vector<SE3> smoothed(const Drive& drive, const std::vector<SE3>& path, const Map& empty) {
  if (path.size() > drive.frames.size())
    cairn::raise("smoothed: expected a path of the drive's frames, found more poses");
  if (path.empty()) return path;
  Estimate at{path, {}};
  const std::vector<SightingOfLine> sightings = associated(drive, at, empty);
  const auto equations_at = [&](const Estimate& e) {
    return NormalEquations(drive, empty.sensor(), sightings, e);
  };
  NormalEquations equations = equations_at(at);
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> root;
  root.analyzePattern(equations.damped(0));
  constexpr int most_iterations = 30;
  double damping = 1e-4;
  for (int i = 0; i < most_iterations && damping < 1e10; ++i) {
    root.factorize(equations.damped(damping));
    Estimate next = equations.moved(at, root.solve(-equations.gradient()));
    NormalEquations there = equations_at(next);
    if (!(there.cost() < equations.cost())) {
      damping *= 10;
      continue;
    }
    const bool is_done = equations.cost() - there.cost() < 1e-6 * equations.cost();
    at = std::move(next);
    equations = std::move(there);
    damping = std::max(1e-12, damping / 10);
    if (is_done) break;
  }
  return at.poses;
}

}  // namespace line_slam
