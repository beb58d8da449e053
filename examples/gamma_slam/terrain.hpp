// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A piece of rough ground whose every height is known: hollows, rocks, and grass or gravel on them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <cairn/core/linalg.hpp>

namespace gamma_slam {

/// The surface is that of hollows and rocks; what grows or lies on it is rough, and no two looks at it meet
/// the same blade: a height there is the surface's plus a normal number.
class Terrain {
public:
  static constexpr double half_side = 25;  ///< [m]; beyond, the ground goes on as at the border

  explicit Terrain(std::uint64_t seed);

  /// Of the surface [m].
  [[nodiscard]] double height(double x, double y) const noexcept;
  /// Standard deviation of what stands on the surface [m].
  [[nodiscard]] double roughness(double x, double y) const noexcept;
  /// Standard deviation of the heights in a square with this lower corner [m].
  [[nodiscard]] double sigma_in(double left, double bottom, double side) const;

  /// Where a ray meets the surface, up to `reach` metres along it.
  [[nodiscard]] std::optional<cairn::Vector<3>> hit(const cairn::Vector<3>& from,
                                                    const cairn::Vector<3>& direction, double reach) const;

private:
  static constexpr double spacing = 0.05;  // [m]
  static constexpr int side = static_cast<int>(2 * half_side / spacing) + 1;

  void add_bump(double x, double y, double radius, double rise);

  std::vector<float> heights_;
  std::vector<float> waves_;  // of the border between grass and gravel
};

}  // namespace gamma_slam
