// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "evaluate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/eval/consistency.hpp>
#include <cairn/io/text.hpp>

namespace cairn_eval {

namespace {

using cairn::AlignBy;
using cairn::Matrix;
using cairn::PosePair;
using cairn::SE3;
using cairn::Vector;

/// By the first line that is neither blank nor a comment.
Format format_of(const std::filesystem::path& path) {
  cairn::TextLines lines(path, "a trajectory");
  constexpr const char* expected =
      "a trajectory: TUM (8 numbers between blanks), KITTI (12) or EuRoC (8 or more between commas)";
  if (!lines.next()) lines.fail(expected);
  std::array<double, 12> first{};
  if (lines.line().find(',') != std::string_view::npos) return Format::euroc;
  const std::size_t fields = lines.numbers(' ', first.data(), first.size());
  if (fields == 8) return Format::tum;
  if (fields == 12) return Format::kitti;
  lines.fail(expected);
}

std::vector<PosePair> paired(const TrajectoryFile& truth, const TrajectoryFile& estimate,
                             const cairn::AssociationOptions& options) {
  if (!truth.has_times && !estimate.has_times) {
    if (truth.poses.size() != estimate.poses.size())
      cairn::raise(estimate.path.string() + ": expected as many poses as " + truth.path.string() +
                   " has, as neither has times, found " + std::to_string(estimate.poses.size()) + " and " +
                   std::to_string(truth.poses.size()));
    return associate_by_index(truth.poses, estimate.poses);
  }
  if (!truth.has_times || !estimate.has_times)
    cairn::raise((truth.has_times ? estimate : truth).path.string() +
                 ": a KITTI file has no times, and the other file has: give its times.txt with --times");
  std::vector<PosePair> pairs = associate(truth.poses, estimate.poses, options);
  // Of times in other units, or of another clock, one may coincide: the first, at 0.
  const bool by_chance = pairs.size() == 1 && truth.poses.size() > 1 && estimate.poses.size() > 1;
  if (pairs.empty() || by_chance)
    cairn::raise(estimate.path.string() + (by_chance ? ": only one pose within " : ": no pose within ") +
                 cairn::shortest(options.largest_difference) + " s of a true one (its times are " +
                 cairn::shortest(estimate.poses.front().time) + " to " +
                 cairn::shortest(estimate.poses.back().time) + ", the truth's " +
                 cairn::shortest(truth.poses.front().time) + " to " +
                 cairn::shortest(truth.poses.back().time) + "; see --offset and --max-difference)");
  return pairs;
}

std::optional<cairn::KittiError> kitti_of(const TrajectoryFile& truth, const TrajectoryFile& estimate,
                                          const Evaluation& result, const cairn::KittiOptions& options) {
  // Published figures are computed from the digits of the files (docs/evaluation.md).
  if (truth.rows.size() == estimate.rows.size() && truth.rows.size() == result.pairs.size())
    return kitti_error(truth.rows, estimate.rows, options);
  return kitti_error(result.pairs, options);
}

/// The covariance of a time, or null. Times are written with fewer digits than they have.
const StampedCovariance* at_time(const std::vector<StampedCovariance>& rows, double time) {
  const auto found = std::lower_bound(rows.begin(), rows.end(), time - 1e-6,
                                      [](const StampedCovariance& c, double t) { return c.time < t; });
  return found != rows.end() && found->time <= time + 1e-6 ? &*found : nullptr;
}

/// Whether covariances can go with poses. Without times pose k has the number k for its time, which is no
/// second of the covariances: they go row by row.
void check(const CovarianceFile& covariances, const TrajectoryFile& estimate, AlignBy align) {
  if (align == AlignBy::similarity)
    cairn::raise("a covariance speaks of metres: NEES after --align similarity has no meaning");
  if (!estimate.has_times && covariances.rows.size() != estimate.poses.size())
    cairn::raise(covariances.path.string() + ": expected a covariance for each of the " +
                 std::to_string(estimate.poses.size()) + " poses of " + estimate.path.string() +
                 ", which has no times, found " + std::to_string(covariances.rows.size()) +
                 ": give its times.txt with --times");
}

NeesFigures nees_of(const Evaluation& result, bool has_times, const CovarianceFile& covariances) {
  NeesFigures figures;
  const SE3 T_estimate_truth = result.absolute.T_truth_estimate.inverse();
  cairn::ConsistencyTest test(6);
  for (std::size_t k = 0; k < result.pairs.size(); ++k) {
    const PosePair& pair = result.pairs[k];
    const StampedCovariance* const row =
        has_times ? at_time(covariances.rows, pair.time) : &covariances.rows[k];
    if (row == nullptr) {
      ++figures.missing;
      continue;
    }
    const Vector<6> d = local(pair.estimate, SE3(T_estimate_truth * pair.truth));
    const auto value = cairn::normalised_squared(d, row->covariance);
    if (!value) {
      ++figures.no_inverse;
      continue;
    }
    test.add(*value);
    figures.times.push_back(pair.time);
    figures.values.push_back(*value);
  }
  if (test.count() == 0)
    cairn::raise(covariances.path.string() + ": no covariance to use: " + std::to_string(figures.missing) +
                 " poses have none of their time, those of " + std::to_string(figures.no_inverse) +
                 " have no inverse");
  figures.mean = test.mean();
  figures.band = test.band();
  return figures;
}

}  // namespace

TrajectoryFile read_trajectory(const std::filesystem::path& path, Format format,
                               const std::filesystem::path& times) {
  TrajectoryFile file{path, format == Format::automatic ? format_of(path) : format, true, {}, {}};
  switch (file.format) {
    case Format::automatic:
    case Format::tum:
      file.poses = cairn::read_tum(path);
      break;
    case Format::euroc:
      file.poses = cairn::read_euroc(path);
      break;
    case Format::kitti:
      file.has_times = !times.empty();
      file.poses = times.empty() ? cairn::read_kitti(path) : cairn::read_kitti(path, times);
      file.rows = cairn::read_kitti_rows(path);
      break;
  }
  return file;
}

CovarianceFile read_covariances(const std::filesystem::path& path) {
  constexpr std::size_t columns = 3 + 21;
  cairn::TextLines lines(path, "covariances of a trajectory");
  constexpr const char* names = "a line of names: frame,time,tracked,x_x,x_y, ... rz_rz";
  if (!lines.next('\0') || lines.line().substr(0, 19) != "frame,time,tracked,") lines.fail(names);
  CovarianceFile file{path, {}};
  std::array<double, columns> n{};
  while (lines.next('\0')) {
    if (lines.numbers(',', n.data(), columns) != columns)
      lines.fail("24 numbers: frame, time, tracked and the 21 of the upper triangle");
    StampedCovariance one{n[1], Matrix<6>::Zero()};
    std::size_t at = 3;
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) one.covariance(i, j) = one.covariance(j, i) = n[at++];
    if (!file.rows.empty() && one.time < file.rows.back().time) lines.fail("times that do not run backwards");
    file.rows.push_back(one);
  }
  if (file.rows.empty()) lines.fail("at least one line of 24 numbers");
  return file;
}

Evaluation evaluate(const TrajectoryFile& truth, const TrajectoryFile& estimate,
                    const std::optional<CovarianceFile>& covariances, const EvaluationOptions& options) {
  Evaluation result;
  result.pairs = paired(truth, estimate, options.association);
  result.poses = estimate.poses.size();
  result.length = cairn::path_distances(result.pairs).back();
  const auto absolute = absolute_error(result.pairs, options.align);
  if (!absolute)
    cairn::raise(
        estimate.path.string() +
        ": nothing to align by: all positions of the estimate or of the truth are one (--align none)");
  result.absolute = *absolute;
  result.relative = relative_error(result.pairs, options.relative);
  result.kitti = kitti_of(truth, estimate, result, options.kitti);
  if (covariances) {
    check(*covariances, estimate, options.align);
    result.has_covariances = true;
    if (absolute->rotation) result.nees = nees_of(result, estimate.has_times, *covariances);
  }
  return result;
}

}  // namespace cairn_eval
