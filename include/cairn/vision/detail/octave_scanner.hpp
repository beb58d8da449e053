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

/// Responses of those filters of an octave that the octave before has as well: every other one of its
/// samples, put down as it is scanned.
class SharedResponses {
public:
  /// For an image of so many pixels. `finer` is the octave before, null for the first.
  void prepare(const Octave* finer, const Octave& octave, int width, int height) {
    from_.fill(none);
    stride_ = (width + octave.step - 1) / octave.step + 16;
    rows_ = (height + octave.step - 1) / octave.step;
    std::size_t count = 0;
    for (std::size_t layer = 0; finer != nullptr && layer < static_cast<std::size_t>(octave.count); ++layer)
      for (std::size_t other = 0; other < static_cast<std::size_t>(finer->count); ++other)
        if (finer->filters[other].lobe == octave.filters[layer].lobe) {
          from_[layer] = static_cast<int>(other);
          place_[layer] = static_cast<std::ptrdiff_t>(count++) * rows_ * stride_;
        }
    responses_.resize(count * static_cast<std::size_t>(rows_ * stride_));
  }

  [[nodiscard]] bool has(int layer) const noexcept { return from_[static_cast<std::size_t>(layer)] != none; }

  /// A row of a filter that it has, at the octave's own samples.
  [[nodiscard]] const float* row(int layer, int y) const noexcept {
    return responses_.data() + place_[static_cast<std::size_t>(layer)] + y * stride_;
  }

  /// Takes what it needs of a row of the octave before, of which samples first to last are there.
  void take(int finer_layer, int y, const float* row, int first, int last) noexcept {
    if (y % 2 != 0) return;
    for (std::size_t layer = 0; layer < from_.size(); ++layer) {
      if (from_[layer] != finer_layer) continue;
      float* const to = responses_.data() + place_[layer] + y / 2 * stride_;
      for (int x = (first + 1) / 2; 2 * x <= last; ++x) to[x] = row[2 * x];
    }
  }

private:
  static constexpr int none = -1;
  std::array<int, Octave::most_filters> from_{};  // which filter of the octave before a filter is
  std::array<std::ptrdiff_t, Octave::most_filters> place_{};
  std::ptrdiff_t stride_ = 0, rows_ = 0;
  std::vector<float> responses_;
};

/// Rows of responses around the one that is searched, from the same column on.
struct ScanRows {
  const float *above, *centre, *below;  // of the same filter
  const float *finer, *coarser;         // the same row of the filters beside it
};

/// marks[k] is 1 for k in [0, count) where the centre reaches the threshold and none of its six nearest
/// neighbours is larger (nor as large, of those that come first), else 0.
[[gnu::always_inline]] inline void mark_peaks(const ScanRows& rows, int count, float threshold,
                                              std::uint8_t* __restrict marks) noexcept {
  const float *const above = rows.above, *const centre = rows.centre, *const below = rows.below,
                     *const finer = rows.finer, *const coarser = rows.coarser;
  const auto larger = [](float a, float b) CAIRN_INLINED { return a > b ? a : b; };
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    const float before = larger(larger(finer[k], above[k]), centre[k - 1]);
    const float after = larger(larger(coarser[k], below[k]), larger(centre[k + 1], threshold));
    marks[k] = ((centre[k] > before) & (centre[k] >= after)) ? 1 : 0;
  }
}

CAIRN_VECTORISED void mark_peaks_narrow(const ScanRows& rows, int count, float threshold,
                                        std::uint8_t* marks) noexcept {
  mark_peaks(rows, count, threshold, marks);
}
#if defined(__x86_64__)
CAIRN_VECTORISED_FOR_AVX2 void mark_peaks_wide(const ScanRows& rows, int count, float threshold,
                                               std::uint8_t* marks) noexcept {
  mark_peaks(rows, count, threshold, marks);
}
#endif

/// Columns that mark_peaks() marks, into `out`; returns how many. `marks` has room for eight more.
inline int candidates(const ScanRows& rows, int count, float threshold, std::uint8_t* marks,
                      int* out) noexcept {
#if defined(__x86_64__)
  if (processor() >= Processor::avx2)
    mark_peaks_wide(rows, count, threshold, marks);
  else
#endif
    mark_peaks_narrow(rows, count, threshold, marks);
  std::fill_n(marks + count, 8, std::uint8_t{0});
  int found = 0;
  for (int k = 0; k < count; k += 8) {
    if (load<std::uint64_t>(marks + k) == 0) [[likely]]
      continue;
    for (int lane = k; lane < k + 8; ++lane)
      if (marks[lane] != 0) out[found++] = lane;
  }
  return found;
}

