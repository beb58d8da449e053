// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where a user's types end. Every filter wraps the model and the measurement it is given in these and works
/// on what they return: plain column-major matrices (or Structured ones, whose zeros are worth something) and
/// states, of the sizes that the belief and the measurement ask for.
///
/// A matrix or vector that is already so is handed on, not copied. One of another run-time size becomes one
/// of the right size full of NaN, so that nothing behind reads past an end, and misfit() says so: a filter
/// asks it before it keeps anything, and refuses with Status::size_mismatch. Where all sizes are fixed
/// nothing of this is left after compiling.
#pragma once

#include <concepts>
#include <type_traits>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/explain_sizes.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// What a caller gave for a measurement or a control, as the type T that the model speaks of.
template <class T, class A = T>
class Given {
  static_assert(given_fits<T, A>());
  static constexpr bool of_eigen = OfEigen<T> && OfEigen<A>;

public:
  explicit Given(const A& given) : value_(convert(given, misfit_)) {}
  [[nodiscard]] const T& value() const noexcept { return value_; }
  [[nodiscard]] bool misfit() const noexcept { return misfit_; }

private:
  [[nodiscard]] static T convert(const A& given, bool& misfit) {
    if constexpr (of_eigen && is_vector<T>) {
      return plain_vector<T>(given, dof<T> != dynamic ? dof<T> : given.size(), misfit);
    } else if constexpr (of_eigen) {
      constexpr int rows = ShapeOf<T>::rows, columns = ShapeOf<T>::columns;
      return plain_matrix<rows, columns, typename ShapeOf<T>::Scalar>(
          given, rows != dynamic ? rows : given.rows(), columns != dynamic ? columns : given.cols(), misfit);
    } else {
      return static_cast<T>(given);
    }
  }

  bool misfit_ = false;  // before value_, whose conversion may set it
  T value_;
};
template <class T>
class Given<T, T> {
public:
  [[gnu::always_inline]] explicit Given(const T& given) : value_(given) {}
  [[gnu::always_inline]] [[nodiscard]] const T& value() const noexcept { return value_; }
  [[nodiscard]] static constexpr bool misfit() noexcept { return false; }

private:
  const T& value_;
};

/// Room for what stands in for a matrix of a wrong run-time size that is known by reference only.
template <int R, int C, class S>
struct StandIn {
  Matrix<R, C, S> matrix;
};
template <int R, int C, class S>
  requires(R != dynamic && C != dynamic)
struct StandIn<R, C, S> {};

/// The plain matrix of rows x columns that a model returned: its own where it is one already.
template <int R, int C, class S, class A>
[[nodiscard]] decltype(auto) plain_result(A&& a, Eigen::Index rows, Eigen::Index columns, bool& misfit,
                                          StandIn<R, C, S>& stand_in) {
  if constexpr (!std::same_as<std::remove_cvref_t<A>, Matrix<R, C, S>>) {
    return plain_matrix<R, C, S>(a, rows, columns, misfit);
  } else if constexpr (std::is_lvalue_reference_v<A>) {
    if (has_size(a, rows, columns)) [[likely]]
      return std::as_const(a);
    misfit = true;
    stand_in.matrix = no_matrix<R, C, S>(rows, columns);
    return std::as_const(stand_in.matrix);
  } else {
    const bool fits = has_size(a, rows, columns);
    misfit = misfit || !fits;
    return fits ? Matrix<R, C, S>(std::forward<A>(a)) : no_matrix<R, C, S>(rows, columns);
  }
}

/// The model's function returns what the filters work on as it is.
template <class A, int R, int C, class S>
inline constexpr bool returns_plain = is_plain<std::remove_cvref_t<A>, R, C, S>;
template <class A, class X>
inline constexpr bool returns_state = dof<X> != dynamic && std::same_as<std::remove_cvref_t<A>, X>;

/// To be called with packs (vectorised.hpp).
template <class Model>
inline constexpr bool side_by_side = requires { requires Model::side_by_side; };

/// A process with the control it is given, for a state whose steps have `size` numbers.
template <class F, class U = detail::ControlOf<F>>
class PlainProcess {
public:
  using State = typename F::State;
  using Noise = typename NoiseOfProcess<F>::type;

