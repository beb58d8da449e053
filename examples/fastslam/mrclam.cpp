// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <deque>
#include <filesystem>
#include <initializer_list>
#include <iterator>
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

/// How odometry differs from what the robot does: turns on the spot err by another factor than curves.
struct WheelErrors {
  double delay = 0;                       ///< [s] that the robot moves later than odometry says so
  double turn = 1, turn_on_the_spot = 1;  ///< what it turns where odometry says one

  bool operator==(const WheelErrors&) const = default;
};

bool is_on_the_spot(const Row& odometry) {
  constexpr double slowest = 0.01;  // [m/s]
  return std::abs(odometry[1]) < slowest;
}

/// Metres gone, radians turned on the way and radians turned on the spot, by odometry until a time.
class Gone {
public:
  explicit Gone(const std::vector<Row>& odometry) : odometry_(odometry) {
    for (std::size_t i = 0; i + 1 < odometry.size(); ++i)
      until_.emplace_back(until_.back() + (odometry[i + 1][0] - odometry[i][0]) * rates(odometry[i]));
  }
  [[nodiscard]] Vector<3> until(double time) const {
    const auto after = std::ranges::upper_bound(odometry_, time, {}, [](const Row& r) { return r[0]; });
    if (after == odometry_.begin()) return Vector<3>::Zero();
    const auto i = static_cast<std::size_t>(after - odometry_.begin()) - 1;
    if (after == odometry_.end()) return until_[i];
    return until_[i] + (time - odometry_[i][0]) * rates(odometry_[i]);
  }

private:
  static Vector<3> rates(const Row& r) {
    return is_on_the_spot(r) ? Vector<3>(r[1], 0, r[2]) : Vector<3>(r[1], r[2], 0);
  }

  const std::vector<Row>& odometry_;
  std::vector<Vector<3>> until_{Vector<3>::Zero()};
};

/// A bar code seen at two times.
struct SeenTwice {
  double from, to;
  Vector<2> place;  // from the robot, at first
  double bearing;   // then
};

/// Each sighting with the last one of the same code that is `least` to `most` seconds before it.
std::vector<SeenTwice> seen_twice(const std::vector<Row>& sightings, double least, double most) {
  std::vector<SeenTwice> pairs;
  std::map<int, std::deque<const Row*>> sightings_of;  // not older than that
  for (const Row& seen : sightings) {
    std::deque<const Row*>& before = sightings_of[static_cast<int>(seen[1])];
    while (!before.empty() && seen[0] - (*before.front())[0] > most) before.pop_front();
    const auto too_late = std::ranges::partition_point(
        before, [&](const Row* row) { return seen[0] > (*row)[0] && seen[0] - (*row)[0] >= least; });
    if (too_late != before.begin()) {
      const Row& first = **std::prev(too_late);
      const Vector<2> place = first[2] * Vector<2>(std::cos(first[3]), std::sin(first[3]));
      pairs.push_back({first[0], seen[0], place, seen[3]});
    }
    before.push_back(&seen);
  }
  return pairs;
}

/// What odometry says of the robot between the two sightings.
Vector<3> gone_between(const SeenTwice& pair, const Gone& gone, double delay) {
  return gone.until(pair.to - delay) - gone.until(pair.from - delay);
}

/// How far the bearings of codes that were seen twice are from where wheels with these errors would have
/// turned them [rad]: the sum, which a code that is read wrongly does not pull at.
double sum_of_errors(const std::vector<SeenTwice>& pairs, const Gone& gone, const WheelErrors& wheels) {
  double sum = 0;
  for (const SeenTwice& p : pairs) {
    const Vector<3> moved = gone_between(p, gone, wheels.delay);
    const double turned = wheels.turn * moved(1) + wheels.turn_on_the_spot * moved(2);
    const Vector<2> then = SE2::exp(Vector<3>(moved(0), 0, turned)).inverse() * p.place;
    sum += std::abs(cairn::SO2(p.bearing - std::atan2(then(1), then(0))).angle());
  }
  return sum;
}

/// By the codes that the robot sees twice: the delay to a hundredth of a second and the turns to a
/// thousandth, each by the least sum of errors with the others as they are, until all stay. Sightings that
/// follow one another tell the delay; of the turns they have too little, and the jitter of their times makes
/// these look smaller than they are: over a second it does not. Where too little was seen of one, odometry is
/// believed.
WheelErrors wheel_errors(const Files& files) {
  constexpr std::size_t enough = 100, enough_turned = 30;
  constexpr double turned = 0.1;  // [rad]
  constexpr int most_rounds = 10;
  const std::vector<SeenTwice> soon = seen_twice(files.sightings, 0, 1);
  const std::vector<SeenTwice> later = seen_twice(files.sightings, 1, 2);
  const Gone gone(files.odometry);
  // The best of middle + i step, |i| <= reach; of two as good the one nearer to the middle.
  const auto best = [&](const auto& pairs, const auto& with, int middle, int step, int reach) {
    int found = middle;
    double least = sum_of_errors(pairs, gone, with(middle));
    for (int i = 1; i <= reach; ++i)
      for (const int value : {middle + i * step, middle - i * step})
        if (const double sum = sum_of_errors(pairs, gone, with(value)); sum < least) {
          least = sum;
          found = value;
        }
    return found;
  };
  const auto has_turned = [&](int kind, double delay) {
    const auto has = [&](const SeenTwice& p) {
      return std::abs(gone_between(p, gone, delay)(kind)) > turned;
    };
    return static_cast<std::size_t>(std::ranges::count_if(later, has)) >= enough_turned;
  };
  WheelErrors now;
  for (int round = 0; round < most_rounds; ++round) {
    const WheelErrors before = now;
    const auto set = [&](double WheelErrors::* which, double to) {
      WheelErrors wheels = now;
      wheels.*which = to;
      return wheels;
    };
    if (soon.size() >= enough) {
      const auto delayed = [&](int hundredths) { return set(&WheelErrors::delay, hundredths / 100.0); };
      now = delayed(best(soon, delayed, 0, 1, 50));
    }
    int kind = 1;
    for (const auto which : {&WheelErrors::turn, &WheelErrors::turn_on_the_spot}) {
      if (!has_turned(kind++, now.delay)) continue;
      const auto turning = [&](int thousandths) { return set(which, thousandths / 1000.0); };
      now = turning(best(later, turning, best(later, turning, 1000, 20, 30), 1, 20));
    }
    if (now == before) break;
  }
  return now;
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
    const cairn::Status status = cairn::Extended{}.predict(moved_, process_, to - time_, control_);
    if (status != cairn::Status::accepted)
      cairn::raise(file_.string() + ": the motion until " + cairn::shortest(to) + " s: " + explain(status));
    time_ = to;
  }
  void steer(const Row& odometry) {
    control_ = Vector<2>(odometry[1], odometry[2]);
    process_.turn_density =
        turn_density + (is_on_the_spot(odometry) ? on_the_spot * std::abs(odometry[2]) : 0);
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
  const WheelErrors wheel = wheel_errors(files);
  for (Row& r : files.odometry) {
    r[0] += wheel.delay;
    r[2] *= is_on_the_spot(r) ? wheel.turn_on_the_spot : wheel.turn;
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
    wheels.steer(o);
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
