// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The smallest and the strangest types that satisfy the concepts of models: matrices and vectors returned as
/// everything that stands for one.
#pragma once

#include <array>
#include <cstddef>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/structured.hpp>

namespace cairn_test {

/// Ways to return a matrix.
enum class As {
  plain,
  row_major,
  unaligned,
  over_aligned,
  map,
  strided,
  block,
  transposed,
  sum,
  product,
  run_time,
  run_time_rows,
  bounded,
  half_known,
  ref,
  derived,
  symmetric,  ///< a view of the lower triangle: of matrices that are
  row,        ///< of vectors, which may be returned lying down
};

template <int R, int C>
struct Derived : cairn::Matrix<R, C> {
  using cairn::Matrix<R, C>::Matrix;
  using cairn::Matrix<R, C>::operator=;
};

/// A matrix that get() returns in one of these ways. Not to be moved while it is in use.
template <As Way, int R, int C>
class Shown {
public:
  using Plain = cairn::Matrix<R, C>;

  explicit Shown(const Plain& m) { set(m); }

  void set(const Plain& m) {
    plain_ = m;
    run_time_ = rows_ = bounded_ = half_known_ = derived_ = m;
    turned_ = m.transpose();
    row_ = m.reshaped().transpose();
    wide_.setConstant(R + 2, C + 3, 1e9);
    wide_.block(1, 2, R, C) = m;
    strided_.fill(1e9);
    for (int i = 0; i < R; ++i)
      for (int j = 0; j < C; ++j) strided_[static_cast<std::size_t>(1 + i * 2 * C + j * 2)] = m(i, j);
  }

  [[nodiscard]] const Plain& plain() const { return plain_; }
  [[nodiscard]] decltype(auto) get() const {
    if constexpr (Way == As::plain)
      return (plain_);
    else if constexpr (Way == As::row_major)
      return Eigen::Matrix < double, R, C, C == 1 ? Eigen::ColMajor : Eigen::RowMajor > (plain_);
    else if constexpr (Way == As::unaligned)
      return Eigen::Matrix < double, R, C,
             Eigen::DontAlign | (R == 1 ? Eigen::RowMajor : Eigen::ColMajor) > (plain_);
    else if constexpr (Way == As::over_aligned)
      return Eigen::Map<const Plain, Eigen::Aligned16>(plain_.data());
    else if constexpr (Way == As::map)
      return Eigen::Map<const Plain>(plain_.data());
    else if constexpr (Way == As::strided)  // every second number of rows
      return Eigen::Map<const Plain, Eigen::Unaligned, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>(
          strided_.data() + 1, by_rows() ? Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>(2 * C, 2)
                                         : Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>(2, 2 * C));
    else if constexpr (Way == As::block)
      return wide_.template block<R, C>(1, 2);
    else if constexpr (Way == As::transposed)
      return turned_.transpose();
    else if constexpr (Way == As::sum)
      return 0.5 * plain_ + 0.5 * plain_;
    else if constexpr (Way == As::product)
      return plain_ * cairn::Matrix<C>::Identity();
    else if constexpr (Way == As::run_time)
      return (run_time_);
    else if constexpr (Way == As::run_time_rows)
      return rows_;
    else if constexpr (Way == As::bounded)
      return bounded_;
    else if constexpr (Way == As::half_known)
      return half_known_;
    else if constexpr (Way == As::ref)
      return Eigen::Ref<const cairn::Matrix<cairn::dynamic>, 0, Eigen::OuterStride<>>(
          wide_.block(1, 2, R, C));
    else if constexpr (Way == As::derived)
      return (derived_);
    else if constexpr (Way == As::row)
      return (row_);
    else
      return plain_.template selfadjointView<Eigen::Lower>();
  }

private:
  [[nodiscard]] static constexpr bool by_rows() { return R == 1 && C != 1; }

  alignas(64) Plain plain_;
  cairn::Matrix<cairn::dynamic> wide_;
  std::array<double, static_cast<std::size_t>(2 * R * C + 1)> strided_;
  cairn::Matrix<cairn::dynamic> run_time_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows_;
  cairn::Matrix<C, R> turned_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, R + 2, C + 2> bounded_;
  Eigen::Matrix<double, Eigen::Dynamic, C, C == 1 ? Eigen::ColMajor : Eigen::RowMajor> half_known_;
  Derived<R, C> derived_;
  cairn::Matrix<1, R * C> row_;
};

/// How the parts of a strange model are returned.
struct Manner {
  As f, q, state, h, r, seen;
};

/// x' = F x + B u + noise(Q) for three states and two controls, in discrete and continuous time.
template <Manner How>
struct StrangeProcess {
  using State = cairn::Vector<3>;
  using Control = cairn::Vector<2>;
  static constexpr bool linear = true;

