// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Opens the page of every lesson, and of one with each kind of panel, in headless Chromium.
#include <cstddef>
#include <filesystem>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/io/file.hpp>

#include "support/browser.hpp"
#include "support/folder.hpp"
#include "support/page_check.hpp"
#include "support/program.hpp"
#include "support/report.hpp"

namespace pages_test {
namespace {

namespace fs = std::filesystem;
using cairn_test::OpenedPage;
using example::Ink;

/// Moves every slider from its first to its last place, and counts those whose picture and words changed.
constexpr const char* mover = R"(<script>
globalThis.more = (async () => {
  await new Promise((done) => setTimeout(done, 500));
  let moved = 0;
  const sliders = [...document.querySelectorAll('input[type=range]')];
  for (const slider of sliders) {
    const panel = slider.closest('.panel');
    const seen = [];
    for (const place of [slider.min, slider.max]) {
      slider.value = place;
      slider.dispatchEvent(new Event('input'));
      await new Promise((done) => setTimeout(done, 50));
      seen.push([panel.querySelector('canvas').toDataURL(), panel.querySelector('output').textContent]);
    }
    if (seen[0][0] !== seen[1][0] && seen[0][1] !== seen[1][1]) ++moved;
  }
  document.documentElement.dataset.sliders = `${moved} of ${sliders.length} moved`;
})();
</script>)";

// Keeps what is written on canvases: numbers of axes, and all of a figure that is saved.
const char* const listener = R"(<script>
const said = new Set();
const write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...where) {
  said.add(text);
  document.documentElement.dataset.said = [...said].join('|');
  return write.call(this, text, ...where);
};
</script>)";

/// The page with this script before its own.
std::string before_all(std::string page, const std::string& script) {
  return page.insert(page.find("<main"), script);
}

/// What stands from one mark to the next other one.
std::string between(const std::string& document, const std::string& begin, const std::string& end) {
  const std::size_t at = document.find(begin);
  if (at == std::string::npos) return {};
  const std::size_t first = at + begin.size();
  return document.substr(first, document.find(end, first) - first);
}

/// Whether the page uses a word, and whether it explains it at its end.
bool says(const OpenedPage& opened, const std::string& word) {
  return between(opened.document, "id=\"data\"", "</script>").find(word) != std::string::npos;
}
bool explains(const OpenedPage& opened, const std::string& word) {
  return between(opened.document, "class=\"words\"", "</section>").find("<dt>" + word + "</dt>") !=
         std::string::npos;
}

std::vector<std::string> lessons() {
  std::istringstream list(CAIRN_LESSONS);
  std::vector<std::string> names;
  for (std::string name; std::getline(list, name, ',');) names.push_back(name);
  return names;
}

void check_sliders_move(const OpenedPage& opened) {
  const std::string sliders = std::to_string(opened.count("<input type=\"range\" min"));
  CHECK(opened.has("data-sliders=\"" + sliders + " of " + sliders + " moved\""));
}

/// The page that the lesson leaves in the folder.
fs::path page_of(const std::string& lesson, const fs::path& folder) {
  const std::string program = std::string(CAIRN_LESSON_FOLDER) + "/" + lesson;
  const auto outcome = cairn_test::run_program("'" + program + "' --out '" + folder.string() + "'");
  CAPTURE(lesson);
  CAPTURE(outcome.words);
  REQUIRE(outcome.code == 0);
  return folder / "index.html";
}

}  // namespace

TEST_SUITE_BEGIN("course/pages");

TEST_CASE("course: the page of every lesson opens without a word on the console, and its sliders move") {
  if (!cairn_test::can_open_pages()) return;
  const cairn_test::Folder folder;
  std::vector<fs::path> pages;
  for (const std::string& lesson : lessons()) {
    pages.push_back(page_of(lesson, folder / lesson));
    REQUIRE(cairn_test::keep_picture(folder, pages.back(), lesson, 2000));
  }
  const std::vector<OpenedPage> opened = cairn_test::check_pages(pages, mover);
  REQUIRE(opened.size() == pages.size());
  for (std::size_t i = 0; i < opened.size(); ++i) {
    CAPTURE(pages[i].string());
    CHECK(opened[i].has("class=\"figure good\""));
    CHECK_FALSE(opened[i].has("class=\"empty\""));
    CHECK(says(opened[i], "NEES") == explains(opened[i], "NEES"));
    check_sliders_move(opened[i]);
  }
}

