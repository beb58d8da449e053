// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Trajectories in the three formats that evaluation tools read, strictly.
///
///   TUM    t tx ty tz qx qy qz qw         seconds, metres; '#' starts a comment; fields between blanks
///   KITTI  r11 r12 r13 tx r21 ... tz      rows of the 3x4 camera-to-world matrix (x right, y down, z ahead)
///   EuRoC  ns,px,py,pz,qw,qx,qy,qz,...    nanoseconds; pose of the body (the IMU); '#' starts a comment
///
/// A pose is T_world_body: it maps body coordinates to world coordinates. A reader takes the whole file or
/// throws Error naming file:line, what was expected and what stands there: a missing or empty file, a
/// truncated line, NaN, a quaternion that is not unit, a matrix that is no rotation, times that run
/// backwards. Equal times in neighbouring lines are accepted: published ground truth has them. Quaternions
/// and matrices are normalised on reading; files carry three to nine digits of them.
///
/// Writers refuse what readers would: numbers that are not finite and times that run backwards throw Error
/// naming the pose before anything is written; also in KITTI's format, whose rows are in the order of time.
/// (An empty trajectory is written, and then refused by readers.) Writers are atomic and byte-deterministic;
/// numbers are the shortest that read back to the same bits. Linear time; the file is held in memory once.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Where the body was at a time.
struct StampedPose {
  double time = 0;   ///< [s]
  SE3 T_world_body;  ///< [m]
};

/// Poses in the order of time.
using Trajectory = std::vector<StampedPose>;

/// One pose of a KITTI file as printed: [R t] to the digits of the file, so R is a rotation to those digits
/// only.
using KittiRow = Matrix<3, 4>;

namespace detail {

inline SE3 pose_of_quaternion(const TextLines& lines, const double* position, double w, double x, double y,
                              double z) {
  constexpr double tolerance = 0.01;  // three printed digits leave 0.001
  const double length = std::sqrt(w * w + x * x + y * y + z * z);
  if (std::abs(length - 1.0) > tolerance) lines.fail("a quaternion of length 1, not " + shortest(length));
  return SE3(SO3::from_quaternion(w, x, y, z), Vector<3>(position[0], position[1], position[2]));
}

inline void append_in_order(const TextLines& lines, Trajectory& trajectory, double time, const SE3& pose) {
  if (!trajectory.empty() && time < trajectory.back().time) lines.fail("times that do not run backwards");
  trajectory.push_back({time, pose});
}

inline void expect_some(const TextLines& lines, const Trajectory& trajectory, const char* what) {
  if (trajectory.empty()) lines.fail(std::string("at least one line of ") + what);
}

/// Calls use(lines, row) on every line of a KITTI pose file.
template <class Use>
void for_each_kitti_row(const std::filesystem::path& path, Use&& use) {
  constexpr const char* expected = "12 numbers: the rows of a 3x4 pose";
  TextLines lines(path, "a KITTI pose file");
  double n[12];
  bool any = false;
  for (; lines.next('\0'); any = true) {
    if (lines.numbers(' ', n, 12) != 12) lines.fail(expected);
    const KittiRow row = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(n);
    use(lines, row);
  }
  if (!any) lines.fail(std::string("at least one line of ") + expected);
}

/// Throws Error naming the file and the first pose that no file should hold.
inline void expect_writable(const std::filesystem::path& path, const Trajectory& trajectory) {
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const auto refuse = [&](const std::string& why) {
      raise(path.string() + ": not written, pose " + std::to_string(i) + " of " +
            std::to_string(trajectory.size()) + " has " + why);
    };
    const StampedPose& pose = trajectory[i];
    const Vector<3>& t = pose.T_world_body.translation();
    const SO3& q = pose.T_world_body.rotation();
    if (!std::isfinite(pose.time)) refuse("a time that is not finite");
    for (const double number : {t(0), t(1), t(2), q.w(), q.x(), q.y(), q.z()})
      if (!std::isfinite(number)) refuse("a number that is not finite");
    if (i > 0 && pose.time < trajectory[i - 1].time) refuse("an earlier time than the one before");
  }
}

inline void append_numbers(std::string& text, const double* numbers, std::size_t count, char separator) {
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0) text += separator;
    append_number(text, numbers[i]);
  }
}

}  // namespace detail

/// Reads a TUM file. Throws Error.
[[nodiscard]] inline Trajectory read_tum(const std::filesystem::path& path) {
  TextLines lines(path, "a TUM trajectory");
  Trajectory trajectory;
  double n[8];
  while (lines.next()) {
    if (lines.numbers(' ', n, 8) != 8) lines.fail("8 numbers: t tx ty tz qx qy qz qw");
    detail::append_in_order(lines, trajectory, n[0],
                            detail::pose_of_quaternion(lines, n + 1, n[7], n[4], n[5], n[6]));
  }
  detail::expect_some(lines, trajectory, "8 numbers: t tx ty tz qx qy qz qw");
  return trajectory;
}

/// Reads a KITTI pose file, which has no times: the time of a pose is its row number 0, 1, 2... Throws Error.
[[nodiscard]] inline Trajectory read_kitti(const std::filesystem::path& path) {
  Trajectory trajectory;
  detail::for_each_kitti_row(path, [&](const TextLines& lines, const KittiRow& row) {
    Matrix<4> pose = Matrix<4>::Identity();
    pose.topRows<3>() = row;
    try {
      trajectory.push_back({static_cast<double>(trajectory.size()), SE3::from_matrix(pose)});
    } catch (const Error& error) {
      lines.fail(std::string("a rotation in columns 1-3, 5-7, 9-11 (") + error.what() + ")");
    }
  });
  return trajectory;
}

