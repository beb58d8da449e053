// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Least squares of many unknowns, few of which meet in a residual: sparse normal equations, and Gauss-Newton
/// steps under Levenberg's damping (D. Marquardt, J. SIAM 11, 1963, by whose rule it follows the diagonal).
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include <Eigen/SparseCholesky>

#include <cairn/core/linalg.hpp>

namespace example {

/// Of a cost 1/2 sum |e|^2 at one estimate: H = sum J^T J, of which the lower triangle is kept, and the
/// gradient sum J^T e. Blocks are added where they stand; those of one place add up.
class NormalEquations {
public:
  explicit NormalEquations(int unknowns) : gradient_(Eigen::VectorXd::Zero(unknowns)) {}

  [[nodiscard]] double cost() const { return cost_; }
  [[nodiscard]] const Eigen::VectorXd& gradient() const { return gradient_; }
  /// The lower triangle of H.
  [[nodiscard]] Eigen::SparseMatrix<double> matrix() const {
    Eigen::SparseMatrix<double> h(gradient_.size(), gradient_.size());
    h.setFromTriplets(entries_.begin(), entries_.end());
    return h;
  }

  void add_cost(double half_of_square) { cost_ += half_of_square; }
  template <int N>
  void add_gradient(int row, const cairn::Vector<N>& g) {
    gradient_.segment<N>(row) += g;
  }
  /// A block of H. What lies above the diagonal is left out: a block beside it is given as the lower one.
  template <int R, int C>
  void add_block(int row, int column, const cairn::Matrix<R, C>& m) {
    for (int i = 0; i < R; ++i)
      for (int j = 0; j < C; ++j)
        if (row + i >= column + j) entries_.emplace_back(row + i, column + j, m(i, j));
  }

private:
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::VectorXd gradient_;
  double cost_ = 0;
};

/// The lower triangle of H + damping diag H, with an entry for each of the diagonal's.
[[nodiscard]] inline Eigen::SparseMatrix<double> damped(Eigen::SparseMatrix<double> h, double damping) {
  for (int i = 0; i < h.rows(); ++i) h.coeffRef(i, i) *= 1 + damping;
  return h;
}

struct LevenbergOptions {
  int most_iterations = 200;
  double most_damping = 1e12;
  double least_gain = 1e-9;  ///< share of the cost that a step has to take off or promise, or it was the last
};

template <class Estimate>
struct LeastSquares {
  Estimate at;
  double cost = 0;
  int iterations = 0;
  bool converged = false;  ///< the last step gained little, or promised little; else the cost still falls
};

/// Begins at an estimate and takes only steps that lower the cost, which may be infinite or no number where
/// an estimate makes no sense. `equations_at(estimate)` are NormalEquations whose entries stand at the same
/// places for all estimates, `moved(estimate, d)` is the estimate after a step. The start as it is where no
/// step lowers its cost, as where H is singular.
template <class Estimate, class EquationsAt, class Moved>
[[nodiscard]] LeastSquares<Estimate> levenberg(Estimate start, const EquationsAt& equations_at,
                                               const Moved& moved, const LevenbergOptions& options = {}) {
  LeastSquares<Estimate> best{std::move(start)};
  NormalEquations equations = equations_at(best.at);
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> root;
  Eigen::SparseMatrix<double> h = equations.matrix();
  root.analyzePattern(damped(h, 0));
  double damping = 1e-4;
  for (; best.iterations < options.most_iterations && !best.converged && damping < options.most_damping;
       ++best.iterations) {
    root.factorize(damped(h, damping));
    const Eigen::VectorXd step = root.solve(-equations.gradient());
    Estimate next = moved(std::as_const(best.at), step);
    NormalEquations there = equations_at(next);
    if (!(there.cost() < equations.cost())) {
      // What the equations promised; with more damping they promise less.
      const double promised =
          0.5 * (damping * step.dot(h.diagonal().cwiseProduct(step)) - step.dot(equations.gradient()));
      best.converged = root.info() == Eigen::Success && promised <= options.least_gain * equations.cost();
      damping *= 10;
      continue;
    }
    best.converged = equations.cost() - there.cost() < options.least_gain * equations.cost();
    best.at = std::move(next);
    equations = std::move(there);
    if (!best.converged) h = equations.matrix();
    damping = std::max(1e-12, damping / 10);
  }
  best.cost = equations.cost();
  return best;
}

}  // namespace example
