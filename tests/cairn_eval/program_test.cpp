// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The program as a user meets it: published figures, its exit codes and words.
#include "support/program.hpp"

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>
#include <cairn/io/trajectory.hpp>
#include <cairn/version.hpp>

#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/program_checks.hpp"

namespace cairn_eval_program_test {
namespace {

namespace fs = std::filesystem;
using cairn::SE3;
using cairn::SO3;
using cairn::Vector;
using cairn_test::Outcome;
using Json = nlohmann::json;

const std::string program = CAIRN_EVAL_PROGRAM;

Outcome run(const std::string& arguments, const std::string& standard_output = "") {
  return cairn_test::run_program("\"" + program + "\" " + arguments, standard_output);
}

std::string quoted(const fs::path& path) {
  return " \"" + path.string() + "\"";
}

Json scored(const cairn_test::Folder& folder, const std::string& arguments) {
  const Outcome outcome = run(arguments + " --out" + quoted(folder / "out"));
  CAPTURE(outcome.words);
  REQUIRE(outcome.code == 0);
  return Json::parse(cairn::read_file(folder / "out" / "summary.json"));
}

bool near(const Json& value, double expected, double tolerance) {
  return std::abs(value.get<double>() - expected) < tolerance;
}

/// A winding walk, a pose each tenth of a second.
cairn::Trajectory walk() {
  cairn::Trajectory trajectory;
  SE3 pose;
  for (int i = 0; i < 200; ++i) {
    trajectory.push_back({0.1 * i, pose});
    pose = pose * SE3(SO3::exp(Vector<3>(0.001 * i, 0.02, 0)), Vector<3>(0, 0.02, 0.5));
  }
  return trajectory;
}

/// The walk with errors of known covariances, and those as the file that the programs write.
std::string erring(cairn::Trajectory& trajectory, double factor) {
  cairn::Random random(5);
  std::string text = "frame,time,tracked,x_x";
  for (int i = 1; i < 21; ++i) text += ",n";
  text += '\n';
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    Vector<6> d, sigma;
    sigma << 0.1, 0.2, 0.3, 0.01, 0.02, 0.03;
    sigma *= 1 + 0.01 * static_cast<double>(i);  // another pose's covariance gives another NEES
    for (int k = 0; k < 6; ++k) d(k) = factor * sigma(k) * random.normal();
    trajectory[i].T_world_body = retract(trajectory[i].T_world_body, d);
    text += std::to_string(i) + "," + cairn::shortest(trajectory[i].time) + ",1";
    for (int a = 0; a < 6; ++a)
      for (int b = a; b < 6; ++b) text += "," + cairn::shortest(a == b ? sigma(a) * sigma(a) : 0.0);
    text += '\n';
  }
  return text;
}

}  // namespace

TEST_SUITE_BEGIN("cairn_eval/program");

TEST_CASE("cairn_eval: gives the published figures of published trajectories") {
  const auto data = cairn_test::real_data("trajectories");
  if (!data) return;
  const cairn_test::Folder folder;
  // Sequence 00 of KITTI's odometry: both files were evaluated for the page of the benchmark's tables.
  const Json kitti = scored(folder, quoted(*data / "KITTI_00_gt.txt") + quoted(*data / "KITTI_00_ORB.txt") +
                                        quoted(*data / "KITTI_00_SPTAM.txt") + " --names ORB-SLAM2 S-PTAM");
  const Json &orb = kitti["estimates"][0], &sptam = kitti["estimates"][1];
  CHECK(orb["name"] == "ORB-SLAM2");
  CHECK(near(orb["ate_m"]["rmse"], 1.303, 0.0005));
  CHECK(near(orb["kitti"]["translation_percent"], 0.6997, 0.00005));
  CHECK(near(orb["kitti"]["rotation_deg_per_100m"], 0.2536, 0.00005));
  CHECK(near(sptam["ate_m"]["rmse"], 3.74, 0.005));
  CHECK(near(sptam["kitti"]["translation_percent"], 1.487, 0.0005));
  CHECK(near(sptam["kitti"]["rotation_deg_per_100m"], 0.558, 0.0005));

  const Json desk =
      scored(folder, quoted(*data / "fr2_desk_groundtruth.txt") + quoted(*data / "fr2_desk_ORB.txt"));
  CHECK(near(desk["estimates"][0]["ate_m"]["rmse"], 0.009, 0.001));
  CHECK(desk["estimates"][0]["kitti"].is_null());

  const Json room = scored(folder, quoted(*data / "V102_groundtruth.csv") + quoted(*data / "V102.txt"));
  CHECK(near(room["estimates"][0]["ate_m"]["rmse"], 0.092, 0.0005));
  CHECK(room["estimates"][0]["pairs"] == 794);
}

