// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/batch.hpp>
#include <cairn/filter/interacting.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/filter/rao_blackwell.hpp>
#include <cairn/models/linear.hpp>

#include "filter/linear_problems.hpp"
#include "support/random.hpp"

namespace sampling_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::NoControl;
using cairn::Resampling;
using cairn::Status;
using cairn::Vector;

TEST_SUITE("batch") {
  TEST_CASE_TEMPLATE("batch: every lane gives the Kalman filter's answer", S, double, float) {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    cairn::GaussianBatch<3, S> batch, seen;
    std::vector<Gaussian<Vector<3, S>>> singles;
    const double tolerance = std::is_same_v<S, double> ? 1e-13 : 1e-4;
    for (int i = 0; i < 53; ++i) {
      singles.push_back(
          {cairn_test::random_matrix<3, 1, S>(random), cairn_test::random_covariance<3, S>(random)});
      CHECK(batch.add(singles.back()) == static_cast<std::size_t>(i));
      seen.add({cairn_test::random_matrix<3, 1, S>(random), cairn_test::random_covariance<3, S>(random)});
    }
    const Matrix<3, 3, S> f = cairn_test::random_matrix<3, 3, S>(random);
    const Matrix<3, 3, S> q = cairn_test::random_covariance<3, S>(random);
    REQUIRE(cairn::BatchKalman{}.predict(batch, f, q) == Status::accepted);
    std::vector<std::uint8_t> kept(53);
    const std::size_t count = cairn::BatchKalman{.gate = 4.0}.update(batch, seen, kept);
    std::size_t expected = 0;
    for (std::size_t i = 0; i < singles.size(); ++i) {
      const cairn::LinearModel<3, S> process{f, q};
      const cairn::LinearSensor<3, 3, S> sensor{Matrix<3, 3, S>::Identity(), seen.get(i).covariance};
      REQUIRE(cairn::Kalman{}.predict(singles[i], process, 1.0) == Status::accepted);
      const bool accepted =
          cairn::Kalman{.gate = 4.0}.update(singles[i], sensor, seen.get(i).mean).accepted();
      expected += accepted ? 1 : 0;
      CHECK(accepted == (kept[i] == 1));
      CHECK(cairn_test::relative_error(batch.get(i).mean, singles[i].mean) < tolerance);
      CHECK(cairn_test::relative_error(batch.get(i).covariance, singles[i].covariance) < tolerance);
    }
    CHECK(count == expected);
    CHECK(count > 0);
    CHECK(count < 53);
  }

  TEST_CASE(
      "batch: a lane whose noise is no covariance stays as it was, also where S and its variances are "
      "sound") {
    const Gaussian<Vector<3>> prior{Vector<3>(1, 2, 3), 10 * Matrix<3>::Identity()};
    Matrix<3> indefinite = Matrix<3>::Identity();
    indefinite(0, 2) = indefinite(2, 0) = 2;  // its variances of -1 and 3 leave -1.1 and 2.3
    Matrix<3> infinite = Matrix<3>::Identity();
    infinite(1, 1) = INFINITY;
    cairn::GaussianBatch<3> batch(20, prior);
    cairn::GaussianBatch<3> seen(20, {Vector<3>(2, 2, 2), Matrix<3>::Identity()});
    seen.set(4, {Vector<3>(2, 2, 2), indefinite});
    seen.set(11, {Vector<3>(2, 2, 2), infinite});
    std::vector<std::uint8_t> kept(20);
    CHECK(cairn::BatchKalman{}.update(batch, seen, kept) == 18);
    for (std::size_t i = 0; i < 20; ++i) {
      CHECK((kept[i] == 0) == (i == 4 || i == 11));
      CHECK((batch.get(i).covariance == prior.covariance) == (kept[i] == 0));
    }
    cairn::GaussianBatch<1> of_one(9, {Vector<1>(1), Matrix<1>(4)});
    cairn::GaussianBatch<1> unknown(9, {Vector<1>(1), Matrix<1>(INFINITY)});
    CHECK(cairn::BatchKalman{}.update(of_one, unknown) == 0);
  }

  TEST_CASE_TEMPLATE("batch: in any unit a lane decides as Kalman does", Size, std::integral_constant<int, 1>,
                     std::integral_constant<int, 2>, std::integral_constant<int, 3>,
                     std::integral_constant<int, 4>) {
    constexpr int n = Size::value;
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    cairn::GaussianBatch<n> batch, seen;
    std::vector<Gaussian<Vector<n>>> singles;
    for (int power = -140; power <= 140; power += 4) {  // variances; where sigmas leave doubles, both refuse
      const double unit = std::pow(10.0, power);
      for (int kind = 0; kind < 3; ++kind) {
        Matrix<n> r = cairn_test::random_covariance<n>(random);
        if (kind == 1) r(0, 0) *= 1e-3;  // mostly no covariance
        if (kind == 2) {                 // costs most of the digits of the last state
          r.col(n - 1) *= 1e-7;
          r.row(n - 1) *= 1e-7;
        }
        singles.push_back({std::sqrt(unit) * cairn_test::random_matrix<n, 1>(random),
                           unit * cairn_test::random_covariance<n>(random)});
        batch.add(singles.back());
        seen.add({std::sqrt(unit) * cairn_test::random_matrix<n, 1>(random), unit * r});
      }
    }
    std::vector<std::uint8_t> kept(singles.size());
    const std::size_t count = cairn::BatchKalman{}.update(batch, seen, kept);
    CHECK(count > singles.size() / 4);
    for (std::size_t i = 0; i < singles.size(); ++i) {
      CAPTURE(i);
      const auto z = seen.get(i);
      const cairn::LinearSensor<n, n> sensor{Matrix<n>::Identity(), z.covariance};
      const bool accepted = cairn::Kalman{}.update(singles[i], sensor, z.mean).accepted();
      CHECK(accepted == (kept[i] == 1));
      const Vector<n> inverse = singles[i].covariance.diagonal().cwiseSqrt().cwiseInverse();
      const Matrix<n> off = batch.get(i).covariance - singles[i].covariance;
      CHECK((inverse.asDiagonal() * off * inverse.asDiagonal()).cwiseAbs().maxCoeff() < 1e-6);
    }
  }

  TEST_CASE("batch: a lane with bad numbers stays as it was and disturbs no other") {
    const Gaussian<Vector<3>> prior{Vector<3>(1, 2, 3), Matrix<3>::Identity()};
    cairn::GaussianBatch<3> batch(20, prior);
    cairn::GaussianBatch<3> seen(20, {Vector<3>(2, 2, 2), Matrix<3>::Identity()});
    seen.set(5, {Vector<3>(std::nan(""), 0, 0), Matrix<3>::Identity()});
    seen.set(6, {Vector<3>(INFINITY, 0, 0), Matrix<3>::Identity()});
    seen.set(7, {Vector<3>(0, 0, 0), -5 * Matrix<3>::Identity()});
    CHECK(cairn::BatchKalman{}.update(batch, seen) == 17);
    for (std::size_t i = 0; i < 20; ++i) {
      const bool bad = i >= 5 && i <= 7;
      CHECK((batch.get(i).mean == prior.mean) == bad);
      CHECK((batch.get(i).covariance == prior.covariance) == bad);
    }
    CHECK_THROWS_AS((void)cairn::BatchKalman{}.update(batch, cairn::GaussianBatch<3>(19, prior)),
                    cairn::Error);
    CHECK_THROWS_AS((void)cairn::BatchKalman{.gate = 0}.update(batch, seen), cairn::Error);
  }
}

