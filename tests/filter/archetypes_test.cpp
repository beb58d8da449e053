// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Whatever stands for a matrix gives the numbers of a plain one, in every filter.
#include "support/archetypes.hpp"

#include <array>
#include <cstddef>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/augmented_unscented.hpp>
#include <cairn/filter/batch.hpp>
#include <cairn/filter/constraint.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/ensemble.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/interacting.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/kalman_bucy.hpp>
#include <cairn/filter/noise_fit.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/filter/rao_blackwell.hpp>
#include <cairn/filter/robust.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/square_root_information.hpp>
#include <cairn/filter/steady_state.hpp>
#include <cairn/filter/timeline.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>

#include "filter/linear_problems.hpp"

namespace archetypes_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::NoControl;
using cairn::Status;
using cairn::Structured;
using cairn::Vector;
using cairn_test::As;
using cairn_test::Manner;
using cairn_test::Shown;
using State = Vector<3>;
using Belief = Gaussian<State>;
constexpr int d = cairn::dynamic;

// What a run ended with, by its name.
using Outcome = std::pair<std::string, Vector<d>>;

Vector<d> flat(const State& mean, const Matrix<3>& covariance) {
  Vector<d> all(12);
  all << mean, covariance.reshaped();
  return all;
}
Vector<d> flat(const Belief& belief) {
  return flat(belief.mean, belief.covariance);
}

const Matrix<3> design_f{{0.9, 0.3, -0.2}, {0.1, 0.7, 0.4}, {0.0, -0.3, 0.8}};
const Matrix<3, 2> design_b{{0.5, 0.0}, {1.0, -1.0}, {0.0, 0.25}};
const Matrix<3> design_q{{0.3, 0.1, 0.05}, {0.1, 0.4, -0.1}, {0.05, -0.1, 0.2}};
const Matrix<2, 3> design_h{{1.0, 0.5, -0.3}, {0.2, -1.0, 0.6}};
const Matrix<2> design_r{{0.5, 0.2}, {0.2, 0.4}};
const Belief prior{State(0.3, -0.2, 0.5), Matrix<3>{{2.0, 0.3, 0.1}, {0.3, 1.5, -0.2}, {0.1, -0.2, 1.0}}};

