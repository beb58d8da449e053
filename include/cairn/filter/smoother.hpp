// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Rauch-Tung-Striebel smoother: what the whole record says about every moment of it.
///
///   G_k = C_k P(k+1|k)^-1,   C_k = cov(x_k, x_{k+1|k}),  which is P F^T where the process is linear
///   x(k|T) = x(k|k) (+) G_k (x(k+1|T) (-) x(k+1|k)),   P(k|T) = V_k + G_k P(k+1|T) G_k^T
/// V_k is what would be left of P(k|k) if x(k+1) were known, P(k|k) - G_k P(k+1|k) G_k^T, as a sum of
/// squares: with P(k|k) = L L^T, F L the image of L by the motion and everything else that P(k+1|k) consists
/// of as W W^T,
///   V_k = (L - G_k F L)(L - G_k F L)^T + G_k W (G_k W)^T
/// G brings back what the state after says. Of a direction that has less than 2e-13 of the variance of the
/// numbers it is made of, P(k+1|k) and P(k+1|T) as matrices say nothing: nothing is brought back from there,
/// and what the state after would have said of it is not known of the smoothed moment. So units matter:
/// choose them so that the deviations of a record are within a thousand of each other (docs/filters.md has
/// figures). (H. Rauch, F. Tung, C. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
/// Journal 3, 1965; S. Sarkka, "Unscented Rauch-Tung-Striebel smoother", IEEE Trans. Automatic Control 53,
/// 2008.)
///
/// ```cpp
/// cairn::Recorder recorder(cairn::Kalman{}, prior);
/// for (const auto& z : measurements) {
///   status = recorder.predict(process, dt);
///   innovation = recorder.update(sensor, z);
/// }
/// const std::vector<cairn::Gaussian<State>> path = recorder.smoothed();
/// ```
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/array_update.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/filter/unscented_transform.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

struct AugmentedUnscented;
struct SquareRootUnscented;

/// One prediction as a smoother needs it: what was known before, what was predicted, and what the state after
/// says about the state before.
template <Manifold X>
struct RecordedStep {
  Gaussian<X> before;
  Gaussian<X> predicted;
  CovarianceOf<X> gain;         ///< G: step of the state before by step of the state after
  CovarianceOf<X> given_after;  ///< V: covariance of the state before if the state after were known
};

