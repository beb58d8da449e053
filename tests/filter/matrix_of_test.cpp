// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <type_traits>

#include <doctest/doctest.h>

#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/kalman_bucy.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/rao_blackwell.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/models/linear.hpp>

#include "support/archetypes.hpp"

namespace matrix_of_test {
namespace {

using cairn::Matrix;
using cairn::MatrixOf;
using cairn::NoControl;
using cairn::StateOf;
using cairn::Structured;
using cairn::Vector;
using cairn::VectorOf;
using cairn_test::As;
using cairn_test::Shown;
constexpr int d = cairn::dynamic;

// What stands for 2 x 3 numbers, and what does not.
static_assert(MatrixOf<Matrix<2, 3>, 2, 3>);
static_assert(MatrixOf<const Matrix<2, 3>&, 2, 3>);
static_assert(MatrixOf<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>&&, 2, 3>);
static_assert(MatrixOf<Eigen::Map<Matrix<2, 3>>, 2, 3>);
static_assert(MatrixOf<Matrix<d>, 2, 3>);
static_assert(MatrixOf<Matrix<2, d>, 2, 3>);
static_assert(MatrixOf<Matrix<2, 3>, d, d>);
static_assert(MatrixOf<Structured<"1*. .1*">, 2, 3>);
static_assert(MatrixOf<Structured<"1*. .1*", float>, 2, 3, float>);
static_assert(MatrixOf<decltype(Vector<3>().asDiagonal()), 3>);
static_assert(MatrixOf<decltype(2.0 * Matrix<3>() + Matrix<3>::Identity()), 3>);
static_assert(MatrixOf<Eigen::Array<double, 2, 3>, 2, 3>);
static_assert(!MatrixOf<Matrix<3, 2>, 2, 3>);
static_assert(!MatrixOf<Matrix<2>, 2, 3>);
static_assert(!MatrixOf<Matrix<d, 2>, 2, 3>);
static_assert(!MatrixOf<Matrix<2, 3, float>, 2, 3>);
static_assert(!MatrixOf<Structured<"1* .1">, 2, 3>);
static_assert(!MatrixOf<double, 1, 1>);
static_assert(!MatrixOf<const double*, 1, 1>);
static_assert(VectorOf<Matrix<1, 3>, 3> && VectorOf<Vector<3>, 3> && VectorOf<Vector<d>, 3>);
static_assert(!VectorOf<Vector<2>, 3> && !VectorOf<Matrix<3>, 3>);
static_assert(StateOf<cairn::SO2, cairn::SO2> && StateOf<const cairn::SO2&, cairn::SO2>);
static_assert(!StateOf<Vector<1>, cairn::SO2> && !StateOf<Vector<2, float>, Vector<2>>);

// Models that lack exactly one thing.
struct Whole {
  using State = Vector<3>;
  using Control = NoControl;
  using Measurement = Vector<2>;
  using Part = Vector<3>;
  static constexpr bool linear = true;
  [[nodiscard]] State propagate(const State&, const Control&, double) const;
  [[nodiscard]] Matrix<3> noise(const State&, const Control&, double) const;
  [[nodiscard]] Matrix<3> jacobian(const State&, const Control&, double) const;
  [[nodiscard]] Measurement predict(const State&) const;
  [[nodiscard]] Matrix<2> noise(const State&) const;
  [[nodiscard]] Matrix<2, 3> jacobian(const State&) const;
};
static_assert(cairn::LinearProcess<Whole> && cairn::LinearMeasurement<Whole>);

struct SmallNoise : Whole {
  [[nodiscard]] Matrix<2> noise(const State&, const Control&, double) const;
  [[nodiscard]] Matrix<3> noise(const State&) const;
};
static_assert(!cairn::ProcessModel<SmallNoise> && !cairn::MeasurementModel<SmallNoise>);
struct OtherJacobian : Whole {
  [[nodiscard]] Matrix<3, 2> jacobian(const State&, const Control&, double) const;
  [[nodiscard]] Matrix<3, 2> jacobian(const State&) const;
};
static_assert(cairn::ProcessModel<OtherJacobian> && !cairn::LinearisedProcess<OtherJacobian>);
static_assert(cairn::MeasurementModel<OtherJacobian> && !cairn::LinearisedMeasurement<OtherJacobian>);
struct FloatNoise : Whole {
  [[nodiscard]] Matrix<3, 3, float> noise(const State&, const Control&, double) const;
  [[nodiscard]] Matrix<2, 2, float> noise(const State&) const;
};
static_assert(!cairn::ProcessModel<FloatNoise> && !cairn::MeasurementModel<FloatNoise>);
struct ShortState : Whole {
  [[nodiscard]] Vector<2> propagate(const State&, const Control&, double) const;
  [[nodiscard]] Vector<3> predict(const State&) const;
};
static_assert(!cairn::ProcessModel<ShortState> && !cairn::MeasurementModel<ShortState>);
struct FloatMeasurement : Whole {  // consistent in itself, but not of the state's number type
  using Measurement = Vector<2, float>;
  [[nodiscard]] Measurement predict(const State&) const;
  [[nodiscard]] Matrix<2, 2, float> noise(const State&) const;
};
static_assert(!cairn::MeasurementModel<FloatMeasurement>);

struct Continuous {
  using State = Vector<3>;
  using Control = NoControl;
  [[nodiscard]] Vector<3> rate(const State&, const Control&) const;
  [[nodiscard]] Matrix<3> rate_jacobian(const State&, const Control&) const;
  [[nodiscard]] Matrix<3> spectral_density(const State&, const Control&) const;
};
static_assert(cairn::ContinuousProcess<Continuous>);
struct ShortRate : Continuous {
  [[nodiscard]] Vector<2> rate(const State&, const Control&) const;
};
struct SmallDensity : Continuous {
  [[nodiscard]] Matrix<2> spectral_density(const State&, const Control&) const;
};
static_assert(!cairn::ContinuousProcess<ShortRate> && !cairn::ContinuousProcess<SmallDensity>);

// Noise that enters by itself: its size is that of the Noise, not of the state.
struct Driven {
  using State = Vector<3>;
  using Control = NoControl;
  using Noise = Vector<2>;
  [[nodiscard]] State propagate(const State&, const Control&, double) const;
  [[nodiscard]] State propagate(const State&, const Control&, const Noise&, double) const;
  [[nodiscard]] Matrix<2> noise(const State&, const Control&, double) const;
};
static_assert(cairn::DrivenProcess<Driven> && cairn::AnyProcess<Driven>);
static_assert(!cairn::ProcessModel<Driven>);

// Not inlined: all ways in one function take clang's optimiser several times as long.
template <As Way>
[[gnu::noinline]] void check_way() {
  const Matrix<2, 3> m{{1, 2, 3}, {4, 5, 6}};
  const Shown<Way, 2, 3> shown(m);
  const Matrix<3> square{{1, 2, 3}, {2, 5, 6}, {3, 6, 9}};
  const Shown<Way, 3, 3> shown_square(square);
  bool misfit = false;
  if constexpr (Way != As::symmetric) {
    static_assert(MatrixOf<decltype(shown.get()), 2, 3>);
    CHECK(cairn::detail::plain_matrix<2, 3, double>(shown.get(), 2, 3, misfit) == m);
    CHECK(cairn::detail::plain_matrix<d, d, double>(shown.get(), 2, 3, misfit) == m);
  }
  static_assert(MatrixOf<decltype(shown_square.get()), 3>);
  CHECK(cairn::detail::plain_matrix<3, 3, double>(shown_square.get(), 3, 3, misfit) == square);
  CHECK_FALSE(misfit);
  const auto other = cairn::detail::plain_matrix<d, d, double>(shown_square.get(), 2, 3, misfit);
  CHECK(misfit);
  CHECK(other.rows() == 2);
  CHECK(other.cols() == 3);
  CHECK_FALSE((other.array() == other.array()).any());
}

TEST_SUITE("matrix_of") {
  TEST_CASE(
      "matrix_of: whatever stands for a matrix has its numbers; of another size it is nothing but NaN") {
    check_way<As::plain>();
    check_way<As::row_major>();
    check_way<As::unaligned>();
    check_way<As::over_aligned>();
    check_way<As::map>();
    check_way<As::strided>();
    check_way<As::block>();
    check_way<As::transposed>();
    check_way<As::sum>();
    check_way<As::product>();
    check_way<As::run_time>();
    check_way<As::run_time_rows>();
    check_way<As::bounded>();
    check_way<As::half_known>();
    check_way<As::ref>();
    check_way<As::derived>();
    check_way<As::symmetric>();
  }

  TEST_CASE("plain_model: what is plain already, and what is structured, is handed on and not copied") {
    const cairn::LinearModel<3> fixed{Matrix<3>::Identity(), Matrix<3>::Identity()};
    const cairn::detail::PlainProcess plain(fixed, 3, NoControl{});
    CHECK(&plain.jacobian(Vector<3>::Zero(), 1.0) == &fixed.transition);
    CHECK(&plain.noise(Vector<3>::Zero(), 1.0) == &fixed.covariance);
    const cairn::LinearModel<d> loose{Matrix<d>::Identity(3, 3), Matrix<d>::Identity(3, 3)};
    const cairn::detail::PlainProcess plain_loose(loose, 3, NoControl{});
    CHECK(&plain_loose.jacobian(Vector<d>::Zero(3), 1.0) == &loose.transition);
    CHECK_FALSE(plain_loose.misfit());
    const cairn::LinearSensor<2, 3> sensor{Matrix<2, 3>::Zero(), Matrix<2>::Identity()};
    const Vector<2> z(1.0, 2.0);
    const cairn::detail::PlainSensor plain_sensor(sensor, 3, z);
    CHECK(&plain_sensor.jacobian(Vector<3>::Zero()) == &sensor.design);
    CHECK(&plain_sensor.z() == &z);
    struct Sparse : Whole {
      [[nodiscard]] Structured<"1.* .1. ..1"> jacobian(const State&, const Control&, double) const {
        return {{0.5}};
      }
    };
    const Sparse sparse{};
    const cairn::detail::PlainProcess plain_sparse(sparse, 3, NoControl{});
    static_assert(
        std::is_same_v<decltype(plain_sparse.jacobian(Vector<3>(), 1.0)), Structured<"1.* .1. ..1">>);
    CHECK(plain_sparse.jacobian(Vector<3>::Zero(), 1.0).values[0] == 0.5);
  }

  TEST_CASE(
      "plain_model: run-time sizes that do not fit are told, and what stands in for them has the right "
      "size") {
    const cairn::LinearModel<d> loose{Matrix<d>::Identity(2, 4), Matrix<d>::Identity(2, 2)};
    const cairn::detail::PlainProcess plain(loose, 3, NoControl{});
    CHECK_FALSE(plain.misfit());
    CHECK(plain.jacobian(Vector<d>::Zero(3), 1.0).rows() == 3);
    CHECK(plain.misfit());
    CHECK(plain.noise(Vector<d>::Zero(3), 1.0).cols() == 3);
    CHECK(plain.propagate(Vector<d>::Zero(3), 1.0).size() == 3);
    CHECK(cairn::detail::PlainProcess(loose, 0, NoControl{}).misfit());
  }
}

}  // namespace
}  // namespace matrix_of_test