// Every filter, on one process and sensor. `u` and `z` stand for two numbers each.
template <Manner How, class U, class Z>
std::vector<Outcome> outcomes(const U& u, const Z& z) {
  const cairn_test::StrangeProcess<How> f{Shown<How.f, 3, 3>(design_f), Shown<How.q, 3, 3>(design_q),
                                          design_b};
  const cairn_test::StrangeSensor<How> h{Shown<How.h, 2, 3>(design_h), Shown<How.r, 2, 2>(design_r)};
  const cairn_test::StrangeDrivenProcess<How> driven_f{f, Shown<How.q, 2, 2>(design_r), design_b};
  const cairn_test::StrangeDrivenSensor<How> driven_h{h};
  static_assert(cairn::LinearProcess<cairn_test::StrangeProcess<How>>);
  static_assert(cairn::ContinuousProcess<cairn_test::StrangeProcess<How>>);
  static_assert(cairn::LinearMeasurement<cairn_test::StrangeSensor<How>>);
  static_assert(cairn::ConditionalMeasurement<cairn_test::StrangeSensor<How>>);
  static_assert(cairn::DrivenProcess<cairn_test::StrangeDrivenProcess<How>>);
  static_assert(cairn::DrivenMeasurement<cairn_test::StrangeDrivenSensor<How>>);

  std::vector<Outcome> all;
  const auto run = [&](const std::string& name, const auto& filter, auto belief, const auto& process,
                       const auto& sensor) {
    INFO(name);
    CHECK(filter.predict(belief, process, 0.5, u) == Status::accepted);
    const auto found = filter.update(belief, sensor, z);
    if constexpr (requires { found.accepted(); })
      CHECK(found.accepted());
    else
      CHECK(found == Status::accepted);
    if constexpr (requires { belief.gaussian().value(); })
      all.emplace_back(name, flat(belief.gaussian().value()));
    else if constexpr (requires { belief.gaussian(); })
      all.emplace_back(name, flat(belief.gaussian()));
    else if constexpr (requires { belief.combined(); })
      all.emplace_back(name, flat(belief.combined()));
    else
      all.emplace_back(name, flat(belief));
  };
  run("Kalman", cairn::Kalman{}, prior, f, h);
  run("Kalman, joseph", cairn::Kalman{.form = cairn::Form::joseph}, prior, f, h);
  run("Kalman, sequential", cairn::Kalman{.form = cairn::Form::sequential}, prior, f, h);
  run("Extended", cairn::Extended{}, prior, f, h);
  run("Extended, iterated", cairn::Extended{.iterations = 3}, prior, f, h);
  run("Extended, numeric", cairn::Extended{}, prior, cairn::numeric(f), cairn::numeric(h));
  run("Unscented", cairn::Unscented{}, prior, f, h);
  run("AugmentedUnscented", cairn::AugmentedUnscented{}, prior, f, h);
  run("AugmentedUnscented, driven", cairn::AugmentedUnscented{}, prior, driven_f, driven_h);
  run("SquareRoot", cairn::SquareRoot{}, cairn::SquareRootGaussian<State>::from(prior), f, h);
  run("SquareRootUnscented", cairn::SquareRootUnscented{}, cairn::SquareRootGaussian<State>::from(prior), f,
      h);
  run("UDFilter", cairn::UDFilter{}, cairn::UDGaussian<State>::from(prior), f, h);
  run("InformationFilter", cairn::InformationFilter{}, *cairn::InformationBelief<State>::from(prior), f, h);
  run("SquareRootInformationFilter", cairn::SquareRootInformationFilter{},
      *cairn::SquareRootInformation<State>::from(prior), f, h);

  Belief belief = prior;
  CHECK(cairn::AugmentedUnscented{}.step(belief, driven_f, 0.5, driven_h, z, u).accepted());
  all.emplace_back("AugmentedUnscented, step", flat(belief));

  belief = prior;
  CHECK(cairn::KalmanBucy{.steps = 4}.predict(belief, f, 0.2, u) == Status::accepted);
  CHECK(cairn::KalmanBucy{.steps = 4}.filter(belief, f, h, z, 0.2, u) == Status::accepted);
  all.emplace_back("KalmanBucy", flat(belief));
  auto informed = *cairn::InformationBelief<State>::from(prior);
  CHECK(cairn::KalmanBucy{.steps = 4}.filter(informed, f, h, z, 0.2, u) == Status::accepted);
  all.emplace_back("KalmanBucy, information", flat(informed.gaussian().value()));

  for (const auto form : {cairn::EnsembleForm::square_root, cairn::EnsembleForm::perturbed}) {
    cairn::Random random(3);
    auto ensemble = cairn::Ensemble<State>::draw(prior, 20, random);
    const cairn::EnsembleKalman filter{.form = form};
    CHECK(filter.predict(ensemble, f, 0.5, random, u) == Status::accepted);
    CHECK(filter.predict(ensemble, driven_f, 0.5, random, u) == Status::accepted);
    CHECK(filter.update(ensemble, h, z, random).accepted());
    all.emplace_back("EnsembleKalman", flat(ensemble.gaussian()));
  }
  {
    cairn::Random random(4);
    auto particles = cairn::draw_particles(prior, 50, random);
    CHECK(cairn::ParticleFilter{}.predict(particles, f, 0.5, random, u) == Status::accepted);
    CHECK(cairn::ParticleFilter{}.update(particles, h, z, random) == Status::accepted);
    all.emplace_back("ParticleFilter", flat(cairn::moments(particles)));
    cairn::ConditionalParticles<State, State> parts;
    for (const State& x : particles.states) parts.states.push_back({x, {prior}});
    parts.log_weights = particles.log_weights;
    CHECK(cairn::RaoBlackwell{}.predict(parts, f, 0.5, random, u) == Status::accepted);
    CHECK(cairn::RaoBlackwell{}.update(parts, 0, h, z, random) == Status::accepted);
    all.emplace_back("RaoBlackwell", flat(parts.states[7].parts[0]));
  }
  {
    cairn::ModeBelief<State, 2> modes{{prior, prior}, {0.3, 0.7}};
    const cairn::Interacting<2, cairn::Extended> filter{{}, {{{0.9, 0.1}, {0.2, 0.8}}}};
    CHECK(filter.predict(modes, std::tuple(f, f), 0.5, u) == Status::accepted);
    CHECK(filter.update(modes, h, z) == Status::accepted);
    all.emplace_back("Interacting", flat(modes.combined()));
  }
  const auto soften = [&](const char* name, const auto& filter) {
    Belief soft = prior;
    CHECK(filter.update(soft, h, z).accepted());
    all.emplace_back(name, flat(soft));
  };
  soften("Robust", cairn::Robust<cairn::Extended>{.limit = 0.01});
  soften("Huber", cairn::Huber<cairn::Unscented>{.threshold = 0.1});
  soften("StudentT", cairn::StudentT<cairn::Kalman>{});

  const auto smooth = [&](const char* name, const auto& filter) {
    cairn::Recorder recorder(filter, prior);
    for (int k = 0; k < 3; ++k) {
      CHECK(recorder.predict(f, 0.5, u) == Status::accepted);
      CHECK(recorder.update(h, z).accepted());
    }
    all.emplace_back(name, flat(recorder.smoothed()[0]));
  };
  smooth("Recorder, Kalman", cairn::Kalman{});
  smooth("Recorder, Unscented", cairn::Unscented{});

  const Vector<2> control = u, seen = z;
  cairn::Timeline<cairn::Extended, cairn_test::StrangeProcess<How>, cairn_test::StrangeSensor<How>> timeline(
      cairn::Extended{}, f, prior, 0.0, control, 10.0);
  CHECK(timeline.steer(u, 0.5) == Status::accepted);
  CHECK(timeline.measure(h, z, 1.0).accepted());
  CHECK(timeline.measure(h, z, 0.7).accepted());
  all.emplace_back("Timeline", flat(*timeline.at(1.2)));

  cairn::NoiseRecord<cairn_test::StrangeProcess<How>, cairn_test::StrangeSensor<How>> record{prior, seen, {}};
  for (int k = 0; k < 5; ++k) record.steps.push_back({control, 0.5, Vector<2>(seen + k * control)});
  const auto fit = cairn::fit_noise(record, f, h, {.rounds = 2});
  CHECK(fit.status == Status::not_converged);
  all.emplace_back("fit_noise",
                   flat(State(fit.sensor(0, 0), fit.sensor(1, 0), fit.sensor(1, 1)), fit.process));

  const Matrix<2> learnt = cairn::adapted_noise(Matrix<2>(design_r), prior, h, z, 0.1);
  all.emplace_back("adapted_noise", learnt.reshaped());
  const auto steady = cairn::steady_state(f.f.get(), h.h.get(), f.q.get(), h.r.get());
  REQUIRE(steady.accepted());
  all.emplace_back("steady_state", steady.predicted.reshaped());
  belief = prior;
  CHECK(cairn::constrain(belief, h.h.get(), z) == Status::accepted);
  all.emplace_back("constrain", flat(belief));
  cairn::GaussianBatch<3> batch(3, prior);
  CHECK(cairn::BatchKalman{}.predict(batch, f.f.get(), f.q.get()) == Status::accepted);
  CHECK(cairn::BatchKalman{}.drift(batch, f.q.get()) == Status::accepted);
  all.emplace_back("BatchKalman", flat(batch.get(2)));
  const auto moved = cairn::unscented_transform(
      prior, [&](const State& x) -> decltype(auto) { return f.propagate(x, control, 0.5); });
  all.emplace_back("unscented_transform", flat(State(moved.mean), Matrix<3>(moved.covariance)));

  CHECK(cairn::check_jacobian(f, prior.mean, control, 0.5).agrees(1e-9));
  CHECK(cairn::check_jacobian(h, prior.mean).agrees(1e-9));
  return all;
}

