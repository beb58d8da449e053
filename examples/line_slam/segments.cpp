// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "segments.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>

#include <cairn/core/statistics.hpp>

#include "segment_detector.hpp"

namespace line_slam {

namespace {

using cairn::LineCamera;
using cairn::LineSegment;
using cairn::LineView;
using cairn::SE3;
using cairn::SO3;
using cairn::Vector;

/// The part of a camera's edge, as shares of it, that is before the camera and inside the picture.
std::optional<std::pair<double, double>> clipped(const LineCamera& c, const Vector<3>& a,
                                                 const Vector<3>& b) {
  constexpr double nearest = 0.3;  // [m]
  const cairn::PinholeParameters& p = c.camera().parameters();
  double low = 0, high = 1;
  const auto keep = [&](double at_a, double at_b) {  // where the linear function is at least zero
    if (at_a < 0 && at_b < 0) low = 2;
    if (at_a < 0 && at_b >= 0) low = std::max(low, at_a / (at_a - at_b));
    if (at_a >= 0 && at_b < 0) high = std::min(high, at_a / (at_a - at_b));
  };
  const auto left = [&](const Vector<3>& q) { return p.fx * q(0) + p.cx * q(2); };
  const auto up = [&](const Vector<3>& q) { return p.fy * q(1) + p.cy * q(2); };
  keep(a(2) - nearest, b(2) - nearest);
  keep(left(a), left(b));
  keep((p.width - 1) * a(2) - left(a), (p.width - 1) * b(2) - left(b));
  keep(up(a), up(b));
  keep((p.height - 1) * a(2) - up(a), (p.height - 1) * b(2) - up(b));
  if (!(low < high)) return std::nullopt;
  return std::pair{low, high};
}

Vector<2> pixel(const LineCamera& c, const Vector<3>& p) {
  const cairn::PinholeParameters& k = c.camera().parameters();
  return {k.fx * p(0) / p(2) + k.cx, k.fy * p(1) / p(2) + k.cy};
}

/// One camera's detector.
class Detector {
public:
  Detector(const Campus& campus, const LineCamera& camera, const SE3& rig, const DetectorOptions& options,
           cairn::Random& random)
      : campus_(campus),
        camera_(camera),
        pose_(rig * camera.T_rig_camera()),
        back_(pose_.inverse()),
        options_(options),
        random_(random) {}

  std::vector<Detected> all() {
    for (std::uint32_t e = 0; e < campus_.edges().size(); ++e) look_at(e);
    const auto real = static_cast<double>(found_.size());
    const auto more = static_cast<std::size_t>(std::lrint(real * options_.made_up));
    for (std::size_t i = 0; i < more; ++i) make_up();
    return std::move(found_);
  }

private:
  void look_at(std::uint32_t number) {
    const Edge& edge = campus_.edges()[number];
    const Vector<3> from = back_ * edge.from, to = back_ * edge.to;
    if (std::min(from(2), to(2)) > options_.farthest || std::max(from(2), to(2)) <= 0) return;
    const auto part = clipped(camera_, from, to);
    if (!part) return;
    // Along the picture, so that what is seen is cut where it is hidden to a pixel or two.
    const Vector<3> a = from + part->first * (to - from), b = from + part->second * (to - from);
    const double length = (pixel(camera_, b) - pixel(camera_, a)).norm();
    if (length < options_.shortest) return;
    const int steps = std::max(8, static_cast<int>(length / 3));
    int begin = -1;
    for (int i = 0; i <= steps + 1; ++i) {
      const bool seen = i <= steps && is_seen(at(a, b, static_cast<double>(i) / steps));
      if (seen && begin < 0) begin = i;
      if (seen || begin < 0) continue;
      if (i - 1 > begin)
        report(number, pixel(camera_, at(a, b, static_cast<double>(begin) / steps)),
               pixel(camera_, at(a, b, static_cast<double>(i - 1) / steps)));
      begin = -1;
    }
  }

  /// The point between two whose pixel is at this share of the way between theirs.
  static Vector<3> at(const Vector<3>& a, const Vector<3>& b, double share) {
    const double s = share * a(2) / (share * a(2) + (1 - share) * b(2));
    return a + s * (b - a);
  }
  bool is_seen(const Vector<3>& p) const {
    return p(2) < options_.farthest && campus_.sees(pose_.translation(), pose_ * p);
  }

