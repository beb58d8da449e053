// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The page that each program leaves of a small run, as a reader sees it.
#include <filesystem>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>

#include "support/data.hpp"
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

/// The pages of programs, looked at in one visit of the browser at the end.
class Pages {
public:
  void add(const std::string& program, const std::string& arguments) {
    if (is_built(program)) add(program, CAIRN_EXAMPLE_FOLDER "/" + program, arguments, "report.html");
  }
  /// The same of a program that is elsewhere, or whose page has another name.
  void add(const std::string& program, const std::string& path, const std::string& arguments,
           const std::string& page) {
    const std::filesystem::path out = folder_ / (program + std::to_string(pages_.size()));
    const auto outcome =
        cairn_test::run_program("'" + path + "' " + arguments + " --out '" + out.string() + "'");
    CAPTURE(program);
    CAPTURE(outcome.words);
    REQUIRE(outcome.code == 0);
    REQUIRE(cairn_test::keep_picture(folder_, out / page, program));
    pages_.push_back(out / page);
  }
  void check() const { cairn_test::check_pages(pages_); }
  [[nodiscard]] const cairn_test::Folder& folder() const { return folder_; }

private:
  cairn_test::Folder folder_;
  std::vector<std::filesystem::path> pages_;
};

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

TEST_CASE("the page of every program opens without a word on the console, and axe finds nothing") {
  if (!cairn_test::can_open_pages()) return;
  Pages pages;
  pages.add("stereo_slam", "--frames 6");
  pages.add("grid_slam", "--simulate --particles 3 --seed 5");
  pages.add("gamma_slam", "--particles 2 --laps 1 --seed 5");
  // Posts that are known, and posts that are not.
  pages.add("fastslam", "--particles 9 --frames 60 --seed 5");
  pages.add("fastslam", "--particles 9 --frames 60 --seed 5 --identities withheld");
  pages.add("line_slam", "--particles 5 --metres 15 --seed 5 --quiet");
  pages.add("correlation_navigation", "--runs 2 --starts 2 --seed 5");
  // Several estimates in one picture.
  std::string files;
  for (const auto& [name, sigma] : {std::pair{"truth.tum", 0.0}, {"near.tum", 0.05}, {"far.tum", 0.5}}) {
    pages.folder().put(name, walk(sigma));
    files += "'" + (pages.folder() / name).string() + "' ";
  }
  pages.add("cairn_eval", files);
#if defined(EXAMPLES_HAVE_YAML) && defined(EXAMPLES_HAVE_JPEG)
  if (const auto data = cairn_test::real_data("stereo_pairs")) {
    const std::string boards = (*data / "opencv-chessboard-stereo").string();
    pages.add("calibrate_stereo",
              "--left '" + boards + "/left0[1-5].jpg' --right '" + boards + "/right0[1-5].jpg'");
  }
#endif
#ifdef CAIRN_STUDY_PROGRAM
  pages.add("index_study", CAIRN_STUDY_PROGRAM, "--brief", "index_study.html");
#else
  MESSAGE("skipped: no program index_study (CAIRN_BUILD_BENCHMARKS)");
#endif
  pages.check();
}

TEST_SUITE_END();

}  // namespace programs_page_test
