// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/rig_file.hpp"

#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/io/file.hpp>

#include "outputs.hpp"
#include "support/data.hpp"
#include "support/folder.hpp"

namespace rig_file_test {
namespace {

cairn::PinholeParameters parameters() {
  cairn::PinholeParameters p;
  p.fx = 718.25;
  p.fy = 717.5;
  p.cx = 607.1928;
  p.cy = 1.0 / 3;
  p.k1 = -0.37;
  p.k2 = 0.2;
  p.p1 = 1e-4;
  p.p2 = -3e-4;
  p.k3 = -0.07;
  p.width = 1242;
  p.height = 375;
  return p;
}

example::CalibratedRig some_rig() {
  example::CalibratedRig rig;
  cairn::PinholeParameters right = parameters();
  right.fx = 700;
  right.width = 1240;
  rig.rig = {cairn::PinholeCamera(parameters()), cairn::PinholeCamera(right),
             cairn::SE3::exp((cairn::Vector<6>() << 0.54, 1e-3, -2e-3, 0.01, -0.02, 0.003).finished())};
  return rig;
}

const std::string good = R"(cairn_rig: 1
left:
  image_size: [640, 480]
  intrinsics: [500, 501, 320, 240]
  distortion: [-0.2, 0.1, 0, 0, 0]
right:
  image_size: [640, 480]
  camera_matrix: [[502, 0, 321], [0, 503, 241], [0, 0, 1]]
T_left_right:
  rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1]
  translation: [0.1, 0, 0]
)";

const std::string opencv = R"(%YAML:1.0
---
nframes: 13
image_width: 640
image_height: 480
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 534., 0., 335., 0.,
       535., 240., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 8
   dt: d
   data: [ -0.29, 0.1, 0., 0., 0.02, 0., 0., 0. ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 536., 0., 334., 0., 537., 241., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ -0.28, 0.1, 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0., -1., 0., 1., 0., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -0.1, 0.02, 0. ]
)";

const std::string kalibr = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [0.0, 1.0, 0.0, -0.11]
  - [-1.0, 0.0, 0.0, 0.02]
  - [0.0, 0.0, 1.0, 0.03]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_model: none
  distortion_coeffs: []
  intrinsics: [457.5, 456.1, 379.9, 255.2]
  resolution: [752, 480]
)";

/// `text` with its first `from` replaced.
std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

std::string refusal(const std::string& text) {
  return cairn_test::message_of([&] { static_cast<void>(example::parse_rig(text, "rig.yaml")); });
}

bool says(const std::string& message, const std::string& words) {
  const bool found = message.find(words) != std::string::npos;
  if (!found) MESSAGE("'" << message << "' does not say '" << words << "'");
  return found;
}

}  // namespace

