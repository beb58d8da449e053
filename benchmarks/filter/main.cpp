// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The scoreboard of the filters: nanoseconds of one predict and update, ours and rivals' in turns.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include <cairn/filter/batch.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>

#include "hand_written.hpp"
#include "problems.hpp"
#include "rivals.hpp"
#include "support/scoreboard.hpp"
#include "support/timing.hpp"

namespace {

using namespace cairn_bench;
using cairn::Gaussian;
using cairn::Status;
using cairn::Vector;

constexpr int steps = 2000;

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "scoreboard_filter: %s\n", what.c_str());
  std::exit(1);
}

template <class Filter, class Belief, class F, class H, class Z>
double run_linear(const Filter& filter, Belief belief, const F& process, const H& sensor, const Z& z,
                  int count) {
  int refused = 0;
  for (int k = 0; k < count; ++k) {
    refused += filter.predict(belief, process, time_step) != Status::accepted ? 1 : 0;
    refused += filter.update(belief, sensor, z[static_cast<std::size_t>(k % 64)]).accepted() ? 0 : 1;
  }
  if (refused != 0) fail("a step was refused");
  if constexpr (requires { belief.covariance(); })
    return belief.covariance().trace();
  else
    return belief.covariance.trace();
}

double ours_6_3(int count) {
  static const auto z = noise<3>(64, 1.0);
  return run_linear(cairn::Kalman{}, Gaussian<Vector<6>>{Vector<6>::Zero(), cairn::Matrix<6>::Identity()},
                    cairn::ConstantVelocity<3>{}, cairn::PositionSensor<3, 6>{}, z, count);
}
double ours_ud_6_3(int count) {
  static const auto z = noise<3>(64, 1.0);
  const Gaussian<Vector<6>> prior{Vector<6>::Zero(), cairn::Matrix<6>::Identity()};
  return run_linear(cairn::UDFilter{}, cairn::UDGaussian<Vector<6>>::from(prior),
                    cairn::ConstantVelocity<3>{}, cairn::PositionSensor<3, 6>{}, z, count);
}
double ours_3_3(int count) {
  static const auto z = noise<3>(64, 1.0);
  return run_linear(cairn::Kalman{}, Gaussian<Vector<3>>{Vector<3>::Zero(), cairn::Matrix<3>::Identity()},
                    Still{}, cairn::PositionSensor<3, 3>{}, z, count);
}
double ours_15_6(int count) {
  static const auto z = noise<6>(64, 1.0);
  return run_linear(cairn::Extended{},
                    Gaussian<Vector<15>>{Vector<15>::Zero(), cairn::Matrix<15>::Identity()}, Inertial{},
                    cairn::PositionSensor<6, 15>{}, z, count);
}
double ours_ud_15_6(int count) {
  static const auto z = noise<6>(64, 1.0);
  const Gaussian<Vector<15>> prior{Vector<15>::Zero(), cairn::Matrix<15>::Identity()};
  return run_linear(cairn::UDFilter{}, cairn::UDGaussian<Vector<15>>::from(prior), Inertial{},
                    cairn::PositionSensor<6, 15>{}, z, count);
}

const Vector<5> vehicle_start = (Vector<5>() << 0, 0, 0, 1, 0.1).finished();

// The vehicle restarts every 64 steps, so that all filters stay near the same states.
template <class Filter>
double run_vehicle(const Filter& filter, int count) {
  static const auto z = noise<2>(64, 0.1);
  const Beacon sensor;
  Gaussian<Vector<5>> belief{vehicle_start, cairn::Matrix<5>::Identity()};
  int refused = 0;
  for (int k = 0; k < count; ++k) {
    if (k % 64 == 0) belief.mean = vehicle_start;
    refused += filter.predict(belief, Vehicle{}, time_step) != Status::accepted ? 1 : 0;
    const auto seen = cairn::retract(sensor.predict(belief.mean), z[static_cast<std::size_t>(k % 64)]);
    refused += filter.update(belief, sensor, seen).accepted() ? 0 : 1;
  }
  if (refused != 0) fail("a step of the vehicle was refused");
  return belief.covariance.trace();
}
double hand_written_vehicle(int count) {
  static const auto z = noise<2>(64, 0.1);
  const Beacon sensor;
  HandWrittenUnscented<5, 2> filter{vehicle_start, cairn::Matrix<5>::Identity()};
  const auto h = [&](const Vector<5>& x) {
    const auto seen = sensor.predict(x);
    return Vector<2>(seen.part<0>()(0), seen.part<1>().angle());
  };
  for (int k = 0; k < count; ++k) {
    if (k % 64 == 0) filter.x = vehicle_start;
    filter.predict([](const Vector<5>& x) { return Vehicle{}.propagate(x, {}, time_step); },
                   Vehicle{}.noise(filter.x, {}, time_step));
    filter.update(h, sensor.noise(filter.x), h(filter.x) + z[static_cast<std::size_t>(k % 64)]);
  }
  return filter.p.trace();
}
double unscented_9_3(int count) {
  static const auto z = noise<3>(64, 0.3);
  return run_linear(cairn::Unscented{}, Gaussian<Vector<9>>{Vector<9>::Zero(), cairn::Matrix<9>::Identity()},
                    Coupled{}, CoupledSensor{}, z, count);
}
double hand_written_9_3(int count) {
  static const auto z = noise<3>(64, 0.3);
  HandWrittenUnscented<9, 3> filter{Vector<9>::Zero(), cairn::Matrix<9>::Identity()};
  for (int k = 0; k < count; ++k) {
    filter.predict([](const Vector<9>& x) { return Coupled{}.propagate(x, {}, time_step); },
                   Coupled{}.noise(filter.x, {}, time_step));
    filter.update([](const Vector<9>& x) { return CoupledSensor{}.predict(x); },
                  CoupledSensor{}.noise(filter.x), z[static_cast<std::size_t>(k % 64)]);
  }
  return filter.p.trace();
}

