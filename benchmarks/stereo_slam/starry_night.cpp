// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "starry_night.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/io/text.hpp>

#ifdef EXAMPLES_HAVE_ZLIB
#include <cstdint>
#include <iostream>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/eval/consistency.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/geometry/alignment.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/slam/keyframe_map.hpp>

#include "support/data.hpp"
#include "support/mat_file.hpp"
#include "support/shape_nees.hpp"
#endif

namespace stereo_slam_bench {
namespace {

/// Errors against the truth, root mean square over the frames.
struct PathErrors {
  double position = 0;  ///< [m]
  double angle = 0;     ///< [rad]
};

/// What is wrong with the truth of a pose, as the dots tell.
struct TruthErrors {
  /// About zero, of a right step of the camera, translation then rotation: no less than it is, for the noise
  /// of the poses it is found by is in it.
  cairn::Matrix<6> covariance = cairn::Matrix<6>::Zero();
  std::size_t images = 0;  ///< by how many
};

struct Outcome {
  PathErrors estimate, dead_reckoning;
  double pose_nees = 0;      ///< mean over all frames, of 6
  double located_nees = 0;   ///< over those that were located
  double landmark_nees = 0;  ///< mean over the dots at the end, of 3: each alone
  double map_nees = 0;       ///< of all dots at the end together, over their number, of 3
  double shape_nees = 0;     ///< of that what is left wherever the first camera was, a number, of 1
  double landmark_rmse = 0;  ///< [m]
  std::size_t landmarks = 0, frames = 0, located = 0, keyframes = 0, first = 0;
};

struct Results {
  Outcome by_images;  ///< with the noise that the images show, against a truth that errs as it was seen to
  Outcome stated;     ///< with the noise that the record states, against a truth without an error
  TruthErrors truth;
  double sigma = 0;             ///< of the images [pixels]
  cairn::RunningMoments shape;  ///< of records simulated with the images' noise
};

#ifdef EXAMPLES_HAVE_ZLIB

using cairn::Matrix;
using cairn::SE3;
using cairn::Vector;

constexpr std::size_t steps = 1900, dots = 20, enough_for_a_pose = 3;

template <int N>
Vector<N> column(const example::MatArray& a, std::size_t k) {
  Vector<N> v;
  for (int i = 0; i < N; ++i) v(i) = a(static_cast<std::size_t>(i), k);
  return v;
}

/// The record, as a camera sees it: all poses and motions are the left camera's.
class Record {
public:
  explicit Record(example::MatFile arrays) : arrays_(std::move(arrays)) {
    Matrix<3> R_vehicle_camera;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        R_vehicle_camera(j, i) = of("C_c_v")(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
    T_vehicle_camera_ = {cairn::SO3::from_matrix(R_vehicle_camera), column<3>(of("rho_v_c_v"), 0)};
    cairn::PinholeParameters p;
    p.fx = of("fu").numbers[0];
    p.fy = of("fv").numbers[0];
    p.cx = of("cu").numbers[0];
    p.cy = of("cv").numbers[0];
    rig.left = rig.right = cairn::PinholeCamera(p);
    rig.T_left_right = {{}, {of("b").numbers[0], 0, 0}};
    double heights_apart = 0, count = 0;
    for (std::size_t k = 0; k < steps; ++k) {
      for (std::uint32_t dot = 0; dot < dots; ++dot) {
        const double* const y = &of("y_k_j").numbers[4 * (steps * dot + k)];
        if (y[0] < 0) continue;
        sightings_[k].push_back({dot, {y[0], y[1]}, {y[2], y[3]}, 1});
        heights_apart += (y[1] - y[3]) * (y[1] - y[3]);
        count += 1;
      }
      velocities_[k] << column<3>(of("v_vk_vk_i"), k), column<3>(of("w_vk_vk_i"), k);
    }
    images_sigma_ = std::sqrt(0.5 * heights_apart / count);
    assume(stated_sigma());
  }

  /// The noise that the record states. It is no pixel noise: held against the truth it is the same in both
  /// images (correlation 0.86 along u, 0.99 along v) and for all dots of a frame, as errors of the true pose
  /// would be; disparities vary by 11 square pixels, not by the 170 that follow from it. So poses, which are
  /// held against that truth, are as uncertain as it says, and dots are known better. [pixels]
  [[nodiscard]] double stated_sigma() const { return std::sqrt(column<4>(of("y_var"), 0).mean()); }
  /// The noise that the images show without any truth or map: a dot is equally high in both. [pixels]
  [[nodiscard]] double images_sigma() const { return images_sigma_; }

  /// How far the true poses are from those that the dots give, whose places were surveyed: by every image
  /// that shows four of them, one more than a pose needs. No map is asked.
  [[nodiscard]] TruthErrors errors_of_truth() const {
    constexpr std::size_t least = enough_for_a_pose + 1;
    const cairn::StereoPoseOptions options{.min_inliers = least};
    TruthErrors errors;
    for (std::size_t k = 0; k < steps; ++k) {
      if (sightings_[k].size() < least) continue;
      std::vector<cairn::StereoMatch> matches;
      for (const cairn::StereoSighting& s : sightings_[k])
        matches.push_back(
            {true_dot(s.landmark), Matrix<3>::Zero(), s.left, s.right, images_sigma_, images_sigma_});
      const cairn::StereoPose pose = cairn::refine_stereo_pose(rig, matches, truth(k), options);
      if (!pose.good()) continue;
      const Vector<6> error = cairn::local(pose.T_world_camera, truth(k));
      errors.covariance += error * error.transpose();
      ++errors.images;
    }
    errors.covariance /= static_cast<double>(std::max<std::size_t>(errors.images, 1));
    return errors;
  }

  /// From now on that is taken for the noise of a pixel.
  void assume(double sigma) {
    for (std::vector<cairn::StereoSighting>& seen : sightings_)
      for (cairn::StereoSighting& s : seen) s.sigma = sigma;
  }

  /// The same way past the same dots, with readings that err independently and by as much as is assumed.
  [[nodiscard]] Record simulated(std::uint64_t seed) const {
    Record result = *this;
    cairn::Random random(seed);
    const SE3 T_camera_vehicle = T_vehicle_camera_.inverse();
    for (std::size_t k = 0; k < steps; ++k) {
      const SE3 T_camera_world = truth(k).inverse();
      std::erase_if(result.sightings_[k], [&](cairn::StereoSighting& s) {
        const auto y = rig.project(T_camera_world * true_dot(s.landmark));
        if (!y) return true;  // the true pose looks away from what was seen
        for (int i = 0; i < 2; ++i) {
          s.left(i) = random.normal((*y)(i), s.sigma);
          s.right(i) = random.normal((*y)(i + 2), s.sigma);
        }
        return false;
      });
      if (k + 1 == steps) break;
      const double dt = seconds(k + 1);
      const Vector<6> step = (T_vehicle_camera_ * truth(k).inverse() * truth(k + 1) * T_camera_vehicle).log();
      const Vector<6> Q = variance_of_step(dt);
      for (int i = 0; i < 6; ++i) result.velocities_[k](i) = random.normal(step(i), std::sqrt(Q(i))) / dt;
    }
    return result;
  }

  /// What the image of step k shows.
  [[nodiscard]] const std::vector<cairn::StereoSighting>& sightings(std::size_t k) const {
    return sightings_[k];
  }
  [[nodiscard]] SE3 truth(std::size_t k) const {
    const SE3 T_world_vehicle(cairn::SO3::exp(column<3>(of("theta_vk_i"), k)), column<3>(of("r_i_vk_i"), k));
    return T_world_vehicle * T_vehicle_camera_;
  }
  [[nodiscard]] Vector<3> true_dot(std::size_t dot) const { return column<3>(of("rho_i_pj_i"), dot); }

  /// Motion from step k - 1 to step k by the velocities measured, and its covariance, of a right step.
  [[nodiscard]] SE3 motion(std::size_t k, Matrix<6>& covariance) const {
    const double dt = seconds(k);
    const Vector<6> Q = variance_of_step(dt);
    const Matrix<6> J = T_vehicle_camera_.inverse().adjoint();
    covariance = J * Q.asDiagonal() * J.transpose();
    return T_vehicle_camera_.inverse() * SE3::exp(Vector<6>(dt * velocities_[k - 1])) * T_vehicle_camera_;
  }

  cairn::StereoRig rig;

private:
  /// From step k - 1 to step k.
  [[nodiscard]] double seconds(std::size_t k) const { return of("t").numbers[k] - of("t").numbers[k - 1]; }
  /// Velocities are held until the next reading, in which time a hand changes them by about 1 m/s^2 and
  /// 4 rad/s^2.
  [[nodiscard]] Vector<6> variance_of_step(double dt) const {
    Vector<6> variance, acceleration;
    variance << column<3>(of("v_var"), 0), column<3>(of("w_var"), 0);
    acceleration << Vector<3>::Constant(1.0), Vector<3>::Constant(4.0);
    return dt * dt * variance + (0.5 * dt * dt * acceleration).cwiseAbs2();
  }
  [[nodiscard]] const example::MatArray& of(const std::string& name) const { return arrays_[name]; }

  example::MatFile arrays_;
  SE3 T_vehicle_camera_;
  double images_sigma_ = 0;
  std::vector<std::vector<cairn::StereoSighting>> sightings_{steps};
  std::vector<Vector<6>> velocities_{steps};
};

/// Where an image was taken: near `guess`, or near where the known dots in it put it. Nothing where that is
/// not determined.
std::optional<cairn::MapLocation> locate(cairn::KeyframeMap& map, const SE3& guess,
                                         const std::vector<cairn::StereoSighting>& seen) {
  const cairn::Triangulator triangulate(map.rig());
  std::vector<Vector<3>> here, there;
  for (const cairn::StereoSighting& s : seen) {
    const auto dot = map.landmark(s.landmark);
    const cairn::Triangulation point = triangulate(s.left, s.right, s.sigma, s.sigma);
    if (!dot || !point.good()) continue;
    here.push_back(point.point);
    there.push_back(dot->mean);
  }
  if (here.size() < enough_for_a_pose) return std::nullopt;
  cairn::MapLocation best = map.locate(guess, seen);
  if (!best.good() || 2 * best.inlier_count <= here.size())
    if (const cairn::Alignment aligned = cairn::align_points(here, there); aligned.good()) {
      const cairn::MapLocation other = map.locate(aligned.T_target_source, seen);
      if (other.good() && (!best.good() || other.inlier_count > best.inlier_count)) best = other;
    }
  if (!best.good()) return std::nullopt;
  return best;
}

/// One dot of the map in both images, as a measurement of the camera's pose. [pixels]
struct DotView {
  using State = SE3;
  using Measurement = Vector<4>;

