// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Blobs in an image: local maxima over place and scale of the box Hessian's determinant.
///
/// Octave o has filters of sides L = 3 (2^(o+1) (i+1) + 1), i = 0, 1, ...:  (3) 9 15 21 27 | 15 27 39 51 |
/// ... and samples every initial_step 2^o pixels. A maximum among its 26 neighbours is a keypoint at the peak
/// of the quadratic through them; a peak more than one sample away is refused. The filter of 3 pixels stands
/// below the published first octave, because only filters with a neighbour on either side can have maxima,
/// and the smallest blobs are the ones that are found again and located best.
/// Bay, Ess, Tuytelaars and Van Gool, CVIU 110(3), 2008, section 3. Cost: 32 reads a sample and filter.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/version.hpp>
#include <cairn/vision/detail/box_hessian.hpp>
#include <cairn/vision/detail/octave_scanner.hpp>
#include <cairn/vision/features.hpp>
#include <cairn/vision/integral_image.hpp>

namespace cairn { inline namespace CAIRN_ABI {

struct FastHessianOptions {
  int octaves = 4;          ///< 1..5: scales double with each
  int intervals = 4;        ///< 3..8 filters an octave
  int initial_step = 1;     ///< 1..4 pixels between the samples of the first octave
  float threshold = 30.0F;  ///< least response [(grey levels)^2]
};

/// The detector with its memory, reused from image to image. One object per thread.
class FastHessian {
public:
  /// Throws Error when an option is out of its range.
  explicit FastHessian(const FastHessianOptions& options = {}) : threshold_(options.threshold) {
    check("octaves", options.octaves, 1, 5);
    check("intervals", options.intervals, 3, 8);
    check("initial_step", options.initial_step, 1, 4);
    if (!std::isfinite(threshold_) || threshold_ < 0)
      raise("SURF: expected a finite threshold of at least 0, found " + std::to_string(threshold_));
    for (int index = 0; index < options.octaves; ++index)
      octaves_.emplace_back(index, options.intervals, options.initial_step);
    phases_.resize(octaves_.size());
    shared_.resize(octaves_.size());
  }

  /// Replaces `found` by the maxima of the image under `sums`, ordered by octave, row, filter and column; the
  /// same for every number of threads. An image smaller than the filters has none.
  void operator()(const IntegralImage& sums, std::vector<Keypoint>& found, unsigned threads = 1) {
    found.clear();
    if (sums.width() == 0 || sums.height() == 0) return;
    for (std::size_t i = 0; i < octaves_.size(); ++i) phases_[i].prepare(sums, octaves_[i].step);
    parallel_for(static_cast<std::size_t>(sums.height()) + 1, threads,
                 [&](std::size_t begin, std::size_t end) {
                   for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                     phases_[0].fill_row(sums, y);
                     for (std::size_t i = 1; i < phases_.size(); ++i) phases_[i].fill_row(phases_[i - 1], y);
                   }
                 });
    bands_.clear();
    std::vector<std::size_t> first;  // band of each octave
    for (std::size_t octave = 0; octave < octaves_.size(); ++octave) {
      shared_[octave].prepare(octave > 0 ? &octaves_[octave - 1] : nullptr, octaves_[octave], sums.width(),
                              sums.height());
      first.push_back(bands_.size());
      const int rows = (sums.height() + octaves_[octave].step - 1) / octaves_[octave].step;
      for (int begin = 0; begin < rows; begin += rows_a_band)
        bands_.push_back({octave, begin, std::min(begin + rows_a_band, rows)});
    }
    first.push_back(bands_.size());
    found_.resize(bands_.size());
    const std::size_t workers = std::max(threads, 1U);
    memory_.resize(workers);
    for (std::size_t octave = 0; octave < octaves_.size(); ++octave)  // an octave needs the one before
      parallel_for(workers, threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t worker = begin; worker < end; ++worker)
          for (std::size_t band = first[octave] + worker; band < first[octave + 1]; band += workers)
            scan(sums, band, memory_[worker]);
      });
    for (const std::vector<Keypoint>& part : found_) found.insert(found.end(), part.begin(), part.end());
  }

private:
  static constexpr int rows_a_band = 64;
  struct Band {
    std::size_t octave;
    int begin, end;
  };

  static void check(const char* name, int value, int low, int high) {
    if (value < low || value > high)
      raise(std::string("SURF: expected ") + name + " between " + std::to_string(low) + " and " +
            std::to_string(high) + ", found " + std::to_string(value));
  }

  void scan(const IntegralImage& sums, std::size_t index, detail::ScannerMemory& memory) {
    const Band& band = bands_[index];
    found_[index].clear();
    detail::SharedResponses* const next =
        band.octave + 1 < octaves_.size() ? &shared_[band.octave + 1] : nullptr;
    detail::OctaveScanner(sums, phases_[band.octave], octaves_[band.octave], threshold_, shared_[band.octave],
                          next, memory)
        .scan(band.begin, band.end, found_[index]);
  }

  float threshold_;
  std::vector<detail::Octave> octaves_;
  std::vector<detail::ColumnPhases> phases_;
  std::vector<detail::SharedResponses> shared_;
  std::vector<Band> bands_;
  std::vector<detail::ScannerMemory> memory_;
  std::vector<std::vector<Keypoint>> found_;
};

}}  // namespace cairn::CAIRN_ABI
