// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <new>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/particle.hpp>

#include "support/random.hpp"

namespace particle_test {
namespace {

using cairn::Particles;
using cairn::Resampling;
using cairn::Vector;

/// Three states of a plane with weights 0.2, 0.5 and 0.3.
Particles<Vector<2>> three() {
  Particles<Vector<2>> particles;
  particles.states = {Vector<2>(0, 1), Vector<2>(1, -1), Vector<2>(4, 2)};
  particles.log_weights = {std::log(0.2), std::log(0.5), std::log(0.3)};
  return particles;
}

/// A state of which so many copies more can be made.
struct Dear {
  int number = 0;
  int* copies = nullptr;

  Dear(int n, int& left) : number(n), copies(&left) {}
  Dear(const Dear& other) : number(other.number), copies(other.copies) {
    if ((*copies)-- == 0) throw std::bad_alloc();
  }
  Dear(Dear&&) noexcept = default;
  Dear& operator=(const Dear&) = default;
  Dear& operator=(Dear&&) noexcept = default;
  ~Dear() = default;
};

}  // namespace

TEST_SUITE("particle") {
  TEST_CASE("particle: mean and covariance are those of the weights") {
    const auto found = cairn::moments(three());
    CHECK(found.mean(0) == doctest::Approx(1.7).epsilon(1e-14));
    CHECK(found.mean(1) == doctest::Approx(0.3).epsilon(1e-14));
    // E x^2 = 5.3, E y^2 = 1.9 and E x y = 1.9, less the squares of the means.
    CHECK(found.covariance(0, 0) == doctest::Approx(5.3 - 2.89).epsilon(1e-14));
    CHECK(found.covariance(1, 1) == doctest::Approx(1.9 - 0.09).epsilon(1e-14));
    CHECK(found.covariance(0, 1) == doctest::Approx(1.9 - 0.51).epsilon(1e-14));
    CHECK(found.covariance(1, 0) == doctest::Approx(1.39).epsilon(1e-14));
  }

  TEST_CASE(
      "particle: moments are those of the weights' shares, whatever their sum, and of none there are none") {
    Particles<Vector<2>> particles = three();
    for (double& weight : particles.log_weights) weight += 2;
    const auto found = cairn::moments(particles), expected = cairn::moments(three());
    CHECK((found.mean - expected.mean).norm() < 1e-14);
    CHECK((found.covariance - expected.covariance).norm() < 1e-14);
    particles.log_weights[1] = std::nan("");
    CHECK_THROWS_WITH_AS((void)cairn::moments(particles), doctest::Contains("index 1"), cairn::Error);
    for (double& weight : particles.log_weights) weight = -1000;
    CHECK_THROWS_AS((void)cairn::moments(particles), cairn::Error);
  }

  TEST_CASE(
      "particle: the effective number is one over the sum of squared weights, all of them once resampled") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    CHECK(three().effective_size() == doctest::Approx(1 / 0.38).epsilon(1e-14));
    for (const std::size_t count : {std::size_t{3}, std::size_t{8}, std::size_t{1}}) {
      auto particles = three();
      particles.resample(count, Resampling::systematic, random);
      REQUIRE(particles.size() == count);
      CHECK(particles.effective_size() == doctest::Approx(static_cast<double>(count)).epsilon(1e-14));
      for (const double weight : particles.weights())
        CHECK(weight == doctest::Approx(1.0 / static_cast<double>(count)).epsilon(1e-14));
    }
  }

  TEST_CASE("particle: resampled is what has fewer effective particles than asked for, and no other") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const std::vector<double> nothing_new(3, 0.0);
    for (const double share : {0.85, 0.9}) {  // 1 / 0.38 are 0.877 of three
      auto particles = three();
      REQUIRE(cairn::ParticleFilter{.resample_below = share}.update_with(particles, nothing_new, random) ==
              cairn::Status::accepted);
      CHECK((particles.effective_size() > 2.99) == (share > 0.877));
    }
  }

  TEST_CASE("particle: where a state cannot be copied, neither states nor weights have changed") {
    cairn::Random random(cairn_test::seed());
    int copies = 1000;
    Particles<Dear> particles;
    for (int i = 0; i < 3; ++i) particles.states.emplace_back(i, copies);
    particles.log_weights = three().log_weights;
    const std::vector<double> unlike{0, -20, -30};
    const cairn::ParticleFilter filter{.resample_below = 1};
    for (int allowed = 0; allowed < 3; ++allowed) {
      copies = allowed;
      CHECK_THROWS_AS(static_cast<void>(filter.update_with(particles, unlike, random)), std::bad_alloc);
      CHECK(particles.log_weights == three().log_weights);
      for (int i = 0; i < 3; ++i) CHECK(particles.states[static_cast<std::size_t>(i)].number == i);
    }
    copies = 1000;
    REQUIRE(filter.update_with(particles, unlike, random) == cairn::Status::accepted);
    CHECK(particles.effective_size() > 2.99);
  }
}

}  // namespace particle_test
