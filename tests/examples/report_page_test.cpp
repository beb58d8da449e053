// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Opens reports in headless Chromium.
#include <cstddef>
#include <string>

#include <doctest/doctest.h>

#include "examples/synthetic_run.hpp"
#include "outputs.hpp"
#include "support/browser.hpp"
#include "support/folder.hpp"
#include "support/report.hpp"

namespace report_page_test {
namespace {

bool can_open() {
  if (!example::has_report_page())
    MESSAGE("skipped: built without the page (npm)");
  else if (!cairn_test::has_chromium())
    MESSAGE("skipped: no chromium");
  else
    return true;
  return false;
}

void check_opens(const stereo_slam::RunRecord& run, const std::string& name, std::size_t plots,
                 std::size_t clouds) {
  const cairn_test::Folder folder;
  REQUIRE_FALSE(stereo_slam::write_outputs(run, folder.path()));
  const cairn_test::OpenedPage opened = cairn_test::open_page(folder, folder / "report.html");
  CHECK(opened.console == "");
  CHECK(opened.has("data-panels=\"8\""));
  CHECK(opened.count("class=\"uplot") == plots);
  CHECK(opened.count("class=\"cloud\"") == clouds);
  CHECK(cairn_test::keep_picture(folder, folder / "report.html", name));
}

}  // namespace

TEST_SUITE_BEGIN("examples/report page");

TEST_CASE("report page: a run with truth opens without a word on the console") {
  if (can_open()) check_opens(cairn_test::circular_run(400, 4000), "circle", 6, 1);
}

TEST_CASE("report page: a run without truth, landmarks and sample opens as well") {
  if (!can_open()) return;
  auto run = cairn_test::straight_run(12);
  for (auto& frame : run.frames) frame.truth.reset();
  run.frames[5].tracked = false;
  run.notes = {"frame 5 was lost", "<b>no markup</b>"};
  check_opens(run, "bare", 3, 1);
}

TEST_CASE("report page: 4000 frames and 20000 landmarks open") {
  if (can_open()) check_opens(cairn_test::circular_run(4000, 20000, 10), "large", 6, 1);
}

TEST_SUITE_END();

}  // namespace report_page_test
