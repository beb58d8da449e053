// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Every filter against every size that does not fit: refused with size_mismatch, the belief as it was, and
// nothing read past an end, whether Eigen asserts or not.
#include <cmath>
#include <cstddef>
#include <functional>
#include <stdexcept>
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
#include <cairn/models/linear.hpp>

namespace cairn_test {

// A user's state of run-time size.
struct Readings {
  std::vector<double> values;
};

}  // namespace cairn_test

template <>
struct cairn::manifold_traits<cairn_test::Readings> {
  using Scalar = double;
  using Tangent = cairn::Vector<cairn::dynamic>;
  using State = cairn_test::Readings;
  static constexpr int dof = cairn::dynamic;
  static State retract(const State& x, const Tangent& step) {
    State y = x;
    for (std::size_t i = 0; i < x.values.size(); ++i) y.values.at(i) += step(static_cast<Eigen::Index>(i));
    return y;
  }
  static Tangent local(const State& x, const State& y) {
    Tangent step(static_cast<Eigen::Index>(x.values.size()));
    for (std::size_t i = 0; i < x.values.size(); ++i)
      step(static_cast<Eigen::Index>(i)) = y.values.at(i) - x.values.at(i);
    return step;
  }
};

namespace sizes_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;
constexpr int d = cairn::dynamic;

// All sizes of a problem of three states and two measured numbers.
struct Shape {
  int rows, columns;
};
struct Sizes {
  int mean = 3;
  Shape p{3, 3};    // covariance, information or root of the belief
  int vector = 3;   // of the information forms
  int odd_one = 3;  // size of one member of many: an ensemble's, a particle, a mode
  Shape f{3, 3};
  Shape q{3, 3};
  int moved = 3;
  Shape h{2, 3};
  Shape r{2, 2};
  int seen = 2;
  int z = 2;
};

// What a filter asks for.
enum Part : unsigned {
  belief = 1,
  vector = 2,
  odd_one = 4,
  f = 8,
  q = 16,
  moved = 32,
  h = 64,
  r = 128,
  seen = 256,
  z = 512
};

struct Mutation {
  std::string name;
  Part part;
  std::function<void(Sizes&)> apply;
};

std::vector<Mutation> mutations() {
  std::vector<Mutation> all;
  const auto add_shapes = [&](const std::string& name, Part part, Shape Sizes::* which, Shape good) {
    for (const Shape s : {Shape{good.rows - 1, good.columns - 1}, Shape{good.rows + 1, good.columns + 1},
                          Shape{good.rows, good.columns - 1}, Shape{good.rows - 1, good.columns},
                          Shape{good.rows, good.columns + 1}, Shape{good.rows + 1, good.columns}, Shape{1, 1},
                          Shape{0, 0}, Shape{0, good.columns}, Shape{good.rows, 0}})
      all.push_back({name + " of " + std::to_string(s.rows) + " x " + std::to_string(s.columns), part,
                     [=](Sizes& sizes) { sizes.*which = s; }});
  };
  const auto add_lengths = [&](const std::string& name, Part part, int Sizes::* which, int good) {
    for (const int n : {0, 1, good - 1, good + 1, good + 7})
      if (n != good)
        all.push_back({name + " of " + std::to_string(n), part, [=](Sizes& sizes) { sizes.*which = n; }});
  };
  add_lengths("mean", belief, &Sizes::mean, 3);
  add_shapes("P", belief, &Sizes::p, {3, 3});
  add_lengths("y", vector, &Sizes::vector, 3);
  add_lengths("one of many", odd_one, &Sizes::odd_one, 3);
  add_shapes("F", f, &Sizes::f, {3, 3});
  add_shapes("Q", q, &Sizes::q, {3, 3});
  add_lengths("propagated state", moved, &Sizes::moved, 3);
  add_shapes("H", h, &Sizes::h, {2, 3});
  all.push_back({"H of 3 x 2", h, [](Sizes& sizes) { sizes.h = {3, 2}; }});
  add_shapes("R", r, &Sizes::r, {2, 2});
  add_lengths("predicted measurement", seen, &Sizes::seen, 2);
  add_lengths("z", z, &Sizes::z, 2);
  return all;
}

Matrix<d> matrix(Shape s, double diagonal) {
  return diagonal * Matrix<d>::Identity(s.rows, s.columns);
}

// Models that return whatever sizes they are told to, for states and measurements of fixed or run-time size.
template <class X>
struct SizedProcess {
  using State = X;
  using Control = Vector<d>;
  static constexpr bool linear = true;
  Sizes sizes;

  [[nodiscard]] Vector<d> propagate(const X& x, const Control&, double) const {
    Vector<d> next = Vector<d>::Zero(sizes.moved);
    for (int i = 0; i < sizes.moved && i < x.size(); ++i) next(i) = x(i);
    return next;
  }
  [[nodiscard]] Matrix<d> jacobian(const X&, const Control&, double) const { return matrix(sizes.f, 1.0); }
  [[nodiscard]] Matrix<d> noise(const X&, const Control&, double) const { return matrix(sizes.q, 0.1); }
  [[nodiscard]] Vector<d> rate(const X&, const Control&) const { return Vector<d>::Zero(sizes.moved); }
  [[nodiscard]] Matrix<d> rate_jacobian(const X&, const Control&) const { return matrix(sizes.f, -0.1); }
  [[nodiscard]] Matrix<d> spectral_density(const X&, const Control&) const { return matrix(sizes.q, 0.1); }
};
template <class X, class Z>
struct SizedSensor {
  using State = X;
  using Part = X;
  using Measurement = Z;
  static constexpr bool linear = true;
  Sizes sizes;

