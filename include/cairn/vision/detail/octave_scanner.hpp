// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// One octave of SURF's fast Hessian: responses of its filters row by row, and their maxima over place and
/// scale. Only three rows of each filter are kept, so the work stays in the processor's nearest cache.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <cairn/version.hpp>
#include <cairn/vision/detail/box_hessian.hpp>
#include <cairn/vision/detail/lanes.hpp>
#include <cairn/vision/detail/quadratic_peak.hpp>
#include <cairn/vision/features.hpp>
#include <cairn/vision/integral_image.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// The filters of an octave and the distance of its samples [pixels].
struct Octave {
  static constexpr int most_filters = 9;
  int count = 0;
  int step = 1;
  std::array<BoxFilter, most_filters> filters;

  /// The first octave has one filter more, below, so that blobs of the size of the 9-pixel filter are maxima.
  Octave(int index, int intervals, int initial_step) noexcept
      : count(index == 0 ? intervals + 1 : intervals), step(initial_step << index) {
    for (int i = 0; i < count; ++i)
      filters[static_cast<std::size_t>(i)].lobe = (2 << index) * (index == 0 ? i : i + 1) + 1;
  }
};

/// First and last sample (in steps) at which a filter fits a side of `length`, `neighbours` steps inside.
struct SampleRange {
  int first, last;
  SampleRange(int length, int border, int step, int neighbours) noexcept
      : first((border + step - 1) / step + neighbours),
        last((length > border ? (length - 1 - border) / step : -1) - neighbours) {}
  [[nodiscard]] bool contains(int i) const noexcept { return first <= i && i <= last; }
};

/// Columns k in [0, count) where centre[k] reaches the threshold and none of its four neighbours is larger
/// (nor as large, left and above), into `out`; returns how many. Reads up to four entries behind the end.
inline int candidates(const float* above, const float* centre, const float* below, int count, float threshold,
                      int* out) noexcept {
  int found = 0;
  for (int k = 0; k < count; k += 4) {
    const auto here = load<Float4>(centre + k);
    const Signed4 mask = (here >= threshold) & (here > load<Float4>(centre + k - 1)) &
                         (here >= load<Float4>(centre + k + 1)) & (here > load<Float4>(above + k)) &
                         (here >= load<Float4>(below + k));
    const auto halves = reinterpret_cast<Long2>(mask);
    if ((halves[0] | halves[1]) == 0) [[likely]]
      continue;
    for (int lane = 0; lane < 4 && k + lane < count; ++lane)
      if (mask[lane] != 0) out[found++] = k + lane;
  }
  return found;
}

/// Memory of a scanner, reused from band to band.
struct ScannerMemory {
  std::vector<float> responses;
  std::vector<std::uint32_t> boxes;
  std::vector<int> columns;
};

/// Finds the maxima of one octave in a band of its rows.
class OctaveScanner {
public:
  OctaveScanner(const IntegralImage& sums, const ColumnPhases& phases, const Octave& octave, float threshold,
                ScannerMemory& memory)
      : sums_(sums),
        phases_(phases),
        octave_(octave),
        threshold_(threshold),
        memory_(memory),
        stride_((sums.width() + octave.step - 1) / octave.step + 16) {
    const auto columns = static_cast<std::size_t>(stride_);
    memory.responses.resize(columns * static_cast<std::size_t>(octave.count * 3));
    memory.boxes.resize(static_cast<std::size_t>(phases.line()) * 3);
    memory.columns.resize(columns);
  }

  /// Appends the maxima whose row of samples is in [begin, end): row by row, filter by filter.
  void scan(int begin, int end, std::vector<Keypoint>& found) {
    for (int y = begin - 1; y <= end; ++y) {
      for (int layer = 0; layer < octave_.count; ++layer) fill_row(layer, y);
      if (y > begin)
        for (int layer = 1; layer + 1 < octave_.count; ++layer) search_row(layer, y - 1, found);
    }
  }

private:
  [[nodiscard]] BoxFilter filter(int layer) const noexcept {
    return octave_.filters[static_cast<std::size_t>(layer)];
  }