  /// A size of 0 fits nothing.
  [[gnu::always_inline]] PlainProcess(const F& model, int size, const U& control)
      : model_(model), control_(control), size_(size) {
    misfit_ = control_.misfit();
    if constexpr (n == dynamic) misfit_ = misfit_ || size < 1;
  }

  /// Something that was given, or asked of the model, has a size that does not fit.
  [[gnu::always_inline]] [[nodiscard]] bool misfit() const noexcept { return misfit_; }

  [[gnu::always_inline]] decltype(auto) propagate(const State& x, double dt) const {
    if constexpr (returns_state<decltype(model_.propagate(x, u(), dt)), State>)
      return model_.propagate(x, u(), dt);
    else
      return plain_state<State>(model_.propagate(x, u(), dt), size_, x, misfit_);
  }
  /// Packs (vectorised.hpp) instead of numbers.
  template <class Packs>
    requires side_by_side<F>
  [[gnu::always_inline]] auto propagate(const Packs& x, double dt) const {
    return model_.propagate(x, u(), dt);
  }
  /// The motion with its noise, however that enters (model.hpp).
  [[nodiscard]] State driven(const State& x, const Tangent<Noise>& w, double dt) const {
    if constexpr (DrivenProcess<F>)
      return plain_state<State>(model_.propagate(x, u(), w, dt), size_, x, misfit_);
    else
      return retract(State(propagate(x, dt)), w);
  }

  [[gnu::always_inline]] decltype(auto) jacobian(const State& x, double dt) const {
    if constexpr (returns_plain<decltype(model_.jacobian(x, u(), dt)), n, n, S>)
      return model_.jacobian(x, u(), dt);
    else
      return plain_result<n, n, S>(model_.jacobian(x, u(), dt), size_, size_, misfit_, jacobian_);
  }
  [[gnu::always_inline]] decltype(auto) noise(const State& x, double dt) const {
    if constexpr (returns_plain<decltype(model_.noise(x, u(), dt)), k, k, S>)
      return model_.noise(x, u(), dt);
    else
      return sized_noise(model_.noise(x, u(), dt));
  }

  // In continuous time (kalman_bucy.hpp).
  [[nodiscard]] Tangent<State> rate(const State& x) const {
    return plain_vector<Tangent<State>>(model_.rate(x, u()), size_, misfit_);
  }
  [[nodiscard]] CovarianceOf<State> rate_jacobian(const State& x) const {
    return plain_matrix<n, n, S>(model_.rate_jacobian(x, u()), size_, size_, misfit_);
  }
  [[nodiscard]] CovarianceOf<State> spectral_density(const State& x) const {
    return plain_matrix<n, n, S>(model_.spectral_density(x, u()), size_, size_, misfit_);
  }

private:
  using S = ScalarOf<State>;
  static constexpr int n = dof<State>;
  static constexpr int k = dof<Noise>;

  [[gnu::always_inline]] [[nodiscard]] const auto& u() const noexcept { return control_.value(); }

  /// Driven noise of run-time size may be of any; else it is known how many numbers it has.
  template <class A>
  [[nodiscard]] decltype(auto) sized_noise(A&& a) const {
    const auto size = !DrivenProcess<F> ? size_ : (k != dynamic ? k : static_cast<int>(a.rows()));
    misfit_ = misfit_ || size < 1;
    return plain_result<k, k, S>(std::forward<A>(a), size, size, misfit_, noise_);
  }

  const F& model_;
  Given<typename F::Control, U> control_;
  int size_;
  mutable bool misfit_;
  [[no_unique_address]] mutable StandIn<n, n, S> jacobian_;
  [[no_unique_address]] mutable StandIn<k, k, S> noise_;
};

/// A sensor and what it is said to have measured, for a state whose steps have `size` numbers.
template <class H, class V = typename H::Measurement>
class PlainSensor {
public:
  using State = typename H::State;
  using Measurement = typename H::Measurement;
  using Noise = typename NoiseOfSensor<H>::type;