  [[nodiscard]] Vector<d> predict(const X& x) const {
    Vector<d> y = Vector<d>::Zero(sizes.seen);
    for (int i = 0; i < sizes.seen && i < x.size(); ++i) y(i) = x(i);
    return y;
  }
  [[nodiscard]] Matrix<d> jacobian(const X&) const { return matrix(sizes.h, 1.0); }
  [[nodiscard]] Matrix<d> noise(const X&) const { return matrix(sizes.r, 0.5); }
  [[nodiscard]] Vector<d> predict(const X&, const Part& part) const { return predict(part); }
  [[nodiscard]] Matrix<d> part_jacobian(const X&, const Part&) const { return matrix(sizes.h, 1.0); }
  [[nodiscard]] Matrix<d> noise(const X&, const Part&) const { return matrix(sizes.r, 0.5); }
};
// Noise of a size of its own, which q and r tell.
template <class X>
struct SizedDrivenProcess {
  using State = X;
  using Control = Vector<d>;
  using Noise = Vector<3>;
  SizedProcess<X> process;
  [[nodiscard]] Vector<d> propagate(const X& x, const Control& u, const Noise& w, double dt) const {
    Vector<d> next = process.propagate(x, u, dt);
    if (next.size() == 3) next += w;
    return next;
  }
  [[nodiscard]] Matrix<d> noise(const X& x, const Control& u, double dt) const {
    return process.noise(x, u, dt);
  }
};
template <class X, class Z>
struct SizedDrivenSensor {
  using State = X;
  using Measurement = Z;
  using Noise = Vector<2>;
  SizedSensor<X, Z> sensor;
  [[nodiscard]] Vector<d> predict(const X& x, const Noise& v) const {
    Vector<d> y = sensor.predict(x);
    if (y.size() == 2) y += v;
    return y;
  }
  [[nodiscard]] Matrix<d> noise(const X& x) const { return sensor.noise(x); }
};

template <class X>
X state(int size, double value = 0.25) {
  if constexpr (X::SizeAtCompileTime == d)
    return X::Constant(size, value);
  else
    return X::Constant(value);
}
template <class M>
M square(Shape s) {
  if constexpr (M::SizeAtCompileTime == d)
    return matrix(s, 1.0);
  else
    return M::Identity();
}
template <class X>
Gaussian<X> gaussian(const Sizes& s) {
  return {state<X>(s.mean), square<cairn::CovarianceOf<X>>(s.p)};
}

// Equal, bit for bit and in size.
template <class A>
bool same(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<A>& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() && (a.array() == b.array()).all();
}
template <class X>
bool same(const Gaussian<X>& a, const Gaussian<X>& b) {
  return same(a.mean, b.mean) && same(a.covariance, b.covariance);
}
template <class X>
bool same(const cairn::SquareRootGaussian<X>& a, const cairn::SquareRootGaussian<X>& b) {
  return same(a.mean, b.mean) && same(a.root, b.root);
}
template <class X>
bool same(const cairn::UDGaussian<X>& a, const cairn::UDGaussian<X>& b) {
  return same(a.mean, b.mean) && same(a.upper, b.upper) && same(a.diagonal, b.diagonal);
}
template <class X>
bool same(const cairn::InformationBelief<X>& a, const cairn::InformationBelief<X>& b) {
  return same(a.point, b.point) && same(a.information, b.information) && same(a.vector, b.vector);
}
template <class X>
bool same(const cairn::SquareRootInformation<X>& a, const cairn::SquareRootInformation<X>& b) {
  return same(a.point, b.point) && same(a.root, b.root) && same(a.vector, b.vector);
}
template <class X>
bool same(const cairn::ConditionalParticle<X, X>& a, const cairn::ConditionalParticle<X, X>& b);
template <class T>
bool same(const std::vector<T>& a, const std::vector<T>& b) {
  bool good = a.size() == b.size();
  for (std::size_t i = 0; good && i < a.size(); ++i) good = same(a[i], b[i]);
  return good;
}
template <class X>
bool same(const cairn::Ensemble<X>& a, const cairn::Ensemble<X>& b) {
  return same(a.members, b.members);
}
template <class X>
bool same(const cairn::ConditionalParticle<X, X>& a, const cairn::ConditionalParticle<X, X>& b) {
  bool parts = a.parts.size() == b.parts.size();
  for (std::size_t i = 0; parts && i < a.parts.size(); ++i) parts = same(a.parts[i], b.parts[i]);
  return parts && same(a.state, b.state);
}
template <class X>
bool same(const cairn::Particles<X>& a, const cairn::Particles<X>& b) {
  return same(a.states, b.states) && a.log_weights == b.log_weights;
}
template <class X, std::size_t R>
bool same(const cairn::ModeBelief<X, R>& a, const cairn::ModeBelief<X, R>& b) {
  bool good = a.probability == b.probability;
  for (std::size_t i = 0; i < R; ++i) good = good && same(a.modes[i], b.modes[i]);
  return good;
}

