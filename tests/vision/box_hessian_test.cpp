// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdlib>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/vision/detail/box_hessian.hpp>

#include "support/random.hpp"
#include "vision/pictures.hpp"

namespace box_hessian_test {
namespace {

using cairn::detail::BoxFilter;

/// The filters of Bay et al. (figure 2) written as weights of single pixels about the centre.
struct SlowHessian {
  double xx = 0, yy = 0, xy = 0;

  SlowHessian(const cairn::Image& image, int lobe, int x, int y) {
    const int side = 3 * lobe, border = (side - 1) / 2, inner = (lobe - 1) / 2;
    for (int v = -border; v <= border; ++v)
      for (int u = -border; u <= border; ++u) {
        const double level = image(x + u, y + v);
        if (std::abs(v) < lobe) xx += level * (std::abs(u) <= inner ? -2 : 1);
        if (std::abs(u) < lobe) yy += level * (std::abs(v) <= inner ? -2 : 1);
        const bool in_quadrant = u != 0 && v != 0 && std::abs(u) <= lobe && std::abs(v) <= lobe;
        if (in_quadrant) xy += level * (u * v < 0 ? 1 : -1);
      }
    const double area = static_cast<double>(side) * side;
    xx /= area;
    yy /= area;
    xy /= area;
  }
  [[nodiscard]] double response() const { return xx * yy - 0.81 * xy * xy; }
};

}  // namespace

TEST_SUITE("box_hessian") {
  TEST_CASE("hessian_row: agrees with the filters applied pixel by pixel, for every step and phase") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    const cairn::Image image = cairn_test::noise(97, 80, seed);
    const cairn::IntegralImage sums(image);
    for (const int step : {1, 2, 4, 8})
      for (const int lobe : {1, 3, 5, 9, 13, 25}) {
        cairn::detail::ColumnPhases phases;
        phases.assign(sums, step);
        const BoxFilter filter{lobe};
        const int first = (filter.border() + step - 1) / step * step;
        const int count = (image.width() - 1 - filter.border() - first) / step + 1;
        std::vector<float> row(static_cast<std::size_t>(count));
        std::vector<std::uint32_t> scratch(3 * static_cast<std::size_t>(phases.line()));
        for (const int y : {filter.border(), image.height() - 1 - filter.border()}) {
          cairn::detail::hessian_row({phases, filter, first, y}, filter.weight(), count, row.data(),
                                     scratch.data());
          for (int k = 0; k < count; ++k) {
            const SlowHessian slow(image, lobe, first + k * step, y);
            const double size = std::abs(slow.xx * slow.yy) + slow.xy * slow.xy + 1e-3;
            CHECK(std::abs(row[static_cast<std::size_t>(k)] - slow.response()) < 1e-5 * size);
            const float trace = cairn::detail::hessian_trace(sums, filter, first + k * step, y);
            CHECK(trace == doctest::Approx(slow.xx + slow.yy).epsilon(1e-5));
          }
        }
      }
  }

#if defined(__x86_64__)
  TEST_CASE("hessian_row: four lanes and eight give the same bits") {
    if (cairn::detail::processor() < cairn::detail::Processor::avx2) return;
    const cairn::IntegralImage sums(cairn_test::noise(203, 60, 4));
    for (const int step : {1, 2})
      for (const int lobe : {1, 5, 9}) {
        cairn::detail::ColumnPhases phases;
        phases.assign(sums, step);
        const BoxFilter filter{lobe};
        const cairn::detail::HessianTaps taps(phases, filter, 16, 30);
        const int count = (186 - filter.border()) / step;
        std::vector<float> narrow(static_cast<std::size_t>(count)), wide(narrow.size());
        std::vector<std::uint32_t> scratch(3 * static_cast<std::size_t>(phases.line()));
        cairn::detail::hessian_row_narrow(taps, filter.weight(), count, narrow.data(), scratch.data());
        cairn::detail::hessian_row_wide(taps, filter.weight(), count, wide.data(), scratch.data());
        for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) CHECK(narrow[k] == wide[k]);
      }
  }
#endif

  TEST_CASE("ColumnPhases: halved from the step before they are those of the image") {
    for (const int width : {1, 2, 7, 37, 96}) {
      const cairn::IntegralImage sums(cairn_test::noise(width, 5, 7));
      for (const int first : {1, 3}) {
        cairn::detail::ColumnPhases finer, halved, direct;
        finer.assign(sums, first);
        halved.prepare(sums, 2 * first);
        direct.assign(sums, 2 * first);
        for (int y = 0; y <= sums.height(); ++y) {
          halved.fill_row(finer, y);
          for (int x = 0; x <= width; ++x) {
            CHECK(*halved.at(x, y) == sums.row(y)[x]);
            CHECK(*direct.at(x, y) == sums.row(y)[x]);
          }
        }
      }
    }
  }

  TEST_CASE("hessian_row: a constant image and a slope have no response") {
    const cairn::Image slope =
        cairn_test::picture(64, 64, [](int x, int y) { return static_cast<std::uint8_t>(2 * x + y); });
    for (const cairn::Image& image : {cairn::Image(64, 64, 200), slope}) {
      const cairn::IntegralImage sums(image);
      cairn::detail::ColumnPhases phases;
      phases.assign(sums, 1);
      std::vector<float> row(64);
      std::vector<std::uint32_t> scratch(3 * static_cast<std::size_t>(phases.line()));
      const BoxFilter filter{5};
      cairn::detail::hessian_row({phases, filter, 10, 30}, filter.weight(), 40, row.data(), scratch.data());
      for (int k = 0; k < 40; ++k) CHECK(row[static_cast<std::size_t>(k)] == 0);
    }
  }
}

}  // namespace box_hessian_test
