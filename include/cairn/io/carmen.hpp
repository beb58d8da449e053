// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Logs of CARMEN, in which the field's laser data sets are kept: FLASER, ROBOTLASER1, RAWLASER1 and ODOM
/// lines; and those of DP-SLAM, of which a line Odometry and a line Laser are one step.
///
///   FLASER n r_1..r_n  laser x y theta  robot x y theta  time host logger_time
///   ROBOTLASER1 type first_angle field_of_view step farthest accuracy mode  n r_1..r_n  m e_1..e_m
///               laser x y theta  robot x y theta  tv rv forward side turn  time host logger_time
///   RAWLASER1 type first_angle field_of_view step farthest accuracy mode  n r_1..r_n  m e_1..e_m
///               time host logger_time
///   PARAM robot_frontlaser_offset metres
///   ODOM x y theta tv rv acceleration  time host logger_time
///   Odometry x y theta
///   Laser n r_1..r_n
/// (CARMEN robot navigation toolkit, manual, "log file format"; DP-SLAM 0.1.1, OpenSLAM.) Metres, radians,
/// seconds. Other lines (SYNC, comments, ...) are of no concern. The order of the file is the order of
/// events, also where times run back, as in published logs: nothing is sorted.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <cairn/io/text.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/scan/scan.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A scan and where odometry believed the scanner to be. The frame is odometry's.
struct StampedScan {
  double time = 0;  ///< [s], by the clock of the sensor's computer
  SE2 T_odom_laser;
  SE2 T_odom_robot;
  LaserScan scan;
  std::size_t line = 0;  ///< of the file, the first is 1; 0 where there is none
};

/// A pose of the wheels' odometry.
struct StampedOdometry {
  double time = 0;  ///< [s]
  SE2 T_odom_robot;
};

/// Poses of a log lie within so many metres of odometry's origin along either axis: what is composed of them
/// should be numbers.
inline constexpr double farthest_odometry = 1e9;

/// What a log holds of scans and odometry, each in the order of the file.
struct CarmenLog {
  std::vector<StampedScan> scans;
  std::vector<StampedOdometry> odometry;
};

namespace detail {

/// Takes the fields of one line one after the other.
class CarmenFields {
public:
  explicit CarmenFields(const TextLines& lines) : lines_(lines), rest_(trimmed(lines.line())) { take(); }

  std::string_view take() {
    const std::string_view field = next();
    rest_ = trimmed(rest_.substr(field.size()));
    return field;
  }

  double number(const char* what) {
    const std::string_view field = take();
    const std::optional<double> value = parse_number(field);
    if (!value || !std::isfinite(*value)) refuse(what, "a finite number", field);
    return *value;
  }

  double above_zero(const char* what) {
    const std::string_view field = next();
    const double value = number(what);
    if (!(value > 0)) refuse(what, "a number above zero", field);
    return value;
  }

  /// A number of beams, or of what else there may be a few thousand of.
  std::size_t count(const char* what) {
    constexpr std::size_t most = 100000;
    const std::string_view field = take();
    const std::optional<std::size_t> value = parse_number<std::size_t>(field);
    if (!value || *value > most) refuse(what, "a whole number up to 100000", field);
    return *value;
  }

  SE2 pose(const char* what) {
    const double x = metres(what), y = metres(what), theta = number(what);
    return {x, y, theta};
  }

  double metres(const char* what) {
    const std::string_view field = next();
    const double value = number(what);
    if (!(std::abs(value) <= farthest_odometry)) refuse(what, "metres within 1e9", field);
    return value;
  }

  /// The time, after which a line has two fields at most: the host's name and the logger's time. More than
  /// those are of a count of ranges that is not the line's.
  double last_time() {
    const double time = number("the time");
    take();
    take();
    if (!next().empty()) refuse("after the time", "a host's name and the logger's time at most", rest_);
    return time;
  }

  void ranges(std::vector<float>& out, std::size_t count) {
    out.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double value = number("a range");
      out.push_back(static_cast<float>(std::clamp(value, -1e6, 1e6)));
    }
  }

private:
  [[nodiscard]] std::string_view next() const { return rest_.substr(0, rest_.find_first_of(" \t")); }