TEST_SUITE("particle") {
  TEST_CASE("resampling: every scheme draws in proportion to the weights") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const std::vector<double> weights{0.5, 0.0, 0.125, 0.25, 0.0625, 0.0625};
    for (const auto scheme :
         {Resampling::multinomial, Resampling::stratified, Resampling::systematic, Resampling::residual}) {
      std::vector<double> drawn(weights.size(), 0.0);
      for (int run = 0; run < 2000; ++run) {
        const auto indices = cairn::resampled_indices(weights, 10, scheme, random);
        REQUIRE(indices.size() == 10);
        for (const std::size_t i : indices) drawn[i] += 1;
      }
      CHECK(drawn[1] == 0.0);
      for (std::size_t i = 0; i < weights.size(); ++i)  // five standard deviations of independent draws
        CHECK(std::abs(drawn[i] - 20000 * weights[i]) <=
              5 * std::sqrt(20000 * weights[i] * (1 - weights[i])));
    }
    // systematic draws keep every particle within one of its expected number
    const auto indices = cairn::resampled_indices(weights, 16, Resampling::systematic, random);
    CHECK(std::count(indices.begin(), indices.end(), 0U) == 8);
    CHECK(std::count(indices.begin(), indices.end(), 3U) == 4);
  }

  TEST_CASE("kld_particle_count: grows with the bins, by the published approximation") {
    // k = 101 bins: the chi-square quantile with 100 degrees of freedom at 99 % is 135.807
    CHECK(std::abs(static_cast<double>(cairn::kld_particle_count(101, 0.05)) - 135.807 / 0.1) < 3.0);
    CHECK(cairn::kld_particle_count(1) == 1);
    // What no number counts is the largest; a quantile far below the middle asks for one.
    for (const double epsilon : {1e-21, 1e-300, 0.0})
      CHECK(cairn::kld_particle_count(100, epsilon) == std::numeric_limits<std::size_t>::max());
    CHECK(cairn::kld_particle_count(2, 0.05, -3) == 1);
    CHECK(cairn::kld_particle_count(2, std::numeric_limits<double>::infinity()) == 1);
    CHECK(cairn::kld_particle_count(1000) > cairn::kld_particle_count(100));
  }

  TEST_CASE("particle filter: nears the Kalman filter on a linear problem") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn_test::LinearProblem<2, 1> p(random);
    auto exact = p.prior;
    auto particles = cairn::draw_particles(p.prior, 20000, random);
    for (int step = 0; step < 10; ++step) {
      REQUIRE(cairn::Kalman{}.predict(exact, p.process, 1.0) == Status::accepted);
      REQUIRE(cairn::ParticleFilter{}.predict(particles, p.process, 1.0, random) == Status::accepted);
      const Vector<1> z = p.sensor.predict(exact.mean) + Vector<1>(0.5);
      REQUIRE(cairn::Kalman{}.update(exact, p.sensor, z).accepted());
      REQUIRE(cairn::ParticleFilter{}.update(particles, p.sensor, z, random) == Status::accepted);
    }
    const auto found = cairn::moments(particles);
    CHECK((found.mean - exact.mean).norm() < 0.05 * std::sqrt(exact.covariance.trace()));
    CHECK(cairn_test::relative_error(found.covariance, exact.covariance) < 0.08);
  }

  TEST_CASE("particle filter: says when nothing is left and keeps the particles") {
    cairn::Random random(1);
    const cairn_test::LinearProblem<2, 1> p(random);
    cairn::Particles<Vector<2>> none;
    CHECK(cairn::ParticleFilter{}.update(none, p.sensor, Vector<1>(0), random) == Status::depleted);
    CHECK(cairn::ParticleFilter{}.predict(none, p.process, 1.0, random) == Status::depleted);
    auto particles = cairn::draw_particles(p.prior, 10, random);
    const auto before = particles.log_weights;
    CHECK(cairn::ParticleFilter{}.update(particles, p.sensor, Vector<1>(std::nan("")), random) ==
          Status::not_finite);
    const std::vector<double> impossible(10, -INFINITY);
    CHECK(cairn::ParticleFilter{}.update_with(particles, impossible, random) == Status::depleted);
    CHECK(cairn::ParticleFilter{.resample_below = 2}.update(particles, p.sensor, Vector<1>(0), random) ==
          Status::bad_option);
    CHECK(particles.log_weights == before);
  }

  // A robot on a line at an unknown place sees a landmark at x + l: given x the landmark is Gaussian, and the
  // whole is linear, so the Kalman filter over (x, l) is the oracle.
  struct Relative {
    using State = Vector<1>;
    using Part = Vector<1>;
    using Measurement = Vector<1>;
    [[nodiscard]] Measurement predict(const State& x, const Part& l) const { return l - x; }
    [[nodiscard]] Matrix<1> part_jacobian(const State&, const Part&) const { return Matrix<1>(1.0); }
    [[nodiscard]] Matrix<1> noise(const State&, const Part&) const { return Matrix<1>(0.1); }
  };
  TEST_CASE("rao-blackwell: particles with Gaussians near the joint Kalman filter") {
    cairn::Random random(cairn_test::seed());
    using Particle = cairn::ConditionalParticle<Vector<1>, Vector<1>>;
    const Gaussian<Vector<1>> start{Vector<1>(0.0), Matrix<1>(1.0)};
    std::vector<Particle> states;
    for (int i = 0; i < 20000; ++i)
      states.push_back({cairn::sample(start, random), {{Vector<1>(5.0), Matrix<1>(0.5)}}});
    auto belief = cairn::Particles<Particle>::equal(states);
    REQUIRE(cairn::RaoBlackwell{}.update(belief, 0, Relative{}, Vector<1>(4.0), random) == Status::accepted);
    CHECK(cairn::RaoBlackwell{}.update(belief, 3, Relative{}, Vector<1>(4.0), random) ==
          Status::size_mismatch);
    Gaussian<Vector<2>> joint{Vector<2>(0, 5), Vector<2>(1, 0.5).asDiagonal()};
    const cairn::LinearSensor<1, 2> sensor{Matrix<1, 2>(-1, 1), Matrix<1>(0.1)};
    REQUIRE(cairn::Kalman{}.update(joint, sensor, Vector<1>(4.0)).accepted());
    double x = 0.0, l = 0.0;
    const auto w = belief.weights();
    for (std::size_t i = 0; i < belief.size(); ++i) {
      x += w[i] * belief.states[i].state(0);
      l += w[i] * belief.states[i].parts[0].mean(0);
    }
    CHECK(std::abs(x - joint.mean(0)) < 0.03);
    CHECK(std::abs(l - joint.mean(1)) < 0.03);
  }

  using OnALine = cairn::ConditionalParticles<Vector<1>, Vector<1>>;
  OnALine on_a_line(int particles, int landmarks, cairn::Random& random) {
    std::vector<cairn::ConditionalParticle<Vector<1>, Vector<1>>> states;
    for (int i = 0; i < particles; ++i) {
      states.push_back({cairn::sample(Gaussian<Vector<1>>{Vector<1>(0.0), Matrix<1>(1.0)}, random), {}});
      for (int l = 0; l < landmarks; ++l) states.back().parts.push_back({Vector<1>(5.0 + l), Matrix<1>(0.5)});
    }
    return OnALine::equal(std::move(states));
  }

  TEST_CASE("rao-blackwell: what is seen at one moment counts together, a part that is seen twice too") {
    cairn::Random random(cairn_test::seed());
    OnALine belief = on_a_line(20000, 3, random);
    const std::vector<cairn::PartSighting<Vector<1>>> seen = {
        {2, Vector<1>(7.4)}, {0, Vector<1>(5.9)}, {2, Vector<1>(7.7)}};
    REQUIRE(cairn::RaoBlackwell{}.update(belief, Relative{}, std::span(seen), random).accepted());
    Gaussian<Vector<4>> joint{Vector<4>(0, 5, 6, 7), Vector<4>(1, 0.5, 0.5, 0.5).asDiagonal()};
    for (const auto& [part, z] : seen) {
      Matrix<1, 4> h(-1, 0, 0, 0);
      h(0, static_cast<Eigen::Index>(part) + 1) = 1;
      REQUIRE(cairn::Kalman{}.update(joint, cairn::LinearSensor<1, 4>{h, Matrix<1>(0.1)}, z).accepted());
    }
    const auto w = belief.weights();
    Vector<4> mean = Vector<4>::Zero();
    for (std::size_t i = 0; i < belief.size(); ++i) {
      mean(0) += w[i] * belief.states[i].state(0);
      for (std::size_t l = 0; l < 3; ++l)
        mean(static_cast<Eigen::Index>(l) + 1) += w[i] * belief.states[i].parts[l].mean(0);
    }
    CHECK((mean - joint.mean).cwiseAbs().maxCoeff() < 0.04);
    // The weights are resampled once, for all of them: a resampled belief has equal ones.
    OnALine weighed = on_a_line(100, 3, random), one_by_one = weighed;
    const cairn::RaoBlackwell never{.particles = {.resample_below = 0}};
    REQUIRE(never.update(weighed, Relative{}, std::span(seen), random).accepted());
    for (const auto& [part, z] : seen)
      REQUIRE(never.update(one_by_one, part, Relative{}, z, random).accepted());
    for (std::size_t i = 0; i < weighed.size(); ++i) {
      CHECK(weighed.log_weights[i] == doctest::Approx(one_by_one.log_weights[i]).epsilon(1e-12));
      CHECK(weighed.states[i].parts[2].mean == one_by_one.states[i].parts[2].mean);
    }
  }

  TEST_CASE("rao-blackwell: a sighting costs as many copies as the array of parts is deep, however many") {
    cairn::Random random(5);
    for (const int landmarks : {16, 256, 4096}) {
      OnALine belief = on_a_line(10, landmarks, random);
      const OnALine before = belief;
      const cairn::RaoBlackwell filter{.particles = {.resample_below = 0}};
      REQUIRE(filter.update(belief, 11, Relative{}, Vector<1>(16.0), random).accepted());
      const double levels = std::max(1.0, std::ceil(std::log2(landmarks) / 4));
      for (std::size_t i = 0; i < belief.size(); ++i) {
        const auto copies = belief.states[i].parts.node_copies() - before.states[i].parts.node_copies();
        CHECK(static_cast<double>(copies) <= levels + 1);
        CHECK(before.states[i].parts[11].mean(0) == 16.0);
        CHECK(&belief.states[i].parts[0] != &before.states[i].parts[0]);  // of the leaf that was written
        if (landmarks > 16) CHECK(&belief.states[i].parts[40] == &before.states[i].parts[40]);
      }
    }
  }

  TEST_CASE("rao-blackwell: what is refused changes nothing and says why") {
    cairn::Random random(6);
    OnALine belief = on_a_line(10, 2, random);
    const OnALine before = belief;
    using Seen = std::vector<cairn::PartSighting<Vector<1>>>;
    const auto update = [&](const Seen& seen) {
      return cairn::RaoBlackwell{}.update(belief, Relative{}, std::span(seen), random).status;
    };
    CHECK(update({{0, Vector<1>(5.0)}, {2, Vector<1>(5.0)}}) == Status::size_mismatch);
    CHECK(update({{0, Vector<1>(5.0)}, {1, Vector<1>(std::nan(""))}}) == Status::not_finite);
    for (std::size_t i = 0; i < belief.size(); ++i) {
      CHECK(belief.log_weights[i] == before.log_weights[i]);
      for (const std::size_t part : {0U, 1U}) {
        CHECK(belief.states[i].parts[part].mean == before.states[i].parts[part].mean);
        CHECK(belief.states[i].parts[part].covariance == before.states[i].parts[part].covariance);
      }
    }
    CHECK(update({}) == Status::accepted);
    belief.states.clear();
    belief.log_weights.clear();
    CHECK(update({{0, Vector<1>(5.0)}}) == Status::depleted);
  }
}

