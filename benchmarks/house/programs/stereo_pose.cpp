// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <iostream>
#include <vector>

#include <cairn/geometry/stereo_pose.hpp>

int main() {
  const cairn::StereoRig rig{{}, {}, cairn::SE3(cairn::SO3(), cairn::Vector<3>(0.1, 0, 0))};
  std::vector<cairn::StereoMatch> matches(20);
  const cairn::StereoPose pose = cairn::estimate_stereo_pose(rig, matches);
  std::cout << pose.inlier_count << ' ' << pose.T_world_camera.translation().transpose() << '\n';
}
