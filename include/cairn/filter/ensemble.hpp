// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The ensemble Kalman filter: mean and covariance are those of N sampled states that move by the model.
///
/// predict() moves every member with a draw of the noise. update() takes the decorrelated numbers of the
/// measurement one after the other; with a the member's distance from the mean, y that of what it would see,
/// s = var(y) + 1 and K = cov(a, y) / s:
///   perturbed     every member is corrected by a measurement with a draw of noise of its own
///   square_root   the mean is corrected by K, the distances by a <- a - K y / (1 + 1/sqrt(s)): no draw, and
///                 exactly the Kalman filter's update of the ensemble's mean and covariance
/// (G. Burgers, P. J. van Leeuwen, G. Evensen, "Analysis scheme in the ensemble Kalman filter", Monthly
/// Weather Review 126, 1998; J. Whitaker, T. Hamill, "Ensemble data assimilation without perturbed
/// observations", 130, 2002.) Needs neither Jacobian nor covariance, so the states may be many; the error of
/// sampling falls with 1/sqrt(N), and N <= dof leaves directions without uncertainty.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

enum class EnsembleForm { perturbed, square_root };

/// Equally probable states.
template <Manifold X>
struct Ensemble {
  using State = X;
  std::vector<X> members;

  /// `count` draws from a Gaussian.
  [[nodiscard]] static Ensemble draw(const Gaussian<X>& belief, std::size_t count, Random& random) {
    Ensemble result;
    result.members.reserve(count);
    for (std::size_t i = 0; i < count; ++i) result.members.push_back(sample(belief, random));
    return result;
  }
  [[nodiscard]] std::size_t size() const noexcept { return members.size(); }

  /// Mean, by two rounds of tangent averaging from the first member.
  [[nodiscard]] X mean() const {
    CAIRN_EXPECTS(!members.empty(), "the mean of an ensemble needs at least one member");
    CAIRN_EXPECTS(detail::common_size(members) > 0, "the members of an ensemble have one size");
    X center = members.front();
    for (int round = 0; round < 2; ++round) {
      Tangent<X> shift = Tangent<X>::Zero(dof_of(center));
      for (const X& x : members) shift += local(center, x);
      center = retract(center, Tangent<X>(shift / static_cast<ScalarOf<X>>(members.size())));
    }
    return center;
  }
  /// Mean and unbiased covariance of at least two members.
  [[nodiscard]] Gaussian<X> gaussian() const {
    CAIRN_EXPECTS(members.size() > 1, "the covariance of an ensemble needs at least two members");
    const X center = mean();
    CovarianceOf<X> sum = CovarianceOf<X>::Zero(dof_of(center), dof_of(center));
    for (const X& x : members) {
      const Tangent<X> d = local(center, x);
      sum += d * d.transpose();
    }
    return {center, sum / static_cast<ScalarOf<X>>(members.size() - 1)};
  }
};

/// Ensemble Kalman filter. Options only; takes additive and driven models. Allocates.
struct EnsembleKalman {
  EnsembleForm form = EnsembleForm::square_root;
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double inflation = 1.0;  ///< distances from the mean are multiplied by this before an update; >= 1

  /// Moves every member by dt and a draw of the noise.
  template <class F, class U = detail::ControlOf<F>>
    requires(AnyProcess<F> || detail::explain_process<F>)
  Status predict(Ensemble<typename F::State>& belief, const F& process, double dt, Random& random,
                 const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    using W = typename detail::NoiseOfProcess<F>::type;
    using S = ScalarOf<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    if (belief.size() < 2) return Status::depleted;
    Ensemble<X> next;
    next.members.reserve(belief.size());
    const detail::PlainProcess plain(process, detail::common_size(belief.members), control);
    if (plain.misfit()) return Status::size_mismatch;
    for (const X& x : belief.members) {
      const CovarianceOf<W> q = detail::dense_of(plain.noise(x, dt));
      if (plain.misfit()) return Status::size_mismatch;
      CovarianceOf<W> root = q;
      if (!all_finite(q)) return Status::not_finite;
      if (!detail::checked_root<dof<W>, S>(q, root)) return Status::not_positive_definite;
      next.members.push_back(plain.driven(x, draw<W>(root, random), dt));
      if (plain.misfit()) return Status::size_mismatch;
      if (!detail::finite_state(next.members.back())) return Status::not_finite;
    }
    belief = std::move(next);
    return Status::accepted;
  }