/// Memory of a scanner, reused from band to band.
struct ScannerMemory {
  std::vector<float> responses;
  std::vector<std::uint32_t> boxes;
  std::vector<std::uint8_t> marks;
  std::vector<int> columns;
};

/// Finds the maxima of one octave in a band of its rows.
class OctaveScanner {
public:
  /// `given` are responses of this octave, `next` those of the one after it (null: there is none).
  OctaveScanner(const IntegralImage& sums, const ColumnPhases& phases, const Octave& octave, float threshold,
                const SharedResponses& given, SharedResponses* next, ScannerMemory& memory)
      : sums_(sums),
        phases_(phases),
        octave_(octave),
        given_(given),
        next_(next),
        threshold_(threshold),
        memory_(memory),
        stride_((sums.width() + octave.step - 1) / octave.step + 16) {
    const auto columns = static_cast<std::size_t>(stride_);
    memory.responses.resize(columns * static_cast<std::size_t>(octave.count * 3));
    memory.boxes.resize(static_cast<std::size_t>(phases.line()) * 3);
    memory.marks.resize(columns);
    memory.columns.resize(columns);
  }

  /// Appends the maxima whose row of samples is in [begin, end): row by row, filter by filter.
  void scan(int begin, int end, std::vector<Keypoint>& found) {
    for (int y = begin - 1; y <= end; ++y) {
      for (int layer = 0; layer < octave_.count; ++layer) fill_row(layer, y, begin <= y && y < end);
      if (y > begin)
        for (int layer = 1; layer + 1 < octave_.count; ++layer) search_row(layer, y - 1, found);
    }
  }

private:
  [[nodiscard]] BoxFilter filter(int layer) const noexcept {
    return octave_.filters[static_cast<std::size_t>(layer)];
  }

  [[nodiscard]] float* own_row(int layer, int y) const noexcept {
    return memory_.responses.data() + static_cast<std::ptrdiff_t>(layer * 3 + (y + 3) % 3) * stride_;
  }
  [[nodiscard]] const float* row(int layer, int y) const noexcept {
    return given_.has(layer) ? given_.row(layer, y) : own_row(layer, y);
  }

  /// A row beside the band is only looked at: the band that it is of passes it on.
  void fill_row(int layer, int y, bool within_band) noexcept {
    const BoxFilter box = filter(layer);
    const SampleRange across(sums_.width(), box.border(), octave_.step, 0);
    if (!SampleRange(sums_.height(), box.border(), octave_.step, 0).contains(y) || across.first > across.last)
      return;
    if (!given_.has(layer)) {
      const HessianTaps taps(phases_, box, across.first * octave_.step, y * octave_.step);
      hessian_row(taps, box.weight(), across.last - across.first + 1, own_row(layer, y) + across.first,
                  memory_.boxes.data());
    }
    if (within_band && next_ != nullptr) next_->take(layer, y, row(layer, y), across.first, across.last);
  }

  /// The next filter is larger than this one and its neighbours below, so where it fits, all do.
  void search_row(int layer, int y, std::vector<Keypoint>& found) {
    const int border = filter(layer + 1).border();
    const SampleRange across(sums_.width(), border, octave_.step, 1);
    if (!SampleRange(sums_.height(), border, octave_.step, 1).contains(y) || across.first > across.last)
      return;
    const auto from = [&](int filter, int line) { return row(filter, line) + across.first; };
    const ScanRows rows{from(layer, y - 1), from(layer, y), from(layer, y + 1), from(layer - 1, y),
                        from(layer + 1, y)};
    const int count = candidates(rows, across.last - across.first + 1, threshold_, memory_.marks.data(),
                                 memory_.columns.data());
    for (int k = 0; k < count; ++k) {
      const int x = across.first + memory_.columns[static_cast<std::size_t>(k)];
      if (!is_maximum(layer, x, y)) continue;
      const std::optional<Peak> peak = fit_peak(neighbourhood(layer, x, y));
      if (peak && std::abs(peak->x) <= 1 && std::abs(peak->y) <= 1 && std::abs(peak->layer) <= 1)
        found.push_back(keypoint(layer, x, y, *peak));
    }
  }

  /// The largest of 27, ties going to the first in the order layer, row, column; of a candidate.
  [[nodiscard]] bool is_maximum(int layer, int x, int y) const noexcept {
    const float centre = row(layer, y)[x];
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
  const SharedResponses& given_;
  SharedResponses* next_;
  float threshold_;
  ScannerMemory& memory_;
  int stride_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
