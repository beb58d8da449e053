// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "rival_ceres.hpp"

#ifdef CAIRN_BENCH_CERES

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <map>
#include <memory>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <ceres/ceres.h>

#include <cairn/geometry/triangulation.hpp>

namespace stereo_slam_bench {
namespace {

using cairn::Matrix;
using cairn::SE3;
using cairn::Vector;
using Dense = Eigen::MatrixXd;
using Column = Eigen::VectorXd;

/// A pose as Ceres keeps it: quaternion x, y, z, w, then translation. Its step is one in the world,
/// translation then rotation; six of a residual's seven derivatives are by that step and the last is nought.
struct Pose {
  std::array<double, 7> numbers{};
  [[nodiscard]] Eigen::Quaterniond turn() const { return Eigen::Quaterniond(numbers.data()); }
  [[nodiscard]] Eigen::Vector3d place() const { return Eigen::Map<const Eigen::Vector3d>(&numbers[4]); }
};

Eigen::Quaterniond turned_by(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const double share = angle > 1e-8 ? std::sin(angle / 2) / angle : 0.5;
  return {std::cos(angle / 2), share * w(0), share * w(1), share * w(2)};
}

Eigen::Vector3d turn_of(Eigen::Quaterniond q) {
  if (q.w() < 0) q.coeffs() *= -1;
  const double sine = q.vec().norm();
  return sine > 1e-12 ? Eigen::Vector3d(2 * std::atan2(sine, q.w()) / sine * q.vec())
                      : Eigen::Vector3d(2 * q.vec());
}

class WorldStep final : public ceres::Manifold {
public:
  [[nodiscard]] int AmbientSize() const override { return 7; }
  [[nodiscard]] int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* d, double* to) const override {
    const Eigen::Quaterniond turn = turned_by(Eigen::Map<const Eigen::Vector3d>(d + 3));
    Eigen::Map<Eigen::Vector4d>(to, 4) = (turn * Eigen::Quaterniond(x)).normalized().coeffs();
    Eigen::Map<Eigen::Vector3d>(to + 4) =
        turn * Eigen::Map<const Eigen::Vector3d>(x + 4) + Eigen::Map<const Eigen::Vector3d>(d);
    return true;
  }
  bool PlusJacobian(const double*, double* to) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> J(to);
    J.setZero();
    J.topRows<6>().setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* to) const override {
    const Eigen::Quaterniond turn = Eigen::Quaterniond(y) * Eigen::Quaterniond(x).conjugate();
    Eigen::Map<Eigen::Vector3d>(to + 3) = turn_of(turn);
    Eigen::Map<Eigen::Vector3d> shift(to);
    shift = Eigen::Map<const Eigen::Vector3d>(y + 4) - turn * Eigen::Map<const Eigen::Vector3d>(x + 4);
    return true;
  }
  bool MinusJacobian(const double*, double* to) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> J(to);
    J.setZero();
    J.leftCols<6>().setIdentity();
    return true;
  }
};

/// The four numbers that place a pinhole rig whose cameras differ by a shift along x.
struct Lens {
  double fx = 0, fy = 0, cx = 0, cy = 0, right_fx = 0, right_fy = 0, right_cx = 0, right_cy = 0, baseline = 0;
  explicit Lens(const cairn::StereoRig& rig)
      : fx(rig.left.fx()),
        fy(rig.left.fy()),
        cx(rig.left.parameters().cx),
        cy(rig.left.parameters().cy),
        right_fx(rig.right.fx()),
        right_fy(rig.right.fy()),
        right_cx(rig.right.parameters().cx),
        right_cy(rig.right.parameters().cy),
        baseline(rig.T_left_right.translation()(0)) {}
};

/// Pixels of both images against where a point should appear, in standard deviations.
class PixelError final : public ceres::SizedCostFunction<4, 7, 3> {
public:
  PixelError(const Lens& lens, const Vector<2>& left, const Vector<2>& right, double sigma)
      : lens_(lens), z_(left(0), left(1), right(0), right(1)), weight_(1 / sigma) {}