template <Manner How, class U, class Z>
void check_like_ordinary(const U& u, const Z& z) {
  const auto found = outcomes<How>(u, z);
  const auto expected = outcomes<cairn_test::ordinary>(Vector<2>(u), Vector<2>(z));
  REQUIRE(found.size() == expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    CAPTURE(expected[i].first);
    CHECK(found[i].first == expected[i].first);
    CHECK(cairn_test::relative_error(found[i].second, expected[i].second) < 1e-12);
  }
}

const Vector<2> control(0.4, -0.1);
const Vector<2> measured(0.7, 0.2);

// The case that was found: the noise of a step and its Jacobian by rows.
struct ByRows {
  using State = Vector<3>;
  using Control = NoControl;
  static constexpr bool linear = true;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> f = (Matrix<3>() << 1, 1, 0.5, 0, 1, 1, 0, 0, 1).finished();
  [[nodiscard]] State propagate(const State& x, const Control&, double) const { return f * x; }
  [[nodiscard]] const auto& jacobian(const State&, const Control&, double) const { return f; }
  [[nodiscard]] Matrix<3> noise(const State&, const Control&, double) const { return Matrix<3>::Identity(); }
};
struct SeenByRows {
  using State = Vector<3>;
  using Measurement = Vector<2>;
  static constexpr bool linear = true;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> h = (Matrix<2, 3>() << 1, 2, 0, 0, 1, 3).finished();
  [[nodiscard]] Measurement predict(const State& x) const { return h * x; }
  [[nodiscard]] const auto& jacobian(const State&) const { return h; }
  [[nodiscard]] Matrix<2> noise(const State&) const { return Matrix<2>::Identity(); }
};