  const cairn::StereoRig* rig;
  cairn::Gaussian<Vector<3>> dot;  // in the world
  double sigma;

  [[nodiscard]] Vector<4> predict(const SE3& T_world_camera) const {
    // Where it is behind the camera, so far out of the image that no gate lets it through.
    return rig->project(T_world_camera.inverse() * dot.mean).value_or(Vector<4>::Constant(1e6));
  }
  [[nodiscard]] Matrix<4> noise(const SE3& T_world_camera) const {
    Matrix<4> R = sigma * sigma * Matrix<4>::Identity();
    const SE3 T_camera_world = T_world_camera.inverse();
    if (const auto seen = rig->project_with_jacobian(T_camera_world * dot.mean)) {
      const Matrix<4, 3> J = seen->J_point * T_camera_world.rotation().matrix();
      R += J * dot.covariance * J.transpose();
    }
    return R;
  }
};

/// What one or two dots say of a pose that they do not determine. After seconds without a dot the attitude is
/// known to some tenths of a radian, and a dot to a pixel: one linearisation at the prediction would be far
/// off.
void correct(cairn::Gaussian<SE3>& camera, cairn::KeyframeMap& map,
             const std::vector<cairn::StereoSighting>& seen) {
  const cairn::Extended filter{.gate = cairn::chi_square_quantile(0.9999, 4), .iterations = 20};
  for (const cairn::StereoSighting& s : seen) {
    const auto dot = map.landmark_in_world(s.landmark);
    if (!dot) continue;
    const DotView view{&map.rig(), *dot, s.sigma};
    const Vector<4> pixels = (Vector<4>() << s.left, s.right).finished();
    static_cast<void>(filter.update(camera, cairn::numeric(view), pixels));  // refused: it stays
  }
}

class Errors {
public:
  void add(const Vector<6>& error) {
    position_.add(error.head<3>().squaredNorm());
    angle_.add(error.tail<3>().squaredNorm());
  }
  [[nodiscard]] PathErrors rmse() const { return {std::sqrt(position_.mean()), std::sqrt(angle_.mean())}; }

private:
  cairn::RunningMoments position_, angle_;
};

/// Maps the dots of the record and follows the camera among them. What is believed is held against the truth
/// of the pose and of the first, which says where the world is: both err, independently of each other here,
/// by what is given.
Outcome map_and_follow(const Record& record, const TruthErrors& of_truth = {}) {
  Outcome outcome;
  while (record.sightings(outcome.first).size() < enough_for_a_pose) ++outcome.first;
  cairn::KeyframeMapOptions options;
  options.min_matches = enough_for_a_pose;
  cairn::KeyframeMap map(record.rig, options);
  const auto add_new = [&](const std::vector<cairn::StereoSighting>& seen) {
    for (const cairn::StereoSighting& s : seen)
      if (!map.contains(s.landmark)) map.add_landmark(s);
  };
  map.begin(SE3());
  add_new(record.sightings(outcome.first));

  const SE3 T_camera_truth = record.truth(outcome.first).inverse();
  SE3 T, reckoned;  // the first camera is the world
  Matrix<6> P = Matrix<6>::Zero(), claimed;
  double best_share = 0;
  Errors estimate, dead_reckoning;
  cairn::RunningMoments nees, located_nees;
  for (std::size_t k = outcome.first + 1; k < steps; ++k) {
    Matrix<6> Q;
    const SE3 motion = record.motion(k, Q);
    reckoned = reckoned * motion;
    T = T * motion;
    const Matrix<6> F = motion.inverse().adjoint();
    P = F * P * F.transpose() + Q;
    const std::vector<cairn::StereoSighting> seen = record.sightings(k);
    const auto here = locate(map, T, seen);
    if (here) {
      ++outcome.located;
      T = here->T_world_camera;
      P = claimed = here->covariance;
      // Keyframes by the rule of the pipeline (examples/stereo_slam/pipeline.hpp)
      constexpr double keyframe_share = 0.8;
      const double share = static_cast<double>(here->inlier_count) / static_cast<double>(seen.size());
      best_share = std::max(best_share, share);
      if (share < keyframe_share * best_share && map.add_keyframe(*here, seen)) {
        add_new(seen);
        best_share = 0;
      }
    } else {
      // The pose goes on from there, but its covariance as if it had not been: the errors of a dot are the
      // same from image to image, and would be counted again in every one.
      cairn::Gaussian<SE3> camera{T, P};
      correct(camera, map, seen);
      T = camera.mean;
      claimed = camera.covariance;
    }
    const SE3 truth = T_camera_truth * record.truth(k);
    const Vector<6> error = cairn::local(T, truth);
    estimate.add(error);
    dead_reckoning.add(cairn::local(reckoned, truth));
    const Matrix<6> at_camera = truth.inverse().adjoint();
    const Matrix<6> due =
        claimed + of_truth.covariance + at_camera * of_truth.covariance * at_camera.transpose();
    if (const auto one = cairn::normalised_squared(error, cairn::symmetrised(due))) {
      nees.add(*one);
      if (here) located_nees.add(*one);
    }
    ++outcome.frames;
  }
  outcome.estimate = estimate.rmse();
  outcome.dead_reckoning = dead_reckoning.rmse();
  outcome.pose_nees = nees.mean();
  outcome.located_nees = located_nees.mean();
  outcome.keyframes = map.keyframe_count();
  cairn::RunningMoments squared, dot_nees;
  std::vector<std::uint32_t> known_dots = map.landmark_ids();
  std::erase_if(known_dots, [&](std::uint32_t dot) { return !map.landmark_in_world(dot); });
  outcome.landmarks = known_dots.size();
  if (const auto together = map.landmarks_in_world(known_dots)) {
    const Matrix<cairn::dynamic, 6> G = cairn_bench::moved_with_world(together->mean, Vector<3>::Zero());
    const Matrix<cairn::dynamic> due = cairn::symmetrised(
        Matrix<cairn::dynamic>(together->covariance + G * of_truth.covariance * G.transpose()));
    Vector<cairn::dynamic> error(together->mean.size());
    Eigen::Index at = 0;
    for (const std::uint32_t dot : known_dots) {
      const Vector<3> one = T_camera_truth * record.true_dot(dot) - together->mean.segment<3>(at);
      squared.add(one.squaredNorm());
      if (const auto nees_of_one = cairn::normalised_squared(one, Matrix<3>(due.block<3, 3>(at, at))))
        dot_nees.add(*nees_of_one);
      error.segment<3>(at) = one;
      at += 3;
    }
    if (const auto all = cairn::normalised_squared(error, due))
      outcome.map_nees = *all / static_cast<double>(known_dots.size());
    if (const auto apart = cairn_bench::shape_nees(together->mean, error, together->covariance))
      outcome.shape_nees = apart->shape / static_cast<double>(error.size() - 6);
  }
  outcome.landmark_rmse = std::sqrt(squared.mean());
  outcome.landmark_nees = dot_nees.mean();
  return outcome;
}

std::optional<Results> run() {
  const auto path = cairn_test::real_data("starry_night_stereo/dataset3.mat");
  if (!path) return std::nullopt;
  std::cout << "running starry_night_stereo" << std::endl;
  Record record{example::MatFile(*path)};
  Results results;
  results.stated = map_and_follow(record);
  results.truth = record.errors_of_truth();
  results.sigma = record.images_sigma();
  record.assume(results.sigma);
  results.by_images = map_and_follow(record, results.truth);
  // A NEES is what it should be where its mean over these is, and of one record no further off than they are.
  constexpr std::uint64_t runs = 40;
  for (std::uint64_t seed = 1; seed <= runs; ++seed)
    results.shape.add(map_and_follow(record.simulated(seed)).shape_nees);
  return results;
}

#else

std::optional<Results> run() {
  return std::nullopt;
}

#endif

}  // namespace

void add_starry_night_rows(cairn_bench::Scoreboard& board) {
  const std::optional<Results> results = run();
  const auto add = [&](cairn_bench::Row row, double measured) {
    row.name = "starry_night_stereo, whole record: " + row.name;
    if (results)
      row.measured = measured;
    else
      row.note = "no data";
    board.add(std::move(row));
  };
  const auto text = [](double value) { return cairn::shortest(std::round(1e3 * value) / 1e3); };
  const auto off = [](double nees, double due) { return std::max(nees / due, due / nees); };
  const Outcome none, &seen = results ? results->by_images : none, &stated = results ? results->stated : none;
  const TruthErrors truth = results ? results->truth : TruthErrors{};
  const cairn::RunningMoments shape = results ? results->shape : cairn::RunningMoments{};
  const auto pose_note = [&](const Outcome& o) {
    return text(o.pose_nees) + " of 6, " + text(o.located_nees) + " where located; " +
           std::to_string(o.keyframes) + " keyframes";
  };
  const auto dots_note = [&](const Outcome& o) {
    return text(o.landmark_nees) + " of 3 each alone, " + text(o.map_nees) + " of 3 a dot all together; " +
           std::to_string(o.landmarks) + " of 20 mapped, RMSE " + text(o.landmark_rmse) + " m";
  };
  const auto path_note = [&](const Outcome& o) {
    return text(o.estimate.position) + " for " + text(o.dead_reckoning.position) + " m RMSE, " +
           text(o.estimate.angle) + " for " + text(o.dead_reckoning.angle) + " rad";
  };
  const std::string as_stated = ", with the pixel noise that the record states and a truth that does not err";

  add({.name = "position better than dead reckoning",
       .unit = "times",
       .must = 5,
       .better = cairn_bench::larger,
       .note = path_note(seen) + " from step " + std::to_string(seen.first + 1) + ", " +
               std::to_string(seen.located) + " of " + std::to_string(seen.frames) +
               " frames located; sigma " + text(results ? results->sigma : 0) +
               " pixels by the heights in both images"},
      seen.dead_reckoning.position / seen.estimate.position);
  add({.name = "attitude better than dead reckoning",
       .unit = "times",
       .must = 5,
       .better = cairn_bench::larger},
      seen.dead_reckoning.angle / seen.estimate.angle);
  const cairn::Vector<6> sigmas = truth.covariance.diagonal().cwiseSqrt();
  add({.name = "NEES of the pose, off 6 either way",
       .unit = "times",
       .must = 2,
       .note = pose_note(seen) + "; the truth errs by " + text(sigmas.head<3>().norm()) + " m and " +
               text(sigmas.tail<3>().norm()) + " rad, by its surveyed dots in " +
               std::to_string(truth.images) + " images"},
      off(seen.pose_nees, 6));
  add({.name = "NEES of the landmarks, off 3 either way",
       .unit = "times",
       .must = 2,
       .note = dots_note(seen)},
      off(seen.landmark_nees, 3));
  add({.name = "NEES of the dots' shape, wherever the first camera was, off 1 either way",
       .unit = "times",
       .must = 2,
       .note = text(seen.shape_nees) + " of 1 a number; " + std::to_string(shape.count()) +
               " records simulated with that noise: " + text(shape.mean()) + " (" + text(shape.smallest()) +
               " to " + text(shape.largest()) + ")"},
      off(seen.shape_nees, 1));
  add({.name = "NEES of the pose" + as_stated,
       .unit = "of 6",
       .note = path_note(stated) + "; " + pose_note(stated)},
      stated.pose_nees);
  add({.name = "NEES of the landmarks" + as_stated, .unit = "of 3", .note = dots_note(stated)},
      stated.landmark_nees);
}

}  // namespace stereo_slam_bench
