// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Random programs of everything a growing state can do, beside one dense covariance (dense_joint.hpp).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/joint_extended.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "filter/dense_joint.hpp"
#include "filter/linear_problems.hpp"
#include "filter/planar_slam.hpp"
#include "support/random.hpp"

namespace joint_programs_test {
namespace {

using cairn::AnyBlockId;
using cairn::BlockId;
using cairn::Form;
using cairn::JointExtended;
using cairn::JointGaussian;
using cairn::Matrix;
using cairn::SE2;
using cairn::Status;
using cairn::Vector;
using cairn_test::Dense;
using cairn_test::DenseJoint;

using Belief = JointGaussian<SE2, Vector<2>, Vector<1>>;

/// Whether no number follows from the others: elsewhere a step may contradict itself, and what it says of the
/// rest depends on rounding.
bool independent(const Matrix<cairn::dynamic>& covariance) {
  Matrix<cairn::dynamic> left = covariance;
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    if (!(left(k, k) > 1e-9 * covariance(k, k))) return false;
    for (Eigen::Index i = k + 1; i < left.rows(); ++i)
      for (Eigen::Index j = k + 1; j < left.rows(); ++j) left(i, j) -= left(i, k) * left(k, j) / left(k, k);
  }
  return true;
}

/// The belief, the oracle, and what the two call the same block.
struct Program {
  explicit Program(std::uint64_t seed, const JointExtended& options) : random(seed), filter(options) {
    add_pose();
    add_landmark();
    add_bias();
  }

  cairn::Random random;
  JointExtended filter;
  Belief belief;
  DenseJoint dense;
  std::vector<AnyBlockId> ids;  // in the oracle's order
  std::vector<int> twin;        // clones that have not moved since share a number
  std::vector<bool> exact;      // known without doubt
  int next_twin = 0;
  int steps[16] = {};

  [[nodiscard]] int count() const { return static_cast<int>(ids.size()); }
  template <class X>
  [[nodiscard]] std::vector<int> all() const {
    std::vector<int> found;
    for (int i = 0; i < count(); ++i)
      if (belief.as<X>(ids[static_cast<std::size_t>(i)])) found.push_back(i);
    return found;
  }
  template <class X>
  [[nodiscard]] int any() {
    const auto of_kind = all<X>();
    return of_kind.empty() ? -1 : of_kind[random.below(of_kind.size())];
  }
  template <class X>
  [[nodiscard]] BlockId<X> id(int i) const {
    return *belief.as<X>(ids[static_cast<std::size_t>(i)]);
  }
  void enlist(AnyBlockId added, int same = -1) {
    ids.push_back(added);
    twin.push_back(same < 0 ? next_twin++ : twin[static_cast<std::size_t>(same)]);
    exact.push_back(same >= 0 && exact[static_cast<std::size_t>(same)]);
  }

