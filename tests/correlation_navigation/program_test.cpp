// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The program as a user meets it: its exit code, its words and what it leaves behind.
#include <csignal>
#include <filesystem>
#include <set>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/version.hpp>

#include "support/folder.hpp"
#include "support/program_checks.hpp"

namespace correlation_program_test {
namespace {

namespace fs = std::filesystem;
using cairn_test::names_in;
using cairn_test::Outcome;

const std::string program = CORRELATION_NAVIGATION_PROGRAM;

Outcome run(const std::string& arguments, const std::string& standard_output = "") {
  return cairn_test::run_program("\"" + program + "\" " + arguments, standard_output);
}

std::set<std::string> results() {
  return cairn_test::with_report({"summary.json", "errors.csv", "timing.json"});
}

}  // namespace

TEST_SUITE("correlation_navigation/program") {
  TEST_CASE("correlation_navigation: a mistake is exit code 2 and a line") {
    cairn_test::check_mistakes(
        [](const std::string& mistake) { return run(mistake); },
        {"--nonsense", "--runs 0", "--runs -3", "--starts many", "--threads 0", "--seed -1", "--spacing nan",
         "--spacing 0", "--spacing inf", "--out", "somewhere"});
  }

  TEST_CASE("correlation_navigation: --version and --help say what they are asked, or that they cannot") {
    cairn_test::check_version_and_help(run, "correlation_navigation " CAIRN_VERSION_STRING "\n", "--terrain");
  }

  TEST_CASE("correlation_navigation: a terrain that cannot be read is named, and nothing is left behind") {
    const cairn_test::Folder folder;
    folder.put("bad.pgm", "P5 2 2 255\nabc");
    for (const char* name : {"none.tif", "bad.pgm"}) {
      const Outcome outcome =
          run("--terrain \"" + (folder / name).string() + "\" --out \"" + (folder / "out").string() + "\"");
      CHECK(outcome.code == 2);
      CHECK(outcome.says((folder / name).string() + ": "));
    }
    CHECK_FALSE(fs::exists(folder / "out"));
  }

  TEST_CASE(
      "correlation_navigation: says how far it is, and the same seed gives the same bytes but for times") {
    const cairn_test::Folder folder;
    for (const std::string out : {"1", "2"}) {
      const Outcome outcome =
          run("--runs 2 --starts 2 --seed 5 --threads " + out + " --out \"" + (folder / out).string() + "\"");
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      CHECK(names_in(folder / out) == results());
      for (const char* experiment : {"straight flight 100 %", "error budget 100 %", "divergence 100 %",
                                     "acquisition 100 %", "flight with turns 100 %", "loop 100 %"})
        CHECK(outcome.says(experiment));
    }
    cairn_test::check_same_bytes(folder / "1", folder / "2", results());
    const auto timing = nlohmann::json::parse(cairn::read_file(folder / "2" / "timing.json"));
    CHECK(timing["threads"] == 2);
    CHECK(timing["seconds"].get<double>() > 0);
    CHECK(timing["experiment_seconds"].size() == 6);
  }

  TEST_CASE("correlation_navigation: interrupted, it writes the experiments that are complete") {
    const cairn_test::Folder folder;
    const auto interrupt = [&](int lines) {
      return cairn_test::interrupt_program(
          {program, "--runs", "20", "--starts", "2", "--out", (folder / "out").string()}, {SIGTERM}, lines);
    };
    CHECK(interrupt(1) == 4);  // in the first one
    CHECK(names_in(folder / "out").empty());
    CHECK(interrupt(11) == 4);  // in the second
    CHECK(names_in(folder / "out") == results());
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(summary["ended_early"] == "ended in error budget: interrupted (SIGTERM)");
    CHECK(summary["rmse_over_crb"].is_number());
    CHECK(summary["error_budget"].empty());
    for (const char* missing : {"acquisition_rate", "acquisition_rms_error_m", "planar", "loop"})
      CHECK(summary[missing].is_null());
  }
}

}  // namespace correlation_program_test
