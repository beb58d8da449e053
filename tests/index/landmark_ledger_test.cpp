// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/landmark_ledger.hpp>

#include "support/violation.hpp"

namespace landmark_ledger_test {
namespace {

using cairn::LandmarkId;
using cairn::LandmarkLedger;

void pass_steps(LandmarkLedger& ledger, int steps) {
  for (int i = 0; i < steps; ++i) ledger.advance();
}

}  // namespace

TEST_SUITE("landmark_ledger") {
  TEST_CASE("landmark_ledger: a merged landmark was first seen when the older was and last when either was") {
    for (const bool newer_is_kept : {true, false}) {
      CAPTURE(newer_is_kept);
      LandmarkLedger ledger({.base_seen_times = 1, .max_nonbase_time = 7});
      pass_steps(ledger, 2);
      const LandmarkId older = ledger.add();
      pass_steps(ledger, 3);
      const LandmarkId newer = ledger.add();
      ledger.sighted(newer);  // once a step
      pass_steps(ledger, 1);
      ledger.sighted(newer);
      pass_steps(ledger, 1);
      const LandmarkId kept = newer_is_kept ? newer : older;
      const LandmarkId twin = newer_is_kept ? older : newer;
      ledger.merge(kept, twin);
      CHECK_FALSE(ledger.contains(twin));
      CHECK(ledger.size() == 1);
      CHECK(ledger.first_seen(kept) == 2);
      CHECK(ledger.last_seen(kept) == 6);
      CHECK(ledger.sightings(kept) == 3);
      pass_steps(ledger, 3);  // step 10
      CHECK(ledger.unseen_for(4).empty());
      CHECK(ledger.unseen_for(3) == std::vector<LandmarkId>{kept});
    }
  }

  TEST_CASE("landmark_ledger: where either of two merged was base, the one kept is from the next step on") {
    LandmarkLedger ledger({.base_seen_times = 3, .max_nonbase_time = 7});
    const LandmarkId base = ledger.add();
    pass_steps(ledger, 1);
    ledger.sighted(base);
    pass_steps(ledger, 1);
    ledger.sighted(base);
    CHECK(ledger.advance().promoted == std::vector<LandmarkId>{base});
    const LandmarkId kept = ledger.add();
    ledger.merge(kept, base);
    CHECK_FALSE(ledger.is_base(kept));
    CHECK(ledger.base_size() == 0);
    CHECK(ledger.probation_size() == 1);
    CHECK(ledger.advance().promoted == std::vector<LandmarkId>{kept});
    CHECK(ledger.base_size() == 1);
    CHECK(ledger.probation_size() == 0);
  }

  TEST_CASE("landmark_ledger: one that is trusted is base from the next step on") {
    LandmarkLedger ledger({.base_seen_times = 3, .max_nonbase_time = 7});
    const LandmarkId trusted = ledger.add(), other = ledger.add();
    ledger.trust(trusted);
    CHECK_FALSE(ledger.is_base(trusted));
    CHECK(ledger.advance().promoted == std::vector<LandmarkId>{trusted});
    CHECK(ledger.is_base(trusted));
    CHECK_FALSE(ledger.is_base(other));
    CHECK(ledger.base_size() == 1);
    CHECK(ledger.probation_size() == 1);
  }

  TEST_CASE("landmark_ledger: a landmark expires more than its time after it was first seen, not at it") {
    LandmarkLedger ledger({.base_seen_times = 3, .max_nonbase_time = 4});
    const LandmarkId id = ledger.add();
    for (int step = 0; step < 4; ++step) CHECK(ledger.advance().expired.empty());
    CHECK(ledger.advance().expired == std::vector<LandmarkId>{id});
    CHECK(ledger.size() == 0);
    CHECK_FALSE(ledger.erase(id));
  }

  TEST_CASE("landmark_ledger: what is no landmark is refused, and nothing changes") {
    using cairn_test::violation_of;
    LandmarkLedger ledger;
    const LandmarkId id = ledger.add();
    CHECK(violation_of([&] { ledger.merge(id, id); }).find("no twin of itself") != std::string::npos);
    CHECK(violation_of([&] { ledger.merge(id, 7); }).find("no such landmark") != std::string::npos);
    CHECK(violation_of([&] { ledger.sighted(7); }).find("no such landmark") != std::string::npos);
    CHECK(ledger.sightings(id) == 1);
    CHECK(ledger.size() == 1);
  }
}

}  // namespace landmark_ledger_test
