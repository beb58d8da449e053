// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// mherb/kalman: extended, unscented and square-root extended filters. Its unscented filter does not draw its
// points anew after Q was added, so its answers differ from the exact ones.
#include "rivals.hpp"

#ifdef CAIRN_BENCH_MHERB
#include <kalman/ExtendedKalmanFilter.hpp>
#include <kalman/SquareRootExtendedKalmanFilter.hpp>
#include <kalman/UnscentedKalmanFilter.hpp>

#include "problems.hpp"

namespace cairn_bench {
namespace {

template <int N>
struct MherbVector : Kalman::Vector<double, N> {
  KALMAN_VECTOR(MherbVector, double, N)
};

template <class F>
struct MherbProcess : Kalman::LinearizedSystemModel<MherbVector<cairn::dof<typename F::State>>,
                                                    Kalman::Vector<double, 1>, Kalman::StandardBase> {
  static constexpr int n = cairn::dof<typename F::State>;
  F process;
  MherbProcess() {
    this->setCovariance(cairn::Matrix<n>(process.noise(cairn::Vector<n>::Zero(), {}, time_step)));
  }
  MherbVector<n> f(const MherbVector<n>& x, const Kalman::Vector<double, 1>&) const override {
    return MherbVector<n>(process.propagate(cairn::Vector<n>(x), {}, time_step));
  }
  void updateJacobians(const MherbVector<n>& x, const Kalman::Vector<double, 1>&) override {
    if constexpr (requires { process.jacobian(cairn::Vector<n>(x), {}, time_step); })
      this->F = cairn::Matrix<n>(process.jacobian(cairn::Vector<n>(x), {}, time_step));
  }
};
template <class H>
struct MherbSensor : Kalman::LinearizedMeasurementModel<MherbVector<cairn::dof<typename H::State>>,
                                                        MherbVector<cairn::dof<typename H::Measurement>>,
                                                        Kalman::StandardBase> {
  static constexpr int n = cairn::dof<typename H::State>;
  static constexpr int m = cairn::dof<typename H::Measurement>;
  H sensor;
  MherbSensor() { this->setCovariance(cairn::Matrix<m>(sensor.noise(cairn::Vector<n>::Zero()))); }
  MherbVector<m> h(const MherbVector<n>& x) const override {
    const auto seen = sensor.predict(cairn::Vector<n>(x));
    if constexpr (std::is_same_v<H, Beacon>)
      return MherbVector<m>(cairn::Vector<m>(seen.template part<0>()(0), seen.template part<1>().angle()));
    else
      return MherbVector<m>(seen);
  }
  void updateJacobians(const MherbVector<n>& x) override {
    if constexpr (requires { sensor.jacobian(cairn::Vector<n>(x)); })
      this->H_() = cairn::Matrix<m, n>(sensor.jacobian(cairn::Vector<n>(x)));
  }
  auto& H_() {
    return Kalman::LinearizedMeasurementModel<MherbVector<n>, MherbVector<m>, Kalman::StandardBase>::H;
  }
};

template <class Filter, class F, class H>
double run(Filter filter, double sigma, int steps) {
  constexpr int n = MherbProcess<F>::n, m = MherbSensor<H>::m;
  static const auto z = noise<m>(64, sigma);
  MherbProcess<F> process;
  MherbSensor<H> sensor;
  cairn::Vector<n> start = cairn::Vector<n>::Zero();
  constexpr bool vehicle = std::is_same_v<F, Vehicle>;
  if constexpr (vehicle) start = vehicle_start();
  filter.init(MherbVector<n>(start));
  filter.setCovariance(cairn::Matrix<n>::Identity());
  const Kalman::Vector<double, 1> none(cairn::Vector<1>::Zero());
  for (int k = 0; k < steps; ++k) {
    if (vehicle && k % 64 == 0) filter.init(MherbVector<n>(start));
    filter.predict(process, none);
    cairn::Vector<m> seen = z[static_cast<std::size_t>(k % 64)];
    if constexpr (vehicle) seen += cairn::Vector<m>(sensor.h(MherbVector<n>(filter.getState())));
    filter.update(sensor, MherbVector<m>(seen));
  }
  return cairn::Matrix<n>(filter.getCovariance()).trace();
}

template <int N>
using Extended = Kalman::ExtendedKalmanFilter<MherbVector<N>>;
template <int N>
using Root = Kalman::SquareRootExtendedKalmanFilter<MherbVector<N>>;
template <int N>
using Unscented = Kalman::UnscentedKalmanFilter<MherbVector<N>>;

}  // namespace

Rival mherb() {
  using Position3 = cairn::PositionSensor<3, 6>;
  return {
      "mherb",
      [](int n) { return run<Extended<6>, cairn::ConstantVelocity<3>, Position3>({}, 1.0, n); },
      [](int n) { return run<Extended<3>, Still, cairn::PositionSensor<3, 3>>({}, 1.0, n); },
      [](int n) { return run<Extended<5>, Vehicle, Beacon>({}, 0.1, n); },
      [](int n) { return run<Extended<15>, Inertial, cairn::PositionSensor<6, 15>>({}, 1.0, n); },
      [](int n) { return run<Unscented<5>, Vehicle, Beacon>(Unscented<5>(1.0, 0.0, -2.0), 0.1, n); },
      [](int n) { return run<Unscented<9>, Coupled, CoupledSensor>(Unscented<9>(1.0, 0.0, -6.0), 0.3, n); },
      [](int n) { return run<Root<6>, cairn::ConstantVelocity<3>, Position3>({}, 1.0, n); },
      [](int n) { return run<Root<15>, Inertial, cairn::PositionSensor<6, 15>>({}, 1.0, n); }};
}

}  // namespace cairn_bench
#else
cairn_bench::Rival cairn_bench::mherb() {
  return {"mherb"};
}
#endif
