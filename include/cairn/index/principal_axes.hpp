// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Turning descriptors so that their first coordinates say most: the principal axes of a sample.
///
/// A rotation changes no Euclidean distance, so trees of turned points answer as before. But splits along the
/// axes of largest variance separate better, and a distance that is summed from the first coordinate on is
/// known to be too large after a few of them. Turned coordinates are rounded in proportion to the length of
/// what was turned: points far from the origin are turned about the mean.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/sizes.hpp>
#include <cairn/core/symmetric_eigen.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A rotation of dim numbers. Const methods may run at the same time.
class PrincipalAxes {
public:
  /// Learns the axes from up to `sample` of the points, evenly spread over the set; equal points give some
  /// rotation. Throws Error for coordinates that are not finite. O(sample dim^2 + dim^3).
  template <PointSet Points>
  explicit PrincipalAxes(const Points& points, std::size_t sample = 4096) {
    const std::size_t count = points.size();
    CAIRN_EXPECTS(count > 0 && sample > 0, "PrincipalAxes: there is nothing to learn from");
    dim_ = detail::dimension_of<dynamic_dim>(points);
    if (dim_ == 0) raise("PrincipalAxes: a point needs at least one coordinate");
    const std::size_t step = count / sample + (count % sample != 0);
    std::vector<double> rows;
    std::vector<double> row(dim_);
    for (std::size_t i = 0; i < count; i += step) {
      detail::copy_point<double>(points[i], dim_, row.data(), {"PrincipalAxes: point", i});
      rows.insert(rows.end(), row.begin(), row.end());
    }
    learn(covariance(rows));
  }

  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  /// Of the points that were looked at.
  [[nodiscard]] std::span<const float> mean() const noexcept { return mean_; }

  /// Writes the turned coordinates of `point` (dim numbers) to `turned`; the two must not overlap. O(dim^2).
  void turn(const float* point, float* turned) const noexcept {
    turn_by(turned, [point](std::size_t a) CAIRN_INLINED { return point[a]; });
  }
  /// The same of the point less mean(): differences and distances are those of turn(), with less rounding.
  void turn_about_mean(const float* point, float* turned) const noexcept {
    const float* mean = mean_.data();
    turn_by(turned, [point, mean](std::size_t a) CAIRN_INLINED { return point[a] - mean[a]; });
  }

private:
  template <class NumberAt>
  void turn_by(float* turned, const NumberAt& number_at) const noexcept {
    detail::with_widest_lanes([&]() CAIRN_INLINED {
      constexpr std::size_t tile = 4;  // blocks whose sums stay in registers
      std::size_t first = 0;
      for (; first + tile * detail::block_size <= room_; first += tile * detail::block_size)
        turn_blocks<tile>(first, turned, number_at);
      for (; first < room_; first += detail::block_size) turn_blocks<1>(first, turned, number_at);
    });
  }

  /// The turned coordinates from number `first` on, some blocks of them: a sum of columns.
  template <std::size_t Blocks, class NumberAt>
  [[gnu::always_inline]] void turn_blocks(std::size_t first, float* turned,
                                          const NumberAt& number_at) const noexcept {
    detail::Block<float> sums[Blocks] = {};
    for (std::size_t a = 0; a < dim_; ++a) {
      const float number = number_at(a);
      const float* column = columns_.data() + a * room_ + first;
      for (std::size_t b = 0; b < Blocks; ++b) {
        detail::Block<float> numbers;
        detail::load_block<float>(column + b * detail::block_size, numbers);
        sums[b] = sums[b] + number * numbers;
      }
    }
    std::memcpy(turned + first, sums, std::min(Blocks * detail::block_size, dim_ - first) * sizeof(float));
  }

  [[nodiscard]] std::vector<double> covariance(std::vector<double>& rows) {
    const std::size_t count = rows.size() / dim_;
    std::vector<double> mean(dim_, 0.0);
    for (std::size_t i = 0; i < rows.size(); ++i) mean[i % dim_] += rows[i] / static_cast<double>(count);
    constexpr double most = detail::largest_coordinate<float>();
    for (const double number : mean) mean_.push_back(static_cast<float>(std::clamp(number, -most, most)));
    std::vector<double> sums(detail::room_for(dim_, dim_, "PrincipalAxes"), 0.0);
    for (std::size_t r = 0; r < count; ++r) {
      double* row = rows.data() + r * dim_;
      for (std::size_t a = 0; a < dim_; ++a) row[a] -= mean[a];
      for (std::size_t a = 0; a < dim_; ++a)
        for (std::size_t b = 0; b < dim_; ++b) sums[a * dim_ + b] += row[a] * row[b];
    }
    return sums;
  }

  /// Keeps the eigenvectors, largest variance first, as the columns that turn() adds up.
  void learn(std::vector<double> matrix) {
    std::vector<double> values(dim_), vectors(dim_ * dim_);
    if (!symmetric_eigen(std::span(matrix), std::span(values), std::span(vectors), 1e-9))
      raise("PrincipalAxes: coordinates so large that their squares overflow");
    room_ = (dim_ + detail::block_size - 1) / detail::block_size * detail::block_size;
    columns_.assign(detail::room_for(dim_, room_, "PrincipalAxes"), 0.0F);
    for (std::size_t i = 0; i < dim_; ++i)
      for (std::size_t a = 0; a < dim_; ++a)
        columns_[a * room_ + i] = static_cast<float>(vectors[i * dim_ + a]);
  }

  std::size_t dim_ = 0;
  std::size_t room_ = 0;  ///< of a column: whole blocks
  std::vector<float> mean_;
  detail::AlignedVector<float> columns_;
};

}}  // namespace cairn::CAIRN_ABI
