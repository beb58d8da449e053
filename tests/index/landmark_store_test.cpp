// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/landmark_store.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace landmark_store_test {
namespace {

using cairn::LandmarkId;
using cairn::LandmarkMatch;
using Descriptor = std::array<float, 8>;

static_assert(cairn::LandmarkStore<cairn::SingleTreeStore<8>>);
static_assert(cairn::LandmarkStore<cairn::MultiTreeStore<64>>);

Descriptor random_descriptor(cairn::Random& random) {
  Descriptor descriptor;
  for (float& number : descriptor) number = static_cast<float>(random.normal());
  return descriptor;
}

Descriptor near(const Descriptor& of, cairn::Random& random, double sigma) {
  Descriptor descriptor = of;
  for (float& number : descriptor) number += static_cast<float>(random.normal(0, sigma));
  return descriptor;
}

/// The store as a table: every rule spelt out, every distance computed.
class Reference {
public:
  struct Entry {
    Descriptor descriptor;
    unsigned label;
    unsigned first;
    unsigned last;
    unsigned sightings;
    bool base;
    bool searchable;
  };

  LandmarkId add(const Descriptor& descriptor, unsigned label) {
    entries[next] = {descriptor, label, step, step, 1, false, false};
    return next++;
  }
  void sighted(LandmarkId id) {
    Entry& entry = entries.at(id);
    if (entry.last != step) ++entry.sightings;
    entry.last = step;
  }
  cairn::StepReport advance() {
    cairn::StepReport report;
    ++step;
    for (auto at = entries.begin(); at != entries.end();) {
      Entry& entry = at->second;
      entry.searchable = true;
      if (!entry.base && entry.sightings >= 3) {
        entry.base = true;
        report.promoted.push_back(at->first);
      } else if (!entry.base && step - entry.first > 7) {
        report.expired.push_back(at->first);
        at = entries.erase(at);
        continue;
      }
      ++at;
    }
    return report;
  }
  std::optional<LandmarkMatch> match(const Descriptor& query, unsigned label,
                                     const cairn::RatioTest& test) const {
    LandmarkMatch best;
    for (const auto& [id, entry] : entries) {
      if (!entry.searchable || entry.label != label) continue;
      double sum = 0;
      for (std::size_t a = 0; a < query.size(); ++a)
        sum += std::pow(static_cast<double>(query[a]) - static_cast<double>(entry.descriptor[a]), 2);
      const auto distance = static_cast<float>(std::sqrt(sum));
      if (distance < best.distance) {
        best = {id, distance, best.distance};
      } else if (distance < best.second_distance) {
        best.second_distance = distance;
      }
    }
    if (best.id == cairn::no_point || best.distance > test.max_distance) return std::nullopt;
    if (best.second_distance < test.ratio * best.distance) return std::nullopt;
    return best;
  }

  std::map<LandmarkId, Entry> entries;
  LandmarkId next = 0;
  unsigned step = 0;
};

template <class Store>
void check_match(const Store& store, const Reference& reference, const Descriptor& query, unsigned label) {
  const cairn::RatioTest test{.ratio = 1.5F, .max_distance = 1.5F};
  const auto expected = reference.match(query, label, test);
  const auto found = store.match(query, label, test);
  REQUIRE(found.has_value() == expected.has_value());
  if (!expected) return;
  CHECK(found->id == expected->id);
  CHECK(found->distance == doctest::Approx(expected->distance).epsilon(1e-4));
  if (expected->second_distance < test.ratio * test.max_distance)
    CHECK(found->second_distance == doctest::Approx(expected->second_distance).epsilon(1e-4));
}

/// A random drive: old landmarks are seen again, some are erased, new ones added.
template <class Store>
void drive(Store& store, std::uint64_t seed) {
  cairn::Random random(seed);
  Reference reference;
  for (int step = 0; step < 60; ++step) {
    for (int i = 0; i < 12; ++i) {
      const Descriptor descriptor = random_descriptor(random);
      const auto label = static_cast<unsigned>(random.below(2));
      REQUIRE(store.add(descriptor, label) == reference.add(descriptor, label));
    }
    std::vector<LandmarkId> known;
    for (const auto& [id, entry] : reference.entries) known.push_back(id);
    for (const LandmarkId id : known) {
      if (random.uniform() < 0.3) {
        store.sighted(id);
        reference.sighted(id);
      } else if (random.uniform() < 0.05) {
        REQUIRE(store.erase(id));
        reference.entries.erase(id);
        CHECK_FALSE(store.erase(id));
      }
    }
    for (int i = 0; i < 8; ++i) {
      const LandmarkId id = known[random.below(known.size())];
      if (reference.entries.count(id) == 0) continue;
      const auto& entry = reference.entries.at(id);
      check_match(store, reference, near(entry.descriptor, random, 0.1), entry.label);
      check_match(store, reference, random_descriptor(random), entry.label);
    }
    const auto report = store.advance();
    const auto expected = reference.advance();
    REQUIRE(report.promoted == expected.promoted);
    REQUIRE(report.expired == expected.expired);
    REQUIRE(store.size() == reference.entries.size());
  }
}

}  // namespace

