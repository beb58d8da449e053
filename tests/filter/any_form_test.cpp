// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <tuple>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/filter/interacting.hpp>
#include <cairn/filter/noise_fit.hpp>
#include <cairn/filter/robust.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/filter/timeline.hpp>

#include "filter/every_form.hpp"
#include "filter/linear_problems.hpp"
#include "support/random.hpp"

// What is built around a filter gives the same around any of them, on linear models.
namespace any_form_test {
namespace {

using cairn::BeliefOf;
using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;
using cairn_test::as_gaussian;
using cairn_test::begin_with;
using cairn_test::relative_error;
using Problem = cairn_test::LinearProblem<3, 2>;
using State = Vector<3>;

template <class A, class B>
double apart(const A& a, const B& b) {
  const auto x = as_gaussian(a), y = as_gaussian(b);
  return std::fmax(cairn_test::largest_difference(x.mean, y.mean),
                   relative_error(x.covariance, y.covariance));
}

std::vector<Vector<2>> measurements(cairn::Random& random, int count) {
  std::vector<Vector<2>> z;
  for (int i = 0; i < count; ++i) z.push_back(cairn_test::random_matrix<2, 1>(random));
  return z;
}

// Two updates, one of them an outlier, by what `wrap` makes of a filter.
template <class Wrap>
void soften_alike(const Wrap& wrap) {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  const Problem p(random);
  const Vector<2> usual = p.sensor.predict(p.prior.mean) + Vector<2>(0.1, -0.2),
                  wild = usual * 3 + Vector<2>(30, -25);
  auto expected = p.prior;
  const auto by_kalman = wrap(Kalman{});
  REQUIRE(by_kalman.predict(expected, p.process, 1.0) == Status::accepted);
  const auto first = by_kalman.update(expected, p.sensor, wild),
             second = by_kalman.update(expected, p.sensor, usual);
  REQUIRE(first.accepted());
  REQUIRE(second.accepted());
  cairn_test::each_proper_form([&](const char* name, const auto& filter) {
    CAPTURE(name);
    const auto wrapped = wrap(filter);
    auto belief = begin_with(filter, p.prior);
    static_assert(std::is_same_v<BeliefOf<decltype(wrapped), State>, BeliefOf<decltype(filter), State>>);
    REQUIRE(wrapped.predict(belief, p.process, 1.0) == Status::accepted);
    const auto softened = wrapped.update(belief, p.sensor, wild);
    REQUIRE(softened.accepted());
    CHECK(std::abs(softened.nis - first.nis) < 1e-6 * first.nis);
    REQUIRE(wrapped.update(belief, p.sensor, usual).accepted());
    CHECK(apart(belief, expected) < 1e-6);
    const auto before = belief;
    CHECK(wrapped.update(belief, p.sensor, Vector<2>(std::nan(""), 0)).status == Status::not_finite);
    CHECK(cairn_test::same_numbers(belief, before));
  });
}

TEST_CASE("outliers are softened alike around every form with a mean") {
  soften_alike([](const auto& filter) { return cairn::Robust<std::decay_t<decltype(filter)>>{filter, 6.0}; });
  soften_alike([](const auto& filter) { return cairn::Huber<std::decay_t<decltype(filter)>>{filter}; });
  soften_alike([](const auto& filter) { return cairn::StudentT<std::decay_t<decltype(filter)>>{filter}; });
}

TEST_CASE("a timeline of every form, the information forms too, is the filter that got all in order") {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  const Problem p(random);
  const auto z = measurements(random, 6);
  cairn_test::each_form([&](const char* name, const auto& filter) {
    CAPTURE(name);
    using Filter = std::decay_t<decltype(filter)>;
    auto expected = begin_with(filter, p.prior);
    cairn::Timeline<Filter, cairn::LinearModel<3>, cairn::LinearSensor<2, 3>> timeline(
        filter, p.process, expected, 0.0, {}, 100.0);
    for (const std::size_t i : {0u, 2u, 1u, 5u, 3u, 4u})
      REQUIRE(timeline.measure(p.sensor, z[i], 1.0 + static_cast<double>(i)).accepted());
    for (const auto& seen : z) {
      REQUIRE(filter.predict(expected, p.process, 1.0) == Status::accepted);
      REQUIRE(filter.update(expected, p.sensor, seen).accepted());
    }
    CHECK(cairn_test::same_numbers(timeline.belief(), expected));
    CHECK(timeline.at(4.0).has_value());
    CHECK(timeline.measure(p.sensor, Vector<2>(std::nan(""), 0), 3.5).status == Status::not_finite);
    CHECK(timeline.measure(p.sensor, z[0], -1.0).status == Status::too_old);
    CHECK(cairn_test::same_numbers(timeline.belief(), expected));
  });
}

TEST_CASE("a recorder of every form with a mean smooths alike, with and without options") {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  for (const double fading : {1.0, 1.1}) {
    const Problem p(random);
    const auto z = measurements(random, 12);
    const auto record = [&](auto filter) {
      filter.fading = fading;
      filter.stabilising_noise = fading - 1.0;
      cairn::Recorder recorder(filter, p.prior);
      for (const auto& seen : z) {
        REQUIRE(recorder.predict(p.process, 1.0) == Status::accepted);
        REQUIRE(recorder.update(p.sensor, seen).accepted());
      }
      return recorder.smoothed();
    };
    const auto expected = record(Kalman{});
    cairn_test::each_proper_form([&](const char* name, const auto& filter) {
      CAPTURE(name);
      const auto path = record(filter);
      REQUIRE(path.size() == expected.size());
      for (std::size_t k = 0; k < path.size(); ++k) CHECK(apart(path[k], expected[k]) < 1e-9);
    });
    cairn::Recorder around(
        cairn::Robust<Kalman>{Kalman{.fading = fading, .stabilising_noise = fading - 1.0}, 1e9}, p.prior);
    for (const auto& seen : z) {
      REQUIRE(around.predict(p.process, 1.0) == Status::accepted);
      REQUIRE(around.update(p.sensor, seen).accepted());
    }
    CHECK(apart(around.smoothed().front(), expected.front()) < 1e-12);
  }
}

TEST_CASE("a square-root unscented recorder smooths a motion that bends like the unscented one") {
  struct Bending {
    using State = Vector<2>;
    using Control = cairn::NoControl;
    [[nodiscard]] State propagate(const State& x, const Control&, double dt) const {
      return State(x(0) + dt * std::sin(x(1)), x(1) + 0.3 * dt * x(0) * x(0));
    }
    [[nodiscard]] Matrix<2> noise(const State&, const Control&, double) const {
      return 0.01 * Matrix<2>::Identity();
    }
  };
  const Gaussian<Vector<2>> prior{Vector<2>(0.4, 0.7), 0.2 * Matrix<2>::Identity()};
  const cairn::LinearSensor<1, 2> sensor{Matrix<1, 2>(1.0, 0.0), Matrix<1>(0.1)};
  const auto record = [&](const auto& filter) {
    cairn::Recorder recorder(filter, prior);
    for (int k = 0; k < 6; ++k) {
      REQUIRE(recorder.predict(Bending{}, 0.3) == Status::accepted);
      REQUIRE(recorder.update(sensor, Vector<1>(0.5 + 0.1 * k)).accepted());
    }
    return recorder.smoothed();
  };
  const cairn::SigmaPoints points{.alpha = 0.5};
  const auto expected = record(cairn::Unscented{.points = points});
  const auto found = record(cairn::SquareRootUnscented{.points = points});
  for (std::size_t k = 0; k < found.size(); ++k) CHECK(apart(found[k], expected[k]) < 1e-10);
}

TEST_CASE("interacting models of every form with a mean agree") {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  const Problem p(random), q(random);
  const auto z = measurements(random, 8);
  const auto run = [&](const auto& filter) {
    using Filter = std::decay_t<decltype(filter)>;
    using Mode = BeliefOf<Filter, State>;
    const cairn::Interacting<2, Filter> interacting{filter, {{{0.9, 0.1}, {0.2, 0.8}}}};
    const auto mode = begin_with(filter, p.prior);
    cairn::ModeBelief<State, 2, Mode> belief{{mode, mode}, {0.4, 0.6}};
    for (const auto& seen : z) {
      REQUIRE(interacting.predict(belief, std::tuple(p.process, q.process), 1.0) == Status::accepted);
      REQUIRE(interacting.update(belief, p.sensor, seen).accepted());
    }
    const auto refused = interacting.update(belief, p.sensor, Vector<2>(std::nan(""), 0));
    CHECK(refused.status == Status::not_finite);
    return std::tuple(belief.combined(), belief.probability[0]);
  };
  const auto expected = run(Kalman{});
  cairn_test::each_proper_form([&](const char* name, const auto& filter) {
    CAPTURE(name);
    const auto found = run(filter);
    CHECK(apart(std::get<0>(found), std::get<0>(expected)) < 1e-9);
    CHECK(std::abs(std::get<1>(found) - std::get<1>(expected)) < 1e-9);
  });
}

TEST_CASE("the noise that a record tells is the same by every form with a mean") {
  cairn::Random random(5);
  const cairn::LinearModel<1> process{Matrix<1>(0.9), Matrix<1>(0.3)};
  const cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(0.5)};
  cairn::NoiseRecord<cairn::LinearModel<1>, cairn::LinearSensor<1, 1>> record{
      {Vector<1>(0.0), Matrix<1>(1.0)}, {}, {}};
  double x = 0.0;
  for (int k = 0; k < 60; ++k) {
    x = 0.9 * x + random.normal(0.0, 1.0);
    record.steps.push_back({{}, 1.0, Vector<1>(x + random.normal(0.0, 0.5))});
  }
  const cairn::NoiseFitting options{.rounds = 5};
  const auto expected = cairn::fit_noise(record, process, sensor, options, Kalman{});
  REQUIRE(expected.log_likelihoods.size() == 6);
  cairn_test::each_proper_form([&](const char* name, const auto& filter) {
    CAPTURE(name);
    const auto found = cairn::fit_noise(record, process, sensor, options, filter);
    CHECK(found.status == expected.status);
    CHECK(std::abs(found.process(0, 0) - expected.process(0, 0)) < 1e-9);
    CHECK(std::abs(found.sensor(0, 0) - expected.sensor(0, 0)) < 1e-9);
    auto bad = record;
    bad.prior.covariance(0, 0) = -1.0;
    CHECK(cairn::fit_noise(bad, process, sensor, options, filter).status == Status::not_positive_definite);
  });
}

}  // namespace
}  // namespace any_form_test
