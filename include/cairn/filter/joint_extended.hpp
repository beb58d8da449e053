// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The extended Kalman filter on a state that grows (joint_gaussian.hpp): steps that name the blocks they are
/// about.
///
/// Any sensor of model.hpp will do whose State is the Product of the blocks that will be named, or the one
/// block; numeric() and automatic() of differentiate.hpp give its Jacobian as well:
/// ```cpp
/// struct LandmarkSighting {
///   using State = cairn::Product<cairn::SE2, cairn::Vector<2>>;  // x.part<0>(): pose, x.part<1>(): landmark
///   using Measurement = cairn::Product<cairn::Vector<1>, cairn::SO2>;
///   Measurement predict(const State& x) const;
///   cairn::Matrix<2, 5> jacobian(const State& x) const;  // columns of the pose, then of the landmark
///   cairn::Matrix<2> noise(const State& x) const;
///   cairn::Vector<2> initialise(const cairn::SE2& pose, const Measurement& z) const;  // for inverted()
/// };
/// ```
/// ```cpp
/// const cairn::JointExtended filter{.gate = cairn::chi_square_quantile(0.999, 2)};
/// const auto moved = filter.predict(belief, cairn::Unicycle{}, dt, control, robot);     // the others stay
/// const double distance = filter.innovation(belief, sighting, z, robot, landmark).nis;  // to associate by
/// const auto seen = filter.update(belief, sighting, z, robot, landmark);                // all blocks learn
/// ```
///
/// With H zero but for the d columns of the named blocks, n numbers of all steps and m of the measurement:
///   W = P H^T S^-T/2: O(n d m);   P <- P - W W^T: one pass over the lower triangle, n^2 m / 2
///   multiplications
/// against the dense filter's O(n^3). Considered blocks (JointGaussian::consider) get no gain: Schmidt's
/// filter.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/joint_covariance.hpp>
#include <cairn/filter/detail/plain_matrix.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/joint_gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/derivatives.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// The models that JointExtended takes, or the sentence: for its functions, not for asking.
template <class F>
concept JointProcess = LinearisedProcess<F> || explain_process<F> || explain_jacobian<F, ProcessModel<F>>;
template <class H>
concept JointSensor =
    LinearisedMeasurement<H> || explain_sensor<H> || explain_jacobian<H, MeasurementModel<H>>;
/// The same of blocks behind a control. Without a control the first block may stand where it would: there
/// the other predict() has the word.
template <class F, class... X>
concept NamesAllBehindControl =
    SpeaksOf<typename F::State, X...> ||
    (!std::same_as<typename F::Control, NoControl> && explain_blocks<typename F::State, X...>);

}  // namespace detail

/// Several measurements of one moment, linearised one by one, to be taken in at once: one pass over the
/// covariance in place of one each. Kept in units of their noise. Also the way to a measurement of blocks
/// whose number is known only at run time. Linearised at the means as they are: apply it before they change.
template <class S = double>
class StackedMeasurement {
public:
  /// Numbers measured so far.
  [[nodiscard]] int rows() const noexcept { return static_cast<int>(residual_.size()); }
  [[nodiscard]] bool empty() const noexcept { return residual_.empty(); }
  void clear() noexcept {
    residual_.clear();
    numbers_.clear();
    terms_.clear();
  }

  /// One more measurement of named blocks. Refused, and the stack left: an unknown block, what is not finite,
  /// a noise that is not positive definite.
  template <LinearisedMeasurement H, class... Kinds, class... X>
    requires detail::NamesAll<typename H::State, X...>
  Status add(const JointGaussian<Kinds...>& belief, const H& sensor, const typename H::Measurement& z,
             BlockId<X>... ids);

  /// The Jacobian by one block, of as many rows as the residual has numbers.
  struct Term {
    AnyBlockId block;
    Matrix<dynamic, dynamic, S> jacobian;
  };
  /// A measurement that is linearised already: residual = sum over terms of jacobian * step + noise.
  template <class... Kinds>
  Status add(const JointGaussian<Kinds...>& belief, const Vector<dynamic, S>& residual,
             const Matrix<dynamic, dynamic, S>& noise, std::span<const Term> terms);

private:
  friend struct JointExtended;

