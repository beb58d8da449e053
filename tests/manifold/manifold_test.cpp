// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <type_traits>

#include <doctest/doctest.h>

#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/so2.hpp>

namespace {

using cairn::Vector;

/// A foreign type: a clock hand on a dial of 12 hours, taught to cairn without being touched.
struct Dial {
  double hours = 0;
};
struct Unknown {};

}  // namespace

template <>
struct cairn::manifold_traits<Dial> {
  using Scalar = double;
  using Tangent = cairn::Vector<1>;
  static constexpr int dof = 1;
  static Dial retract(const Dial& x, const Tangent& d) { return {std::fmod(x.hours + d(0) + 12, 12)}; }
  static Tangent local(const Dial& x, const Dial& y) {
    return Tangent(std::remainder(y.hours - x.hours, 12.0));
  }
};

static_assert(cairn::Manifold<Dial>);
static_assert(!cairn::Manifold<Unknown> && !cairn::Manifold<int>);
static_assert(cairn::Manifold<Vector<3>> && cairn::Manifold<Vector<2, float>>);
static_assert(cairn::dof<Vector<3>> == 3 && cairn::dof<Vector<cairn::dynamic>> == cairn::dynamic);

TEST_SUITE("manifold") {
  TEST_CASE("manifold: vectors of fixed and run-time size step by addition") {
    const Vector<3> x(1, 2, 3), d(0.5, -1, 4);
    CHECK(cairn::retract(x, d) == Vector<3>(1.5, 1, 7));
    CHECK(cairn::local(x, cairn::retract(x, d)) == d);
    const Vector<cairn::dynamic> y = x;
    CHECK(cairn::dof_of(y) == 3);
    CHECK(cairn::dof_of(x) == 3);
    CHECK(cairn::local(y, cairn::retract(y, Vector<cairn::dynamic>(d))) == d);
  }

  TEST_CASE("manifold: a foreign type becomes a state through its traits alone") {
    const Dial eleven{11};
    CHECK(cairn::retract(eleven, Vector<1>(2.0)).hours == doctest::Approx(1));
    CHECK(cairn::local(eleven, Dial{1})(0) == doctest::Approx(2));
  }

  TEST_CASE("manifold: several parts in braces are a Product, one part is none by chance") {
    using Pair = cairn::Product<cairn::SO2, Vector<2>>;
    const auto turned = [](const Pair& x) -> Pair { return {x.part<0>() * cairn::SO2(1.0), x.part<1>()}; };
    const Pair y = turned({cairn::SO2(0.5), Vector<2>(3, 4)});
    CHECK(y.part<0>().angle() == doctest::Approx(1.5));
    CHECK(y.part<1>() == Vector<2>(3, 4));
    CHECK(!std::is_convertible_v<cairn::SO2, cairn::Product<cairn::SO2>>);
  }
}