TEST_CASE(
    "report page: films, heat maps, bands, dots and areas are drawn, gaps and all, and axe finds nothing") {
  if (!cairn_test::can_open_pages()) return;
  const double gap = std::numeric_limits<double>::quiet_NaN();
  example::Report report("panels", "");
  report.add(example::LinePlot{.title = "lines",
                               .x_values = {0, 1, 2},
                               .curves = {{"dots", Ink::measurement, {1, gap, 2}, false, true}},
                               .bands = {{"band", Ink::belief, {0, gap, 1}, {2, gap, 3}}}});
  report.add(example::HeatMap{
      .title = "heat", .columns = 2, .rows = 2, .values = {1, -1, gap, 0.5}, .diverging = true});
  report.add(example::HeatMap{.title = "flat", .columns = 1, .rows = 1, .values = {3}});
  example::PlaneFilm film{.title = "film", .slider = {"step"}, .equal_scale = false};
  film.still = {{.name = "way", .ink = Ink::truth, .x = {0, gap, 9}, .y = {0, 1, 1}, .dashed = true}};
  for (const double at : {0.0, 1.0})
    film.frames.push_back({at, "frame", {example::ellipse("area", Ink::belief, {at, 0}, {1, 0.5, 1})}});
  film.frames.push_back({2, "nothing here", {}});
  report.add(film);
  report.add(example::Cloud{.title = "cloud", .points = {{0, 0, 0}, {1, 1, 1}}});
  report.add(example::Table{.title = "table", .columns = {"name", "value"}, .rows = {{"one", "1"}}});
  report.figure({"figure", "1", "m", "a hint", example::KeyFigure::Verdict::good});
  report.note("a note");
  const cairn_test::Folder folder;
  cairn::write_file_atomically(folder / "page.html", report.html().value());
  const OpenedPage opened = cairn_test::check_page(folder / "page.html", mover);
  CHECK(opened.has("data-panels=\"6\""));
  CHECK(opened.count("class=\"heat\"") == 2);
  CHECK(opened.count("<input type=\"range\" min") == 1);
  CHECK(opened.count("href=\"#figure-") == 6);
  check_sliders_move(opened);
}

TEST_CASE("report page: words that it uses are explained at its end, and others are not") {
  if (!cairn_test::can_open_pages()) return;
  example::Report report("words", "");
  report.figure({"ATE", "1", "m", "first", example::KeyFigure::Verdict::good});
  report.add(example::LinePlot{.title = "NIS", .x_values = {0, 1}, .curves = {{"one", Ink::belief, {1, 2}}}});
  const cairn_test::Folder folder;
  cairn::write_file_atomically(folder / "page.html", report.html().value());
  const OpenedPage opened = cairn_test::open_page(folder, folder / "page.html");
  CHECK(opened.console == "");
  CHECK(explains(opened, "ATE"));
  CHECK(explains(opened, "NIS"));
  CHECK_FALSE(explains(opened, "NEES"));
}

TEST_CASE(
    "report page: a logarithmic axis does not begin at a rounding error, small numbers are short, the legend "
    "shows lines as they are drawn and goes into the file that is saved") {
  if (!cairn_test::can_open_pages()) return;
  example::LinePlot plot{.title = "errors", .curves = {{"first", Ink::wrong, {}}, {"second", Ink::teal, {}}}};
  for (int i = 0; i < 200; ++i) {
    plot.x_values.push_back(i);
    plot.curves[0].values.push_back(i == 0 ? 1e-14 : 0.1 + i);
    plot.curves[1].values.push_back(0.2 + i);
  }
  plot.logarithmic = true;
  example::Report report("legend", "");
  report.add(plot);
  report.add(example::LinePlot{
      .title = "small", .x_values = {0, 1}, .curves = {{"tiny", Ink::belief, {2e-5, 9e-5}}}});
  const cairn_test::Folder folder;
  cairn::write_file_atomically(folder / "page.html", before_all(report.html().value(), listener));
  const OpenedPage opened = cairn_test::check_page(folder / "page.html");
  REQUIRE(opened.has("data-said=\""));
  const std::string said = "|" + between(opened.document, "data-said=\"", "\"") + "|";
  CAPTURE(said);
  CHECK(said.find("|100|") != std::string::npos);
  CHECK(said.find("e-14") == std::string::npos);
  CHECK(said.find("|4e-5|") != std::string::npos);
  for (const char* name : {"|first|", "|second|", "|tiny|"}) CHECK(said.find(name) != std::string::npos);
  CHECK(opened.has("stroke-dasharray=\"11 4 3 4\""));  // of Ink::wrong
  CHECK(opened.has("stroke-dasharray=\"13 5\""));      // of Ink::teal
}

TEST_SUITE_END();

}  // namespace pages_test
