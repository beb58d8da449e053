// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Every allocation of every operation fails once: what was there before is there afterwards.
#include <algorithm>
#include <array>
#include <cstddef>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/landmark_store.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/packed_points.hpp>
#include <cairn/index/tree_file.hpp>

#include "support/failing_memory.hpp"
#include "support/random.hpp"

namespace {

using cairn_test::enough;
using Point = std::array<float, 3>;

std::vector<Point> random_points(std::size_t count, cairn::Random& random) {
  std::vector<Point> points(count);
  for (Point& point : points)
    for (float& number : point) number = static_cast<float>(random.uniform());
  return points;
}

/// What can be seen of an index.
template <class Index>
std::vector<float> answers(const Index& index, const std::vector<Point>& queries) {
  std::vector<float> all{static_cast<float>(index.size())};
  for (const Point& query : queries)
    for (const auto& hit : index.nearest(query, 9)) {
      all.push_back(hit.distance);
      all.push_back(static_cast<float>(hit.id));
    }
  return all;
}

using Forest = cairn::MultiKdTree<float, 3>;

/// Points in several trees, the first so many of them erased.
Forest make_forest(cairn::Merging merging, cairn::PointId erased) {
  cairn::Random random(7);
  Forest forest({.first_size = 40, .growth = 2, .merging = merging});
  for (int step = 0; step < 9; ++step) forest.insert(random_points(30, random));
  for (cairn::PointId id = 0; id < erased; ++id) forest.erase(id);
  return forest;
}

/// Fails every allocation of `change` in turn on a forest of its own; returns how many there are.
template <class Change>
long check_change(cairn::Merging merging, cairn::PointId erased, const std::vector<Point>& queries,
                  Change&& change) {
  std::vector<float> before;
  std::vector<float> after;
  {
    Forest forest = make_forest(merging, erased);
    before = answers(forest, queries);
    change(forest);
    after = answers(forest, queries);
  }
  for (long allowed = 0;; ++allowed) {
    Forest forest = make_forest(merging, erased);
    const bool done = enough(allowed, [&] { change(forest); });
    CAPTURE(allowed);
    REQUIRE(answers(forest, queries) == (done ? after : before));
    if (done) return allowed;
    change(forest);  // and it works when there is memory again
    REQUIRE(answers(forest, queries) == after);
  }
}

using Store = cairn::MultiTreeStore<3>;

/// A store some steps old: base landmarks, some erased, others on probation, some added in the open step.
Store make_store() {
  cairn::Random random(11);
  Store store(
      {.probation = {.base_seen_times = 2, .max_nonbase_time = 3}, .shape = {.first_size = 8, .growth = 2}});
  for (int step = 0; step < 6; ++step) {
    cairn::LandmarkId last = 0;
    for (const Point& point : random_points(12, random)) last = store.add(point);
    if (step > 0)
      for (cairn::LandmarkId id = last - 23; id < last - 16; ++id) store.sighted(id);
    if (step < 5) store.advance();
  }
  for (cairn::LandmarkId id = 0; id < 14; ++id) store.erase(id);
  return store;
}

/// What can be seen of a store without a ratio test's limits: who is there, as what, and the nearest to each
/// query, told only where it is no twin of another.
std::vector<float> answers_of(const Store& store, const std::vector<Point>& queries) {
  std::vector<float> all{static_cast<float>(store.size()), static_cast<float>(store.base_size())};
  for (cairn::LandmarkId id = 0; id < 100; ++id)
    all.push_back(static_cast<float>(store.contains(id)) + 2 * static_cast<float>(store.is_base(id)));
  for (const Point& query : queries) {
    const auto match = store.match(query, 0, {.ratio = 1.001F});
    all.push_back(match ? static_cast<float>(match->id) : -1);
    all.push_back(match ? match->distance : -1);
  }
  return all;
}

/// Fails every allocation of `change` in turn on a store of its own, prepared, which must stay as it was;
/// returns how many there are.
template <class Prepare, class Change>
long check_store(const std::vector<Point>& queries, Prepare&& prepare, Change&& change) {
  Store changed = make_store();
  prepare(changed);
  const std::vector<float> before = answers_of(changed, queries);
  change(changed);
  const std::vector<float> after = answers_of(changed, queries);
  const Point far{9, 9, 9};  // from all others
  for (long allowed = 0;; ++allowed) {
    Store store = make_store();
    prepare(store);
    const bool done = enough(allowed, [&] { change(store); });
    CAPTURE(allowed);
    REQUIRE(answers_of(store, queries) == (done ? after : before));
    if (done) return allowed;
    change(store);
    REQUIRE(answers_of(store, queries) == after);
    const cairn::LandmarkId id = store.add(far);  // numbers still mean the same to all parts of the store
    store.advance();
    REQUIRE(store.match(far, 0, {}).value_or(cairn::LandmarkMatch{}).id == id);
  }
}

}  // namespace

