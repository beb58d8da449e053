// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the twelve programs of the course share, so that a lesson holds nothing but its subject: a command
/// line, a verdict that can turn red, and a page.
///
///   example::Lesson lesson({.name = "04_banana", .title = "...", .sentence = "...", .steps = 100,
///                           .least_steps = 10, .most_steps = 1000,
///                           .mistakes = {{"wrap", "residual not wrapped: seen in", "Lost at 180."}}},
///                          argc, argv);
///   ...
///   lesson.verdict("NEES", nees.mean(), band.low, band.high, "3 where the filter knows how wrong it is");
///   lesson.add(example::PlaneFilm{...});
///   return lesson.finish();
///
/// A verdict judges by an oracle. Each mistake is a bug that famous material had; it is planted where the
/// program asks `lesson.mistake("wrap")`, and has to turn the verdict red. Exit codes: 0 green, 1 red, 2 bad
/// arguments or results that cannot be written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <cairn/core/statistics.hpp>

#include "support/report.hpp"

namespace example {

/// A bug that can be planted with --mistake=NAME.
struct Mistake {
  std::string name;       ///< "drop-correlations"
  std::string what;       ///< one line: the bug, and where it was really seen
  std::string look = {};  ///< a sentence: what it does to the page
};

struct LessonInfo {
  std::string name;         ///< of the program: "01_building_height"
  std::string title;        ///< of the page
  std::string sentence;     ///< what is learned
  std::size_t steps = 100;  ///< without --steps
  std::size_t least_steps = 1;
  std::size_t most_steps = 100000;
  std::vector<Mistake> mistakes = {};
};

/// A table that is kept row by row, and one of its columns.
using Rows = std::vector<std::vector<double>>;
[[nodiscard]] std::vector<double> column(const Rows& rows, std::size_t index);

class Lesson {
public:
  /// Parses --seed, --steps, --out, --mistake, --quiet, --about, --help and --version. Ends the program where
  /// those ask for words only (exit code 0) or cannot be understood (a sentence, 2). From then on an
  /// exception that leaves main ends it with a sentence and 2.
  Lesson(LessonInfo info, int argc, char** argv);

  [[nodiscard]] std::uint64_t seed() const noexcept { return seed_; }
  [[nodiscard]] std::size_t steps() const noexcept { return steps_; }

  /// Whether this mistake is to be made. Throws cairn::Error where the lesson did not list the name.
  [[nodiscard]] bool mistake(std::string_view name) const;

  /// One line of the summary.
  void say(std::string_view line) const;

  /// Judges a number: right from `low` to `high`, both included, and wrong otherwise, as NaN is. Printed, and
  /// a key figure of the page.
  void verdict(const std::string& name, double value, double low, double high, const std::string& hint = {});

  void verdict(const std::string& name, double value, const cairn::ConsistencyBand& band,
               const std::string& hint = {}) {
    verdict(name, value, band.low, band.high, hint);
  }

  /// A number of the page without a verdict.
  void figure(KeyFigure figure) { report_.figure(std::move(figure)); }

  /// A panel of the page: anything that Report::add takes.
  template <class Panel>
  void add(const Panel& panel) {
    report_.add(panel);
  }

  /// The file NAME.csv among the results. Throws cairn::Error where a row has another number of values than
  /// there are columns.
  void csv(const std::string& name, const std::vector<std::string>& columns, const Rows& rows);

  /// A file of this name and text among the results.
  void file(const std::string& name, const std::string& text) { tables_.push_back({name, text}); }

  /// Writes page and tables, prints "verdict: green" or "verdict: RED (names)", and returns the exit code. A
  /// lesson without a verdict is red.
  [[nodiscard]] int finish();

private:
  struct Table {
    std::string file;
    std::string text;
  };
  void write_results();

  LessonInfo info_;
  std::uint64_t seed_ = 1;
  std::size_t steps_ = 0;
  std::filesystem::path out_;
  std::string planted_;  // the mistake, or nothing
  bool quiet_ = false;
  Report report_;
  std::size_t verdicts_ = 0;
  std::vector<std::string> wrong_;  // names of the verdicts
  std::vector<Table> tables_;
};

}  // namespace example