  Shown<How.f, 3, 3> f;
  Shown<How.q, 3, 3> q;
  cairn::Matrix<3, 2> b;
  mutable Shown<How.state, 3, 1> shown{State::Zero()};  ///< what is returned may refer to it

  [[nodiscard]] decltype(auto) propagate(const State& x, const Control& u, double) const {
    return show(f.plain() * x + b * u);
  }
  [[nodiscard]] decltype(auto) jacobian(const State&, const Control&, double) const { return f.get(); }
  [[nodiscard]] decltype(auto) noise(const State&, const Control&, double) const { return q.get(); }
  [[nodiscard]] decltype(auto) rate(const State& x, const Control& u) const {
    return show(0.1 * (f.plain() * x + b * u));
  }
  [[nodiscard]] decltype(auto) rate_jacobian(const State&, const Control&) const { return f.get(); }
  [[nodiscard]] decltype(auto) spectral_density(const State&, const Control&) const { return q.get(); }

private:
  [[nodiscard]] decltype(auto) show(const State& x) const {
    shown.set(x);
    return shown.get();
  }
};

/// z = H x + noise(R), two numbers of three states; also given a part of three numbers instead.
template <Manner How>
struct StrangeSensor {
  using State = cairn::Vector<3>;
  using Part = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  static constexpr bool linear = true;

  Shown<How.h, 2, 3> h;
  Shown<How.r, 2, 2> r;
  mutable Shown<How.seen, 2, 1> shown{Measurement::Zero()};

  [[nodiscard]] decltype(auto) predict(const State& x) const {
    shown.set(h.plain() * x);
    return shown.get();
  }
  [[nodiscard]] decltype(auto) jacobian(const State&) const { return h.get(); }
  [[nodiscard]] decltype(auto) noise(const State&) const { return r.get(); }

  [[nodiscard]] decltype(auto) predict(const State& x, const Part& part) const { return predict(x + part); }
  [[nodiscard]] decltype(auto) part_jacobian(const State&, const Part&) const { return h.get(); }
  [[nodiscard]] decltype(auto) noise(const State&, const Part&) const { return r.get(); }
};

/// The same motion with noise of two numbers that enters by G, and the same sensor with noise that enters by
/// its own factor.
template <Manner How>
struct StrangeDrivenProcess {
  using State = cairn::Vector<3>;
  using Control = cairn::Vector<2>;
  using Noise = cairn::Vector<2>;

  StrangeProcess<How> motion;
  Shown<How.q, 2, 2> q;
  cairn::Matrix<3, 2> g;

  [[nodiscard]] decltype(auto) propagate(const State& x, const Control& u, const Noise& w, double) const {
    motion.shown.set(motion.f.plain() * x + motion.b * u + g * w);
    return motion.shown.get();
  }
  [[nodiscard]] decltype(auto) noise(const State&, const Control&, double) const { return q.get(); }
};
template <Manner How>
struct StrangeDrivenSensor {
  using State = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  using Noise = cairn::Vector<2>;

  StrangeSensor<How> sensor;

  [[nodiscard]] decltype(auto) predict(const State& x, const Noise& v) const {
    sensor.shown.set(sensor.h.plain() * x + 1.5 * v);
    return sensor.shown.get();
  }
  [[nodiscard]] decltype(auto) noise(const State&) const { return sensor.r.get(); }
};

// Together they return every kind of matrix.
inline constexpr Manner ordinary{As::plain, As::plain, As::plain, As::plain, As::plain, As::plain};
inline constexpr Manner by_rows{As::row_major, As::map, As::transposed, As::transposed, As::block, As::row};
inline constexpr Manner expressions{As::product,    As::symmetric, As::run_time,
                                    As::half_known, As::ref,       As::sum};
inline constexpr Manner elsewhere{As::strided,       As::bounded, As::row,
                                  As::run_time_rows, As::derived, As::unaligned};

}  // namespace cairn_test
