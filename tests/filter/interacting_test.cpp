// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <tuple>

#include <doctest/doctest.h>

#include <cairn/filter/interacting.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/models/linear.hpp>

namespace interacting_test {
namespace {

using cairn::Matrix;
using cairn::NoControl;
using cairn::Status;
using cairn::Vector;

constexpr double pi = 3.14159265358979323846;

}  // namespace

TEST_SUITE("interacting") {
  // H. Blom, Y. Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian switching
  // coefficients", IEEE Trans. Automatic Control 33, 1988, number by number.
  TEST_CASE(
      "interacting: modes are mixed by the chance of coming from each other, and weighed by what was seen") {
    const std::array<std::array<double, 2>, 2> p{{{0.9, 0.1}, {0.4, 0.6}}};
    const cairn::Interacting<2, cairn::Kalman> filter{.switching = p};
    const std::array<double, 2> mu{0.3, 0.7}, m{1.0, 5.0}, v{2.0, 0.5}, q{0.25, 3.0};
    cairn::ModeBelief<Vector<1>, 2> belief{{cairn::Gaussian<Vector<1>>{Vector<1>(m[0]), Matrix<1>(v[0])},
                                            cairn::Gaussian<Vector<1>>{Vector<1>(m[1]), Matrix<1>(v[1])}},
                                           mu};
    const auto processes = std::tuple(cairn::LinearModel<1>{Matrix<1>(1.0), Matrix<1>(q[0])},
                                      cairn::LinearModel<1>{Matrix<1>(1.0), Matrix<1>(q[1])});
    REQUIRE(filter.predict(belief, processes, 1.0) == Status::accepted);
    std::array<double, 2> chance{}, mean{}, variance{};
    for (std::size_t j = 0; j < 2; ++j) {
      chance[j] = p[0][j] * mu[0] + p[1][j] * mu[1];
      for (std::size_t i = 0; i < 2; ++i) mean[j] += p[i][j] * mu[i] * m[i] / chance[j];
      for (std::size_t i = 0; i < 2; ++i)
        variance[j] += p[i][j] * mu[i] * (v[i] + (m[i] - mean[j]) * (m[i] - mean[j])) / chance[j];
      variance[j] += q[j];
      CAPTURE(j);
      CHECK(belief.probability[j] == doctest::Approx(chance[j]).epsilon(1e-13));
      CHECK(belief.modes[j].mean(0) == doctest::Approx(mean[j]).epsilon(1e-13));
      CHECK(belief.modes[j].covariance(0, 0) == doctest::Approx(variance[j]).epsilon(1e-13));
    }

    const double z = 3.0, r = 0.5;
    REQUIRE(filter.update(belief, cairn::LinearSensor<1, 1>{Matrix<1>(1.0), Matrix<1>(r)}, Vector<1>(z)) ==
            Status::accepted);
    std::array<double, 2> seen{};
    for (std::size_t j = 0; j < 2; ++j) {
      const double s = variance[j] + r, d = z - mean[j];
      seen[j] = chance[j] * std::exp(-0.5 * d * d / s) / std::sqrt(2 * pi * s);
      mean[j] += variance[j] / s * d;
      variance[j] -= variance[j] * variance[j] / s;
    }
    const double first = seen[0] / (seen[0] + seen[1]);
    CHECK(belief.probability[0] == doctest::Approx(first).epsilon(1e-12));
    const double both = first * mean[0] + (1 - first) * mean[1];
    const double spread = first * (variance[0] + (mean[0] - both) * (mean[0] - both)) +
                          (1 - first) * (variance[1] + (mean[1] - both) * (mean[1] - both));
    const auto combined = belief.combined();
    CHECK(combined.mean(0) == doctest::Approx(both).epsilon(1e-12));
    CHECK(combined.covariance(0, 0) == doctest::Approx(spread).epsilon(1e-12));
  }

  TEST_CASE("interacting: a mode that cannot be leaves the others alone, whatever it holds") {
    const std::array<std::array<double, 2>, 2> p{{{1.0, 0.0}, {0.5, 0.5}}};
    const cairn::Interacting<2, cairn::Kalman> filter{.switching = p};
    const auto processes = std::tuple(cairn::LinearModel<1>{Matrix<1>(1.0), Matrix<1>(1.0)},
                                      cairn::LinearModel<1>{Matrix<1>(1e10), Matrix<1>(1.0)});
    const cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(2.0)};
    cairn::ModeBelief<Vector<1>, 2> belief{{cairn::Gaussian<Vector<1>>{Vector<1>(1.0), Matrix<1>(1.0)},
                                            cairn::Gaussian<Vector<1>>{Vector<1>(1.0), Matrix<1>(1.0)}},
                                           {1.0, 0.0}};
    for (int step = 0; step < 40; ++step) {  // the second one's variance leaves what numbers hold after 15
      CAPTURE(step);
      REQUIRE(filter.predict(belief, processes, 1.0) == Status::accepted);
      REQUIRE(filter.update(belief, sensor, Vector<1>(1.0)) == Status::accepted);
      CHECK(belief.combined().covariance(0, 0) == doctest::Approx(1.0).epsilon(1e-12));
    }
    belief.modes[1].mean(0) = std::nan("");
    REQUIRE(filter.predict(belief, processes, 1.0) == Status::accepted);
    CHECK(belief.combined().mean(0) == doctest::Approx(1.0));
    CHECK(belief.combined().covariance(0, 0) == doctest::Approx(2.0).epsilon(1e-12));
    CHECK(filter.predict(belief, processes, -1.0) == Status::bad_time_step);
  }
}

}  // namespace interacting_test
