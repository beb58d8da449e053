// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <numeric>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/io/text.hpp>
#include <cairn/models/motion.hpp>

#include "landmark_log.hpp"
#include "wheel_errors.hpp"

namespace fastslam {

namespace {

using cairn::SE2;
using cairn::Vector;

constexpr std::size_t most_columns = 5;
using Row = std::vector<double>;

/// What a file's first columns are: times, the numbers of subjects or bar codes (whole, below 2^24), any
/// other numbers, or distances, which are above zero.
enum class Column { time, identity, number, distance, speed };

/// Puts rows in the order of their times, those of one time as they stood. Returns how many were before an
/// earlier one: the ninth set's odometry begins with a line that is a tenth of a second late.
std::size_t put_in_order(std::vector<Row>& rows) {
  std::size_t late = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) late += rows[i][0] < rows[i - 1][0];
  if (late == 0) return 0;
  std::vector<std::size_t> order(rows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) { return std::pair(rows[i][0], i); });
  std::vector<Row> sorted;
  for (const std::size_t i : order) sorted.push_back(std::move(rows[i]));
  rows = std::move(sorted);
  return late;
}

/// Rows of the first numbers of each line.
std::vector<Row> read_rows(const std::filesystem::path& path, std::initializer_list<Column> columns) {
  cairn::TextLines lines(path, "a file of the UTIAS set");
  std::vector<Row> rows;
  constexpr double fastest = 1000;  // no robot is, and motions remain finite
  while (lines.next('#')) {
    double numbers[most_columns];
    if (lines.numbers(' ', numbers, columns.size()) < columns.size())
      lines.fail(std::to_string(columns.size()) + " numbers");
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const double n = numbers[i];
      const Column kind = columns.begin()[i];
      if (kind == Column::identity && !(n >= 0 && n < Map::most_identity && n == std::floor(n)))
        lines.fail("a whole number from 0 to below 2^24 in column " + std::to_string(i + 1));
      if (kind == Column::distance && !(n > 0)) lines.fail("a distance above zero");
      if (kind == Column::speed && !(std::abs(n) <= fastest))
        lines.fail("a speed of at most " + cairn::shortest(fastest) + " m/s or rad/s in column " +
                   std::to_string(i + 1));
    }
    rows.emplace_back(numbers, numbers + columns.size());
  }
  return rows;
}

/// Of one robot's files and those of its set.
struct Files {
  using enum Column;
  std::vector<std::string> notes;
  std::vector<WheelSpeeds> odometry;
  std::vector<CodeSighting> sightings;
  std::vector<Row> truth;
  std::map<int, std::uint32_t> subject_of;  // by bar code
  std::map<std::uint32_t, Vector<2>> landmarks;

  Files(const std::filesystem::path& folder, const std::string& robot) {
    for (const Row& r : read_timed(folder / (robot + "_Odometry.dat"), {time, speed, speed}))
      odometry.push_back({r[0], r[1], r[2]});
    for (const Row& r : read_timed(folder / (robot + "_Measurement.dat"), {time, identity, distance, number}))
      sightings.push_back({r[0], static_cast<int>(r[1]), r[2], r[3]});
    const std::filesystem::path watched = folder / (robot + "_Groundtruth.dat");
    if (std::filesystem::exists(watched))
      truth = read_timed(watched, {time, number, number, number});
    else
      notes.push_back("no " + watched.filename().string() + ": nobody knows how wrong the path is");
    for (const Row& r : read_rows(folder / "Barcodes.dat", {identity, identity}))
      subject_of[static_cast<int>(r[1])] = static_cast<std::uint32_t>(r[0]);
    for (const Row& r : read_rows(folder / "Landmark_Groundtruth.dat", {identity, number, number}))
      landmarks[static_cast<std::uint32_t>(r[0])] = Vector<2>(r[1], r[2]);
  }

private:
  std::vector<Row> read_timed(const std::filesystem::path& path, std::initializer_list<Column> columns) {
    std::vector<Row> rows = read_rows(path, columns);
    if (const std::size_t late = put_in_order(rows); late > 0)
      notes.push_back(path.filename().string() + ": the time goes back " + std::to_string(late) +
                      (late == 1 ? " time" : " times") + ", lines are taken in its order");
    return rows;
  }
};

/// Odometry turned into motions between frames.
class Wheels {
public:
  Wheels(LandmarkLog& log, std::filesystem::path file, double begin)
      : log_(log), file_(std::move(file)), time_(begin) {
    reset();
  }