  bool Evaluate(double const* const* at, double* residuals, double** derivatives) const override {
    const Eigen::Matrix3d R = Eigen::Quaterniond(at[0]).toRotationMatrix();
    const Eigen::Map<const Eigen::Vector3d> place(at[0] + 4), x(at[1]);
    const Eigen::Vector3d p = R.transpose() * (x - place);
    if (!(p(2) > 1e-3)) return false;
    const double depth = 1 / p(2), u = p(0) * depth, v = p(1) * depth, w = (p(0) - lens_.baseline) * depth;
    Eigen::Map<Eigen::Vector4d> r(residuals);
    r << lens_.fx * u + lens_.cx, lens_.fy * v + lens_.cy, lens_.right_fx * w + lens_.right_cx,
        lens_.right_fy * v + lens_.right_cy;
    r = weight_ * (r - z_);
    if (derivatives == nullptr) return true;
    Eigen::Matrix<double, 4, 3> H;
    H << lens_.fx, 0, -lens_.fx * u, 0, lens_.fy, -lens_.fy * v, lens_.right_fx, 0, -lens_.right_fx * w, 0,
        lens_.right_fy, -lens_.right_fy * v;
    const Eigen::Matrix<double, 4, 3> by_point = weight_ * depth * H * R.transpose();
    if (derivatives[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 4, 3, Eigen::RowMajor>> J(derivatives[1]);
      J = by_point;
    }
    if (derivatives[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 4, 7, Eigen::RowMajor>> J(derivatives[0]);
      J.leftCols<3>() = -by_point;
      for (int row = 0; row < 4; ++row)
        J.block<1, 3>(row, 3) = Eigen::Vector3d(by_point.row(row)).cross(x).transpose();
      J.col(6).setZero();
    }
    return true;
  }

private:
  Lens lens_;
  Eigen::Vector4d z_;
  double weight_;
};

/// What is known of poses by what was marginalised: a root of its information and what that says at the poses
/// it was linearised at, which stay.
class PosePrior final : public ceres::CostFunction {
public:
  PosePrior(std::vector<std::array<double, 7>> at, const Dense& information, const Column& gradient)
      : at_(std::move(at)) {
    const Eigen::SelfAdjointEigenSolver<Dense> parts(information);
    const double least = 1e-12 * parts.eigenvalues().maxCoeff();
    const Column root = parts.eigenvalues().cwiseMax(least).cwiseSqrt();
    root_ = root.asDiagonal() * parts.eigenvectors().transpose();
    offset_ = root.cwiseInverse().asDiagonal() * (parts.eigenvectors().transpose() * gradient);
    set_num_residuals(static_cast<int>(information.rows()));
    for (std::size_t i = 0; i < at_.size(); ++i) mutable_parameter_block_sizes()->push_back(7);
  }
  /// r = root (x - at) + offset.
  bool Evaluate(double const* const* x, double* residuals, double** derivatives) const override {
    Column step(root_.cols());
    for (std::size_t i = 0; i < at_.size(); ++i)
      WorldStep().Minus(x[i], at_[i].data(), &step(6 * static_cast<Eigen::Index>(i)));
    Eigen::Map<Column>(residuals, root_.rows()) = root_ * step + offset_;
    for (std::size_t i = 0; derivatives != nullptr && i < at_.size(); ++i) {
      if (derivatives[i] == nullptr) continue;
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>> J(derivatives[i], root_.rows(),
                                                                              7);
      J.leftCols<6>() = root_.middleCols<6>(6 * static_cast<Eigen::Index>(i));
      J.col(6).setZero();
    }
    return true;
  }

private:
  std::vector<std::array<double, 7>> at_;
  Dense root_;
  Column offset_;
};

Pose pose_of(const SE3& T) {
  Pose pose;
  const cairn::SO3& r = T.rotation();
  pose.numbers = {r.x(), r.y(), r.z(), r.w(), T.translation()(0), T.translation()(1), T.translation()(2)};
  return pose;
}

SE3 pose_of(const Pose& pose) {
  const auto& n = pose.numbers;
  return {cairn::SO3::from_quaternion(n[3], n[0], n[1], n[2]), Vector<3>(n[4], n[5], n[6])};
}

/// Between CPU clock readings.
double seconds_since(std::clock_t start) {
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

/// Normal equations over poses with the points eliminated one by one; gradient is that of half the squares.
class PoseEquations {
public:
  explicit PoseEquations(std::size_t poses)
      : H(Dense::Zero(6 * static_cast<Eigen::Index>(poses), 6 * static_cast<Eigen::Index>(poses))),
        g(Column::Zero(H.rows())) {}
  void add(const ceres::CostFunction& prior, const std::vector<Pose*>& poses,
           const std::vector<std::size_t>& places) {
    std::vector<double*> at;
    std::vector<Dense> unused;
    std::vector<std::vector<double>> room(poses.size());
    std::vector<double*> to;
    const auto rows = static_cast<std::size_t>(prior.num_residuals());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      at.push_back(poses[i]->numbers.data());
      room[i].resize(7 * rows);
      to.push_back(room[i].data());
    }
    Column r(prior.num_residuals());
    prior.Evaluate(at.data(), r.data(), to.data());
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>;
    for (std::size_t a = 0; a < poses.size(); ++a) {
      const Dense Ja = Eigen::Map<Rows>(to[a], r.size(), 7).leftCols<6>();
      g.segment<6>(6 * static_cast<Eigen::Index>(places[a])) += Ja.transpose() * r;
      for (std::size_t b = 0; b < poses.size(); ++b)
        H.block<6, 6>(6 * static_cast<Eigen::Index>(places[a]), 6 * static_cast<Eigen::Index>(places[b])) +=
            Ja.transpose() * Eigen::Map<Rows>(to[b], r.size(), 7).leftCols<6>();
    }
  }
  /// A point and all that is to be said of it.
  struct Seen {
    const PixelError* error;
    const Pose* pose;
    std::size_t place;
  };
  void add_point(const double* x, const std::vector<Seen>& seen) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    cross_.clear();
    for (const Seen& one : seen) {
      Eigen::Vector4d r;
      Eigen::Matrix<double, 4, 7, Eigen::RowMajor> J;
      Eigen::Matrix<double, 4, 3, Eigen::RowMajor> K;
      const std::array<const double*, 2> at{one.pose->numbers.data(), x};
      std::array<double*, 2> to{J.data(), K.data()};
      if (!one.error->Evaluate(at.data(), r.data(), to.data())) continue;
      const Eigen::Matrix<double, 4, 6> Jp = J.leftCols<6>();
      const auto place = 6 * static_cast<Eigen::Index>(one.place);
      H.block<6, 6>(place, place) += Jp.transpose() * Jp;
      g.segment<6>(place) += Jp.transpose() * r;
      A += K.transpose() * K;
      b += K.transpose() * r;
      cross_.emplace_back(place, Jp.transpose() * K);
    }
    const Eigen::Matrix3d S = A.inverse();
    for (const auto& [i, Ci] : cross_) {
      const Eigen::Matrix<double, 6, 3> CS = Ci * S;
      g.segment<6>(i) -= CS * b;
      for (const auto& [j, Cj] : cross_) H.block<6, 6>(i, j) -= CS * Cj.transpose();
    }
  }

  Dense H;
  Column g;

private:
  std::vector<std::pair<Eigen::Index, Eigen::Matrix<double, 6, 3>>> cross_;
};

ceres::Solver::Options solver_options() {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;  // a dozen poses; all of a drive are not many either
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  options.max_num_iterations = 20;
  return options;
}

/// A window of keyframes over the frames of a drive.
class Window {
public:
  Window(const cairn::StereoRig& rig, std::size_t size)
      : triangulate_(rig), lens_(rig), size_(size), problem_(problem_options()) {}

