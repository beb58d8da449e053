// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "study/analysis.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <utility>

#include "support/fit.hpp"

namespace cairn_study {
namespace {

constexpr std::size_t grid_size = 64;

std::vector<double> make_grid(const Stream& stream) {
  std::vector<double> grid;
  const double step = static_cast<double>(stream.step);
  const auto steps = static_cast<double>(stream.steps());
  for (std::size_t i = 0; i < grid_size; ++i) {
    const double share = static_cast<double>(i) / (grid_size - 1);
    const double n = std::round(std::pow(steps, share)) * step;
    if (grid.empty() || n > grid.back()) grid.push_back(n);
  }
  return grid;
}

/// Samples' values summed over all steps up to each n of the grid; between samples by straight lines.
std::vector<double> totals(const Drive& drive, const std::vector<double>& grid,
                           const std::function<double(const Sample&)>& value) {
  std::vector<double> sums;
  double sum = 0;
  double points = 0;
  std::size_t next = 0;
  for (const double n : grid) {
    for (; next < drive.samples.size() && drive.samples[next].points <= n; ++next) {
      sum += value(drive.samples[next]) * drive.samples[next].steps;
      points = drive.samples[next].points;
    }
    double rest = 0;
    if (next < drive.samples.size() && n > points) {
      const double share = (n - points) / (drive.samples[next].points - points);
      rest = share * value(drive.samples[next]) * drive.samples[next].steps;
    }
    sums.push_back(sum + rest);
  }
  return sums;
}

/// Mean a step of what was summed, over the steps since half the n: merges come seldom, and shorter means
/// jump.
std::vector<double> means(const std::vector<double>& sums, const std::vector<double>& grid, double step) {
  std::vector<double> result;
  std::size_t half = 0;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    while (2 * grid[half] < grid[i]) ++half;
    const double before = half > 0 ? sums[half - 1] : 0;
    const double from = half > 0 ? grid[half - 1] : 0;
    result.push_back((sums[i] - before) / ((grid[i] - from) / step));
  }
  return result;
}

std::vector<double> quotients(std::vector<double> sums, const std::vector<double>& grid) {
  for (std::size_t i = 0; i < grid.size(); ++i) sums[i] /= grid[i];
  return sums;
}

/// The largest value so far.
std::vector<double> worst(const Drive& drive, const std::vector<double>& grid) {
  std::vector<double> result;
  double largest = 0;
  std::size_t next = 0;
  for (const double n : grid) {
    for (; next < drive.samples.size() && drive.samples[next].points <= n; ++next)
      largest = std::max(largest, drive.samples[next].build + drive.samples[next].search);
    result.push_back(largest);
  }
  return result;
}

/// The value at the last sample up to each n.
std::vector<double> latest(const Drive& drive, const std::vector<double>& grid,
                           const std::function<double(const Sample&)>& value) {
  std::vector<double> result;
  for (const double n : grid) {
    double last = std::nan("");
    for (const Sample& sample : drive.samples)
      if (sample.points <= n) last = value(sample);
    result.push_back(last);
  }
  return result;
}

Curves curves_of(const Stream& stream, const Drive& drive, const std::vector<double>& grid) {
  const auto step = static_cast<double>(stream.step);
  Curves curves;
  curves.total_build = totals(drive, grid, [](const Sample& s) { return s.build; });
  curves.total_search = totals(drive, grid, [](const Sample& s) { return s.search; });
  curves.total = totals(drive, grid, [](const Sample& s) { return s.build + s.search; });
  curves.build = means(curves.total_build, grid, step);
  curves.search = means(curves.total_search, grid, step);
  curves.sum = means(curves.total, grid, step);
  curves.worst = worst(drive, grid);
  curves.bytes = latest(drive, grid, [](const Sample& s) { return s.bytes / s.points; });
  curves.moved = quotients(totals(drive, grid, [](const Sample& s) { return s.moved; }), grid);
  curves.distances = means(totals(drive, grid, [](const Sample& s) { return s.distances; }), grid, step);
  curves.trees = latest(drive, grid, [](const Sample& s) { return s.trees; });
  return curves;
}

/// The estimates of a step at n points: the first tree rebuilt, the further ones
/// amortised.
double theory_of_build(const Stream& stream, const Drive& drive, double n) {
  if (drive.growth == 0) return n * std::log(n);
  const auto step = static_cast<double>(stream.step);
  const double first = std::min(n, static_cast<double>(drive.first_steps) * step);
  const auto q = static_cast<double>(drive.growth);
  const double further_trees = std::log(n / first) / std::log(q);
  return first * std::log(first) + step * q * further_trees * (std::log(n) + std::log(first * q)) / 2;
}

double theory_of_search(const Stream& stream, const Drive& drive, double n) {
  if (drive.growth == 0) return std::log(n);
  const double first = std::min(n, static_cast<double>(drive.first_steps * stream.step));
  const double trees = std::log(n / first) / std::log(static_cast<double>(drive.growth)) + 1;
  return trees * (std::log(n) + std::log(first)) / 2;
}

Growth growth_of(const Stream& stream, const std::vector<double>& grid, const std::vector<double>& total,
                 const std::function<double(double)>& theory) {
  std::vector<double> expected;
  double sum = 0;
  double n = 0;
  for (const double end : grid) {
    for (; n + static_cast<double>(stream.step) <= end; n += static_cast<double>(stream.step))
      sum += theory(n + static_cast<double>(stream.step));
    expected.push_back(sum);
  }
  const auto begin =
      static_cast<std::size_t>(std::lower_bound(grid.begin(), grid.end(), grid.back() / 32) - grid.begin());
  const auto tail = [begin](const std::vector<double>& values) { return std::span(values).subspan(begin); };
  return {cairn_bench::exponent_of(tail(grid), tail(total)) - 1,
          cairn_bench::exponent_of(tail(grid), tail(expected)) - 1};
}

Result result_of(const Stream& stream, const std::vector<double>& grid, Drive drive) {
  Result result;
  result.curves = curves_of(stream, drive, grid);
  const bool is_scan = drive.growth == 0 && drive.samples.back().trees == 0;
  result.build = growth_of(stream, grid, result.curves.total_build, [&](double n) {
    return is_scan ? static_cast<double>(stream.step) : theory_of_build(stream, drive, n);
  });
  result.search = growth_of(stream, grid, result.curves.total_search,
                            [&](double n) { return is_scan ? n : theory_of_search(stream, drive, n); });
  for (const Sample& sample : drive.samples) result.worst_build = std::max(result.worst_build, sample.build);
  result.drive = std::move(drive);
  return result;
}

}  // namespace

double total_time(const Drive& drive) {
  double sum = 0;
  for (const Sample& sample : drive.samples) sum += (sample.build + sample.search) * sample.steps;
  return sum;
}

Study analyse(Stream stream, std::vector<Drive> drives) {
  Study study;
  study.grid = make_grid(stream);
  for (Drive& drive : drives) study.results.push_back(result_of(stream, study.grid, std::move(drive)));
  const std::vector<double>& single = study.results.front().curves.total;
  const std::vector<double>& scan = study.results.back().curves.total;
  for (Result& result : study.results) {
    result.below_single = cairn_bench::crossing(study.grid, result.curves.total, single);
    result.below_scan = cairn_bench::crossing(study.grid, result.curves.total, scan);
  }
  stream.rows.clear();  // the points themselves are not needed any more
  stream.rows.shrink_to_fit();
  study.stream = std::move(stream);
  return study;
}

}  // namespace cairn_study