/// Reads a KITTI pose file digit by digit, without asking whether the left 3x3 parts are rotations: for
/// figures that must equal those computed from the printed matrices (kitti_error). Throws Error.
[[nodiscard]] inline std::vector<KittiRow> read_kitti_rows(const std::filesystem::path& path) {
  std::vector<KittiRow> rows;
  detail::for_each_kitti_row(path, [&](const TextLines&, const KittiRow& row) { rows.push_back(row); });
  return rows;
}

/// Reads a KITTI pose file with its times.txt (one number of seconds a line, as many lines as poses). Throws
/// Error.
[[nodiscard]] inline Trajectory read_kitti(const std::filesystem::path& poses,
                                           const std::filesystem::path& times) {
  Trajectory trajectory = read_kitti(poses);
  TextLines lines(times, "a KITTI times file");
  double previous = 0;
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    double& time = trajectory[i].time;
    if (!lines.next('\0') || lines.numbers(' ', &time, 1) != 1)
      lines.fail("one time for each of the " + std::to_string(trajectory.size()) + " poses");
    if (i > 0 && time < previous) lines.fail("times that do not run backwards");
    previous = time;
  }
  if (lines.next('\0'))
    lines.fail("no more than " + std::to_string(trajectory.size()) + " times, one a pose");
  return trajectory;
}

/// Reads a EuRoC ground truth or estimate: the first 8 columns; further ones (velocity, biases) are passed
/// over but must be as many in every line. Poses are of the body as the file has them: multiply by T_BS on
/// the right (moved_frame) to compare with a camera. Throws Error.
[[nodiscard]] inline Trajectory read_euroc(const std::filesystem::path& path) {
  TextLines lines(path, "a EuRoC trajectory");
  Trajectory trajectory;
  std::size_t columns = 0;
  double n[8];
  while (lines.next()) {
    const std::size_t fields = lines.numbers(',', n, 8);
    if (fields < 8) lines.fail("at least 8 numbers: ns,px,py,pz,qw,qx,qy,qz");
    if (columns != 0 && fields != columns) lines.fail(std::to_string(columns) + " columns as above");
    columns = fields;
    // A double holds 53 bits of the 61 that nanoseconds since 1970 need: up to 250 ns are lost either way.
    detail::append_in_order(lines, trajectory, n[0] / 1e9,
                            detail::pose_of_quaternion(lines, n + 1, n[4], n[5], n[6], n[7]));
  }
  detail::expect_some(lines, trajectory, "8 or more numbers: ns,px,py,pz,qw,qx,qy,qz");
  return trajectory;
}

/// The same motion seen at another place of the body: every pose becomes T_world_body * T_body_sensor (EuRoC
/// calls T_body_sensor T_BS).
[[nodiscard]] inline Trajectory moved_frame(Trajectory trajectory, const SE3& T_body_sensor) {
  for (StampedPose& pose : trajectory) pose.T_world_body = pose.T_world_body * T_body_sensor;
  return trajectory;
}

/// Writes a TUM file, completely or not at all. Throws Error.
inline void write_tum(const std::filesystem::path& path, const Trajectory& trajectory) {
  detail::expect_writable(path, trajectory);
  std::string text;
  for (const StampedPose& pose : trajectory) {
    const Vector<3>& t = pose.T_world_body.translation();
    const SO3& q = pose.T_world_body.rotation();
    const double numbers[] = {pose.time, t(0), t(1), t(2), q.x(), q.y(), q.z(), q.w()};
    detail::append_numbers(text, numbers, 8, ' ');
    text += '\n';
  }
  write_file_atomically(path, text);
}

/// Writes a KITTI pose file, completely or not at all; the format has no times. Throws Error.
inline void write_kitti(const std::filesystem::path& path, const Trajectory& trajectory) {
  detail::expect_writable(path, trajectory);
  std::string text;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = pose.T_world_body.matrix();
    detail::append_numbers(text, rows.data(), 12, ' ');
    text += '\n';
  }
  write_file_atomically(path, text);
}

/// Writes the first 8 columns of a EuRoC file, completely or not at all. Times are rounded to the nearest
/// nanosecond; those of more than 292 years before or after their origin do not fit and throw Error, as all
/// that expect_writable refuses.
inline void write_euroc(const std::filesystem::path& path, const Trajectory& trajectory) {
  detail::expect_writable(path, trajectory);
  for (const StampedPose& pose : trajectory)
    if (std::abs(pose.time) >= 9.2e9)
      raise(path.string() + ": not written, a time of " + shortest(pose.time) +
            " s is no number of nanoseconds");
  std::string text = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z\n";
  for (const StampedPose& pose : trajectory) {
    const Vector<3>& t = pose.T_world_body.translation();
    const SO3& q = pose.T_world_body.rotation();
    const double numbers[] = {t(0), t(1), t(2), q.w(), q.x(), q.y(), q.z()};
    append_number(text, static_cast<std::int64_t>(std::llround(pose.time * 1e9)));
    text += ',';
    detail::append_numbers(text, numbers, 7, ',');
    text += '\n';
  }
  write_file_atomically(path, text);
}

}}  // namespace cairn::CAIRN_ABI