  void add_pose() {
    const SE2 mean(random.normal(), random.normal(), random.normal());
    const Matrix<3> p = 0.05 * cairn_test::random_covariance<3>(random);
    const auto added = belief.add(mean, p);
    REQUIRE(added.accepted());
    dense.extend(mean, Dense(3, dense.size()), Dense(p));
    enlist(added.id);
  }
  void add_landmark() {
    const Vector<2> mean(random.uniform(3, 9), random.uniform(-5, 5));
    const Matrix<2> p = cairn_test::random_covariance<2>(random);
    const auto added = belief.add(mean, p);
    REQUIRE(added.accepted());
    dense.extend(mean, Dense(2, dense.size()), Dense(p));
    enlist(added.id);
  }
  void add_bias() {
    const auto added = belief.add(Vector<1>(random.normal()), Matrix<1>(random.uniform(0.0, 0.3)));
    REQUIRE(added.accepted());
    dense.extend(belief.mean(added.id), Dense(1, dense.size()), Dense(belief.covariance(added.id)));
    enlist(added.id);
  }
  template <class G, class... X>
  void augment(const G& model, const typename G::Measurement& z, const std::vector<int>& named,
               BlockId<X>... known) {
    const auto x = cairn::detail::StateOfBlocks<X...>::of(belief.mean(known)...);
    const Dense g = dense.spread(Dense(model.jacobian(x, z)), named), q(model.noise(x, z));
    const auto mean = model.initialise(x, z);
    const auto added = belief.augment(model, z, known...);
    REQUIRE(added.accepted());
    dense.extend(mean, g, q);
    enlist(added.id);
  }
  void clone() {
    const int i = static_cast<int>(random.below(ids.size()));
    const auto clone_of = [&]<class X>(BlockId<X> original) {
      const auto added = belief.clone(original);
      REQUIRE(added.accepted());
      dense.extend(belief.mean(original), dense.spread(Dense::identity(cairn::dof<X>), {i}),
                   Dense(cairn::dof<X>, cairn::dof<X>));
      enlist(added.id, i);
    };
    if (const auto pose = belief.as<SE2>(ids[static_cast<std::size_t>(i)])) return clone_of(*pose);
    if (const auto landmark = belief.as<Vector<2>>(ids[static_cast<std::size_t>(i)]))
      return clone_of(*landmark);
    clone_of(id<Vector<1>>(i));
  }

  template <class F, class... X>
  void predict(const F& process, const typename F::Control& u, double dt, const std::vector<int>& named,
               BlockId<X>... moving) {
    const auto x = cairn::detail::StateOfBlocks<X...>::of(belief.mean(moving)...);
    constexpr int n = cairn::dof<typename F::State>;
    Matrix<n> f = cairn::detail::dense_of(process.jacobian(x, u, dt));
    f *= std::sqrt(filter.fading);
    Matrix<n> q = cairn::detail::dense_of(process.noise(x, u, dt));
    q.diagonal().array() += filter.stabilising_noise;
    const auto moved = process.propagate(x, u, dt);
    REQUIRE(filter.predict(belief, process, dt, u, moving...) == Status::accepted);
    dense.transform(Dense(f), Dense(q), named);
    if constexpr (sizeof...(X) == 1) {
      dense.blocks[static_cast<std::size_t>(named[0])].mean = moved;
    } else {
      dense.blocks[static_cast<std::size_t>(named[0])].mean = moved.template part<0>();
      dense.blocks[static_cast<std::size_t>(named[1])].mean = moved.template part<1>();
    }
    for (const int i : named) {
      twin[static_cast<std::size_t>(i)] = next_twin++;
      exact[static_cast<std::size_t>(i)] = false;
    }
  }

