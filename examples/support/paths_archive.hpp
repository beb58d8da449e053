// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Beliefs and particles' paths in the plane as parts of a file (archive.hpp), and what they have to be.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/io/carmen.hpp>
#include <cairn/manifold/se2.hpp>

#include "archive.hpp"

namespace cairn {
inline namespace CAIRN_ABI {

// Found by the archive, beside the types.
template <class Archive, Manifold X>
void parts(Archive& archive, Gaussian<X>& belief) {
  archive(belief.mean, belief.covariance);
}
template <class Archive>
void parts(Archive& archive, PathsRecord<SE2>::Node& n) {
  archive(n.pose.pose, n.pose.drawn_from, n.pose.before, n.pose.drawn, n.pose.step, n.parent);
}
template <class Archive>
void parts(Archive& archive, PathsRecord<SE2>::Particle& p) {
  archive(p.node, p.log_evidence, p.log_weight, p.regime);
}
template <class Archive>
void parts(Archive& archive, PathsRecord<SE2>& r) {
  archive(r.nodes, r.particles, r.step);
}

}  // namespace CAIRN_ABI
}  // namespace cairn

namespace example {

/// As the reader of logs has it: sums and products of such places are numbers.
inline void expect_place(const Reader& reader, const cairn::SE2& pose) {
  if (!(std::abs(pose.x()) <= cairn::farthest_odometry && std::abs(pose.y()) <= cairn::farthest_odometry))
    reader.refuse("a pose lies more than 1e9 m away");
}

inline void expect_covariance(const Reader& reader, const cairn::Matrix<3>& covariance) {
  try {
    static_cast<void>(cairn::Gaussian<cairn::SE2>::checked(cairn::SE2(), covariance));
  } catch (const cairn::Error& error) {
    reader.refuse(error.what());
  }
}

/// A path of `poses` for every particle, each pose with its place on it; parents before their children; the
/// newest motion in one of so many regimes.
inline void expect_paths(const Reader& reader, const cairn::PathsRecord<cairn::SE2>& record,
                         std::size_t poses, std::size_t regimes) {
  std::vector<std::uint64_t> length;
  for (const auto& node : record.nodes) {
    const bool first = node.parent == std::numeric_limits<std::uint32_t>::max();
    if (!first && node.parent >= length.size()) reader.refuse("a pose comes before the one it follows");
    length.push_back(first ? 1 : length[node.parent] + 1);
    if (node.pose.step + 1 != length.back()) reader.refuse("a pose is not where it stands on its path");
    for (const cairn::SE2& pose :
         {node.pose.pose, node.pose.before, node.pose.drawn, node.pose.drawn_from.mean})
      expect_place(reader, pose);
    expect_covariance(reader, node.pose.drawn_from.covariance);
  }
  for (const auto& particle : record.particles) {
    if (particle.node >= length.size() || length[particle.node] != poses)
      reader.refuse("a particle's path is not as long as the map's");
    if (particle.regime >= regimes) reader.refuse("a particle moves in a way that there is not");
  }
  if (record.step + 1 != poses) reader.refuse("the steps are not as many as those of the paths");
}

}  // namespace example
