// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/unscented.hpp>

#include "filter/linear_problems.hpp"
#include "support/random.hpp"

namespace dynamic_size_test {
namespace {

using cairn::Form;
using cairn::Gaussian;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;
using cairn_test::LinearProblem;
using cairn_test::relative_error;

TEST_SUITE("dynamic sizes") {
  TEST_CASE("gaussian filters: sizes known at run time give the answers of fixed sizes") {
    constexpr int d = cairn::dynamic;
    cairn::Random random(cairn_test::seed());
    const LinearProblem<4, 2> p(random);
    const cairn::LinearModel<d> process{p.process.transition, p.process.covariance};
    const cairn::LinearSensor<d, d> sensor{p.sensor.design, p.sensor.covariance};
    const auto run = [&](const auto& filter, auto fixed, auto loose) {
      for (int step = 0; step < 50; ++step) {
        REQUIRE(filter.predict(fixed, p.process, 1.0) == Status::accepted);
        REQUIRE(filter.predict(loose, process, 1.0) == Status::accepted);
        const Vector<2> z = cairn_test::random_matrix<2, 1>(random);
        REQUIRE(filter.update(fixed, p.sensor, z).accepted());
        REQUIRE(filter.update(loose, sensor, Vector<d>(z)).accepted());
        CHECK(relative_error(loose.mean, fixed.mean) < 1e-11);
      }
    };
    const Gaussian<Vector<d>> loose{p.prior.mean, p.prior.covariance};
    using Root = cairn::SquareRootGaussian<Vector<4>>;
    using LooseRoot = cairn::SquareRootGaussian<Vector<d>>;
    run(cairn::Kalman{}, p.prior, loose);
    run(cairn::Kalman{.form = Form::joseph}, p.prior, loose);
    run(cairn::Extended{.iterations = 3}, p.prior, loose);
    run(cairn::Unscented{}, p.prior, loose);
    run(cairn::SquareRoot{}, Root::from(p.prior), LooseRoot::from(loose));
    run(cairn::SquareRootUnscented{}, Root::from(p.prior), LooseRoot::from(loose));
  }

  TEST_CASE("gaussian filters: refuse run-time sizes that do not fit") {
    constexpr int d = cairn::dynamic;
    cairn::Random random(1);
    const LinearProblem<4, 2> p(random);
    Gaussian<Vector<d>> belief{p.prior.mean, p.prior.covariance};
    const cairn::LinearModel<d> small{Matrix<d>::Identity(3, 3), Matrix<d>::Identity(3, 3)};
    Gaussian<Vector<d>> three{Vector<d>::Zero(3), Matrix<d>::Identity(4, 4)};
    CHECK(cairn::Kalman{}.predict(three, small, 1.0) == Status::size_mismatch);
    CHECK(cairn::Unscented{}.predict(three, small, 1.0) == Status::size_mismatch);
    const cairn::LinearSensor<d, d> wide{Matrix<d>::Identity(2, 4), Matrix<d>::Identity(3, 3)};
    CHECK(cairn::Kalman{}.update(belief, wide, Vector<d>::Zero(2)).status == Status::size_mismatch);
    CHECK(belief.mean == p.prior.mean);
    CHECK_THROWS_AS(
        static_cast<void>(Gaussian<Vector<d>>::checked(Vector<d>::Zero(3), Matrix<d>::Identity(4, 4))),
        cairn::Error);
    Matrix<2> skewed = Matrix<2>::Identity();
    skewed(0, 1) = 0.5;
    CHECK_THROWS_WITH_AS(static_cast<void>(Gaussian<Vector<2>>::checked(Vector<2>::Zero(), skewed)),
                         "Gaussian: the covariance is not symmetric: row 0, column 1", cairn::Error);
    CHECK_THROWS_AS(
        static_cast<void>(Gaussian<Vector<2>>::checked(Vector<2>::Zero(), -Matrix<2>::Identity())),
        cairn::Error);
  }
}

}  // namespace
}  // namespace dynamic_size_test
