// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/io/text.hpp>
#include <cairn/models/motion.hpp>

#include "landmark_log.hpp"

namespace fastslam {

namespace {

using cairn::SE2;
using cairn::Vector;

constexpr double speed = 3, wheel_base = 4, period = 0.2, degree = std::numbers::pi / 180;  // m/s, m, s

/// Turn rates towards one way point after the other, the steering bounded to 30 degrees.
class Driver {
public:
  explicit Driver(const std::vector<Vector<2>>& way) : way_(way) {}

  double turn_rate(const SE2& x) {
    if ((way_[next_] - x.translation()).norm() < 2) next_ = (next_ + 1) % way_.size();
    const Vector<2> ahead = x.inverse() * way_[next_];
    const double steering = std::clamp(std::atan2(ahead(1), ahead(0)), -30 * degree, 30 * degree);
    return speed * std::tan(steering) / wheel_base;
  }

private:
  const std::vector<Vector<2>>& way_;
  std::size_t next_ = 0;
};

std::vector<Vector<2>> read_points(cairn::TextLines& lines, const char* name) {
  double size[3] = {};
  const std::string_view head = cairn::trimmed(lines.line());
  if (!head.starts_with(name)) lines.fail(std::string("'") + name + " 2 COUNT'");
  std::string_view rest = cairn::trimmed(head.substr(2));
  const std::size_t blank = std::min(rest.find_first_of(" \t"), rest.size());
  const auto columns = cairn::parse_number<int>(rest.substr(0, blank));
  const auto count = cairn::parse_number<std::size_t>(cairn::trimmed(rest.substr(blank)));
  if (!columns || *columns != 2 || !count || *count == 0 || *count > 100000)
    lines.fail(std::string("'") + name + " 2 COUNT' with at least one and at most 100000 points");
  std::vector<Vector<2>> points;
  while (points.size() < *count) {
    if (!lines.next('#')) lines.fail(std::to_string(*count) + " points, the file ends before");
    if (lines.numbers(' ', size, 2) != 2) lines.fail("two numbers");
    points.emplace_back(size[0], size[1]);
  }
  return points;
}

}  // namespace

PointMap read_point_map(const std::filesystem::path& path) {
  cairn::TextLines lines(path, "a map of landmarks and way points");
  PointMap map{.name = path.stem().string(), .way = {}};
  const auto head = [&](const char* name) {
    if (!lines.next('#'))
      cairn::raise(path.string() + ": expected '" + name + " 2 COUNT', the file ends before");
    return read_points(lines, name);
  };
  map.landmarks = head("lm");
  map.way = head("wp");
  if (map.way.size() < 2) lines.fail("a way of at least two points");
  return map;
}

PointMap loop_map() {
  PointMap map{.name = "simulated loop",
               .way = {{0, 0}, {55, 0}, {60, 5}, {60, 35}, {55, 40}, {5, 40}, {0, 35}, {0, 5}}};
  cairn::Random random(3);  // the same for every drive
  const Vector<2> corners[] = {{0, 0}, {60, 0}, {60, 40}, {0, 40}};
  for (int side = 0; side < 4; ++side) {
    const Vector<2> from = corners[side], to = corners[(side + 1) % 4], along = (to - from).normalized();
    for (int i = 0; i < 12; ++i) {
      const double across = (i % 2 == 0 ? 1 : -1) * random.uniform(3, 8);
      map.landmarks.emplace_back(from + (i + random.uniform()) / 12 * (to - from) +
                                 across * Vector<2>(-along(1), along(0)));
    }
  }
  return map;
}

LandmarkLog simulated(const PointMap& map, std::uint64_t seed, std::size_t frames) {
  const cairn::Unicycle process{
      .speed_density = 0.3 * 0.3 * 0.025,
      .slip_density = 1e-4,
      .turn_density = std::pow(3 * degree * speed / wheel_base, 2) * 0.025};  // Bailey draws them every 25 ms
  LandmarkLog log{
      .name = map.name,
      .sensor = {.range_sigma = 0.1,
                 .bearing_sigma = 1 * degree,
                 .farthest = 30,
                 .half_view = std::numbers::pi / 2,
                 .detection = 0.9},
  };
  for (std::size_t i = 0; i < map.landmarks.size(); ++i)
    log.landmarks[static_cast<std::uint32_t>(i)] = map.landmarks[i];
  cairn::Random random(seed, 29);
  const Vector<2> to_first = map.way[map.way.size() > 1 ? 1 : 0] - map.way[0];
  SE2 is(map.way[0](0), map.way[0](1), std::atan2(to_first(1), to_first(0)));
  log.start = is;
  Driver driver(map.way);
  for (std::size_t k = 0; k < frames; ++k) {
    Frame frame{period * static_cast<double>(k + 1), {SE2(), cairn::Matrix<3>::Zero()}, {}};
    const Vector<2> control(speed, driver.turn_rate(is));
    if (cairn::Extended{}.predict(frame.moved, process, period, control) != cairn::Status::accepted)
      cairn::raise("simulated drive: the motion is not finite");
    is = is * cairn::sample(frame.moved, random);
    for (const auto& [id, place] : log.landmarks) {
      const auto z = log.sensor.predict(is, place);
      const Vector<2> noise(random.normal(0, log.sensor.range_sigma),
                            random.normal(0, log.sensor.bearing_sigma));
      const bool reported = random.uniform() < log.sensor.detection;
      if (reported && log.sensor.detection_probability(is, place) > 0)
        frame.seen.push_back({cairn::retract(z, noise), id});
    }
    log.truth.push_back({frame.time, is});
    log.frames.push_back(std::move(frame));
  }
  return log;
}

}  // namespace fastslam
