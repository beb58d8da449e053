// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "dataset.hpp"

#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>
#include <cairn/io/trajectory.hpp>

#include "arena_dataset.hpp"
#include "recording.hpp"
#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/image_io.hpp"

namespace dataset_test {
namespace {

namespace fs = std::filesystem;
using stereo_slam::DatasetOptions;
using stereo_slam::StereoFrame;

constexpr int width = 12, height = 8;

// A picture that tells which frame and camera it is of.
cairn::Image picture(std::size_t frame, int camera) {
  return cairn::Image(width, height,
                      static_cast<std::uint8_t>(10 * frame + static_cast<std::size_t>(camera)));
}

std::unique_ptr<stereo_slam::Dataset> open(const std::string& kind, const fs::path& folder,
                                           std::size_t frames = 0) {
  DatasetOptions options;
  options.kind = kind;
  options.folder = folder;
  options.frames = frames;
  return stereo_slam::open_dataset(options);
}

// Opens and reads every frame; what is said if that fails.
std::string refusal(const std::string& kind, const fs::path& folder) {
  return cairn_test::message_of([&] {
    const auto dataset = open(kind, folder);
    for (std::size_t i = 0; i < dataset->size(); ++i) static_cast<void>(dataset->frame(i));
  });
}

bool says(const std::string& message, const std::vector<std::string>& words) {
  CAPTURE(message);
  bool all = true;
  for (const std::string& word : words) {
    CAPTURE(word);
    const bool found = message.find(word) != std::string::npos;
    CHECK(found);
    all = all && found;
  }
  return all;
}

std::string digits(std::size_t number, std::size_t count) {
  const std::string text = std::to_string(number);
  return std::string(count - text.size(), '0') + text;
}

// ---------------------------------------------------------------- KITTI odometry

class OdometryFolder : public cairn_test::Folder {
public:
  OdometryFolder() {
    fs::create_directories(path() / "image_0");
    fs::create_directories(path() / "image_1");
    for (std::size_t i = 0; i < 3; ++i) {
      example::write_png(left(i), picture(i, 0));
      example::write_png(right(i), picture(i, 1));
    }
    put("calib.txt", "P0: 100 0 6 0 0 110 4 0 0 0 1 0\nP1: 100 0 6 -50 0 110 4 0 0 0 1 0\n");
    put("times.txt", "0\n0.1\n0.25\n");
    put("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 2\n1 0 0 0 0 1 0 0 0 0 1 4\n");
  }
  [[nodiscard]] fs::path left(std::size_t i) const { return path() / "image_0" / (digits(i, 6) + ".png"); }
  [[nodiscard]] fs::path right(std::size_t i) const { return path() / "image_1" / (digits(i, 6) + ".png"); }
};

// ---------------------------------------------------------------- KITTI raw

class RawFolder : public cairn_test::Folder {
public:
  RawFolder() {
    for (const char* camera : {"image_00", "image_01"}) {
      fs::create_directories(path() / camera / "data");
      std::string times;
      for (int i = 0; i < 6; ++i) times += "2011-09-26 23:59:59." + std::to_string(i) + "00000000\n";
      put(std::string(camera) + "/timestamps.txt", times);
    }
    for (std::size_t i = 0; i < 6; ++i) {
      if (i != 3) example::write_png(image(0, i), picture(i, 0));
      if (i != 4) example::write_png(image(1, i), picture(i, 1));
    }
    put("calib_cam_to_cam.txt", calibration());
    put("poses_cam0_rectified.txt",
        "# frame, pose\n1 1 0 0 0 0 1 0 0 0 0 1 0\n2 1 0 0 0 0 1 0 0 0 0 1 1.5\n5 1 0 0 0 0 1 0 0 0 0 1 4\n");
  }
  [[nodiscard]] fs::path image(int camera, std::size_t i) const {
    return path() / ("image_0" + std::to_string(camera)) / "data" / (digits(i, 10) + ".png");
  }
  // Camera 1 stands half a metre to the right and is turned by a quarter about its view; camera 0 was turned
  // by a quarter for rectification.
  static std::string calibration() {
    return "calib_time: 09-Jan-2012 13:57:47\n"
           "S_00: 12 8\nK_00: 100 0 6 0 110 4 0 0 1\nD_00: -0.3 0.1 0.001 0.002 -0.02\n"
           "R_00: 1 0 0 0 1 0 0 0 1\nT_00: 0 0 0\nR_rect_00: 0 -1 0 1 0 0 0 0 1\n"
           "S_01: 12 8\nK_01: 101 0 6.5 0 111 4.5 0 0 1\nD_01: -0.31 0.11 0.0011 0.0021 -0.021\n"
           "R_01: 0 -1 0 1 0 0 0 0 1\nT_01: 0 -0.5 0\n";
  }
};

// ---------------------------------------------------------------- EuRoC

class EurocFolder : public cairn_test::Folder {
public:
  EurocFolder() {
    for (const std::string camera : {"cam0", "cam1"}) {
      fs::create_directories(path() / "mav0" / camera / "data");
      put("mav0/" + camera + "/sensor.yaml", sensor(camera == "cam0" ? 0.0 : 0.11));
      std::string list = "#timestamp [ns],filename\n";
      for (std::size_t i = 0; i < 4; ++i) {
        if (i == 2 && camera == "cam1") continue;
        const std::string name = time(i) + ".png";
        example::write_png(path() / "mav0" / camera / "data" / name, picture(i, camera == "cam0" ? 0 : 1));
        list += time(i) + "," + name + "\r\n";
      }
      put("mav0/" + camera + "/data.csv", list);
    }
    // The body moves along x at 1 m/s and turns about z at 1 rad/s; poses every 10 ms from 30 ms on.
    std::string truth = "#timestamp, p_RS_R_x [m], ...\n";
    for (int i = 3; i < 40; ++i) {
      const double t = 0.01 * i;
      truth += std::to_string(1403636579763555584 + 10'000'000LL * i) + "," + std::to_string(t) + ",0,0," +
               std::to_string(std::cos(t / 2)) + ",0,0," + std::to_string(std::sin(t / 2)) + ",0,0,0\n";
    }
    fs::create_directories(path() / "mav0" / "state_groundtruth_estimate0");
    put("mav0/state_groundtruth_estimate0/data.csv", truth);
  }
  static std::string time(std::size_t i) { return std::to_string(1403636579763555584 + 55'000'000 * i); }
  static std::string sensor(double x) {
    return "# a camera\nsensor_type: camera\ncomment: VI-Sensor\nT_BS:\n  cols: 4\n  rows: 4\n"
           "  data: [0.0, -1.0, 0.0, " +
           std::to_string(x) +
           ",\n         1.0, 0.0, 0.0, 0.02,\n         0.0, 0.0, 1.0, 0.0,\n         0.0, 0.0, 0.0, 1.0]\n"
           "rate_hz: 20\nresolution: [12, 8]\ncamera_model: pinhole\n"
           "intrinsics: [458.654, 457.296, 6.2, 4.3] #fu, fv, cu, cv\n"
           "distortion_model: radial-tangential\n"
           "distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]\n";
  }
};

void replace_in(const fs::path& file, const std::string& from, const std::string& to) {
  std::string text = cairn::read_file(file);
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  text.replace(at, from.size(), to);
  cairn::write_file_atomically(file, text);
}

double distance(const cairn::SE3& a, const cairn::SE3& b) {
  return (a.inverse() * b).log().norm();
}

}  // namespace

TEST_SUITE("dataset") {
  TEST_CASE("dataset: an unknown kind and a folder that is none are refused in words") {
    CHECK(refusal("video", "/") ==
          "there is no kind of data set 'video'; expected arena, kitti_odometry, kitti_raw, euroc or images");
    const cairn_test::Folder folder;
    folder.put("file", "");
    for (const char* kind : {"kitti_odometry", "kitti_raw", "euroc"}) {
      CHECK(says(refusal(kind, ""), {kind, "needs a folder"}));
      CHECK(says(refusal(kind, folder / "none"), {"none: no such folder", "expected a"}));
      CHECK(says(refusal(kind, folder / "file"), {"file: is no folder", "expected a"}));
      CHECK(says(refusal(kind, folder.path()), {"no such folder", "expected"}));
    }
  }

  TEST_CASE("kitti_odometry: frames, times, rig and poses are those of the files") {
    const OdometryFolder folder;
    const auto dataset = open("kitti_odometry", folder.path().string() + "/");
    CHECK(dataset->name() == "kitti_odometry " + folder.path().filename().string());
    REQUIRE(dataset->size() == 3);
    CHECK(dataset->rig().rectified());
    CHECK(dataset->rig().baseline() == doctest::Approx(0.5));
    CHECK(dataset->rig().left.fy() == 110);
    CHECK(dataset->rig().left.cx() == 6);
    CHECK(dataset->rig().right.width() == width);
    const StereoFrame frame = dataset->frame(2);
    CHECK(frame.index == 2);
    CHECK(frame.time == 0.25);
    CHECK(frame.left == picture(2, 0));
    CHECK(frame.right == picture(2, 1));
    REQUIRE(frame.truth.has_value());
    CHECK(frame.truth->translation()(2) == 4);
    CHECK(dataset->notes().empty());
    CHECK(open("kitti_odometry", folder.path(), 2)->size() == 2);
  }

  TEST_CASE("kitti_odometry: times and poses may be absent, and poses may lie where KITTI puts them") {
    const OdometryFolder folder;
    fs::remove(folder / "times.txt");
    CHECK(open("kitti_odometry", folder.path())->frame(2).time == doctest::Approx(0.2));
    const cairn_test::Folder root;
    fs::create_directories(root / "poses");
    fs::create_directories(root / "sequences");
    fs::copy(folder.path(), root / "sequences/07", fs::copy_options::recursive);
    fs::rename(root / "sequences/07/poses.txt", root / "poses/07.txt");
    CHECK(open("kitti_odometry", root / "sequences/07")->frame(1).truth.has_value());
    fs::remove(root / "poses/07.txt");
    const auto dataset = open("kitti_odometry", root / "sequences/07");
    CHECK_FALSE(dataset->frame(1).truth.has_value());
    REQUIRE(dataset->notes().size() == 1);
    CHECK(dataset->notes()[0] == "no true poses: errors cannot be computed");
  }

  TEST_CASE("kitti_odometry: the calibration may be two rows without names") {
    const OdometryFolder folder;
    folder.put("calib.txt", "100 0 6 0 0 110 4 0 0 0 1 0\n100 0 6 -50 0 110 4 0 0 0 1 0");
    CHECK(open("kitti_odometry", folder.path())->rig().baseline() == doctest::Approx(0.5));
    folder.put("calib.txt", "100 0 6 0 0 110 4 0 0 0 1 0\n");
    CHECK(says(refusal("kitti_odometry", folder.path()), {"calib.txt:1", "second row"}));
  }

  TEST_CASE("kitti_odometry: every broken file is refused by name, with what was expected") {
    const auto broken = [](const std::function<void(const OdometryFolder&)>& breaking) {
      const OdometryFolder folder;
      breaking(folder);
      return refusal("kitti_odometry", folder.path());
    };
    using F = const OdometryFolder&;
    CHECK(says(broken([](F f) { fs::remove(f.right(2)); }),
               {"image_1: holds 2 images; expected 3 as in", "image_0"}));
    CHECK(says(broken([](F f) { fs::rename(f.right(1), f.path() / "image_1/000009.png"); }),
               {"000002.png: has no partner; expected", "image_1/000001.png"}));
    CHECK(says(broken([](F f) { fs::remove_all(f / "image_1"); }), {"image_1: no such folder; expected"}));
    CHECK(says(broken([](F f) {
                 for (std::size_t i = 0; i < 3; ++i)
                   fs::rename(f.left(i), f.left(i).replace_extension("jpg"));
               }),
               {"image_0: holds no .png or .pgm file"}));
    CHECK(says(broken([](F f) {
                 const std::string bytes = cairn::read_file(f.left(1));
                 cairn::write_file_atomically(f.left(1), bytes.substr(0, bytes.size() / 2));
               }),
               {"image_0/000001.png: damaged PNG"}));
    CHECK(says(broken([](F f) { cairn::write_file_atomically(f.left(2), "no picture"); }),
               {"image_0/000002.png: neither PNG nor JPEG nor PGM"}));
    CHECK(says(broken([](F f) { example::write_png(f.right(2), cairn::Image(5, 6)); }),
               {"image_1/000002.png: the image has 5 x 6 pixels; expected 12 x 8"}));
    CHECK(says(broken([](F f) { fs::remove(f / "calib.txt"); }), {"calib.txt: no such file"}));
    CHECK(says(broken([](F f) { replace_in(f / "calib.txt", "P1:", "P2:"); }),
               {"calib.txt: lacks the key P1; expected 'P1:' with 12 finite numbers"}));
    CHECK(
        says(broken([](F f) { replace_in(f / "calib.txt", "P1: 100", "P1:"); }), {"key P1 has 11 numbers"}));
    CHECK(says(broken([](F f) { replace_in(f / "calib.txt", "P1: 100", "P1: nan"); }), {"not finite"}));
    CHECK(says(broken([](F f) { replace_in(f / "calib.txt", "-50", "50"); }), {"to the right"}));
    CHECK(says(broken([](F f) { f.put("times.txt", "0\n0.1\n"); }), {"times.txt", "3 frames"}));
    CHECK(says(broken([](F f) { f.put("times.txt", "5\n3\n3\n"); }), {"times.txt:2", "backwards"}));
    CHECK(says(broken([](F f) { f.put("times.txt", "5\n5\n-1\n"); }), {"times.txt:3", "backwards"}));
    CHECK(says(broken([](F f) { f.put("times.txt", "0\nnan\n1\n"); }), {"times.txt:2", "finite"}));
    CHECK(says(broken([](F f) { f.put("times.txt", "0\n1\n2\n3\n"); }), {"times.txt:4", "no more than 3"}));
    CHECK(broken([](F f) { f.put("times.txt", "0\n1\n1\n"); }).empty());  // as published drives have them
    CHECK(says(broken([](F f) { replace_in(f / "calib.txt", "P1:", "P0: 1\nP1:"); }),
               {"calib.txt:2", "one line 'P0:'"}));
    CHECK(says(broken([](F f) { f.put("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n"); }),
               {"poses.txt: holds 1 poses; expected 3, one a frame"}));
    CHECK(says(broken([](F f) { replace_in(f / "poses.txt", "1 0", "2 0"); }), {"poses.txt:1"}));
    CHECK(broken([](F) {}).empty());
  }

  TEST_CASE("kitti_raw: pairs are kept, the unpaired are named, frames before the first pose are left out") {
    const RawFolder folder;
    const auto dataset = open("kitti_raw", folder.path());
    REQUIRE(dataset->size() == 3);
    CHECK(dataset->frame(0).index == 1);
    CHECK(dataset->frame(1).index == 2);
    CHECK(dataset->frame(2).index == 5);
    CHECK(dataset->frame(2).left == picture(5, 0));
    CHECK(dataset->frame(2).right == picture(5, 1));
    CHECK(dataset->frame(2).time - dataset->frame(0).time == doctest::Approx(0.4).epsilon(1e-5));
    const std::vector<std::string> notes = dataset->notes();
    REQUIRE(notes.size() == 3);
    CHECK(notes[0] == "left out, no image of the left camera: frame 3");
    CHECK(notes[1] == "left out, no image of the right camera: frame 4");
    CHECK(notes[2] == "left out, before the first true pose: frame 0");
  }

  TEST_CASE("kitti_raw: the rig is that of the unrectified cameras, and so are the poses") {
    const RawFolder folder;
    const auto dataset = open("kitti_raw", folder.path());
    const cairn::StereoRig& rig = dataset->rig();
    CHECK_FALSE(rig.rectified());
    CHECK(rig.left.parameters().k1 == -0.3);
    CHECK(rig.left.parameters().k2 == 0.1);
    CHECK(rig.left.parameters().p1 == 0.001);
    CHECK(rig.left.parameters().p2 == 0.002);
    CHECK(rig.left.parameters().k3 == -0.02);
    CHECK(rig.right.fy() == 111);
    // x_1 = R_01 x_0 + T_01, so camera 1 stands at -R_01^T T_01 = (0.5, 0, 0) of camera 0.
    CHECK((rig.T_left_right.translation() - cairn::Vector<3>(0.5, 0, 0)).norm() < 1e-12);
    CHECK(((rig.T_left_right * cairn::Vector<3>(0, 1, 0)) - cairn::Vector<3>(1.5, 0, 0)).norm() < 1e-12);
    // A point on the x axis of camera 0 is on the y axis of the rectified camera, whose pose the file has.
    const StereoFrame frame = dataset->frame(1);
    REQUIRE(frame.truth.has_value());
    CHECK((*frame.truth * cairn::Vector<3>(1, 0, 0) - cairn::Vector<3>(0, 1, 1.5)).norm() < 1e-12);
  }

  TEST_CASE("kitti_raw: the calibration is also found in calib and one folder up") {
    for (const char* place : {"drive/calib", ".", "calib"}) {
      const RawFolder source;
      const cairn_test::Folder root;
      fs::copy(source.path(), root / "drive", fs::copy_options::recursive);
      fs::create_directories(root / place);
      fs::rename(root / "drive/calib_cam_to_cam.txt", root.path() / place / "calib_cam_to_cam.txt");
      CAPTURE(place);
      CHECK(open("kitti_raw", root / "drive")->size() == 3);
    }
  }

  TEST_CASE("kitti_raw: every broken file is refused by name, with what was expected") {
    const auto broken = [](const std::function<void(const RawFolder&)>& breaking) {
      const RawFolder folder;
      breaking(folder);
      return refusal("kitti_raw", folder.path());
    };
    using F = const RawFolder&;
    const auto calibration = [](const std::string& from, const std::string& to) {
      return [from, to](F f) { replace_in(f / "calib_cam_to_cam.txt", from, to); };
    };
    for (const std::string key : {"K_00", "D_01", "R_01", "T_01", "S_00", "R_rect_00"})
      CHECK(says(broken(calibration(key + ":", "X:")),
                 {"calib_cam_to_cam.txt: lacks the key " + key + "; expected '" + key + ":'"}));
    CHECK(says(broken(calibration("R_01: 0 -1", "R_01: 0 -2")), {"calib_cam_to_cam.txt", "rotation matrix"}));
    CHECK(says(broken(calibration("K_00: 100", "K_00: -100")), {"calib_cam_to_cam.txt", "focal"}));
    CHECK(says(broken(calibration("S_00: 12", "S_00: 1e99")),
               {"calib_cam_to_cam.txt", "image size", "found 1e+99"}));
    CHECK(says(broken(calibration("S_00: 12", "S_00: 13")), {"0000000001.png", "expected 13 x 8"}));
    CHECK(says(broken([](F f) { fs::remove(f / "calib_cam_to_cam.txt"); }),
               {"calib_cam_to_cam.txt: no such file", "expected the calibration"}));
    CHECK(says(broken([](F f) { fs::remove_all(f / "image_01"); }), {"image_01/data: no such folder"}));
    CHECK(says(broken([](F f) { fs::rename(f.image(0, 2), f / "image_00/data/two.png"); }),
               {"two.png: the name is no number"}));
    CHECK(says(broken([](F f) { replace_in(f / "image_00/timestamps.txt", "23:59", "soon"); }),
               {"timestamps.txt:1", "expected a time"}));
    CHECK(says(broken([](F f) { f.put("image_00/timestamps.txt", "2011-09-26 23:59:59.0\n"); }),
               {"timestamps.txt: holds 1 times; expected one for each frame up to the last, 5"}));
    for (const std::string stamp :
         {"2011-09-26 14:05:nan", "2011-09-26 14:05:inf", "2011-09-26 14:05:60.0", "2011-09-26 14:60:00",
          "2011-09-26 24:00:00", "2011-02-29 14:05:00", "2011-13-01 14:05:00", "2011-09-26 14:05:-1",
          "2011-09-26 14:05:1e1", "2011-09-26 14:05:00.", "2011-09-26 14:05:00.5x", "2011-09-26T14:05:00",
          "2011/09/26 14:05:00", "+011-09-26 14:05:00", "2011-09-26 14:05", "14:05:00", "nan",
          "1316959535.5"}) {
      CAPTURE(stamp);
      CHECK(says(broken([&](F f) {
                   std::string times;
                   for (int i = 0; i < 6; ++i) times += (i == 2 ? stamp : "2011-09-26 14:05:00.5") + "\n";
                   f.put("image_00/timestamps.txt", times);
                 }),
                 {"timestamps.txt:3", "expected a time"}));
    }
    CHECK(says(broken([](F f) { replace_in(f / "image_00/timestamps.txt", "59.2", "59.0"); }),
               {"timestamps.txt:3", "times that do not run backwards"}));
    CHECK(broken([](F f) { replace_in(f / "image_00/timestamps.txt", "59.2", "59.1"); }).empty());
    CHECK(says(broken([](F f) {
                 for (const int camera : {0, 1})
                   fs::rename(f.image(camera, 5),
                              f.image(camera, 5).parent_path() / "18446744073709551615.png");
               }),
               {"timestamps.txt: holds 6 times", "18446744073709551615"}));
    CHECK(says(broken([](F f) { fs::copy(f.image(1, 2), f / "image_01/data/2.png"); }),
               {"2.png: has the number of 0000000002.png; expected one image a number"}));
    CHECK(says(broken([](F f) { replace_in(f / "poses_cam0_rectified.txt", "\n2 1", "\n1 1"); }),
               {"poses_cam0_rectified.txt:3", "not a second of 1"}));
    CHECK(says(broken(calibration("R_rect_00: 0 -1", "R_rect_00: 0 -2")),
               {"calib_cam_to_cam.txt", "rotation matrix"}));
    CHECK(says(broken([](F f) { replace_in(f / "poses_cam0_rectified.txt", "\n1 1", "\n1 1 1"); }),
               {"poses_cam0_rectified.txt:2", "13 numbers"}));
    CHECK(says(broken([](F f) { replace_in(f / "poses_cam0_rectified.txt", "\n1 1", "\n1 3"); }),
               {"poses_cam0_rectified.txt:2", "rotation"}));
    CHECK(broken([](F) {}).empty());
  }

  TEST_CASE("euroc: frames of equal time are pairs, poses are of the left camera at the time of the image") {
    const EurocFolder folder;
    const auto dataset = open("euroc", folder.path());
    REQUIRE(dataset->size() == 2);  // image 0 is before the first pose, image 2 has no right partner
    CHECK(dataset->notes().size() == 2);
    const StereoFrame frame = dataset->frame(0);
    CHECK(frame.index == 1);
    CHECK(frame.left == picture(1, 0));
    CHECK(frame.right == picture(1, 1));
    CHECK(frame.time == doctest::Approx(1403636579.818555584).epsilon(1e-15));
    const cairn::StereoRig& rig = dataset->rig();
    CHECK(rig.left.fx() == 458.654);
    CHECK(rig.left.parameters().p2 == 1.8e-05);
    CHECK(rig.left.width() == 12);
    // Both cameras are turned by a quarter in the body, whose x is their -y.
    CHECK((rig.T_left_right.translation() - cairn::Vector<3>(0, -0.11, 0)).norm() < 1e-12);
    const double t = 0.055;
    const cairn::SE3 T_world_body(cairn::SO3::exp({0, 0, t}), {t, 0, 0});
    const cairn::SE3 T_body_camera(cairn::SO3::exp({0, 0, std::acos(-1.0) / 2}), {0, 0.02, 0});
    REQUIRE(frame.truth.has_value());
    CHECK(distance(*frame.truth, T_world_body * T_body_camera) < 1e-4);
    CHECK(open("euroc", folder / "mav0")->size() == 2);
  }

  TEST_CASE("euroc: every broken file is refused by name, with what was expected") {
    const auto broken = [](const std::function<void(const EurocFolder&)>& breaking) {
      const EurocFolder folder;
      breaking(folder);
      return refusal("euroc", folder.path());
    };
    using F = const EurocFolder&;
    const auto sensor = [](const std::string& from, const std::string& to) {
      return [from, to](F f) { replace_in(f / "mav0/cam1/sensor.yaml", from, to); };
    };
    for (const std::string key :
         {"T_BS", "intrinsics", "distortion_coefficients", "resolution", "camera_model", "distortion_model"})
      CHECK(says(broken(sensor("\n" + key + ":", "\nother:")),
                 {"cam1/sensor.yaml: lacks the key " + key + "; expected '" + key}));
    CHECK(says(broken(sensor("pinhole", "omni")), {"cam1/sensor.yaml", "pinhole, found 'omni'"}));
    CHECK(says(broken(sensor("radial-tangential", "equidistant")), {"cam1/sensor.yaml", "equidistant"}));
    CHECK(says(broken(sensor("458.654, ", "")), {"cam1/sensor.yaml", "intrinsics", "4 finite numbers"}));
    CHECK(says(broken(sensor("458.654", "inf")), {"cam1/sensor.yaml", "intrinsics", "4 finite numbers"}));
    CHECK(says(broken(sensor("data: [0.0", "data: [0.5")), {"cam1/sensor.yaml", "rotation matrix"}));
    CHECK(says(broken(sensor("1.8e-05]", "1.8e-05")), {"cam1/sensor.yaml", "distortion_coefficients"}));
    CHECK(says(broken([](F f) { fs::remove(f / "mav0/cam0/sensor.yaml"); }),
               {"cam0/sensor.yaml: no such file"}));
    CHECK(says(broken([](F f) { f.put("mav0/cam0/data.csv", "#nothing\n"); }),
               {"cam0/data.csv", "at least one"}));
    CHECK(says(broken([](F f) { f.put("mav0/cam0/data.csv", "then.png\n"); }),
               {"cam0/data.csv:1", "nanoseconds"}));
    CHECK(says(broken([](F f) { fs::remove(f / ("mav0/cam1/data/" + EurocFolder::time(3) + ".png")); }),
               {"cam1/data/" + EurocFolder::time(3) + ".png: no such file"}));
    CHECK(says(broken([](F f) { f.put("mav0/cam1/data.csv", "17,a.png\n"); }),
               {"no image of cam0 has the time"}));
    CHECK(says(broken([](F f) { f.put("mav0/state_groundtruth_estimate0/data.csv", "1,2\n"); }),
               {"state_groundtruth_estimate0/data.csv:1"}));
    CHECK(broken([](F) {}).empty());
  }

  TEST_CASE("euroc: a list belongs to its key, a key and a time stand once") {
    const auto broken = [](const std::string& from, const std::string& to) {
      const EurocFolder folder;
      replace_in(folder / "mav0/cam0/sensor.yaml", from, to);
      return refusal("euroc", folder.path());
    };
    // Without its own list, the intrinsics would be the four numbers of the distortion.
    CHECK(says(broken("intrinsics: [458.654, 457.296, 6.2, 4.3] #fu, fv, cu, cv\n", "intrinsics:\n"),
               {"sensor.yaml", "'intrinsics' with a list of 4"}));
    CHECK(says(broken("rate_hz: 20\n", "rate_hz: 20\nintrinsics: [1, 2, 3, 4]\n"),
               {"sensor.yaml", "the key intrinsics once"}));
    CHECK(broken("data: [0.0", "!!opencv-matrix\n  dt: d\n  data: [0.0").empty());
    const EurocFolder folder;
    const std::string list = cairn::read_file(folder / "mav0/cam0/data.csv");
    folder.put("mav0/cam0/data.csv", list + EurocFolder::time(1) + ",again.png\n");
    CHECK(says(refusal("euroc", folder.path()), {"data.csv:6", "one image a time"}));
    folder.put("mav0/cam0/data.csv", list + EurocFolder::time(9) + ", \n");
    CHECK(says(refusal("euroc", folder.path()), {"data.csv:6", "nanoseconds,file name"}));
    // Images are paired by time: lines need no order.
    folder.put("mav0/cam0/data.csv",
               list.substr(list.find('\n') + 1) + "1403636579763555585,late.png\n" + "17,first.png\n");
    CHECK(open("euroc", folder.path())->size() == 2);
  }

  TEST_CASE("dataset: frames may be read from several threads") {
    const OdometryFolder folder;
    const auto dataset = open("kitti_odometry", folder.path());
    std::vector<std::optional<StereoFrame>> frames(3);
    {
      std::vector<std::jthread> readers;
      for (std::size_t i = 0; i < 3; ++i) readers.emplace_back([&, i] { frames[i] = dataset->frame(i); });
    }
    for (std::size_t i = 0; i < 3; ++i) CHECK(frames[i]->left == picture(i, 0));
  }

  TEST_CASE("dataset: an arena written as a KITTI sequence reads back frame by frame") {
    const cairn_test::Folder folder;
    stereo_slam::ArenaOptions options;
    options.width = 160;
    options.height = 120;
    options.cache = false;
    const auto arena = stereo_slam::open_arena(options, 3, 2);
    CHECK(write_kitti_sequence(*arena, folder / "sequence") == 3);
    const auto read = open("kitti_odometry", folder / "sequence");
    REQUIRE(read->size() == 3);
    CHECK(read->rig().left.fx() == arena->rig().left.fx());
    CHECK(read->rig().left.cy() == arena->rig().left.cy());
    CHECK(read->rig().baseline() == doctest::Approx(options.baseline));
    for (std::size_t i = 0; i < 3; ++i) {
      const StereoFrame a = arena->frame(i), b = read->frame(i);
      CHECK(a.left == b.left);
      CHECK(a.right == b.right);
      CHECK(a.time == b.time);
      REQUIRE(b.truth.has_value());
      CHECK(distance(*a.truth, *b.truth) < 1e-12);
    }
    CHECK(says(cairn_test::message_of([&] { write_kitti_sequence(*arena, folder / "sequence"); }),
               {"sequence", "an empty one"}));  // it holds files, which may be anybody's
    int left = 2;
    CHECK(write_kitti_sequence(*arena, folder / "cut", [&] { return --left > 0; }) == 2);
    CHECK(open("kitti_odometry", folder / "cut")->size() == 2);
    folder.put("file", "");
    CHECK(says(cairn_test::message_of([&] { write_kitti_sequence(*arena, folder / "file"); }),
               {"file", "cannot make the folder"}));
    const EurocFolder unrectified;
    CHECK(says(cairn_test::message_of(
                   [&] { write_kitti_sequence(*open("euroc", unrectified.path()), folder / "other"); }),
               {"expected a rectified rig"}));
  }

  TEST_CASE("dataset: the KITTI odometry excerpt opens as published") {
    const auto folder = cairn_test::real_data("kitti_odometry_a");
    if (!folder) return;
    const auto dataset = open("kitti_odometry", *folder);
    REQUIRE(dataset->size() == 51);
    CHECK(dataset->rig().rectified());
    CHECK(dataset->rig().baseline() == doctest::Approx(0.537151).epsilon(1e-5));
    const StereoFrame frame = dataset->frame(50);
    CHECK(frame.left.width() == 1226);
    CHECK(frame.left.height() == 370);
    CHECK(frame.truth->translation()(2) > 50);
  }

  TEST_CASE("dataset: the KITTI raw drive opens unrectified and agrees with its published rectification") {
    const auto folder = cairn_test::real_data("kitti_raw_0926");
    if (!folder) return;
    const auto dataset = open("kitti_raw", *folder);
    REQUIRE(dataset->size() == 116);
    CHECK(dataset->frame(0).index == 2);
    CHECK(dataset->frame(115).left.width() == 1392);
    CHECK_FALSE(dataset->rig().rectified());
    // Turned by the rectifying rotations, the cameras must be parallel and side by side.
    const stereo_slam::KeyedNumbers calibration(*folder / "calib" / "calib_cam_to_cam.txt");
    const auto rectifying = [&](const std::string& key) {
      cairn::Matrix<3> m;
      for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = calibration.at(key, 9)[static_cast<std::size_t>(i)];
      return cairn::SE3(cairn::SO3::from_matrix(m), cairn::Vector<3>::Zero());
    };
    const cairn::SE3 T =
        rectifying("R_rect_00") * dataset->rig().T_left_right * rectifying("R_rect_01").inverse();
    const std::vector<double>& P = calibration.at("P_rect_01", 12);
    CHECK(T.rotation().log().norm() < 1e-5);
    CHECK((T.translation() - cairn::Vector<3>(-P[3] / P[0], 0, 0)).norm() < 1e-4);
    // The car drives about 0.45 m from the first frame to the second, ahead: along z of the camera.
    const cairn::SE3 step = dataset->frame(0).truth->inverse() * *dataset->frame(1).truth;
    CHECK(step.translation()(2) == doctest::Approx(step.translation().norm()).epsilon(0.03));
  }
}

}  // namespace dataset_test