Status status_of(Status status) {
  return status;
}
template <int M, class S>
Status status_of(const cairn::Innovation<M, S>& innovation) {
  return innovation.status;
}

/// Runs `step(belief, sizes)` for every mutation: refused where it touches `asked`, else accepted.
template <class Make, class Step>
void check_all(const std::string& name, unsigned asked, bool fixed_state, const Make& make,
               const Step& step) {
  const auto run = [&](const Sizes& sizes, Status expected) {
    auto belief = make(sizes);
    const auto before = belief;
    const Status status = status_of(step(belief, sizes));
    CHECK(status == expected);
    if (status != Status::accepted) CHECK(same(belief, before));
  };
  CAPTURE(name);
  run(Sizes{}, Status::accepted);
  for (const Mutation& mutation : mutations()) {
    CAPTURE(mutation.name);
    Sizes sizes;
    mutation.apply(sizes);
    if (fixed_state && (mutation.part & (belief | vector | odd_one)) != 0) continue;
    if ((mutation.part & (belief | vector | odd_one)) != 0 && (mutation.part & asked) == 0) continue;
    run(sizes, (mutation.part & asked) != 0 ? Status::size_mismatch : Status::accepted);
  }
  if (!fixed_state) {
    CAPTURE("nothing at all");
    const Shape none{0, 0};
    run(Sizes{0, none, 0, 0, none, none, 0, none, none, 0, 0}, Status::size_mismatch);
  }
}

template <class X, class Z>
struct Table {
  static constexpr bool fixed_state = X::SizeAtCompileTime != d;
  static constexpr bool fixed_measurement = Z::SizeAtCompileTime != d;
  static constexpr unsigned linearised = f | q | moved;
  static constexpr unsigned propagated = q | moved;
  static constexpr unsigned sighted = h | r | seen | z;
  static constexpr unsigned looked = r | seen | z;
  using F = SizedProcess<X>;
  using H = SizedSensor<X, Z>;
  static inline const Vector<d> u = Vector<d>::Ones(1);

  static Vector<d> seen_as(const Sizes& s) { return Vector<d>::Constant(s.z, 0.3); }

  template <class Make, class Step>
  static void check(const std::string& name, unsigned asked, const Make& make, const Step& step) {
    check_all(name, asked, fixed_state, make, step);
  }
  template <class Filter, class Make>
  static void check_filter(const std::string& name, const Filter& filter, unsigned of_belief,
                           unsigned predict, unsigned update, const Make& make) {
    check(name + ", predict", of_belief | predict, make,
          [&](auto& b, const Sizes& s) { return filter.predict(b, F{s}, 0.1, u); });
    check(name + ", update", of_belief | update, make,
          [&](auto& b, const Sizes& s) { return filter.update(b, H{s}, seen_as(s)); });
  }

  static void kalman() {
    check_filter("Kalman", cairn::Kalman{}, belief, linearised, sighted, gaussian<X>);
    check_filter("Kalman, joseph", cairn::Kalman{.form = cairn::Form::joseph}, belief, linearised, sighted,
                 gaussian<X>);
  }

  static void gaussian_filters() {
    const auto make = gaussian<X>;
    kalman();
    check_filter("Unscented", cairn::Unscented{}, belief, propagated, looked, make);
    check_filter("Extended", cairn::Extended{}, belief, linearised, sighted, make);
    check_filter("Extended, iterated", cairn::Extended{.iterations = 3}, belief, linearised, sighted, make);
    check_filter("AugmentedUnscented", cairn::AugmentedUnscented{}, belief, propagated, looked, make);
    const cairn::AugmentedUnscented augmented;
    check("AugmentedUnscented, driven predict", belief | propagated, make,
          [&](auto& b, const Sizes& s) { return augmented.predict(b, SizedDrivenProcess<X>{{s}}, 0.1, u); });
    check("AugmentedUnscented, driven update", belief | looked, make, [&](auto& b, const Sizes& s) {
      return augmented.update(b, SizedDrivenSensor<X, Z>{{s}}, seen_as(s));
    });
    check("AugmentedUnscented, step", belief | propagated | looked, make,
          [&](auto& b, const Sizes& s) { return augmented.step(b, F{s}, 0.1, H{s}, seen_as(s), u); });
    check("numeric", belief | propagated | looked, make, [&](auto& b, const Sizes& s) {
      auto next = b;
      Status status = cairn::Extended{}.predict(next, cairn::numeric(F{s}), 0.1, u);
      if (status == Status::accepted)
        status = cairn::Extended{}.update(next, cairn::numeric(H{s}), seen_as(s)).status;
      if (status == Status::accepted) b = next;
      return status;
    });
    const auto soften = [&](const char* name, const auto& filter, unsigned asked) {
      check(name, belief | asked, make,
            [&](auto& b, const Sizes& s) { return filter.update(b, H{s}, seen_as(s)); });
    };
    soften("Robust", cairn::Robust<cairn::Extended>{.limit = 1e-3}, sighted);
    soften("Huber", cairn::Huber<cairn::Unscented>{.threshold = 0.1}, looked);
    soften("StudentT", cairn::StudentT<cairn::Kalman>{}, sighted);
  }