TEST_CASE("cairn_eval: NEES of errors drawn from the covariances is 6, of errors twice as large 24") {
  const cairn_test::Folder folder;
  const cairn::Trajectory truth = walk();
  cairn::write_tum(folder / "truth.tum", truth);
  for (const double factor : {1.0, 2.0}) {
    cairn::Trajectory estimate = truth;
    cairn::write_file_atomically(folder / "covariance.csv", erring(estimate, factor));
    cairn::write_tum(folder / "estimate.tum", estimate);
    const Json summary =
        scored(folder, quoted(folder / "truth.tum") + quoted(folder / "estimate.tum") +
                           " --align none --covariances" + quoted(folder / "covariance.csv"));
    const Json& nees = summary["estimates"][0]["nees"];
    CHECK(nees["poses"] == 200);
    CHECK(nees["without_covariance"] == 0);
    CHECK(nees["without_inverse"] == 0);
    // 200 independent poses: the mean has the deviation sqrt(12 / 200) = 0.24, times the factor squared.
    CHECK(near(nees["mean"], 6 * factor * factor, 4 * 0.245 * factor * factor));
  }
}

TEST_CASE("cairn_eval: covariances go row by row with poses that have no times, and with times by those") {
  const cairn_test::Folder folder;
  const cairn::Trajectory truth = walk();
  cairn::Trajectory estimate = truth;
  std::string covariances = erring(estimate, 1), times;
  for (const cairn::StampedPose& pose : truth) times += cairn::shortest(pose.time) + "\n";
  cairn::write_tum(folder / "truth.tum", truth);
  cairn::write_tum(folder / "estimate.tum", estimate);
  cairn::write_kitti(folder / "truth.kitti", truth);
  cairn::write_kitti(folder / "estimate.kitti", estimate);
  cairn::write_file_atomically(folder / "covariance.csv", covariances);
  cairn::write_file_atomically(folder / "times.txt", times);
  const std::string kitti = quoted(folder / "truth.kitti") + quoted(folder / "estimate.kitti") +
                            " --align first --covariances" + quoted(folder / "covariance.csv");
  const Json by_row = scored(folder, kitti)["estimates"][0]["nees"];
  const Json by_time =
      scored(folder, kitti + " --times" + quoted(folder / "times.txt"))["estimates"][0]["nees"];
  CHECK(by_row["poses"] == 200);
  CHECK(by_row["without_covariance"] == 0);
  CHECK(by_row == by_time);

  // The second half has no covariance, and the first pose one without an inverse.
  const std::size_t half = covariances.find("\n100,") + 1, first = covariances.find('\n') + 1;
  covariances.resize(half);
  std::string zeros = "0,0,1";
  for (int i = 0; i < 21; ++i) zeros += ",0";
  covariances.replace(first, covariances.find('\n', first) - first, zeros);
  cairn::write_file_atomically(folder / "half.csv", covariances);
  const Outcome outcome =
      run(quoted(folder / "truth.tum") + quoted(folder / "estimate.tum") + " --align none --covariances" +
          quoted(folder / "half.csv") + " --out" + quoted(folder / "half"));
  CAPTURE(outcome.words);
  CHECK(outcome.says("left out: 100 without a covariance of their time, 1 whose covariance has no inverse"));
  const Json summary = Json::parse(cairn::read_file(folder / "half" / "summary.json"));
  CHECK(summary["estimates"][0]["nees"]["poses"] == 99);
  CHECK(summary["estimates"][0]["nees"]["without_covariance"] == 100);
  CHECK(summary["estimates"][0]["nees"]["without_inverse"] == 1);
}

