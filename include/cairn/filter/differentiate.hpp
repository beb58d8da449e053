// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Jacobians for models that do not give them, chosen by word: numeric(model), automatic(model).
///
/// ```cpp
/// const auto innovation = extended.update(belief, cairn::automatic(radar), z);
/// ```
///
/// numeric() differentiates propagate and predict by central differences: 2 dof + 1 calls a Jacobian.
/// automatic() sends dual numbers through them: one call, exact, for models whose propagate and predict are
/// templates over the scalar:
/// ```cpp
/// struct Pendulum {
///   using State = cairn::Vector<2>;  using Control = cairn::NoControl;
///   template <class T>
///   cairn::Vector<2, T> propagate(const cairn::Vector<2, T>& x, const Control& u, double dt) const;
///   cairn::Matrix<2> noise(const State& x, const Control& u, double dt) const;
/// };
/// ```
/// check_jacobian() holds a model's own Jacobian against central differences, check_jacobians() all three
/// against one another.
#pragma once

#include <concepts>
#include <limits>
#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/explain_sizes.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/manifold/derivatives.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The model with Jacobians by central differences.
template <class Model>
struct Numeric : Model {
  using State = typename Model::State;

  template <class Control>
    requires ProcessModel<Model>
  [[nodiscard]] auto jacobian(const State& x, const Control& u, double dt) const {
    const Model& model = *this;
    return numeric_jacobian(
        [&](const State& s) { return detail::state_found<State>(model.propagate(s, u, dt)); }, x);
  }
  [[nodiscard]] auto jacobian(const State& x) const
    requires MeasurementModel<Model>
  {
    using Z = typename Model::Measurement;
    const Model& model = *this;
    return numeric_jacobian([&](const State& s) { return detail::state_found<Z>(model.predict(s)); }, x);
  }
};

namespace detail {

/// X with dual numbers.
template <class X>
using Dualled = typename Recast<X, Dual<ScalarOf<X>, dof<X>>>::type;

/// Whether what a function gave for duals has duals. (A State of doubles may convert from duals by the looks
/// of it, so that a function that takes it can be called, too.)
template <class A, class X>
consteval bool has_duals() {
  using D = Dual<ScalarOf<X>, dof<X>>;
  if constexpr (requires { typename ShapeOf<std::remove_cvref_t<A>>::Scalar; })
    return std::same_as<typename ShapeOf<std::remove_cvref_t<A>>::Scalar, D>;
  else
    return std::same_as<ScalarOf<std::remove_cvref_t<A>>, D>;
}

/// Whether propagate or predict, where there is one for the number itself, takes duals too.
template <class Model>
inline constexpr bool takes_duals = [] {
  using X = typename Model::State;
  if constexpr (dof<X> == dynamic) {
    return true;  // is refused by automatic_jacobian
  } else if constexpr (ProcessModel<Model>) {
    return requires(const Model& model, const Dualled<X>& x, const typename Model::Control& u) {
      requires has_duals<decltype(model.propagate(x, u, 0.0)), X>();
    };
  } else if constexpr (MeasurementModel<Model>) {
    return requires(const Model& model, const Dualled<X>& x) {
      requires has_duals<decltype(model.predict(x)), X>();
    };
  } else {
    return true;  // nothing that could be differentiated: the filter says what is missing
  }
}();

}  // namespace detail

/// The model with Jacobians by dual numbers.
template <class Model>
struct Automatic : Model {
  static_assert(detail::takes_duals<Model>,
                "cairn: automatic() sends dual numbers through propagate() or predict(), which has to be a "
                "template over the number for that; numeric() takes the model as it is");
  using State = typename Model::State;

  template <class Control>
    requires ProcessModel<Model>
  [[nodiscard]] auto jacobian(const State& x, const Control& u, double dt) const {
    const Model& model = *this;
    return automatic_jacobian([&](const auto& s) { return model.propagate(s, u, dt); }, x);
  }
  [[nodiscard]] auto jacobian(const State& x) const
    requires MeasurementModel<Model>
  {
    const Model& model = *this;
    return automatic_jacobian([&](const auto& s) { return model.predict(s); }, x);
  }
};