  struct Piece {
    AnyBlockId block;
    int count;  // of the block's numbers
    int first, rows;
    std::size_t begin;  // of the Jacobian in numbers_, column-major
  };

  std::vector<S> residual_, numbers_;
  std::vector<Piece> terms_;
};

/// Extended Kalman filter on a state that grows. Options only: may serve any number of beliefs and threads. A
/// step that is refused has left the belief as it was, bit for bit. A block may be named twice by a sensor,
/// not by a process. No step but of a stack or of run-time sizes allocates, once the belief has been used at
/// its size.
struct JointExtended {
  /// standard: P - W W^T, and Joseph's form of the named blocks' rows where digits are lost; joseph: always
  /// those. There is no sequential form here.
  Form form = Form::standard;
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  /// Fading memory: F P F^T of the blocks that move is multiplied by this each step, their covariances with
  /// others by its root; >= 1
  double fading = 1.0;
  double stabilising_noise = 0.0;  ///< variance added to every number of what moves at each predict; >= 0
  int iterations = 1;              ///< of the update, at most; 1 is the plain filter
  double tolerance = 1e-10;        ///< iterations end when the step changes by less, in the new deviations
  double settled = 1e-3;           ///< refused as not_converged where they end with a larger change

  /// Moves the named blocks, which together are the process's State, by one step of dt. Their correlations
  /// with all others are carried along; the others stay. O(n d^2).
  template <detail::JointProcess F, class... Kinds, class... X>
    requires detail::NamesAllBehindControl<F, X...>
  Status predict(JointGaussian<Kinds...>& belief, const F& process, double dt,
                 const typename F::Control& control, BlockId<X>... ids) const;
  template <detail::JointProcess F, class... Kinds, class... X>
    requires(std::same_as<typename F::Control, NoControl> && detail::NamesAll<typename F::State, X...>)
  Status predict(JointGaussian<Kinds...>& belief, const F& process, double dt, BlockId<X>... ids) const {
    return predict(belief, process, dt, NoControl{}, ids...);
  }

  /// Takes in the measurement z of the named blocks, which together are the sensor's State, or refuses it.
  /// The innovation is the one before the update, whatever the iterations. O(n^2 m).
  template <detail::JointSensor H, class... Kinds, class... X>
    requires detail::NamesAll<typename H::State, X...>
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      JointGaussian<Kinds...>& belief, const H& sensor, const typename H::Measurement& z,
      BlockId<X>... ids) const;

  /// What update() would say of it, but for what only updating shows: digits that are lost, iterations that
  /// do not converge. Nothing is changed. O(d^2 + m^3), whatever the number of blocks.
  template <detail::JointSensor H, class... Kinds, class... X>
    requires detail::NamesAll<typename H::State, X...>
  [[nodiscard]] Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> innovation(
      const JointGaussian<Kinds...>& belief, const H& sensor, const typename H::Measurement& z,
      BlockId<X>... ids) const;

  /// Takes in all measurements of a stack at once, or none. Residual and covariance of the innovation are in
  /// units of the noise. iterations has to be 1. O(n^2 m) for m numbers in all.
  template <class... Kinds>
  Innovation<dynamic, typename JointGaussian<Kinds...>::Scalar> update(
      JointGaussian<Kinds...>& belief,
      const StackedMeasurement<typename JointGaussian<Kinds...>::Scalar>& stack) const;

private:
  template <int M, class S>
  [[nodiscard]] Status verdict(Innovation<M, S>& in, const Cholesky<M, S>& root, Vector<M, S>& y) const;
  template <int M, class S>
  [[nodiscard]] bool lowers(detail::JointCovariance<S>& core, std::span<const detail::JacobianPart<S>> parts,
                            const Cholesky<M, S>& root, const Matrix<M, M, S>& r) const;
  template <LinearisedMeasurement H, class... Kinds, class... X>
  [[nodiscard]] Status iterated(JointGaussian<Kinds...>& belief, const H& sensor, const typename H::State& x,
                                const typename H::Measurement& z, BlockId<X>... ids) const;
};

