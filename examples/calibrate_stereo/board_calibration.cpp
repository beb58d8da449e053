// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "board_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>

#include <cairn/core/check.hpp>
#include <cairn/geometry/triangulation.hpp>

namespace calibrate_stereo {
namespace {

using Dense = cairn::Matrix<cairn::dynamic, cairn::dynamic>;
using Column = cairn::Vector<cairn::dynamic>;
using cairn::SE3;

constexpr int lens_numbers = 5;
constexpr int camera_numbers = 4 + lens_numbers;

/// A camera's numbers in the order of the file: fx, fy, cx, cy, k1, k2, p1, p2, k3.
std::array<double, camera_numbers> numbers_of(const cairn::PinholeCamera& camera) {
  const cairn::PinholeParameters& p = camera.parameters();
  return {p.fx, p.fy, p.cx, p.cy, p.k1, p.k2, p.p1, p.p2, p.k3};
}

cairn::PinholeCamera camera_of(const std::array<double, camera_numbers>& n,
                               const cairn::PinholeCamera& sized) {
  cairn::PinholeParameters p = sized.parameters();
  p.fx = n[0];
  p.fy = n[1];
  p.cx = n[2];
  p.cy = n[3];
  p.k1 = n[4];
  p.k2 = n[5];
  p.p1 = n[6];
  p.p2 = n[7];
  p.k3 = n[8];
  return cairn::PinholeCamera(p);
}

struct State {
  cairn::StereoRig rig;
  std::vector<SE3> boards;  // T_left_board
};

/// The order of the unknowns: left camera, right camera, T_left_right, boards; of a camera the first 4 +
/// lens.
struct Layout {
  int lens;
  std::size_t views;
  [[nodiscard]] int camera() const { return 4 + lens; }
  [[nodiscard]] int motion() const { return 2 * camera(); }
  [[nodiscard]] int rig() const { return motion() + 6; }
  [[nodiscard]] int board(std::size_t v) const { return rig() + 6 * static_cast<int>(v); }
  [[nodiscard]] int size() const { return board(views); }
};

State moved(const State& state, const Column& step, const Layout& layout) {
  State next = state;
  for (int side = 0; side < 2; ++side) {
    cairn::PinholeCamera& camera = side == 0 ? next.rig.left : next.rig.right;
    std::array<double, camera_numbers> numbers = numbers_of(camera);
    for (int i = 0; i < layout.camera(); ++i)
      numbers[static_cast<std::size_t>(i)] += step(side * layout.camera() + i);
    camera = camera_of(numbers, camera);
  }
  next.rig.T_left_right =
      state.rig.T_left_right * SE3::exp(cairn::Vector<6>(step.segment<6>(layout.motion())));
  for (std::size_t v = 0; v < layout.views; ++v)
    next.boards[v] = state.boards[v] * SE3::exp(cairn::Vector<6>(step.segment<6>(layout.board(v))));
  return next;
}

/// d pixel / d (fx, fy, cx, cy, k1, k2, p1, p2, k3) at a point in front of a camera; camera.hpp's (1).
cairn::Matrix<2, camera_numbers> by_numbers(const cairn::PinholeParameters& p, const cairn::Vector<3>& point,
                                            const cairn::Vector<2>& pixel) {
  const double x = point(0) / point(2), y = point(1) / point(2), r2 = x * x + y * y;
  cairn::Matrix<2, camera_numbers> J = cairn::Matrix<2, camera_numbers>::Zero();
  J(0, 0) = (pixel(0) - p.cx) / p.fx;
  J(1, 1) = (pixel(1) - p.cy) / p.fy;
  J(0, 2) = J(1, 3) = 1;
  double power = r2;
  for (const int k : {4, 5, 8}) {
    J(0, k) = p.fx * x * power;
    J(1, k) = p.fy * y * power;
    power *= r2;
  }
  J(0, 6) = p.fx * 2 * x * y;
  J(1, 6) = p.fy * (r2 + 2 * y * y);
  J(0, 7) = p.fx * (r2 + 2 * x * x);
  J(1, 7) = p.fy * 2 * x * y;
  return J;
}

cairn::Matrix<3> cross_matrix(const cairn::Vector<3>& v) {
  cairn::Matrix<3> m;
  m << 0, -v(2), v(1), v(2), 0, -v(0), -v(1), v(0), 0;
  return m;
}

/// Calls use(view, side, point, residual); false where a point is not seen.
template <class Use>
bool each_residual(std::span<const cairn::Vector<3>> board, std::span<const BoardView> views,
                   const State& state, const Use& use) {
  const SE3 T_right_left = state.rig.T_left_right.inverse();
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t i = 0; i < board.size(); ++i) {
      const cairn::Vector<3> in_left = state.boards[v] * board[i], in_right = T_right_left * in_left;
      const auto left = state.rig.left.project(in_left);
      const auto right = state.rig.right.project(in_right);
      if (!left || !right) return false;
      use(v, 0, i, in_left, cairn::Vector<2>(views[v].left[i] - *left), *left);
      use(v, 1, i, in_right, cairn::Vector<2>(views[v].right[i] - *right), *right);
    }
  return true;
}

/// F of (1); infinite where a point is not seen.
double cost_of(std::span<const cairn::Vector<3>> board, std::span<const BoardView> views,
               const State& state) {
  double cost = 0;
  const bool seen =
      each_residual(board, views, state,
                    [&](std::size_t, int, std::size_t, const cairn::Vector<3>&, const cairn::Vector<2>& r,
                        const cairn::Vector<2>&) { cost += r.squaredNorm(); });
  return seen ? cost : INFINITY;
}

/// J^T J and J^T r.
void normal_equations(std::span<const cairn::Vector<3>> board, std::span<const BoardView> views,
                      const State& state, const Layout& layout, Dense& A, Column& b) {
  A = Dense::Zero(layout.size(), layout.size());
  b = Column::Zero(layout.size());
  const cairn::Matrix<3> R_right_left = state.rig.T_left_right.rotation().inverse().matrix();
  static_cast<void>(each_residual(
      board, views, state,
      [&](std::size_t v, int side, std::size_t i, const cairn::Vector<3>& point,
          const cairn::Vector<2>& residual, const cairn::Vector<2>& pixel) {
        const cairn::PinholeCamera& camera = side == 0 ? state.rig.left : state.rig.right;
        const cairn::Matrix<2, 3> by_point = camera.project_with_jacobian(point)->J_point;
        // The board moves on its own side: T exp(d) x = T (x + d_t + d_r x x).
        cairn::Matrix<3, 6> of_board;
        of_board.leftCols<3>() = state.boards[v].rotation().matrix();
        of_board.rightCols<3>() = -of_board.leftCols<3>() * cross_matrix(board[i]);
        if (side == 1) of_board = (R_right_left * of_board).eval();
        const cairn::Matrix<2, 6> by_board = by_point * of_board;
        const cairn::Matrix<2, camera_numbers> by_camera = by_numbers(camera.parameters(), point, pixel);
        Dense J = Dense::Zero(2, layout.camera() + 12);  // this camera, the rig's motion, the board
        J.leftCols(layout.camera()) = by_camera.leftCols(layout.camera());
        if (side == 1) {  // (T exp(d))^-1 y = T^-1 y - d_t + (T^-1 y) x d_r
          J.block<2, 3>(0, layout.camera()) = -by_point;
          J.block<2, 3>(0, layout.camera() + 3) = by_point * cross_matrix(point);
        }
        J.rightCols<6>() = by_board;
        std::array<int, 3> at{side * layout.camera(), layout.motion(), layout.board(v)};
        std::array<int, 3> from{0, layout.camera(), layout.camera() + 6}, size{layout.camera(), 6, 6};
        for (std::size_t k = 0; k < 3; ++k) {
          b.segment(at[k], size[k]) += J.middleCols(from[k], size[k]).transpose() * residual;
          for (std::size_t l = 0; l < 3; ++l)
            A.block(at[k], at[l], size[k], size[l]) +=
                J.middleCols(from[k], size[k]).transpose() * J.middleCols(from[l], size[l]);
        }
      }));
}

void check(std::span<const cairn::Vector<3>> board, std::span<const BoardView> views, std::size_t poses) {
  if (views.size() < 3)
    cairn::raise(std::to_string(views.size()) + " views of the board; expected three at least, better ten");
  if (poses != views.size()) cairn::raise("calibration: expected one pose of the board a view");
  for (const BoardView& view : views) {
    if (view.left.size() != board.size() || view.right.size() != board.size())
      cairn::raise(view.name + ": expected all " + std::to_string(board.size()) +
                   " points of the board in both images");
    for (const auto* side : {&view.left, &view.right})
      for (const cairn::Vector<2>& pixel : *side)
        if (!cairn::all_finite(pixel)) cairn::raise(view.name + ": a point of the board is not finite");
  }
}

/// RMS of the epipolar distances of a view.
double epipolar_rms(const BoardView& view, const cairn::StereoRig& rig) {
  double sum = 0;
  for (std::size_t i = 0; i < view.left.size(); ++i) {
    const auto distance = cairn::epipolar_distance(rig, view.left[i], view.right[i]);
    sum += distance ? *distance * *distance : INFINITY;
  }
  return std::sqrt(sum / static_cast<double>(view.left.size()));
}

[[noreturn]] void refuse_views() {
  cairn::raise(
      "the views do not determine the calibration; expected the board tilted in several directions, near "
      "and far, and in all parts of the images");
}

/// The inverse of J^T J, scaled to a unit diagonal for the test of its rank.
Dense covariance_of(const Dense& A) {
  const Column scale = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Dense scaled = scale.asDiagonal() * A * scale.asDiagonal();
  const Eigen::LDLT<Dense> factor(scaled);
  constexpr double least = 1e-11;
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > least)) refuse_views();
  return scale.asDiagonal() * factor.solve(Dense::Identity(A.rows(), A.cols())) * scale.asDiagonal();
}

