// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Every allocation of every operation fails once: what was there before is there afterwards.
#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/bulk_match.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/tree_file.hpp>

#include "support/random.hpp"

namespace {

std::atomic<long> allocations_left{-1};  ///< negative: no end

bool is_refused() noexcept {
  return allocations_left.load() >= 0 && allocations_left.fetch_sub(1) <= 0;
}

void* taken(std::size_t size, std::size_t alignment) {
  if (is_refused()) throw std::bad_alloc();
  void* memory =
      std::aligned_alloc(alignment, (std::max<std::size_t>(size, 1) + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

// Never inlined: gcc 12, seeing one half of a pair, takes it for a mismatch.
[[gnu::noinline]] void* operator new(std::size_t size) {
  return taken(size, 16);
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t alignment) {
  return taken(size, static_cast<std::size_t>(alignment));
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

namespace {

using Point = std::array<float, 3>;

/// Runs with so many allocations and no more; false where they were not enough.
template <class Run>
bool enough(long allowed, Run&& run) {
  bool done = false;
  allocations_left = allowed;
  try {
    run();
    done = true;
  } catch (const std::bad_alloc&) {
    done = false;
  }
  allocations_left = -1;
  return done;
}

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

}  // namespace

TEST_SUITE("out_of_memory") {
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
        allocations_left = -1;  // the stream may say that it is broken
      }
      CHECK(loaded.size() == (done ? 60 : 0));
    }
    CHECK(steps > 4);
  }
}
