// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/filter/conditional.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace conditional_test {
namespace {

using namespace cairn;
using Line = Vector<1>;

/// A known sensor of the position, and a memory of all that was inserted.
struct Memory {
  using Pose = Line;
  using Observation = double;
  double sigma = 0.5;
  std::vector<std::pair<double, double>> inserted{};

  [[nodiscard]] double log_likelihood(const Pose& x, const Observation& z) const {
    return log_density(Gaussian<Line>{x, Matrix<1>(sigma * sigma)}, Line(z));
  }
  void insert(const Pose& x, const Observation& z) { inserted.emplace_back(x(0), z); }
};

/// The same, where what is asked has to be made ready first.
struct Preparing : Memory {
  [[nodiscard]] const Memory& prepared() const { return *this; }
  [[nodiscard]] double log_likelihood(const Pose&, const Observation&) const { return NAN; }
};

constexpr double motion_variance = 0.3;
Gaussian<Line> moved(const Line& x) {
  return {Line(x(0) + 1), Matrix<1>(motion_variance)};
}
const auto motion = [](const Line& x, std::size_t) { return moved(x); };

/// Draws from the exact posterior of motion and sensor.
struct Optimal {
  Proposed<Line> operator()(const Memory& map, const Gaussian<Line>& prior, const double& z,
                            Random& random) const {
    const double p = prior.covariance(0, 0), r = map.sigma * map.sigma, gain = p / (p + r);
    const Gaussian<Line> q{Line(prior.mean(0) + gain * (z - prior.mean(0))), Matrix<1>((1 - gain) * p)};
    const Line x = sample(q, random);
    const double l = map.log_likelihood(x, z);
    return {x, q, l + log_density(prior, x) - log_density(q, x), l};
  }
};

/// Kalman's filter of the same problem.
struct Exact {
  double mean = 0, variance = 0;
  void step(double z, double r) {
    mean += 1;
    variance += motion_variance;
    const double gain = variance / (variance + r);
    mean += gain * (z - mean);
    variance *= 1 - gain;
  }
};

template <class P>
void check_against_kalman(const P& proposal, std::size_t count) {
  const std::uint64_t seed = cairn_test::seed();
  CAPTURE(seed);
  Random random(seed);
  MappedPaths<Memory> belief(Line(0.0), Memory{}, count);
  const ConditionalFilter filter{.seed = seed};
  Exact exact;
  double truth = 0;
  for (int step = 0; step < 8; ++step) {
    truth += 1 + std::sqrt(motion_variance) * random.normal();
    const double z = truth + 0.5 * random.normal();
    exact.step(z, 0.25);
    REQUIRE(filter.step(belief, motion, proposal, z).accepted());
    Particles<Line> poses;
    for (std::size_t i = 0; i < belief.size(); ++i) poses.states.push_back(belief[i].pose);
    poses.log_weights = belief.particles().log_weights;
    const Gaussian<Line> found = moments(poses);
    CHECK(std::abs(found.mean(0) - exact.mean) <
          5 * std::sqrt(exact.variance / static_cast<double>(count) * 8));
    CHECK(found.covariance(0, 0) == doctest::Approx(exact.variance).epsilon(0.2).scale(0));
  }
}

/// Bytes of a run: every pose and weight.
std::vector<double> run(unsigned threads) {
  MappedPaths<Memory> belief(Line(0.0), Memory{}, 23);
  const ConditionalFilter filter{.resample_below = 0.8, .seed = 4, .threads = threads};
  for (int step = 0; step < 30; ++step)
    REQUIRE(filter.step(belief, motion, FromMotion{}, step + 1.2).accepted());
  std::vector<double> all = belief.particles().log_weights;
  for (std::size_t i = 0; i < belief.size(); ++i)
    for (const auto& [x, z] : belief[i].map.inserted) all.push_back(x);
  return all;
}

}  // namespace