// A state and a measurement that are not aligned.
using Loose = Eigen::Matrix<double, 3, 1, Eigen::DontAlign>;
struct LooseProcess {
  using State = Loose;
  using Control = NoControl;
  static constexpr bool linear = true;
  [[nodiscard]] State propagate(const State& x, const Control&, double) const { return design_f * x; }
  [[nodiscard]] Matrix<3> jacobian(const State&, const Control&, double) const { return design_f; }
  [[nodiscard]] Matrix<3> noise(const State&, const Control&, double) const { return design_q; }
};
struct LooseSensor {
  using State = Loose;
  using Measurement = Eigen::Matrix<double, 2, 1, Eigen::DontAlign>;
  static constexpr bool linear = true;
  [[nodiscard]] auto predict(const State& x) const { return design_h * x; }
  [[nodiscard]] Matrix<2, 3> jacobian(const State&) const { return design_h; }
  [[nodiscard]] Matrix<2> noise(const State&) const { return design_r; }
};

// Zeros known when compiled, and a diagonal that is an expression.
struct Sparse {
  using State = Vector<3>;
  using Control = NoControl;
  static constexpr bool linear = true;
  [[nodiscard]] State propagate(const State& x, const Control& u, double dt) const {
    return jacobian(x, u, dt) * x;
  }
  [[nodiscard]] Structured<"1*. .1* *.1"> jacobian(const State&, const Control&, double) const {
    return {{0.5, -0.25, 2.0}};
  }
  [[nodiscard]] auto noise(const State&, const Control&, double) const { return variances.asDiagonal(); }
  State variances{0.1, 0.2, 0.3};
};