/// The inverse model of a sensor whose State is Product<Known..., New> and whose initialise(x, z) says where
/// the new block must be, x the known block, or the Product<Known...> of several. One Gauss-Newton step of
/// the new block follows, which matters where z has more numbers than it. With H = [H_k H_n] and N = H_n^T
/// R^-1 H_n: jacobian -N^-1 H_n^T R^-1 H_k, noise N^-1. That is an update with a new block of infinite
/// variance, but for what z says beyond the block, which is dropped: nothing, where the sensor sees the block
/// relative to the known ones. Where z does not determine the block the noise is NaN, and refused.
template <detail::JointSensor H>
struct Inverted;
template <detail::JointSensor H>
[[nodiscard]] Inverted<H> inverted(const H& sensor) {
  return {sensor};
}

namespace detail {

/// Product<Known..., New> taken apart.
template <class State>
struct LastPart;
template <class... Parts>
struct LastPart<Product<Parts...>> {
  static_assert(sizeof...(Parts) >= 2, "an inverse model needs known blocks and a new one");
  static constexpr std::size_t last = sizeof...(Parts) - 1;
  using New = std::tuple_element_t<last, std::tuple<Parts...>>;
  template <std::size_t... I>
  static StateOfBlocks<std::tuple_element_t<I, std::tuple<Parts...>>...> known_of(std::index_sequence<I...>);
  using Known = typename decltype(known_of(std::make_index_sequence<last>{}))::type;

  static Product<Parts...> join(const Known& known, const New& added) {
    Product<Parts...> x;
    if constexpr (last == 1)
      x.template part<0>() = known;
    else
      [&]<std::size_t... I>(std::index_sequence<I...>) {
        ((x.template part<I>() = known.template part<I>()), ...);
      }(std::make_index_sequence<last>{});
    x.template part<last>() = added;
    return x;
  }
};

/// A sensor's answers at a state, as plain numbers.
template <class H>
struct LinearisedAt {
  using State = typename H::State;
  using S = ScalarOf<State>;
  static constexpr int m = dof<typename H::Measurement>;
  static constexpr int n = dof<State>;
  Vector<m, S> residual;
  Matrix<m, n, S> jacobian;
  Matrix<m, m, S> noise;

