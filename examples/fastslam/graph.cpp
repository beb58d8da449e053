// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/io/text.hpp>

#include "landmark_log.hpp"

namespace fastslam {

namespace {

using cairn::Matrix;
using cairn::SE2;

/// Takes the lines one after the other. Motions without a sighting between them become one: what is drawn of
/// a pose is better drawn when something of it is seen.
class GraphReader {
public:
  GraphReader(const std::filesystem::path& path, LandmarkLog& log)
      : lines_(path, "a graph of odometry and landmarks"), log_(log) {}

  void read() {
    while (lines_.next('#')) {
      rest_ = lines_.line();
      const std::string_view kind = word();
      if (kind == "ODOMETRY")
        motion();
      else if (kind == "LANDMARK")
        sighting();
      else
        lines_.fail("ODOMETRY or LANDMARK");
    }
    if (!newest_) lines_.fail("odometry");
    if (log_.frames.empty()) lines_.fail("sightings of landmarks");
  }

private:
  std::string_view word() {
    rest_ = cairn::trimmed(rest_);
    const std::size_t end = std::min(rest_.find_first_of(" \t"), rest_.size());
    const std::string_view found = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return found;
  }
  double number() {
    const auto value = cairn::parse_number(word());
    if (!value || !std::isfinite(*value)) lines_.fail("finite numbers");
    return *value;
  }
  std::uint32_t vertex() {
    const auto value = cairn::parse_number<std::uint32_t>(word());
    if (!value || *value >= Map::most_identity) lines_.fail("the number of a vertex, below 2^24");
    return *value;
  }

  void motion() {
    const std::uint32_t from = vertex(), to = vertex();
    if (newest_ && from != *newest_) lines_.fail("a motion from the newest pose");
    const double x = number(), y = number();
    const SE2 step(x, y, number());
    Matrix<3> p;
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) p(i, j) = p(j, i) = number();
    if (!cairn::Cholesky<3>(p).good()) lines_.fail("a motion that is uncertain in every direction");
    const Matrix<3> back = step.inverse().adjoint();
    moved_.covariance = cairn::symmetrised(Matrix<3>(back * moved_.covariance * back.transpose() + p));
    moved_.mean = moved_.mean * step;
    if (!cairn::all_finite(moved_.covariance) || !std::isfinite(moved_.mean.x() + moved_.mean.y()))
      lines_.fail("motions that remain finite together");
    newest_ = to;
    ++poses_;
    if (!log_.frames.empty())
      log_.between.push_back({static_cast<double>(poses_), log_.frames.size() - 1, moved_.mean});
  }

  void sighting() {
    if (!newest_) lines_.fail("a motion before the first sighting");
    const std::uint32_t from = vertex(), landmark = vertex();
    if (from != *newest_) lines_.fail("a sighting from the newest pose");
    const double x = number(), y = number(), xx = number(), xy = number(), yy = number();
    if (!(std::hypot(x, y) > 0)) lines_.fail("a landmark apart from the robot, which has a bearing");
    if (!(xx > 0) || xy != 0 || xx != yy) lines_.fail("a covariance that is the same in every direction");
    const double sigma = std::sqrt(xx);
    if (log_.sensor.across_sigma != 0 && log_.sensor.across_sigma != sigma)
      lines_.fail("the same covariance for all sightings");
    log_.sensor.across_sigma = log_.sensor.range_sigma = sigma;
    frame().seen.push_back({cairn::RangeBearing::measurement(std::hypot(x, y), std::atan2(y, x)), landmark});
  }

  Frame& frame() {
    const auto now = static_cast<double>(poses_);
    if (!log_.frames.empty() && log_.frames.back().time == now) return log_.frames.back();
    if (!log_.between.empty()) log_.between.pop_back();  // the pose that is a frame itself
    log_.frames.push_back({now, moved_, {}});
    moved_ = {SE2(), Matrix<3>::Zero()};
    return log_.frames.back();
  }

  cairn::TextLines lines_;
  LandmarkLog& log_;
  std::string_view rest_;
  std::optional<std::uint32_t> newest_;
  std::size_t poses_ = 0;
  cairn::Gaussian<SE2> moved_{SE2(), Matrix<3>::Zero()};
};

}  // namespace

LandmarkLog read_graph(const std::filesystem::path& path) {
  LandmarkLog log{.name = path.filename().string(),
                  .sensor = {.range_sigma = 0.5,
                             .bearing_sigma = 0,
                             .across_sigma = 0,
                             .farthest = 60,
                             .half_view = 1.5,
                             .detection = 0.3}};
  GraphReader(path, log).read();
  return log;
}

}  // namespace fastslam