namespace detail {

/// How a prediction made its covariance: image^T and rest, rows of an array whose squares they are. The first
/// n rows are the images of the columns of `root`, the others stand for all that was added.
template <class X, class Array>
void record_rows(RecordedStep<X>& step, const CovarianceOf<X>& root, Array& array) {
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  const int ns = static_cast<int>(root.rows()), rows = static_cast<int>(array.rows());
  // [image^T L^T; rest^T 0] -> [U, (G U^T)^T; 0 *],  U^T U = P(k+1|k); a number that others fix has no pivot:
  // G would be of that matrix's rounding, and V = P - G P(k+1|k) G^T too small by what P(k+1|T) has lost
  Array triangular = array;
  Vector<n, int> pivot = Vector<n, int>::Zero(ns);
  to_echelon(triangular, ns, pivot);
  step.gain = CovarianceOf<X>::Zero(ns, ns);
  for (int j = ns - 1; j >= 0; --j) {
    const int row = pivot(j);
    if (row < 0) continue;
    for (int i = 0; i < ns; ++i) {
      S sum = triangular(row, ns + i);
      for (int k = j + 1; k < ns; ++k) sum -= step.gain(i, k) * triangular(row, k);
      step.gain(i, j) = sum / triangular(row, j);
    }
  }
  Matrix<n, Array::RowsAtCompileTime, S> left(ns, rows);
  for (int k = 0; k < rows; ++k)
    for (int i = 0; i < ns; ++i) {
      S sum = array(k, ns + i);
      for (int j = 0; j < ns; ++j) sum -= step.gain(i, j) * array(k, j);
      left(i, k) = sum;
    }
  square(left, step.given_after);
}

/// All of one size, as those of a Recorder are.
template <Manifold X>
[[nodiscard]] bool fits_together(const RecordedStep<X>& step, const Gaussian<X>& after) {
  const int n = common_size(step.before.mean, step.before.covariance);
  return n > 0 && common_size(step.predicted.mean, step.predicted.covariance) == n &&
         common_size(after.mean, after.covariance) == n && has_size(step.gain, n, n) &&
         has_size(step.given_after, n, n);
}

/// The filter that predicts: that inside of one which is around another.
template <class Filter>
[[nodiscard]] const auto& predicting_filter(const Filter& filter) {
  if constexpr (requires { filter.filter; })
    return predicting_filter(filter.filter);
  else
    return filter;
}

/// The step that led from `before` to `predicted`; nothing where `before` has no covariance. Where rounding
/// has left `predicted` none, it gets the sum of the squares that it consists of.
template <class Filter, class F, class U>
[[nodiscard]] std::optional<RecordedStep<typename F::State>> record_step(
    const Filter& filter, const Gaussian<typename F::State>& before,
    const Gaussian<typename F::State>& predicted, const F& process, const U& u, double dt) {
  using X = typename F::State;
  using S = ScalarOf<X>;
  using std::sqrt;
  constexpr int n = dof<X>;
  static_assert(
      !std::same_as<Filter, AugmentedUnscented> || LinearProcess<F>,
      "cairn: a Recorder of AugmentedUnscented takes linear processes: where the noise bends, what a "
      "state says of the one before is no sum of a moved and an added part");
  const PlainProcess plain(process, common_size(before.mean, before.covariance), u);
  CovarianceOf<X> root = before.covariance;
  if (!checked_root<n, S>(before.covariance, root)) return std::nullopt;
  const int ns = static_cast<int>(root.rows());
  RecordedStep<X> step{before, predicted, root, root};
  CovarianceOf<X> q = dense_of(plain.noise(before.mean, dt));
  double fading = 1.0;
  if constexpr (requires { filter.fading; }) {
    fading = filter.fading;
    for (int i = 0; i < ns; ++i) q(i, i) += static_cast<S>(filter.stabilising_noise);
  }
  const S faded = sqrt(static_cast<S>(fading)), more = sqrt(static_cast<S>(fading - 1.0));
  const CovarianceOf<X> root_q = semi_definite_root<n, S>(q);
  constexpr bool unscented = std::same_as<Filter, Unscented> || std::same_as<Filter, SquareRootUnscented>;
  constexpr int count = unscented ? 4 : 3;  // blocks of n rows: image, fading, noise and what is bent
  constexpr int rows = n == dynamic ? dynamic : count * n + 1;
  Matrix<rows, size_sum<n, n>, S> array = Matrix<rows, size_sum<n, n>, S>::Zero(count * ns + 1, 2 * ns);
  if constexpr (unscented) {
    const SigmaPoints& points = filter.points;
    Matrix<rows, size_sum<n, n>, S> sums = array;
    const auto f = [&](const X& x) -> X { return plain.propagate(x, dt); };
    static_cast<void>(sigma_rows(before.mean, root, f, points.spread_squared(ns),
                                 points.beta - points.alpha * points.alpha, sums));
    for (int j = 0; j < ns; ++j) {
      for (int i = 0; i < ns; ++i) {
        array(i, j) = sums(i, j);
        array(3 * ns + i, j) = faded * sums(ns + i, j);
      }
      const S last = faded * sums(2 * ns, j);
      array(4 * ns, j) = finite(last) ? last : S(0);  // a negative square, which no root has
    }
  } else {
    const CovarianceOf<X> jacobian = dense_of(plain.jacobian(before.mean, dt));
    put_transposed(array, 0, 0, column_product(jacobian, root));
  }
  for (int j = 0; j < ns; ++j)
    for (int i = 0; i < ns; ++i) {
      array(ns + i, j) = more * array(i, j);
      array(2 * ns + i, j) = root_q(j, i);
    }
  if (!is_valid_covariance<n, S>(predicted.covariance))
    square(array.leftCols(ns).transpose(), step.predicted.covariance);
  put_transposed(array, 0, ns, root);
  record_rows(step, root, array);
  return step;
}

}  // namespace detail