  [[nodiscard]] bool fill(const H& sensor, const State& x, const typename H::Measurement& z) {
    typename H::Measurement seen = z;
    if (!to_state(sensor.predict(x), seen)) return false;
    if constexpr (m == dynamic)
      if (dof_of(seen) != dof_of(z)) return false;
    residual = local(seen, z);
    return to_plain<m, n, S>(sensor.jacobian(x), residual.size(), n, jacobian) &&
           to_plain<m, m, S>(sensor.noise(x), residual.size(), residual.size(), noise);
  }
};

/// A sensor seen from the prior: its answers at prior (+) step, the jacobian by the step from the prior.
/// False where sizes do not fit. Of run-time size, so that what iterates is compiled once.
template <class S>
struct SensorFromPrior {
  Vector<dynamic, S> residual;
  Matrix<dynamic, dynamic, S> jacobian, noise;
  const void* context = nullptr;  // of the function
  bool (*linearise)(SensorFromPrior& at, const Vector<dynamic, S>& step, bool with_jacobian) = nullptr;
};

/// The square of a step p c in deviations after the update, c^T p c + |j p c|^2 by the noise's covariance r.
/// A noise that is singular is taken for what rounding leaves of hph, what the state adds to it.
template <class S>
[[nodiscard]] S squared_deviations(const Vector<dynamic, S>& c, const Vector<dynamic, S>& step,
                                   const Vector<dynamic, S>& seen, const Matrix<dynamic, dynamic, S>& r,
                                   const Matrix<dynamic, dynamic, S>& hph) {
  S sum(0);
  for (int i = 0; i < static_cast<int>(c.size()); ++i) sum += c(i) * step(i);
  Cholesky<dynamic, S> root(r);
  if (!root.good()) {
    Matrix<dynamic, dynamic, S> least = r;
    for (int i = 0; i < static_cast<int>(r.rows()); ++i)
      least(i, i) += S(64) * std::numeric_limits<S>::epsilon() * (hph(i, i) + r(i, i));
    root = Cholesky<dynamic, S>(least);
  }
  return root.good() ? sum + root.whiten(seen).squaredNorm() : std::numeric_limits<S>::infinity();
}

/// Gauss-Newton on the posterior of the named blocks alone, p being their covariance: the mode of all blocks
/// is that of the named ones and what the others expect given those. The step is p y, so that p may be
/// singular; extended.hpp says the rest. Leaves in `at` the last linearisation.
template <class S>
[[nodiscard]] Status iterate(SensorFromPrior<S>& at, const Matrix<dynamic, dynamic, S>& p, int iterations,
                             double tolerance, double settled, Vector<dynamic, S>& y) {
  using Column = Vector<dynamic, S>;
  const int n = static_cast<int>(p.rows());
  const auto times = [n](const Matrix<dynamic, dynamic, S>& a, const Column& x) {
    Column result = Column::Zero(a.rows());
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < static_cast<int>(a.rows()); ++i) result(i) += a(i, j) * x(j);
    return result;
  };
  const auto dot = [n](const Column& a, const Column& b) {
    S sum(0);
    for (int i = 0; i < n; ++i) sum += a(i) * b(i);
    return sum;
  };
  const auto cost_at = [&](const Column& dual, const Column& step, S& cost) {
    if (!at.linearise(at, step, false)) return false;
    cost = dot(dual, step) + squared_mahalanobis<dynamic, S>(at.residual, at.noise);
    return true;
  };
  y = Column::Zero(n);
  Column e = Column::Zero(n);
  S cost(0), size(0);  // size of the last change
  SensorFromPrior<S> last = at;
  if (!cost_at(y, e, cost)) return Status::size_mismatch;
  for (int k = 0; k < iterations; ++k) {
    if (!at.linearise(at, e, true)) return Status::size_mismatch;
    const int m = static_cast<int>(at.residual.size());
    if (const Status status = check_noise<dynamic, S>(at.noise); status != Status::accepted) return status;
    at.residual += times(at.jacobian, e);
    if (!all_finite(at.residual) || !all_finite(at.jacobian)) return Status::not_finite;
    last = at;
    Matrix<dynamic, dynamic, S> hph = Matrix<dynamic, dynamic, S>::Zero(m, m), hp(m, n);
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < m; ++i) {
        S sum(0);
        for (int l = 0; l < n; ++l) sum += at.jacobian(i, l) * p(l, j);
        hp(i, j) = sum;
      }
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < m; ++i)
        for (int l = 0; l < n; ++l) hph(i, j) += hp(i, l) * at.jacobian(j, l);
    const Cholesky<dynamic, S> root(symmetrised(at.noise + hph));
    if (!root.good()) return Status::not_positive_definite;
    const Column weighted = root.solve(at.residual);
    Column change(n);
    for (int j = 0; j < n; ++j) {
      change(j) = -y(j);
      for (int i = 0; i < m; ++i) change(j) += at.jacobian(i, j) * weighted(i);
    }
    size = std::sqrt(squared_deviations<S>(change, times(p, change), times(hp, change), at.noise, hph));
    S lower(0);
    Column next, step;
    for (int halving = 0; halving <= 10; ++halving) {
      next = y + change;
      step = times(p, next);
      if (!cost_at(next, step, lower)) return Status::size_mismatch;
      if (lower <= cost) break;
      change *= S(0.5);
    }
    if (!(lower <= cost)) break;  // no descent left above rounding
    y = next;
    e = step;
    cost = lower;
    if (size <= static_cast<S>(tolerance)) break;
  }
  at = last;
  if (!all_finite(e)) return Status::not_finite;
  return size <= static_cast<S>(settled) ? Status::accepted : Status::not_converged;
}

/// A jacobian by steps from x (+) e, block by block made one by steps from x.
template <class... X, class S, class State>
void carry_columns(Matrix<dynamic, dynamic, S>& jacobian, const State& x, const Tangent<State>& e) {
  const auto carry = [&]<class B>(const B& block, int first) {
    if constexpr (!is_vector<B>) {
      constexpr int d = dof<B>;
      Tangent<B> step;
      for (int k = 0; k < d; ++k) step(k) = e(first + k);
      const CovarianceOf<B> by = carried(block, step);
      for (int i = 0; i < static_cast<int>(jacobian.rows()); ++i) {
        S row[d];
        for (int k = 0; k < d; ++k) row[k] = jacobian(i, first + k);
        for (int k = 0; k < d; ++k) {
          jacobian(i, first + k) = S(0);
          for (int l = 0; l < d; ++l) jacobian(i, first + k) += row[l] * by(l, k);
        }
      }
    }
  };
  if constexpr (sizeof...(X) == 1)
    carry(x, 0);
  else
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      (carry(x.template part<I>(), block_offsets<X...>[I]), ...);
    }(std::index_sequence_for<X...>{});
}

}  // namespace detail

