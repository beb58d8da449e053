// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/io/netpbm.hpp>

#include "dataset.hpp"
#include "recording.hpp"
#include "support/folder.hpp"

namespace image_globs_test {
namespace {

namespace fs = std::filesystem;

class Images : public cairn_test::Folder {
public:
  Images(std::initializer_list<const char*> left, std::initializer_list<const char*> right) {
    for (const char* side : {"l", "r"}) fs::create_directory(path() / side);
    for (const char* name : left) cairn::write_pgm(path() / "l" / name, cairn::Image(12, 8, 100));
    for (const char* name : right) cairn::write_pgm(path() / "r" / name, cairn::Image(12, 8, 100));
  }
  [[nodiscard]] stereo_slam::ImageGlobs globs(std::optional<double> rate = {}) const {
    return {(path() / "l" / "*").string(), (path() / "r" / "*").string(), rate};
  }
};

/// Left and right name of every frame.
std::vector<std::string> names(const stereo_slam::Recording& recording) {
  std::vector<std::string> result;
  for (const auto& frame : recording.frames)
    result.push_back(frame.left.filename().string() + " " + frame.right.filename().string());
  return result;
}

std::string refusal(const stereo_slam::ImageGlobs& globs) {
  return cairn_test::message_of([&] { static_cast<void>(stereo_slam::read_images(globs)); });
}

bool says(const std::string& message, const std::string& words) {
  return message.find(words) != std::string::npos;
}

}  // namespace

TEST_SUITE("image_globs") {
  TEST_CASE("image_globs: pairs have the same number, in the order in which people count") {
    const Images images({"left1.pgm", "left10.pgm", "left2.pgm"},
                        {"right_01.pgm", "right_02.pgm", "right_10.pgm"});
    const auto recording = stereo_slam::read_images(images.globs());
    CHECK(names(recording) == std::vector<std::string>{"left1.pgm right_01.pgm", "left2.pgm right_02.pgm",
                                                       "left10.pgm right_10.pgm"});
    CHECK(recording.frames[2].time == doctest::Approx(0.2));
    REQUIRE(recording.notes.size() == 1);
    CHECK(says(recording.notes[0], "10 frames a second are assumed (--fps says otherwise)"));
  }

  TEST_CASE("image_globs: --fps is the clock") {
    const Images images({"1.pgm", "2.pgm"}, {"1.pgm", "2.pgm"});
    const auto recording = stereo_slam::read_images(images.globs(4));
    CHECK(recording.frames[1].time == 0.25);
    CHECK(recording.notes.empty());
  }

  TEST_CASE("image_globs: an image without a partner is left out, and said so") {
    const Images images({"1.pgm", "2.pgm", "4.pgm"}, {"2.pgm", "3.pgm", "4.pgm"});
    const auto recording = stereo_slam::read_images(images.globs(1));
    CHECK(names(recording) == std::vector<std::string>{"2.pgm 2.pgm", "4.pgm 4.pgm"});
    REQUIRE(recording.notes.size() == 1);
    CHECK(says(recording.notes[0], "same number: 1 left, 1 right"));
  }

  TEST_CASE("image_globs: names that are times") {
    const Images nanoseconds({"1403636579763555584.pgm", "1403636579813555456.pgm"},
                             {"1403636579763555584.pgm", "1403636579813555456.pgm"});
    auto recording = stereo_slam::read_images(nanoseconds.globs());
    CHECK(recording.frames[1].time - recording.frames[0].time == doctest::Approx(0.05).epsilon(1e-4));
    const Images seconds({"1305031102.175304.pgm", "1305031102.211214.pgm"},
                         {"1305031102.175304.pgm", "1305031102.211214.pgm"});
    recording = stereo_slam::read_images(seconds.globs());
    CHECK(recording.frames[0].time == 1305031102.175304);
    CHECK(recording.frames[1].time == 1305031102.211214);
  }

  TEST_CASE("image_globs: without numbers in common they are paired in order if they are as many") {
    const Images equal({"a1.pgm", "a2.pgm"}, {"b11.pgm", "b12.pgm"});
    const auto recording = stereo_slam::read_images(equal.globs(1));
    CHECK(names(recording) == std::vector<std::string>{"a1.pgm b11.pgm", "a2.pgm b12.pgm"});
    CHECK(says(recording.notes.at(0), "paired in order, a1.pgm with b11.pgm"));
    const Images unequal({"a.pgm", "b.pgm"}, {"c.pgm"});
    CHECK(says(refusal(unequal.globs()), "2 left images and 1 right ones"));
  }

  TEST_CASE("image_globs: the same image of both cameras is refused") {
    const Images both({"1.pgm", "2.pgm"}, {});
    auto globs = both.globs(1);
    globs.right = globs.left;
    CHECK(says(refusal(globs), "--left and --right name the same"));
  }

  TEST_CASE("image_globs: a pattern that no file has is named") {
    const Images none({}, {"1.pgm"});
    CHECK(says(refusal(none.globs()), "--left '"));
    CHECK(says(refusal(none.globs()), "no file has such a name"));
    const Images other({"1.pgm"}, {});
    CHECK(says(refusal(other.globs()), "--right '"));
    CHECK(says(refusal({"", "", {}}), "no file has such a name"));
  }

  TEST_CASE(
      "image_globs: images with a rig are a data set, those of another size than the rig's are refused") {
    const Images images({"1.pgm", "2.pgm"}, {"1.pgm", "2.pgm"});
    const auto open = [&](int width) {
      cairn::PinholeParameters p;
      p.fx = p.fy = 20;
      p.width = width;
      p.height = 8;
      stereo_slam::DatasetOptions options;
      options.kind = "images";
      options.rig = cairn::StereoRig{cairn::PinholeCamera(p), cairn::PinholeCamera(p),
                                     cairn::SE3(cairn::SO3(), cairn::Vector<3>(0.1, 0, 0))};
      options.left = images.globs().left;
      options.right = images.globs().right;
      return stereo_slam::open_dataset(options);
    };
    const auto dataset = open(12);
    CHECK(dataset->size() == 2);
    CHECK(dataset->rig().baseline() == 0.1);
    CHECK(dataset->frame(1).left.width() == 12);
    const auto wrong = open(14);
    const std::string message = cairn_test::message_of([&] { static_cast<void>(wrong->frame(0)); });
    CHECK(
        says(message, "1.pgm: the image has 12 x 8 pixels; expected 14 x 8 pixels as the calibrated camera"));
    stereo_slam::DatasetOptions options;
    options.kind = "images";
    CHECK(says(cairn_test::message_of([&] { static_cast<void>(stereo_slam::open_dataset(options)); }),
               "images need a rig"));
    options.kind = "arena";
    options.rig = dataset->rig();
    CHECK(says(cairn_test::message_of([&] { static_cast<void>(stereo_slam::open_dataset(options)); }),
               "the arena is rendered with a rig of its own"));
  }
}

}  // namespace image_globs_test
