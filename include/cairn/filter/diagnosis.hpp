// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Why a step was refused, for people: explain() of status.hpp with the matrix or vector that is at fault.
///
/// ```cpp
/// const auto innovation = filter.update(belief, gps, z);
/// if (!innovation.accepted()) std::cerr << cairn::explain(innovation.status, belief, gps, z) << '\n';
/// ```
///
/// A filter at work looks at no more than it needs; here everything is asked again, one after the other, so
/// this is for what was refused. Of P, the covariance of the belief; Q, a process's noise(x, u, dt); R, a
/// sensor's noise(x); F and H, their jacobians. O(n^3), allocates.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstdio>
#include <initializer_list>
#include <string>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

using AnyMatrix = Matrix<dynamic, dynamic, double>;

/// Whatever stands for a matrix, as doubles of run-time size.
template <class A>
[[nodiscard]] AnyMatrix any_matrix(const A& a) {
  return as_found(a).template cast<double>();
}

[[nodiscard]] inline std::string in_words(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

/// "row 1, column 2 is nan", or nothing where all numbers are finite.
[[nodiscard]] inline std::string not_finite_in(const AnyMatrix& a) {
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    for (Eigen::Index j = 0; j < a.cols(); ++j)
      if (!std::isfinite(a(i, j)))
        return "row " + std::to_string(i) + ", column " + std::to_string(j) + " is " + in_words(a(i, j));
  return {};
}

/// What keeps a from being a covariance, with `singular_too` from one that has an inverse; or nothing.
[[nodiscard]] inline std::string no_covariance(const AnyMatrix& a, bool singular_too) {
  if (a.rows() != a.cols()) return "it is not square";
  if (const std::string bad = not_finite_in(a); !bad.empty()) return bad;
  const auto entry = [](Eigen::Index i) { return "the variance in row " + std::to_string(i); };
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    if (a(i, i) < 0) return entry(i) + " is negative: " + in_words(a(i, i));
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    for (Eigen::Index j = 0; j < i; ++j)
      if (!(std::abs(a(i, j) - a(j, i)) <= 1e-4 * std::sqrt(a(i, i) * a(j, j))))
        return "it is not symmetric: " + in_words(a(i, j)) + " and " + in_words(a(j, i)) + " in rows " +
               std::to_string(i) + " and " + std::to_string(j);
  AnyMatrix root = a;
  if (!rare_root<dynamic, double>(a, root)) return "it has a negative variance in some direction";
  if (!singular_too) return {};
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    if (a(i, i) == 0) return entry(i) + " is zero";
  if (!regular_root<dynamic, double>(a, root)) return "it has no variance in some direction";
  return {};
}

/// The sentence of the status, and behind it what was found.
[[nodiscard]] inline std::string explained(Status status, const std::string& found) {
  return found.empty() ? std::string(explain(status)) : std::string(explain(status)) + ": " + found;
}
[[nodiscard]] inline std::string at_fault(const char* what, const std::string& why) {
  return why.empty() ? std::string() : std::string(what) + ": " + why;
}
[[nodiscard]] inline std::string first_of(std::initializer_list<std::string> found) {
  for (const std::string& one : found)
    if (!one.empty()) return one;
  return {};
}

}  // namespace detail

/// The sentence of an update's status and what is at fault: "refused: a covariance is not positive definite:
/// R, noise(x) of the sensor: the variance in row 0 is zero". Adds nothing to other statuses.
template <Manifold X, class H>
  requires MeasurementModel<H> && std::same_as<X, typename H::State>
[[nodiscard]] std::string explain(Status status, const Gaussian<X>& belief, const H& sensor,
                                  const typename H::Measurement& z) {
  constexpr const char* p_is = "P, the covariance of the belief";
  constexpr const char* r_is = "R, noise(x) of the sensor";
  const detail::AnyMatrix p = detail::any_matrix(belief.covariance);
  const auto sizes = [](const detail::AnyMatrix& a) {
    return std::to_string(a.rows()) + " x " + std::to_string(a.cols());
  };
  if (status == Status::size_mismatch)  // nothing more is asked of a sensor that may not fit
    return detail::explained(status, "the mean has " + std::to_string(dof_of(belief.mean)) +
                                         " numbers, P is " + sizes(p) + ", z has " +
                                         std::to_string(dof_of(z)));
  if (status != Status::not_finite && status != Status::not_positive_definite)
    return detail::explained(status, {});
  if (!detail::finite_state(belief.mean)) return detail::explained(status, "the mean of the belief");
  const detail::AnyMatrix r = detail::any_matrix(sensor.noise(belief.mean));
  if (status == Status::not_finite) {
    detail::AnyMatrix h(0, 0);
    if constexpr (LinearisedMeasurement<H>) h = detail::any_matrix(sensor.jacobian(belief.mean));
    return detail::explained(
        status,
        detail::first_of(
            {detail::at_fault(p_is, detail::not_finite_in(p)),
             detail::finite_state(z) ? std::string() : "the measurement",
             detail::finite_state(detail::state_found<typename H::Measurement>(sensor.predict(belief.mean)))
                 ? std::string()
                 : "predict(x) of the sensor",
             detail::at_fault("H, jacobian(x) of the sensor", detail::not_finite_in(h)),
             detail::at_fault(r_is, detail::not_finite_in(r))}));
  }
  return detail::explained(status,
                           detail::first_of({detail::at_fault(p_is, detail::no_covariance(p, false)),
                                             detail::at_fault(r_is, detail::no_covariance(r, true)),
                                             "S = H P H^T + R, where rounding left too little of it"}));
}

/// The same of a step of the process.
template <Manifold X, class F>
  requires ProcessModel<F> && std::same_as<X, typename F::State>
[[nodiscard]] std::string explain(
    Status status, const Gaussian<X>& belief, const F& process, double dt,
    const typename F::Control& control = detail::no_control<typename F::Control>()) {
  constexpr const char* p_is = "P, the covariance of the belief";
  constexpr const char* q_is = "Q, noise(x, u, dt) of the process";
  if (status == Status::bad_time_step) return detail::explained(status, "dt is " + detail::in_words(dt));
  if (status != Status::not_finite && status != Status::not_positive_definite)
    return detail::explained(status, {});
  if (!detail::finite_state(belief.mean)) return detail::explained(status, "the mean of the belief");
  const detail::AnyMatrix p = detail::any_matrix(belief.covariance);
  const X moved = detail::state_found<X>(process.propagate(belief.mean, control, dt));
  if (!detail::finite_state(moved)) return detail::explained(status, "propagate(x, u, dt) of the process");
  const detail::AnyMatrix q = detail::any_matrix(process.noise(belief.mean, control, dt));
  if (status == Status::not_finite) {
    detail::AnyMatrix f(0, 0);
    if constexpr (LinearisedProcess<F>) f = detail::any_matrix(process.jacobian(belief.mean, control, dt));
    return detail::explained(
        status,
        detail::first_of({detail::at_fault(p_is, detail::not_finite_in(p)),
                          detail::at_fault("F, jacobian(x, u, dt) of the process", detail::not_finite_in(f)),
                          detail::at_fault(q_is, detail::not_finite_in(q))}));
  }
  return detail::explained(status, detail::first_of({detail::at_fault(p_is, detail::no_covariance(p, false)),
                                                     detail::at_fault(q_is, detail::no_covariance(q, false)),
                                                     "F P F^T + Q, where rounding left too little of it"}));
}

}}  // namespace cairn::CAIRN_ABI
