// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>

#include "filter/linear_problems.hpp"
#include "support/random.hpp"

namespace agreement_test {
namespace {

using cairn::Form;
using cairn::Gaussian;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;
using cairn_test::LinearProblem;
using cairn_test::relative_error;

// What a filter that keeps its belief in a form of its own gives back.
template <class Belief, int N, class S>
Gaussian<Vector<N, S>> as_gaussian(const Belief& belief) {
  if constexpr (requires { belief.gaussian().has_value(); })
    return belief.gaussian().value();
  else if constexpr (requires { belief.gaussian(); })
    return belief.gaussian();
  else
    return belief;
}

// What the plain Kalman filter says after every step, and the measurements it was given.
template <int N, int M, class S>
struct Record {
  LinearProblem<N, M, S> problem;
  std::vector<Vector<M, S>> measurements;
  std::vector<cairn::Innovation<M, S>> innovations;
  std::vector<Gaussian<Vector<N, S>>> beliefs;

  explicit Record(cairn::Random& random) : problem(random) {
    auto belief = problem.prior;
    for (int step = 0; step < 100; ++step) {
      if (step % 3 != 1) REQUIRE(cairn::Kalman{}.predict(belief, problem.process, 1.0) == Status::accepted);
      measurements.push_back(cairn_test::random_matrix<M, 1, S>(random));
      innovations.push_back(cairn::Kalman{}.update(belief, problem.sensor, measurements.back()));
      REQUIRE(innovations.back().accepted());
      beliefs.push_back(belief);
    }
  }
};

// Runs `filter` on a belief of its own kind over the record and returns the worst difference.
template <int N, int M, class S, class Filter, class Belief>
double distance(const Record<N, M, S>& record, const Filter& filter, Belief belief) {
  double worst = 0.0;
  const auto note = [&](double error) { worst = error <= worst ? worst : error; };
  for (std::size_t step = 0; step < record.beliefs.size(); ++step) {
    if (step % 3 != 1) REQUIRE(filter.predict(belief, record.problem.process, 1.0) == Status::accepted);
    const auto found = filter.update(belief, record.problem.sensor, record.measurements[step]);
    if constexpr (requires { found.nis; }) {
      const auto& expected = record.innovations[step];
      REQUIRE(found.accepted());
      note(relative_error(found.covariance, expected.covariance));
      note(static_cast<double>(std::abs(found.nis - expected.nis) / (1 + expected.nis)));
      note(static_cast<double>(std::abs(found.log_likelihood() - expected.log_likelihood())));
    } else {
      REQUIRE(found == Status::accepted);
    }
    const auto plain = as_gaussian<Belief, N, S>(belief);
    note(relative_error(plain.covariance, record.beliefs[step].covariance));
    note(relative_error(plain.mean, record.beliefs[step].mean) * 0.1);
  }
  return worst;
}

template <int N, int M, class S>
void all_agree(double tolerance) {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  for (int run = 0; run < 5; ++run) {
    const Record<N, M, S> record(random);
    const auto& prior = record.problem.prior;
    const auto root = cairn::SquareRootGaussian<Vector<N, S>>::from(prior);
    const auto ud = cairn::UDGaussian<Vector<N, S>>::from(prior);
    const auto information = cairn::InformationBelief<Vector<N, S>>::from(prior).value();
    for (const Form form : {Form::joseph, Form::sequential})
      CHECK(distance(record, cairn::Kalman{.form = form}, prior) < tolerance);
    for (const int iterations : {1, 4})
      CHECK(distance(record, cairn::Extended{.iterations = iterations}, prior) < tolerance);
    for (const cairn::Unscented& filter : {cairn::Unscented{}, cairn::cubature()})
      CHECK(distance(record, filter, prior) < tolerance);
    CHECK(distance(record, cairn::SquareRoot{}, root) < tolerance);
    CHECK(distance(record, cairn::SquareRootUnscented{}, root) < tolerance);
    CHECK(distance(record, cairn::UDFilter{}, ud) < tolerance);
    CHECK(distance(record, cairn::InformationFilter{}, information) < 100 * tolerance);
  }
}

TEST_SUITE("agreement") {
  TEST_CASE("gaussian filters: agree on linear problems in double") {
    all_agree<4, 2, double>(1e-11);
  }
  TEST_CASE("gaussian filters: fading memory and stabilising noise mean the same in every form") {
    cairn::Random random(cairn_test::seed());
    const Record<4, 2, double> record(random);
    const auto& p = record.problem;
    auto expected = p.prior;
    REQUIRE(cairn::Kalman{.fading = 1.3, .stabilising_noise = 0.2}.predict(expected, p.process, 1.0) ==
            Status::accepted);
    const auto check = [&](const auto& filter, auto belief) {
      REQUIRE(filter.predict(belief, p.process, 1.0) == Status::accepted);
      const auto plain = as_gaussian<decltype(belief), 4, double>(belief);
      CHECK(relative_error(plain.covariance, expected.covariance) < 1e-10);
      auto wrong = filter;
      wrong.fading = 0.9;
      CHECK(wrong.predict(belief, p.process, 1.0) == Status::bad_option);
      wrong = filter;
      wrong.stabilising_noise = std::nan("");
      CHECK(wrong.predict(belief, p.process, 1.0) == Status::bad_option);
    };
    const auto root = cairn::SquareRootGaussian<Vector<4>>::from(p.prior);
    check(cairn::Unscented{.fading = 1.3, .stabilising_noise = 0.2}, p.prior);
    check(cairn::SquareRoot{.fading = 1.3, .stabilising_noise = 0.2}, root);
    check(cairn::SquareRootUnscented{.fading = 1.3, .stabilising_noise = 0.2}, root);
    check(cairn::InformationFilter{.fading = 1.3, .stabilising_noise = 0.2},
          cairn::InformationBelief<Vector<4>>::from(p.prior).value());
  }
  TEST_CASE("gaussian filters: agree on linear problems in float") {
    all_agree<2, 1, float>(5e-4);
  }
}

}  // namespace
}  // namespace agreement_test