template <detail::JointSensor H>
struct Inverted {
  using Parts = detail::LastPart<typename H::State>;
  using State = typename Parts::Known;
  using New = typename Parts::New;
  using Measurement = typename H::Measurement;
  using S = ScalarOf<State>;

  H sensor;

  [[nodiscard]] New initialise(const State& x, const Measurement& z) const {
    const New first = sensor.initialise(x, z);
    const Weighted w = weigh(x, first, z);
    const Tangent<New> step = w.root.solve(transposed_product(w.by_new, w.residual));
    return retract(first, step);
  }
  [[nodiscard]] Matrix<dof<New>, dof<State>, S> jacobian(const State& x, const Measurement& z) const {
    const Weighted w = weigh(x, initialise(x, z), z);
    return -w.root.solve(transposed_product(w.by_new, w.by_known));
  }
  [[nodiscard]] CovarianceOf<New> noise(const State& x, const Measurement& z) const {
    return weigh(x, initialise(x, z), z).root.inverse();
  }

private:
  static constexpr int m = dof<Measurement>;
  static constexpr int known = dof<State>;
  static constexpr int added = dof<New>;
  /// In units of the noise.
  struct Weighted {
    Vector<m, S> residual;
    Matrix<m, known, S> by_known;
    Matrix<m, added, S> by_new;
    Cholesky<added, S> root;  // of N
  };
  [[nodiscard]] Weighted weigh(const State& x, const New& value, const Measurement& z) const {
    detail::LinearisedAt<H> at;
    const bool fits = at.fill(sensor, Parts::join(x, value), z);
    const int rows = static_cast<int>(at.residual.size());
    Matrix<m, known, S> by_known(rows, known);
    Matrix<m, added, S> by_new(rows, added);
    for (int i = 0; fits && i < rows; ++i) {
      for (int j = 0; j < known; ++j) by_known(i, j) = at.jacobian(i, j);
      for (int j = 0; j < added; ++j) by_new(i, j) = at.jacobian(i, known + j);
    }
    if (!fits) {
      const S nan = std::numeric_limits<S>::quiet_NaN();
      by_known.setConstant(nan);
      by_new.setConstant(nan);
      return {at.residual, by_known, by_new, Cholesky<added, S>(transposed_product(by_new, by_new))};
    }
    const Cholesky<m, S> root(at.noise);
    by_new = root.whiten(by_new);
    return {root.whiten(at.residual), root.whiten(by_known), by_new,
            Cholesky<added, S>(transposed_product(by_new, by_new))};
  }
};

template <int M, class S>
Status JointExtended::verdict(Innovation<M, S>& in, const Cholesky<M, S>& root, Vector<M, S>& y) const {
  if (!(gate > 0.0) || iterations < 1 || !(tolerance >= 0.0) || !(settled >= 0.0) || form == Form::sequential)
    return Status::bad_option;
  if (!all_finite(in.residual) || !all_finite(in.covariance)) return Status::not_finite;
  if (!root.good()) return Status::not_positive_definite;
  y = root.whiten(in.residual);
  in.nis = y.squaredNorm();
  if (in.nis > static_cast<S>(gate)) return Status::gated;
  return detail::finite(in.nis) ? Status::accepted : Status::not_finite;
}

template <int M, class S>
bool JointExtended::lowers(detail::JointCovariance<S>& core, std::span<const detail::JacobianPart<S>> parts,
                           const Cholesky<M, S>& root, const Matrix<M, M, S>& r) const {
  core.whiten(root.lower().data());
  return (form == Form::standard && core.sound()) || core.stabilise(parts, root.lower().data(), r.data());
}

template <detail::JointProcess F, class... Kinds, class... X>
  requires detail::NamesAllBehindControl<F, X...>
