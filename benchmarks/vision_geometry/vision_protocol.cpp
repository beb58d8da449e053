// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "vision_protocol.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <span>
#include <tuple>
#include <vector>

namespace vision_bench {

namespace {

struct Spot {
  double x, y, scale;
};

bool inside(const cairn::Image& image, Place at) {
  return at.x >= 0 && at.y >= 0 && at.x <= image.width() - 1 && at.y <= image.height() - 1;
}

/// One spot a place and scale.
void drop_doubles(std::vector<Spot>& spots) {
  const auto key = [](const Spot& a, const Spot& b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.scale < b.scale;
  };
  std::sort(spots.begin(), spots.end(), key);
  const auto equal = [](const Spot& a, const Spot& b) {
    return a.x == b.x && a.y == b.y && a.scale == b.scale;
  };
  spots.erase(std::unique(spots.begin(), spots.end(), equal), spots.end());
}

/// Points of the first image that the second shows, where it shows them.
std::vector<Spot> mapped(const Pair& pair, const cairn::Features& features) {
  std::vector<Spot> spots;
  for (const cairn::Keypoint& keypoint : features.keypoints) {
    const Place at{keypoint.x, keypoint.y};
    const Place to = pair.map(at);
    if (inside(pair.second, to)) spots.push_back({to.x, to.y, keypoint.scale * pair.map.scale(at)});
  }
  drop_doubles(spots);
  return spots;
}

std::vector<Spot> common(const Pair& pair, const cairn::Features& features) {
  const Homography back = pair.map.inverse();
  std::vector<Spot> spots;
  for (const cairn::Keypoint& keypoint : features.keypoints)
    if (inside(pair.first, back({keypoint.x, keypoint.y})))
      spots.push_back({keypoint.x, keypoint.y, keypoint.scale});
  drop_doubles(spots);
  return spots;
}

struct Assignment {
  std::size_t count = 0;
  double squares = 0;
};

/// One to one, least cost first; `cost` is infinite where two spots do not fit.
Assignment assign(const std::vector<Spot>& a, const std::vector<Spot>& b,
                  const std::function<double(const Spot&, const Spot&)>& cost) {
  struct Candidate {
    double cost;
    std::size_t i, j;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j)
      if (const double c = cost(a[i], b[j]); std::isfinite(c)) candidates.push_back({c, i, j});
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& x, const Candidate& y) {
    return std::tie(x.cost, x.i, x.j) < std::tie(y.cost, y.i, y.j);
  });
  std::vector<bool> used_a(a.size(), false), used_b(b.size(), false);
  Assignment result;
  for (const Candidate& candidate : candidates) {
    if (used_a[candidate.i] || used_b[candidate.j]) continue;
    used_a[candidate.i] = used_b[candidate.j] = true;
    const double dx = a[candidate.i].x - b[candidate.j].x, dy = a[candidate.i].y - b[candidate.j].y;
    ++result.count;
    result.squares += dx * dx + dy * dy;
  }
  return result;
}

constexpr double none = std::numeric_limits<double>::infinity();

std::function<double(const Spot&, const Spot&)> within(double tolerance) {
  return [=](const Spot& a, const Spot& b) {
    const double squared = (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
    const double ratio = a.scale / b.scale;
    return squared < tolerance * tolerance && ratio < 1.5 && ratio > 1 / 1.5 ? squared : none;
  };
}

/// 1 - intersection / union of two circles, the first brought to a radius of 30 pixels with all about it.
double overlap_error(const Spot& a, const Spot& b) {
  const double zoom = 30 / (3 * a.scale);
  const double r = 30, q = 3 * b.scale * zoom;
  const double d = zoom * std::hypot(a.x - b.x, a.y - b.y);
  if (d >= r + q) return 1;
  const double smaller = std::min(r, q), larger = std::max(r, q);
  double both = std::numbers::pi * smaller * smaller;
  if (d > larger - smaller) {
    const double u = std::acos((d * d + r * r - q * q) / (2 * d * r));
    const double v = std::acos((d * d + q * q - r * r) / (2 * d * q));
    both = r * r * (u - std::sin(2 * u) / 2) + q * q * (v - std::sin(2 * v) / 2);
  }
  return 1 - both / (std::numbers::pi * (r * r + q * q) - both);
}

double squared_distance(std::span<const float> a, std::span<const float> b) {
  float sum = 0;
  for (std::size_t n = 0; n < a.size(); ++n) sum += (a[n] - b[n]) * (a[n] - b[n]);
  return sum;
}

double percent(std::size_t part, std::size_t first, std::size_t second) {
  return 100.0 * static_cast<double>(part) /
         static_cast<double>(std::max<std::size_t>(std::min(first, second), 1));
}

}  // namespace

Repeatability repeatability(const Pair& pair, const cairn::Features& first, const cairn::Features& second,
                            double tolerance) {
  const std::vector<Spot> a = mapped(pair, first), b = common(pair, second);
  const Assignment assigned = assign(a, b, within(tolerance));
  return {percent(assigned.count, a.size(), b.size()),
          std::sqrt(assigned.squares / static_cast<double>(std::max<std::size_t>(assigned.count, 1))),
          std::min(a.size(), b.size())};
}

double chance_level(const Pair& pair, const cairn::Features& first, const cairn::Features& second,
                    double tolerance) {
  const std::vector<Spot> a = mapped(pair, first);
  std::vector<Spot> b = common(pair, second);
  if (b.empty()) return 0;
  const auto by_x = [](const Spot& p, const Spot& q) { return p.x < q.x; };
  const auto [least, most] = std::minmax_element(b.begin(), b.end(), by_x);
  const double both = least->x + most->x;
  for (Spot& spot : b) spot.x = both - spot.x;
  return percent(assign(a, b, within(tolerance)).count, a.size(), b.size());
}

double overlap_repeatability(const Pair& pair, const cairn::Features& first, const cairn::Features& second) {
  const std::vector<Spot> a = mapped(pair, first), b = common(pair, second);
  const auto cost = [](const Spot& p, const Spot& q) {
    if (std::abs(p.x - q.x) > 6 * p.scale) return none;  // no overlap left: saves the arccosines
    const double error = overlap_error(p, q);
    return error < 0.4 ? error : none;
  };
  return percent(assign(a, b, cost).count, a.size(), b.size());
}

Matches ratio_matches(const Pair& pair, const cairn::Features& first, const cairn::Features& second) {
  Matches matches;
  for (std::size_t i = 0; i < first.size(); ++i) {
    double best = none, next = none;
    std::size_t partner = 0;
    for (std::size_t j = 0; j < second.size(); ++j) {
      if (first.keypoints[i].laplacian != second.keypoints[j].laplacian) continue;
      const double distance = squared_distance(first.descriptor(i), second.descriptor(j));
      if (distance < best) {
        next = best;
        best = distance;
        partner = j;
      } else {
        next = std::min(next, distance);
      }
    }
    if (!(best < 0.8 * 0.8 * next)) continue;
    const Place to = pair.map({first.keypoints[i].x, first.keypoints[i].y});
    ++matches.found;
    if (std::hypot(to.x - second.keypoints[partner].x, to.y - second.keypoints[partner].y) < 5)
      ++matches.correct;
  }
  return matches;
}

}  // namespace vision_bench