  static void factored_filters() {
    const auto root = [](const Sizes& s) {
      return cairn::SquareRootGaussian<X>{state<X>(s.mean), square<cairn::CovarianceOf<X>>(s.p)};
    };
    check_filter("SquareRoot", cairn::SquareRoot{}, belief, linearised, sighted, root);
    check_filter("SquareRootUnscented", cairn::SquareRootUnscented{}, belief, propagated, looked, root);
    const auto informed = [](const Sizes& s) {
      return cairn::InformationBelief<X>{state<X>(s.mean), square<cairn::CovarianceOf<X>>(s.p),
                                         state<cairn::Tangent<X>>(s.vector)};
    };
    check_filter("InformationFilter", cairn::InformationFilter{}, belief | vector, linearised, sighted,
                 informed);
    const auto root_informed = [](const Sizes& s) {
      return cairn::SquareRootInformation<X>{state<X>(s.mean), square<cairn::CovarianceOf<X>>(s.p),
                                             state<cairn::Tangent<X>>(s.vector)};
    };
    check_filter("SquareRootInformationFilter", cairn::SquareRootInformationFilter{}, belief | vector,
                 linearised, sighted, root_informed);
    if constexpr (fixed_state && fixed_measurement)
      check_filter("UDFilter", cairn::UDFilter{}, 0, linearised, sighted, [](const Sizes&) {
        return cairn::UDGaussian<X>{state<X>(3), cairn::CovarianceOf<X>::Identity(), X::Ones()};
      });
    const cairn::KalmanBucy bucy{.steps = 2};
    check("KalmanBucy, predict", belief | linearised, gaussian<X>,
          [&](auto& b, const Sizes& s) { return bucy.predict(b, F{s}, 0.1, u); });
    check("KalmanBucy, filter", belief | linearised | sighted, gaussian<X>,
          [&](auto& b, const Sizes& s) { return bucy.filter(b, F{s}, H{s}, seen_as(s), 0.1, u); });
    check("KalmanBucy, information", belief | vector | linearised | sighted, informed,
          [&](auto& b, const Sizes& s) { return bucy.filter(b, F{s}, H{s}, seen_as(s), 0.1, u); });
  }

  static void sampling_filters() {
    const auto states = [](const Sizes& s) {
      std::vector<X> all;
      for (int i = 0; i < 6; ++i) all.push_back(state<X>(i == 4 ? s.odd_one : s.mean, 0.1 * i * i));
      return all;
    };
    cairn::Random random(1);
    const auto ensemble = [&](const Sizes& s) { return cairn::Ensemble<X>{states(s)}; };
    const cairn::EnsembleKalman kalman;
    check("EnsembleKalman, predict", odd_one | propagated, ensemble,
          [&](auto& b, const Sizes& s) { return kalman.predict(b, F{s}, 0.1, random, u); });
    check("EnsembleKalman, driven predict", odd_one | propagated, ensemble, [&](auto& b, const Sizes& s) {
      return kalman.predict(b, SizedDrivenProcess<X>{{s}}, 0.1, random, u);
    });
    check("EnsembleKalman, update", odd_one | looked, ensemble,
          [&](auto& b, const Sizes& s) { return kalman.update(b, H{s}, seen_as(s), random); });
    const auto particles = [&](const Sizes& s) { return cairn::Particles<X>::equal(states(s)); };
    const cairn::ParticleFilter filter;
    check("ParticleFilter, predict", odd_one | propagated, particles,
          [&](auto& b, const Sizes& s) { return filter.predict(b, F{s}, 0.1, random, u); });
    check("ParticleFilter, update", odd_one | looked, particles,
          [&](auto& b, const Sizes& s) { return filter.update(b, H{s}, seen_as(s), random); });
    const auto conditional = [&](const Sizes& s) {
      cairn::ConditionalParticles<X, X> belief;
      for (const X& x : states({})) belief.states.push_back({x, {gaussian<X>(s), gaussian<X>(s)}});
      belief.log_weights.assign(belief.states.size(), -std::log(6.0));
      return belief;
    };
    const cairn::RaoBlackwell blackwell;
    check("RaoBlackwell, predict", propagated, conditional,
          [&](auto& b, const Sizes& s) { return blackwell.predict(b, F{s}, 0.1, random, u); });
    check("RaoBlackwell, update", belief | sighted, conditional,
          [&](auto& b, const Sizes& s) { return blackwell.update(b, 1, H{s}, seen_as(s), random); });
    const auto modes = [](const Sizes& s) {
      cairn::ModeBelief<X, 2> belief{{gaussian<X>(s), gaussian<X>({})}, {0.5, 0.5}};
      if constexpr (!fixed_state) {
        if (s.odd_one != 3) belief.modes[1] = {state<X>(s.odd_one), matrix({s.odd_one, s.odd_one}, 1.0)};
        if (s.mean == 0 && s.p.rows == 0) belief.modes[1] = belief.modes[0];
      }
      return belief;
    };
    const cairn::Interacting<2, cairn::Kalman> interacting{{}, {{{0.9, 0.1}, {0.1, 0.9}}}};
    check("Interacting, predict", belief | odd_one | linearised, modes,
          [&](auto& b, const Sizes& s) { return interacting.predict(b, std::tuple(F{s}, F{{}}), 0.1, u); });
    check("Interacting, update", belief | odd_one | sighted, modes,
          [&](auto& b, const Sizes& s) { return interacting.update(b, H{s}, seen_as(s)); });
  }

