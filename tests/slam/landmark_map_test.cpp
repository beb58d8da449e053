// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/manifold/se2.hpp>
#include <cairn/models/sensor.hpp>
#include <cairn/slam/landmark_map.hpp>

#include "support/linear_slam.hpp"
#include "support/random.hpp"
#include "support/violation.hpp"

namespace landmark_map_test {
namespace {

using namespace cairn;
using Plane = Vector<2>;

/// Range and bearing of a point.
struct Polar {
  using State = SE2;
  using Part = Plane;
  using Measurement = RangeBearing::Measurement;
  [[nodiscard]] Measurement predict(const State& x, const Part& m) const {
    return RangeBearing{.beacon = m}.predict(x);
  }
  [[nodiscard]] Matrix<2, 3> state_jacobian(const State& x, const Part& m) const {
    return RangeBearing{.beacon = m}.jacobian(x);
  }
  [[nodiscard]] Matrix<2> part_jacobian(const State& x, const Part& m) const {
    return -state_jacobian(x, m).leftCols<2>() * x.rotation().inverse().matrix();
  }
  [[nodiscard]] Matrix<2> noise(const State&, const Part&) const {
    return Vector<2>(0.01, 4e-4).asDiagonal();
  }
  [[nodiscard]] Part initialise(const State& x, const Measurement& z) const {
    const double range = z.part<0>()(0), bearing = z.part<1>().angle();
    return x * Plane(range * std::cos(bearing), range * std::sin(bearing));
  }
};

using namespace cairn_test::linear_slam;

/// The same, where copies that are drawn anew have to be of different poses.
double squared_error_where_copies_differ(const Drive& d, std::size_t count, std::uint64_t seed,
                                         const ConditionalFilter& options,
                                         const FromLandmarks& proposal = {}) {
  return squared_error(d, count, seed, options, proposal, [&](const auto& belief, const auto& did) {
    if (!options.redraw || !did.resampled) return;
    for (std::size_t i = 1; i < count; ++i) REQUIRE(belief[i].pose != belief[i - 1].pose);
    REQUIRE(belief.path(0).back().pose == belief[0].pose);
  });
}

/// Covariances of the pose and of each landmark over all particles: means of a particle's own and the spread
/// of its means, in the order of the joint filter's rows.
std::vector<Matrix<2>> covariances(const Drive& d, std::size_t count, std::uint64_t seed) {
  std::vector<Matrix<2>> found;
  squared_error(d, count, seed, {}, {}, [&](const auto& belief, const auto&) {
    const std::vector<double> weights = belief.particles().weights();
    found.assign(1 + landmarks.size(), Matrix<2>::Zero());
    std::vector<Plane> mean(found.size(), Plane::Zero());
    const auto each = [&](const auto& visit) {
      for (std::size_t i = 0; i < count; ++i) {
        visit(weights[i], 0, Gaussian<Plane>{belief[i].pose, Matrix<2>::Zero()});
        for (const auto& [id, row] : d.exact.row_of)
          visit(weights[i], static_cast<std::size_t>(row) / 2, belief[i].map.find(id)->belief);
      }
    };
    each([&](double w, std::size_t of, const Gaussian<Plane>& b) { mean[of] += w * b.mean; });
    each([&](double w, std::size_t of, const Gaussian<Plane>& b) {
      const Plane off = b.mean - mean[of];
      found[of] += w * (b.covariance + off * off.transpose());
    });
  });
  return found;
}

/// A map of the landmarks as seen once from the origin.
template <class M = Map>
M seen_once(Random& random, const LandmarkOptions& options = keep_all) {
  M map({}, options);
  map.insert(Plane::Zero(), seen_from(Plane::Zero(), random));
  return map;
}

/// All injective associations of sightings with landmarks inside the gate, or with none of the map; calls
/// visit(association, log likelihood).
template <class Visit>
void enumerate(const Map& map, const Plane& x, const Map::Observation& z, double gate, Association& n,
               double sum, const Visit& visit) {
  const std::size_t k = n.size();
  if (k == z.size()) {
    visit(n, sum);
    return;
  }
  const auto go_on = [&](std::uint32_t number, double log_density) {
    n.push_back(number);
    enumerate(map, x, z, gate, n, sum + log_density, visit);
    n.pop_back();
  };
  map.for_each([&](std::uint32_t number, const auto& landmark) {
    if (std::find(n.begin(), n.end(), number) != n.end()) return;
    const Matrix<2> s = landmark.belief.covariance + map.sensor().covariance;
    const Plane v = z[k].z - (landmark.belief.mean - x);
    const double nis = v.dot(s.inverse() * v);
    if (nis <= gate) go_on(number, -0.5 * (nis + std::log(s.determinant())) - std::log(2 * std::numbers::pi));
  });
  go_on(new_landmark, std::log(map.options().new_density));
}

Map::Observation without_identity(Map::Observation z) {
  for (auto& s : z) s.identity.reset();
  return z;
}

/// Bytes of a run without identities: poses, weights, landmarks.
std::vector<double> run(unsigned threads, Pick pick) {
  Random random(3);
  MappedPaths<Map> belief(Plane::Zero(), Map({}, {.pick = pick, .gate = 0.999}), 23);
  const ConditionalFilter filter{.resample_below = 0.8, .seed = 4, .threads = threads};
  Plane is = Plane::Zero();
  for (int step = 0; step < 20; ++step) {
    is += Plane(0.05, 0.01);
    REQUIRE(filter
                .step(
                    belief,
                    [](const Plane& x, std::size_t) {
                      return Gaussian<Plane>{x + Plane(0.05, 0.01), 0.01 * motion_noise};
                    },
                    FromLandmarks{}, without_identity(seen_from(is, random)))
                .accepted());
  }
  std::vector<double> all = belief.particles().log_weights;
  for (std::size_t i = 0; i < belief.size(); ++i) {
    all.insert(all.end(), {belief[i].pose(0), belief[i].pose(1)});
    belief[i].map.for_each([&](std::uint32_t number, const auto& landmark) {
      all.insert(all.end(), {double(number), landmark.belief.mean(0), landmark.belief.mean(1),
                             landmark.belief.covariance(0, 1), landmark.log_odds});
    });
  }
  return all;
}

}  // namespace

TEST_SUITE("slam/landmark_map") {
  TEST_CASE("landmark_map: in the linear case a particle's proposal is Kalman's posterior given its past") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Map::Observation first = seen_from(Plane::Zero(), random),
                           second = seen_from(Plane(0.8, 0), random);
    Joint exact;
    for (const auto& s : first) exact.see(*s.identity, s.z, Relative{}.covariance);
    exact.move();
    for (const auto& s : second) exact.see(*s.identity, s.z, Relative{}.covariance);
    Map map({}, keep_all);
    map.insert(Plane::Zero(), first);
    Map::Observation order = second;
    for (int run = 0; run < 20; ++run) {
      std::rotate(order.begin(), order.begin() + 1 + run % 3, order.end());
      const auto by_weight = [&](FromLandmarks::Weight weight) {
        Random same(seed + static_cast<std::uint64_t>(run));
        return FromLandmarks{.weight = weight}(map, motion(Plane::Zero(), 0), order, same);
      };
      const auto proposed = by_weight(FromLandmarks::Weight::exact);
      CHECK((proposed.drawn_from.mean - exact.mean.head(2)).norm() < 1e-12);
      CHECK((proposed.drawn_from.covariance - exact.covariance.topLeftCorner(2, 2)).norm() < 1e-12);
      // both weights are the evidence, whatever pose was drawn
      CHECK(std::abs(proposed.log_weight - exact.log_evidence) <
            1e-12 * std::abs(exact.log_evidence) + 1e-12);
      CHECK(std::abs(by_weight(FromLandmarks::Weight::evidence).log_weight - proposed.log_weight) < 1e-12);
    }
  }

