// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "patch_alignment.hpp"

#include <array>
#include <cmath>

#include <Eigen/Cholesky>

#include <cairn/core/linalg.hpp>

namespace stereo_slam {
namespace {

constexpr int patch_half = 5;
constexpr int patch_side = 2 * patch_half + 1;
constexpr int patch_pixels = patch_side * patch_side;
constexpr int most_steps = 12;
constexpr float farthest = 2.0F;  // [pixels] from the start: beyond it the match itself was wrong
constexpr float settled = 0.01F;  // [pixels]

/// Grey levels of a patch, row by row; the rest, which fills the vector registers, is zero.
constexpr int padded = 128;
using Patch = Eigen::Array<float, padded, 1>;

bool inside(cairn::ImageView image, float x, float y, float margin) {
  return x >= margin && y >= margin && x < static_cast<float>(image.width()) - 1 - margin &&
         y < static_cast<float>(image.height()) - 1 - margin;
}

/// Subtracts the mean; returns the root of the sum of squares that is left.
float centre(Patch& patch) {
  const float mean = patch.sum() / patch_pixels;
  patch.head<patch_pixels>() -= mean;
  return std::sqrt(patch.square().sum());
}

/// The left patch and what its grey levels do under the four parameters (d_u, d_v, a, b).
struct Template {
  Patch grey = Patch::Zero();
  std::array<Patch, 4> slopes{Patch::Zero(), Patch::Zero(), Patch::Zero(), Patch::Zero()};
  float norm = 0;
  Eigen::LDLT<cairn::Matrix<4, 4, float>> normal_equations;
};

/// Fills grey levels and slopes (central differences) of the patch around (x, y).
void sample_template(cairn::ImageView image, float x, float y, Template& result) {
  constexpr int wide = patch_side + 2;
  // Between two columns of the image first, of every row once, then between two rows.
  const float left = x - (patch_half + 1), top = y - (patch_half + 1);
  const int first = static_cast<int>(left), line = static_cast<int>(top);
  std::array<float, wide> part;
  for (int u = 0; u < wide; ++u)
    part[static_cast<std::size_t>(u)] =
        (x + static_cast<float>(u - patch_half - 1)) - static_cast<float>(first + u);
  std::array<std::array<float, wide>, wide + 1> across;
  for (int v = 0; v <= wide; ++v) {
    const std::uint8_t* const row = image.row(line + v) + first;
    for (std::size_t u = 0; u < wide; ++u)
      across[static_cast<std::size_t>(v)][u] =
          static_cast<float>(row[u]) + part[u] * static_cast<float>(row[u + 1] - row[u]);
  }
  std::array<float, wide * wide> grey;
  for (int v = 0; v < wide; ++v) {
    const float fy = (y + static_cast<float>(v - patch_half - 1)) - static_cast<float>(line + v);
    const auto& here = across[static_cast<std::size_t>(v)];
    const auto& next = across[static_cast<std::size_t>(v) + 1];
    for (std::size_t u = 0; u < wide; ++u)
      grey[static_cast<std::size_t>(v * wide) + u] = here[u] + fy * (next[u] - here[u]);
  }
  for (int v = 0, i = 0; v < patch_side; ++v)
    for (int u = 0; u < patch_side; ++u, ++i) {
      const float* at = grey.data() + (v + 1) * wide + u + 1;
      result.grey(i) = *at;
      const float slope_x = 0.5F * (at[1] - at[-1]);
      result.slopes[0](i) = slope_x;
      result.slopes[1](i) = 0.5F * (at[wide] - at[-wide]);
      result.slopes[2](i) = slope_x * static_cast<float>(u - patch_half) / patch_half;
      result.slopes[3](i) = slope_x * static_cast<float>(v - patch_half) / patch_half;
    }
}

std::optional<Template> make_template(cairn::ImageView image, float x, float y) {
  if (!inside(image, x, y, patch_half + 1)) return std::nullopt;
  Template result;
  sample_template(image, x, y, result);
  result.norm = centre(result.grey);
  for (Patch& slope : result.slopes) centre(slope);
  cairn::Matrix<4, 4, float> normal;
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c <= r; ++c)
      normal(r, c) = normal(c, r) =
          (result.slopes[static_cast<std::size_t>(r)] * result.slopes[static_cast<std::size_t>(c)]).sum();
  constexpr float weakest_gradient = 2.0F;  // [grey levels a pixel] rms: below it noise decides
  if (!(normal(0, 0) >= weakest_gradient * weakest_gradient * patch_pixels)) return std::nullopt;
  // A little of the largest entry keeps the shears from running away on patches that cannot see them.
  normal.diagonal().array() += 1e-4F * normal.diagonal().maxCoeff();
  result.normal_equations.compute(normal);
  return result;
}

/// The right patch under the warp, centred and scaled to the template's contrast, minus the template.
bool residual(const Template& reference, cairn::ImageView right, float x, float y,
              const cairn::Vector<4, float>& warp, Patch& difference) {
  constexpr float margin = patch_half + 2 * farthest;
  if (!inside(right, x + warp(0), y + warp(1), margin) || std::abs(warp(2)) > farthest ||
      std::abs(warp(3)) > farthest)
    return false;
  // A row of the patch lies between two rows of the image: blended once, which leaves two of four products.
  constexpr int most_columns = 20;  // 10 steps of at most 1.4 pixels, and the neighbour
  static_assert(most_columns >= 2 * patch_half * (1 + farthest / patch_half) + 2);
  const float step = 1 + warp(2) / patch_half, reach = step * patch_half;  // the step is 0.6 at least
  // Only read at first, and interpolated when all of it is there, in whole registers.
  Patch part = Patch::Zero(), here = Patch::Zero(), next = Patch::Zero();
  for (int v = -patch_half, i = 0; v <= patch_half; ++v) {
    const auto fv = static_cast<float>(v);
    const float row_x = x + warp(0) + warp(3) * fv / patch_half, row_y = y + fv + warp(1);
    const int first = static_cast<int>(row_x - reach), line = static_cast<int>(row_y);
    const int columns = static_cast<int>(row_x + reach) + 2 - first;
    const float fy = row_y - static_cast<float>(line);
    const std::uint8_t* top = right.row(line) + first;
    const std::uint8_t* bottom = top + right.stride();
    std::array<float, most_columns> blended{};
    const auto blend = [&](int count) {
      for (int c = 0; c < count; ++c)
        blended[static_cast<std::size_t>(c)] =
            static_cast<float>(top[c]) + fy * static_cast<float>(bottom[c] - top[c]);
    };
    constexpr int usual = 16;  // known beforehand: whole registers
    if (columns <= usual && first + usual <= right.width())
      blend(usual);
    else
      blend(columns);
    const float start = row_x - static_cast<float>(first) - reach;
    std::array<int, patch_side> column;
    for (std::size_t k = 0; k < patch_side; ++k) {
      const float at = start + step * static_cast<float>(static_cast<int>(k));
      column[k] = static_cast<int>(at);
      part(i + static_cast<int>(k)) = at - static_cast<float>(column[k]);
    }
    for (std::size_t k = 0; k < patch_side; ++k, ++i) {
      here(i) = blended[static_cast<std::size_t>(column[k])];
      next(i) = blended[static_cast<std::size_t>(column[k]) + 1];
    }
  }
  difference = here + part * (next - here);
  const float norm = centre(difference);
  if (!(norm > 0)) return false;
  difference = difference * (reference.norm / norm) - reference.grey;
  return true;
}

}  // namespace