TEST_SUITE("filter/conditional") {
  TEST_CASE("conditional: a linear Gaussian problem ends at Kalman's mean and variance, by either proposal") {
    check_against_kalman(FromMotion{}, 20000);
    check_against_kalman(Optimal{}, 5000);
  }

  TEST_CASE("conditional: where the proposal is the exact posterior all draws weigh the same") {
    MappedPaths<Memory> belief(Line(0.0), Memory{}, 50);
    const ConditionalFilter filter{.seed = 2};
    const MappingStep step = filter.step(belief, motion, Optimal{}, 1.7);
    CHECK(step.effective_size == doctest::Approx(50));
    CHECK_FALSE(step.resampled);
    // ... and that weight is the evidence of z.
    const double evidence =
        log_density(Gaussian<Line>{Line(1.0), Matrix<1>(motion_variance + 0.25)}, Line(1.7));
    CHECK(belief[7].log_evidence == doctest::Approx(evidence));
  }

  TEST_CASE("conditional: a particle's map is that of its own path, however often it was copied") {
    MappedPaths<Memory> belief(Line(0.0), Memory{}, 40);
    const ConditionalFilter filter{.resample_below = 1, .seed = 3};
    for (int step = 0; step < 25; ++step)
      REQUIRE(filter.step(belief, motion, FromMotion{}, 1.1 * (step + 1)).accepted());
    for (std::size_t i = 0; i < belief.size(); ++i) {
      const auto path = belief.path(i);
      REQUIRE(path.size() == 26);
      REQUIRE(belief[i].map.inserted.size() == 25);
      for (std::size_t k = 1; k < path.size(); ++k) {
        REQUIRE(path[k].step == k);
        REQUIRE(path[k].pose(0) == belief[i].map.inserted[k - 1].first);
        REQUIRE(path[k].before(0) == path[k - 1].pose(0));
      }
      REQUIRE(path.back().pose(0) == belief[i].pose(0));
    }
    CHECK(belief.stored_poses() < 26 + 40 * 10);  // the past is shared
  }

  TEST_CASE("conditional: a map that makes ready is asked through what it has prepared") {
    const ConditionalFilter filter{.seed = 3};
    MappedPaths<Memory> plain(Line(0.0), Memory{}, 20);
    MappedPaths<Preparing> preparing(Line(0.0), Preparing{}, 20);
    for (const double z : {1.1, 1.9, 3.2}) {
      REQUIRE(filter.step(plain, motion, FromMotion{.draws = 5}, z).accepted());
      REQUIRE(filter.step(preparing, motion, FromMotion{.draws = 5}, z).accepted());
    }
    for (std::size_t i = 0; i < plain.size(); ++i) REQUIRE(plain[i].pose == preparing[i].pose);
  }

  TEST_CASE("conditional: the same bytes for 1, 2 and 7 threads") {
    const std::vector<double> one = run(1);
    CHECK(one == run(2));
    CHECK(one == run(7));
  }

  TEST_CASE("conditional: a motion whose covariance is none is refused in words, and changes nothing") {
    MappedPaths<Memory> belief(Line(0.0), Memory{}, 3);
    const ConditionalFilter filter;
    for (const double variance : {std::numeric_limits<double>::quiet_NaN(), -1.0}) {
      const auto wrong = [&](const Line& x, std::size_t) {
        return Gaussian<Line>{x, Matrix<1>::Constant(variance)};
      };
      CHECK(cairn_test::message_of([&] {
              static_cast<void>(filter.step(belief, wrong, FromMotion{}, 1.0));
            }).find("FromMotion: expected a motion whose covariance is finite") == 0);
      CHECK(belief.steps() == 0);
    }
    const auto exact = [](const Line& x, std::size_t) { return Gaussian<Line>{x, Matrix<1>::Zero()}; };
    CHECK(filter.step(belief, exact, FromMotion{}, 1.0).accepted());
  }

  TEST_CASE("conditional: a step that is refused changes nothing") {
    MappedPaths<Memory> belief(Line(0.0), Memory{}, 5);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK(ConditionalFilter{}.step(belief, motion, FromMotion{}, nan).status == Status::not_finite);
    CHECK((ConditionalFilter{.resample_below = 2}.step(belief, motion, FromMotion{}, 1.0).status) ==
          Status::bad_option);
    CHECK((ConditionalFilter{.evidence_share = 0}.step(belief, motion, FromMotion{}, 1.0).status) ==
          Status::bad_option);
    CHECK(belief.steps() == 0);
    CHECK(belief[0].pose(0) == 0);
    CHECK(belief[0].map.inserted.empty());
    CHECK(cairn_test::message_of([] {
            const MappedPaths<Memory> none(Line(0.0), Memory{}, 0);
          }).find("at least one") != std::string::npos);
  }

  TEST_CASE(
      "conditional: of several draws one is kept: the weight's mean is the evidence, the pose's the "
      "posterior's") {
    const std::uint64_t seed = cairn_test::seed(7);
    CAPTURE(seed);
    Random random(seed);
    const Memory map;
    const double z = 2.2, r = map.sigma * map.sigma;
    const Gaussian<Line> prior = moved(Line(0.5));
    const double evidence =
        std::exp(log_density(Gaussian<Line>{prior.mean, Matrix<1>(motion_variance + r)}, Line(z)));
    const double gain = motion_variance / (motion_variance + r);
    const double mean = prior.mean(0) + gain * (z - prior.mean(0)), variance = (1 - gain) * motion_variance;
    for (const std::size_t draws : {std::size_t{1}, std::size_t{2}, std::size_t{9}}) {
      CAPTURE(draws);
      constexpr int trials = 40000;
      double sum = 0, weighted = 0, squares = 0;
      for (int trial = 0; trial < trials; ++trial) {
        const auto proposed = FromMotion{draws}(map, prior, z, random);
        const double weight = std::exp(proposed.log_weight);
        CHECK(proposed.log_likelihood == map.log_likelihood(proposed.pose, z));
        sum += weight;
        weighted += weight * proposed.pose(0);
        squares += weight * (proposed.pose(0) - mean) * (proposed.pose(0) - mean);
      }
      CHECK(sum / trials == doctest::Approx(evidence).epsilon(0.03).scale(0));
      CHECK(weighted / sum == doctest::Approx(mean).epsilon(0.02).scale(0));
      CHECK(squares / sum == doctest::Approx(variance).epsilon(0.05).scale(0));
    }
    // Where no draw has a likelihood the weight says so.
    const auto lost = FromMotion{3}(map, prior, std::numeric_limits<double>::infinity(), random);
    CHECK_FALSE(lost.log_weight > -1e300);
  }

  TEST_CASE("conditional: regimes are drawn by their shares and stay with the particle") {
    MappedPaths<Memory> belief(Line(0.0), Memory{.sigma = 1e6}, 4000);
    const auto either = [](const Line& x, std::size_t regime) {
      RegimeMotion<Line> m;
      m.modes.push_back({regime, 0.75, {Line(x(0) + (regime == 0 ? 1 : -1)), Matrix<1>(1e-6)}});
      m.modes.push_back({1 - regime, 0.25, {Line(x(0) + (regime == 0 ? -1 : 1)), Matrix<1>(1e-6)}});
      return m;
    };
    const ConditionalFilter filter{.resample_below = 0, .seed = 5};
    const double expected[] = {0.25, 0.375, 0.4375};  // of the other regime: 1/2 - 1/2^(n+1)
    for (const double share : expected) {
      REQUIRE(filter.step(belief, either, FromMotion{}, 0.0).accepted());
      double others = 0;
      for (std::size_t i = 0; i < belief.size(); ++i) others += belief[i].regime == 1 ? 1 : 0;
      CHECK(std::abs(others / 4000 - share) < 0.035);
    }
  }

  TEST_CASE("conditional: localising inserts nothing; tempered evidence counts its share") {
    MappedPaths<Memory> belief(Line(0.0), Memory{}, 3), tempered = belief;
    REQUIRE(ConditionalFilter{.insert = false}.step(belief, motion, Optimal{}, 1.5).accepted());
    CHECK(belief[0].map.inserted.empty());
    REQUIRE(ConditionalFilter{.evidence_share = 0.25}.step(tempered, motion, Optimal{}, 1.5).accepted());
    CHECK(tempered[0].log_evidence == doctest::Approx(0.25 * belief[0].log_evidence));
  }

  TEST_CASE("conditional: survivors stand for all, and a moved path is the particle's") {
    MappedPaths<Memory> belief(Line(0.0), Memory{}, 10);
    const ConditionalFilter filter{.seed = 6};
    for (int step = 0; step < 4; ++step)
      REQUIRE(filter.step(belief, motion, FromMotion{}, step + 1.0).accepted());
    Random random(1);
    const auto first = belief.concentrate(2, random);
    CHECK(first[0] == 0);
    CHECK(first[9] == first[5]);
    for (std::size_t i = 0; i < 10; ++i) CHECK(belief[i].node == belief[first[i]].node);
    auto path = belief.path(0);
    for (auto& each : path) each.pose(0) += 10;
    const double end = path.back().pose(0);
    belief.move(0, std::move(path), Memory{});
    belief.copy_path(0, 9);
    CHECK(belief[9].pose(0) == end);
    CHECK(belief.path(9).front().pose(0) == 10);
    CHECK(belief[9].map.inserted.empty());
    CHECK(belief[5].pose(0) < 10);
  }

  TEST_CASE(
      "conditional: a record whose paths are not as long as its steps, or whose weights are none, is "
      "refused") {
    MappedPaths<Memory> belief(Line(0.0), Memory{}, 3);
    for (int step = 0; step < 4; ++step)
      REQUIRE(ConditionalFilter{}.step(belief, motion, FromMotion{}, step + 1.0).accepted());
    const PathsRecord<Line> good = belief.record();
    const auto words = [](const PathsRecord<Line>& record) {
      return cairn_test::message_of(
          [&] { const MappedPaths<Memory> made(record, std::vector<Memory>(record.particles.size())); });
    };
    CHECK(words(good).empty());
    for (const std::uint64_t step : {0U, 3U, 5U}) {  // an ancestor would be looked for before the first
      PathsRecord<Line> bad = good;
      bad.step = step;
      CHECK(words(bad).find("one pose a step") != std::string::npos);
    }
    PathsRecord<Line> bad = good;
    bad.particles[2].node = bad.nodes[bad.particles[2].node].parent;
    CHECK(words(bad).find("one pose a step") != std::string::npos);
    const double infinity = std::numeric_limits<double>::infinity();
    for (const double weight : {std::nan(""), infinity}) {
      bad = good;
      bad.particles[1].log_weight = weight;
      CHECK(words(bad).find("weights that are numbers") != std::string::npos);
      bad = good;
      bad.particles[0].log_evidence = weight;
      CHECK(words(bad).find("weights that are numbers") != std::string::npos);
    }
    bad = good;
    bad.particles[1].log_weight = -infinity;
    CHECK(words(bad).empty());
  }

  TEST_CASE("conditional: ancestors are counted by what their descendants weigh, as the paths have them") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    MappedPaths<Memory> belief(Line(0.0), Memory{}, 40);
    const ConditionalFilter filter{.seed = seed};
    CHECK(belief.effective_ancestors(0) == doctest::Approx(40));
    for (int step = 0; step < 12; ++step) {
      REQUIRE(filter.step(belief, motion, FromMotion{}, step + 1.0).accepted());
      CHECK(belief.effective_ancestors(belief.steps()) >=
            doctest::Approx(belief.effective_ancestors(1)));  // lines only run together
    }
    const std::vector<double> weights = belief.particles().weights();
    for (const std::size_t step : {1U, 5U, 9U, 12U}) {
      std::map<double, double> families;  // poses are drawn: no two ancestors' are the same
      for (std::size_t i = 0; i < belief.size(); ++i) {
        families[belief.path(i)[step].pose(0)] += weights[i];
        CHECK(belief.ancestor(i, step).pose == belief.path(i)[step].pose);
      }
      double squares = 0;
      for (const auto& [pose, weight] : families) squares += weight * weight;
      CHECK(belief.effective_ancestors(step) == doctest::Approx(1 / squares));
    }
    CHECK(belief.effective_ancestors(1) < 20);
  }

  TEST_CASE("conditional: a belief made again of its record counts ancestors to the same bit") {
    for (std::uint64_t seed = 1; seed < 6; ++seed) {
      CAPTURE(seed);
      MappedPaths<Memory> belief(Line(0.0), Memory{}, 60);
      const ConditionalFilter filter{.seed = seed};
      for (int step = 0; step < 15; ++step)
        REQUIRE(filter.step(belief, motion, FromMotion{}, step + 1.0).accepted());
      std::vector<Memory> maps;
      for (std::size_t i = 0; i < belief.size(); ++i) maps.push_back(belief[i].map);
      const MappedPaths<Memory> again(belief.record(), std::move(maps));  // nodes have other numbers
      for (std::uint64_t step = 0; step <= belief.steps(); ++step)
        CHECK(again.effective_ancestors(step) == belief.effective_ancestors(step));
    }
  }
}

}  // namespace conditional_test
