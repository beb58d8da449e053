// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstddef>
#include <memory>
#include <vector>

#include <Eigen/Geometry>

#ifdef CAIRN_BENCH_PCL
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/registration/transformation_estimation_svd.h>
#endif
#ifdef CAIRN_BENCH_OPENGV
#include <opengv/point_cloud/PointCloudAdapter.hpp>
#include <opengv/point_cloud/methods.hpp>
#include <opengv/sac/Ransac.hpp>
#include <opengv/sac_problems/point_cloud/PointCloudSacProblem.hpp>
#endif

#include <cairn/geometry/triangulation.hpp>

#include "geometry_rivals.hpp"

namespace rivals {

namespace {

using Points = std::span<const cairn::Vector<3>>;

AlignmentRival umeyama(Points source, Points target) {
  const auto columns = [](Points points) {
    cairn::Matrix<3, cairn::dynamic> m(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) m.col(static_cast<Eigen::Index>(i)) = points[i];
    return m;
  };
  return {"Eigen::umeyama", [x = columns(source), y = columns(target)]() -> cairn::Matrix<4> {
            return Eigen::umeyama(x, y, false);
          }};
}

#ifdef CAIRN_BENCH_PCL
AlignmentRival pcl_svd(Points source, Points target) {
  const auto cloud = [](Points points) {
    pcl::PointCloud<pcl::PointXYZ> result;
    for (const cairn::Vector<3>& p : points)
      result.emplace_back(static_cast<float>(p(0)), static_cast<float>(p(1)), static_cast<float>(p(2)));
    return result;
  };
  return {"PCL SVD (of floats)", [x = cloud(source), y = cloud(target)] {
            const pcl::registration::TransformationEstimationSVD<pcl::PointXYZ, pcl::PointXYZ, double> solve;
            Eigen::Matrix4d T;
            solve.estimateRigidTransformation(x, y, T);
            return cairn::Matrix<4>(T);
          }};
}
#endif

#ifdef CAIRN_BENCH_OPENGV
opengv::points_t opengv_points(Points points) {
  return {points.begin(), points.end()};
}

cairn::Matrix<4> square(const opengv::transformation_t& T) {
  cairn::Matrix<4> result = cairn::Matrix<4>::Identity();
  result.topRows<3>() = T;
  return result;
}

/// The adapter refers to the points. Its frame 1 is the target.
struct OpenGvProblem {
  OpenGvProblem(Points target_points, Points source_points)
      : target(opengv_points(target_points)), source(opengv_points(source_points)), adapter(target, source) {}
  opengv::points_t target, source;
  opengv::point_cloud::PointCloudAdapter adapter;
};

AlignmentRival opengv_arun(Points source, Points target) {
  return {"OpenGV Arun", [problem = std::make_shared<OpenGvProblem>(target, source)] {
            return square(opengv::point_cloud::threept_arun(problem->adapter));
          }};
}
#endif

}  // namespace

std::vector<AlignmentRival> alignment_rivals(Points source, Points target) {
  std::vector<AlignmentRival> all{umeyama(source, target)};
#ifdef CAIRN_BENCH_PCL
  all.push_back(pcl_svd(source, target));
#endif
#ifdef CAIRN_BENCH_OPENGV
  all.push_back(opengv_arun(source, target));
#endif
  return all;
}

#ifdef CAIRN_BENCH_OPENGV
std::optional<cairn::SE3> opengv_pose(const cairn::StereoRig& rig,
                                      std::span<const cairn::StereoMatch> matches) {
  namespace problems = opengv::sac_problems::point_cloud;
  opengv::points_t world, camera;
  const cairn::Triangulator triangulator(rig);
  for (const cairn::StereoMatch& match : matches) {
    const cairn::Triangulation seen = triangulator(match.left, match.right);
    if (!seen.good()) continue;
    world.push_back(match.landmark);
    camera.push_back(seen.point);
  }
  opengv::point_cloud::PointCloudAdapter adapter(world, camera);
  opengv::sac::Ransac<problems::PointCloudSacProblem> ransac;
  ransac.sac_model_ = std::make_shared<problems::PointCloudSacProblem>(adapter, false);
  ransac.threshold_ = 0.3;
  ransac.max_iterations_ = 1000;
  if (!ransac.computeModel()) return std::nullopt;
  adapter.sett12(ransac.model_coefficients_.col(3));
  adapter.setR12(ransac.model_coefficients_.leftCols<3>());
  const opengv::transformation_t T = opengv::point_cloud::optimize_nonlinear(adapter, ransac.inliers_);
  return cairn::SE3::from_matrix(square(T));
}
#endif

}  // namespace rivals