std::optional<PatchAlignment> align_patch(cairn::ImageView left, float left_x, float left_y,
                                          cairn::ImageView right, float right_x, float right_y) {
  const auto reference = make_template(left, left_x, left_y);
  if (!reference) return std::nullopt;
  cairn::Vector<4, float> warp = cairn::Vector<4, float>::Zero();
  Patch difference = Patch::Zero();
  for (int step = 0; step < most_steps; ++step) {
    if (!residual(*reference, right, right_x, right_y, warp, difference)) return std::nullopt;
    cairn::Vector<4, float> gradient;
    for (int r = 0; r < 4; ++r)
      gradient(r) = (reference->slopes[static_cast<std::size_t>(r)] * difference).sum();
    const cairn::Vector<4, float> change = reference->normal_equations.solve(gradient);
    warp -= change;
    if (!(std::abs(warp(0)) <= farthest && std::abs(warp(1)) <= farthest)) return std::nullopt;
    if (change.cwiseAbs().maxCoeff() > settled) continue;
    // Of two unit patches with correlation c the difference has the squared length 2 - 2 c.
    const float squares = difference.square().sum();
    const cairn::Vector<4, float> column =
        reference->normal_equations.solve(cairn::Vector<4, float>::Unit(0));
    PatchAlignment result;
    result.x = right_x + warp(0);
    result.y = right_y + warp(1);
    result.stretch = warp(2) / patch_half;
    result.shear = warp(3) / patch_half;
    result.sigma = std::sqrt(squares / (patch_pixels - 6) * column(0));
    result.correlation = 1 - 0.5F * squares / (reference->norm * reference->norm);
    return result;
  }
  return std::nullopt;
}

}  // namespace stereo_slam