  void begin(const cairn_test::ArenaFrame& frame) {
    keyframes_.push_back(std::make_unique<Pose>(pose_of(SE3())));
    problem_.AddParameterBlock(keyframes_.back()->numbers.data(), 7, &step_);
    constexpr double first_sigma = 1e-6;
    set_prior(Dense::Identity(6, 6) / (first_sigma * first_sigma), Column::Zero(6));
    add_points(frame.sightings);
  }

  /// The pose of a frame, from where the motion leads. False where Ceres fails.
  bool locate(const SE3& start, const std::vector<cairn::StereoSighting>& known) {
    now_ = std::make_unique<Pose>(pose_of(start));
    problem_.AddParameterBlock(now_->numbers.data(), 7, &step_);
    for (const cairn::StereoSighting& s : known) see(points_.at(s.landmark), *now_, s);
    auto options = solver_options();
    auto* order = new ceres::ParameterBlockOrdering;
    for (auto& [id, point] : points_) order->AddElementToGroup(point.x.data(), 0);
    for (const auto& pose : keyframes_) order->AddElementToGroup(pose->numbers.data(), 1);
    order->AddElementToGroup(now_->numbers.data(), 1);
    options.linear_solver_ordering.reset(order);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    return summary.IsSolutionUsable();
  }
  [[nodiscard]] SE3 pose() const { return pose_of(*now_); }
  /// Of that pose, a step in the world.
  [[nodiscard]] Matrix<6> covariance() const {
    std::vector<const Pose*> poses = kept();
    poses.push_back(now_.get());
    PoseEquations all(poses.size());
    add_prior(all);
    for (const auto& [id, point] : points_) all.add_point(point.x.data(), seen(point, poses, nullptr));
    Dense right = Dense::Zero(all.H.rows(), 6);
    right.bottomRows<6>().setIdentity();
    return all.H.ldlt().solve(right).bottomRows<6>();
  }

