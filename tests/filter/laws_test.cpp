// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <type_traits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/models/linear.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "filter/every_form.hpp"
#include "filter/linear_problems.hpp"
#include "support/random.hpp"

// Laws of filter.hpp, for each of the nine filters of Gaussian beliefs.
namespace laws_test {
namespace {

using cairn::BeliefOf;
using cairn::Gaussian;
using cairn::GaussianFilter;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;
using cairn_test::as_gaussian;
using cairn_test::begin_with;
using cairn_test::each_form;
using cairn_test::LinearProblem;
using cairn_test::same_numbers;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class Filter>
concept Gates = requires { Filter{.gate = 9.0}; };
template <class Filter>
concept Fades = requires { Filter{.fading = 1.1}; };
template <class Filter>
concept Stabilises = requires { Filter{.stabilising_noise = 0.1}; };

// The table of options in docs/filters.md.
template <class... Filter>
constexpr bool have_all_options = ((Gates<Filter> && Fades<Filter> && Stabilises<Filter>) && ...);
template <class... Filter>
constexpr bool have_all_but_a_gate = ((!Gates<Filter> && Fades<Filter> && Stabilises<Filter>) && ...);
static_assert(have_all_options<cairn::Kalman, cairn::Extended, cairn::Unscented, cairn::AugmentedUnscented,
                               cairn::SquareRoot, cairn::SquareRootUnscented, cairn::UDFilter>);
static_assert(have_all_but_a_gate<cairn::InformationFilter, cairn::SquareRootInformationFilter>);

// Each works on its own form of belief and on no other.
static_assert(GaussianFilter<cairn::Kalman, Gaussian<Vector<3>>>);
static_assert(!GaussianFilter<cairn::Kalman, cairn::UDGaussian<Vector<3>>>);
static_assert(!GaussianFilter<cairn::SquareRoot, Gaussian<Vector<3>>>);
static_assert(!GaussianFilter<int, Gaussian<Vector<3>>>);
static_assert(!cairn::Belief<Vector<3>> && !cairn::Belief<int>);
static_assert(cairn::ProperBelief<Gaussian<cairn::SE2>> &&
              cairn::Belief<cairn::InformationBelief<Vector<2>>>);
static_assert(!cairn::ProperBelief<cairn::InformationBelief<Vector<2>>>);

TEST_CASE("every form satisfies the concepts, on vectors, on manifolds and in float") {
  int count = 0;
  each_form([&](const char*, const auto& filter) {
    using Filter = std::decay_t<decltype(filter)>;
    static_assert(GaussianFilter<Filter, BeliefOf<Filter, Vector<3>>>);
    static_assert(GaussianFilter<Filter, BeliefOf<Filter, Vector<3, float>>>);
    static_assert(GaussianFilter<Filter, BeliefOf<Filter, cairn::SE2>>);
    ++count;
  });
  CHECK(count == 9);
}

TEST_CASE("a belief made from a Gaussian is that Gaussian") {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  for (int run = 0; run < 20; ++run) {
    const LinearProblem<4, 2> p(random);
    each_form([&](const char* name, const auto& filter) {
      CAPTURE(name);
      const auto back = as_gaussian(begin_with(filter, p.prior));
      CHECK(cairn_test::relative_error(back.mean, p.prior.mean) < 1e-12);
      CHECK(cairn_test::relative_error(back.covariance, p.prior.covariance) < 1e-11);
    });
  }
}

TEST_CASE("a step that is refused leaves the belief as it was, and says why") {
  cairn::Random random(7);
  const LinearProblem<3, 2> p(random);
  each_form([&](const char* name, const auto& usual) {
    CAPTURE(name);
    using Filter = std::decay_t<decltype(usual)>;
    const auto before = begin_with(usual, p.prior);
    const auto predicts = [&](const Filter& filter, const auto& process, double dt) {
      auto belief = before;
      const Status status = filter.predict(belief, process, dt);
      if (status != Status::accepted) CHECK(same_numbers(belief, before));
      return status;
    };
    const auto updates = [&](const Filter& filter, const auto& sensor, const Vector<2>& z) {
      auto belief = before;
      const auto result = filter.update(belief, sensor, z);
      CHECK(result.accepted() == (result.status == Status::accepted));
      if (!result.accepted()) CHECK(same_numbers(belief, before));
      return result.status;
    };
    const Vector<2> z = p.sensor.predict(p.prior.mean) + Vector<2>(0.3, -0.2);
    CHECK(predicts(usual, p.process, 1.0) == Status::accepted);
    CHECK(updates(usual, p.sensor, z) == Status::accepted);

    for (const double dt : {-1.0, nan, std::numeric_limits<double>::infinity()})
      CHECK(predicts(usual, p.process, dt) == Status::bad_time_step);
    CHECK(updates(usual, p.sensor, Vector<2>(nan, 0)) == Status::not_finite);
    auto process = p.process;
    process.covariance(1, 1) = nan;
    CHECK(predicts(usual, process, 1.0) == Status::not_finite);
    process.covariance(1, 1) = -1.0;
    CHECK(predicts(usual, process, 1.0) == Status::not_positive_definite);
    auto sensor = p.sensor;
    sensor.covariance(0, 0) = -100.0;
    CHECK(updates(usual, sensor, z) == Status::not_positive_definite);
    sensor.covariance(0, 0) = nan;
    CHECK(updates(usual, sensor, z) == Status::not_finite);

    for (const double fading : {0.9, nan}) {
      Filter filter;
      filter.fading = fading;
      CHECK(predicts(filter, p.process, 1.0) == Status::bad_option);
    }
    for (const double noise : {-0.1, nan}) {
      Filter filter;
      filter.stabilising_noise = noise;
      CHECK(predicts(filter, p.process, 1.0) == Status::bad_option);
    }
    if constexpr (Gates<Filter>) {
      for (const double gate : {0.0, -1.0, nan}) {
        Filter filter;
        filter.gate = gate;
        CHECK(updates(filter, p.sensor, z) == Status::bad_option);
      }
      Filter filter;
      filter.gate = 9.0;
      CHECK(updates(filter, p.sensor, z) == Status::accepted);
      CHECK(updates(filter, p.sensor, Vector<2>(z + Vector<2>(100, 100))) == Status::gated);
    }
  });
}

TEST_CASE("numbers of a wrong run-time size are refused and change nothing") {
  constexpr int d = cairn::dynamic;
  cairn::Random random(8);
  const LinearProblem<3, 2> p(random);
  const Gaussian<Vector<d>> prior{p.prior.mean, p.prior.covariance};
  const cairn::LinearModel<d> process{p.process.transition, p.process.covariance};
  const cairn::LinearModel<d> small{Matrix<2>::Identity(), Matrix<2>::Identity()};
  const cairn::LinearSensor<d, d> sensor{p.sensor.design, p.sensor.covariance};
  each_form([&](const char* name, const auto& filter) {
    CAPTURE(name);
    using Filter = std::decay_t<decltype(filter)>;
    if constexpr (!std::is_same_v<Filter, cairn::UDFilter>) {  // sizes fixed at compile time
      const auto before = begin_with(filter, prior);
      auto belief = before;
      CHECK(filter.predict(belief, small, 1.0) == Status::size_mismatch);
      for (const int size : {1, 3}) {
        const Vector<d> z = Vector<d>::Zero(size);
        CHECK(filter.update(belief, sensor, z).status == Status::size_mismatch);
      }
      CHECK(same_numbers(belief, before));
      const Vector<d> z = Vector<d>::Zero(2);
      CHECK(filter.predict(belief, process, 1.0) == Status::accepted);
      CHECK(filter.update(belief, sensor, z).accepted());
      CHECK_FALSE(same_numbers(belief, before));
    }
  });
}

// The Kalman filter of 3 states and 2 numbers, as the textbooks write it.
struct Textbook {
  using Real = long double;
  Real x[3], p[3][3];

