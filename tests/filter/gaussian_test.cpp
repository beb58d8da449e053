// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <concepts>

#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se3.hpp>

namespace gaussian_test {
namespace {

using cairn::Gaussian, cairn::Matrix, cairn::Vector;

TEST_CASE("gaussian: its state is deduced from a mean, and from what Eigen has yet to compute") {
  const Gaussian at_zero{Vector<4>::Zero(), 100 * Matrix<4>::Identity()};
  static_assert(std::same_as<decltype(at_zero), const Gaussian<Vector<4>>>);
  CHECK(at_zero.mean == Vector<4>::Zero());
  CHECK(at_zero.covariance == 100 * Matrix<4>::Identity());

  const Gaussian twice{2 * at_zero.mean + Vector<4>::Ones(), at_zero.covariance};
  static_assert(std::same_as<decltype(twice), const Gaussian<Vector<4>>>);
  CHECK(twice.mean == Vector<4>::Ones());

  const Gaussian copy{at_zero};
  static_assert(std::same_as<decltype(copy), const Gaussian<Vector<4>>>);

  const Gaussian pose{cairn::SE3(), 2 * Matrix<6>::Identity()};
  static_assert(std::same_as<decltype(pose), const Gaussian<cairn::SE3>>);
  CHECK(pose.covariance == 2 * Matrix<6>::Identity());

  const Gaussian at_run_time{Vector<cairn::dynamic>::Ones(3), Matrix<cairn::dynamic>::Identity(3, 3)};
  static_assert(std::same_as<decltype(at_run_time), const Gaussian<Vector<cairn::dynamic>>>);
  CHECK(at_run_time.mean.sum() == 3);

  CHECK(cairn::nees(at_zero, 10 * Vector<4>::Ones()) == 4);  // an expression is a truth too

  const Gaussian of_floats{Vector<2, float>::Zero(), Matrix<2, 2, float>::Identity()};
  static_assert(std::same_as<decltype(of_floats), const Gaussian<Vector<2, float>>>);
  CHECK(of_floats.covariance.trace() == 2);
}

}  // namespace
}  // namespace gaussian_test
