// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What every example program promises.
#pragma once

#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/io/file.hpp>

#include "support/program.hpp"
#include "support/report.hpp"

namespace cairn_test {

/// Each of the command lines ends with exit code 2 and between 10 and `most` letters.
template <class Run>
void check_mistakes(const Run& run, const std::vector<std::string>& mistakes, std::size_t most = 200) {
  for (const std::string& mistake : mistakes) {
    CAPTURE(mistake);
    const Outcome outcome = run(mistake);
    CAPTURE(outcome.words);
    CHECK(outcome.code == 2);
    CHECK(outcome.words.size() > 10);
    CHECK(outcome.words.size() < most);
  }
}

/// --version and --help say what they are asked (`option` among it, and defaults), or that they cannot.
template <class Run>
void check_version_and_help(const Run& run, const std::string& version, const std::string& option) {
  CHECK(run("--version", "").code == 0);
  CHECK(run("--version", "").words == version);
  CHECK(run("--help", "").code == 0);
  CHECK(run("--help", "").says(option));
  CHECK(run("--help", "").says("=" + version.substr(0, version.find(' ')) + "_out"));
  for (const char* asked : {"--version", "--help"}) {
    const Outcome outcome = run(asked, "/dev/full");
    CHECK(outcome.code == 2);
    CHECK(outcome.says("cannot write to the standard output (No space left on device)"));
  }
}

/// The files named and, where the programs have one, the report.
inline std::set<std::string> with_report(std::set<std::string> names) {
  if (example::has_report_page()) names.insert("report.html");
  return names;
}

/// Two runs left the same bytes in all of `names` but timing.json.
inline void check_same_bytes(const std::filesystem::path& one, const std::filesystem::path& other,
                             const std::set<std::string>& names) {
  for (const std::string& name : names) {
    CAPTURE(name);
    CHECK((cairn::read_file(one / name) == cairn::read_file(other / name)) == (name != "timing.json"));
  }
}

}  // namespace cairn_test
