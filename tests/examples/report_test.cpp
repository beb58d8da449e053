// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/report.hpp"

#include <limits>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "examples/synthetic_run.hpp"
#include "run_report.hpp"
#include "support/folder.hpp"

using cairn_test::message_of;
using example::Ink;
using example::Report;

namespace report_test {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

nlohmann::json data_of(const Report& report) {
  return nlohmann::json::parse(report.data());
}

nlohmann::json panel_called(const nlohmann::json& data, const std::string& title) {
  for (const auto& panel : data["panels"])
    if (panel["title"] == title) return panel;
  FAIL("no panel is called " << title);
  return {};
}

}  // namespace

TEST_SUITE_BEGIN("examples/report");

TEST_CASE("report: an empty page is valid") {
  const auto data = data_of(Report("title", "subtitle"));
  CHECK(data["title"] == "title");
  CHECK(data["panels"].empty());
}

TEST_CASE("report: curves keep six digits, and gaps are null") {
  Report report("title", "");
  report.add(example::LinePlot{.title = "lines",
                               .x = {"time", "s"},
                               .y = {"error", "m"},
                               .x_values = {0, 1, 2},
                               .curves = {{"a", Ink::wrong, {1.23456789, not_a_number, -1e300}, true}}});
  const auto panel = data_of(report)["panels"][0];
  CHECK(panel["kind"] == "lines");
  CHECK(panel["x"]["unit"] == "s");
  CHECK(panel["curves"][0]["ink"] == "wrong");
  CHECK(panel["curves"][0]["dashed"] == true);
  CHECK(panel["curves"][0]["values"][0] == 1.23457);
  CHECK(panel["curves"][0]["values"][1].is_null());
  CHECK(panel["curves"][0]["values"][2] == -1e300);
}

TEST_CASE("report: points are packed as little-endian floats, those not finite left out with their values") {
  Report report("title", "");
  report.add(
      example::Cloud{.title = "cloud",
                     .unit = "m",
                     .points = {{1, 2, -0.5F}, {std::numeric_limits<float>::infinity(), 0, 0}, {0, 0, 0}},
                     .colourings = {{"age", "frames", {3, 4, 5}}},
                     .curves = {}});
  const auto panel = data_of(report)["panels"][0];
  CHECK(panel["points"] == "AACAPwAAAEAAAAC/AAAAAAAAAAAAAAAA");  // 0000803f 00000040 000000bf 0 0 0
  CHECK(panel["colourings"][0]["values"] == "AABAQAAAoEA=");     // 00004040 0000a040
}

TEST_CASE("report: what is known of a path is drawn so that it can be seen, and nothing over another") {
  std::vector<example::PlaneGaussian> path;
  for (int i = 0; i <= 200; ++i)  // 100 m eastwards, 0.1 mm by 0.2 mm
    path.push_back({{0.5 * i, 0}, {1e-8, 0, 4e-8}});
  const example::Spreads spreads = example::spreads_along(path, Ink::violet, 2);
  CHECK(spreads.scale == 8000);  // half of 7 m over 2 times 0.2 mm is 8750
  CHECK(spreads.curve.name == "2 sigma, 8000 times as large");
  constexpr std::size_t each = 50;               // 49 corners and a gap
  REQUIRE(spreads.curve.x.size() == 14 * each);  // at 0, 7.5, ..., 97.5 m: 7 m and what rounding adds
  for (std::size_t i = 0; i < spreads.curve.x.size(); ++i) {
    if (i % each == each - 1) {
      CHECK(std::isnan(spreads.curve.x[i]));
      continue;
    }
    const double u = (spreads.curve.x[i] - 7.5 * static_cast<double>(i / each)) / (8000 * 1e-4),
                 v = spreads.curve.y[i] / (8000 * 2e-4);
    CHECK(std::hypot(u, v) == doctest::Approx(2));
  }
  CHECK(example::spreads_along({}, Ink::violet).curve.x.empty());
  CHECK(example::spreads_along({{{0, 0}, {4, 0, 9}}}, Ink::violet).scale == 1);  // never smaller
}

TEST_CASE("report: a panel that does not fit together is refused by name") {
  Report report("title", "");
  const auto lines = [&](std::vector<double> x, std::vector<double> y) {
    return message_of([&] {
      report.add(example::LinePlot{.title = "speeds", .x_values = x, .curves = {{"left", Ink::belief, y}}});
    });
  };
  CHECK(lines({0, 1}, {5}).find("\"speeds\": expected 2 values of \"left\", found 1") != std::string::npos);
  CHECK(lines({1, 0}, {5, 5}).find("never fall, x value 1 does") != std::string::npos);
  CHECK(lines({0, not_a_number}, {5, 5}).find("never fall, x value 1 does") != std::string::npos);
  CHECK(message_of([&] {
          report.add(example::PlanePlot{.title = "map", .curves = {{"way", Ink::truth, {1, 2}, {1}}}});
        }).find("\"map\": expected 2 values of \"way\", found 1") != std::string::npos);
  CHECK(message_of([&] {
          report.add(example::Table{.title = "table", .columns = {"a", "b"}, .rows = {{"1"}}});
        }).find("expected 2 values of \"a row\", found 1") != std::string::npos);
  CHECK(data_of(report)["panels"].empty());
}

