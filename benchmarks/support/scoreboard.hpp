// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The table that `scripts/scoreboard AREA` prints: what was measured, beside what is owed and what is hoped
/// for.
///
///   Scoreboard board("index");
///   board.add({.name = "nearest 1, uniform", .measured = 2.1, .unit = "x", .must = 1.3, .aim = 2.0, .better
///   = larger,
///              .rival = 1.2, .rival_name = "nanoflann", .note = "0.57 us against 1.20 us"});
///   board.add(against_rival("build", ours_seconds, rival_seconds, "FLANN", 1.5, 2.5));
///   return board.finish();
///
/// finish() writes $CAIRN_SCOREBOARD_DIR/<area>.json (build/scoreboard by default):
///   {"area", "context", "rows": [{"name", "measured", "unit", "must", "aim", "met", "verdict", "rival",
///   "rival_name", "note"}]}
/// with "met" true, false, or null where nothing was measured.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "support/timing.hpp"

namespace cairn_bench {

enum class Better { smaller, larger };
using enum Better;

/// Exit code of a program whose command line asks for --help or --version, or names what is none of `parts`
/// (2); nothing where it is to run. The parts named are a program's to find.
std::optional<int> answer(int argc, char** argv, const std::string& program,
                          std::initializer_list<std::string_view> parts = {});

/// Where scoreboards put what they make: $CAIRN_SCOREBOARD_DIR, build/scoreboard by default.
std::filesystem::path output_folder();

/// Hands everything printed to whoever reads it; says on standard error where that fails, and returns false.
bool flush_standard_output(const std::string& program);

/// One line of the table. A row without a measurement carries the reason in `note`: "no data" or "no rival".
struct Row {
  std::string name{};
  std::optional<double> measured{};
  std::string unit{};
  std::optional<double> must{};
  std::optional<double> aim{};
  Better better = smaller;
  std::optional<double> rival{};
  std::string rival_name{};
  std::string note{};
};

/// "met aim", "met must" or "missed"; "reported" for a row without figures; "no data" or "no rival" (or
/// whatever the note says first) for a row without a measurement.
std::string verdict(const Row& row);

/// The required figure is reached: `must`, or `aim` where there is no must. Nothing without a measurement or
/// a figure.
std::optional<bool> met(const Row& row);

/// A row relative to a rival in the same run: measured is rival / ours (how many times faster, or smaller),
/// the note keeps both numbers in `unit`. Without a rival the row says "no rival" and keeps our number in the
/// note.
Row against_rival(const std::string& name, double ours, std::optional<double> rival,
                  const std::string& rival_name, std::optional<double> must, std::optional<double> aim,
                  const std::string& unit = "s");

/// CPU, cores, compiler, flags: what a reader needs to judge a time.
struct Context {
  std::string cpu;
  unsigned threads = 0;
  std::string compiler;
  std::string flags;
};
Context context();

class Scoreboard {
public:
  explicit Scoreboard(std::string area);

  /// Prints the row at once, so that a long run can be watched.
  void add(Row row);

  [[nodiscard]] const std::vector<Row>& rows() const noexcept { return rows_; }

  /// Prints the aligned table and writes the JSON file. Returns the exit code: 0 also when rows are missed (a
  /// scoreboard reports), 1 when the file or the table cannot be written.
  [[nodiscard]] int finish() const;

private:
  std::string area_;
  std::vector<Row> rows_;
};

}  // namespace cairn_bench
