// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "batch.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>

#include "support/sparse_least_squares.hpp"

namespace line_slam {

namespace {

using cairn::Matrix;
using cairn::SE3;
using cairn::Vector;

struct SightingOfLine {
  std::size_t frame, index, line;
};
struct Estimate {
  std::vector<SE3> poses;
  std::vector<MappedLine> lines;
};

/// Which lines were seen along a path, and where the map of that path has them.
std::vector<SightingOfLine> associated(const Drive& drive, Estimate& estimate, Map map) {
  std::vector<SightingOfLine> all, kept;
  cairn::Random none(1);  // the likeliest are no draw
  std::uint32_t numbers = 0;
  for (std::size_t k = 0; k < estimate.poses.size(); ++k) {
    const auto& seen = drive.frames[k].seen;
    const cairn::Association choice = map.choose(estimate.poses[k], seen, none).choice;
    for (std::size_t i = 0; i < choice.size(); ++i) {
      const bool is_new = choice[i] == cairn::new_landmark;
      if (choice[i] != cairn::no_landmark)
        all.push_back({k, i, is_new ? seen[i].identity.value_or(numbers) : choice[i]});
      numbers += is_new;
    }
    map.insert(estimate.poses[k], seen, choice);
  }
  std::map<std::size_t, std::size_t> place;  // of a line of the map among the estimate's
  for (SightingOfLine s : all) {
    const auto* landmark = map.find(static_cast<std::uint32_t>(s.line));
    if (landmark == nullptr) continue;
    const auto [at, is_new] = place.try_emplace(s.line, estimate.lines.size());
    if (is_new) estimate.lines.push_back(landmark->belief.mean);
    s.line = at->second;
    kept.push_back(s);
  }
  return kept;
}

/// The least squares problem of these sightings: unknowns are steps of the poses, then of the lines.
class Problem {
public:
  Problem(const Drive& drive, const LineSensor& sensor, std::vector<SightingOfLine> sightings)
      : drive_(drive), sensor_(sensor), sightings_(std::move(sightings)) {}

  /// Their cost is not finite where a line has left the cameras' front.
  [[nodiscard]] example::NormalEquations equations_at(const Estimate& at) const {
    const int poses = 6 * static_cast<int>(at.poses.size());
    example::NormalEquations equations(poses + 4 * static_cast<int>(at.lines.size()));
    for (std::size_t k = 0; k < at.poses.size(); ++k)
      add_motion(equations, drive_.frames[k].moved, k == 0 ? drive_.truth.front() : at.poses[k - 1],
                 at.poses[k], k);
    for (const SightingOfLine& s : sightings_)
      add_sighting(equations, sensor_.of(drive_.frames[s.frame].seen[s.index].z), at, s);
    return equations;
  }
  [[nodiscard]] static Estimate moved(const Estimate& at, const Eigen::VectorXd& d) {
    Estimate next = at;
    const int poses = 6 * static_cast<int>(at.poses.size());
    for (std::size_t k = 0; k < next.poses.size(); ++k)
      next.poses[k] = cairn::retract(next.poses[k], Vector<6>(d.segment<6>(6 * static_cast<int>(k))));
    for (std::size_t n = 0; n < next.lines.size(); ++n)
      next.lines[n] = cairn::retract(next.lines[n], Vector<4>(d.segment<4>(poses + 4 * static_cast<int>(n))));
    return next;
  }

private:
  /// The steps of a drive err in each direction by itself.
  static void add_motion(example::NormalEquations& to, const cairn::Gaussian<SE3>& moved, const SE3& before,
                         const SE3& pose, std::size_t k) {
    const Vector<6> information = moved.covariance.diagonal().cwiseInverse();
    const Vector<6> e = cairn::local(before * moved.mean, pose);
    const Matrix<6> by_before = -(pose.inverse() * before).adjoint();
    const Matrix<6> weighed = information.asDiagonal() * by_before;
    const int row = 6 * static_cast<int>(k);
    to.add_cost(0.5 * e.dot(information.cwiseProduct(e)));
    to.add_block(row, row, Matrix<6>(information.asDiagonal()));
    to.add_gradient(row, Vector<6>(information.cwiseProduct(e)));
    if (k == 0) return;
    to.add_block(row, row - 6, weighed);
    to.add_block(row - 6, row - 6, Matrix<6>(by_before.transpose() * weighed));
    to.add_gradient(row - 6, Vector<6>(weighed.transpose() * e));
  }

  /// Half of c^2 chi^2 / (c^2 + chi^2) is what one that is wrong may cost at most: half of c^2.
  static void add_sighting(example::NormalEquations& to, const EndsOfSighting& model, const Estimate& at,
                           const SightingOfLine& s) {
    constexpr double c_squared = 9;
    const SE3& x = at.poses[s.frame];
    const MappedLine& line = at.lines[s.line];
    const Vector<6> e = model.predict(x, line) / model.sigma;
    const double chi_squared = e.squaredNorm(), share = c_squared / (c_squared + chi_squared);
    to.add_cost(0.5 * share * chi_squared);
    const Matrix<6> by_pose = share * model.state_jacobian(x, line) / model.sigma;
    const Matrix<6, 4> by_line = share * model.part_jacobian(x, line) / model.sigma;
    const int row = 6 * static_cast<int>(s.frame);
    const int line_row = 6 * static_cast<int>(at.poses.size()) + 4 * static_cast<int>(s.line);
    to.add_block(row, row, Matrix<6>(by_pose.transpose() * by_pose));
    to.add_block(line_row, line_row, Matrix<4>(by_line.transpose() * by_line));
    to.add_block(line_row, row, Matrix<4, 6>(by_line.transpose() * by_pose));
    to.add_gradient(row, Vector<6>(share * by_pose.transpose() * e));
    to.add_gradient(line_row, Vector<4>(share * by_line.transpose() * e));
  }

  const Drive& drive_;
  const LineSensor& sensor_;
  std::vector<SightingOfLine> sightings_;
};

}  // namespace

std::vector<SE3> smoothed(const Drive& drive, const std::vector<SE3>& path, const Map& empty) {
  if (path.size() > drive.frames.size())
    cairn::raise("smoothed: expected a path of the drive's frames, found more poses");
  if (path.empty()) return path;
  Estimate at{path, {}};
  const Problem problem(drive, empty.sensor(), associated(drive, at, empty));
  return example::levenberg(std::move(at), [&](const Estimate& e) { return problem.equations_at(e); },
                            &Problem::moved,
                            {.most_iterations = 30, .most_damping = 1e10, .least_gain = 1e-6})
      .at.poses;
}

}  // namespace line_slam
