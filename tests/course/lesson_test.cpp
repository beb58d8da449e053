// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What the lessons share: as a library, and as a program that its user meets.
#include "support/lesson.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/io/file.hpp>
#include <cairn/version.hpp>

#include "support/folder.hpp"
#include "support/program.hpp"

namespace lesson_test {
namespace {

using cairn_test::message_of;
using cairn_test::Outcome;

/// A lesson of this command line whose results go to `folder`, silent.
struct Started {
  explicit Started(const cairn_test::Folder& folder, std::vector<std::string> more = {})
      : words{"lesson", "--quiet", "--out", (folder / "out").string()} {
    words.insert(words.end(), more.begin(), more.end());
    for (std::string& word : words) arguments.push_back(word.data());
  }
  [[nodiscard]] example::Lesson lesson() {
    return {{.name = "00_test",
             .title = "title",
             .sentence = "sentence",
             .steps = 7,
             .mistakes = {{"swap", "two things changed places"}}},
            static_cast<int>(arguments.size()),
            arguments.data()};
  }
  std::vector<std::string> words;
  std::vector<char*> arguments;
};

const std::string first_lesson = std::string("'") + CAIRN_LESSON_FOLDER + "/01_building_height'";

}  // namespace

TEST_SUITE_BEGIN("course/lesson");

TEST_CASE("lesson: a number inside its band, edges included, is green") {
  const cairn_test::Folder folder;
  example::Lesson lesson = Started(folder).lesson();
  lesson.verdict("low", 1, 1, 2);
  lesson.verdict("high", 2, 1, 2);
  CHECK(lesson.finish() == 0);
}

TEST_CASE("lesson: one number outside its band, or NaN, is red") {
  for (const double wrong :
       {0.999, 2.001, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    CAPTURE(wrong);
    const cairn_test::Folder folder;
    example::Lesson lesson = Started(folder).lesson();
    lesson.verdict("right", 1, 1, 2);
    lesson.verdict("wrong", wrong, 1, 2);
    CHECK(lesson.finish() == 1);
  }
}

TEST_CASE("lesson: one that judged nothing is red") {
  const cairn_test::Folder folder;
  CHECK(Started(folder).lesson().finish() == 1);
}

TEST_CASE("lesson: options reach it, and only the planted mistake is made") {
  const cairn_test::Folder folder;
  const example::Lesson plain = Started(folder).lesson();
  CHECK(plain.steps() == 7);
  CHECK(plain.seed() == 1);
  CHECK_FALSE(plain.mistake("swap"));
  const example::Lesson lesson =
      Started(folder, {"--steps", "9", "--seed", "18446744073709551615", "--mistake", "swap"}).lesson();
  CHECK(lesson.steps() == 9);
  CHECK(lesson.seed() == std::numeric_limits<std::uint64_t>::max());
  CHECK(lesson.mistake("swap"));
  CHECK(message_of([&] { static_cast<void>(lesson.mistake("swop")); }).find("no mistake \"swop\"") !=
        std::string::npos);
}

TEST_CASE("lesson: tables are files of their name, and a row that does not fit is refused") {
  const cairn_test::Folder folder;
  example::Lesson lesson = Started(folder).lesson();
  lesson.csv("table", {"a", "b"}, {{1, 2}, {0.5, -3}});
  CHECK(message_of([&] { lesson.csv("torn", {"a", "b"}, {{1, 2}, {3}}); }) ==
        "table \"torn\": expected 2 values in a row, found 1");
  lesson.verdict("right", 1, 1, 1);
  CHECK(lesson.finish() == 0);
  CHECK(cairn::read_file(folder / "out" / "table.csv") == "a,b\n1,2\n0.5,-3\n");
  CHECK(std::filesystem::exists(folder / "out" / "index.html") == example::has_report_page());
}

TEST_CASE("lesson: a column of rows") {
  CHECK(example::column({{1, 2}, {3, 4}}, 1) == std::vector<double>{2, 4});
  CHECK(example::column({}, 1).empty());
}

TEST_CASE("ellipse: its corners lie at so many deviations, for any covariance") {
  for (const std::array<double, 3>& covariance :
       {std::array<double, 3>{4, 1, 2}, {1, -0.9, 1}, {2, 0, 0.5}}) {
    const auto [xx, xy, yy] = covariance;
    const double determinant = xx * yy - xy * xy;
    const auto curve = example::ellipse("e", example::Ink::belief, {3, -1}, covariance, 1.5);
    REQUIRE(curve.x.size() == 49);
    CHECK(curve.x.front() == doctest::Approx(curve.x.back()));
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      const double x = curve.x[i] - 3, y = curve.y[i] + 1;
      CHECK((yy * x * x - 2 * xy * x * y + xx * y * y) / determinant == doctest::Approx(1.5 * 1.5));
    }
  }
}

TEST_CASE("ellipse: without variance it is a point or a line, and what is no covariance is refused") {
  const auto point = example::ellipse("e", example::Ink::belief, {3, -1}, {0, 0, 0});
  CHECK(point.x[7] == 3);
  CHECK(point.y[7] == -1);
  const auto upright = example::ellipse("e", example::Ink::belief, {0, 0}, {0, 0, 4}, 1);
  CHECK(upright.x[12] == 0);
  CHECK(upright.y[12] == doctest::Approx(2));
  const double not_a_number = std::numeric_limits<double>::quiet_NaN();
  for (const std::array<double, 3>& covariance :
       {std::array<double, 3>{1, 2, 1}, {-1, 0, 1}, {0, 1, 1}, {1, 0, -1}, {not_a_number, 0, 1}})
    CHECK(message_of([&] {
            static_cast<void>(example::ellipse("e", example::Ink::belief, {0, 0}, covariance));
          }).find("ellipse \"e\": expected a covariance") == 0);
}

TEST_CASE("area: runs along the upper edge and back along the lower one") {
  const auto curve = example::area("a", example::Ink::belief, {0, 1}, {-1, -2}, {1, 2});
  CHECK(curve.x == std::vector<double>{0, 1, 1, 0});
  CHECK(curve.y == std::vector<double>{1, 2, -2, -1});
  CHECK(curve.filled);
  CHECK(message_of([] {
          static_cast<void>(example::area("a", example::Ink::belief, {0}, {}, {1}));
        }).find("expected 1 values of \"a\", found 0") != std::string::npos);
}

TEST_CASE("report: a film starts at the frame that was asked for, or at its last one") {
  example::Report report("title", "");
  example::PlaneFilm film{.title = "film", .frames = {{0, "", {}}, {1, "", {}}, {2, "", {}}}};
  report.add(film);
  CHECK(report.data().find("\"start\":2") != std::string::npos);
  film.start = 1;
  report.add(film);
  CHECK(report.data().find("\"start\":1") != std::string::npos);
  film.start = 3;
  CHECK(message_of([&] { report.add(film); }) ==
        "report panel \"film\": expected to start at a frame up to 2, found 3");
}

TEST_CASE("report: a heat map and a film that do not fit together are refused by name") {
  example::Report report("title", "");
  CHECK(message_of([&] {
          report.add(
              example::HeatMap{.title = "map", .value = {"v"}, .columns = 2, .rows = 2, .values = {1}});
        }) == "report panel \"map\": expected 4 values of \"v\", found 1");
  CHECK(message_of([&] {
          report.add(example::PlaneFilm{.title = "film", .frames = {{0, "", {{.name = "a", .x = {1}}}}}});
        }) == "report panel \"film\": expected 1 values of \"a\", found 0");
  CHECK(message_of([&] {
          report.add(
              example::LinePlot{.title = "lines", .x_values = {0}, .bands = {{.name = "b", .low = {1}}}});
        }) == "report panel \"lines\": expected 1 values of \"b\", found 0");
}

TEST_CASE("lesson: bad arguments are exit code 2 and a sentence, and nothing is written") {
  const cairn_test::Folder folder;
  for (const char* arguments : {"--nonsense", "--seed -1", "--seed", "--steps 0", "--steps many",
                                "--mistake nobody-made-this", "extra"}) {
    CAPTURE(arguments);
    const Outcome outcome =
        cairn_test::run_program("cd '" + folder.path().string() + "' && " + first_lesson + " " + arguments);
    CAPTURE(outcome.words);
    CHECK(outcome.code == 2);
    CHECK(outcome.words.size() > 10);
    CHECK(outcome.words.find("verdict") == std::string::npos);
    CHECK(cairn_test::names_in(folder.path()).empty());
  }
}

TEST_CASE("lesson: results that cannot be written are exit code 2 and a sentence") {
  const cairn_test::Folder folder;
  folder.put("file", "");
  const Outcome outcome =
      cairn_test::run_program(first_lesson + " --out '" + (folder / "file").string() + "'");
  CAPTURE(outcome.words);
  CHECK(outcome.code == 2);
  CHECK(outcome.says("01_building_height: "));
  CHECK(outcome.says("expected a writable folder"));
  CHECK_FALSE(outcome.says("verdict"));
  CHECK(cairn_test::run_program(first_lesson + " --quiet --out '" + (folder / "out").string() + "'",
                                "/dev/full")
            .code == 2);
}

TEST_CASE("lesson: results that have no room leave nothing half written") {
  const cairn_test::Folder folder;
  const Outcome outcome = cairn_test::run_program("ulimit -f 16 && trap '' XFSZ && " + first_lesson +
                                                  " --out '" + (folder / "out").string() + "'");
  CAPTURE(outcome.words);
  CHECK(outcome.code == 2);
  CHECK(outcome.says("01_building_height: "));
  CHECK_FALSE(outcome.says("verdict"));
  CHECK(cairn_test::names_in(folder.path()) == std::set<std::string>{"out"});
  CHECK(cairn_test::names_in(folder / "out").empty());
}

TEST_CASE("lesson: --help, --version and --about answer and write nothing") {
  const cairn_test::Folder folder;
  const auto run = [&](const std::string& option) {
    return cairn_test::run_program("cd '" + folder.path().string() + "' && " + first_lesson + " " + option);
  };
  CHECK(run("--help").says("--mistake"));
  CHECK(run("--version").says("01_building_height " CAIRN_VERSION_STRING));
  CHECK(run("--about").says("\nvariance-stays: "));
  CHECK(run("--help").code + run("--version").code + run("--about").code == 0);
  CHECK(cairn_test::names_in(folder.path()).empty());
}

TEST_SUITE_END();

}  // namespace lesson_test
