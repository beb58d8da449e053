// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The unscented filter whose points carry the noise too, for noise that is not simply added (model.hpp).
///
/// predict() and update() draw the points of (x, w) and of (x, v), of L = n + q and n + m numbers. step()
/// does both at once and draws only once: the predicted points, with those of w among them, are extended by
/// the points of v and go on through the sensor, so that what the motion bent out of a Gaussian is not
/// forgotten; L = n + q + m. Points without w there would leave Q out of the gain. (S. Julier, J. Uhlmann,
/// Proc. IEEE 92, 2004; R. van der Merwe, "Sigma-point Kalman filters", thesis, Oregon, 2004, 3.2.) Models of
/// model.hpp, whose noise is additive, are taken as well. On linear models this is the Kalman filter, and
/// with additive noise predict() is that of Unscented with kappa larger by q. Sums are those of
/// unscented_transform.hpp:
///   P_ab = w sum (odd_a odd_b^T + even_a even_b^T) + (beta - alpha^2) m_a m_b^T
#pragma once

#include <cmath>
#include <concepts>
#include <limits>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/filter/unscented_transform.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// Pairs of transformed points by their odd and even parts about the transformed centre, one column a pair.
template <Manifold Y, int K>
struct PointPairs {
  using S = ScalarOf<Y>;
  Y center;
  Matrix<dof<Y>, K, S> odd, even;
  Tangent<Y> shift;  ///< of the mean from the centre

  PointPairs(const Y& y, int pairs)
      : center(y),
        odd(Matrix<dof<Y>, K, S>::Zero(dof_of(y), pairs)),
        even(Matrix<dof<Y>, K, S>::Zero(dof_of(y), pairs)),
        shift(Tangent<Y>::Zero(dof_of(y))) {}

  void set(int column, const Y& up, const Y& down) {
    const Tangent<Y> a = local(center, up);
    const Tangent<Y> b = local(center, down);
    Tangent<Y> odd_part = a, even_part = b;
    for (int i = 0; i < rows(); ++i) {
      odd_part(i) = S(0.5) * (a(i) - b(i));
      even_part(i) = S(0.5) * (a(i) + b(i));
    }
    drop_noise<Y>(center, odd_part, even_part);
    for (int i = 0; i < rows(); ++i) {
      odd(i, column) = odd_part(i);
      even(i, column) = even_part(i);
      shift(i) += even_part(i);
    }
  }
  [[nodiscard]] Y up(int column) const { return point(column, S(1)); }
  [[nodiscard]] Y down(int column) const { return point(column, S(-1)); }
  [[nodiscard]] Y mean() const { return retract(center, shift); }

  /// w (sum of odd odd^T + even even^T of both) + extra shift shift^T: covariance with other pairs that went
  /// through another function. O(rows of one * of the other * columns).
  template <Manifold Z>
  [[nodiscard]] Matrix<dof<Y>, dof<Z>, S> moment(const PointPairs<Z, K>& other, const S& w,
                                                 const S& extra) const {
    Matrix<dof<Y>, dof<Z>, S> sum(rows(), other.rows());
    for (int j = 0; j < other.rows(); ++j)
      for (int i = 0; i < rows(); ++i) {
        S entry(0);
        for (int k = 0; k < static_cast<int>(odd.cols()); ++k)
          entry += odd(i, k) * other.odd(j, k) + even(i, k) * other.even(j, k);
        sum(i, j) = w * entry + extra * (shift(i) * other.shift(j));
      }
    return sum;
  }
  [[nodiscard]] CovarianceOf<Y> covariance(const S& w, const S& extra) const {
    return symmetrised(moment(*this, w, extra));
  }
  [[nodiscard]] int rows() const { return static_cast<int>(shift.size()); }

  /// The roots of covariance() and moment(), as rows of an array from column `first` on: odd / c, even / c
  /// and sqrt(extra) m, see sigma_rows().
  template <class Array>
  void to_rows(Array& array, int first, const S& c, const S& extra) const {
    using std::sqrt;
    const int pairs = static_cast<int>(odd.cols());
    for (int j = 0; j < rows(); ++j) {
      for (int k = 0; k < pairs; ++k) {
        array(k, first + j) = odd(j, k) / c;
        array(pairs + k, first + j) = even(j, k) / c;
      }
      array(2 * pairs, first + j) = shift(j) == S(0) ? S(0) : sqrt(extra) * shift(j);
    }
  }

private:
  [[nodiscard]] Y point(int column, const S& sign) const {
    Tangent<Y> step = shift;
    for (int i = 0; i < rows(); ++i) step(i) = even(i, column) + sign * odd(i, column);
    return retract(center, step);
  }
};

}  // namespace detail