  /// A size of 0 fits nothing.
  [[gnu::always_inline]] PlainSensor(const H& model, int size, const V& z)
      : model_(model), z_(z), size_(size) {
    misfit_ = z_.misfit();
    if constexpr (n == dynamic) misfit_ = misfit_ || size < 1;
    if constexpr (m == dynamic) misfit_ = misfit_ || numbers() < 1;
  }

  /// Something that was given, or asked of the model, has a size that does not fit.
  [[gnu::always_inline]] [[nodiscard]] bool misfit() const noexcept { return misfit_; }

  [[gnu::always_inline]] [[nodiscard]] const Measurement& z() const noexcept { return z_.value(); }
  /// How many numbers a step of the measurement has.
  [[gnu::always_inline]] [[nodiscard]] int numbers() const {
    if constexpr (m != dynamic)
      return m;
    else
      return dof_of(z());
  }

  [[gnu::always_inline]] decltype(auto) predict(const State& x) const {
    if constexpr (returns_state<decltype(model_.predict(x)), Measurement>)
      return model_.predict(x);
    else
      return plain_state<Measurement>(model_.predict(x), numbers(), z(), misfit_);
  }
  /// Packs (vectorised.hpp) instead of numbers.
  template <class Packs>
    requires side_by_side<H>
  [[gnu::always_inline]] auto predict(const Packs& x) const {
    return model_.predict(x);
  }
  /// What is measured with the noise v, however that enters (model.hpp).
  [[nodiscard]] Measurement driven(const State& x, const Tangent<Noise>& v) const {
    if constexpr (DrivenMeasurement<H>)
      return plain_state<Measurement>(model_.predict(x, v), numbers(), z(), misfit_);
    else
      return retract(Measurement(predict(x)), v);
  }
  /// z (-) h(x).
  [[gnu::always_inline]] [[nodiscard]] Tangent<Measurement> residual(const State& x) const {
    if constexpr (returns_state<decltype(model_.predict(x)), Measurement>) {
      return local(Measurement(model_.predict(x)), z());
    } else {
      const Measurement seen = predict(x);
      if (misfit_) return no_matrix<m, 1, S>(numbers(), 1);
      return local(seen, z());
    }
  }

  [[gnu::always_inline]] decltype(auto) jacobian(const State& x) const {
    if constexpr (returns_plain<decltype(model_.jacobian(x)), m, n, S>)
      return model_.jacobian(x);
    else
      return plain_result<m, n, S>(model_.jacobian(x), numbers(), size_, misfit_, jacobian_);
  }
  [[gnu::always_inline]] decltype(auto) noise(const State& x) const {
    if constexpr (returns_plain<decltype(model_.noise(x)), k, k, S>)
      return model_.noise(x);
    else
      return sized_noise(model_.noise(x));
  }

private:
  using S = ScalarOf<State>;
  static constexpr int n = dof<State>;
  static constexpr int m = dof<Measurement>;
  static constexpr int k = dof<Noise>;

  /// Driven noise of run-time size may be of any; else it is known how many numbers it has.
  template <class A>
  [[nodiscard]] decltype(auto) sized_noise(A&& a) const {
    const auto size = !DrivenMeasurement<H> ? numbers() : (k != dynamic ? k : static_cast<int>(a.rows()));
    misfit_ = misfit_ || size < 1;
    return plain_result<k, k, S>(std::forward<A>(a), size, size, misfit_, noise_);
  }

  const H& model_;
  Given<Measurement, V> z_;
  int size_;
  mutable bool misfit_;
  [[no_unique_address]] mutable StandIn<m, n, S> jacobian_;
  [[no_unique_address]] mutable StandIn<k, k, S> noise_;
};

/// The update that a sensor's sizes do not let happen.
template <class H, class V>
[[nodiscard, gnu::cold]] auto misfitting(const PlainSensor<H, V>& sensor) {
  using S = ScalarOf<typename H::State>;
  constexpr int m = dof<typename H::Measurement>;
  Innovation<m, S> innovation;
  innovation.residual = Vector<m, S>::Zero(sensor.numbers());
  innovation.covariance = Matrix<m, m, S>::Zero(sensor.numbers(), sensor.numbers());
  innovation.status = Status::size_mismatch;
  return innovation;
}

}}}  // namespace cairn::CAIRN_ABI::detail