TEST_CASE("cairn_eval: a straight path has no error of the attitude after a fit, and the words say why") {
  const cairn_test::Folder folder;
  cairn::Trajectory truth, estimate;
  for (int i = 0; i < 200; ++i) truth.push_back({0.1 * i, SE3(SO3(), Vector<3>(0, 0, i))});
  estimate = truth;
  cairn::write_file_atomically(folder / "covariance.csv", erring(estimate, 1));
  cairn::write_tum(folder / "truth.tum", truth);
  cairn::write_tum(folder / "estimate.tum", estimate);
  const std::string files = quoted(folder / "truth.tum") + quoted(folder / "estimate.tum") +
                            " --covariances" + quoted(folder / "covariance.csv") + " --out" +
                            quoted(folder / "out");
  const auto estimated = [&] {
    return Json::parse(cairn::read_file(folder / "out" / "summary.json"))["estimates"][0];
  };
  const Outcome rigid = run(files);
  CAPTURE(rigid.words);
  CHECK(rigid.code == 0);
  CHECK(rigid.says("attitude not determined by this alignment"));
  CHECK(rigid.says("--align first"));
  CHECK(rigid.says("NEES   needs attitudes"));
  CHECK(estimated()["attitude_error_deg"].is_null());
  CHECK(estimated()["nees"].is_null());
  if (fs::exists(folder / "out" / "report.html"))
    CHECK(cairn::read_file(folder / "out" / "report.html").find("not determined by this alignment") !=
          std::string::npos);
  const Outcome first = run(files + " --align first");
  CHECK_FALSE(first.says("not determined"));
  CHECK(estimated()["attitude_error_deg"]["rmse"].get<double>() > 0);
  CHECK(estimated()["nees"]["poses"] == 200);
}

TEST_CASE(
    "cairn_eval: every format and alignment of one trajectory gives the same, and an own world no error") {
  const cairn_test::Folder folder;
  const cairn::Trajectory truth = walk();
  cairn::Trajectory moved = truth;
  const SE3 T(SO3::exp(Vector<3>(0.3, -0.2, 1)), Vector<3>(5, 6, 7));
  for (cairn::StampedPose& pose : moved) pose.T_world_body = T * pose.T_world_body;
  cairn::write_tum(folder / "truth.tum", truth);
  cairn::write_kitti(folder / "truth.kitti", truth);
  cairn::write_tum(folder / "moved.tum", moved);
  cairn::write_kitti(folder / "moved.kitti", moved);
  cairn::write_euroc(folder / "moved.csv", moved);
  std::string times;
  for (const cairn::StampedPose& pose : truth) times += cairn::shortest(pose.time) + "\n";
  cairn::write_file_atomically(folder / "times.txt", times);
  for (const char* files : {"truth.tum moved.tum", "truth.tum moved.csv", "truth.kitti moved.kitti"})
    for (const char* align : {"first", "rigid", "similarity"}) {
      CAPTURE(files);
      CAPTURE(align);
      const std::string names = files;
      const std::size_t blank = names.find(' ');
      const Json summary = scored(folder, quoted(folder / names.substr(0, blank)) +
                                              quoted(folder / names.substr(blank + 1)) + " --align " + align);
      CHECK(summary["estimates"][0]["pairs"] == 200);
      CHECK(near(summary["estimates"][0]["ate_m"]["rmse"], 0, 1e-6));
      CHECK(near(summary["estimates"][0]["rpe_m"]["rmse"], 0, 1e-6));
    }
  const Json mixed = scored(folder, quoted(folder / "truth.tum") + quoted(folder / "moved.kitti") +
                                        " --align first --times" + quoted(folder / "times.txt"));
  CHECK(near(mixed["estimates"][0]["ate_m"]["rmse"], 0, 1e-6));
  const Json apart =
      scored(folder, quoted(folder / "truth.tum") + quoted(folder / "moved.tum") + " --align none");
  CHECK(apart["estimates"][0]["ate_m"]["rmse"].get<double>() > 1);
  const Json longer =
      scored(folder, quoted(folder / "truth.tum") + quoted(folder / "moved.tum") +
                         " --kitti-lengths 10 20 --kitti-step 1 --delta 5 --delta-unit metres --all-pairs");
  CHECK(longer["estimates"][0]["kitti"]["by_length"].size() == 2);
  CHECK(longer["rpe_delta"] == "5 m, all pairs");
}