  static void records() {
    const auto smooth = [&](const char* name, const auto& filter, unsigned predict, unsigned update) {
      check(std::string(name) + ", predict", belief | predict, gaussian<X>, [&](auto& b, const Sizes& s) {
        cairn::Recorder recorder(filter, b);
        const Status status = recorder.predict(F{s}, 0.1, u);
        CHECK(recorder.steps().size() == (status == Status::accepted ? 1 : 0));
        CHECK(recorder.smoothed().size() == recorder.steps().size() + 1);
        b = recorder.belief();
        return status;
      });
      check(std::string(name) + ", update", belief | update, gaussian<X>, [&](auto& b, const Sizes& s) {
        cairn::Recorder recorder(filter, b);
        const Status status = recorder.update(H{s}, seen_as(s)).status;
        b = recorder.belief();
        return status;
      });
    };
    smooth("Recorder of Kalman", cairn::Kalman{}, linearised, sighted);
    smooth("Recorder of Unscented", cairn::Unscented{}, propagated, looked);
    check("Timeline", belief | linearised | sighted, gaussian<X>, [&](auto& b, const Sizes& s) {
      cairn::Timeline<cairn::Extended, F, H> timeline(cairn::Extended{}, F{s}, b, 0.0, u, 1.0);
      const Status status = timeline.measure(H{s}, seen_as(s), 0.1).status;
      CHECK(timeline.size() == (status == Status::accepted ? 1 : 0));
      b = timeline.belief();
      return status;
    });
    check("fit_noise", belief | linearised | (fixed_measurement ? h | r | seen : sighted), gaussian<X>,
          [&](auto& b, const Sizes& s) {
            cairn::NoiseRecord<F, H> record{b, state<Z>(s.z), {}};
            for (int k = 0; k < 3; ++k) record.steps.push_back({u, 0.1, state<Z>(s.z, 0.1 * k)});
            const Status status = cairn::fit_noise(record, F{s}, H{s}, {.rounds = 2}).status;
            return status == Status::not_converged ? Status::accepted : status;
          });
  }
};

