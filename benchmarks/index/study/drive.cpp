// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "study/drive.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <cairn/core/random.hpp>

#include "support/timing.hpp"

namespace cairn_study {
namespace {

/// On a machine with other work the wall clock says little.
double cpu_seconds() {
  return cairn_bench::running_seconds(cairn_bench::Running::thread);
}

double distance(const float* a, const float* b, std::size_t dim) {
  double sum = 0;
  for (std::size_t i = 0; i < dim; ++i) {
    const double difference = double{a[i]} - double{b[i]};
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

constexpr std::size_t queries_checked = 30;
constexpr double ratio = 0.8;

/// The steps at which answers are checked.
std::vector<std::size_t> checked_steps(const Stream& stream) {
  std::vector<std::size_t> steps;
  for (std::size_t i = 1; i <= 5; ++i) steps.push_back(stream.steps() * i / 5 - 1);
  return steps;
}

bool same(double a, double b) {
  return std::abs(a - b) <= 2e-4 * b + 1e-6;
}

void check(const Stream& stream, const Truth& truth, std::size_t step, Store& store, bool exact,
           Drive& drive) {
  std::vector<float> query(stream.dim);
  const cairn::Work before = store.work;
  for (const Truth::Query& expected : truth.queries) {
    if (expected.step != step) continue;
    const std::size_t present = (step + 1) * stream.step;
    stream.make_query(step, expected.number, present, query.data());
    const Found found = store.search(query.data());
    ++drive.checked;
    if (found.id >= present) {
      ++drive.wrong;
      continue;
    }
    const double first = distance(query.data(), &stream.rows[found.id * stream.dim], stream.dim);
    const bool nearest = same(first, expected.first);
    drive.wrong += !same(double{found.first}, first) || first < expected.first * (1 - 1e-6) ||
                   (exact && (!nearest || !same(double{found.second}, expected.second)));
    const bool is_match = expected.first <= ratio * expected.second;
    drive.matches += is_match;
    drive.kept += is_match && nearest && double{found.first} <= ratio * double{found.second};
  }
  store.work = before;
}

}  // namespace

void Stream::make_query(std::size_t step_number, std::size_t i, std::size_t present, float* query) const {
  cairn::Random random(step_number, i);
  const bool new_one = i % 2 == 1;
  const std::size_t source = new_one ? points() + random.below(held_back) : random.below(present);
  for (std::size_t a = 0; a < dim; ++a) {
    query[a] = rows[source * dim + a];
    if (!new_one) query[a] += noise * static_cast<float>(random.normal());
  }
}

Truth make_truth(const Stream& stream) {
  Truth truth;
  std::vector<float> query(stream.dim);
  for (const std::size_t step : checked_steps(stream))
    for (std::size_t number = 0; number < queries_checked; ++number) {
      const std::size_t present = (step + 1) * stream.step;
      stream.make_query(step, number, present, query.data());
      Truth::Query answer{step, number, std::numeric_limits<double>::infinity(),
                          std::numeric_limits<double>::infinity()};
      for (std::size_t i = 0; i < present; ++i) {
        const double to_point = distance(query.data(), &stream.rows[i * stream.dim], stream.dim);
        if (to_point < answer.first) {
          answer.second = answer.first;
          answer.first = to_point;
        } else if (to_point < answer.second) {
          answer.second = to_point;
        }
      }
      truth.queries.push_back(answer);
    }
  return truth;
}

Drive run(const Stream& stream, const Truth& truth, Store& store, const RunOptions& options,
          const std::function<void()>& progress) {
  Drive drive;
  const std::size_t timed = std::min(options.timed, stream.timed);
  std::vector<float> queries(timed * stream.dim);
  std::vector<Found> answers(timed);
  std::uint64_t moved = 0;
  const std::vector<std::size_t> checks = checked_steps(stream);
  double sampled = 0;  // steps up to the last one timed
  for (std::size_t step = 0; step < stream.steps(); ++step, progress()) {
    const auto rows =
        std::span(stream.rows).subspan(step * stream.step * stream.dim, stream.step * stream.dim);
    const std::size_t present = (step + 1) * stream.step;
    const bool is_checked = std::find(checks.begin(), checks.end(), step) != checks.end();
    const auto steps = static_cast<double>(step + 1);
    if (steps < sampled * (1 + options.gap) && !is_checked) {
      store.stage(rows);
      continue;
    }
    for (std::size_t i = 0; i < timed; ++i) stream.make_query(step, i, present, &queries[i * stream.dim]);
    Sample sample;
    sample.points = static_cast<double>(present);
    sample.steps = steps - std::exchange(sampled, steps);
    moved = store.points_moved();
    const std::uint64_t distances = store.work.distances;
    double begin = cpu_seconds();
    store.insert(rows);
    sample.build = cpu_seconds() - begin;
    begin = cpu_seconds();
    for (std::size_t i = 0; i < timed; ++i) answers[i] = store.search(&queries[i * stream.dim]);
    sample.search =
        (cpu_seconds() - begin) * static_cast<double>(stream.queries) / static_cast<double>(timed);
    sample.bytes = static_cast<double>(store.bytes());
    sample.moved = static_cast<double>(store.points_moved() - moved);
    sample.distances = static_cast<double>(store.work.distances - distances) / static_cast<double>(timed);
    sample.trees = static_cast<double>(store.trees());
    drive.samples.push_back(sample);
    if (is_checked) check(stream, truth, step, store, options.exact, drive);
  }
  return drive;
}

}  // namespace cairn_study