  void report(std::uint32_t edge, const Vector<2>& a, const Vector<2>& b) {
    if ((b - a).norm() < options_.shortest || random_.uniform() < options_.missed) return;
    const int pieces = random_.uniform() < options_.broken ? 2 + static_cast<int>(random_.below(2)) : 1;
    const Vector<2> along = (b - a).normalized();
    Vector<2> begin = a;
    for (int i = 1; i <= pieces; ++i) {
      const double cut = (static_cast<double>(i) + (i < pieces ? random_.uniform(-0.2, 0.2) : 0)) / pieces;
      const Vector<2> end = a + cut * (b - a);
      if ((end - begin).norm() >= options_.shortest) found_.push_back({{noisy(begin), noisy(end)}, edge});
      begin = end + random_.uniform(1, options_.widest_gap) * along;
    }
  }
  Vector<2> noisy(const Vector<2>& p) {
    return p + Vector<2>(random_.normal(0, options_.sigma), random_.normal(0, options_.sigma));
  }

  void make_up() {
    const auto& k = camera_.camera().parameters();
    const Vector<2> middle(random_.uniform(0, k.width), random_.uniform(0, k.height));
    const double angle = random_.uniform(0, 2 * std::numbers::pi), half = random_.uniform(10, 60);
    const Vector<2> along = half * Vector<2>(std::cos(angle), std::sin(angle));
    found_.push_back({{middle - along, middle + along}, no_edge});
  }

