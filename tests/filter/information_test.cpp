// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>

#include <doctest/doctest.h>

#include <cairn/filter/information.hpp>
#include <cairn/filter/square_root_information.hpp>
#include <cairn/models/linear.hpp>

namespace information_test {
namespace {

using cairn::Matrix;
using cairn::Status;
using cairn::Vector;

constexpr std::array<double, 5> heights{3.0, 4.5, 5.0, 8.5, 9.0};

/// Position and speed now, and their covariance, from heights one second apart of variance 0.25 each, which
/// is multiplied by `fading` with every second that has passed: normal equations of a weighted line.
template <class Belief, class Filter>
void check_line(const Filter& filter) {
  Matrix<2> f;
  f << 1, 1, 0, 1;
  const cairn::LinearModel<2> process{f, Matrix<2>::Zero()};
  const cairn::LinearSensor<1, 2> sensor{Matrix<1, 2>(1, 0), Matrix<1>(0.25)};
  Belief belief = Belief::ignorant(Vector<2>(-7.0, 11.0));
  for (std::size_t count = 1; count <= heights.size(); ++count) {
    CAPTURE(count);
    if (count > 1) REQUIRE(filter.predict(belief, process, 1.0) == Status::accepted);
    REQUIRE(filter.update(belief, sensor, Vector<1>(heights[count - 1])) == Status::accepted);
    const auto known = belief.gaussian();
    REQUIRE(known.has_value() == (count > 1));
    if (!known) continue;
    long double w = 0, wt = 0, wtt = 0, wz = 0, wtz = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const long double t = static_cast<long double>(i) - static_cast<long double>(count - 1);
      const long double weight = 4 / std::pow(static_cast<long double>(filter.fading), -t);
      w += weight;
      wt += weight * t;
      wtt += weight * t * t;
      wz += weight * heights[i];
      wtz += weight * t * heights[i];
    }
    const long double d = w * wtt - wt * wt;
    CHECK(known->mean(0) == doctest::Approx(static_cast<double>((wtt * wz - wt * wtz) / d)).epsilon(1e-12));
    CHECK(known->mean(1) == doctest::Approx(static_cast<double>((w * wtz - wt * wz) / d)).epsilon(1e-12));
    CHECK(known->covariance(0, 0) == doctest::Approx(static_cast<double>(wtt / d)).epsilon(1e-12));
    CHECK(known->covariance(1, 0) == doctest::Approx(static_cast<double>(-wt / d)).epsilon(1e-12));
    CHECK(known->covariance(1, 1) == doctest::Approx(static_cast<double>(w / d)).epsilon(1e-12));
  }
}

}  // namespace

TEST_SUITE("information") {
  TEST_CASE("information: what is known of one direction only moves with the process and fades") {
    check_line<cairn::InformationBelief<Vector<2>>>(cairn::InformationFilter{});
    check_line<cairn::InformationBelief<Vector<2>>>(cairn::InformationFilter{.fading = 1.5});
  }
  TEST_CASE("square_root_information: what is known of one direction only moves with the process and fades") {
    check_line<cairn::SquareRootInformation<Vector<2>>>(cairn::SquareRootInformationFilter{});
    check_line<cairn::SquareRootInformation<Vector<2>>>(cairn::SquareRootInformationFilter{.fading = 1.5});
  }
}

}  // namespace information_test