/// Unscented Kalman filter with augmented noise. Options only: may serve any number of beliefs and threads.
struct AugmentedUnscented {
  SigmaPoints points{};                                   ///< n of spread_squared is L, noise included
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: the prior P is multiplied by this at each predict; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0

  /// Moves the belief by one step of dt. Refused: dt < 0, anything not finite, a P or Q that is no
  /// covariance.
  template <class F, class U = detail::ControlOf<F>>
    requires(AnyProcess<F> || detail::explain_process<F>)
  Status predict(Gaussian<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
    using S = ScalarOf<typename F::State>;
    S c(0);
    const int n = detail::common_size(belief.mean, belief.covariance);
    const auto pairs = propagated(belief, detail::PlainProcess(process, n, control), dt, 0, c);
    if (pairs.status != Status::accepted) return pairs.status;
    return keep(belief, pairs.points, c);
  }

  /// Takes in the measurement z, or refuses it and leaves the belief as it was.
  template <class H, class T = typename H::Measurement>
    requires(AnyMeasurement<H> || detail::explain_sensor<H>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      Gaussian<typename H::State>& belief, const H& sensor, const T& z) const {
    using X = typename H::State;
    using S = ScalarOf<X>;
    using V = typename detail::NoiseOfSensor<H>::type;
    constexpr int n = dof<X>;
    constexpr int k = detail::size_sum<n, dof<V>>;
    const int size = detail::common_size(belief.mean, belief.covariance);
    const detail::PlainSensor plain(sensor, size, z);
    if (plain.misfit()) return detail::misfitting(plain);
    CovarianceOf<V> r = detail::dense_of(plain.noise(belief.mean)), root_r = r;
    if (plain.misfit()) return detail::misfitting(plain);
    CovarianceOf<X> root = belief.covariance;
    const int count = size + static_cast<int>(r.rows());
    S c(0);
    Status status = spread(count, c);
    if (status == Status::accepted) status = roots<X, V>(belief.covariance, root, r, root_r);
    if (status != Status::accepted) return refused(plain, belief, status);
    detail::PointPairs<X, k> prior(belief.mean, count);
    for (int i = 0; i < size; ++i) prior.odd.col(i) = c * root.col(i);
    return fuse<k>(belief, prior, size, plain, root_r, c);
  }

  /// One predict and one update with points drawn once. Refused: as either of them; the belief then stays
  /// where it was before the prediction. No point carries stabilising noise: it has to be zero here.
  template <class F, class H, class U = detail::ControlOf<F>, class T = typename H::Measurement>
    requires(AnyProcess<F> || detail::explain_process<F>) &&
            (AnyMeasurement<H> || detail::explain_sensor<H>) &&
            std::same_as<typename F::State, typename H::State>
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> step(
      Gaussian<typename H::State>& belief, const F& process, double dt, const H& sensor, const T& z,
      const U& control = detail::no_control<U>()) const {
    using X = typename H::State;
    using S = ScalarOf<X>;
    using W = typename detail::NoiseOfProcess<F>::type;
    using V = typename detail::NoiseOfSensor<H>::type;
    constexpr int moved = detail::size_sum<dof<X>, dof<W>>;
    constexpr int k = detail::size_sum<moved, dof<V>>;
    const int size = detail::common_size(belief.mean, belief.covariance);
    const detail::PlainSensor plain(sensor, size, z);
    if (plain.misfit()) return detail::misfitting(plain);
    CovarianceOf<V> r = detail::dense_of(plain.noise(belief.mean));
    if (plain.misfit()) return detail::misfitting(plain);
    S c(0);
    const auto predicted =
        propagated(belief, detail::PlainProcess(process, size, control), dt, static_cast<int>(r.rows()), c);
    const int count = static_cast<int>(predicted.points.odd.cols());
    Gaussian<X> next = belief;
    Status status = stabilising_noise == 0.0 ? predicted.status : Status::bad_option;
    if (status == Status::accepted) status = keep(next, predicted.points, c);
    CovarianceOf<V> root_r = r;
    if (status == Status::accepted) {
      const Eigen::Index numbers = r.rows();
      r = detail::dense_of(plain.noise(predicted.points.center));
      if (plain.misfit() || r.rows() != numbers) return detail::misfitting(plain);
      status = noise_root<V>(r, root_r);
    }
    if (status != Status::accepted) return refused(plain, belief, status);
    detail::PointPairs<X, k> prior(predicted.points.center, count + static_cast<int>(r.rows()));
    prior.odd.leftCols(count) = predicted.points.odd;
    prior.even.leftCols(count) = predicted.points.even;
    prior.shift = predicted.points.shift;
    auto innovation = fuse<k>(next, prior, count, plain, root_r, c);
    if (innovation.accepted()) belief = next;
    return innovation;
  }

private:
  template <Manifold X, int K>
  struct Propagated {
    detail::PointPairs<X, K> points;
    Status status;
  };