Status JointExtended::predict(JointGaussian<Kinds...>& belief, const F& process, double dt,
                              const typename F::Control& control, BlockId<X>... ids) const {
  using State = typename F::State;
  using S = ScalarOf<State>;
  using Named = detail::StateOfBlocks<X...>;
  constexpr int n = dof<State>;
  if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
  if (!(fading >= 1.0) || !(stabilising_noise >= 0.0)) return Status::bad_option;
  const std::array<AnyBlockId, sizeof...(X)> named{ids...};
  for (std::size_t i = 0; i < named.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      if (named[i] == named[k]) return Status::unknown_block;
  if (!(belief.has(ids) && ...)) return Status::unknown_block;

  const State x = Named::of(belief.mean(ids)...);
  State moved = x;
  Matrix<n, n, S> f, q;
  if (!detail::to_state(process.propagate(x, control, dt), moved) ||
      !detail::to_plain<n, n, S>(process.jacobian(x, control, dt), n, n, f) ||
      !detail::to_plain<n, n, S>(process.noise(x, control, dt), n, n, q))
    return Status::size_mismatch;
  for (int i = 0; i < n; ++i) q(i, i) += static_cast<S>(stabilising_noise);
  if (!detail::finite_state(moved) || !all_finite(f)) return Status::not_finite;
  if (const Status status = detail::check_noise<n, S>(q); status != Status::accepted) return status;
  if (fading != 1.0) f *= static_cast<S>(std::sqrt(fading));
  const std::array<detail::RowRange, sizeof...(X)> ranges{belief.range(*belief.find(ids))...};
  if (!belief.core_.transform(ranges, f.data(), q.data())) return belief.not_extended();
  belief.core_.write_transformed();
  if constexpr (sizeof...(X) == 1)
    (belief.set_mean(ids, moved), ...);
  else
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      (belief.set_mean(ids, moved.template part<I>()), ...);
    }(std::index_sequence_for<X...>{});
  return Status::accepted;
}

template <detail::JointSensor H, class... Kinds, class... X>
  requires detail::NamesAll<typename H::State, X...>
Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> JointExtended::innovation(
    const JointGaussian<Kinds...>& belief, const H& sensor, const typename H::Measurement& z,
    BlockId<X>... ids) const {
  using S = ScalarOf<typename H::State>;
  constexpr int m = dof<typename H::Measurement>;
  Innovation<m, S> in;
  if (!(belief.has(ids) && ...)) {
    in.status = Status::unknown_block;
    return in;
  }
  detail::LinearisedAt<H> at;
  if (!at.fill(sensor, detail::StateOfBlocks<X...>::of(belief.mean(ids)...), z)) {
    in.status = Status::size_mismatch;
    return in;
  }
  in.residual = at.residual;
  in.covariance = at.noise;
  const int rows = static_cast<int>(at.residual.size());
  const auto parts = belief.template parts<m, X...>(at.jacobian, ids...);
  belief.core_.predicted(parts, rows, in.covariance.data());
  in.covariance += at.noise;
  in.status = detail::check_noise<m, S>(at.noise);
  Vector<m, S> y = at.residual;
  if (in.accepted()) in.status = verdict<m, S>(in, Cholesky<m, S>(in.covariance), y);
  return in;
}

template <detail::JointSensor H, class... Kinds, class... X>
  requires detail::NamesAll<typename H::State, X...>
Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> JointExtended::update(
    JointGaussian<Kinds...>& belief, const H& sensor, const typename H::Measurement& z,
    BlockId<X>... ids) const {
  using State = typename H::State;
  using S = ScalarOf<State>;
  constexpr int m = dof<typename H::Measurement>;
  Innovation<m, S> in;
  if (!(belief.has(ids) && ...)) {
    in.status = Status::unknown_block;
    return in;
  }
  const State x = detail::StateOfBlocks<X...>::of(belief.mean(ids)...);
  detail::LinearisedAt<H> at;
  if (!at.fill(sensor, x, z)) {
    in.status = Status::size_mismatch;
    return in;
  }
  const int rows = static_cast<int>(at.residual.size());
  const auto parts = belief.template parts<m, X...>(at.jacobian, ids...);
  detail::JointCovariance<S>& core = belief.core_;
  in.residual = at.residual;
  in.covariance = at.noise;
  in.status = detail::check_noise<m, S>(at.noise);
  if (!in.accepted()) return in;
  core.measure(parts, rows, in.covariance.data());
  in.covariance += at.noise;
  Vector<m, S> y = at.residual;
  const Cholesky<m, S> root(in.covariance);
  in.status = verdict<m, S>(in, root, y);
  if (!in.accepted()) return in;
  if (iterations == 1) [[likely]] {
    if (!lowers<m, S>(core, parts, root, at.noise)) {
      in.status = Status::not_positive_definite;
      return in;
    }
    core.step_by_whitened(y.data());
    if (!core.may_step()) {
      in.status = Status::not_finite;
      return in;
    }
    core.lower();
    belief.move(core.step());
    return in;
  }
  in.status = iterated(belief, sensor, x, z, ids...);
  return in;
}