  template <class Z>
  [[nodiscard]] Z noisy(const Z& z, double sigma) {
    cairn::Tangent<Z> d;
    for (int i = 0; i < cairn::dof<Z>; ++i) d(i) = sigma * random.normal();
    return cairn::retract(z, d);
  }
  template <class H, class... X>
  void update(const H& sensor, const std::vector<int>& named, BlockId<X>... seen) {
    const auto x = cairn::detail::StateOfBlocks<X...>::of(belief.mean(seen)...);
    const auto z = noisy(typename H::Measurement(sensor.predict(x)), 0.05);
    const Dense h = dense.spread(Dense(cairn::detail::dense_of(sensor.jacobian(x))), named);
    const Dense r(cairn::detail::dense_of(sensor.noise(x)));
    const Dense residual(cairn::local(typename H::Measurement(sensor.predict(x)), z));
    const auto in_advance = filter.innovation(belief, sensor, z, seen...);
    const auto in = filter.update(belief, sensor, z, seen...);
    REQUIRE(in.accepted());
    const Dense s = h * dense.p * h.transposed() + r;
    const Dense nis = residual.transposed() * s.inverse() * residual;
    CHECK(in.nis == doctest::Approx(static_cast<double>(nis(0, 0))).epsilon(1e-9));
    CHECK(in_advance.nis == doctest::Approx(in.nis).epsilon(1e-9));
    CHECK(cairn_test::largest_difference(in.covariance, in_advance.covariance) <=
          1e-12 * in.covariance.norm());
    dense.update(h, r, residual);
  }
  void stack() {
    cairn::StackedMeasurement<> stack;
    const int rows = 2 * static_cast<int>(2 + random.below(6));
    Dense h(rows, dense.size()), r(rows, rows), residual(rows, 1);
    for (int row = 0; row < rows; row += 2) {
      const int pose = any<SE2>(), landmark = any<Vector<2>>();
      const cairn_test::Sighting sensor{.range_sigma = 0.3};
      const cairn_test::Sighting::State x(belief.mean(id<SE2>(pose)), belief.mean(id<Vector<2>>(landmark)));
      const auto z = noisy(sensor.predict(x), 0.05);
      REQUIRE(stack.add(belief, sensor, z, id<SE2>(pose), id<Vector<2>>(landmark)) == Status::accepted);
      const Dense part = dense.spread(Dense(sensor.jacobian(x)), {pose, landmark});
      const Matrix<2> noise = sensor.noise(x);
      const Vector<2> d = cairn::local(sensor.predict(x), z);
      for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < dense.size(); ++j) h(row + i, j) = part(i, j);
        r(row + i, row + i) = noise(i, i);
        residual(row + i, 0) = d(i);
      }
    }
    REQUIRE(filter.update(belief, stack).accepted());
    dense.update(h, r, residual);
  }

  void marginalise() {
    if (count() < 4) return;
    const int i = static_cast<int>(random.below(ids.size()));
    const AnyBlockId gone = ids[static_cast<std::size_t>(i)];
    REQUIRE(belief.marginalise(gone) == Status::accepted);
    CHECK(belief.marginalise(gone) == Status::unknown_block);
    dense.remove(i);
    ids.erase(ids.begin() + i);
    twin.erase(twin.begin() + i);
    exact.erase(exact.begin() + i);
  }
  void condition() {
    const int i = any<Vector<2>>();
    if (i < 0 || exact[static_cast<std::size_t>(i)]) return;
    const Vector<2> value = belief.mean(id<Vector<2>>(i)) + 0.1 * Vector<2>(random.normal(), random.normal());
    const Vector<2> step = value - belief.mean(id<Vector<2>>(i));
    const auto in = belief.condition(id<Vector<2>>(i), value);
    REQUIRE(in.accepted());
    dense.commit({i}, Dense(step), Dense(2, 2));
    for (int k = 0; k < count(); ++k)
      if (twin[static_cast<std::size_t>(k)] == twin[static_cast<std::size_t>(i)] &&
          (k == i || !belief.considered(ids[static_cast<std::size_t>(k)])))
        exact[static_cast<std::size_t>(k)] = true;
  }
  void commit() {
    std::vector<int> named;
    for (int i = 0; i < count(); ++i) {
      bool fits = !exact[static_cast<std::size_t>(i)] && random.below(3) == 0;
      for (const int k : named)
        fits = fits && twin[static_cast<std::size_t>(k)] != twin[static_cast<std::size_t>(i)];
      if (fits) named.push_back(i);
    }
    if (named.empty()) return;
    std::reverse(named.begin(), named.end());  // any order
    std::vector<AnyBlockId> blocks;
    for (const int i : named) blocks.push_back(ids[static_cast<std::size_t>(i)]);
    const Matrix<cairn::dynamic> prior = belief.covariance(blocks);
    const int d = static_cast<int>(prior.rows());
    if (!independent(prior)) return;
    bool beside_considered = false;
    for (int i = 0; i < count(); ++i)
      beside_considered = beside_considered || (belief.considered(ids[static_cast<std::size_t>(i)]) &&
                                                std::ranges::find(named, i) == named.end());
    // a share of the prior, and a little; not more than it where others are considered
    const double share = random.uniform(0.3, beside_considered ? 1.0 : 1.2);
    Matrix<cairn::dynamic> posterior = share * prior;
    for (int k = 0; k < d && !beside_considered; ++k) posterior(k, k) += 0.01 * prior(k, k);
    Vector<cairn::dynamic> step(d);
    for (int k = 0; k < d; ++k) step(k) = 0.2 * std::sqrt(prior(k, k)) * random.normal();
    if (random.below(2) == 0) {
      REQUIRE(belief.commit(blocks, step, posterior) == Status::accepted);
      dense.commit(named, Dense(step), Dense(posterior));
      return;
    }
    // with a new pose that is tied to them
    Matrix<3, cairn::dynamic> tie = Matrix<3, cairn::dynamic>::Zero(3, d);
    for (int k = 0; k < d; ++k) tie(static_cast<int>(random.below(3)), k) = random.normal();
    const Matrix<3> own = 0.02 * cairn_test::random_covariance<3>(random);
    Matrix<cairn::dynamic> joint(d + 3, d + 3);
    joint.topLeftCorner(d, d) = posterior;
    joint.bottomLeftCorner(3, d) = tie * posterior;
    joint.topRightCorner(d, 3) = (tie * posterior).transpose();
    joint.bottomRightCorner(3, 3) = tie * posterior * tie.transpose() + own;
    const SE2 mean(1, 2, 0.3);
    const auto added = belief.commit(blocks, step, joint, mean);
    REQUIRE(added.accepted());
    dense.commit(named, Dense(step), Dense(posterior));
    dense.extend(mean, dense.spread(Dense(tie), named), Dense(own));
    enlist(added.id);
  }
  void reorder() {
    std::vector<int> order(ids.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
    std::vector<AnyBlockId> next;
    std::vector<int> twins;
    std::vector<bool> known;
    for (const int i : order) {
      next.push_back(ids[static_cast<std::size_t>(i)]);
      twins.push_back(twin[static_cast<std::size_t>(i)]);
      known.push_back(exact[static_cast<std::size_t>(i)]);
    }
    REQUIRE(belief.reorder(next) == Status::accepted);
    dense.reorder(order);
    ids = next;
    twin = twins;
    exact = known;
  }
  void consider() {
    const std::size_t i = random.below(ids.size());
    const bool on = random.below(3) == 0;
    REQUIRE(belief.consider(ids[i], on) == Status::accepted);
    dense.blocks[i].considered = on;
  }

  void step() {
    if (all<SE2>().empty()) add_pose();
    if (all<Vector<2>>().empty()) add_landmark();
    if (all<Vector<1>>().empty()) add_bias();
    if (dense.size() > 60) return marginalise();
    const int pose = any<SE2>(), landmark = any<Vector<2>>(), bias = any<Vector<1>>();
    const int what = static_cast<int>(random.below(16));
    ++steps[what];
    CAPTURE(what);
    const Vector<2> u(random.normal(), 0.3 * random.normal());
    switch (what) {
      case 0:
        return random.below(2) == 0 ? add_landmark() : add_bias();
      case 1: {
        const auto z = cairn_test::Sighting::measurement(random.uniform(2, 8), random.uniform(-2, 2));
        return augment(cairn::inverted(cairn_test::Sighting{.range_sigma = 0.2}), z, {pose}, id<SE2>(pose));
      }
      case 2:
        return augment(cairn_test::Beside{}, Vector<2>(1, 2), {landmark, pose}, id<Vector<2>>(landmark),
                       id<SE2>(pose));
      case 3:
        return clone();
      case 4:
        return predict(cairn::Unicycle{}, u, 0.2, {pose}, id<SE2>(pose));
      case 5:
        return predict(cairn_test::Wander{}, {}, 0.5, {bias}, id<Vector<1>>(bias));
      case 6:
        return predict(cairn_test::ScaledDrive{}, u, 0.2, {pose, bias}, id<SE2>(pose), id<Vector<1>>(bias));
      case 7:
      case 8:
        return update(cairn_test::Sighting{.range_sigma = 0.3, .bearing_sigma = 0.1}, {pose, landmark},
                      id<SE2>(pose), id<Vector<2>>(landmark));
      case 9: {
        const int other = any<SE2>();
        return update(cairn_test::Passage{0.01 * Matrix<3>::Identity()}, {pose, other}, id<SE2>(pose),
                      id<SE2>(other));
      }
      case 10:
        return update(cairn_test::Biased{}, {landmark, bias}, id<Vector<2>>(landmark), id<Vector<1>>(bias));
      case 11: {
        const int other = any<Vector<2>>();
        return update(cairn_test::Blend{}, {landmark, other}, id<Vector<2>>(landmark), id<Vector<2>>(other));
      }
      case 12:
        return random.below(2) == 0 ? stack() : update(cairn::Compass{.sigma = 0.2}, {pose}, id<SE2>(pose));
      case 13:
        return random.below(2) == 0 ? marginalise() : condition();
      case 14:
        return commit();
      default:
        return random.below(2) == 0 ? reorder() : consider();
    }
  }

  /// Largest error of a covariance in units of the two deviations, and of a mean.
  [[nodiscard]] double difference() const {
    double worst = 0.0;
    const Matrix<cairn::dynamic> p = belief.covariance();
    REQUIRE(p.rows() == dense.size());
    REQUIRE(belief.dof() == dense.size());
    REQUIRE(belief.size() == count());
    for (int i = 0; i < dense.size(); ++i)
      for (int j = 0; j < dense.size(); ++j) {
        const double scale = static_cast<double>(std::sqrt(std::abs(dense.p(i, i) * dense.p(j, j))));
        const double error = std::abs(p(i, j) - static_cast<double>(dense.p(i, j)));
        if (!(error <= 1e-13)) worst = std::max(worst, std::isnan(error) ? 1e300 : error / scale);
      }
    for (int i = 0; i < count(); ++i) {
      CHECK(belief.blocks()[static_cast<std::size_t>(i)] == ids[static_cast<std::size_t>(i)]);
      const auto& theirs = dense.blocks[static_cast<std::size_t>(i)].mean;
      const auto compare = [&]<class X>(const X& mean) {
        worst = std::max(worst, cairn::local(mean, belief.mean(id<X>(i))).norm() /
                                    (1 + cairn::local(mean, X{mean}).norm()));
      };
      std::visit(compare, theirs);
    }
    return worst;
  }
};

void run(const JointExtended& filter, int programs, int length) {
  const auto first = cairn_test::seed();
  int steps[16] = {};
  double worst = 0.0;
  for (int k = 0; k < programs; ++k) {
    const auto seed = first + 1000 * static_cast<std::uint64_t>(k);
    CAPTURE(seed);
    Program program(seed, filter);
    for (int i = 0; i < length; ++i) {
      CAPTURE(i);
      program.step();
      const double difference = program.difference();
      REQUIRE(difference < 1e-9);
      worst = std::max(worst, difference);
    }
    for (int i = 0; i < 16; ++i) steps[i] += program.steps[i];
  }
  for (const int count : steps) CHECK(count > programs);
  MESSAGE("largest difference from the dense form: ", worst);
}

TEST_SUITE("joint_programs") {
  TEST_CASE("joint_gaussian: random programs give what one dense covariance gives") {
    run(JointExtended{}, 30, 120);
  }
  TEST_CASE("joint_gaussian: random programs in Joseph's form, fading, with stabilising noise") {
    run(JointExtended{.form = Form::joseph}, 15, 120);
    run(JointExtended{.fading = 1.05, .stabilising_noise = 1e-4}, 10, 120);
  }
}

}  // namespace
}  // namespace joint_programs_test