  explicit Textbook(const Gaussian<Vector<3>>& prior) {
    for (int i = 0; i < 3; ++i) {
      x[i] = prior.mean(i);
      for (int j = 0; j < 3; ++j) p[i][j] = prior.covariance(i, j);
    }
  }
  void predict(const Matrix<3>& f, const Matrix<3>& q, Real fading, Real stabilising) {
    Real moved[3] = {}, fp[3][3] = {}, next[3][3] = {};
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        moved[i] += f(i, k) * x[k];
        for (int j = 0; j < 3; ++j) fp[i][j] += f(i, k) * p[k][j];
      }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < 3; ++k) next[i][j] += fp[i][k] * f(j, k);
        next[i][j] = fading * next[i][j] + q(i, j) + (i == j ? stabilising : 0);
      }
    for (int i = 0; i < 3; ++i) {
      x[i] = moved[i];
      for (int j = 0; j < 3; ++j) p[i][j] = next[i][j];
    }
  }
  void update(const Matrix<2, 3>& h, const Matrix<2>& r, const Vector<2>& z) {
    Real ph[3][2] = {}, s[2][2], v[2], k[3][2];
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < 2; ++a)
        for (int j = 0; j < 3; ++j) ph[i][a] += p[i][j] * h(a, j);
    for (int a = 0; a < 2; ++a) {
      v[a] = z(a);
      for (int j = 0; j < 3; ++j) v[a] -= h(a, j) * x[j];
      for (int b = 0; b < 2; ++b) {
        s[a][b] = r(a, b);
        for (int i = 0; i < 3; ++i) s[a][b] += h(a, i) * ph[i][b];
      }
    }
    const Real det = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    const Real inverse[2][2] = {{s[1][1] / det, -s[0][1] / det}, {-s[1][0] / det, s[0][0] / det}};
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < 2; ++a) k[i][a] = ph[i][0] * inverse[0][a] + ph[i][1] * inverse[1][a];
    for (int i = 0; i < 3; ++i) {
      x[i] += k[i][0] * v[0] + k[i][1] * v[1];
      for (int j = 0; j < 3; ++j) p[i][j] -= k[i][0] * ph[j][0] + k[i][1] * ph[j][1];
    }
  }
  [[nodiscard]] Gaussian<Vector<3>> gaussian() const {
    Gaussian<Vector<3>> result{};
    for (int i = 0; i < 3; ++i) {
      result.mean(i) = static_cast<double>(x[i]);
      for (int j = 0; j < 3; ++j) result.covariance(i, j) = static_cast<double>(p[i][j]);
    }
    return result;
  }
};