  void drop() {
    problem_.RemoveParameterBlock(now_->numbers.data());  // and its residuals, whose errors are still there
    for (auto& [id, point] : points_) forget(point, now_.get());
    now_.reset();
  }

  void keep(const std::vector<cairn::StereoSighting>& unknown) {
    keyframes_.push_back(std::move(now_));
    add_points(unknown);
    if (keyframes_.size() > size_) marginalise();
  }

  [[nodiscard]] bool knows(std::uint32_t landmark) const { return points_.contains(landmark); }

private:
  struct Sight {
    Pose* pose;
    std::unique_ptr<PixelError> error;
    ceres::ResidualBlockId block;
  };
  struct Point {
    std::array<double, 3> x{};
    std::vector<Sight> seen;
  };

  static ceres::Problem::Options problem_options() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.enable_fast_removal = true;
    options.disable_all_safety_checks = true;
    return options;
  }

  void see(Point& point, Pose& pose, const cairn::StereoSighting& s) {
    auto error = std::make_unique<PixelError>(lens_, s.left, s.right, s.sigma);
    const auto block = problem_.AddResidualBlock(error.get(), nullptr, pose.numbers.data(), point.x.data());
    point.seen.push_back({&pose, std::move(error), block});
  }
  /// Only the entry: the caller takes the residual out of the problem.
  static void forget(Point& point, const Pose* pose) {
    std::erase_if(point.seen, [&](const Sight& one) { return one.pose == pose; });
  }
  void add_points(const std::vector<cairn::StereoSighting>& sightings) {
    Pose& newest = *keyframes_.back();
    const SE3 T = pose_of(newest);
    for (const cairn::StereoSighting& s : sightings) {
      const cairn::Triangulation there = triangulate_(s.left, s.right, s.sigma, s.sigma);
      if (!there.good()) continue;
      const Vector<3> x = T * there.point;
      Point& point = points_[s.landmark];
      point.x = {x(0), x(1), x(2)};
      see(point, newest, s);
    }
  }