double batch_of_1000(int rounds) {
  const Gaussian<Vector<3>> prior{Vector<3>::Zero(), cairn::Matrix<3>::Identity()};
  static cairn::GaussianBatch<3> batch(1000, prior);
  static const cairn::GaussianBatch<3> seen(1000, prior);
  const cairn::Matrix<3> q = Still{}.q;
  std::size_t kept = 0;
  for (int k = 0; k < rounds; ++k) {
    cairn::BatchKalman{}.drift(batch, q);
    kept += cairn::BatchKalman{}.update(batch, seen);
  }
  if (kept != 1000U * static_cast<std::size_t>(rounds)) fail("a lane of the batch was refused");
  return batch.get(0).covariance.trace();
}

// Two ways must end with the same uncertainty, or the time of one is worth nothing.
void same(const std::string& name, double ours, double theirs, double tolerance) {
  if (!(std::abs(ours - theirs) <= tolerance * std::abs(ours)))
    fail(name + ": the answers differ: " + std::to_string(ours) + " and " + std::to_string(theirs));
}

struct Duel {
  std::string name;
  Run ours;
  Run rival;
  std::string rival_name;
  double must, aim;
  double tolerance = 1e-6;
};

void fight(Scoreboard& board, const Duel& duel) {
  std::vector<Contender> contenders{{"ours", [&] { do_not_optimise(duel.ours(steps)); }, double(steps)}};
  if (duel.rival) {
    same(duel.name, duel.ours(steps), duel.rival(steps), duel.tolerance);
    contenders.push_back({duel.rival_name, [&] { do_not_optimise(duel.rival(steps)); }, double(steps)});
  }
  const auto timings = interleave(contenders);
  const std::optional<double> rival = duel.rival ? std::optional(timings[1].median * 1e9) : std::nullopt;
  board.add(
      against_rival(duel.name, timings[0].median * 1e9, rival, duel.rival_name, duel.must, duel.aim, "ns"));
}

void absolute(Scoreboard& board, const std::string& name, const Run& run, double operations_a_step,
              double must, double aim) {
  const auto timings = interleave({{"ours", [&] { do_not_optimise(run(200)); }, 200.0 * operations_a_step}});
  board.add({.name = name, .measured = timings[0].median * 1e9, .unit = "ns", .must = must, .aim = aim});
}

}  // namespace

int main() {
  Scoreboard board("filter");
  const Rival open = openkf(), tiny = tinyekf();
  fight(board, {"KF 6/3 constant velocity", ours_6_3, open.kalman_6_3, open.name, 1.0, 1.69});
  fight(board, {"KF 3/3 landmark", ours_3_3, open.landmark_3_3, open.name, 1.0, 1.38});
  absolute(board, "KF 3/3 landmark, batch of 1000, each", batch_of_1000, 1000.0, 15.0, 10.0);
  fight(board, {"EKF 5/2 range and bearing", [](int n) { return run_vehicle(cairn::Extended{}, n); },
                open.extended_5_2, open.name, 1.0, 1.42});
  fight(board, {"EKF 15/6 inertial", ours_15_6, tiny.extended_15_6, tiny.name, 1.3, 3.04});
  fight(board, {"UKF 5/2 range and bearing",
                [](int n) {
                  return run_vehicle(cairn::Unscented{.points = {.alpha = 1, .beta = 0, .kappa = -2}}, n);
                },
                hand_written_vehicle, "hand-written Eigen", 2.0, 2.9, 1e-3});
  fight(board, {"UKF 9/3", unscented_9_3, hand_written_9_3, "hand-written Eigen", 2.0, 2.97, 0.5});
  absolute(board, "UD 6/3", ours_ud_6_3, 1.0, 400.0, 350.0);
  absolute(board, "UD 15/6", ours_ud_15_6, 1.0, 3000.0, 2400.0);
  same("UD 6/3", ours_6_3(steps), ours_ud_6_3(steps), 1e-9);
  same("UD 15/6", ours_15_6(steps), ours_ud_15_6(steps), 1e-9);
  return board.finish();
}
