// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "summary.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "examples/synthetic_run.hpp"
#include "support/folder.hpp"

using cairn_test::pose;
using cairn_test::straight_run;
using doctest::Approx;
using stereo_slam::RunRecord;
using stereo_slam::summarise;
using stereo_slam::Summary;

namespace summary_test {
namespace {

constexpr double degree = std::numbers::pi / 180.0;

nlohmann::json json_of(const RunRecord& run) {
  return nlohmann::json::parse(stereo_slam::summary_json(run, summarise(run)));
}

}  // namespace

TEST_SUITE_BEGIN("stereo_slam/summary");

TEST_CASE("summary: a run without error has none") {
  const Summary summary = summarise(straight_run(120));
  REQUIRE(summary.errors);
  CHECK(summary.errors->frames == 120);
  CHECK(summary.errors->ate_rmse == Approx(0).epsilon(1e-9));
  CHECK(summary.errors->end == 0.0);
  CHECK(summary.errors->largest.position == 0.0);
  CHECK(summary.errors->largest.heading == 0.0);
  CHECK(*summary.errors->kitti_translation_percent == Approx(0).epsilon(1e-9));
  CHECK_FALSE(summary.errors->revisit);  // straight ahead comes to no place twice
  CHECK(summary.path == Approx(119));
}

TEST_CASE("summary: one percent too far shows in every measure as computed by hand") {
  RunRecord run = straight_run(120);
  for (std::size_t i = 0; i < 120; ++i)
    run.frames[i].T_world_camera = pose(0, 0, 1.01 * static_cast<double>(i));
  const nlohmann::json json = json_of(run);
  CHECK(json["end_error_m"].get<double>() == Approx(1.19));
  CHECK(json["max_position_error_m"].get<double>() == Approx(1.19));
  CHECK(json["max_heading_error_deg"].get<double>() == Approx(0));
  CHECK(json["rpe_trans_m"].get<double>() == Approx(0.01));
  CHECK(json["rpe_rot_deg"].get<double>() == Approx(0));
  // The fit takes the mean of the errors 0, 0.01, ..., 1.19 away: their standard deviation is left.
  CHECK(json["ate_rmse_m"].get<double>() == Approx(0.01 * std::sqrt((120.0 * 120.0 - 1.0) / 12.0)));
  CHECK(json["ate_alignment"] == "rigid");
  // A segment of 100 m ends at the first frame beyond it, after 101 m.
  CHECK(json["kitti_t_rel_percent"].get<double>() == Approx(1.01));
  CHECK(json["path_m"].get<double>() == Approx(119));
}

TEST_CASE("summary: the KITTI measure is null for a path under 100 m") {
  const nlohmann::json json = json_of(straight_run(60));
  CHECK(json["kitti_t_rel_percent"].is_null());
  CHECK(json["ate_rmse_m"].is_number());
}

TEST_CASE("summary: one frame turned by two degrees is the largest heading error and not the end error") {
  RunRecord run = straight_run(50);
  run.frames[20].T_world_camera = pose(0.03, 0, 20, 2 * degree);
  const nlohmann::json json = json_of(run);
  CHECK(json["max_heading_error_deg"].get<double>() == Approx(2));
  CHECK(json["max_position_error_m"].get<double>() == Approx(0.03));
  CHECK(json["end_error_m"].get<double>() == 0.0);
}

TEST_CASE("summary: the second lap disagrees with the first by what was put in") {
  RunRecord run = straight_run(60);
  for (std::size_t i = 0; i < 60; ++i) {  // two laps of 30 frames around a circle
    const double angle = 2 * std::numbers::pi * static_cast<double>(i) / 30.0;
    run.frames[i].truth = pose(std::cos(angle), 0, std::sin(angle), -angle);
    run.frames[i].T_world_camera = *run.frames[i].truth;
    if (i >= 30) run.frames[i].T_world_camera = *run.frames[i].truth * pose(0.02, 0, 0.03, 0.1 * degree);
  }
  // Frame 45 differs from the rest of its lap; frame 15 saw the same place without an error.
  run.frames[45].T_world_camera = *run.frames[45].truth * pose(0.06, 0, 0.08, 0.5 * degree);
  const nlohmann::json json = json_of(run);
  CHECK(json["revisit_pairs"] == 30);
  CHECK(json["revisit_position_m"].get<double>() == Approx(0.1));
  CHECK(json["revisit_heading_deg"].get<double>() == Approx(0.5));
}

TEST_CASE(
    "summary: errors of one sigma in each of six numbers are a NEES of six, ten sigma are above 0.999") {
  auto run = cairn_test::straight_run(40);
  for (auto& frame : run.frames) {
    frame.covariance = 4e-6 * cairn::Matrix<6>::Identity();
    frame.truth = cairn::retract(frame.T_world_camera, cairn::Vector<6>::Constant(0.002));
  }
  run.frames[0].covariance = 1e-12 * cairn::Matrix<6>::Identity();  // the world
  run.frames[7].tracked = false;
  // Known to 5 um and 5 urad, as a camera over a thousand landmarks is: this one counts too.
  run.frames[8].covariance = 25e-12 * cairn::Matrix<6>::Identity();
  run.frames[8].truth = cairn::retract(run.frames[8].T_world_camera, cairn::Vector<6>::Constant(10e-6));
  for (std::size_t i = 30; i < 40; ++i)
    run.frames[i].truth =
        cairn::retract(run.frames[i].T_world_camera, cairn::Vector<6>::Constant(0.02 / std::sqrt(6.0)));
  run.frames.back().keyframes = 12;
  const auto json = json_of(run);
  CHECK(json["pose_nees_mean"].get<double>() == Approx((27 * 6 + 24 + 10 * 100) / 38.0));
  CHECK(json["pose_nees_above_999"].get<double>() == Approx(11 / 38.0));
  CHECK(json["keyframes"] == 12);
  run.truth_laid_on_estimate = true;  // whose error no covariance knows of
  CHECK(json_of(run)["pose_nees_mean"].is_null());
  CHECK(json_of(run)["pose_nees_above_999"].is_null());
  CHECK(json_of(run)["max_position_error_m"].is_number());
  run.truth_laid_on_estimate = false;
  for (auto& frame : run.frames) frame.truth.reset();
  CHECK(json_of(run)["pose_nees_mean"].is_null());
}

TEST_CASE("summary: what meeting a place again was worth, and the path before and after") {
  RunRecord run = straight_run(10);
  for (std::size_t i = 0; i < 10; ++i) {
    run.frames[i].T_world_camera = *run.frames[i].truth * pose(0.3, 0, 0.4);
    run.corrected.push_back(*run.frames[i].truth * pose(0, 0.1, 0));
  }
  CHECK(json_of(run)["loops_closed"] == 0);
  CHECK(json_of(run)["loops"].empty());
  run.loops.push_back({4, 30, 77, *run.frames[4].truth * pose(0.3, 0, 1.4, 2 * degree)});
  run.loops.push_back({5, 31, 78, std::nullopt});
  const nlohmann::json json = json_of(run);
  CHECK(json["loops_closed"] == 2);
  REQUIRE(json["loops"].size() == 1);
  const nlohmann::json& loop = json["loops"][0];
  CHECK(loop["frame"] == 4);
  CHECK(loop["landmarks"] == 30);
  CHECK(loop["frames_away"] == 77);
  CHECK(loop["correction_m"].get<double>() == Approx(1.0));
  CHECK(loop["correction_deg"].get<double>() == Approx(2.0));
  CHECK(loop["error_before_m"].get<double>() == Approx(std::hypot(0.3, 1.4)));
  CHECK(loop["error_after_m"].get<double>() == Approx(0.5));
  CHECK(json["path_rmse_while_driving_m"].get<double>() == Approx(0.5));
  CHECK(json["path_rmse_at_the_end_m"].get<double>() == Approx(0.1));
  run.frames.resize(9);  // a path that is not this run's
  CHECK(json_of(run)["path_rmse_at_the_end_m"].is_null());
}

TEST_CASE("summary: the same place looked at in another direction is no return") {
  RunRecord run = straight_run(60);
  for (std::size_t i = 0; i < 60; ++i)
    run.frames[i].truth = run.frames[i].T_world_camera = pose(0, 0, 0, 3 * degree * static_cast<double>(i));
  CHECK(json_of(run)["revisit_position_m"].is_null());
  CHECK(json_of(run)["revisit_pairs"] == 0);
}

TEST_CASE("summary: a run on the spot falls back to the first pose and says so") {
  RunRecord run = straight_run(10);
  for (auto& frame : run.frames) frame.truth = frame.T_world_camera = pose(0, 0, 0);
  const nlohmann::json json = json_of(run);
  CHECK(json["ate_alignment"] == "first pose");
  CHECK(json["ate_rmse_m"].get<double>() == 0.0);
}

TEST_CASE("summary: without a truth the errors are null and the path is the estimate's") {
  RunRecord run = straight_run(30);
  for (auto& frame : run.frames) frame.truth.reset();
  const nlohmann::json json = json_of(run);
  for (const char* key :
       {"ate_rmse_m", "ate_alignment", "rpe_trans_m", "rpe_rot_deg", "kitti_t_rel_percent", "end_error_m",
        "max_position_error_m", "max_heading_error_deg", "revisit_position_m", "revisit_heading_deg"}) {
    CAPTURE(key);
    REQUIRE(json.contains(key));
    CHECK(json[key].is_null());
  }
  CHECK(json["frames_with_truth"] == 0);
  CHECK(json["path_m"].get<double>() == Approx(29));
}

TEST_CASE("summary: counts and medians are those of the frames, and times are not among them") {
  RunRecord run = straight_run(101);
  run.landmarks.resize(17);
  run.frames[3].tracked = run.frames[4].tracked = false;
  run.notes = {"frame 3 was lost"};
  const nlohmann::json json = json_of(run);
  CHECK(json["dataset"] == "straight");
  CHECK(json["store"] == "multi");
  CHECK(json["seed"] == 7);
  CHECK(json["target_points"] == 2000);
  CHECK(json["frames"] == 101);
  CHECK(json["frames_tracked"] == 99);
  CHECK(json["frames_lost"] == 2);
  CHECK(json["ended_early"].is_null());
  CHECK(json["points_left"] == 1050.0);
  CHECK(json["stereo_matches"] == 550.0);
  CHECK(json["map_matches"] == 350.0);
  CHECK(json["inliers"] == 250.0);
  CHECK(json["landmarks"] == 17);
  CHECK(json["notes"][0] == "frame 3 was lost");
  run.seconds = 5;
  run.threads = 1;
  for (auto& frame : run.frames) frame.milliseconds.fill(7);
  CHECK(json_of(run) == json);
  run.ended_early = "after frame 100: no more light";
  CHECK(json_of(run)["ended_early"] == "after frame 100: no more light");
}

TEST_CASE("summary: what a budget left out is counted by kind, and without one nothing is said of it") {
  RunRecord run = straight_run(10);
  CHECK_FALSE(json_of(run).contains("budget"));
  run.budget = 20;
  for (auto& frame : run.frames) {
    frame.points_wanted = 2000;
    frame.milliseconds.fill(0);
  }
  using stereo_slam::Shed;
  const auto leave_out = [&](std::size_t frame, Shed kind) {
    run.frames[frame].shed.set(static_cast<std::size_t>(kind));
  };
  leave_out(2, Shed::second_look);
  leave_out(2, Shed::points);
  leave_out(3, Shed::points);
  leave_out(7, Shed::tidying);
  run.frames[2].points_wanted = 800;
  run.frames[3].points_wanted = 900;
  run.frames[4].milliseconds.back() = 20.5;
  const nlohmann::json expected = {
      {"ms", 20.0},
      {"frames_over", 1},
      {"frames_shed", 3},
      {"shed", {{"tidying", 1}, {"points", 2}, {"second_look", 1}, {"patches", 0}, {"keyframe", 0}}},
      {"fewest_points", 800}};
  CHECK(json_of(run)["budget"] == expected);
  CHECK(stereo_slam::budget_text(*stereo_slam::summarise(run).budget) ==
        "budget of 20 ms a frame: 3 of 10 frames left work out, tidying 1 times, points 2 times (at least "
        "800 an "
        "image), second look 1 times; 1 took longer");
}

TEST_CASE("timing: what differs from run to run stands here, for the run and for every frame") {
  const RunRecord run = straight_run(101);
  const auto json = nlohmann::json::parse(stereo_slam::timing_json(run));
  CHECK(json["threads"] == 2);
  CHECK(json["seconds"] == 4.0);
  CHECK(json["hz"].get<double>() == Approx(101.0 / 4));
  REQUIRE(json["stage_ms"].size() == stereo_slam::stage_names.size());
  for (std::size_t stage = 0; stage < stereo_slam::stage_names.size(); ++stage) {
    const char* name = stereo_slam::stage_names[stage];
    CHECK(json["stage_ms"][name]["median"].get<double>() == Approx(50.0 + static_cast<double>(stage)));
    CHECK(json["stage_ms"][name]["p95"].get<double>() == Approx(95.0 + static_cast<double>(stage)));
    REQUIRE(json["frame_ms"][name].size() == 101);
    CHECK(json["frame_ms"][name][30].get<double>() == 30.0 + static_cast<double>(stage));
  }
}

TEST_CASE("timing: what is not finite becomes null, not invalid JSON") {
  RunRecord run = straight_run(5);
  run.seconds = std::numeric_limits<double>::infinity();
  CHECK(nlohmann::json::parse(stereo_slam::timing_json(run))["seconds"].is_null());
}

TEST_CASE("summary: a run without frames is refused") {
  for (const std::string& message : {cairn_test::message_of([] { (void)summarise(RunRecord{}); }),
                                     cairn_test::message_of([] { (void)stereo_slam::timing(RunRecord{}); })})
    CHECK(message.find("at least one frame") != std::string::npos);
}

TEST_SUITE_END();

}  // namespace summary_test