  template <class S>
  [[nodiscard]] S extra() const {
    return static_cast<S>(points.beta - points.alpha * points.alpha);
  }

  /// c for `count` numbers: never so near that the points drown in rounding (unscented_transform.hpp).
  template <class S>
  Status spread(int count, S& c) const {
    using std::sqrt;
    const double squared = points.spread_squared(count);
    if (!(squared > 0.0) || !(fading >= 1.0) || !(stabilising_noise >= 0.0)) return Status::bad_option;
    const S nearest = sqrt(sqrt(std::numeric_limits<S>::epsilon()));
    const S wanted = sqrt(static_cast<S>(squared));
    c = wanted > nearest ? wanted : nearest;
    return Status::accepted;
  }

  /// Roots of the covariances of the state and of the noise.
  template <Manifold X, Manifold V>
  static Status roots(const CovarianceOf<X>& p, CovarianceOf<X>& root_p, const CovarianceOf<V>& r,
                      CovarianceOf<V>& root_r) {
    if (!all_finite(p)) return Status::not_finite;
    if (!detail::checked_root<dof<X>, ScalarOf<X>>(p, root_p)) return Status::not_positive_definite;
    return noise_root<V>(r, root_r);
  }
  template <Manifold V>
  static Status noise_root(const CovarianceOf<V>& r, CovarianceOf<V>& root) {
    if (!all_finite(r)) return Status::not_finite;
    const CovarianceOf<V> symmetric = symmetrised(r);
    return detail::checked_root<dof<V>, ScalarOf<V>>(symmetric, root) ? Status::accepted
                                                                      : Status::not_positive_definite;
  }