TEST_CASE("cairn_eval: what does not belong together is exit code 2 and words that say what to do") {
  const cairn_test::Folder folder;
  const cairn::Trajectory truth = walk();
  cairn::write_tum(folder / "truth.tum", truth);
  cairn::write_kitti(folder / "truth.kitti", truth);
  cairn::Trajectory later = truth;
  for (cairn::StampedPose& pose : later) pose.time += 1e6;
  cairn::write_tum(folder / "later.tum", later);
  cairn::write_kitti(folder / "short.kitti", {truth.begin(), truth.begin() + 10});
  cairn::write_file_atomically(folder / "bad.tum", "0 1 2 3 0 0 0 1\n1 1 2\n");
  cairn::write_file_atomically(folder / "words.tum", "so it goes\n");
  cairn::write_file_atomically(folder / "seven.tum", "1 2 3 4 5 6 7\n");
  cairn::write_file_atomically(folder / "still.tum",
                               "0 1 2 3 0 0 0 1\n0.1 1 2 3 0 0 0 1\n0.2 1 2 3 0 0 0 1\n");
  cairn::write_file_atomically(folder / "bad.csv", "frame,time,tracked,x_x\n0,0,1,1\n");
  const auto says = [&](const std::string& truth_name, const std::string& estimate, const std::string& more,
                        const std::string& words) {
    const Outcome outcome = run(quoted(folder / truth_name) + quoted(folder / estimate) + " " + more +
                                " --out" + quoted(folder / "out"));
    CAPTURE(outcome.words);
    CAPTURE(words);
    CHECK(outcome.code == 2);
    CHECK(outcome.says(words));
    CHECK_FALSE(fs::exists(folder / "out"));
  };
  says("truth.tum", "later.tum", "", "--offset");
  // In nanoseconds one time, 0, is that of a true pose.
  cairn::Trajectory nanoseconds = truth;
  for (cairn::StampedPose& pose : nanoseconds) pose.time *= 1e9;
  cairn::write_tum(folder / "nano.tum", nanoseconds);
  for (const char* align : {"none", "first", "rigid"})
    says("truth.tum", "nano.tum", std::string("--align ") + align,
         "only one pose within 0.01 s of a true one");
  says("truth.tum", "truth.kitti", "", "--times");
  says("truth.kitti", "short.kitti", "",
       (folder / "short.kitti").string() + ": expected as many poses as " +
           (folder / "truth.kitti").string() + " has, as neither has times, found 10 and 200");
  says("truth.tum", "truth.tum", "--times" + quoted(folder / "nowhere.txt"), "--times is for KITTI files");
  says("truth.tum", "bad.tum", "", "bad.tum:2: expected 8 numbers");
  says("truth.tum", "words.tum", "", "words.tum:1: expected");
  says("truth.tum", "seven.tum", "", "TUM (8 numbers between blanks)");
  says("truth.tum", "nowhere.tum", "", "nowhere.tum");
  says("truth.tum", "still.tum", "", "nothing to align by");
  says("truth.tum", "truth.tum", "--names a b", "one for each estimate");
  says("truth.tum", "truth.tum", "--covariances a b", "one for each estimate");
  says("truth.tum", "truth.tum", "--covariances" + quoted(folder / "bad.csv"),
       "bad.csv:2: expected 24 numbers");
  says("truth.tum", "truth.tum", "--delta 0.5", "at least one frame");
  says("truth.tum", "truth.tum", "--align sideways", "sideways");
  cairn::Trajectory estimate = truth, longer = truth;
  cairn::write_file_atomically(folder / "covariance.csv", erring(estimate, 1));
  longer.push_back({20, truth.back().T_world_body});
  cairn::write_file_atomically(folder / "late.csv", erring(later, 1));
  says("truth.tum", "truth.tum", "--align similarity --covariances" + quoted(folder / "covariance.csv"),
       "has no meaning");
  cairn::write_file_atomically(folder / "many.csv", erring(longer, 1));
  says("truth.kitti", "truth.kitti", "--covariances" + quoted(folder / "many.csv"),
       (folder / "many.csv").string() + ": expected a covariance for each of the 200 poses of " +
           (folder / "truth.kitti").string() +
           ", which has no times, found 201: give its times.txt with --times");
  says("truth.tum", "truth.tum", "--offset 1e-3 --covariances" + quoted(folder / "late.csv"),
       (folder / "late.csv").string() + ": no covariance to use: 200 poses have none of their time");
  CHECK(run("").code == 2);
  const Outcome misspelt = run("--bogus");
  CHECK(misspelt.code == 2);
  CHECK(misspelt.says("--bogus"));
}