TEST_SUITE("interacting") {
  TEST_CASE("interacting: recognises which of two processes made the data") {
    cairn::Random random(cairn_test::seed());
    const auto modes = std::tuple(cairn::LinearModel<1>{Matrix<1>(1.0), Matrix<1>(0.01)},
                                  cairn::LinearModel<1>{Matrix<1>(1.0), Matrix<1>(4.0)});
    const cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(0.01)};
    const cairn::Interacting<2, cairn::Kalman> filter{.switching = {{{0.95, 0.05}, {0.05, 0.95}}}};
    const Gaussian<Vector<1>> prior{Vector<1>(0.0), Matrix<1>(1.0)};
    cairn::ModeBelief<Vector<1>, 2> belief{{prior, prior}, {0.5, 0.5}};
    double calm = 0.0, wild = 0.0, x = 0.0;
    for (int step = 0; step < 200; ++step) {
      x += random.normal(0.0, step < 100 ? 0.1 : 2.0);
      REQUIRE(filter.predict(belief, modes, 1.0) == Status::accepted);
      REQUIRE(filter.update(belief, sensor, Vector<1>(x + random.normal(0.0, 0.1))) == Status::accepted);
      CHECK(belief.probability[0] + belief.probability[1] == doctest::Approx(1.0).epsilon(1e-12));
      (step < 100 ? calm : wild) += belief.probability[1] / 100;
    }
    CHECK(calm < 0.1);
    CHECK(wild > 0.8);
    CHECK(std::abs(belief.combined().mean(0) - x) < 0.5);
  }

  TEST_CASE("interacting: with equal modes is the one filter") {
    cairn::Random random(cairn_test::seed());
    const cairn_test::LinearProblem<2, 1> p(random);
    const cairn::Interacting<2, cairn::Kalman> filter{.switching = {{{0.9, 0.1}, {0.3, 0.7}}}};
    cairn::ModeBelief<Vector<2>, 2> belief{{p.prior, p.prior}, {0.2, 0.8}};
    auto single = p.prior;
    for (int step = 0; step < 20; ++step) {
      const Vector<1> z(random.normal());
      REQUIRE(filter.predict(belief, std::tuple(p.process, p.process), 1.0) == Status::accepted);
      REQUIRE(filter.update(belief, p.sensor, z) == Status::accepted);
      REQUIRE(cairn::Kalman{}.predict(single, p.process, 1.0) == Status::accepted);
      REQUIRE(cairn::Kalman{}.update(single, p.sensor, z).accepted());
      CHECK((belief.combined().mean - single.mean).norm() < 1e-12);
      CHECK((belief.combined().covariance - single.covariance).norm() < 1e-12);
    }
    const auto before = belief.probability;
    CHECK(filter.update(belief, p.sensor, Vector<1>(std::nan(""))) == Status::not_finite);
    CHECK(belief.probability == before);
    const cairn::Interacting<2, cairn::Kalman> bad{.switching = {{{0.9, 0.3}, {0.3, 0.7}}}};
    CHECK(bad.predict(belief, std::tuple(p.process, p.process), 1.0) == Status::bad_option);
  }
}

}  // namespace
}  // namespace sampling_test