  TEST_CASE("landmark_map: the error to the exact posterior falls with the root of the number of particles") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const Drive d = drive(seed);
    const double slope = slope_of_error(d, seed);
    MESSAGE("slope ", slope);
    CHECK(std::abs(slope + 0.5) < 0.1);
    CHECK(std::sqrt(squared_error(d, 3000, seed)) < 0.2);
  }

  TEST_CASE(
      "landmark_map: the particles' spread and their landmarks' covariances make up the exact covariances") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const Drive d = drive(seed);
    const std::vector<Matrix<2>> found = covariances(d, 3000, seed);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const Matrix<2> exact = d.exact.covariance.block<2, 2>(Eigen::Index(2 * i), Eigen::Index(2 * i));
      CAPTURE(i);
      CHECK((found[i] - exact).norm() < 0.2 * exact.norm());
    }
  }

  TEST_CASE(
      "landmark_map: a sighting of a number that the map does not have is clutter, and changes nothing") {
    Random random(5);
    Map map = seen_once(random);
    const std::size_t before = map.size();
    const Map::Observation z{{Plane(1, 1), {}}};
    CHECK(map.log_likelihood(Plane::Zero(), z, {77}) == map.log_density_of(no_landmark));
    map.insert(Plane::Zero(), z, {77});
    CHECK(map.size() == before);
    CHECK(map.find(77) == nullptr);
  }

  TEST_CASE(
      "landmark_map: copies that draw poses of their own are as many poses, and their mean is no worse") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const Drive d = drive(seed);
    const ConditionalFilter redraw{.resample_below = 1, .redraw = true};
    const FromLandmarks evidence{.weight = FromLandmarks::Weight::evidence};
    double own = 0, shared = 0;
    for (std::uint64_t run = seed * 1000; run < seed * 1000 + 200; ++run) {
      own += squared_error_where_copies_differ(d, 30, run, redraw, evidence);
      shared += squared_error_where_copies_differ(d, 30, run, {.resample_below = 1});
    }
    MESSAGE("squared errors ", own, ", ", shared);
    CHECK(own < 1.25 * shared);
  }

  TEST_CASE("landmark_map: the likeliest association is the best of all injective ones") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    const double gate = chi_square_quantile(0.999, 2);
    int several = 0;
    for (int run = 0; run < 60; ++run) {
      const Map map = seen_once(random, {.gate = 0.999, .new_density = 0.02});
      const Plane x = normal(0.3 * motion_noise, random);
      Map::Observation z = without_identity(seen_from(x, random));
      z[1].z = z[0].z + normal(0.3 * motion_noise, random);  // two of one, or nearly
      double best = -std::numeric_limits<double>::infinity();
      Association n, best_n;
      int count = 0;
      enumerate(map, x, z, gate, n, 0, [&](const Association& each, double l) {
        ++count;
        if (l <= best) return;
        best = l;
        best_n = each;
      });
      several += count > 2 ? 1 : 0;
      const auto chosen = map.choose(x, z, random);
      CHECK(chosen.choice == best_n);
      CHECK(chosen.log_likelihood == doctest::Approx(best).epsilon(1e-12));
      CHECK(map.log_likelihood(x, z, chosen.choice) == doctest::Approx(best).epsilon(1e-12));
      CHECK(map.log_likelihood(x, z) == doctest::Approx(best).epsilon(1e-12));
    }
    CHECK(several > 30);
  }

  TEST_CASE("landmark_map: drawn associations, weighed, sum to the likelihood over all associations") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Map map = seen_once(random, {.pick = Pick::drawn, .gate = 0.999, .new_density = 0.05});
    const Plane x(0.2, -0.1);
    Map::Observation z = without_identity(seen_from(x, random));
    z.resize(3);
    z[1].z = z[0].z + Plane(0.2, 0.1);
    double sum = 0;
    Association n;
    enumerate(map, x, z, chi_square_quantile(0.999, 2), n, 0,
              [&](const Association&, double l) { sum += std::exp(l); });
    RunningMoments weights;
    std::map<Association, int> met;
    for (int draw = 0; draw < 20000; ++draw) {
      const auto chosen = map.choose(x, z, random);
      weights.add(std::exp(chosen.log_likelihood - chosen.log_probability) / sum);
      ++met[chosen.choice];
    }
    CHECK(met.size() > 1);
    CHECK(std::abs(weights.mean() - 1) < 5 * weights.standard_deviation() / std::sqrt(20000.0) + 1e-12);
  }

  TEST_CASE("landmark_map: a landmark that has moved is one candidate, not one for each of its places") {
    Random random(1);
    Map map({}, {.pick = Pick::drawn, .gate = 0.999});
    map.insert(Plane::Zero(), {{Plane(1, 1), 0}}, {new_landmark});
    map.insert(Plane::Zero(), {{Plane(2.5, 1), 0}}, {0});
    const Map::Observation z{{Plane(1.7, 1), {}}};
    double sum = 0;
    Association n;
    enumerate(map, Plane::Zero(), z, chi_square_quantile(0.999, 2), n, 0,
              [&](const Association&, double l) { sum += std::exp(l); });
    const auto chosen = map.choose(Plane::Zero(), z, random);
    CHECK(std::exp(chosen.log_likelihood - chosen.log_probability) == doctest::Approx(sum).epsilon(1e-12));
  }

  TEST_CASE("landmark_map: of many landmarks a sighting finds the likeliest, as looking at all does") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    Map map({}, {.gate = 0.999, .new_density = 1e-9, .clutter_density = 1e-9});
    std::vector<Plane> all;
    for (std::uint32_t i = 0; i < 400; ++i) {
      all.emplace_back(random.uniform(-20, 20), random.uniform(-20, 20));
      for (int twice = 0; twice < 3; ++twice) {  // the second time it is known, and moves
        const Plane z = all.back() + normal(Relative{}.covariance, random);
        map.insert(Plane::Zero(), {{z, i}}, {twice == 0 ? new_landmark : i});
      }
    }
    const Matrix<2> spread = 0.2 * motion_noise;
    int found = 0;
    for (int run = 0; run < 500; ++run) {
      const Plane x = normal(25 * motion_noise, random);
      const Plane z = all[random.below(400)] - x + 2 * normal(motion_noise, random);
      std::uint32_t best = new_landmark;
      double least = std::numeric_limits<double>::infinity();
      map.for_each([&](std::uint32_t number, const auto& landmark) {
        const Matrix<2> s = landmark.belief.covariance + spread + Relative{}.covariance;
        const Plane v = z - (landmark.belief.mean - x);
        const double nis = v.dot(s.inverse() * v), cost = nis + std::log(s.determinant());
        if (nis > chi_square_quantile(0.999, 2) || cost >= least) return;
        least = cost;
        best = number;
      });
      found += best == new_landmark ? 0 : 1;
      CHECK(map.associate({x, spread}, {{z, {}}}, random).choice == Association{best});
    }
    CHECK(found > 200);
    CHECK(found < 500);
  }

  TEST_CASE(
      "landmark_map: what is not seen where it should be goes; what is out of view or at its rim stays") {
    Map map;
    const auto seen_at = [](double x, double y) { return Map::Sighting{Plane(x, y), {}}; };
    map.insert(Plane::Zero(), {seen_at(1, 0), seen_at(2.95, 0), seen_at(8, 0), seen_at(0, 1)});
    REQUIRE(map.size() == 4);
    for (int step = 0; step < 20; ++step) map.insert(Plane::Zero(), {seen_at(0, 1)});
    CHECK(map.find(0) == nullptr);
    CHECK(map.find(1) != nullptr);
    CHECK(map.find(2) != nullptr);
    REQUIRE(map.find(3) != nullptr);
    CHECK(map.find(3)->sightings == 21);
    CHECK(map.find(3)->log_odds == doctest::Approx(map.options().most_log_odds));
    CHECK(map.size() == 3);
    map.insert(Plane::Zero(), {seen_at(1, 0)});  // a number that went is not given again
    CHECK(map.find(0) == nullptr);
    CHECK(map.find(4) != nullptr);
    // sightings with names say nothing of what was not named
    const double odds = map.find(4)->log_odds;
    map.insert(Plane::Zero(), {{Plane(0, 1), 3}});
    CHECK(map.find(4)->log_odds == odds);
  }

  TEST_CASE("landmark_map: a second sighting never makes a landmark less likely to be there") {
    Map map({}, {.false_share = 1e-6});  // one sighting alone says more than the most that is counted
    for (int step = 0; step < 3; ++step) {
      map.insert(Plane::Zero(), {{Plane(1, 0), {}}});
      CHECK(map.find(0)->log_odds == map.options().most_log_odds);
    }
  }

  TEST_CASE("landmark_map: a landmark is not missed by the observation that it begins with") {
    Relative sure;
    sure.probability = 0.99;
    Map map(sure);
    map.insert(Plane::Zero(), {{Plane(1, 0), {}}, {Plane(0, 1), {}}});
    REQUIRE(map.size() == 2);
    CHECK(map.find(0)->log_odds == doctest::Approx(std::log(0.99 / map.options().false_share)));
    CHECK(map.find(1)->log_odds == map.find(0)->log_odds);
    map.insert(Plane::Zero(), {{Plane(1, 0), {}}});  // the other one is, from the next on
    CHECK(map.find(0) != nullptr);
    CHECK(map.find(1) == nullptr);
  }

  TEST_CASE("landmark_map: a named landmark outside its gate is clutter, and none is seen twice at once") {
    Random random(1);
    Map map({}, {.gate_of_named = 0.99});
    map.insert(Plane::Zero(), {{Plane(1, 0), 7}});
    CHECK(Map().choose(Plane::Zero(), {{Plane(4, 0), 7}}, random).choice == Association{new_landmark});
    CHECK(map.find(7) != nullptr);
    CHECK(map.choose(Plane::Zero(), {{Plane(4, 0), 7}}, random).choice == Association{no_landmark});
    const auto twice = map.choose(Plane::Zero(), {{Plane(1.1, 0), 7}, {Plane(1, 0), 7}}, random).choice;
    CHECK(twice == Association{no_landmark, 7});
    map.insert(Plane::Zero(), {{Plane(4, 0), 7}});
    CHECK(map.find(7)->sightings == 1);
    map.insert(Plane::Zero(), {{Plane(5, 0), 9}, {Plane(5, 0), 9}});
    CHECK(map.find(9)->sightings == 1);
    CHECK(map.size() == 2);
    Map trusting;  // takes a name for true, wherever the landmark is seen
    trusting.insert(Plane::Zero(), {{Plane(1, 0), 7}});
    CHECK(trusting.choose(Plane::Zero(), {{Plane(90, 0), 7}}, random).choice == Association{7});
  }

  TEST_CASE("landmark_map: the same bytes for 1, 2 and 7 threads") {
    for (const Pick pick : {Pick::likeliest, Pick::drawn}) {
      const std::vector<double> one = run(1, pick);
      CHECK(one.size() > 23 * 10);
      CHECK(one == run(2, pick));
      CHECK(one == run(7, pick));
    }
  }

  TEST_CASE("landmark_map: where the sensor bends, drawn poses keep their weights exact") {
    // FastSLAM 1.0 and 2.0 with many particles agree on the posterior of one step.
    Random random(5);
    LandmarkMap<Polar> map({}, keep_all);
    const std::vector<Plane> places{{4, 1}, {3, -2}, {1, 3}};
    LandmarkMap<Polar>::Observation first, second;
    const SE2 is(0.35, 0.05, 0.25);
    for (std::uint32_t i = 0; i < 3; ++i) {
      first.push_back({Polar{}.predict(SE2(), places[i]), i});
      second.push_back({Polar{}.predict(is, places[i]), i});
    }
    map.insert(SE2(), first);
    const auto move = [](const SE2&, std::size_t) {
      return Gaussian<SE2>{SE2(0.2, 0, 0.1), Vector<3>(0.04, 0.01, 0.04).asDiagonal()};
    };
    const auto posterior = [&](const auto& proposal, std::size_t count) {
      MappedPaths<LandmarkMap<Polar>> belief(SE2(), map, count);
      REQUIRE((
          ConditionalFilter{.resample_below = 0, .seed = 8}.step(belief, move, proposal, second).accepted()));
      Particles<SE2> poses;
      for (std::size_t i = 0; i < count; ++i) poses.states.push_back(belief[i].pose);
      poses.log_weights = belief.particles().log_weights;
      return moments(poses);
    };
    const Gaussian<SE2> one = posterior(FromMotion{}, 60000), two = posterior(FromLandmarks{}, 10000),
                        more = posterior(FromLandmarks{.iterations = 5}, 10000);
    CHECK(local(one.mean, two.mean).norm() < 0.006);
    CHECK(local(one.mean, more.mean).norm() < 0.006);
    CHECK((one.covariance - two.covariance).norm() < 0.1 * one.covariance.norm());
  }

  TEST_CASE("landmark_map: bad input is refused in words") {
    Random random(1);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    LandmarkMap<Polar> map;
    const auto words_of = [](const auto& attempt) -> std::string {
      try {
        attempt();
      } catch (const Error& error) {
        return error.what();
      }
      return "";
    };
    const auto bad = [&](const LandmarkMap<Polar>::Observation& z) {
      return words_of([&] { static_cast<void>(map.choose(SE2(), z, random)); });
    };
    const std::string not_finite = "LandmarkMap: expected sightings of finite numbers, found another: ";
    CHECK(bad({{RangeBearing::measurement(nan, 0), {}}}).find(not_finite + "0") != std::string::npos);
    CHECK(bad({{RangeBearing::measurement(1, 0), {}}, {RangeBearing::measurement(1, nan), {}}})
              .find(not_finite + "1") != std::string::npos);
    CHECK(bad({{RangeBearing::measurement(1, 0), LandmarkMap<Polar>::most_identity}})
              .find("expected identities below 16777216, found 16777216") != std::string::npos);
    for (const std::uint32_t number : {LandmarkMap<Polar>::most_identity, no_landmark, new_landmark}) {
      const LandmarkMap<Polar>::Observation two{{RangeBearing::measurement(1, 0), 1},
                                                {RangeBearing::measurement(2, 0), number}};
      CHECK(words_of([&] {
              map.insert(SE2(), two, {new_landmark, new_landmark});
            }).find("expected identities below 16777216") != std::string::npos);
      CHECK(map.size() == 0);
    }
    CHECK_THROWS_AS((LandmarkMap<Polar>({}, {.gate = 1})), Error);
    CHECK_THROWS_AS((LandmarkMap<Polar>({}, {.new_density = 0})), Error);
    CHECK_THROWS_AS((LandmarkMap<Polar>({}, {.remove_below = nan})), Error);
    const Gaussian<SE2> singular{SE2(), Vector<3>(0.1, 0, 0.1).asDiagonal()};
    CHECK(words_of([&] {
            static_cast<void>(FromLandmarks{}(map, singular, {}, random));
          }).find("uncertain in every direction, found a singular covariance") != std::string::npos);
    for (const FromLandmarks& wrong : {FromLandmarks{.iterations = 0}, FromLandmarks{.associations = 0},
                                       FromLandmarks{.hypotheses = -1}})  // would drive blindly
      CHECK_FALSE(cairn_test::violation_of([&] {
                    static_cast<void>(wrong(map, {SE2(), 0.01 * Matrix<3>::Identity()}, {}, random));
                  }).empty());
    // an empty map, nothing seen, a robot that stands on what it sees
    CHECK(map.choose(SE2(), {}, random).choice.empty());
    map.insert(SE2(), {});
    map.insert(SE2(), {{RangeBearing::measurement(0, 0), 3}});
    CHECK(map.size() == 0);
    CHECK(map.find(new_landmark) == nullptr);
    const Gaussian<SE2> good{SE2(), 0.01 * Matrix<3>::Identity()};
    CHECK(std::isfinite(FromLandmarks{}(map, good, {}, random).log_weight));
  }

  TEST_CASE("landmark_map: an update in a copy of 50,000 landmarks copies few nodes, the others stay") {
    Map map;
    Random random(2);
    for (std::uint32_t i = 0; i < 50000; ++i)
      map.insert(Plane::Zero(), {{Plane(random.uniform(-500, 500), random.uniform(-500, 500)), i}},
                 {new_landmark});
    std::size_t most = 0;
    for (int particle = 0; particle < 100; ++particle) {
      Map copy = map;
      const auto number = static_cast<std::uint32_t>(random.below(50000));
      const Plane z = map.find(number)->belief.mean + normal(Relative{}.covariance, random);
      copy.insert(Plane::Zero(), {{z, number}}, {number});
      most = std::max(most, copy.node_copies() - map.node_copies());
      REQUIRE(copy.find(number)->sightings == 2);
      REQUIRE(map.find(number)->sightings == 1);
    }
    MESSAGE("at most ", most, " nodes");
    CHECK(most <= 10);
  }

  TEST_CASE("landmark_map: a map made again of its record goes on as the map itself, to the bit") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    for (const Pick pick : {Pick::likeliest, Pick::drawn}) {
      Random world(seed), random(seed + 1), again(seed + 1);
      std::vector<Plane> posts;
      for (int i = 0; i < 60; ++i) posts.emplace_back(world.uniform(-6, 6), world.uniform(-6, 6));
      Map map(Relative{}, {.pick = pick, .filing_distance = 0.1});
      std::optional<Map> other;
      int lost = 0;
      for (int step = 0; step < 400; ++step) {
        const Plane x(world.uniform(-5, 5), world.uniform(-5, 5));
        Map::Observation z;
        for (const Plane& post : posts)
          if ((post - x).norm() < 2.5 && world.uniform() < 0.5)
            z.push_back({Plane(post - x + normal(Relative{}.covariance, world)), {}});
        if (step == 200) other = Map(map).restored(map.record());
        const auto before = map.size();
        const auto one = map.associate({x, 0.01 * motion_noise}, z, random);
        map.insert(x, z, one.choice);
        lost += map.size() < before ? 1 : 0;
        again = other ? again : random;
        if (!other) continue;
        const auto two = other->associate({x, 0.01 * motion_noise}, z, again);
        REQUIRE(one.choice == two.choice);
        REQUIRE(one.log_likelihood == two.log_likelihood);
        REQUIRE(one.log_probability == two.log_probability);
        other->insert(x, z, two.choice);
      }
      CHECK(lost > 0);  // numbers that are not given again
      const auto a = map.record(), b = other->record();
      CHECK(a.numbers == b.numbers);
      CHECK(a.numbers > a.landmarks.size());
      CHECK(a.widest == b.widest);
      REQUIRE(a.landmarks.size() == b.landmarks.size());
      CHECK(a.landmarks.size() == map.size());
      CHECK(other->size() == map.size());
      for (std::size_t i = 0; i < a.landmarks.size(); ++i) {
        const auto &p = a.landmarks[i], &q = b.landmarks[i];
        CHECK(p.number == q.number);
        CHECK(p.filed == q.filed);
        CHECK(p.landmark.belief.mean == q.landmark.belief.mean);
        CHECK(p.landmark.belief.covariance == q.landmark.belief.covariance);
        CHECK(p.landmark.log_odds == q.landmark.log_odds);
        CHECK(p.landmark.sightings == q.landmark.sightings);
      }
    }
  }

  TEST_CASE("landmark_map: a map made again gives no number again, and looks as far as the map did") {
    Relative sure;
    sure.probability = 0.99;
    Map map(sure);
    map.insert(Plane::Zero(), {{Plane(1, 0), {}}, {Plane(0, 1), {}}});
    for (int step = 0; step < 9; ++step) map.insert(Plane::Zero(), {{Plane(1, 0), {}}});
    REQUIRE(map.find(1) == nullptr);
    Map again = map.restored(map.record());
    CHECK(again.record().widest == map.record().widest);
    const Gaussian<Plane>& left = map.find(0)->belief;  // surer than any was when it was filed
    CHECK(map.record().widest > 2 * std::sqrt(left.covariance(1, 1)));
    for (Map* each : {&map, &again}) each->insert(Plane::Zero(), {{Plane(1, 0), {}}, {Plane(0, 1), {}}});
    CHECK(map.find(2) != nullptr);
    CHECK(again.find(2) != nullptr);
  }

  TEST_CASE("landmark_map: a record that is none is refused in words") {
    Map map;
    map.insert(Plane::Zero(), {{Plane(1, 1), 2}, {Plane(2, 1), 5}});
    const auto good = map.record();
    CHECK(good.numbers == 6);
    CHECK(map.restored(good).size() == 2);
    CHECK(map.restored({}).size() == 0);
    const auto words = [&](const auto& spoil) -> std::string {
      auto bad = good;
      spoil(bad);
      try {
        static_cast<void>(map.restored(bad));
      } catch (const Error& error) {
        return error.what();
      }
      return "";
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK(words([](auto& r) { std::swap(r.landmarks[0], r.landmarks[1]); }).find("numbers that grow") !=
          std::string::npos);
    CHECK(words([](auto& r) { r.landmarks[1].number = 2; }).find("numbers that grow") != std::string::npos);
    CHECK(words([](auto& r) { r.numbers = 5; }).find("numbers that grow") != std::string::npos);
    CHECK(words([](auto& r) { r.numbers = no_landmark; }).find("fewer numbers") != std::string::npos);
    CHECK(words([](auto& r) { r.landmarks[0].landmark.sightings = 0; }).find("been seen") !=
          std::string::npos);
    CHECK(words([&](auto& r) { r.landmarks[0].landmark.log_odds = nan; }).find("finite odds") !=
          std::string::npos);
    CHECK_FALSE(words([&](auto& r) { r.landmarks[0].landmark.belief.mean(0) = nan; }).empty());
    CHECK_FALSE(words([&](auto& r) { r.landmarks[0].landmark.belief.covariance(0, 0) = -1; }).empty());
    CHECK(words([](auto& r) { r.landmarks[0].filed[1] += 0.6; }).find("near where they are filed") !=
          std::string::npos);
    CHECK(words([&](auto& r) { r.landmarks[0].filed[0] = nan; }).find("near where they are filed") !=
          std::string::npos);
    CHECK(words([](auto& r) { r.landmarks[0].filed.clear(); }).find("as many numbers") != std::string::npos);
    CHECK(words([&](auto& r) { r.widest = nan; }).find("standard deviation") != std::string::npos);
  }

  TEST_CASE("from_landmarks: of sightings that do not agree with each other the fewer are left out") {
    const Relative sharp{.covariance = 1e-4 * Matrix<2>::Identity()};
    Map map(sharp, {.gate = 0.999, .new_density = 1e-6, .clutter_density = 1e-7});
    const std::vector<Plane> apart{{0, 0}, {8, 0}, {0, 8}, {8, 8}, {4, 4}};
    for (std::uint32_t k = 0; k < 5; ++k) map.insert(Plane::Zero(), {{apart[k], k}}, {new_landmark});
    for (int again = 0; again < 10; ++again) map.insert(Plane::Zero(), {{apart[4], 4U}}, {4});  // the surest
    const Plane is(0.5, -0.4);
    Map::Observation z;
    for (std::uint32_t k = 0; k < 5; ++k)
      z.push_back({apart[k] - is + (k == 4 ? Plane(0.6, 0.5) : Plane(0, 0)), {}});
    const Gaussian<Plane> moved{Plane::Zero(), 0.25 * Matrix<2>::Identity()};
    Random random(1);
    const auto careful = FromLandmarks{.associations = 2, .hypotheses = 5}(map, moved, z, random);
    CHECK((careful.drawn_from.mean - is).norm() < 0.01);
    for (std::uint32_t k = 0; k < 4; ++k) CHECK(careful.choice[k] == k);
    CHECK(careful.choice[4] != 4);
    const auto trusting = FromLandmarks{}(map, moved, z, random);
    CHECK(trusting.choice[4] == 4);
    CHECK((trusting.drawn_from.mean - is).norm() > 0.05);
    // Named ones are believed, whatever the others say.
    for (std::uint32_t k = 0; k < 5; ++k) z[k].identity = k;
    CHECK(FromLandmarks{.hypotheses = 5}(map, moved, z, random).choice[4] == 4);
  }
}

}  // namespace landmark_map_test