TEST_SUITE("out_of_memory") {
  TEST_CASE("out_of_memory: a landmark store keeps all that it had when adding, erasing or merging fails") {
    cairn::Random random(12);
    const auto queries = random_points(12, random);
    const auto as_it_is = [](Store&) {};
    long most = 0;  // some addition finds every list full
    for (std::size_t added = 0; added < 70; ++added) {
      const auto add_some = [&](Store& store) {
        for (std::size_t i = 0; i < added; ++i) store.add(queries[i % queries.size()]);
      };
      most = std::max(most, check_store(queries, add_some, [&](Store& store) { store.add(queries[1]); }));
    }
    CHECK(most > 1);
    check_store(queries, as_it_is, [&](Store& store) { store.merge(45, 28); });
    most = 0;  // the erasure that leaves more dead than alive in the trees of base landmarks
    for (cairn::LandmarkId id = 14; id < 50; ++id) {
      const auto erase_those_before = [&](Store& store) {
        for (cairn::LandmarkId before = 14; before < id; ++before) store.erase(before);
      };
      most = std::max(most, check_store(queries, erase_those_before, [&](Store& store) { store.erase(id); }));
    }
    CHECK(most > 4);
  }

  TEST_CASE(
      "out_of_memory: a step of a landmark store that fails loses nobody, and the next makes up for it") {
    cairn::Random random(13);
    const auto queries = random_points(30, random);
    Store expected = make_store();
    expected.advance();
    expected.advance();
    const std::vector<float> after = answers_of(expected, queries);
    const std::vector<float> before = answers_of(make_store(), queries);
    long failed = 0;
    for (bool done = false; !done; ++failed) {
      CAPTURE(failed);
      Store store = make_store();
      done = enough(failed, [&] { store.advance(); });
      if (!done) {
        // The step may have ended or not. What is matched is there, and no landmark is its own twin.
        std::size_t matched = 0;
        for (const Point& query : queries)
          if (const auto match = store.match(query, 0, {.ratio = 1.001F}))
            matched += store.contains(match->id);
        CHECK(matched >= queries.size() / 2);
        const bool ended = store.ledger().step() == 6;
        if (!ended) store.advance();
        CHECK(store.ledger().step() == 6);
      }
      store.advance();
      REQUIRE(answers_of(store, queries) == after);
    }
    CHECK(failed > 10);
    CHECK(before != after);
  }

  TEST_CASE("out_of_memory: an insertion, an erasure or a rebuilding that fails leaves the index as it was") {
    cairn::Random random(8);
    const auto points = random_points(35, random);
    const auto queries = random_points(6, random);
    for (const auto merging : {cairn::Merging::at_once, cairn::Merging::spread, cairn::Merging::background}) {
      CAPTURE(static_cast<int>(merging));
      CHECK(check_change(merging, 130, queries, [&](Forest& forest) { forest.insert(points); }) > 4);
      CHECK(check_change(merging, 130, queries, [&](Forest& forest) { forest.rebuild(); }) > 4);
      check_change(merging, 130, queries, [&](Forest& forest) { forest.finish_merges(); });
      long most = 0;  // the erasure that leaves more dead than alive starts a merge
      for (cairn::PointId id = 125; id < 145; ++id)
        most = std::max(most, check_change(merging, id, queries, [&](Forest& forest) { forest.erase(id); }));
      CHECK(most > 4);
    }
  }

  TEST_CASE("out_of_memory: insertions into cells, and erasures, fail as a whole") {
    cairn::Random random(12);
    std::vector<Point> points = random_points(90, random);
    const auto queries = random_points(6, random);
    using Cells = cairn::DescriptorIndex<std::vector<Point>>;
    const auto more = random_points(60, random);
    for (const auto codes : {cairn::DescriptorCodes::off, cairn::DescriptorCodes::on}) {
      points.resize(90);
      const Cells small(points, {.points_in_cell = 6, .codes = codes});
      points.insert(points.end(), more.begin(), more.end());
      const auto before = answers(small, queries);
      Cells grown = small;
      grown.insert(90, 60);
      const auto after = answers(grown, queries);
      REQUIRE(grown.cells() >= small.cells() + 2);
      long allowed = 0;
      for (bool done = false; !done; ++allowed) {
        CAPTURE(allowed);
        Cells index = small;
        done = enough(allowed, [&] { index.insert(90, 60); });
        REQUIRE(answers(index, queries) == (done ? after : before));
        index.erase(3);
        if (!done) index.insert(90, 60);
        index.insert(3);
        REQUIRE(answers(index, queries) == after);
      }
      CHECK(allowed > 30);
      for (long few = 0; few < 2; ++few) {
        Cells index = small;
        REQUIRE_FALSE(enough(few, [&] { index.erase(5); }));
        REQUIRE(answers(index, queries) == before);
      }
    }
  }

  TEST_CASE("out_of_memory: searches and builds that fail can be tried again") {
    cairn::Random random(9);
    const auto points = random_points(700, random);
    const auto queries = random_points(20, random);
    const cairn::KdTree<float, 3> tree(points);
    const auto expected = tree.within(queries[0], 0.3F);
    cairn::BestBinFirst<cairn::KdTree<float, 3>> search;
    long steps = 0;
    for (bool done = false; !done; ++steps)
      done = enough(steps, [&] {
        const cairn::KdTree<float, 3> again(points);
        static_cast<void>(again.within(queries[0], 0.3F));
        cairn::NearestTwo<float> two;
        search.search(tree, queries[0], two);
        const cairn::PackedPoints packed(points);
        static_cast<void>(nearest_two(packed, queries));
      });
    CHECK(steps > 15);
    CHECK(tree.within(queries[0], 0.3F) == expected);
    cairn::NearestTwo<float> two;
    CHECK(search.search(tree, queries[0], two));
    CHECK(two.id() == tree.nearest(queries[0])->id);
  }

  TEST_CASE("out_of_memory: loading fails as a whole") {
    cairn::Random random(10);
    const cairn::KdTree<float, 3> tree(random_points(60, random));
    std::ostringstream out;
    cairn::save_tree(out, tree);
    const std::string bytes = out.str();
    long steps = 0;
    for (bool done = false; !done; ++steps) {
      std::istringstream in(bytes);
      cairn::KdTree<float, 3> loaded;
      try {
        done = enough(steps, [&] { loaded = cairn::load_tree<cairn::KdTree<float, 3>>(in, "memory"); });
      } catch (const cairn::Error&) {
        cairn_test::allocations_left = -1;  // the stream may say that it is broken
      }
      CHECK(loaded.size() == (done ? 60 : 0));
    }
    CHECK(steps > 4);
  }
}
