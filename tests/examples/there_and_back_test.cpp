// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "there_and_back.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "there_and_back.hpp"

namespace {

/// Frames without pictures, at uneven times.
class Numbers : public stereo_slam::Dataset {
public:
  [[nodiscard]] std::string name() const override { return "numbers"; }
  [[nodiscard]] std::size_t size() const override { return 4; }
  [[nodiscard]] const cairn::StereoRig& rig() const override { return rig_; }
  [[nodiscard]] stereo_slam::StereoFrame frame(std::size_t i) const override {
    stereo_slam::StereoFrame frame;
    frame.index = 10 + i;
    frame.time = static_cast<double>(i * i);
    return frame;
  }
  [[nodiscard]] std::vector<std::string> notes() const override { return {"a note"}; }

private:
  cairn::StereoRig rig_;
};

}  // namespace

TEST_SUITE("there_and_back") {
  TEST_CASE("there_and_back: the last frame is seen once, the first one twice, and time runs on") {
    const auto frames = stereo_slam::there_and_back(std::make_unique<Numbers>());
    REQUIRE(frames->size() == 7);
    const std::size_t expected[] = {10, 11, 12, 13, 12, 11, 10};
    double last = -1;
    for (std::size_t i = 0; i < frames->size(); ++i) {
      CHECK(frames->frame(i).index == expected[i]);
      CHECK(frames->frame(i).time > last);
      last = frames->frame(i).time;
    }
    CHECK(last == 18);
    CHECK(frames->frame(4).time == 9 + 5);
    CHECK(frames->notes().size() == 1);
  }
}