  [[nodiscard]] float* row(int layer, int y) const noexcept {
    return memory_.responses.data() + static_cast<std::ptrdiff_t>(layer * 3 + (y + 3) % 3) * stride_;
  }

  void fill_row(int layer, int y) noexcept {
    const BoxFilter box = filter(layer);
    const SampleRange across(sums_.width(), box.border(), octave_.step, 0);
    if (!SampleRange(sums_.height(), box.border(), octave_.step, 0).contains(y) || across.first > across.last)
      return;
    const HessianTaps taps(phases_, box, across.first * octave_.step, y * octave_.step);
    hessian_row(taps, box.weight(), across.last - across.first + 1, row(layer, y) + across.first,
                memory_.boxes.data());
  }

  /// The next filter is larger than this one and its neighbours below, so where it fits, all do.
  void search_row(int layer, int y, std::vector<Keypoint>& found) {
    const int border = filter(layer + 1).border();
    const SampleRange across(sums_.width(), border, octave_.step, 1);
    if (!SampleRange(sums_.height(), border, octave_.step, 1).contains(y) || across.first > across.last)
      return;
    const int count = candidates(row(layer, y - 1) + across.first, row(layer, y) + across.first,
                                 row(layer, y + 1) + across.first, across.last - across.first + 1, threshold_,
                                 memory_.columns.data());
    for (int k = 0; k < count; ++k) {
      const int x = across.first + memory_.columns[static_cast<std::size_t>(k)];
      if (!is_maximum(layer, x, y)) continue;
      const std::optional<Peak> peak = fit_peak(neighbourhood(layer, x, y));
      if (peak && std::abs(peak->x) <= 1 && std::abs(peak->y) <= 1 && std::abs(peak->layer) <= 1)
        found.push_back(keypoint(layer, x, y, *peak));
    }
  }

  /// The largest of 27, ties going to the first in the order layer, row, column.
  [[nodiscard]] bool is_maximum(int layer, int x, int y) const noexcept {
    const float centre = row(layer, y)[x];
    // The filters beside this one first: they refuse most.
    if (row(layer - 1, y)[x] >= centre || row(layer + 1, y)[x] > centre) return false;
    const auto all_below = [&](const float* line) {
      return line[x - 1] < centre && line[x] < centre && line[x + 1] < centre;
    };
    const auto none_above = [&](const float* line) {
      return line[x - 1] <= centre && line[x] <= centre && line[x + 1] <= centre;
    };
    for (int dy = -1; dy <= 1; ++dy)
      if (!all_below(row(layer - 1, y + dy)) || !none_above(row(layer + 1, y + dy))) return false;
    const float* const same = row(layer, y);
    return all_below(row(layer, y - 1)) && none_above(row(layer, y + 1)) && same[x - 1] < centre &&
           same[x + 1] <= centre;
  }

  [[nodiscard]] Neighbourhood neighbourhood(int layer, int x, int y) const noexcept {
    Neighbourhood samples;
    for (int dl = 0; dl < 3; ++dl)
      for (int dy = 0; dy < 3; ++dy)
        std::copy_n(row(layer - 1 + dl, y - 1 + dy) + x - 1, 3,
                    samples[static_cast<std::size_t>(dl)][static_cast<std::size_t>(dy)].data());
    return samples;
  }

  [[nodiscard]] Keypoint keypoint(int layer, int x, int y, const Peak& peak) const noexcept {
    const int side_step = filter(1).side() - filter(0).side();
    Keypoint keypoint;
    keypoint.x = static_cast<float>((x + peak.x) * octave_.step);
    keypoint.y = static_cast<float>((y + peak.y) * octave_.step);
    keypoint.scale = static_cast<float>(1.2 / 9 * (filter(layer).side() + peak.layer * side_step));
    keypoint.response = static_cast<float>(peak.height);
    const float trace = hessian_trace(sums_, filter(layer), x * octave_.step, y * octave_.step);
    keypoint.laplacian = static_cast<std::int8_t>(trace < 0 ? -1 : 1);
    return keypoint;
  }

  const IntegralImage& sums_;
  const ColumnPhases& phases_;
  const Octave& octave_;
  float threshold_;
  ScannerMemory& memory_;
  int stride_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