  /// The points of (x, w) after the motion; `further` numbers of noise are still to come.
  template <class F, class U>
  auto propagated(const Gaussian<typename F::State>& belief, const detail::PlainProcess<F, U>& process,
                  double dt, int further, ScalarOf<typename F::State>& c) const {
    using X = typename F::State;
    using S = ScalarOf<X>;
    using W = typename detail::NoiseOfProcess<F>::type;
    constexpr int k = detail::size_sum<dof<X>, dof<W>>;
    const int n = dof_of(belief.mean);
    const CovarianceOf<W> q = detail::dense_of(process.noise(belief.mean, dt));
    if (process.misfit()) return Propagated<X, k>{{belief.mean, k == dynamic ? 0 : k}, Status::size_mismatch};
    const int count = n + static_cast<int>(q.rows());
    Tangent<W> w = Tangent<W>::Zero(q.rows());
    Propagated<X, k> out{{process.driven(belief.mean, w, dt), count}, Status::accepted};
    CovarianceOf<X> root = belief.covariance;
    CovarianceOf<W> root_q = q;
    out.status = spread(count + further, c);
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) out.status = Status::bad_time_step;
    if (process.misfit()) out.status = Status::size_mismatch;
    if (out.status == Status::accepted) out.status = roots<X, W>(belief.covariance, root, q, root_q);
    if (out.status != Status::accepted) return out;
    using std::sqrt;
    const S wider = c * sqrt(static_cast<S>(fading));
    for (int i = 0; i < n; ++i) {
      const Tangent<X> d = wider * root.col(i);
      out.points.set(i, process.driven(retract(belief.mean, d), w, dt),
                     process.driven(retract(belief.mean, Tangent<X>(-d)), w, dt));
    }
    for (int i = n; i < count; ++i) {
      w = c * root_q.col(i - n);
      const X up = process.driven(belief.mean, w, dt);
      w = -w;
      out.points.set(i, up, process.driven(belief.mean, w, dt));
    }
    if (process.misfit()) out.status = Status::size_mismatch;
    out.points.shift /= c * c;
    return out;
  }

  /// Mean and covariance of the points, kept if they are sound.
  template <Manifold X, int K>
  Status keep(Gaussian<X>& belief, const detail::PointPairs<X, K>& pairs, const ScalarOf<X>& c) const {
    using S = ScalarOf<X>;
    CovarianceOf<X> covariance = pairs.covariance(S(1) / (c * c), extra<S>());
    for (int i = 0; i < static_cast<int>(covariance.rows()); ++i)
      covariance(i, i) += static_cast<S>(stabilising_noise);
    const X mean = pairs.mean();
    if (!all_finite(covariance) || !detail::finite_state(mean)) return Status::not_finite;
    if (!detail::is_valid_covariance<dof<X>, S>(covariance)) return Status::not_positive_definite;
    belief.mean = mean;
    belief.covariance = covariance;
    return Status::accepted;
  }

  /// The first `count` pairs of `prior` and the noise's own through the sensor, and the update.
  template <int K, class H, class T>
  auto fuse(Gaussian<typename H::State>& belief, const detail::PointPairs<typename H::State, K>& prior,
            int count, const detail::PlainSensor<H, T>& sensor,
            const CovarianceOf<typename detail::NoiseOfSensor<H>::type>& root_r,
            const ScalarOf<typename H::State>& c) const {
    using X = typename H::State;
    using Z = typename H::Measurement;
    using S = ScalarOf<X>;
    using V = typename detail::NoiseOfSensor<H>::type;
    Tangent<V> v = Tangent<V>::Zero(root_r.rows());
    const int all = count + static_cast<int>(root_r.rows());
    detail::PointPairs<Z, K> seen(sensor.driven(prior.center, v), all);
    for (int i = 0; i < count; ++i)
      seen.set(i, sensor.driven(prior.up(i), v), sensor.driven(prior.down(i), v));
    for (int i = count; i < all; ++i) {
      v = c * root_r.col(i - count);
      const Z up = sensor.driven(prior.center, v);
      v = -v;
      seen.set(i, up, sensor.driven(prior.center, v));
    }
    if (sensor.misfit()) return detail::misfitting(sensor);
    constexpr int n = dof<X>, m = dof<Z>;
    const S w = S(1) / (c * c);
    seen.shift *= w;
    auto in = detail::fresh_innovation<m, S>(local(seen.mean(), sensor.z()), seen.covariance(w, extra<S>()));
    const Matrix<n, m, S> cross = prior.moment(seen, w, extra<S>());
    const S digits = detail::digits_of_points(belief.mean, belief.covariance, seen.center, in.covariance);
    const auto by_array = [&](detail::ArrayUpdate<n, m, S>& update) {
      constexpr int rows = K == dynamic ? dynamic : 2 * K + 1;
      constexpr int size = detail::size_sum<m, n>;
      Matrix<rows, size, S> array = Matrix<rows, size, S>::Zero(2 * all + 1, seen.rows() + prior.rows());
      seen.to_rows(array, 0, c, extra<S>());
      prior.to_rows(array, seen.rows(), c, extra<S>());
      if (!all_finite(array)) return Status::not_positive_definite;
      Matrix<rows, size, S> by_state = array;  // the state's columns first: [L^T, (H L)^T; 0, *]
      const int ns = prior.rows(), ms = seen.rows();
      for (int k = 0; k <= 2 * all; ++k) {
        for (int j = 0; j < ns; ++j) by_state(k, j) = array(k, ms + j);
        for (int j = 0; j < ms; ++j) by_state(k, ns + j) = array(k, j);
      }
      Matrix<m, m, S> in_z = Matrix<m, m, S>::Zero(ms, ms);  // variances that the sensor's noise makes
      for (int j = 0; j < ms; ++j)
        for (int k = count; k < all; ++k)
          in_z(j, j) += array(k, j) * array(k, j) + array(all + k, j) * array(all + k, j);
      detail::triangularise(detail::view(by_state));
      const CovarianceOf<X> root = detail::lower_part<CovarianceOf<X>>(by_state, 0, ns);
      const Matrix<m, n, S> slope = detail::mean_slope<m, n, S>(by_state, root, ms, ns);
      update = detail::update_by_array<n, m, S, detail::Wanted::rarely>(array, in.residual, ns);
      const bool good = update.regular && detail::determined<n, m, S, detail::Wanted::rarely>(
                                              update, root, slope, in_z, detail::KeptAs::covariance, digits);
      return good ? Status::accepted : Status::not_positive_definite;
    };
    detail::correct_by_moments<X, m, S>(belief, cross, in, gate, digits, by_array);
    return in;
  }

  template <class H, class T>
  static auto refused(const detail::PlainSensor<H, T>& sensor, const Gaussian<typename H::State>& belief,
                      Status status) {
    using Z = typename H::Measurement;
    using V = typename detail::NoiseOfSensor<H>::type;
    auto innovation = detail::misfitting(sensor);
    innovation.status = status;
    if (status == Status::size_mismatch) return innovation;
    const Tangent<V> none = Tangent<V>::Zero(sensor.noise(belief.mean).rows());
    const Z seen = sensor.driven(belief.mean, none);
    if (!sensor.misfit()) innovation.residual = local(seen, sensor.z());
    return innovation;
  }
};

}}  // namespace cairn::CAIRN_ABI