TEST_SUITE("sizes") {
  TEST_CASE("sizes: Gaussian filters refuse run-time sizes that do not fit") {
    Table<Vector<d>, Vector<d>>::gaussian_filters();
    Table<Vector<3>, Vector<2>>::gaussian_filters();
    Table<Vector<d>, Vector<2>>::kalman();
    Table<Vector<3>, Vector<d>>::kalman();
  }
  TEST_CASE("sizes: factored and continuous filters refuse run-time sizes that do not fit") {
    Table<Vector<d>, Vector<d>>::factored_filters();
    Table<Vector<3>, Vector<2>>::factored_filters();
  }
  TEST_CASE("sizes: ensembles, particles and modes refuse run-time sizes that do not fit") {
    Table<Vector<d>, Vector<d>>::sampling_filters();
    Table<Vector<3>, Vector<2>>::sampling_filters();
  }
  TEST_CASE("sizes: recorders, timelines and noise fits refuse run-time sizes that do not fit") {
    Table<Vector<d>, Vector<d>>::records();
    Table<Vector<3>, Vector<2>>::records();
  }

  // Whatever filter meets them: those that ask for the Jacobian first, and those that never do.
  enum class Filters { two, all };
  template <Filters Which = Filters::all, class Process, class U>
  void refused(const Process& process, const U& u) {
    using X = typename Process::State;
    const auto check = [&](const auto& filter, auto belief) {
      const auto before = belief;
      CHECK(filter.predict(belief, process, 0.1, u) == Status::size_mismatch);
      CHECK(same(belief, before));
    };
    const Gaussian<X> prior = gaussian<X>({});
    check(cairn::Kalman{}, prior);
    check(cairn::Unscented{}, prior);
    if constexpr (Which == Filters::all) {
      check(cairn::AugmentedUnscented{}, prior);
      check(cairn::SquareRoot{}, cairn::SquareRootGaussian<X>::from(prior));
      check(cairn::SquareRootUnscented{}, cairn::SquareRootGaussian<X>::from(prior));
      check(cairn::InformationFilter{}, *cairn::InformationBelief<X>::from(prior));
      cairn::Random random(1);
      cairn::Ensemble<X> ensemble{{prior.mean, prior.mean}};
      CHECK(cairn::EnsembleKalman{}.predict(ensemble, process, 0.1, random, u) == Status::size_mismatch);
      auto particles = cairn::Particles<X>::equal({prior.mean, prior.mean});
      CHECK(cairn::ParticleFilter{}.predict(particles, process, 0.1, random, u) == Status::size_mismatch);
    }
  }
  template <Filters Which = Filters::all, class Sensor>
  void refused(const Sensor& sensor) {
    using X = typename Sensor::State;
    const Vector<d> z = Vector<d>::Ones(2);
    const auto check = [&](const auto& filter, auto belief) {
      const auto before = belief;
      CHECK(status_of(filter.update(belief, sensor, z)) == Status::size_mismatch);
      CHECK(same(belief, before));
    };
    const Gaussian<X> prior = gaussian<X>({});
    check(cairn::Kalman{}, prior);
    check(cairn::Unscented{}, prior);
    if constexpr (Which == Filters::all) {
      check(cairn::AugmentedUnscented{}, prior);
      check(cairn::SquareRoot{}, cairn::SquareRootGaussian<X>::from(prior));
      check(cairn::SquareRootUnscented{}, cairn::SquareRootGaussian<X>::from(prior));
      check(cairn::InformationFilter{}, *cairn::InformationBelief<X>::from(prior));
      cairn::Random random(1);
      cairn::Ensemble<X> ensemble{{prior.mean, prior.mean}};
      CHECK(cairn::EnsembleKalman{}.update(ensemble, sensor, z, random).status == Status::size_mismatch);
      auto particles = cairn::Particles<X>::equal({prior.mean, prior.mean});
      CHECK(cairn::ParticleFilter{}.update(particles, sensor, z, random) == Status::size_mismatch);
    }
  }

  TEST_CASE(
      "linear models: matrices of run-time size that fit neither one another nor the state are refused") {
    const cairn::NoControl none;
    const Matrix<d> i2 = matrix({2, 2}, 1.0), i3 = matrix({3, 3}, 1.0), i4 = matrix({4, 4}, 1.0);
    const Vector<d> u = Vector<d>::Ones(1);
    using Model = cairn::LinearModel<d>;
    for (const Model& model : {Model{i2, i3, {}}, Model{i4, i3, {}}, Model{matrix({3, 2}, 1.0), i3, {}},
                               Model{matrix({2, 3}, 1.0), i3, {}}, Model{i3, i2, {}},
                               Model{i3, i3, Vector<d>::Zero(2)}, Model{i3, i3, Vector<d>::Zero(4)}, Model{}})
      refused(model, none);
    using Steered = cairn::ControlledLinearModel<d, d>;
    for (const Steered& model :
         {Steered{i3, matrix({3, 2}, 1.0), i3}, Steered{i3, matrix({2, 1}, 1.0), i3},
          Steered{i3, matrix({4, 1}, 1.0), i3}, Steered{i3, {}, i3}, Steered{i2, matrix({2, 1}, 1.0), i3}})
      refused(model, u);
    refused<Filters::two>(cairn::ControlledLinearModel<3, d>{i3, matrix({3, 2}, 1.0), i3}, u);
    refused<Filters::two>(cairn::ControlledLinearModel<d, 1>{i3, Vector<d>::Ones(4), i3}, u);
    refused<Filters::two>(cairn::ControlledLinearModel<3, 1>{i3, Vector<3>::Ones(), i3},
                          Vector<d>(Vector<2>::Ones()));

    const Matrix<d> h = matrix({2, 3}, 1.0);
    using Sensor = cairn::LinearSensor<d, d>;
    for (const Sensor& sensor :
         {Sensor{matrix({2, 4}, 1.0), i2, {}}, Sensor{matrix({2, 2}, 1.0), i2, {}}, Sensor{i3, i2, {}},
          Sensor{matrix({1, 3}, 1.0), i2, {}}, Sensor{h, matrix({1, 1}, 1.0), {}}, Sensor{h, i3, {}},
          Sensor{h, i2, Vector<d>::Zero(1)}, Sensor{h, i2, Vector<d>::Zero(3)}, Sensor{}})
      refused(sensor);
    refused<Filters::two>(cairn::LinearSensor<2, d>{matrix({2, 4}, 1.0), i2});
    refused<Filters::two>(cairn::LinearSensor<d, 3>{i3, i2, {}});
    refused<Filters::two>(
        cairn::LinearSensor<1, 3>{Matrix<1, 3>::Ones(), Matrix<1>::Ones()});  // z has two numbers
  }

  TEST_CASE(
      "foreign states: a state or measurement of another run-time size is refused before it is compared") {
    using cairn_test::Readings;
    struct Still {
      using State = Readings;
      using Control = cairn::NoControl;
      std::size_t size;
      [[nodiscard]] Readings propagate(const Readings& x, const Control&, double) const {
        return Readings{std::vector<double>(size, x.values.at(0))};
      }
      [[nodiscard]] Matrix<d> jacobian(const Readings&, const Control&, double) const {
        return matrix({3, 3}, 1.0);
      }
      [[nodiscard]] Matrix<d> noise(const Readings&, const Control&, double) const {
        return matrix({3, 3}, 0.1);
      }
    };
    struct Copy {
      using State = Readings;
      using Measurement = Readings;
      std::size_t size;
      [[nodiscard]] Readings predict(const Readings& x) const {
        return Readings{std::vector<double>(size, x.values.at(0))};
      }
      [[nodiscard]] Matrix<d> jacobian(const Readings&) const { return matrix({3, 3}, 1.0); }
      [[nodiscard]] Matrix<d> noise(const Readings&) const { return matrix({3, 3}, 0.5); }
    };
    const Readings three{{1, 2, 3}}, two{{1, 2}};
    const Gaussian<Readings> prior{three, matrix({3, 3}, 1.0)};
    const auto check = [&](const auto& filter, const auto& before, const auto& mean) {
      auto b = before;
      CHECK(filter.predict(b, Still{3}, 0.1) == Status::accepted);
      CHECK(status_of(filter.update(b, Copy{3}, three)) == Status::accepted);
      b = before;
      for (const std::size_t other : {2U, 4U}) {
        CHECK(filter.predict(b, Still{other}, 0.1) == Status::size_mismatch);
        CHECK(status_of(filter.update(b, Copy{other}, three)) == Status::size_mismatch);
      }
      CHECK(status_of(filter.update(b, Copy{2}, two)) == Status::size_mismatch);
      CHECK(mean(b).values == three.values);
    };
    const auto mean = [](const auto& b) { return b.mean; };
    check(cairn::Extended{}, prior, mean);
    check(cairn::Unscented{}, prior, mean);
    check(cairn::AugmentedUnscented{}, prior, mean);
    const auto root = cairn::SquareRootGaussian<Readings>::from(prior);
    check(cairn::SquareRoot{}, root, mean);
    check(cairn::SquareRootUnscented{}, root, mean);
    check(cairn::InformationFilter{}, *cairn::InformationBelief<Readings>::from(prior),
          [](const auto& b) { return b.point; });
    check(cairn::SquareRootInformationFilter{}, *cairn::SquareRootInformation<Readings>::from(prior),
          [](const auto& b) { return b.point; });
    Gaussian<Readings> short_one{two, matrix({3, 3}, 1.0)};
    CHECK(cairn::Extended{}.predict(short_one, Still{3}, 0.1) == Status::size_mismatch);
  }

  TEST_CASE("sizes: what has no status to return says so as its header promises") {
    const auto previous = cairn::set_violation_handler(
        [](const cairn::Violation& violation) { throw std::logic_error(violation.sentence); });
    using X = Vector<d>;
    const Gaussian<X> good = gaussian<X>({}), odd{X::Ones(3), matrix({2, 2}, 1.0)},
                      skew{X::Ones(3), matrix({3, 2}, 1.0)}, two{X::Ones(2), matrix({2, 2}, 1.0)};
    cairn::Random random(1);
    for (const auto& bad : {odd, skew}) {
      CHECK_THROWS_AS(static_cast<void>(cairn::sample(bad, random)), std::logic_error);
      CHECK_THROWS_AS(static_cast<void>(cairn::nees(bad, good.mean)), std::logic_error);
      CHECK_THROWS_AS(static_cast<void>(cairn::SquareRootGaussian<X>::from(bad)), std::logic_error);
      CHECK_THROWS_AS(static_cast<void>(cairn::unscented_transform(bad, [](const X& x) { return x; })),
                      std::logic_error);
      CHECK_FALSE(cairn::InformationBelief<X>::from(bad).has_value());
      CHECK_FALSE(cairn::SquareRootInformation<X>::from(bad).has_value());
      CHECK_FALSE(cairn::InformationBelief<X>{bad.mean, bad.covariance, X::Zero(3)}.gaussian().has_value());
      CHECK_FALSE(
          cairn::SquareRootInformation<X>{bad.mean, bad.covariance, X::Zero(3)}.gaussian().has_value());
      CHECK_THROWS_AS(static_cast<void>(Gaussian<X>::checked(bad.mean, bad.covariance)), cairn::Error);
      CHECK_THROWS_AS(
          static_cast<void>(cairn::smooth_back({good, bad, matrix({3, 3}, 1.0), good.covariance}, good)),
          std::logic_error);
    }
    CHECK_THROWS_AS(static_cast<void>(cairn::nees(good, two.mean)), std::logic_error);
    const Matrix<d> square = matrix({3, 3}, 1.0), oblong = matrix({3, 2}, 1.0);
    CHECK_THROWS_AS(static_cast<void>(cairn::smooth_back({good, good, oblong, square}, good)),
                    std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(cairn::smooth_back({good, good, square, oblong}, good)),
                    std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(cairn::smooth_back({good, good, square, square}, two)),
                    std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(cairn::ModeBelief<X, 2>{{good, two}, {0.5, 0.5}}.combined()),
                    std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(cairn::Ensemble<X>{{good.mean, two.mean}}.gaussian()),
                    std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(cairn::moments(cairn::Particles<X>::equal({good.mean, two.mean}))),
                    std::logic_error);
    const cairn::LinearSensor<d, d> sensor{matrix({2, 3}, 1.0), matrix({2, 2}, 1.0), {}};
    const X z = X::Ones(2);
    CHECK_THROWS_AS(static_cast<void>(cairn::adapted_noise(matrix({3, 3}, 1.0), good, sensor, z, 0.1)),
                    std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(cairn::adapted_noise(matrix({2, 2}, 1.0), two, sensor, z, 0.1)),
                    std::logic_error);
    CHECK_THROWS_AS(
        static_cast<void>(cairn::adapted_noise(matrix({2, 2}, 1.0), good, sensor, X::Ones(3), 0.1)),
        std::logic_error);
    cairn::Innovation<d> innovation;
    innovation.residual = z;
    innovation.covariance = matrix({2, 2}, 1.0);
    CHECK_THROWS_AS(static_cast<void>(cairn::innovated_noise(matrix({3, 3}, 1.0), innovation, 0.1)),
                    std::logic_error);
    cairn::set_violation_handler(previous);

    // a fixed state from numbers of run-time size
    CHECK_THROWS_WITH_AS(
        static_cast<void>(Gaussian<Vector<3>>::checked(X::Ones(2), matrix({3, 3}, 1.0))),
        "Gaussian: expected a mean and a square covariance of the size of the state; found 2 numbers, 3 x 3",
        cairn::Error);
    CHECK_THROWS_AS(static_cast<void>(Gaussian<Vector<3>>::checked(X::Ones(3), matrix({3, 2}, 1.0))),
                    cairn::Error);
    CHECK(Gaussian<Vector<3>>::checked(X::Ones(3), matrix({3, 3}, 2.0)).covariance(1, 1) == 2.0);

    Gaussian<X> constrained = good;
    for (const Shape s : {Shape{1, 2}, Shape{1, 4}, Shape{2, 3}, Shape{0, 3}, Shape{0, 0}})
      CHECK(cairn::constrain(constrained, matrix(s, 1.0), X(X::Ones(1))) == Status::size_mismatch);
    CHECK(cairn::constrain(constrained, Matrix<1, 3>(Matrix<1, 3>::Ones()), X(X::Ones(2))) ==
          Status::size_mismatch);
    Gaussian<X> unfit = odd;
    CHECK(cairn::constrain(unfit, matrix({1, 3}, 1.0), X(X::Ones(1))) == Status::size_mismatch);
    CHECK(same(constrained, good));
    CHECK(cairn::constrain(constrained, matrix({1, 3}, 1.0), X(X::Ones(1))) == Status::accepted);

    const Matrix<d> f = matrix({3, 3}, 0.9), h = matrix({2, 3}, 1.0), q = matrix({3, 3}, 1.0),
                    r = matrix({2, 2}, 1.0);
    CHECK(cairn::steady_state(f, h, q, r).accepted());
    CHECK(cairn::steady_state(Matrix<3>(f), h, q, Matrix<2>(r)).accepted());
    CHECK_FALSE(cairn::steady_state(f, Matrix<d>(h.transpose()), q, r).accepted());
    CHECK_FALSE(cairn::steady_state(f, h, r, r).accepted());
    CHECK_FALSE(cairn::steady_state(f, h, q, q).accepted());
    CHECK_FALSE(cairn::steady_state(r, h, q, r).accepted());
    CHECK_FALSE(cairn::steady_state(Matrix<3>(f), h, r, r).accepted());
    CHECK_FALSE(cairn::steady_state(Matrix<d>(), Matrix<d>(), Matrix<d>(), Matrix<d>()).accepted());

    cairn::GaussianBatch<3> batch(2, {Vector<3>::Ones(), Matrix<3>::Identity()});
    CHECK(cairn::BatchKalman{}.predict(batch, r, q) == Status::size_mismatch);
    CHECK(cairn::BatchKalman{}.predict(batch, f, r) == Status::size_mismatch);
    CHECK(cairn::BatchKalman{}.drift(batch, h) == Status::size_mismatch);
    CHECK(batch.get(1).covariance == Matrix<3>::Identity());
  }

  TEST_CASE("particles: a list of weights of another length is refused") {
    cairn::Random random(1);
    cairn::Particles<Vector<1>> belief = cairn::Particles<Vector<1>>::equal({Vector<1>(1.0), Vector<1>(2.0)});
    belief.log_weights.pop_back();
    const std::vector<double> likelihoods{0.0, 0.0};
    CHECK(belief.reweigh(likelihoods) == Status::size_mismatch);
    CHECK(cairn::ParticleFilter{}.update_with(belief, likelihoods, random) == Status::size_mismatch);
    CHECK(cairn::resample_by_kld(
              belief, {}, [](const Vector<1>& x) { return x(0); }, random) == Status::size_mismatch);
    CHECK(belief.states.size() == 2);
  }

  TEST_CASE("timeline: a control of a size that the process does not take is refused when it comes") {
    using X = Vector<d>;
    using Steered = cairn::ControlledLinearModel<d, d>;
    using Sensor = cairn::LinearSensor<d, d>;
    const Steered process{matrix({3, 3}, 1.0), matrix({3, 1}, 1.0), matrix({3, 3}, 0.1)};
    const Sensor sensor{matrix({2, 3}, 1.0), matrix({2, 2}, 1.0), {}};
    cairn::Timeline<cairn::Kalman, Steered, Sensor> timeline(cairn::Kalman{}, process, gaussian<X>({}), 0.0,
                                                             X::Ones(1), 10.0);
    CHECK(timeline.steer(X::Ones(2), 0.5) == Status::size_mismatch);
    CHECK(timeline.steer(X::Zero(1), 0.5) == Status::accepted);
    CHECK(timeline.measure(sensor, X::Ones(2), 1.0).accepted());
    CHECK(timeline.measure(sensor, X::Ones(3), 1.5).status == Status::size_mismatch);
    CHECK(timeline.size() == 2);
  }
}

}  // namespace
}  // namespace sizes_test