  [[nodiscard]] std::vector<const Pose*> kept() const {
    std::vector<const Pose*> poses;
    for (const auto& pose : keyframes_) poses.push_back(pose.get());
    return poses;
  }
  /// What was seen of a point but by `without`.
  [[nodiscard]] static std::vector<PoseEquations::Seen> seen(const Point& point,
                                                             const std::vector<const Pose*>& poses,
                                                             const Pose* without) {
    std::vector<PoseEquations::Seen> result;
    for (const Sight& one : point.seen) {
      if (one.pose == without) continue;
      const auto at = std::ranges::find(poses, one.pose);
      result.push_back({one.error.get(), one.pose, static_cast<std::size_t>(at - poses.begin())});
    }
    return result;
  }
  void add_prior(PoseEquations& equations) const {
    std::vector<Pose*> poses;
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < prior_poses_; ++i) {
      poses.push_back(keyframes_[i].get());
      places.push_back(i);
    }
    equations.add(*prior_, poses, places);
  }
  /// On all the keyframes there are.
  void set_prior(const Dense& information, const Column& gradient) {
    if (prior_) problem_.RemoveResidualBlock(prior_block_);
    std::vector<std::array<double, 7>> at;
    std::vector<double*> blocks;
    for (const auto& pose : keyframes_) {
      at.push_back(pose->numbers);
      blocks.push_back(pose->numbers.data());
    }
    prior_ = std::make_unique<PosePrior>(std::move(at), information, gradient);
    prior_poses_ = keyframes_.size();
    prior_block_ = problem_.AddResidualBlock(prior_.get(), nullptr, blocks);
  }

  void marginalise() {
    const std::vector<const Pose*> poses = kept();
    Pose* const oldest = keyframes_.front().get();
    Pose* const newest = keyframes_.back().get();
    PoseEquations leaving(poses.size());
    add_prior(leaving);
    for (auto it = points_.begin(); it != points_.end();) {
      Point& point = it->second;
      const auto by = [&](const Pose* pose) {
        return std::ranges::any_of(point.seen, [&](const Sight& one) { return one.pose == pose; });
      };
      if (!by(oldest)) {
        ++it;
        continue;
      }
      leaving.add_point(point.x.data(), seen(point, poses, newest));
      if (by(newest)) {
        std::erase_if(point.seen, [&](const Sight& one) {
          if (one.pose == newest) return false;
          problem_.RemoveResidualBlock(one.block);
          return true;
        });
        ++it;
      } else {
        problem_.RemoveParameterBlock(point.x.data());
        it = points_.erase(it);
      }
    }
    const Eigen::Index n = leaving.H.rows() - 6;
    const Eigen::LDLT<Dense> oldest_alone(leaving.H.topLeftCorner(6, 6));
    const Dense K = oldest_alone.solve(leaving.H.topRightCorner(6, n)).transpose();
    const Dense H = leaving.H.bottomRightCorner(n, n) - K * leaving.H.topRightCorner(6, n);
    const Column g = leaving.g.tail(n) - K * leaving.g.head(6);
    problem_.RemoveResidualBlock(prior_block_);
    prior_.reset();
    problem_.RemoveParameterBlock(oldest->numbers.data());
    keyframes_.erase(keyframes_.begin());
    set_prior((H + H.transpose()) / 2, g);
  }

  cairn::Triangulator triangulate_;
  Lens lens_;
  std::size_t size_;
  WorldStep step_;
  std::vector<std::unique_ptr<Pose>> keyframes_;  // oldest first
  std::unique_ptr<Pose> now_;
  std::map<std::uint32_t, Point> points_;
  std::unique_ptr<PosePrior> prior_;
  std::size_t prior_poses_ = 0;  // of the oldest keyframes
  ceres::Problem problem_;       // refers to all of the above
  ceres::ResidualBlockId prior_block_{};
};

}  // namespace

