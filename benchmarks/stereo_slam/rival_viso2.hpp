// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// libviso2 (Geiger, Ziegler, Stiller, "StereoScan", IV 2011), stereo odometry from frame to frame, with the
/// defaults of its authors, where its folder is given.
#pragma once

#include <memory>
#include <vector>

#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>

#include "dataset.hpp"

namespace stereo_slam_bench {

class Viso2 {
public:
  /// Nothing where it was not built in, or where the rig's images are not rectified: it takes no others.
  [[nodiscard]] static std::unique_ptr<Viso2> beside(const cairn::StereoRig& rig);
  Viso2() = default;
  Viso2(const Viso2&) = delete;
  Viso2& operator=(const Viso2&) = delete;
  virtual ~Viso2() = default;

  virtual void step(const stereo_slam::StereoFrame& frame) = 0;
  /// T_first_camera of every frame; where it found no motion the last one goes on.
  [[nodiscard]] const std::vector<cairn::SE3>& poses() const noexcept { return poses_; }
  [[nodiscard]] double cpu_milliseconds() const noexcept;  ///< of a pair

protected:
  std::vector<cairn::SE3> poses_;
  double cpu_seconds_ = 0;
};

}  // namespace stereo_slam_bench