TEST_SUITE("landmark_store") {
  TEST_CASE_TEMPLATE("landmark_store: a random drive goes as the plain table says", Store,
                     cairn::SingleTreeStore<8>, cairn::MultiTreeStore<8>) {
    for (std::uint64_t round = 0; round < 4; ++round) {
      const std::uint64_t seed = cairn_test::seed(17) + round;
      CAPTURE(seed);
      Store store({.classes = 2, .shape = {.first_size = 8, .growth = 2}});
      drive(store, seed);
    }
  }

  TEST_CASE("landmark_store: one tree and several give the same matches when the budget is unlimited") {
    const std::uint64_t seed = cairn_test::seed(3);
    CAPTURE(seed);
    cairn::Random random(seed);
    cairn::SingleTreeStore<8> single({.classes = 2});
    cairn::MultiTreeStore<8> multi({.classes = 2, .shape = {.first_size = 50, .growth = 3}});
    std::vector<Descriptor> world;
    for (int i = 0; i < 600; ++i) world.push_back(random_descriptor(random));
    std::size_t matched = 0;
    for (int step = 0; step < 20; ++step) {
      std::vector<float> queries;
      std::vector<unsigned> labels;
      for (int i = 0; i < 150; ++i) {
        const auto which = random.below(world.size());
        const Descriptor seen = near(world[which], random, 0.05);
        queries.insert(queries.end(), seen.begin(), seen.end());
        labels.push_back(which % 2);
      }
      const cairn::RatioTest test{.ratio = 1.5F, .max_distance = 2};
      const auto by_single = single.match_all(queries, labels, test, {}, 1);
      const auto by_multi = multi.match_all(queries, labels, test, {}, 2);
      REQUIRE(by_single == by_multi);
      for (std::size_t i = 0; i < labels.size(); ++i) {
        if (by_single[i]) {
          ++matched;
          single.sighted(by_single[i]->id);
          multi.sighted(by_single[i]->id);
        } else {
          const auto row = std::span<const float>(queries).subspan(8 * i, 8);
          single.add(row, labels[i]);
          multi.add(row, labels[i]);
        }
      }
      single.advance();
      multi.advance();
    }
    CHECK(matched > 1000);
    CHECK(single.base_size() == multi.base_size());
    CHECK(multi.points_moved() < single.points_moved());
  }

  TEST_CASE("landmark_store: the answers to many queries do not depend on the number of threads") {
    cairn::Random random(5);
    cairn::MultiTreeStore<8> store;
    for (int i = 0; i < 3000; ++i) store.add(random_descriptor(random));
    store.advance();
    std::vector<float> queries;
    for (int i = 0; i < 8 * 500; ++i) queries.push_back(static_cast<float>(random.normal()));
    const cairn::RatioTest test{.ratio = 1.05F};
    cairn::Work one;
    cairn::Work three;
    const auto alone = store.match_all(queries, {}, test, {.leaves = 5}, 1, &one);
    CHECK(alone == store.match_all(queries, {}, test, {.leaves = 5}, 3, &three));
    CHECK(one == three);
    CHECK(one.leaves <= 500 * 5);
    CHECK(one.leaves > 500);
  }

  TEST_CASE(
      "landmark_store: a descriptor that is not finite is refused by number and axis, and changes nothing") {
    cairn::MultiTreeStore<3> store;
    store.add(std::array{1.0F, 2.0F, 3.0F});
    const std::array bad{0.0F, std::numeric_limits<float>::quiet_NaN(), 0.0F};
    const std::string message = cairn_test::message_of([&] { store.add(bad); });
    CHECK(message.find("landmark 1, coordinate 1") != std::string::npos);
    store.advance();
    CHECK(store.size() == 1);
    const std::vector<float> queries{0, 0, 0, 0, 0, std::numeric_limits<float>::infinity()};
    const std::string of_query =
        cairn_test::message_of([&] { static_cast<void>(store.match_all(queries, {}, {})); });
    CHECK(of_query.find("query 1, coordinate 2") != std::string::npos);
  }

  TEST_CASE("landmark_store: what was added is found from the next step on, and twins are no match") {
    cairn::SingleTreeStore<2> store;
    const std::array here{1.0F, 1.0F};
    const LandmarkId id = store.add(here);
    CHECK_FALSE(store.match(here, 0, {}).has_value());
    store.advance();
    REQUIRE(store.match(here, 0, {}).has_value());
    CHECK(store.match(here, 0, {})->id == id);
    store.add(here);
    store.advance();
    CHECK_FALSE(store.match(here, 0, {}).has_value());
  }

  TEST_CASE_TEMPLATE("landmark_store: twins are merged, and what was not seen for long is forgotten", Store,
                     cairn::SingleTreeStore<2>, cairn::MultiTreeStore<2>) {
    Store store({.probation = {.base_seen_times = 2, .max_nonbase_time = 7}});
    const std::array here{1.0F, 1.0F};
    const std::array there{1.0F, 1.01F};
    const LandmarkId old = store.add(here);
    store.advance();
    store.sighted(old);
    CHECK(store.advance().promoted == std::vector<LandmarkId>{old});
    const LandmarkId kept = store.add(there);
    store.advance();
    CHECK(store.match(here, 0, {})->id == old);
    store.merge(kept, old);
    CHECK_FALSE(store.contains(old));
    CHECK(store.ledger().first_seen(kept) == 0);
    CHECK(store.ledger().sightings(kept) == 3);
    CHECK(store.match(here, 0, {})->id == kept);  // at once, though no tree was rebuilt
    CHECK(store.advance().promoted == std::vector<LandmarkId>{kept});
    CHECK(store.forget_unseen(5).empty());
    for (int i = 0; i < 4; ++i) store.advance();
    CHECK(store.forget_unseen(5) == std::vector<LandmarkId>{kept});
    CHECK(store.size() == 0);
    CHECK_FALSE(store.match(here, 0, {}).has_value());
    store.advance();
    CHECK_FALSE(store.match(here, 0, {}).has_value());
  }
}

}  // namespace landmark_store_test
