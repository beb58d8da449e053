// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The program as a user meets it, on OpenCV's own pairs of chessboards.
#include "support/program.hpp"

#include <cmath>
#include <filesystem>
#include <set>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/version.hpp>

#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/program_checks.hpp"
#include "support/rig_file.hpp"

namespace calibrate_program_test {
namespace {

namespace fs = std::filesystem;
using cairn_test::Outcome;

Outcome run(const std::string& arguments, const std::string& standard_output = "") {
  return cairn_test::run_program(std::string("\"") + CALIBRATE_STEREO_PROGRAM + "\" " + arguments,
                                 standard_output);
}

}  // namespace

TEST_SUITE("calibrate_stereo/program") {
  TEST_CASE("calibrate_stereo: --version and --help") {
    cairn_test::check_version_and_help(run, "calibrate_stereo " CAIRN_VERSION_STRING "\n", "--corners");
  }

  TEST_CASE("calibrate_stereo: a mistake is exit code 2 and a line") {
    const cairn_test::Folder folder;
    for (const char* name : {"l1.pgm", "l2.pgm", "r1.pgm", "r2.pgm"})
      cairn::write_pgm(folder / name, cairn::Image(64, 48, 100));
    const std::string left = "--left \"" + (folder / "l*").string() + "\"",
                      right = " --right \"" + (folder / "r*").string() + "\"";
    cairn_test::check_mistakes(
        [&](const std::string& mistake) {
          return run(mistake + " --out \"" + (folder / "out").string() + "\"");
        },
        {"", left, left + right + " --square 0", left + right + " --corners 2 2",
         left + right + " --corners 9", left + right + " --distortion 3", "--nonsense"});
    const Outcome none = run(left + right + " --out \"" + (folder / "out").string() + "\"");
    CHECK(none.code == 2);
    CHECK(none.says("was found in 0 pairs; expected three at least (--corners counts inner corners)"));
    CHECK(run("--left /no/such" + right + " --out \"" + (folder / "out").string() + "\"")
              .says("--left '/no/such': no file has such a name"));
  }

#if defined(EXAMPLES_HAVE_YAML) && defined(EXAMPLES_HAVE_JPEG)
  TEST_CASE("calibrate_stereo: OpenCV's chessboards give a rig as good as OpenCV's own, with sigmas") {
    const auto data = cairn_test::real_data("stereo_pairs");
    if (!data) return;
    const fs::path boards = *data / "opencv-chessboard-stereo";
    const cairn_test::Folder folder;
    const Outcome outcome =
        run("--left \"" + (boards / "left[0-9]*.jpg").string() + "\" --right \"" +
            (boards / "right[0-9]*.jpg").string() + "\" --out \"" + (folder / "out").string() + "\"");
    CAPTURE(outcome.words);
    REQUIRE(outcome.code == 0);
    CHECK(cairn_test::names_in(folder / "out") == cairn_test::with_report({"rig.yaml", "summary.json"}));
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(summary["views"].get<int>() >= 10);
    // Both minimise the same sum.
    CHECK(summary["rms_px"].get<double>() <= 1.002 * summary["opencv_rms_px"].get<double>());
    CHECK(summary["rms_px"].get<double>() < 0.6);
    CHECK(summary["opencv_largest_difference_sigma"].get<double>() < 0.1);
    CHECK(summary["held_out"]["epipolar_rms_px"].get<double>() < 0.6);
    CHECK(std::abs(summary["held_out"]["length_error"].get<double>()) < 0.005);
    const example::CalibratedRig rig = example::read_rig(folder / "out" / "rig.yaml");
    CHECK(std::abs(rig.rig.left.fx() - 534.8) < 5);  // as OpenCV's sample has it
    CHECK(rig.rig.left.width() == 640);
    REQUIRE(rig.angle_sigma());
    CHECK(*rig.angle_sigma() > 1e-5);
    CHECK(*rig.angle_sigma() < 5e-3);
    CHECK_FALSE(outcome.says("images exchanged"));
  }

  TEST_CASE("calibrate_stereo: sides that are exchanged, and images that are no pairs, are said") {
    const auto data = cairn_test::real_data("stereo_pairs");
    if (!data) return;
    const fs::path boards = *data / "opencv-chessboard-stereo";
    const cairn_test::Folder folder;
    const std::string out = " --out \"" + (folder / "out").string() + "\"";
    const Outcome exchanged = run("--left \"" + (boards / "right0[1-5].jpg").string() + "\" --right \"" +
                                  (boards / "left0[1-5].jpg").string() + "\"" + out);
    CAPTURE(exchanged.words);
    CHECK(exchanged.code == 0);
    CHECK(exchanged.says("expected the images exchanged"));

    for (int i = 1; i <= 5; ++i) {
      const std::string number = std::to_string(i), other = std::to_string(6 - i);
      fs::copy_file(boards / ("left0" + number + ".jpg"), folder / ("l" + number + ".jpg"));
      fs::copy_file(boards / ("right0" + other + ".jpg"), folder / ("r" + number + ".jpg"));
    }
    const Outcome mixed =
        run("--left \"" + (folder / "l*").string() + "\" --right \"" + (folder / "r*").string() + "\"" + out);
    CAPTURE(mixed.words);
    CHECK(mixed.code == 2);
    CHECK(mixed.says("taken at one moment"));
  }
#endif
}

}  // namespace calibrate_program_test
