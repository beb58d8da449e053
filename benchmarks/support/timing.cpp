// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/timing.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <ctime>

#include <cairn/core/check.hpp>

namespace cairn_bench {
namespace {

double seconds_of_repeats(const Contender& contender, int repeats) {
  return seconds_of([&] {
    for (int i = 0; i < repeats; ++i) contender.run();
  });
}

/// Repeats that fill a turn; running them to find out also warms caches and branch predictors.
int repeats_for(const Contender& contender, double seconds) {
  int repeats = 1;
  double taken = seconds_of_repeats(contender, repeats);
  while (taken < seconds / 4 && repeats < (1 << 28)) {
    repeats *= 2;
    taken = seconds_of_repeats(contender, repeats);
  }
  return std::max(1, static_cast<int>(std::ceil(repeats * seconds / std::max(taken, seconds / 4))));
}

}  // namespace

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

double seconds_of(const std::function<void()>& run) {
  const auto start = std::chrono::steady_clock::now();
  run();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double running_seconds(Running whose) {
  timespec now{};
  clock_gettime(whose == Running::thread ? CLOCK_THREAD_CPUTIME_ID : CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::vector<Timing> interleave(const std::vector<Contender>& contenders, const InterleaveOptions& options) {
  std::vector<Timing> timings;
  std::vector<int> repeats;
  for (const Contender& contender : contenders) {
    timings.push_back({contender.name, {}, 0, 0});
    repeats.push_back(repeats_for(contender, options.seconds_per_round));
  }
  for (int round = 0; round < std::max(1, options.rounds); ++round)
    for (std::size_t turn = 0; turn < contenders.size(); ++turn) {
      const std::size_t i = (turn + static_cast<std::size_t>(round)) % contenders.size();
      const double operations = contenders[i].operations * repeats[i];
      if (options.run_first) contenders[i].run();
      timings[i].rounds.push_back(seconds_of_repeats(contenders[i], repeats[i]) / operations);
    }
  for (Timing& timing : timings) {
    timing.median = median_of(timing.rounds);
    timing.fastest = *std::min_element(timing.rounds.begin(), timing.rounds.end());
  }
  return timings;
}

double ratio(const Timing& slow, const Timing& fast) {
  CAIRN_EXPECTS(slow.rounds.size() == fast.rounds.size(), "a ratio needs two timings of one interleave()");
  std::vector<double> quotients;
  for (std::size_t i = 0; i < slow.rounds.size(); ++i) quotients.push_back(slow.rounds[i] / fast.rounds[i]);
  return median_of(std::move(quotients));
}

}  // namespace cairn_bench