example::CameraSigmas sigmas_of(const Column& sigmas, int first, int lens) {
  example::CameraSigmas result;
  result.intrinsics.emplace();
  result.distortion.emplace();
  for (int i = 0; i < 4; ++i) (*result.intrinsics)[static_cast<std::size_t>(i)] = sigmas(first + i);
  for (int i = 0; i < lens_numbers; ++i)
    (*result.distortion)[static_cast<std::size_t>(i)] = i < lens ? sigmas(first + 4 + i) : 0;
  return result;
}

}  // namespace

std::vector<cairn::Vector<3>> board_points(int columns, int rows, double square) {
  std::vector<cairn::Vector<3>> points;
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) points.emplace_back(square * x, square * y, 0);
  return points;
}

BoardCalibration calibrate(std::span<const cairn::Vector<3>> board, std::span<const BoardView> views,
                           const cairn::StereoRig& start, std::span<const SE3> T_left_board,
                           const BoardCalibrationOptions& options) {
  check(board, views, T_left_board.size());
  CAIRN_EXPECTS(options.distortion >= 0 && options.distortion <= lens_numbers, "a lens has 0 to 5 numbers");
  const Layout layout{options.distortion, views.size()};
  const std::size_t residuals = 4 * views.size() * board.size();
  if (residuals <= static_cast<std::size_t>(layout.size()))
    cairn::raise("fewer points than numbers to estimate; expected more views or a larger board");
  State state{start, {T_left_board.begin(), T_left_board.end()}};
  double cost = cost_of(board, views, state);
  if (!std::isfinite(cost))
    cairn::raise(
        "calibration: the start puts a board where no camera sees it; expected pairs "
        "taken at one moment, the left image of each with its own right one");
  BoardCalibration result;
  Dense A;
  Column b;
  double damping = 1e-3;
  bool settled = false;
  while (!settled && result.steps < options.most_steps) {
    normal_equations(board, views, state, layout, A, b);
    for (; result.steps < options.most_steps; damping *= 10) {
      ++result.steps;
      Dense damped = A;
      damped.diagonal() *= 1 + damping;
      const Column step = damped.ldlt().solve(b);
      if (!step.allFinite()) continue;
      State next = state;
      try {
        next = moved(state, step, layout);
      } catch (const cairn::Error&) {
        continue;  // a focal length that is not positive
      }
      const double there = cost_of(board, views, next);
      if (!(there <= cost)) {
        if (b.dot(step) <= 1e-12 * cost) {  // at the minimum to rounding
          settled = true;
          break;
        }
        continue;
      }
      settled =
          (cost - there <= 1e-12 * cost && damping < 1) || there < 1e-18 * static_cast<double>(residuals);
      state = std::move(next);
      cost = there;
      damping = std::max(damping / 10, 1e-12);
      break;
    }
  }
  normal_equations(board, views, state, layout, A, b);
  const Dense inverse = covariance_of(A);
  const double variance = cost / static_cast<double>(residuals - static_cast<std::size_t>(layout.size()));
  const Column sigmas = (variance * inverse.diagonal()).cwiseMax(0.0).cwiseSqrt();
  // Noise tilts boards that were held parallel to the images, and the equations have full rank by that alone.
  constexpr double most = 0.05;  // a focal length's sigma, relative
  for (const auto& [camera, first] :
       {std::pair{&state.rig.left, 0}, std::pair{&state.rig.right, layout.camera()}}) {
    const cairn::PinholeParameters& p = camera->parameters();
    if (!(sigmas(first) < most * p.fx) || !(sigmas(first + 1) < most * p.fy)) refuse_views();
  }
  if (!settled)
    cairn::raise("the calibration found no minimum; expected views of one rigid board by one rigid rig");
  result.pixel_sigma = std::sqrt(variance);
  result.rms = std::sqrt(cost / static_cast<double>(2 * views.size() * board.size()));
  result.rig.rig = state.rig;
  result.rig.left = sigmas_of(sigmas, 0, layout.lens);
  result.rig.right = sigmas_of(sigmas, layout.camera(), layout.lens);
  result.rig.rotation_sigma = cairn::Vector<3>(sigmas.segment<3>(layout.motion() + 3));
  // The step is in the right camera's axes, the file's sigmas in the left one's.
  const cairn::Matrix<3> R = state.rig.T_left_right.rotation().matrix();
  const cairn::Matrix<3> P =
      variance * (R * inverse.block<3, 3>(layout.motion(), layout.motion()) * R.transpose());
  result.rig.translation_sigma = cairn::Vector<3>(P.diagonal().cwiseMax(0.0).cwiseSqrt());
  const cairn::Vector<3> along = state.rig.T_left_right.translation() / state.rig.baseline();
  result.baseline_sigma = std::sqrt(std::max(0.0, along.dot(P * along)));
  result.T_left_board = state.boards;
  for (const BoardView& view : views)
    result.views.push_back({view.name, 0, 0, epipolar_rms(view, state.rig)});
  static_cast<void>(each_residual(board, views, state,
                                  [&](std::size_t v, int side, std::size_t, const cairn::Vector<3>&,
                                      const cairn::Vector<2>& r, const cairn::Vector<2>&) {
                                    (side == 0 ? result.views[v].left : result.views[v].right) +=
                                        r.squaredNorm();
                                  }));
  for (ViewError& view : result.views)
    for (double* sum : {&view.left, &view.right}) *sum = std::sqrt(*sum / static_cast<double>(board.size()));
  return result;
}