  const Campus& campus_;
  const LineCamera& camera_;
  SE3 pose_, back_;
  const DetectorOptions& options_;
  cairn::Random& random_;
  std::vector<Detected> found_;
};

/// The edge that a segment lies along: both ends within two pixels of its line, beside most of it; of several
/// the nearest.
std::uint32_t edge_along(const LineSegment& segment, const std::vector<Detected>& edges) {
  double nearest = 2;  // [pixels]
  std::uint32_t edge = no_edge;
  for (const Detected& e : edges) {
    const Vector<2> along = (e.segment.to - e.segment.from).normalized();
    const double length = e.segment.length();
    double off = 0, low = length, high = 0;
    for (const Vector<2>* end : {&segment.from, &segment.to}) {
      const Vector<2> d = *end - e.segment.from;
      off = std::max(off, std::abs(d(1) * along(0) - d(0) * along(1)));
      low = std::min(low, d.dot(along));
      high = std::max(high, d.dot(along));
    }
    const double beside = std::min(high, length) - std::max(low, 0.0);
    if (off >= nearest || beside < 0.5 * segment.length()) continue;
    nearest = off;
    edge = e.edge;
  }
  return edge;
}

/// The nearer end of `of` is so far from `segment` along it; nothing where it lies beside it, or turned.
std::optional<double> gap_between(const LineSegment& segment, const LineSegment& of, double sigma) {
  const Vector<2> along = (segment.to - segment.from).normalized();
  const double length = segment.length();
  double low = 0, high = 0;
  for (const Vector<2>* end : {&of.from, &of.to}) {
    const Vector<2> d = *end - segment.from;
    const double at = d.dot(along), off = d(1) * along(0) - d(0) * along(1);
    const double beyond = std::max({0.0, at - length, -at});
    if (std::abs(off) > 4 * sigma * (1 + 2 * beyond / length)) return std::nullopt;
    low = end == &of.from ? at : std::min(low, at);
    high = end == &of.from ? at : std::max(high, at);
  }
  return std::max({0.0, low - length, -high});
}

/// The line through all four ends, from the first to the last of them.
LineSegment merged(const LineSegment& a, const LineSegment& b) {
  const Vector<2> ends[] = {a.from, a.to, b.from, b.to};
  Vector<2> mean = Vector<2>::Zero();
  for (const Vector<2>& e : ends) mean += 0.25 * e;
  double xx = 0, xy = 0, yy = 0;
  for (const Vector<2>& e : ends) {
    const Vector<2> d = e - mean;
    xx += d(0) * d(0);
    xy += d(0) * d(1);
    yy += d(1) * d(1);
  }
  const double angle = 0.5 * std::atan2(2 * xy, xx - yy);
  const Vector<2> along(std::cos(angle), std::sin(angle));
  double low = 0, high = 0;
  for (const Vector<2>& e : ends) {
    low = std::min(low, along.dot(e - mean));
    high = std::max(high, along.dot(e - mean));
  }
  return {mean + low * along, mean + high * along};
}

/// Inverse distances along the rays of two pixels at which a segment of another camera has its plane.
struct Distances {
  double from = 0, to = 0, sigma = 0;  ///< [1/m]; the plane of a segment along the baseline says nothing
};
Distances distances(const LineCamera& of, const LineSegment& segment, const LineCamera& other,
                    const LineSegment& its, double sigma) {
  const Vector<3> n = other.plane(its);
  const double across = n.dot(other.centre() - of.centre());
  return {n.dot(of.ray(segment.from)) / across, n.dot(of.ray(segment.to)) / across,
          1.5 * sigma / of.camera().fx() / std::abs(across)};
}

/// What two cameras both saw over what either saw, along the line: the least of the three pairs.
double least_overlap(const std::array<LineView, cameras>& views, const cairn::Line& line) {
  std::array<std::pair<double, double>, cameras> part;
  for (std::size_t c = 0; c < cameras; ++c) {
    const auto a = views[c].camera->coordinate(line, views[c].segment.from),
               b = views[c].camera->coordinate(line, views[c].segment.to);
    if (!a || !b) return 0;
    part[c] = std::minmax(*a, *b);
  }
  double least = 1;
  for (std::size_t c = 0; c < cameras; ++c) {
    const auto &p = part[c], &q = part[(c + 1) % cameras];
    const double common = std::min(p.second, q.second) - std::max(p.first, q.first);
    const double either = std::max(p.second, q.second) - std::min(p.first, q.first);
    least = std::min(least, either > 0 ? common / either : 0);
  }
  return least;
}

/// How unsure a sighting is in depth, see LineSighting.
void judge(LineSighting& s, const Rig& rig, double sigma) {
  const LineSegment& a = s.seen[0];
  double information = 0;
  for (std::size_t c = 1; c < cameras; ++c) {
    const Distances d = distances(rig[0], a, rig[c], s.seen[c], sigma);
    information += 1 / (d.sigma * d.sigma);
  }
  const double z = rig[0].depth(s.line.line.point()), inverse_sigma = 1 / std::sqrt(information);
  s.depth = z * z * inverse_sigma;
  s.tilt = std::numbers::sqrt2 * z * inverse_sigma * rig[0].camera().fx() / a.length();
}

}  // namespace

Rig three_cameras(double baseline) {
  const cairn::PinholeCamera camera(
      {.fx = 600, .fy = 600, .cx = 479.5, .cy = 359.5, .width = 960, .height = 720});
  return {LineCamera(camera, SE3()), LineCamera(camera, SE3(SO3(), {-baseline, 0, 0})),
          LineCamera(camera, SE3(SO3(), {0, -baseline, 0}))};
}

Detections detect(const Campus& campus, const Rig& rig, const SE3& pose, const DetectorOptions& options,
                  cairn::Random& random) {
  Detections all;
  for (std::size_t c = 0; c < cameras; ++c)
    all[c] = joined(Detector(campus, rig[c], pose, options, random).all(), options.sigma);
  return all;
}

Detections detect_in_pictures(const Campus& campus, const Rig& rig, const SE3& pose,
                              const DetectorOptions& options) {
  const DetectorOptions exactly{.sigma = 0,
                                .shortest = 0.5 * options.shortest,
                                .farthest = options.farthest,
                                .missed = 0,
                                .made_up = 0,
                                .broken = 0};
  Detections all;
  cairn::Random nothing(1);
  for (std::size_t c = 0; c < cameras; ++c) {
    const std::vector<Detected> edges = Detector(campus, rig[c], pose, exactly, nothing).all();
    std::vector<Detected> found;
    for (const LineSegment& s : segments_of(campus.picture(rig[c], pose), options.shortest))
      found.push_back({s, edge_along(s, edges)});
    all[c] = joined(std::move(found), options.sigma);
  }
  return all;
}

std::vector<Detected> joined(std::vector<Detected> segments, double sigma) {
  constexpr double widest_gap = 10;  // [pixels]
  for (std::size_t i = 0; i < segments.size(); ++i)
    for (std::size_t j = i + 1; j < segments.size();) {
      const auto gap = gap_between(segments[i].segment, segments[j].segment, sigma);
      const auto back = gap_between(segments[j].segment, segments[i].segment, sigma);
      if (!gap || !back || *gap > widest_gap) {
        ++j;
        continue;
      }
      segments[i].segment = merged(segments[i].segment, segments[j].segment);
      if (segments[i].edge != segments[j].edge) segments[i].edge = no_edge;
      segments.erase(segments.begin() + static_cast<std::ptrdiff_t>(j));
      j = i + 1;  // it has grown: look at all again
    }
  return segments;
}

std::vector<LineSighting> match(const Rig& rig, const Detections& detections,
                                const MatchingOptions& options) {
  struct Triple {
    double cost;
    std::array<std::size_t, cameras> which;
    LineSighting sighting;
  };
  const double gate = cairn::chi_square_quantile(options.gate, 2);
  std::vector<Triple> triples;
  for (std::size_t i = 0; i < detections[0].size(); ++i) {
    const LineSegment& a = detections[0][i].segment;
    // What may be of the same line in either other picture, and the distances it gives.
    std::array<std::vector<std::pair<std::size_t, Distances>>, cameras> likely;
    for (std::size_t c = 1; c < cameras; ++c)
      for (std::size_t j = 0; j < detections[c].size(); ++j) {
        const Distances d = distances(rig[0], a, rig[c], detections[c][j].segment, options.sigma);
        const double low = 1 / options.farthest - 4 * d.sigma, high = 1 / options.nearest + 4 * d.sigma;
        if (d.from > low && d.from < high && d.to > low && d.to < high) likely[c].emplace_back(j, d);
      }
    for (const auto& [j, b] : likely[1])
      for (const auto& [k, c] : likely[2]) {
        const double apart = 4 * std::hypot(b.sigma, c.sigma);
        if (!(std::abs(b.from - c.from) < apart && std::abs(b.to - c.to) < apart)) continue;
        const std::array<LineView, cameras> views{LineView{&rig[0], a},
                                                  LineView{&rig[1], detections[1][j].segment},
                                                  LineView{&rig[2], detections[2][k].segment}};
        const auto line = cairn::triangulate_line(views, {.sigma = options.sigma});
        if (!line.good() || !(line.chi2 < gate)) continue;
        const double overlap = least_overlap(views, line.line);
        if (overlap < options.overlap) continue;
        const std::uint32_t edge = detections[0][i].edge;
        const bool same = detections[1][j].edge == edge && detections[2][k].edge == edge;
        triples.push_back(
            {line.chi2 + options.of_overlap * (1 - overlap),
             {i, j, k},
             {.seen = {a, views[1].segment, views[2].segment}, .line = line, .edge = same ? edge : no_edge}});
      }
  }
  std::sort(triples.begin(), triples.end(), [](const Triple& a, const Triple& b) {
    return std::tie(a.cost, a.which) < std::tie(b.cost, b.which);
  });
  // One after the other; what another triple would explain nearly as well is left out with it.
  std::array<std::vector<bool>, cameras> used;
  for (std::size_t c = 0; c < cameras; ++c) used[c].resize(detections[c].size());
  const auto is_used = [&](const Triple& t) {
    return used[0][t.which[0]] || used[1][t.which[1]] || used[2][t.which[2]];
  };
  std::vector<LineSighting> result;
  for (std::size_t n = 0; n < triples.size(); ++n) {
    const Triple& t = triples[n];
    if (is_used(t)) continue;
    const bool in_doubt = std::any_of(
        triples.begin() + static_cast<std::ptrdiff_t>(n) + 1, triples.end(), [&](const Triple& other) {
          const bool shares =
              t.which[0] == other.which[0] || t.which[1] == other.which[1] || t.which[2] == other.which[2];
          return shares && other.cost < t.cost + options.doubt && !is_used(other);
        });
    for (std::size_t c = 0; c < cameras; ++c) used[c][t.which[c]] = true;
    if (in_doubt) continue;
    result.push_back(t.sighting);
    judge(result.back(), rig, options.sigma);
  }
  return result;
}

}  // namespace line_slam