TEST_CASE("report: what the data says cannot end the script it stands in") {
  Report report("a </script><b> & c", "");
  report.note("</script><script>alert(1)</script>");
  CHECK(data_of(report)["title"] == "a </script><b> & c");
  const auto html = report.html();
  if (!html) {
    MESSAGE("skipped: built without the page");
    return;
  }
  CHECK(html->find("<title>a &lt;/script>&lt;b> &amp; c</title>") != std::string::npos);
  CHECK(html->find("alert(1)") != std::string::npos);
  CHECK(html->find("<script>alert(1)") == std::string::npos);
  CHECK(html->find("@CAIRN_REPORT") == std::string::npos);
}

TEST_CASE("report: the page asks nothing of the network") {
  const auto html = Report("title", "").html();
  if (!html) {
    MESSAGE("skipped: built without the page");
    return;
  }
  for (const char* reference : {"src=\"http", "href=\"http", "src=\"//", "@import", "url(http"}) {
    CAPTURE(reference);
    CHECK(html->find(reference) == std::string::npos);
  }
}

TEST_CASE("report of a run: every panel of the main job is there") {
  auto run = cairn_test::circular_run(60, 200);
  run.frames[7].keyframe = run.frames[9].keyframe = true;
  const auto data = data_of(stereo_slam::run_report(run, stereo_slam::summarise(run)));
  const auto path = panel_called(data, "Path from above")["curves"];
  CHECK(path.size() == 4);  // truth, estimate and
  CHECK(path[2]["name"] == "3 sigma, 9 times as large");
  CHECK(path[3]["name"] == "keyframes");
  CHECK(path[3]["x"].size() == 2);
  CHECK(panel_called(data, "Position error")["curves"][0]["values"].size() == 60);
  CHECK(panel_called(data, "Heading error")["y"]["unit"] == "deg");
  CHECK(panel_called(data, "Points and matches")["curves"].size() == 4);
  CHECK(panel_called(data, "Landmarks")["curves"].size() == 1);
  CHECK(panel_called(data, "Landmarks and path")["colourings"].size() == 4);
  const auto picture = panel_called(data, "One frame with its matches");
  CHECK(picture["png"].get<std::string>().starts_with("iVBORw0KGgo"));  // the signature of PNG
  CHECK(picture["marks"][1]["count"] == 90);                            // every tenth of 900
  const auto lines = [&](int kind) {  // of 4 floats, three bytes in four letters
    return picture["marks"][kind]["segments"].get<std::string>().size() * 3 / 4 / 16;
  };
  CHECK(lines(1) == 90);
  CHECK(picture["marks"][2]["count"] > 400);
  CHECK(lines(2) > 50);
  CHECK(lines(2) < 200);  // one in a part of the image
}

TEST_CASE("report of a run: times and threads change nothing in it") {
  auto run = cairn_test::circular_run(60, 200);
  const std::string before = stereo_slam::run_report(run, stereo_slam::summarise(run)).data();
  run.seconds = 77;
  run.threads = 9;
  for (auto& frame : run.frames) frame.milliseconds.fill(3);
  CHECK(stereo_slam::run_report(run, stereo_slam::summarise(run)).data() == before);
}

TEST_CASE("report of a run: one that ended early says so first") {
  auto run = cairn_test::straight_run(5);
  run.notes = {"another note"};
  run.ended_early = "ended after 5 of 9 frames: the sixth is torn";
  const auto data = data_of(stereo_slam::run_report(run, stereo_slam::summarise(run)));
  CHECK(data["notes"][0] == "ended after 5 of 9 frames: the sixth is torn");
}

TEST_CASE("report of a run: without truth, sample or landmarks the panels say so") {
  auto run = cairn_test::straight_run(5);
  for (auto& frame : run.frames) {
    frame.truth.reset();
    frame.time = 0;  // a clock that stands still: frame numbers instead
    frame.covariance.setConstant(not_a_number);
  }
  const auto data = data_of(stereo_slam::run_report(run, stereo_slam::summarise(run)));
  CHECK(panel_called(data, "Position error")["curves"].empty());
  CHECK(panel_called(data, "Position error")["caption"].get<std::string>().find("no truth") !=
        std::string::npos);
  CHECK(panel_called(data, "Path from above")["curves"].size() == 1);
  CHECK(panel_called(data, "One frame with its matches")["png"] == "");
  CHECK(panel_called(data, "Landmarks")["x"]["label"] == "frame");
}

TEST_CASE("report: readable numbers are short") {
  CHECK(example::readable(0.0123456) == "0.0123");
  CHECK(example::readable(1234567) == "1.23e+06");
  CHECK(example::readable(12345.6) == "12346");
  CHECK(example::readable(999.6) == "1000");
  CHECK(example::readable(12, 2) == "12");
  CHECK(example::readable(not_a_number) == "none");
  CHECK(example::readable_length(12.345).words() == "12.3 m");
  CHECK(example::readable_length(-0.0123).words() == "-0.0123 m");
  CHECK(example::readable_length(0.01).words() == "0.01 m");
  CHECK(example::readable_length(0.000726).words() == "0.726 mm");
  CHECK(example::readable_length(-1.68e-6).words() == "-1.68 um");
  CHECK(example::readable_length(0).words() == "0 m");
  CHECK(example::readable_length(not_a_number).words() == "none m");
}

TEST_SUITE_END();

}  // namespace report_test
