// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "summary.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include <nlohmann/json.hpp>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/eval/consistency.hpp>
#include <cairn/eval/kitti_metric.hpp>
#include <cairn/eval/trajectory_error.hpp>
#include <cairn/io/text.hpp>

namespace stereo_slam {
namespace {

double median_over_frames(const RunRecord& run, int FrameRecord::* count) {
  std::vector<double> values;
  for (const FrameRecord& frame : run.frames) values.push_back(frame.*count);
  return cairn::median(std::move(values));
}

StageTime stage_time(const RunRecord& run, std::size_t stage) {
  std::vector<double> values;
  for (const FrameRecord& frame : run.frames) values.push_back(frame.milliseconds[stage]);
  return {cairn::median(values), cairn::quantile(values, 0.95)};
}

double path_length(const RunRecord& run) {
  const bool all_true = std::all_of(run.frames.begin(), run.frames.end(),
                                    [](const FrameRecord& frame) { return frame.truth.has_value(); });
  const auto position = [&](const FrameRecord& frame) {
    return all_true ? frame.truth->translation() : frame.T_world_camera.translation();
  };
  double length = 0;
  for (std::size_t i = 1; i < run.frames.size(); ++i)
    length += (position(run.frames[i]) - position(run.frames[i - 1])).norm();
  return length;
}

std::optional<PoseConsistency> consistency_of(const RunRecord& run) {
  if (run.truth_laid_on_estimate) return std::nullopt;
  const double limit = cairn::chi_square_quantile(0.999, 6);
  PoseConsistency result;
  for (const FrameRecord& frame : run.frames)
    if (const auto nees = pose_nees(frame)) {
      ++result.frames;
      result.nees_mean += *nees;
      result.nees_above_999 += *nees > limit ? 1 : 0;
    }
  if (result.frames == 0) return std::nullopt;
  result.nees_mean /= static_cast<double>(result.frames);
  result.nees_above_999 /= static_cast<double>(result.frames);
  return result;
}

TruthErrors errors_against(const std::vector<cairn::PosePair>& pairs) {
  TruthErrors errors;
  errors.frames = pairs.size();
  errors.ate_alignment = "rigid";
  auto absolute = cairn::absolute_error(pairs, cairn::AlignBy::rigid);
  if (!absolute) {
    errors.ate_alignment = "first pose";
    absolute = cairn::absolute_error(pairs, cairn::AlignBy::first_pose);
  }
  errors.ate_rmse = absolute->translation.rmse;
  if (const auto relative = cairn::relative_error(pairs)) {
    errors.rpe_translation = relative->translation.rmse;
    errors.rpe_rotation = relative->rotation.rmse;
  }
  if (const auto kitti = cairn::kitti_error(pairs))
    errors.kitti_translation_percent = kitti->overall.translation_percent();
  for (const cairn::PosePair& pair : pairs) {
    const FrameError error = frame_error(pair.estimate, pair.truth);
    errors.largest.position = std::max(errors.largest.position, error.position);
    errors.largest.heading = std::max(errors.largest.heading, error.heading);
    errors.end = error.position;
  }
  errors.revisit = revisit_error(pairs);
  return errors;
}

/// The pair before j, by more than frames_apart, whose true place is nearest and the same; the first of
/// equally near ones.
std::optional<std::size_t> earlier_at_same_place(const std::vector<cairn::PosePair>& pairs, std::size_t j,
                                                 const RevisitOptions& options) {
  const double* here = pairs[j].truth.translation().data();
  std::optional<std::size_t> nearest;
  double smallest = options.distance * options.distance;
  for (std::size_t i = 0; i + options.frames_apart < j; ++i) {
    const double* there = pairs[i].truth.translation().data();
    const double x = here[0] - there[0], y = here[1] - there[1], z = here[2] - there[2];
    const double squared = x * x + y * y + z * z;
    if (squared > smallest || (nearest && squared == smallest)) continue;
    if ((pairs[i].truth.rotation().inverse() * pairs[j].truth.rotation()).angle() > options.angle) continue;
    nearest = i;
    smallest = squared;
  }
  return nearest;
}

std::optional<BudgetEffect> budget_effect(const RunRecord& run) {
  if (!run.budget) return std::nullopt;
  BudgetEffect effect{.milliseconds = *run.budget, .frames = run.frames.size()};
  effect.fewest_points = run.target_points;
  for (const FrameRecord& frame : run.frames) {
    effect.frames_over += frame.milliseconds[static_cast<std::size_t>(Stage::total)] > *run.budget ? 1U : 0U;
    effect.frames_shed += frame.shed.any() ? 1U : 0U;
    for (std::size_t kind = 0; kind < shed_names.size(); ++kind)
      effect.shed[kind] += frame.shed[kind] ? 1U : 0U;
    effect.fewest_points = std::min(effect.fewest_points, frame.points_wanted);
  }
  return effect;
}

void expect_frames(const RunRecord& run) {
  if (run.frames.empty()) cairn::raise("summary of a run: expected at least one frame, found none");
}

using Json = nlohmann::ordered_json;

std::string text_of(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

/// A number, or null where there is none or it is not finite.
Json number(std::optional<double> value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}

Json loops_json(const Summary& summary) {
  Json loops = Json::array();
  const auto append = [](Json& one, const std::string& name, const std::optional<FrameError>& error) {
    one[name + "_m"] = error ? number(error->position) : Json(nullptr);
    one[name + "_deg"] = error ? number(error->heading * degrees) : Json(nullptr);
  };
  for (const LoopEffect& loop : summary.loops) {
    Json one;
    one["frame"] = loop.frame;
    one["landmarks"] = loop.landmarks;
    one["frames_away"] = loop.away;
    append(one, "correction", loop.correction);
    append(one, "error_before", loop.before);
    append(one, "error_after", loop.after);
    loops.push_back(std::move(one));
  }
  return loops;
}

void append_errors(Json& json, const Summary& summary) {
  const auto& errors = summary.errors;
  const auto of = [&](auto&& get) -> Json { return errors ? number(get(*errors)) : Json(nullptr); };
  const auto in_degrees = [](std::optional<double> angle) -> std::optional<double> {
    return angle ? std::optional(*angle * degrees) : std::nullopt;
  };
  json["frames_with_truth"] = errors ? errors->frames : 0;
  json["ate_rmse_m"] = of([](const TruthErrors& e) { return std::optional(e.ate_rmse); });
  json["ate_alignment"] = errors ? Json(errors->ate_alignment) : Json(nullptr);
  json["rpe_trans_m"] = of([](const TruthErrors& e) { return e.rpe_translation; });
  json["rpe_rot_deg"] = of([&](const TruthErrors& e) { return in_degrees(e.rpe_rotation); });
  json["kitti_t_rel_percent"] = of([](const TruthErrors& e) { return e.kitti_translation_percent; });
  json["end_error_m"] = of([](const TruthErrors& e) { return std::optional(e.end); });
  json["path_m"] = number(summary.path);
  json["max_position_error_m"] = of([](const TruthErrors& e) { return std::optional(e.largest.position); });
  json["max_heading_error_deg"] = of([&](const TruthErrors& e) { return in_degrees(e.largest.heading); });
  const std::optional<RevisitError> revisit = errors ? errors->revisit : std::nullopt;
  json["revisit_position_m"] = revisit ? number(revisit->position) : Json(nullptr);
  json["revisit_heading_deg"] = revisit ? number(revisit->heading * degrees) : Json(nullptr);
  json["revisit_pairs"] = revisit ? revisit->pairs : 0;
  const std::optional<PoseConsistency> consistency = errors ? errors->consistency : std::nullopt;
  json["pose_nees_mean"] = consistency ? number(consistency->nees_mean) : Json(nullptr);
  json["pose_nees_above_999"] = consistency ? number(consistency->nees_above_999) : Json(nullptr);
}

}  // namespace

std::vector<cairn::PosePair> truth_pairs(const RunRecord& run) {
  std::vector<cairn::PosePair> pairs;
  for (const FrameRecord& frame : run.frames)
    if (frame.truth) pairs.push_back({frame.time, *frame.truth, frame.T_world_camera});
  return pairs;
}

FrameError frame_error(const cairn::SE3& estimate, const cairn::SE3& truth) {
  return {(estimate.translation() - truth.translation()).norm(),
          (truth.rotation().inverse() * estimate.rotation()).angle()};
}

std::optional<double> pose_nees(const FrameRecord& frame) {
  if (!frame.truth || !frame.tracked || !(frame.covariance.diagonal().minCoeff() > gauge_variance))
    return std::nullopt;
  return cairn::normalised_squared(cairn::local(frame.T_world_camera, *frame.truth), frame.covariance);
}

std::optional<RevisitError> revisit_error(const std::vector<cairn::PosePair>& pairs,
                                          const RevisitOptions& options) {
  RevisitError result;
  for (std::size_t j = options.frames_apart + 1; j < pairs.size(); ++j) {
    const auto i = earlier_at_same_place(pairs, j, options);
    if (!i) continue;
    const cairn::PosePair& before = pairs[*i];
    const FrameError error =
        frame_error(before.estimate.inverse() * pairs[j].estimate, before.truth.inverse() * pairs[j].truth);
    result.position = std::max(result.position, error.position);
    result.heading = std::max(result.heading, error.heading);
    ++result.pairs;
  }
  if (result.pairs == 0) return std::nullopt;
  return result;
}

std::vector<LoopEffect> loop_effects(const RunRecord& run) {
  std::vector<LoopEffect> effects;
  for (const LoopClosure& loop : run.loops) {
    if (!loop.T_world_before || loop.frame >= run.frames.size()) continue;
    const FrameRecord& frame = run.frames[loop.frame];
    LoopEffect effect{frame.index, loop.landmarks,
                      loop.away,   frame_error(frame.T_world_camera, *loop.T_world_before),
                      {},          {}};
    if (frame.truth) {
      effect.before = frame_error(*loop.T_world_before, *frame.truth);
      effect.after = frame_error(frame.T_world_camera, *frame.truth);
    }
    effects.push_back(effect);
  }
  return effects;
}

std::optional<PathError> path_error(const RunRecord& run) {
  if (run.corrected.size() != run.frames.size()) return std::nullopt;
  PathError sum;
  std::size_t count = 0;
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    const FrameRecord& frame = run.frames[i];
    if (!frame.truth) continue;
    const cairn::Vector<3>& truth = frame.truth->translation();
    sum.while_driving += (frame.T_world_camera.translation() - truth).squaredNorm();
    sum.at_the_end += (run.corrected[i].translation() - truth).squaredNorm();
    ++count;
  }
  if (count == 0) return std::nullopt;
  const auto frames = static_cast<double>(count);
  return PathError{std::sqrt(sum.while_driving / frames), std::sqrt(sum.at_the_end / frames)};
}

Summary summarise(const RunRecord& run) {
  expect_frames(run);
  Summary summary;
  summary.frames = run.frames.size();
  for (const FrameRecord& frame : run.frames) {
    summary.frames_tracked += frame.tracked ? 1 : 0;
    summary.frames_carried += frame.carried ? 1 : 0;
    summary.frames_bridged += frame.bridged ? 1 : 0;
    summary.relocalisations += frame.relocalised ? 1 : 0;
  }
  summary.frames_lost = summary.frames - summary.frames_tracked;
  summary.points_left = median_over_frames(run, &FrameRecord::points_left);
  summary.stereo_matches = median_over_frames(run, &FrameRecord::stereo_matches);
  summary.map_matches = median_over_frames(run, &FrameRecord::map_matches);
  summary.inliers = median_over_frames(run, &FrameRecord::inliers);
  summary.landmarks = run.landmarks.size();
  summary.path = path_length(run);
  summary.budget = budget_effect(run);
  summary.loops_closed = run.loops.size();
  summary.loops = loop_effects(run);
  summary.path_error = path_error(run);
  const std::vector<cairn::PosePair> pairs = truth_pairs(run);
  summary.keyframes = run.frames.back().keyframes;
  if (pairs.empty()) return summary;
  summary.errors = errors_against(pairs);
  summary.errors->consistency = consistency_of(run);
  return summary;
}

std::string budget_text(const BudgetEffect& effect) {
  std::string text = "budget of " + cairn::shortest(effect.milliseconds) +
                     " ms a frame: " + std::to_string(effect.frames_shed) + " of " +
                     std::to_string(effect.frames) + " frames left work out";
  for (std::size_t kind = 0; kind < shed_names.size(); ++kind) {
    if (effect.shed[kind] == 0) continue;
    std::string name = shed_names[kind];
    std::ranges::replace(name, '_', ' ');
    text += ", " + name + " " + std::to_string(effect.shed[kind]) + " times";
    if (kind == static_cast<std::size_t>(Shed::points))
      text += " (at least " + std::to_string(effect.fewest_points) + " an image)";
  }
  return text + "; " + std::to_string(effect.frames_over) + " took longer";
}

std::string summary_json(const RunRecord& run, const Summary& summary) {
  Json json;
  json["dataset"] = run.dataset;
  json["frames"] = summary.frames;
  json["frames_tracked"] = summary.frames_tracked;
  json["frames_lost"] = summary.frames_lost;
  json["frames_carried"] = summary.frames_carried;
  json["frames_bridged"] = summary.frames_bridged;
  json["poses_refused"] = run.refused;
  json["relocalisations"] = summary.relocalisations;
  json["ended_early"] = run.ended_early ? Json(*run.ended_early) : Json(nullptr);
  json["points_left"] = number(summary.points_left);
  json["stereo_matches"] = number(summary.stereo_matches);
  json["map_matches"] = number(summary.map_matches);
  json["inliers"] = number(summary.inliers);
  json["landmarks"] = summary.landmarks;
  json["keyframes"] = summary.keyframes;
  json["landmarks_merged"] = run.merged;
  json["landmarks_aged"] = run.aged;
  json["loops_closed"] = summary.loops_closed;
  json["loops"] = loops_json(summary);
  json["path_rmse_while_driving_m"] =
      summary.path_error ? number(summary.path_error->while_driving) : Json(nullptr);
  json["path_rmse_at_the_end_m"] =
      summary.path_error ? number(summary.path_error->at_the_end) : Json(nullptr);
  append_errors(json, summary);
  json["features"] = run.features;
  json["store"] = run.store;
  json["motion"] = run.motion;
  json["seed"] = run.seed;
  json["variance_factor"] = number(run.variance_factor);
  Json& calibration = json["calibration"];
  calibration["on"] = run.calibration.on;
  calibration["why"] = run.calibration.why;
  for (int i = 0; run.calibration.on && i < cairn::rig_numbers; ++i) {
    if (!(run.calibration.sigmas(i) > 0)) continue;
    const char* const unit = i < 5 ? "_rad" : i < 8 ? "_relative" : "_focal_lengths";
    Json& one = calibration[std::string(cairn::rig_number_names[static_cast<std::size_t>(i)]) + unit];
    one["value"] = number(run.calibration.numbers(i));
    one["sigma"] = number(run.calibration.sigmas(i));
  }
  Json& riding_along = json["riding_along"];
  riding_along["since_frame"] = run.riding_along.since ? Json(*run.riding_along.since) : Json(nullptr);
  riding_along["share_of_image"] = number(run.riding_along.share);
  riding_along["largest_share_of_image"] = number(run.riding_along.largest_share);
  json["target_points"] = run.target_points;
  if (summary.budget) {
    Json& budget = json["budget"];
    budget["ms"] = number(summary.budget->milliseconds);
    budget["frames_over"] = summary.budget->frames_over;
    budget["frames_shed"] = summary.budget->frames_shed;
    for (std::size_t kind = 0; kind < shed_names.size(); ++kind)
      budget["shed"][shed_names[kind]] = summary.budget->shed[kind];
    budget["fewest_points"] = summary.budget->fewest_points;
  }
  json["notes"] = run.notes;
  return text_of(json);
}

Timing timing(const RunRecord& run) {
  expect_frames(run);
  Timing timing;
  timing.seconds = run.seconds;
  timing.hz = run.seconds > 0 ? static_cast<double>(run.frames.size()) / run.seconds : 0;
  for (std::size_t stage = 0; stage < stage_names.size(); ++stage)
    timing.stages[stage] = stage_time(run, stage);
  return timing;
}

std::string timing_json(const RunRecord& run) {
  const Timing times = timing(run);
  Json json;
  json["frames"] = run.frames.size();
  json["threads"] = run.threads;
  json["seconds"] = number(times.seconds);
  json["hz"] = number(times.hz);
  for (std::size_t stage = 0; stage < stage_names.size(); ++stage) {
    Json& of_stage = json["stage_ms"][stage_names[stage]];
    of_stage["median"] = number(times.stages[stage].median);
    of_stage["p95"] = number(times.stages[stage].p95);
    for (const FrameRecord& frame : run.frames)
      json["frame_ms"][stage_names[stage]].push_back(number(frame.milliseconds[stage]));
  }
  return text_of(json);
}

}  // namespace stereo_slam
