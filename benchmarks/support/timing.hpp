// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Fair timing of several ways to do one job: they take turns, so that a busy or throttled machine slows all
/// of them alike.
///
///   const auto timings = interleave({{"ours", ours, 1000}, {"rival", rival, 1000}});
///   timings[0].median                    seconds per operation
///   ratio(timings[1], timings[0])        how many times slower the rival is: the median over the rounds
///
/// A ratio is taken round by round, between runs that stood next to each other in time; it is steadier than
/// the quotient of two medians.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace cairn_bench {

/// Keeps the compiler from dropping the computation of `value`.
template <class T>
inline void do_not_optimise(const T& value) noexcept {
  asm volatile("" : : "g"(&value) : "memory");
}

/// One way to do the job. `run` does it `operations` times; make that enough work (a microsecond or more) to
/// drown the cost of the call.
struct Contender {
  std::string name;
  std::function<void()> run;
  double operations = 1;
};

/// Seconds per operation of one contender, in every round, their median and the fastest.
struct Timing {
  std::string name;
  std::vector<double> rounds;
  double median = 0;
  double fastest = 0;
};

struct InterleaveOptions {
  int rounds = 15;
  double seconds_per_round = 0.02;  ///< each contender repeats its run until a turn takes about this long
  /// One untimed run before each turn, for sets larger than the caches: what the one before left of caches
  /// and of the machine's tables of pages is not the cost of the next.
  bool run_first = false;
};

/// Times all contenders in turns, in an order that rotates from round to round, after one untimed turn each.
std::vector<Timing> interleave(const std::vector<Contender>& contenders,
                               const InterleaveOptions& options = {});

/// Median over the rounds of slow / fast: 2 says that `slow` takes twice as long. Both must come from one
/// interleave().
double ratio(const Timing& slow, const Timing& fast);

/// Seconds that one call takes.
double seconds_of(const std::function<void()>& run);

/// Whose running is counted: of the calling thread, or of all threads of the process.
enum class Running { thread, process };

/// Seconds so far in which they were running, which a busy machine does not stretch as it does wall time.
double running_seconds(Running whose);

/// Middle value; the mean of the middle two for an even count, and 0 for none.
double median_of(std::vector<double> values);

}  // namespace cairn_bench
