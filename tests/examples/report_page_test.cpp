// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Opens reports in headless Chromium. CAIRN_SCREENSHOTS names a folder for pictures of them.
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>

#include <doctest/doctest.h>

#include <cairn/io/file.hpp>

#include "examples/synthetic_run.hpp"
#include "outputs.hpp"
#include "support/folder.hpp"
#include "support/report.hpp"

namespace report_page_test {
namespace {

struct Opened {
  std::string document;  ///< after the scripts have run
  std::string console;   ///< what they said
};

bool has_chromium() {
  return std::system("command -v chromium >/dev/null 2>&1") == 0;
}

int chromium(const cairn_test::Folder& folder, const std::string& more) {
  const std::string command =
      "timeout 120 chromium --headless --no-sandbox --disable-gpu-sandbox --use-angle=swiftshader "
      "--enable-unsafe-swiftshader --disable-dev-shm-usage --no-first-run --enable-logging=stderr "
      "--virtual-time-budget=8000 --user-data-dir='" +
      (folder / "profile").string() + "' " + more;
  return std::system(command.c_str());
}

/// The document that Chromium makes of the file, and what it said meanwhile.
Opened open_page(const cairn_test::Folder& folder, const std::filesystem::path& page) {
  const int status =
      chromium(folder, "--dump-dom 'file://" + page.string() + "' >'" + (folder / "dom").string() + "' 2>'" +
                           (folder / "log").string() + "'");
  REQUIRE(status == 0);
  Opened opened{cairn::read_file(folder / "dom"), {}};
  std::istringstream log(cairn::read_file(folder / "log"));
  for (std::string line; std::getline(log, line);)
    if (line.find("CONSOLE") != std::string::npos) opened.console += line + "\n";
  return opened;
}

void keep_picture(const cairn_test::Folder& folder, const std::filesystem::path& page,
                  const std::string& name) {
  const char* pictures = std::getenv("CAIRN_SCREENSHOTS");
  if (pictures == nullptr) return;
  for (const char* theme : {"light", "dark"}) {
    const std::string target = std::string(pictures) + "/" + name + "-" + theme + ".png";
    CHECK(chromium(folder, "--hide-scrollbars --window-size=1280,3400 --screenshot='" + target +
                               "' 'file://" + page.string() + "?theme=" + theme + "' 2>/dev/null") == 0);
  }
}

bool can_open() {
  if (!example::has_report_page())
    MESSAGE("skipped: built without the page (npm)");
  else if (!has_chromium())
    MESSAGE("skipped: no chromium");
  else
    return true;
  return false;
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

void check_opens(const stereo_slam::RunRecord& run, const std::string& name, std::size_t plots,
                 std::size_t clouds) {
  const cairn_test::Folder folder;
  REQUIRE_FALSE(stereo_slam::write_outputs(run, folder.path()));
  const Opened opened = open_page(folder, folder / "report.html");
  CHECK(opened.console == "");
  CHECK(opened.document.find("data-panels=\"8\"") != std::string::npos);
  CHECK(count(opened.document, "class=\"uplot") == plots);
  CHECK(count(opened.document, "class=\"cloud\"") == clouds);
  keep_picture(folder, folder / "report.html", name);
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
