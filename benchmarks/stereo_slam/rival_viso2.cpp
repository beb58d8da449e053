// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "rival_viso2.hpp"

#include <algorithm>

#ifdef CAIRN_BENCH_VISO2
#include <array>
#include <cstddef>
#include <cstdint>
#include <ctime>

#include <viso_stereo.h>

#include <cairn/vision/image.hpp>
#endif

namespace stereo_slam_bench {

double Viso2::cpu_milliseconds() const noexcept {
  return 1e3 * cpu_seconds_ / static_cast<double>(std::max<std::size_t>(1, poses_.size()));
}

#ifdef CAIRN_BENCH_VISO2
namespace {

// It reads rows through a pointer that it may write to: a copy, row on row.
std::vector<std::uint8_t> packed(const cairn::ImageView& image) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(static_cast<std::size_t>(image.width()) * static_cast<std::size_t>(image.height()));
  for (int row = 0; row < image.height(); ++row)
    bytes.insert(bytes.end(), image.row(row), image.row(row) + image.width());
  return bytes;
}

class BuiltIn final : public Viso2 {
public:
  explicit BuiltIn(const cairn::StereoRig& rig) : odometry_(parameters(rig)) {}

  void step(const stereo_slam::StereoFrame& frame) override {
    std::vector<std::uint8_t> left = packed(frame.left), right = packed(frame.right);
    std::array<std::int32_t, 3> size{frame.left.width(), frame.left.height(), frame.left.width()};
    const std::clock_t start = std::clock();
    const bool moved = odometry_.process(left.data(), right.data(), size.data());
    cpu_seconds_ += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    if (!poses_.empty() && moved) last_ = motion().inverse();
    poses_.push_back(poses_.empty() ? cairn::SE3() : poses_.back() * last_);
  }

private:
  static VisualOdometryStereo::parameters parameters(const cairn::StereoRig& rig) {
    VisualOdometryStereo::parameters result;
    result.calib.f = rig.left.fx();
    result.calib.cu = rig.left.cx();
    result.calib.cv = rig.left.cy();
    result.base = rig.baseline();
    return result;
  }
  // T_now_before.
  cairn::SE3 motion() {
    const ::Matrix moved = odometry_.getMotion();
    cairn::Matrix<4> T;
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column) T(row, column) = moved.val[row][column];
    return cairn::SE3::from_matrix(T);
  }

  VisualOdometryStereo odometry_;
  cairn::SE3 last_;
};

}  // namespace

std::unique_ptr<Viso2> Viso2::beside(const cairn::StereoRig& rig) {
  if (!rig.rectified()) return nullptr;
  return std::make_unique<BuiltIn>(rig);
}
#else
std::unique_ptr<Viso2> Viso2::beside(const cairn::StereoRig&) {
  return nullptr;
}
#endif

}  // namespace stereo_slam_bench