  void move(double to) {
    if (to <= time_) return;
    const cairn::Status status = cairn::Extended{}.predict(moved_, process_, to - time_, control_);
    if (status != cairn::Status::accepted)
      cairn::raise(file_.string() + ": the motion until " + cairn::shortest(to) + " s: " + explain(status));
    time_ = to;
  }
  void steer(const WheelSpeeds& odometry) {
    control_ = Vector<2>(odometry.speed, odometry.turn);
    process_.turn_density =
        turn_density + (is_on_the_spot(odometry) ? on_the_spot * std::abs(odometry.turn) : 0);
  }
  void between() {
    if (!log_.frames.empty()) log_.between.push_back({time_, log_.frames.size() - 1, moved_.mean});
  }
  Frame& frame() {
    log_.frames.push_back({time_, moved_, {}});
    reset();
    return log_.frames.back();
  }
  [[nodiscard]] double time() const { return time_; }

private:
  // Against the truth, distance over 5 s errs by 0.04 m and the turn by 0.08 to 0.11 rad: as white noise,
  // densities of 3e-4 and 2e-3. Errors that last want a little more than that. A turn on the spot, where
  // wheels slip, adds 0.026 (over 1 s) to 0.066 (over 10 s) rad^2 for each radian.
  static constexpr double turn_density = 3e-3, on_the_spot = 0.02;

  void reset() { moved_ = {SE2(), cairn::Matrix<3>::Zero()}; }

  LandmarkLog& log_;
  std::filesystem::path file_;  // for messages
  double time_;
  Vector<2> control_ = Vector<2>::Zero();
  cairn::Unicycle process_{.speed_density = 1e-3, .slip_density = 3e-5, .turn_density = turn_density};
  cairn::Gaussian<SE2> moved_;
};

}  // namespace

LandmarkLog read_mrclam(const std::filesystem::path& folder, int robot) {
  const std::string name = "Robot" + std::to_string(robot);
  Files files(folder, name);
  if (files.odometry.empty())
    cairn::raise((folder / name).string() + "_Odometry.dat: expected odometry, found none");
  const WheelErrors wheel = wheel_errors(files.odometry, files.sightings);
  for (WheelSpeeds& now : files.odometry) {
    now.time += wheel.delay;
    now.turn *= is_on_the_spot(now) ? wheel.turn_on_the_spot : wheel.turn;
  }
  LandmarkLog log{
      .name = "UTIAS " + folder.filename().string() + ", robot " + std::to_string(robot),
      // A bar code faces one way, and what the camera does not read says nothing.
      .sensor = {.range_sigma = 0.5, .bearing_sigma = 0.05, .farthest = 8, .half_view = 0.5, .detection = 0},
      .landmarks = files.landmarks,
      .notes = files.notes,
  };
  for (const Row& r : files.truth) log.truth.push_back({r[0], {r[1], r[2], r[3]}});
  for (const auto& [time, pose] : log.truth)  // where it was when odometry began
    if (!log.start || time <= files.odometry.front().time) log.start = pose;
  std::set<int> unknown;
  const double begin = files.odometry.front().time;
  Wheels wheels(log, folder / (name + "_Odometry.dat"), begin);
  std::size_t next = 0;
  while (next < files.sightings.size() && files.sightings[next].time <= begin) ++next;
  std::size_t outside = next;
  for (const WheelSpeeds& now : files.odometry) {
    for (; next < files.sightings.size() && files.sightings[next].time <= now.time; ++next) {
      const CodeSighting& seen = files.sightings[next];
      const auto subject = files.subject_of.find(seen.code);
      if (subject == files.subject_of.end()) unknown.insert(seen.code);
      if (subject == files.subject_of.end() || !files.landmarks.contains(subject->second)) continue;
      wheels.move(seen.time);
      const bool same = !log.frames.empty() && log.frames.back().time == wheels.time();
      Frame& frame = same ? log.frames.back() : wheels.frame();
      frame.seen.push_back({cairn::RangeBearing::measurement(seen.range, seen.bearing), subject->second});
    }
    wheels.move(now.time);
    wheels.between();
    wheels.steer(now);
  }
  outside += files.sightings.size() - next;
  if (log.frames.empty())
    cairn::raise(folder.string() + ": " + name + " saw no landmark of this set while odometry was kept");
  if (outside > 0)
    log.notes.push_back("sightings before odometry begins or after it ends, left out: " +
                        std::to_string(outside));
  for (const int code : unknown)
    log.notes.push_back("bar code " + std::to_string(code) + " belongs to nothing of the set: left out");
  if (wheel.delay != 0)
    log.notes.push_back("the robot moves " + cairn::shortest(wheel.delay) +
                        " s later than odometry says: odometry is taken for that");
  for (const auto& [turn, where] : {std::pair(wheel.turn, ""), {wheel.turn_on_the_spot, " on the spot"}})
    if (turn != 1)
      log.notes.push_back("the robot turns " + cairn::shortest(turn) + " times as far" + where +
                          " as odometry says: odometry is taken for that");
  return log;
}

}  // namespace fastslam