  [[noreturn]] void refuse(const char* what, const char* expected, std::string_view found) const {
    std::string text(what);
    text.append(": ").append(expected);
    if (found.empty())
      text.append(" (the line ends before it)");
    else
      text.append(" ('").append(found.substr(0, 20)).append("' is none)");
    lines_.fail(text);
  }

  const TextLines& lines_;
  std::string_view rest_;  ///< of the line, no blanks around it
};

/// FLASER says nothing of its angles. Half a turn from -90 deg on: an odd number of beams has both ends, an
/// even one leaves the last out, as SICK's scanners of 180 and 360 readings do.
inline void set_half_turn(LaserScan& scan) {
  const auto n = static_cast<double>(scan.range.size());
  scan.first_angle = -std::numbers::pi / 2;
  scan.angle_step = std::numbers::pi / (scan.range.size() % 2 == 1 ? std::max(1.0, n - 1) : std::max(1.0, n));
}

inline StampedScan front_laser(CarmenFields fields, double farthest) {
  StampedScan s;
  s.scan.farthest = farthest;
  fields.ranges(s.scan.range, fields.count("the number of ranges"));
  set_half_turn(s.scan);
  s.T_odom_laser = fields.pose("the laser's pose");
  s.T_odom_robot = fields.pose("the robot's pose");
  s.time = fields.last_time();
  return s;
}

/// What ROBOTLASER1 and RAWLASER1 begin with.
inline LaserScan described_scan(CarmenFields& fields, double farthest) {
  LaserScan scan;
  fields.number("the type");
  scan.first_angle = fields.number("the first angle");
  const double view = fields.number("the field of view");
  scan.angle_step = fields.number("the angle between beams");
  scan.farthest = std::min(farthest, fields.above_zero("the largest range"));
  fields.number("the accuracy");
  fields.number("the mode");
  fields.ranges(scan.range, fields.count("the number of ranges"));
  // Writers that leave the step out still say what all beams see.
  if (scan.angle_step == 0 && scan.size() > 1) scan.angle_step = view / static_cast<double>(scan.size() - 1);
  for (std::size_t left = fields.count("the number of remissions"); left > 0; --left)
    fields.number("a remission");
  return scan;
}

inline StampedScan robot_laser(CarmenFields fields, double farthest) {
  StampedScan s;
  s.scan = described_scan(fields, farthest);
  s.T_odom_laser = fields.pose("the laser's pose");
  s.T_odom_robot = fields.pose("the robot's pose");
  for (const char* what :
       {"the velocity", "the turn rate", "the forward distance", "the side distance", "the turning axis"})
    fields.number(what);
  s.time = fields.last_time();
  return s;
}

/// The scanner knows of no odometry: the pose is the start of it.
inline StampedScan raw_laser(CarmenFields fields, double farthest, double ahead) {
  StampedScan s;
  s.scan = described_scan(fields, farthest);
  s.T_odom_laser = SE2(ahead, 0, 0);
  s.time = fields.last_time();
  return s;
}

inline StampedOdometry odometry(CarmenFields fields) {
  StampedOdometry o;
  o.T_odom_robot = fields.pose("the robot's pose");
  for (const char* what : {"the velocity", "the turn rate", "the acceleration"}) fields.number(what);
  o.time = fields.last_time();
  return o;
}

/// DP-SLAM's logs have no times: a scan's is its number. The scanner is taken to be where odometry is. Its
/// readings are millimetres in 13 bits, of which those above 8 m say what went wrong instead of how far.
inline StampedScan dp_slam_laser(CarmenFields fields, const TextLines& lines,
                                 const std::optional<StampedOdometry>& at, double farthest) {
  if (!at) lines.fail("a line Odometry before a line Laser");
  StampedScan s;
  s.time = at->time;
  s.T_odom_laser = s.T_odom_robot = at->T_odom_robot;
  s.scan.farthest = std::min(farthest, 8.0);
  fields.ranges(s.scan.range, fields.count("the number of ranges"));
  set_half_turn(s.scan);
  return s;
}

}  // namespace detail