TEST_SUITE("archetypes") {
  TEST_CASE("archetypes: matrices by rows, maps, blocks and rows give the numbers of plain ones") {
    const Eigen::Map<const Vector<2>> z(measured.data());
    check_like_ordinary<cairn_test::by_rows>(Eigen::RowVector2d(control.transpose()), z);
  }
  TEST_CASE("archetypes: expressions give the numbers of plain matrices") {
    check_like_ordinary<cairn_test::expressions>(0.5 * control + 0.5 * control, 2.0 * (0.5 * measured));
  }
  TEST_CASE("archetypes: strided, derived, unaligned and bounded matrices give the numbers of plain ones") {
    Vector<5> wide;
    wide << 9, control, measured;
    check_like_ordinary<cairn_test::elsewhere>(wide.segment<2>(1), Vector<d>(wide.tail(2)));
  }

  TEST_CASE("issue 14: a row-major Jacobian gives the covariance of its matrix") {
    const Belief start{State::Zero(), Matrix<3>{{4, 1, 0}, {1, 3, 0.5}, {0, 0.5, 2}}};
    const Matrix<3> expected{{11, 5.75, 1.5}, {5.75, 7, 2.5}, {1.5, 2.5, 3}};
    const Matrix<2> expected_s{{21, 10}, {10, 25}};  // H P H^T + I of the prior, by hand
    const auto check = [&](const auto& filter) {
      Belief belief = start;
      CHECK(filter.predict(belief, ByRows{}, 1.0) == Status::accepted);
      CHECK(cairn_test::largest_difference(belief.covariance, expected) < 1e-13);
      belief = start;
      const auto innovation = filter.update(belief, SeenByRows{}, Vector<2>(1.0, 2.0));
      CHECK(innovation.accepted());
      CHECK(cairn_test::largest_difference(innovation.covariance, expected_s) < 1e-13);
      // r^T S^-1 r with S^-1 = [25 -10; -10 21] / 425
      CHECK(innovation.nis == doctest::Approx((25 - 40 + 84) / 425.0));
    };
    check(cairn::Kalman{});
    check(cairn::Extended{});
    check(cairn::Unscented{});
  }

  TEST_CASE("archetypes: states and measurements of other alignment or storage are states") {
    const cairn::LinearModel<3> process{design_f, design_q};
    const cairn::LinearSensor<2, 3> sensor{design_h, design_r};
    const auto check = [&](const auto& filter, auto loose, auto plain) {
      REQUIRE(filter.predict(loose, LooseProcess{}, 0.5) == Status::accepted);
      REQUIRE(filter.predict(plain, process, 0.5) == Status::accepted);
      static_cast<void>(filter.update(loose, LooseSensor{}, measured));
      static_cast<void>(filter.update(plain, sensor, measured));
      if constexpr (requires { plain.gaussian().value(); }) {
        CHECK(cairn_test::relative_error(loose.gaussian()->covariance, plain.gaussian()->covariance) < 1e-12);
        CHECK(cairn_test::relative_error(loose.gaussian()->mean, plain.gaussian()->mean) < 1e-12);
      } else if constexpr (requires { plain.gaussian(); }) {
        CHECK(cairn_test::relative_error(loose.gaussian().covariance, plain.gaussian().covariance) < 1e-12);
        CHECK(cairn_test::relative_error(loose.mean, plain.mean) < 1e-12);
      } else {
        CHECK(cairn_test::relative_error(loose.covariance, plain.covariance) < 1e-12);
        CHECK(cairn_test::relative_error(loose.mean, plain.mean) < 1e-12);
      }
    };
    const Gaussian<Loose> loose{prior.mean, prior.covariance};
    check(cairn::Kalman{}, loose, prior);
    check(cairn::Extended{.iterations = 2}, loose, prior);
    check(cairn::Unscented{}, loose, prior);
    check(cairn::AugmentedUnscented{}, loose, prior);
    check(cairn::SquareRoot{}, cairn::SquareRootGaussian<Loose>::from(loose),
          cairn::SquareRootGaussian<State>::from(prior));
    check(cairn::SquareRootUnscented{}, cairn::SquareRootGaussian<Loose>::from(loose),
          cairn::SquareRootGaussian<State>::from(prior));
    check(cairn::UDFilter{}, cairn::UDGaussian<Loose>::from(loose), cairn::UDGaussian<State>::from(prior));
    check(cairn::InformationFilter{}, *cairn::InformationBelief<Loose>::from(loose),
          *cairn::InformationBelief<State>::from(prior));
    check(cairn::SquareRootInformationFilter{}, *cairn::SquareRootInformation<Loose>::from(loose),
          *cairn::SquareRootInformation<State>::from(prior));
  }

  TEST_CASE("archetypes: a Structured and a diagonal stand for their matrices") {
    const cairn::LinearModel<3> dense{Sparse{}.jacobian({}, {}, 0.0), State(0.1, 0.2, 0.3).asDiagonal()};
    const auto check = [&](const auto& filter, auto sparse, auto plain) {
      REQUIRE(filter.predict(sparse, Sparse{}, 0.5) == Status::accepted);
      REQUIRE(filter.predict(plain, dense, 0.5) == Status::accepted);
      CHECK(cairn_test::relative_error(sparse.mean, plain.mean) < 1e-14);
      CHECK(cairn_test::relative_error(sparse.gaussian().covariance, plain.gaussian().covariance) < 1e-14);
    };
    check(cairn::Kalman{}, prior, prior);
    check(cairn::Extended{}, prior, prior);
    check(cairn::Unscented{}, prior, prior);
    const auto root = cairn::SquareRootGaussian<State>::from(prior);
    check(cairn::SquareRoot{}, root, root);
    const auto ud = cairn::UDGaussian<State>::from(prior);
    check(cairn::UDFilter{}, ud, ud);
  }
}

}  // namespace
}  // namespace archetypes_test