TEST_SUITE("rig_file") {
#ifdef EXAMPLES_HAVE_YAML
  TEST_CASE("rig_file: what is written reads back, sigmas and note too") {
    example::CalibratedRig rig = some_rig();
    rig.note = "\"a\" \\ note: of # two\nlines";
    rig.left.intrinsics = {0.1, 0.2, 0.3, 0.4};
    rig.right.distortion = {1e-3, 2e-3, 3e-4, 4e-4, 0};
    rig.rotation_sigma = cairn::Vector<3>(1e-5, 2e-4, 3e-5);
    rig.translation_sigma = cairn::Vector<3>(1, 1e-4, 2e-4);
    const cairn_test::Folder folder;
    example::write_rig(folder / "rig.yaml", rig);
    const example::CalibratedRig again = example::read_rig(folder / "rig.yaml");
    for (const auto& [a, b] :
         {std::pair(&rig.rig.left, &again.rig.left), {&rig.rig.right, &again.rig.right}}) {
      const cairn::PinholeParameters &p = a->parameters(), &q = b->parameters();
      CHECK(std::vector{p.fx, p.fy, p.cx, p.cy, p.k1, p.k2, p.p1, p.p2, p.k3} ==
            std::vector{q.fx, q.fy, q.cx, q.cy, q.k1, q.k2, q.p1, q.p2, q.k3});
      CHECK(p.width == q.width);
      CHECK(p.height == q.height);
    }
    CHECK((rig.rig.T_left_right.matrix() - again.rig.T_left_right.matrix()).cwiseAbs().maxCoeff() < 1e-15);
    CHECK(rig.left.intrinsics == again.left.intrinsics);
    CHECK_FALSE(again.left.distortion);
    CHECK(rig.right.distortion == again.right.distortion);
    CHECK(*rig.rotation_sigma == *again.rotation_sigma);
    CHECK(*rig.translation_sigma == *again.translation_sigma);
    CHECK(again.note == "\"a\" \\ note: of # two lines");
    // The sigma along the baseline is of a length.
    CHECK(*again.angle_sigma() < 0.02);
    CHECK(*again.angle_sigma() >= 2e-4);
  }

  TEST_CASE("rig_file: intrinsics or a camera matrix, distortion or none") {
    const example::CalibratedRig rig = example::parse_rig(good, "rig.yaml");
    CHECK(rig.rig.left.fy() == 501);
    CHECK(rig.rig.left.parameters().k1 == -0.2);
    CHECK(rig.rig.right.cx() == 321);
    CHECK_FALSE(rig.rig.right.distorted());
    CHECK(rig.rig.baseline() == 0.1);
    CHECK_FALSE(rig.angle_sigma());
  }

  TEST_CASE("rig_file: what OpenCV's stereo calibration leaves, whose motion is the other way round") {
    const example::CalibratedRig rig = example::parse_rig(opencv, "rig.yaml");
    CHECK(rig.rig.left.fy() == 535);
    CHECK(rig.rig.left.parameters().k3 == 0.02);
    CHECK(rig.rig.right.height() == 480);
    // x_right = R x_left + T
    const cairn::Vector<3> x(1, 2, 3), seen = rig.rig.T_left_right.inverse() * x;
    CHECK((seen - cairn::Vector<3>(-2 - 0.1, 1 + 0.02, 3)).norm() < 1e-12);
  }

  TEST_CASE("rig_file: a camera chain of Kalibr's, whose motion is the other way round as well") {
    const example::CalibratedRig rig = example::parse_rig(kalibr, "camchain.yaml");
    const cairn::PinholeParameters &left = rig.rig.left.parameters(), &right = rig.rig.right.parameters();
    CHECK(std::vector{left.fx, left.fy, left.cx, left.cy} == std::vector{458.6, 457.3, 367.2, 248.4});
    CHECK(std::vector{left.k1, left.k2, left.p1, left.p2, left.k3} ==
          std::vector{-0.28, 0.07, 0.0002, 0.00002, 0.0});
    CHECK(right.cy == 255.2);
    CHECK(right.k1 == 0);
    CHECK(right.width == 752);
    CHECK(right.height == 480);
    // x_cam1 = T_cn_cnm1 x_cam0
    const cairn::Vector<3> x(1, 2, 3), seen = rig.rig.T_left_right.inverse() * x;
    CHECK((seen - cairn::Vector<3>(2 - 0.11, -1 + 0.02, 3 + 0.03)).norm() < 1e-12);
  }

  TEST_CASE("rig_file: every field that is missing or wrong is named") {
    const std::vector<std::pair<std::string, std::string>> broken{
        {"", "expected fields"},
        {"- 1\n- 2\n", "expected fields"},
        {"left: [", "rig.yaml:"},
        {"hello: world\n", "is no rig; expected the field cairn_rig"},
        {with(good, "cairn_rig: 1", "cairn_rig: 2"),
         "is of version 2 of the format; this program reads version 1"},
        {with(good, "cairn_rig: 1", "cairn_rig: one"), "cairn_rig is 'one'"},
        {with(good, "cairn_rig: 1", "cairn_rig: [1]"), "the field cairn_rig is no single word"},
        {with(good, "left:", "lefd:"), "there is no field lefd; expected cairn_rig, left, right"},
        {with(good, "right:\n", "rigth:\n"), "there is no field rigth"},
        {with(good, "  intrinsics: [500, 501, 320, 240]\n", ""), "lacks the field left.intrinsics"},
        {with(good, "  image_size: [640, 480]\n", ""), "lacks the field left.image_size"},
        {with(good, "640, 480", "640"), "the field left.image_size has 1 numbers; expected 2 finite numbers"},
        {with(good, "640", "640.5"), "the field left.image_size has 640.5; expected whole pixels"},
        {with(good, "640", "-1"), "expected whole pixels"},
        {with(good, "640", "1e9"), "expected whole pixels"},
        {with(good, "500", "fast"), "the field left.intrinsics has 'fast' where a finite number should be"},
        {with(good, "500", ".nan"), "where a finite number should be"},
        {with(good, "500", "inf"), "where a finite number should be"},
        {with(good, "500", "-500"), "left: PinholeCamera: expected positive focal lengths"},
        {with(good, "501, ", ""), "the field left.intrinsics has 3 numbers"},
        {with(good, "[500, 501, 320, 240]", "500"), "the field left.intrinsics is no list"},
        {with(good, "distortion: [-0.2, 0.1, 0, 0, 0]", "distorsion: [0, 0, 0, 0]"),
         "there is no field left.distorsion"},
        {with(good, "[-0.2, 0.1, 0, 0, 0]", "[-0.2, 0.1]"),
         "the field distortion has 2 numbers; expected 4 or 5"},
        {with(good, "[-0.2, 0.1, 0, 0, 0]", "[-0.2, 0.1, 0, 0, 0, 1, 2, 3]"), "which is not supported"},
        {with(good, "  distortion: [", "  distortion_model: equidistant\n  distortion: ["),
         "the lens model 'equidistant' is not supported"},
        {with(good, "  distortion: [", "  distortion: [0, 0, 0, 0]\n  distortion: ["),
         "the field left.distortion stands there twice"},
        {with(good, "[[502, 0,", "[[502, 1,"), "is no camera matrix"},
        {with(good, "  camera_matrix", "  intrinsics: [1, 1, 0, 0]\n  camera_matrix"),
         "right: has both intrinsics and camera_matrix"},
        {with(good, "0, 0, 0, 1]", "0, 0, 0, 2]"),
         "T_left_right: SO3::from_matrix: expected a rotation matrix"},
        {with(good, "0, 0, 0, 1]", "0, 0, 0, -1]"), "found a reflection"},
        {with(good, "[0.1, 0, 0]", "[0, 0, 0]"), "the cameras stand at one place"},
        {with(good, "[0.1, 0, 0]", "[0.1, 0, 0, 0]"), "the field T_left_right.translation has 4 numbers"},
        {with(good, "  translation: [0.1, 0, 0]", ""), "lacks the field T_left_right.translation"},
        {good + "  rotation_sigma: [0, -1, 0]\n", "has a negative standard deviation"},
        {with(opencv, "T: !!opencv-matrix", "Tx: !!opencv-matrix"), "lacks the field T;"},
        {with(opencv, "D2: !!opencv-matrix", "D3: !!opencv-matrix"), "lacks the field D2;"},
        {with(opencv, "data: [ -0.28", "date: [ -0.28"), "the field D2 has no list 'data'"},
        {with(opencv, "image_height: 480", "image_height: high"), "the field image_height has 0"},
        {with(kalibr, "cam1:", "cam3:"), "lacks the field cam1"},
        {with(kalibr, "  T_cn_cnm1", "  T_cam_imu"), "lacks the field cam1.T_cn_cnm1"},
        {with(kalibr, "- [0.0, 0.0, 0.0, 1.0]", "- [0.0, 0.0, 0.0, 2.0]"),
         "T_cn_cnm1 does not end with 0, 0, 0, 1"},
        {with(kalibr, "[0.0, 1.0, 0.0, -0.11]", "[0.0, 1.1, 0.0, -0.11]"), "cam1: SO3::from_matrix"},
        {with(kalibr, "radtan", "equidistant"), "cam0: the lens model 'equidistant' is not supported"},
        {with(kalibr, "camera_model: pinhole", "camera_model: omni"),
         "the camera model 'omni' is not supported"},
        {kalibr + "cam2: {}\n", "more than two cameras"},
        {std::string(2 << 20, '\n'), "larger than a rig can be"},
    };
    for (const auto& [text, words] : broken) {
      CAPTURE(text.substr(0, 2000));
      const std::string message = refusal(text);
      CHECK(message.starts_with("rig.yaml"));
      CHECK(says(message, words));
    }
    CHECK(says(cairn_test::message_of([] { static_cast<void>(example::read_rig("/no/such/rig.yaml")); }),
               "/no/such/rig.yaml: no such file; expected a stereo rig"));
  }

  TEST_CASE("rig_file: OpenCV's own sample, whose cameras are in one file and their motion in another") {
    const auto data = cairn_test::real_data("stereo_pairs");
    if (!data) return;
    const std::string cameras =
        cairn::read_file(*data / "opencv-chessboard-stereo" / "intrinsics.yml", "a calibration");
    CHECK(says(refusal(cameras), "lacks the field T;"));
    const std::size_t motion = opencv.find("\nR:") + 1;
    const example::CalibratedRig rig = example::parse_rig(cameras + opencv.substr(motion), "both");
    CHECK(rig.rig.left.fx() == 534.80326845051309);
    CHECK(rig.rig.right.parameters().k1 == -0.16916358306948096);
    CHECK(rig.rig.left.width() == 0);  // the file does not say
  }
#else
  TEST_CASE("rig_file: without yaml-cpp a rig is refused and the package named") {
    CHECK(says(refusal(good), "libyaml-cpp-dev"));
  }
#endif

  TEST_CASE("rig_file: the rig a run learned has its sigmas, and the cameras' as they were given") {
    example::CalibratedRig given = some_rig();
    given.left.intrinsics = {1, 1, 1, 1};
    stereo_slam::RunRecord run;
    run.dataset = "a drive";
    run.frames.resize(7);
    run.rig = given.rig;
    run.rig.T_left_right = given.rig.T_left_right * cairn::SE3::exp(cairn::Vector<6>::Constant(1e-3));
    run.calibration.sigmas << 1e-5, 2e-5, 3e-5, 4e-5, 5e-5;
    CHECK_FALSE(stereo_slam::learned_rig(given, run).rotation_sigma);
    run.calibration.on = true;
    const example::CalibratedRig learned = stereo_slam::learned_rig(given, run);
    CHECK(learned.left.intrinsics == given.left.intrinsics);
    CHECK(learned.rig.T_left_right.matrix() == run.rig.T_left_right.matrix());
    CHECK(*learned.rotation_sigma == cairn::Vector<3>(1e-5, 2e-5, 3e-5));
    // Across the baseline, which is nearly x: u2 nearly y, u3 nearly z.
    CHECK((*learned.translation_sigma)(1) == doctest::Approx(0.54 * 4e-5).epsilon(0.01).scale(0));
    CHECK((*learned.translation_sigma)(2) == doctest::Approx(0.54 * 5e-5).epsilon(0.01).scale(0));
    CHECK((*learned.translation_sigma)(0) < 1e-6);
    CHECK(learned.note == "learned from a drive, 7 frames");
  }
}

}  // namespace rig_file_test
