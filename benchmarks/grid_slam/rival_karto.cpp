// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "rivals.hpp"

#ifdef CAIRN_BENCH_KARTO
#include <atomic>
#include <cmath>
#include <ctime>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>

#include <open_karto/Mapper.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/manifold/so2.hpp>

#include "support/sparse_least_squares.hpp"
#endif

namespace grid_slam_bench {

#ifndef CAIRN_BENCH_KARTO
std::optional<RivalPath> open_karto(const cairn::CarmenLog&) {
  return std::nullopt;
}
#else
namespace {

using cairn::Matrix;
using cairn::SE2;
using cairn::Vector;

SE2 pose_of(const karto::Pose2& pose) {
  return {pose.GetX(), pose.GetY(), pose.GetHeading()};
}

/// The least squares of the graph, each edge a pose seen from another, with the covariance that the matcher
/// gives it.
class GraphSolver final : public karto::ScanSolver {
public:
  void AddNode(karto::Vertex<karto::LocalizedRangeScan>* vertex) override {
    const auto* scan = vertex->GetObject();
    row_[scan->GetUniqueId()] = static_cast<int>(poses_.size());
    ids_.push_back(scan->GetUniqueId());
    poses_.push_back(pose_of(scan->GetCorrectedPose()));
  }
  void AddConstraint(karto::Edge<karto::LocalizedRangeScan>* edge) override {
    auto* seen = dynamic_cast<karto::LinkInfo*>(edge->GetLabel());
    karto::Matrix3 covariance = seen->GetCovariance();
    Matrix<3> sigma;
    for (int i = 0; i < 9; ++i)
      sigma(i / 3, i % 3) = covariance(static_cast<kt_int32u>(i / 3), static_cast<kt_int32u>(i % 3));
    edges_.push_back({row_.at(edge->GetSource()->GetObject()->GetUniqueId()),
                      row_.at(edge->GetTarget()->GetObject()->GetUniqueId()),
                      pose_of(seen->GetPoseDifference()), cairn::Cholesky<3>(sigma).inverse()});
  }
  void Compute() override {
    poses_ = example::levenberg(
                 poses_, [&](const Poses& at) { return equations(at); },
                 [](const Poses& at, const Eigen::VectorXd& d) {
                   Poses moved = at;
                   for (std::size_t i = 0; i < at.size(); ++i)
                     moved[i] =
                         cairn::retract(at[i], Vector<3>(d.segment<3>(static_cast<Eigen::Index>(3 * i))));
                   return moved;
                 },
                 {.most_iterations = 40})
                 .at;
    corrections_.clear();
    for (std::size_t i = 0; i < poses_.size(); ++i)
      corrections_.emplace_back(ids_[i], karto::Pose2(poses_[i].x(), poses_[i].y(), poses_[i].angle()));
  }
  [[nodiscard]] const IdPoseVector& GetCorrections() const override { return corrections_; }
  void Clear() override { corrections_.clear(); }

private:
  using Poses = std::vector<SE2>;
  struct Edge {
    int from, to;
    SE2 seen;
    Matrix<3> information;
  };

  [[nodiscard]] example::NormalEquations equations(const Poses& at) const {
    example::NormalEquations sum(static_cast<int>(3 * at.size()));
    sum.add_block<3, 3>(0, 0, Matrix<3>(1e9 * Matrix<3>::Identity()));  // the first stays where it is
    for (const Edge& edge : edges_) {
      const SE2& a = at[static_cast<std::size_t>(edge.from)];
      const SE2& b = at[static_cast<std::size_t>(edge.to)];
      const SE2 between = a.inverse() * b;
      const Vector<2> apart = between.translation();
      Vector<3> error;
      error << apart - edge.seen.translation(), cairn::SO2(between.angle() - edge.seen.angle()).angle();
      Matrix<3> by_a = -Matrix<3>::Identity(), by_b = Matrix<3>::Identity();
      by_a(0, 2) = apart(1);
      by_a(1, 2) = -apart(0);
      const double c = std::cos(between.angle()), s = std::sin(between.angle());
      by_b(0, 0) = by_b(1, 1) = c;
      by_b(0, 1) = -s;
      by_b(1, 0) = s;
      add(sum, edge, error, by_a, by_b);
    }
    return sum;
  }
  static void add(example::NormalEquations& sum, const Edge& edge, const Vector<3>& error,
                  const Matrix<3>& by_from, const Matrix<3>& by_to) {
    const Matrix<3>& w = edge.information;
    const int i = 3 * edge.from, j = 3 * edge.to;
    sum.add_cost(0.5 * error.dot(w * error));
    sum.add_gradient<3>(i, by_from.transpose() * (w * error));
    sum.add_gradient<3>(j, by_to.transpose() * (w * error));
    sum.add_block<3, 3>(i, i, Matrix<3>(by_from.transpose() * w * by_from));
    sum.add_block<3, 3>(j, j, Matrix<3>(by_to.transpose() * w * by_to));
    if (i > j)
      sum.add_block<3, 3>(i, j, Matrix<3>(by_from.transpose() * w * by_to));
    else
      sum.add_block<3, 3>(j, i, Matrix<3>(by_to.transpose() * w * by_from));
  }

  std::unordered_map<kt_int32s, int> row_;
  std::vector<kt_int32s> ids_;
  Poses poses_;
  std::vector<Edge> edges_;
  IdPoseVector corrections_;
};

/// Lasers are registered for the whole program, by their name.
karto::LaserRangeFinder* laser_of(const cairn::LaserScan& scan, const karto::Name& name) {
  auto* laser = karto::LaserRangeFinder::CreateLaserRangeFinder(karto::LaserRangeFinder_Custom, name);
  laser->SetMaximumRange(scan.farthest);
  laser->SetMinimumAngle(scan.first_angle);
  laser->SetMaximumAngle(scan.angle(scan.size() - 1));
  laser->SetAngularResolution(scan.angle_step);
  laser->SetRangeThreshold(12);
  return laser;
}

}  // namespace

std::optional<RivalPath> open_karto(const cairn::CarmenLog& log) {
  static std::atomic<int> lasers = 0;
  const karto::Name name("laser" + std::to_string(lasers++));
  karto::Dataset owned;  // of all objects that are added
  owned.Add(laser_of(log.scans.front().scan, name));
  GraphSolver solver;
  const auto mapper = std::make_unique<karto::Mapper>();
  mapper->SetScanSolver(&solver);
  RivalPath path;
  std::vector<karto::LocalizedRangeScan*> scans;
  const std::clock_t begin = std::clock();
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    const cairn::StampedScan& from = log.scans[i];
    auto scan = std::make_unique<karto::LocalizedRangeScan>(
        name, std::vector<kt_double>(from.scan.range.begin(), from.scan.range.end()));
    const SE2& pose = from.T_odom_laser;
    scan->SetOdometricPose(karto::Pose2(pose.x(), pose.y(), pose.angle()));
    scan->SetCorrectedPose(scan->GetOdometricPose());
    if (!mapper->Process(scan.get())) continue;
    path.processed.push_back(i);
    scans.push_back(scan.get());
    owned.Add(scan.release());
  }
  path.cpu_seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  for (const auto* scan : scans) path.poses.push_back(pose_of(scan->GetCorrectedPose()));
  return path;
}
#endif

}  // namespace grid_slam_bench
