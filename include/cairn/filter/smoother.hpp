// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Rauch-Tung-Striebel smoother: what the whole record says about every moment of it.
///
///   G_k = C_k P(k+1|k)^-1,   C_k = cov(x_k, x_{k+1|k}),  which is P F^T where the process is linear
///   x(k|T) = x(k|k) (+) G_k (x(k+1|T) (-) x(k+1|k)),   P(k|T) = P(k|k) + G_k (P(k+1|T) - P(k+1|k)) G_k^T
/// (H. Rauch, F. Tung, C. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 3,
/// 1965; S. Sarkka, "Unscented Rauch-Tung-Striebel smoother", IEEE Trans. Automatic Control 53, 2008.)
///
///   Recorder recorder(Kalman{}, prior);
///   status = recorder.predict(process, dt);   innovation = recorder.update(sensor, z);   ...
///   std::vector<Gaussian<State>> path = recorder.smoothed();
#pragma once

#include <concepts>
#include <cstddef>
#include <optional>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/kernels.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/plain_model.hpp>
#include <cairn/filter/sigma_points.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// One prediction as a smoother needs it: what was known before, what was predicted, and how they vary
/// together.
template <Manifold X>
struct RecordedStep {
  Gaussian<X> before;
  Gaussian<X> predicted;
  CovarianceOf<X> cross;  ///< covariance of the state before and the state after
};

namespace detail {

template <class Filter, class F, class U>
[[nodiscard]] CovarianceOf<typename F::State> cross_covariance(const Filter& filter,
                                                               const Gaussian<typename F::State>& belief,
                                                               const F& process, const U& u, double dt) {
  using X = typename F::State;
  const PlainProcess plain(process, common_size(belief.mean, belief.covariance), u);
  if constexpr (std::same_as<Filter, Unscented>) {
    const auto f = [&](const X& x) -> X { return plain.propagate(x, dt); };
    const CovarianceOf<X> root = semi_definite_root<dof<X>, ScalarOf<X>>(belief.covariance);
    const SigmaPoints& points = filter.points;
    return unscented_transform(belief.mean, root, f, points.spread_squared(static_cast<int>(root.rows())),
                               points.beta - points.alpha * points.alpha)
        .cross;
  } else {
    const CovarianceOf<X> f = dense_of(plain.jacobian(belief.mean, dt));
    return belief.covariance * f.transpose();
  }
}

/// All of one size, as those of a Recorder are.
template <Manifold X>
[[nodiscard]] bool fits_together(const RecordedStep<X>& step, const Gaussian<X>& after) {
  const int n = common_size(step.before.mean, step.before.covariance);
  return n > 0 && common_size(step.predicted.mean, step.predicted.covariance) == n &&
         common_size(after.mean, after.covariance) == n && has_size(step.cross, n, n);
}

/// cross * predicted^-1. A direction without predicted uncertainty is not corrected.
template <Manifold X>
[[nodiscard]] CovarianceOf<X> smoother_gain(const RecordedStep<X>& step) {
  const int n = static_cast<int>(step.cross.rows());
  const CovarianceOf<X> lower = semi_definite_root<dof<X>, ScalarOf<X>>(step.predicted.covariance);
  CovarianceOf<X> gain_t = transposed<dof<X>, dof<X>, ScalarOf<X>>(step.cross);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) gain_t.row(i) -= lower(i, k) * gain_t.row(k);
    gain_t.row(i) *= lower(i, i) > 0 ? ScalarOf<X>(1) / lower(i, i) : ScalarOf<X>(0);
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) gain_t.row(i) -= lower(k, i) * gain_t.row(k);
    gain_t.row(i) *= lower(i, i) > 0 ? ScalarOf<X>(1) / lower(i, i) : ScalarOf<X>(0);
  }
  return transposed<dof<X>, dof<X>, ScalarOf<X>>(gain_t);
}

}  // namespace detail

/// The belief before `step`, corrected by what became known of the state after it.
template <Manifold X>
[[nodiscard]] Gaussian<X> smooth_back(const RecordedStep<X>& step, const Gaussian<X>& after) {
  CAIRN_EXPECTS(detail::fits_together(step, after), "smooth_back needs beliefs of one size");
  const CovarianceOf<X> gain = detail::smoother_gain(step);
  constexpr int n = dof<X>;
  const Tangent<X> correction =
      detail::column_product(gain, Tangent<X>(local(step.predicted.mean, after.mean)));
  const CovarianceOf<X> change = after.covariance - step.predicted.covariance;
  return {retract(step.before.mean, correction),
          symmetrised(step.before.covariance +
                      detail::column_product(
                          gain, detail::column_product(change, transposed<n, n, ScalarOf<X>>(gain))))};
}

/// Runs a filter and remembers what smoothing needs: one RecordedStep a prediction.
template <class Filter, Manifold X>
class Recorder {
public:
  Recorder(const Filter& filter, const Gaussian<X>& prior) : filter_(filter), belief_(prior) {}

  template <class F, class U = typename F::Control>
    requires(ProcessModel<F> || detail::explain_sizes<F>)
  Status predict(const F& process, const U& control, double dt) {
    const Gaussian<X> before = belief_;
    const Status status = filter_.predict(belief_, process, control, dt);
    if (status == Status::accepted)
      steps_.push_back({before, belief_, detail::cross_covariance(filter_, before, process, control, dt)});
    return status;
  }
  template <class F>
    requires(ProcessModel<F> || detail::explain_sizes<F>) && std::same_as<typename F::Control, NoControl>
  Status predict(const F& process, double dt) {
    return predict(process, NoControl{}, dt);
  }

  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sizes<H>)
  auto update(const H& sensor, const V& z) {
    return filter_.update(belief_, sensor, z);
  }

  /// The filter's belief now.
  [[nodiscard]] const Gaussian<X>& belief() const noexcept { return belief_; }
  [[nodiscard]] const std::vector<RecordedStep<X>>& steps() const noexcept { return steps_; }

  /// Every moment given the whole record: element 0 before the first prediction, the last one the filter's.
  [[nodiscard]] std::vector<Gaussian<X>> smoothed() const {
    std::vector<Gaussian<X>> path(steps_.size() + 1, belief_);
    for (std::size_t k = steps_.size(); k-- > 0;) path[k] = smooth_back(steps_[k], path[k + 1]);
    return path;
  }

  /// The moment `lag` predictions ago given everything until now; nothing if there are fewer. O(lag).
  [[nodiscard]] std::optional<Gaussian<X>> lagged(std::size_t lag) const {
    if (lag > steps_.size()) return std::nullopt;
    Gaussian<X> belief = belief_;
    for (std::size_t k = 0; k < lag; ++k) belief = smooth_back(steps_[steps_.size() - 1 - k], belief);
    return belief;
  }

  /// Forgets all but the last `lag` predictions: the memory of a fixed-lag smoother.
  void keep_last(std::size_t lag) {
    if (steps_.size() > lag) steps_.erase(steps_.begin(), steps_.end() - static_cast<std::ptrdiff_t>(lag));
  }

private:
  Filter filter_;
  Gaussian<X> belief_;
  std::vector<RecordedStep<X>> steps_;
};

}  // namespace cairn::inline CAIRN_ABI
