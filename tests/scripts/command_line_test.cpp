// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The scripts as a user meets them. None of these calls installs, builds or measures anything.
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/version.hpp>

#include "support/program.hpp"

namespace script_test {
namespace {

using cairn_test::Outcome;

Outcome run(const std::string& command, const std::string& standard_output = "") {
  return cairn_test::run_program("CAIRN_SKIP_INSTALL=1 \"" CAIRN_SCRIPTS "\"/" + command, standard_output);
}

const std::vector<std::string> scripts{"benchmark",  "docs",   "check_headers", "check_layers",
                                       "check_tidy", "course", "include_cost",  "install",
                                       "scoreboard", "test",   "mutants",       "ci-full"};

}  // namespace

TEST_SUITE("scripts") {
  TEST_CASE("scripts: --version and --help answer and end well, wherever they stand") {
    for (const std::string& script : scripts) {
      CAPTURE(script);
      const Outcome version = run(script + " --version");
      CHECK(version.code == 0);
      CHECK(version.words == "cairn " CAIRN_VERSION_STRING "\n");
      const Outcome help = run(script + " --help");
      CHECK(help.code == 0);
      CHECK(help.says("scripts/" + script));
    }
    CHECK(run("scoreboard main_job --help").words == run("scoreboard --help").words);
    CHECK(run("scoreboard index --preset release low -h").words == run("scoreboard --help").words);
    CHECK(run("demo --frames 3 --version").words == "cairn " CAIRN_VERSION_STRING "\n");
    CHECK(run("demo --help").code == 0);
    CHECK(run("benchmark --full --version").words == "cairn " CAIRN_VERSION_STRING "\n");
  }

  TEST_CASE("scripts: what they do not know is exit code 2 and a line that names it") {
    std::vector<std::string> mistakes;
    for (const std::string& script : scripts) mistakes.push_back(script + " --nonsense");
    for (const char* mistake : {"check_headers nonsense",
                                "mutants nonsense",
                                "fuzz",
                                "fuzz nonsense",
                                "install",
                                "install nonsense",
                                "install test nonsense",
                                "scoreboard",
                                "scoreboard nonsense",
                                "scoreboard main_job nonsense",
                                "scoreboard index low nonsense",
                                "scoreboard fastslam robots nonsense",
                                "scoreboard index --preset nonsense",
                                "benchmark --only",
                                "benchmark --preset nonsense",
                                "include_cost nonsense",
                                "include_cost cairn/nonsense.hpp",
                                "course nonsense",
                                "course 01 nonsense",
                                "course 01 --seed nonsense",
                                "course 01 --steps=nonsense",
                                "course --seed"})
      mistakes.emplace_back(mistake);
    for (const std::string& mistake : mistakes) {
      CAPTURE(mistake);
      const Outcome outcome = run(mistake);
      CAPTURE(outcome.words);
      CHECK(outcome.code == 2);
      const bool names = outcome.says("nonsense") || outcome.says("expected") || outcome.says("needs");
      CHECK(names);
      CHECK(outcome.words.size() < 400);
    }
  }

  TEST_CASE("scripts: words that do not get through are no success") {
    for (const std::string& script : scripts) {
      CAPTURE(script);
      if (script == "check_layers" || script == "include_cost")
        continue;  // Python's argparse keeps it to itself
      CHECK(run(script + " --version", "/dev/full").code != 0);
    }
  }
}

}  // namespace script_test