/// update() with the last linearisation of the named blocks' own iteration, the first having passed the gate.
template <LinearisedMeasurement H, class... Kinds, class... X>
Status JointExtended::iterated(JointGaussian<Kinds...>& belief, const H& sensor, const typename H::State& x,
                               const typename H::Measurement& z, BlockId<X>... ids) const {
  using State = typename H::State;
  using S = ScalarOf<State>;
  constexpr int n = dof<State>;
  struct Context {
    const H& sensor;
    const typename H::Measurement& z;
    const State& prior;
  } context{sensor, z, x};
  detail::SensorFromPrior<S> mode;
  mode.context = &context;
  mode.linearise = [](detail::SensorFromPrior<S>& from, const Vector<dynamic, S>& step, bool with_jacobian) {
    const Context& given = *static_cast<const Context*>(from.context);
    Tangent<State> e;
    for (int i = 0; i < n; ++i) e(i) = step(i);
    detail::LinearisedAt<H> there;
    if (!there.fill(given.sensor, retract(given.prior, e), given.z)) return false;
    from.residual = there.residual;
    from.noise = there.noise;
    if (!with_jacobian) return true;
    from.jacobian = there.jacobian;
    detail::carry_columns<X...>(from.jacobian, given.prior, e);
    return true;
  };
  Vector<dynamic, S> dual;
  const std::array<detail::RowRange, sizeof...(X)> ranges{belief.range(*belief.find(ids))...};
  Matrix<dynamic, dynamic, S> p(n, n);
  detail::JointCovariance<S>& core = belief.core_;
  core.read(ranges, ranges, p.data());
  const Status found = detail::iterate<S>(mode, p, iterations, tolerance, settled, dual);
  if (found != Status::accepted) return found;
  Matrix<dynamic, dynamic, S> covariance = mode.noise;
  const auto last = belief.template parts<dynamic, X...>(mode.jacobian, ids...);
  core.measure(last, static_cast<int>(mode.residual.size()), covariance.data());
  covariance += mode.noise;
  const Cholesky<dynamic, S> root(covariance);
  if (!root.good() || !lowers<dynamic, S>(core, last, root, mode.noise)) return Status::not_positive_definite;
  core.step_by_dual(last, dual.data());
  if (!core.may_step()) return Status::not_finite;
  core.lower();
  belief.move_and_carry(core.step());
  return Status::accepted;
}

template <class... Kinds>
Innovation<dynamic, typename JointGaussian<Kinds...>::Scalar> JointExtended::update(
    JointGaussian<Kinds...>& belief,
    const StackedMeasurement<typename JointGaussian<Kinds...>::Scalar>& stack) const {
  using S = typename JointGaussian<Kinds...>::Scalar;
  const int m = stack.rows();
  Innovation<dynamic, S> in;
  in.residual = Vector<dynamic, S>::Zero(m);
  in.covariance = Matrix<dynamic, dynamic, S>::Zero(m, m);
  std::vector<detail::JacobianPart<S>> parts;
  parts.reserve(stack.terms_.size());
  for (const auto& term : stack.terms_) {
    const auto* const slot = belief.find(term.block);
    if (slot == nullptr || belief.range(*slot).count != term.count) {
      in.status = Status::unknown_block;
      return in;
    }
    parts.push_back(
        {belief.range(*slot), term.first, term.rows, stack.numbers_.data() + term.begin, term.rows});
  }
  if (iterations != 1) {
    in.status = Status::bad_option;
    return in;
  }
  if (m == 0) return in;
  for (int i = 0; i < m; ++i) in.residual(i) = stack.residual_[static_cast<std::size_t>(i)];
  const Matrix<dynamic, dynamic, S> one = Matrix<dynamic, dynamic, S>::Identity(m, m);
  belief.core_.measure(parts, m, in.covariance.data());
  for (int i = 0; i < m; ++i) in.covariance(i, i) += S(1);
  const Cholesky<dynamic, S> root(in.covariance);
  Vector<dynamic, S> y = in.residual;
  in.status = verdict<dynamic, S>(in, root, y);
  if (!in.accepted()) return in;
  if (!lowers<dynamic, S>(belief.core_, parts, root, one)) {
    in.status = Status::not_positive_definite;
    return in;
  }
  belief.core_.step_by_whitened(y.data());
  if (!belief.core_.may_step()) {
    in.status = Status::not_finite;
    return in;
  }
  belief.core_.lower();
  belief.move(belief.core_.step());
  return in;
}

