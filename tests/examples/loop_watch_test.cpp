// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "loop_watch.hpp"

#include <vector>

#include <doctest/doctest.h>

namespace loop_watch_test {

using stereo_slam::LoopWatch;

TEST_SUITE("loop_watch") {
  TEST_CASE("loop_watch: a loop begins with the first frame of a return, and not again while that lasts") {
    LoopWatch watch({.away = 10, .landmarks = 3});
    const std::vector<int> recent{1, 1, 2, 10, 10}, returned{1, 11, 200, 12}, too_few{1, 11, 200};
    CHECK_FALSE(watch.observe(0, recent));
    CHECK_FALSE(watch.observe(300, too_few));
    CHECK(watch.observe(301, returned));
    for (int step = 302; step < 320; ++step)
      CHECK_FALSE(watch.observe(step, step % 2 == 0 ? returned : recent));
    CHECK_FALSE(watch.observe(328, returned));  // ten steps after the last of them
    CHECK(watch.observe(339, returned));        // eleven
    CHECK_FALSE(watch.observe(340, {}));
  }
}

}  // namespace loop_watch_test