std::optional<BundleSolution> solve_with_ceres(const cairn::StereoRig& rig, const Bundle& bundle) {
  const std::clock_t start = std::clock();
  const Lens lens(rig);
  std::vector<Pose> poses;
  for (const SE3& pose : bundle.poses) poses.push_back(pose_of(pose));
  std::vector<Vector<3>> points = bundle.points;
  ceres::Problem problem;
  auto options = solver_options();
  auto* order = new ceres::ParameterBlockOrdering;
  options.linear_solver_ordering.reset(order);
  for (Pose& pose : poses) {
    problem.AddParameterBlock(pose.numbers.data(), 7, new WorldStep);
    order->AddElementToGroup(pose.numbers.data(), 1);
  }
  for (const Bundle::Sighting& s : bundle.sightings) {
    problem.AddResidualBlock(new PixelError(lens, s.left, s.right, s.sigma), nullptr,
                             poses[s.pose].numbers.data(), points[s.point].data());
    order->AddElementToGroup(points[s.point].data(), 0);
  }
  // Held rather than known to a micrometre, which a factorisation need not find out.
  problem.SetParameterBlockConstant(poses[0].numbers.data());
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-14;
  options.gradient_tolerance = 1e-10;
  options.parameter_tolerance = 1e-12;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return std::nullopt;
  BundleSolution solution;
  solution.seconds = seconds_since(start);
  for (const Pose& pose : poses) solution.poses.push_back(pose_of(pose));

  PoseEquations all(poses.size());
  std::vector<std::vector<PoseEquations::Seen>> seen(points.size());
  std::vector<std::unique_ptr<PixelError>> errors;
  for (const Bundle::Sighting& s : bundle.sightings) {
    errors.push_back(std::make_unique<PixelError>(lens, s.left, s.right, s.sigma));
    seen[s.point].push_back({errors.back().get(), &poses[s.pose], s.pose});
  }
  for (std::size_t i = 0; i < points.size(); ++i) all.add_point(points[i].data(), seen[i]);
  const Eigen::Index n = all.H.rows() - 6;
  solution.covariance = all.H.bottomRightCorner(n, n).llt().solve(Dense::Identity(n, n));
  return solution;
}

std::optional<WindowRun> drive_ceres_window(const cairn::StereoRig& rig,
                                            const std::vector<cairn_test::ArenaFrame>& frames,
                                            const cairn_test::ArenaRule& rule, std::size_t size) {
  const std::clock_t start = std::clock();
  WindowRun run;
  Window window(rig, size);
  window.begin(frames[0]);
  SE3 pose, motion;
  int since = 0;
  for (std::size_t f = 1; f < frames.size(); ++f) {
    std::vector<cairn::StereoSighting> known, unknown;
    for (const cairn::StereoSighting& s : frames[f].sightings)
      (window.knows(s.landmark) ? known : unknown).push_back(s);
    if (!window.locate(pose * motion, known)) return std::nullopt;
    motion = pose.inverse() * window.pose();
    pose = window.pose();
    const Matrix<6> Ad = pose.inverse().adjoint();
    run.poses.push_back(pose);
    run.covariances.push_back(Ad * window.covariance() * Ad.transpose());
    ++since;
    if (static_cast<double>(unknown.size()) >
            rule.unknown * static_cast<double>(frames[f].sightings.size()) &&
        since >= rule.apart) {
      window.keep(unknown);
      ++run.keyframes;
      since = 0;
    } else {
      window.drop();
    }
  }
  run.seconds = seconds_since(start);
  return run;
}

}  // namespace stereo_slam_bench

#else

namespace stereo_slam_bench {

std::optional<BundleSolution> solve_with_ceres(const cairn::StereoRig&, const Bundle&) {
  return std::nullopt;
}
std::optional<WindowRun> drive_ceres_window(const cairn::StereoRig&,
                                            const std::vector<cairn_test::ArenaFrame>&,
                                            const cairn_test::ArenaRule&, std::size_t) {
  return std::nullopt;
}

}  // namespace stereo_slam_bench

#endif
