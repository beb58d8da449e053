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

namespace fastslam {

namespace {

using cairn::SE2;
using cairn::Vector;

constexpr std::size_t most_columns = 5;
using Row = std::vector<double>;

/// What a file's first columns are: times, the numbers of subjects or bar codes (whole, below 2^24), any
/// other numbers, or distances, which are above zero.
enum class Column { time, identity, number, distance };

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
    }
    rows.emplace_back(numbers, numbers + columns.size());
  }
  return rows;
}

/// Of one robot's files and those of its set.
struct Files {
  using enum Column;
  std::vector<std::string> notes;
  std::vector<Row> odometry, sightings, truth;
  std::map<int, std::uint32_t> subject_of;  // by bar code
  std::map<std::uint32_t, Vector<2>> landmarks;

  Files(const std::filesystem::path& folder, const std::string& robot)
      : odometry(read_timed(folder / (robot + "_Odometry.dat"), {time, number, number})),
        sightings(read_timed(folder / (robot + "_Measurement.dat"), {time, identity, distance, number})) {
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

/// Metres and radians that odometry has gone and turned until a time.
class Gone {
public:
  explicit Gone(const std::vector<Row>& odometry) : odometry_(odometry) {
    for (std::size_t i = 0; i + 1 < odometry.size(); ++i) {
      const double dt = odometry[i + 1][0] - odometry[i][0];
      until_.emplace_back(until_.back() + dt * Vector<2>(odometry[i][1], odometry[i][2]));
    }
  }
  [[nodiscard]] Vector<2> until(double time) const {
    const auto after = std::ranges::upper_bound(odometry_, time, {}, [](const Row& r) { return r[0]; });
    if (after == odometry_.begin()) return Vector<2>::Zero();
    const auto i = static_cast<std::size_t>(after - odometry_.begin()) - 1;
    if (after == odometry_.end()) return until_[i];
    return until_[i] + (time - odometry_[i][0]) * Vector<2>(odometry_[i][1], odometry_[i][2]);
  }

private:
  const std::vector<Row>& odometry_;
  std::vector<Vector<2>> until_{Vector<2>::Zero()};
};

/// How much later than odometry says so the robot moves [s], by which the bearings of a bar code change, from
/// one sighting to the next within a second, most nearly as the wheels went: to a hundredth of a second, by
/// the least sum of errors, which a code that is read wrongly does not pull at. 0 where few were seen twice.
double delay_of(const Files& files) {
  constexpr std::size_t enough = 100;
  struct Pair {
    double from, to;
    Vector<2> place;  // from the robot, at first
    double bearing;   // then
  };
  std::vector<Pair> pairs;
  std::map<int, const Row*> last;
  for (const Row& seen : files.sightings) {
    const Row*& before = last[static_cast<int>(seen[1])];
    if (before != nullptr && seen[0] > (*before)[0] && seen[0] - (*before)[0] <= 1)
      pairs.push_back({(*before)[0], seen[0],
                       (*before)[2] * Vector<2>(std::cos((*before)[3]), std::sin((*before)[3])), seen[3]});
    before = &seen;
  }
  if (pairs.size() < enough) return 0;
  const Gone gone(files.odometry);
  const auto off = [&](double delay) {
    double sum = 0;
    for (const Pair& p : pairs) {
      const Vector<2> moved = gone.until(p.to - delay) - gone.until(p.from - delay);
      const Vector<2> then = SE2::exp(cairn::Vector<3>(moved(0), 0, moved(1))).inverse() * p.place;
      sum += std::abs(cairn::SO2(p.bearing - std::atan2(then(1), then(0))).angle());
    }
    return sum;
  };
  double best = 0, least = off(0);
  for (int hundredths = 1; hundredths <= 50; ++hundredths)
    for (const double delay : {0.01 * hundredths, -0.01 * hundredths})
      if (const double sum = off(delay); sum < least) {
        least = sum;
        best = delay;
      }
  return best;
}

/// Odometry turned into motions between frames.
class Wheels {
public:
  Wheels(LandmarkLog& log, std::filesystem::path file, double begin)
      : log_(log), file_(std::move(file)), time_(begin) {
    reset();
  }

  void move(double to) {
    if (to <= time_) return;
    const cairn::Status status = cairn::Extended{}.predict(moved_, process, to - time_, control_);
    if (status != cairn::Status::accepted)
      cairn::raise(file_.string() + ": the motion until " + cairn::shortest(to) + " s: " + explain(status));
    time_ = to;
  }
  void steer(double speed, double turn) { control_ = Vector<2>(speed, turn); }
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
  // densities of 3e-4 and 2e-3. Errors that last want a little more than that.
  static constexpr cairn::Unicycle process{.speed_density = 1e-3, .slip_density = 3e-5, .turn_density = 3e-3};

  void reset() { moved_ = {SE2(), cairn::Matrix<3>::Zero()}; }

  LandmarkLog& log_;
  std::filesystem::path file_;  // for messages
  double time_;
  Vector<2> control_ = Vector<2>::Zero();
  cairn::Gaussian<SE2> moved_;
};

}  // namespace

LandmarkLog read_mrclam(const std::filesystem::path& folder, int robot) {
  const std::string name = "Robot" + std::to_string(robot);
  Files files(folder, name);
  if (files.odometry.empty())
    cairn::raise((folder / name).string() + "_Odometry.dat: expected odometry, found none");
  const double delay = delay_of(files);
  for (Row& r : files.odometry) r[0] += delay;
  LandmarkLog log{
      .name = "UTIAS " + folder.filename().string() + ", robot " + std::to_string(robot),
      // A bar code faces one way, and what the camera does not read says nothing.
      .sensor = {.range_sigma = 0.5, .bearing_sigma = 0.05, .farthest = 8, .half_view = 0.5, .detection = 0},
      .landmarks = files.landmarks,
      .notes = files.notes,
  };
  for (const Row& r : files.truth) log.truth.push_back({r[0], {r[1], r[2], r[3]}});
  for (const auto& [time, pose] : log.truth)  // where it was when odometry began
    if (!log.start || time <= files.odometry.front()[0]) log.start = pose;
  std::set<int> unknown;
  const double begin = files.odometry.front()[0];
  Wheels wheels(log, folder / (name + "_Odometry.dat"), begin);
  std::size_t next = 0;
  while (next < files.sightings.size() && files.sightings[next][0] <= begin) ++next;
  std::size_t outside = next;
  for (const Row& o : files.odometry) {
    for (; next < files.sightings.size() && files.sightings[next][0] <= o[0]; ++next) {
      const Row& seen = files.sightings[next];
      const auto subject = files.subject_of.find(static_cast<int>(seen[1]));
      if (subject == files.subject_of.end()) unknown.insert(static_cast<int>(seen[1]));
      if (subject == files.subject_of.end() || !files.landmarks.contains(subject->second)) continue;
      wheels.move(seen[0]);
      const bool same = !log.frames.empty() && log.frames.back().time == wheels.time();
      Frame& frame = same ? log.frames.back() : wheels.frame();
      frame.seen.push_back({cairn::RangeBearing::measurement(seen[2], seen[3]), subject->second});
    }
    wheels.move(o[0]);
    wheels.between();
    wheels.steer(o[1], o[2]);
  }
  outside += files.sightings.size() - next;
  if (log.frames.empty())
    cairn::raise(folder.string() + ": " + name + " saw no landmark of this set while odometry was kept");
  if (outside > 0)
    log.notes.push_back("sightings before odometry begins or after it ends, left out: " +
                        std::to_string(outside));
  for (const int code : unknown)
    log.notes.push_back("bar code " + std::to_string(code) + " belongs to nothing of the set: left out");
  if (delay != 0)
    log.notes.push_back("the robot moves " + cairn::shortest(delay) +
                        " s later than odometry says: odometry is taken for that");
  return log;
}

}  // namespace fastslam