  /// Takes in z, or refuses it and leaves every member; the noise is that at the mean. `random` is drawn from
  /// by the perturbed form alone. O(N m (n + m)).
  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      Ensemble<typename H::State>& belief, const H& sensor, const V& z, Random& random) const {
    using X = typename H::State;
    using Z = typename H::Measurement;
    using S = ScalarOf<X>;
    constexpr int m = dof<Z>;
    const int count = static_cast<int>(belief.size());
    if (count < 2) return refused<m, S>(Status::depleted);
    if (!(gate > 0.0) || !(inflation >= 1.0)) return refused<m, S>(Status::bad_option);
    const detail::PlainSensor plain(sensor, detail::common_size(belief.members), z);
    if (plain.misfit()) return detail::misfitting(plain);
    const X center = belief.mean();
    if (!detail::finite_state(center)) return refused<m, S>(Status::not_finite);
    Matrix<dof<X>, dynamic, S> apart(dof_of(center), count);
    Ensemble<Z> seen;
    for (int i = 0; i < count; ++i) {
      apart.col(i) = static_cast<S>(inflation) * local(center, belief.members[static_cast<std::size_t>(i)]);
      seen.members.push_back(plain.predict(retract(center, Tangent<X>(apart.col(i)))));
    }
    const Matrix<m, m, S> r = detail::dense_of(plain.noise(center));
    if (plain.misfit()) return detail::misfitting(plain);
    const Z expected = seen.mean();
    Matrix<m, dynamic, S> views(dof_of(expected), count);
    for (int i = 0; i < count; ++i) views.col(i) = local(expected, seen.members[static_cast<std::size_t>(i)]);
    const Matrix<m, m, S> spread = product_transposed(views, views) / static_cast<S>(count - 1);
    auto in = detail::fresh_innovation<m, S>(local(expected, plain.z()), symmetrised(spread + r));
    Matrix<m, m, S> root = r;
    if (!all_finite(in.residual) || !all_finite(in.covariance) || !all_finite(r))
      in.status = Status::not_finite;
    else if (!detail::regular_root<m, S>(r, root))
      in.status = Status::not_positive_definite;
    if (in.status != Status::accepted) return in;
    Vector<m, S> residual = in.residual;
    decorrelate<m, S>(root, views, residual);
    in.status = judge<m, S>(in, root, views, residual);
    if (in.status != Status::accepted) return in;
    const Tangent<X> shift = assimilate<dof<X>, m, S>(apart, views, residual, random);
    if (!all_finite(apart) || !all_finite(shift)) {
      in.status = Status::not_finite;
      return in;
    }
    Ensemble<X> next;
    next.members.reserve(belief.size());
    for (int i = 0; i < count; ++i) {
      next.members.push_back(retract(center, Tangent<X>(shift + apart.col(i))));
      if (!detail::finite_state(next.members.back())) {
        in.status = Status::not_finite;
        return in;
      }
    }
    belief = std::move(next);
    return in;
  }

private:
  template <Manifold W>
  static Tangent<W> draw(const CovarianceOf<W>& root, Random& random) {
    Tangent<W> w = Tangent<W>::Zero(root.rows());
    for (int i = 0; i < static_cast<int>(w.size()); ++i) w(i) = static_cast<ScalarOf<W>>(random.normal());
    return root * w;
  }

  template <int M, class S>
  static Innovation<M, S> refused(Status status) {
    Innovation<M, S> in;
    in.status = status;
    return in;
  }

  /// Turns the views and the residual into numbers of unit noise.
  template <int M, class S>
  static void decorrelate(const Matrix<M, M, S>& root, Matrix<M, dynamic, S>& views, Vector<M, S>& residual) {
    for (int i = 0; i < static_cast<int>(residual.size()); ++i) {
      for (int k = 0; k < i; ++k) {
        views.row(i) -= root(i, k) * views.row(k);
        residual(i) -= root(i, k) * residual(k);
      }
      views.row(i) /= root(i, i);
      residual(i) /= root(i, i);
    }
  }

  /// One number of unit noise: its views, their variance with the noise, and how far it is off.
  template <class S>
  struct Number {
    Vector<dynamic, S> view;
    S variance, error;
    S scale;  // of a covariance with the views: to a gain
  };
  /// Takes the numbers one after the other, each given those before it. `change(number)` is how the members
  /// move per gain, once the caller has what it wants of the number.
  template <int M, class S, class Change>
  static void one_by_one(Matrix<M, dynamic, S>& views, Vector<M, S> residual, const Change& change) {
    const S freedoms = static_cast<S>(views.cols() - 1);
    Number<S> number;
    for (int j = 0; j < static_cast<int>(residual.size()); ++j) {
      number.view = views.row(j).transpose();
      number.variance = number.view.squaredNorm() / freedoms + S(1);
      number.scale = S(1) / (number.variance * freedoms);
      number.error = residual(j);
      const Vector<M, S> gain = number.scale * (views * number.view);
      const Vector<dynamic, S> moved = change(j, number);
      residual -= gain * number.error;
      views += gain * moved.transpose();
    }
  }
  /// The square-root form's.
  template <class S>
  [[nodiscard]] static Vector<dynamic, S> shrunk(const Number<S>& number) {
    using std::sqrt;
    return number.view * (S(-1) / (S(1) + S(1) / sqrt(number.variance)));
  }

  /// Leaves in `in` the NIS and the determinant of S, which S as it is written may have lost.
  template <int M, class S>
  Status judge(Innovation<M, S>& in, const Matrix<M, M, S>& root, Matrix<M, dynamic, S> views,
               const Vector<M, S>& residual) const {
    using std::log;
    in.log_determinant = S(0);
    one_by_one<M, S>(views, residual, [&](int j, const Number<S>& number) {
      in.nis += number.error * number.error / number.variance;
      in.log_determinant += log(number.variance) + S(2) * log(root(j, j));
      return shrunk(number);
    });
    if (in.nis != in.nis) return Status::not_finite;
    return in.nis <= static_cast<S>(gate) ? Status::accepted : Status::gated;
  }

  /// Corrects the distances `apart` and returns the correction of the mean.
  template <int N, int M, class S>
  Vector<N, S> assimilate(Matrix<N, dynamic, S>& apart, Matrix<M, dynamic, S>& views,
                          const Vector<M, S>& residual, Random& random) const {
    const int count = static_cast<int>(apart.cols());
    Vector<N, S> shift = Vector<N, S>::Zero(apart.rows());
    one_by_one<M, S>(views, residual, [&](int, const Number<S>& number) {
      Vector<dynamic, S> change(count);
      const Vector<N, S> gain = number.scale * (apart * number.view);
      if (form == EnsembleForm::square_root) {
        change = shrunk(number);
      } else {
        for (int i = 0; i < count; ++i) change(i) = static_cast<S>(random.normal());
        change.array() -= change.mean();
        change -= number.view;
      }
      shift += gain * number.error;
      apart += gain * change.transpose();
      return change;
    });
    return shift;
  }
};

}}  // namespace cairn::CAIRN_ABI
