// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The page that each program leaves of a small run, as a reader sees it.
#include <cstddef>
#include <sstream>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>

#include "support/folder.hpp"
#include "support/page_check.hpp"
#include "support/program.hpp"

namespace programs_page_test {
namespace {

/// Whether the program was built: it is left out where what it needs is missing.
bool is_built(const std::string& program) {
  const std::string all = "," CAIRN_PAGE_PROGRAMS ",";
  if (all.find("," + program + ",") != std::string::npos) return true;
  MESSAGE("skipped: no program " << program);
  return false;
}

/// Runs the program and looks at its page.
void check_page_of(const std::string& program, const std::string& arguments) {
  if (!cairn_test::can_open_pages() || !is_built(program)) return;
  const cairn_test::Folder folder;
  const auto outcome = cairn_test::run_program("'" CAIRN_EXAMPLE_FOLDER "/" + program + "' " + arguments +
                                               " --out '" + (folder / "out").string() + "'");
  CAPTURE(outcome.words);
  REQUIRE(outcome.code == 0);
  REQUIRE(cairn_test::keep_picture(folder, folder / "out" / "report.html", program));
  cairn_test::check_page(folder / "out" / "report.html");
}

/// A walk of 60 steps in the format TUM, every place off by `sigma` or so.
std::string walk(double sigma) {
  cairn::Random random(5);
  std::ostringstream text;
  for (int i = 0; i < 60; ++i)
    text << 0.5 * i << ' ' << i + random.normal(0, sigma) << ' ' << 0.02 * i * i << " 0 0 0 0 1\n";
  return text.str();
}

}  // namespace

TEST_SUITE_BEGIN("pages/programs");

TEST_CASE("page of stereo_slam") {
  check_page_of("stereo_slam", "--frames 6");
}

TEST_CASE("page of grid_slam") {
  check_page_of("grid_slam", "--simulate --particles 3 --seed 5");
}

TEST_CASE("page of gamma_slam") {
  check_page_of("gamma_slam", "--particles 2 --laps 1 --seed 5");
}

TEST_CASE("page of fastslam: posts that are known, and posts that are not") {
  check_page_of("fastslam", "--particles 9 --frames 60 --seed 5");
  check_page_of("fastslam", "--particles 9 --frames 60 --seed 5 --identities withheld");
}

TEST_CASE("page of line_slam") {
  check_page_of("line_slam", "--particles 5 --metres 15 --seed 5 --quiet");
}

TEST_CASE("page of correlation_navigation") {
  check_page_of("correlation_navigation", "--runs 2 --starts 2 --seed 5");
}

TEST_CASE("page of cairn_eval: several estimates in one picture") {
  const cairn_test::Folder folder;
  folder.put("truth.tum", walk(0));
  folder.put("near.tum", walk(0.05));
  folder.put("far.tum", walk(0.5));
  const auto named = [&](const char* name) { return " '" + (folder / name).string() + "'"; };
  check_page_of("cairn_eval", named("truth.tum") + named("near.tum") + named("far.tum"));
}

TEST_SUITE_END();

}  // namespace programs_page_test