double largest_difference(const BoardCalibration& calibration, const cairn::StereoRig& other) {
  const example::CalibratedRig& own = calibration.rig;
  double largest = 0;
  const auto compare = [&](double difference, double sigma) {
    if (sigma > 0) largest = std::max(largest, std::abs(difference) / sigma);
  };
  for (const auto& [camera, sigmas, others] : {std::tuple{&own.rig.left, &own.left, &other.left},
                                               std::tuple{&own.rig.right, &own.right, &other.right}}) {
    const auto here = numbers_of(*camera), there = numbers_of(*others);
    for (std::size_t i = 0; i < here.size(); ++i)
      compare(there[i] - here[i], i < 4 ? (*sigmas->intrinsics)[i] : (*sigmas->distortion)[i - 4]);
  }
  const cairn::Vector<3> turn =
      (own.rig.T_left_right.rotation().inverse() * other.T_left_right.rotation()).log();
  const cairn::Vector<3> shift = other.T_left_right.translation() - own.rig.T_left_right.translation();
  for (int i = 0; i < 3; ++i) {
    compare(turn(i), (*own.rotation_sigma)(i));
    compare(shift(i), (*own.translation_sigma)(i));
  }
  return largest;
}

HeldOut check_view(std::span<const cairn::Vector<3>> board, int columns, const BoardView& view,
                   const cairn::StereoRig& rig) {
  HeldOut result{epipolar_rms(view, rig), 0};
  const cairn::Triangulator triangulate(rig);
  std::vector<std::optional<cairn::Vector<3>>> points;
  for (std::size_t i = 0; i < board.size(); ++i) {
    const cairn::Triangulation point = triangulate(view.left[i], view.right[i], 1, 1);
    points.push_back(point.good() ? std::optional(point.point) : std::nullopt);
  }
  double sum = 0, count = 0;
  const auto width = static_cast<std::size_t>(columns);
  for (std::size_t i = 0; i < board.size(); ++i)
    for (const std::size_t j : {i % width + 1 < width ? i + 1 : board.size(), i + width}) {
      if (j >= board.size() || !points[i] || !points[j]) continue;
      sum += (*points[j] - *points[i]).norm() / (board[j] - board[i]).norm() - 1;
      ++count;
    }
  result.length = count > 0 ? sum / count : NAN;
  return result;
}

std::vector<HeldOut> leave_one_out(std::span<const cairn::Vector<3>> board, int columns,
                                   std::span<const BoardView> views, const BoardCalibration& full,
                                   const BoardCalibrationOptions& options) {
  std::vector<HeldOut> result;
  for (std::size_t out = 0; out < views.size(); ++out) {
    std::vector<BoardView> others;
    std::vector<SE3> poses;
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (v == out) continue;
      others.push_back(views[v]);
      poses.push_back(full.T_left_board[v]);
    }
    result.push_back(check_view(board, columns, views[out],
                                calibrate(board, others, full.rig.rig, poses, options).rig.rig));
  }
  return result;
}

}  // namespace calibrate_stereo