/// The scans and the odometry of a CARMEN log; ranges from `farthest` [m] on are no return. RAWLASER1 lines
/// count where there are no others: their scans all carry the same pose, until place_by_odometry(). Throws
/// Error naming the line, what was expected and what stands there; where there is no scan at all, Error as
/// well.
[[nodiscard]] inline CarmenLog read_carmen(const std::filesystem::path& path, double farthest = 40) {
  if (!(farthest > 0)) raise("read_carmen: expected a largest range above zero");
  TextLines lines(path, "a CARMEN log");
  CarmenLog log;
  std::optional<StampedOdometry> dp_slam;  // what a line Laser goes with
  std::vector<StampedScan> raw;
  double ahead = 0;  // [m] of the scanner before the robot's centre
  while (lines.next()) {
    const std::string_view line = lines.line();
    const std::string_view kind = line.substr(0, line.find_first_of(" \t"));
    if (kind == "FLASER")
      log.scans.push_back(detail::front_laser(detail::CarmenFields(lines), farthest));
    else if (kind == "ROBOTLASER1")
      log.scans.push_back(detail::robot_laser(detail::CarmenFields(lines), farthest));
    else if (kind == "RAWLASER1")
      raw.push_back(detail::raw_laser(detail::CarmenFields(lines), farthest, ahead));
    else if (kind == "PARAM") {
      detail::CarmenFields fields(lines);
      if (fields.take() == "robot_frontlaser_offset") ahead = fields.metres("the laser's offset");
    } else if (kind == "ODOM")
      log.odometry.push_back(detail::odometry(detail::CarmenFields(lines)));
    else if (kind == "Odometry")
      dp_slam = {static_cast<double>(log.scans.size()), detail::CarmenFields(lines).pose("the odometry")};
    else if (kind == "Laser")
      log.scans.push_back(
          detail::dp_slam_laser(detail::CarmenFields(lines), lines, std::exchange(dp_slam, {}), farthest));
    for (std::vector<StampedScan>* scans : {&log.scans, &raw})
      if (!scans->empty() && scans->back().line == 0) scans->back().line = lines.number();
  }
  if (log.scans.empty()) log.scans = std::move(raw);
  if (log.scans.empty())
    raise(path.string() + ": expected lines FLASER, ROBOTLASER1, RAWLASER1 or Laser, found none");
  return log;
}

/// Gives every scan a pose of the odometry, where the scans' own poses are all the same though the ODOM
/// lines move (RAWLASER1, logs of CARMEN without a localisation): the newest one before it by time, moved on
/// between neighbours in proportion. Throws Error where there is neither.
inline void place_by_odometry(CarmenLog& log, const std::string& name) {
  const auto at_start = [](const SE2& pose) { return local(SE2(), pose).isZero(0); };  // as a raw scan's is
  const auto moves = [](const auto& list, auto pose) {
    return std::ranges::any_of(list, [&](const auto& each) {
      return local(pose(list.front()), pose(each)).cwiseAbs().maxCoeff() > 1e-6;
    });
  };
  if (log.scans.empty() || moves(log.scans, [](const auto& s) { return s.T_odom_robot; })) return;
  if (log.scans.size() == 1 && (log.odometry.empty() || !at_start(log.scans[0].T_odom_robot))) return;
  if (log.odometry.empty())
    raise(name + ": expected scans with odometry, found scans that all carry the same pose and no ODOM line");
  if (log.scans.size() > 1 && !moves(log.odometry, [](const auto& o) { return o.T_odom_robot; })) return;
  std::multimap<double, SE2> by_time;  // the log's times may run back; what shares one stays in its order
  for (const StampedOdometry& each : log.odometry)
    by_time.emplace_hint(by_time.end(), each.time, each.T_odom_robot);
  for (StampedScan& scan : log.scans) {
    const auto after = by_time.upper_bound(scan.time);
    const auto before = after == by_time.begin() ? after : std::prev(after);
    SE2 pose = before->second;
    if (after != before && after != by_time.end()) {
      const double share = std::clamp((scan.time - before->first) / (after->first - before->first), 0.0, 1.0);
      pose = retract(pose, Tangent<SE2>(share * local(pose, after->second)));
    }
    scan.T_odom_laser = pose * (scan.T_odom_robot.inverse() * scan.T_odom_laser);
    scan.T_odom_robot = pose;
  }
}

}}  // namespace cairn::CAIRN_ABI