/// The belief before `step`, corrected by what became known of the state after it. Its covariance is a sum of
/// squares, and one however little was left.
template <Manifold X>
[[nodiscard]] Gaussian<X> smooth_back(const RecordedStep<X>& step, const Gaussian<X>& after) {
  CAIRN_EXPECTS(detail::fits_together(step, after), "smooth_back needs beliefs of one size");
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  const Tangent<X> correction =
      detail::column_product(step.gain, Tangent<X>(local(step.predicted.mean, after.mean)));
  const CovarianceOf<X> root =
      detail::column_product(step.gain, detail::semi_definite_root<n, S>(after.covariance));
  return {retract(step.before.mean, correction), step.given_after + detail::squared_root<n, S>(root)};
}

/// Runs a filter and remembers what smoothing needs: one RecordedStep a prediction. The filter's own form of
/// belief is kept; the steps, and so the smoother, are of covariances.
template <class Filter, Manifold X>
class Recorder {
  static_assert(detail::demand_proper_belief<BeliefOf<Filter, X>>());

public:
  using Belief = BeliefOf<Filter, X>;

  /// Throws Error where the filter's belief is of another form than the prior, which is no covariance.
  Recorder(const Filter& filter, const Gaussian<X>& prior) : filter_(filter), belief_(Belief::from(prior)) {}

  /// As the filter's own; refused as well where the belief before has no covariance, which a filter may not
  /// see before an update. One that rounding has left indefinite here is made of squares.
  template <class F, class U = detail::ControlOf<F>>
    requires(ProcessModel<F> || detail::explain_process<F>)
  Status predict(const F& process, double dt, const U& control = detail::no_control<U>()) {
    static_assert(detail::demand_one_belief<Filter, Belief, F>());
    const Belief before = belief_;
    const Status status = filter_.predict(belief_, process, dt, control);
    if (status != Status::accepted) return status;
    const Gaussian<X> predicted = belief_.gaussian();
    auto step = detail::record_step(detail::predicting_filter(filter_), before.gaussian(), predicted, process,
                                    control, dt);
    if (!step) {
      belief_ = before;
      return Status::not_positive_definite;
    }
    if (step->predicted.covariance != predicted.covariance) belief_ = Belief::from(step->predicted);
    steps_.push_back(std::move(*step));
    return status;
  }

  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  auto update(const H& sensor, const V& z) {
    return filter_.update(belief_, sensor, z);
  }

  /// The filter's belief now.
  [[nodiscard]] const Belief& belief() const noexcept { return belief_; }
  [[nodiscard]] const std::vector<RecordedStep<X>>& steps() const noexcept { return steps_; }

  /// Every moment given the whole record: element 0 before the first prediction, the last one the filter's.
  [[nodiscard]] std::vector<Gaussian<X>> smoothed() const {
    std::vector<Gaussian<X>> path(steps_.size() + 1, belief_.gaussian());
    for (std::size_t k = steps_.size(); k-- > 0;) path[k] = smooth_back(steps_[k], path[k + 1]);
    return path;
  }

  /// The moment `lag` predictions ago given everything until now; nothing if there are fewer. O(lag).
  [[nodiscard]] std::optional<Gaussian<X>> lagged(std::size_t lag) const {
    if (lag > steps_.size()) return std::nullopt;
    Gaussian<X> belief = belief_.gaussian();
    for (std::size_t k = 0; k < lag; ++k) belief = smooth_back(steps_[steps_.size() - 1 - k], belief);
    return belief;
  }

  /// Forgets all but the last `lag` predictions: the memory of a fixed-lag smoother.
  void keep_last(std::size_t lag) {
    if (steps_.size() > lag) steps_.erase(steps_.begin(), steps_.end() - static_cast<std::ptrdiff_t>(lag));
  }

private:
  Filter filter_;
  Belief belief_;
  std::vector<RecordedStep<X>> steps_;
};

}}  // namespace cairn::CAIRN_ABI