TEST_CASE("cairn_eval: the same files give the same bytes, and the page where there is one") {
  const cairn_test::Folder folder;
  cairn::Trajectory estimate = walk();
  cairn::write_tum(folder / "truth.tum", estimate);
  static_cast<void>(erring(estimate, 1));
  cairn::write_tum(folder / "estimate, \"one\".tum", estimate);
  for (const char* out : {"a", "b"})
    REQUIRE(run(quoted(folder / "truth.tum") + " '" + (folder / "estimate, \"one\".tum").string() +
                "' --out" + quoted(folder / out))
                .code == 0);
  for (const std::string& name : cairn_test::with_report({"summary.json", "errors.csv"}))
    CHECK(cairn::read_file(folder / "a" / name) == cairn::read_file(folder / "b" / name));
  CHECK(cairn::read_file(folder / "a" / "errors.csv").find("\"estimate, \"\"one\"\"\",0,") !=
        std::string::npos);
}

TEST_CASE("cairn_eval: estimates of one file name are told apart by their folders, else by their paths") {
  const cairn_test::Folder folder;
  const cairn::Trajectory trajectory = walk();
  cairn::write_tum(folder / "truth.tum", trajectory);
  const auto names = [&](const std::vector<std::string>& estimates) {
    std::string arguments = quoted(folder / "truth.tum");
    for (const std::string& each : estimates) {
      fs::create_directories((folder / each).parent_path());
      cairn::write_tum(folder / each, trajectory);
      arguments += quoted(folder / each);
    }
    const Json summary = scored(folder, arguments);
    std::vector<std::string> found;
    for (const Json& one : summary["estimates"]) found.push_back(one["name"]);
    return found;
  };
  CHECK(names({"a/one.tum", "b/two.tum"}) == std::vector<std::string>{"one", "two"});
  CHECK(names({"a/same.tum", "b/same.tum"}) == std::vector<std::string>{"a", "b"});
  CHECK(names({"a/c/same.tum", "b/c/same.tum"}) ==
        std::vector<std::string>{(folder / "a/c/same.tum").string(), (folder / "b/c/same.tum").string()});
}

TEST_CASE("cairn_eval: --version and --help say what they are asked, or that they cannot") {
  cairn_test::check_version_and_help(
      [](const std::string& arguments, const std::string& output) { return run(arguments, output); },
      "cairn_eval " CAIRN_VERSION_STRING "\n", "--covariances");
}

TEST_SUITE_END();

}  // namespace cairn_eval_program_test
