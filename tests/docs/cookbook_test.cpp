// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The programs of docs/cookbook.md, each in a namespace of its own, where what they include is already
// included: compiled together and run; each returns 0 only if its answer is right.
#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <sstream>
#include <tuple>
#include <vector>

#include <Eigen/Core>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/eval/association.hpp>
#include <cairn/eval/trajectory_error.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/interacting.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/timeline.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/multi_tree_file.hpp>
#include <cairn/index/ratio_test.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/manifold/so3.hpp>
#include <cairn/models/linear.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>
#include <cairn/vision/surf.hpp>

#define main recipe  // NOLINT: a program has one main, and this one has fifteen programs

namespace docs_cookbook_test {

namespace irregular_steps {
#include "snippets/docs/cookbook_1.inc"
}  // namespace irregular_steps
namespace own_sensor {
#include "snippets/docs/cookbook_2.inc"
}  // namespace own_sensor
namespace attitude {
#include "snippets/docs/cookbook_3.inc"
}  // namespace attitude
namespace run_time_sizes {
#include "snippets/docs/cookbook_4.inc"
}  // namespace run_time_sizes
namespace single_precision {
#include "snippets/docs/cookbook_5.inc"
}  // namespace single_precision
namespace late_measurements {
#include "snippets/docs/cookbook_6.inc"
}  // namespace late_measurements
namespace smoothing {
#include "snippets/docs/cookbook_7.inc"
}  // namespace smoothing
namespace monte_carlo_localisation {
#include "snippets/docs/cookbook_8.inc"
}  // namespace monte_carlo_localisation
namespace manoeuvring_target {
#include "snippets/docs/cookbook_9.inc"
}  // namespace manoeuvring_target
namespace own_points {
#include "snippets/docs/cookbook_10.inc"
}  // namespace own_points
namespace growing_cloud {
#include "snippets/docs/cookbook_11.inc"
}  // namespace growing_cloud
namespace descriptors {
#include "snippets/docs/cookbook_12.inc"
}  // namespace descriptors
namespace two_images {
#include "snippets/docs/cookbook_13.inc"
}  // namespace two_images
namespace stereo_pose {
#include "snippets/docs/cookbook_14.inc"
}  // namespace stereo_pose
namespace trajectory_score {
#include "snippets/docs/cookbook_15.inc"
}  // namespace trajectory_score

#undef main

TEST_CASE("docs: every program of the cookbook gives the answer that it checks for") {
  CHECK(irregular_steps::recipe() == 0);
  CHECK(own_sensor::recipe() == 0);
  CHECK(attitude::recipe() == 0);
  CHECK(run_time_sizes::recipe() == 0);
  CHECK(single_precision::recipe() == 0);
  CHECK(late_measurements::recipe() == 0);
  CHECK(smoothing::recipe() == 0);
  CHECK(monte_carlo_localisation::recipe() == 0);
  CHECK(manoeuvring_target::recipe() == 0);
  CHECK(own_points::recipe() == 0);
  CHECK(growing_cloud::recipe() == 0);
  CHECK(descriptors::recipe() == 0);
  CHECK(two_images::recipe() == 0);
  CHECK(stereo_pose::recipe() == 0);
  CHECK(trajectory_score::recipe() == 0);
}

}  // namespace docs_cookbook_test