TEST_CASE("on linear models every form is the Kalman filter of the textbooks, with and without options") {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  for (int run = 0; run < 6; ++run) {
    const LinearProblem<3, 2> p(random);
    const double fading = run % 2 == 0 ? 1.0 : 1.07, noise = run % 3 == 0 ? 0.0 : 0.03;
    CAPTURE(fading);
    CAPTURE(noise);
    each_form([&](const char* name, const auto& usual) {
      CAPTURE(name);
      auto filter = usual;
      filter.fading = fading;
      filter.stabilising_noise = noise;
      auto belief = begin_with(filter, p.prior);
      Textbook expected(p.prior);
      cairn::Random draws(seed, static_cast<std::uint64_t>(run));
      double worst = 0.0;
      for (int step = 0; step < 40; ++step) {
        if (step % 4 != 1) {
          REQUIRE(filter.predict(belief, p.process, 1.0) == Status::accepted);
          expected.predict(p.process.transition, p.process.covariance, fading, noise);
        }
        if (step % 5 != 2) {
          const Vector<2> z = cairn_test::random_matrix<2, 1>(draws);
          REQUIRE(filter.update(belief, p.sensor, z).accepted());
          expected.update(p.sensor.design, p.sensor.covariance, z);
        }
        const auto found = as_gaussian(belief), wanted = expected.gaussian();
        const auto note = [&](double error) { worst = error <= worst ? worst : error; };  // a NaN too
        for (int i = 0; i < 3; ++i) {
          const double si = std::sqrt(wanted.covariance(i, i));
          note(std::abs(found.mean(i) - wanted.mean(i)) / si);
          for (int j = 0; j < 3; ++j)
            note(std::abs(found.covariance(i, j) - wanted.covariance(i, j)) /
                 (si * std::sqrt(wanted.covariance(j, j))));
        }
      }
      CHECK(worst < 1e-9);
    });
  }
}

TEST_CASE("the truth lies where every form says, as often as it says") {
  constexpr int runs = 300;
  const auto band = cairn::chi_square_mean_band(4, runs, 0.999);
  const cairn::ConstantVelocity<2> process{.density = 0.3};
  const cairn::PositionSensor<2, 4> sensor{0.25 * Matrix<2>::Identity()};
  const Gaussian<Vector<4>> prior{Vector<4>(0, 0, 1, 2), Vector<4>(1, 1, 4, 4).asDiagonal()};
  each_form([&](const char* name, const auto& filter) {
    CAPTURE(name);
    cairn::Random random(11);
    double sum = 0.0;
    for (int run = 0; run < runs; ++run) {
      auto belief = begin_with(filter, prior);
      Vector<4> truth = cairn::sample(prior, random);
      for (int step = 0; step < 8; ++step) {
        truth = cairn::sample(Gaussian<Vector<4>>{process.propagate(truth, {}, 0.5),
                                                  cairn::detail::dense_of(process.noise(truth, {}, 0.5))},
                              random);
        REQUIRE(filter.predict(belief, process, 0.5) == Status::accepted);
        const Vector<2> z =
            cairn::sample(Gaussian<Vector<2>>{sensor.predict(truth), 0.25 * Matrix<2>::Identity()}, random);
        REQUIRE(filter.update(belief, sensor, z).accepted());
      }
      sum += cairn::nees(as_gaussian(belief), truth);
    }
    CHECK(band.contains(sum / runs));
  });
}

}  // namespace
}  // namespace laws_test