template <class Model>
[[nodiscard]] Numeric<Model> numeric(const Model& model) {
  return {model};
}
template <class Model>
[[nodiscard]] Automatic<Model> automatic(const Model& model) {
  return {model};
}

/// Largest difference of any entry between a given Jacobian and a reference, relative to 1 + |reference|;
/// infinite where their sizes differ.
struct JacobianComparison {
  double worst = 0.0;
  int row = 0;
  int column = 0;
  [[nodiscard]] bool agrees(double tolerance = 1e-6) const noexcept { return worst <= tolerance; }
};

template <class A, class B>
[[nodiscard]] JacobianComparison compare_jacobians(const A& given, const B& reference) {
  JacobianComparison result;
  const auto a = detail::as_found(given);
  const auto b = detail::as_found(reference);
  if (!detail::has_size(a, b.rows(), b.cols())) {
    result.worst = std::numeric_limits<double>::infinity();
    return result;
  }
  for (int i = 0; i < static_cast<int>(b.rows()); ++i)
    for (int j = 0; j < static_cast<int>(b.cols()); ++j) {
      const double expected = static_cast<double>(b(i, j));
      const double error = static_cast<double>(a(i, j)) - expected;
      const double relative = (error < 0 ? -error : error) / (1.0 + (expected < 0 ? -expected : expected));
      if (!(relative <= result.worst)) result = {relative, i, j};
    }
  return result;
}

/// The process's own Jacobian against central differences at (x, u, dt).
template <class F>
  requires(LinearisedProcess<F> || detail::explain_sizes<F>)
[[nodiscard]] JacobianComparison check_jacobian(const F& f, const typename F::State& x,
                                                const typename F::Control& u, double dt) {
  return compare_jacobians(f.jacobian(x, u, dt), numeric(f).jacobian(x, u, dt));
}
/// The sensor's own Jacobian against central differences at x.
template <class H>
  requires(LinearisedMeasurement<H> || detail::explain_sizes<H>)
[[nodiscard]] JacobianComparison check_jacobian(const H& h, const typename H::State& x) {
  return compare_jacobians(h.jacobian(x), numeric(h).jacobian(x));
}

/// A model's own Jacobian, dual numbers and central differences, each two compared: the one that agrees with
/// neither of the others is wrong.
struct JacobianCheck {
  JacobianComparison given_automatic;
  JacobianComparison given_numeric;
  JacobianComparison automatic_numeric;
  [[nodiscard]] bool agree(double tolerance = 1e-6) const noexcept {
    return given_automatic.agrees(tolerance) && given_numeric.agrees(tolerance) &&
           automatic_numeric.agrees(tolerance);
  }
};

namespace detail {

template <class A, class B, class C>
[[nodiscard]] JacobianCheck check_three(const A& given, const B& by_duals, const C& by_differences) {
  return {compare_jacobians(given, by_duals), compare_jacobians(given, by_differences),
          compare_jacobians(by_duals, by_differences)};
}

}  // namespace detail

/// All three Jacobians of a process whose propagate is a template over the scalar, at (x, u, dt).
template <class F>
  requires(LinearisedProcess<F> || detail::explain_sizes<F>)
[[nodiscard]] JacobianCheck check_jacobians(const F& f, const typename F::State& x,
                                            const typename F::Control& u, double dt) {
  return detail::check_three(f.jacobian(x, u, dt), automatic(f).jacobian(x, u, dt),
                             numeric(f).jacobian(x, u, dt));
}
/// All three Jacobians of a sensor whose predict is a template over the scalar, at x.
template <class H>
  requires(LinearisedMeasurement<H> || detail::explain_sizes<H>)
[[nodiscard]] JacobianCheck check_jacobians(const H& h, const typename H::State& x) {
  return detail::check_three(h.jacobian(x), automatic(h).jacobian(x), numeric(h).jacobian(x));
}

}}  // namespace cairn::CAIRN_ABI