template <class S>
template <LinearisedMeasurement H, class... Kinds, class... X>
  requires detail::NamesAll<typename H::State, X...>
Status StackedMeasurement<S>::add(const JointGaussian<Kinds...>& belief, const H& sensor,
                                  const typename H::Measurement& z, BlockId<X>... ids) {
  if (!(belief.has(ids) && ...)) return Status::unknown_block;
  detail::LinearisedAt<H> at;
  if (!at.fill(sensor, detail::StateOfBlocks<X...>::of(belief.mean(ids)...), z)) return Status::size_mismatch;
  const AnyBlockId blocks[] = {ids...};
  const int sizes[] = {dof<X>...};
  std::vector<Term> terms;
  int column = 0;
  for (std::size_t i = 0; i < sizeof...(X); ++i) {
    terms.push_back({blocks[i], Matrix<dynamic, dynamic, S>(at.residual.size(), sizes[i])});
    for (int j = 0; j < sizes[i]; ++j, ++column)
      for (int k = 0; k < static_cast<int>(at.residual.size()); ++k)
        terms.back().jacobian(k, j) = at.jacobian(k, column);
  }
  return add(belief, at.residual, at.noise, std::span<const Term>(terms));
}

template <class S>
template <class... Kinds>
Status StackedMeasurement<S>::add(const JointGaussian<Kinds...>& belief, const Vector<dynamic, S>& residual,
                                  const Matrix<dynamic, dynamic, S>& noise, std::span<const Term> terms) {
  const Eigen::Index m = residual.size();
  if (noise.rows() != m || noise.cols() != m) return Status::size_mismatch;
  if (!all_finite(residual) || !all_finite(noise)) return Status::not_finite;
  for (const Term& term : terms) {
    if (!belief.contains(term.block)) return Status::unknown_block;
    if (term.jacobian.rows() != m || term.jacobian.cols() != belief.dof(term.block))
      return Status::size_mismatch;
    if (!all_finite(term.jacobian)) return Status::not_finite;
  }
  const Cholesky<dynamic, S> root(symmetrised(noise));
  if (!root.good()) return Status::not_positive_definite;
  std::size_t count = numbers_.size();
  for (const Term& term : terms) count += static_cast<std::size_t>(term.jacobian.size());
  detail::room_for(residual_, residual_.size() + static_cast<std::size_t>(m));
  detail::room_for(terms_, terms_.size() + terms.size());
  detail::room_for(numbers_, count);
  std::vector<Matrix<dynamic, dynamic, S>> whitened;
  for (const Term& term : terms) whitened.push_back(root.whiten(term.jacobian));
  const Vector<dynamic, S> white = root.whiten(residual);
  const int first = rows();  // nothing can fail from here
  residual_.insert(residual_.end(), white.data(), white.data() + m);
  for (const Term& term : terms) {
    const Matrix<dynamic, dynamic, S>& h = whitened[static_cast<std::size_t>(&term - terms.data())];
    terms_.push_back({term.block, static_cast<int>(h.cols()), first, static_cast<int>(m), numbers_.size()});
    numbers_.insert(numbers_.end(), h.data(), h.data() + h.size());
  }
  return Status::accepted;
}

}}  // namespace cairn::CAIRN_ABI
