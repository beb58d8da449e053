// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "there_and_back.hpp"

#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>

namespace stereo_slam {
namespace {

class ThereAndBack : public Dataset {
public:
  explicit ThereAndBack(std::unique_ptr<Dataset> there)
      : there_(std::move(there)), turn_(there_->size() - 1), time_of_turn_(there_->frame(turn_).time) {}

  [[nodiscard]] std::string name() const override { return there_->name() + ", there and back"; }
  [[nodiscard]] std::size_t size() const override { return 2 * turn_ + 1; }
  [[nodiscard]] const cairn::StereoRig& rig() const override { return there_->rig(); }
  [[nodiscard]] StereoFrame frame(std::size_t i) const override {
    if (i <= turn_) return there_->frame(i);
    StereoFrame frame = there_->frame(2 * turn_ - i);
    frame.time = 2 * time_of_turn_ - frame.time;
    return frame;
  }
  [[nodiscard]] std::vector<std::string> notes() const override { return there_->notes(); }

private:
  std::unique_ptr<Dataset> there_;
  std::size_t turn_;
  double time_of_turn_;
};

}  // namespace

std::unique_ptr<Dataset> there_and_back(std::unique_ptr<Dataset> there) {
  CAIRN_EXPECTS(there != nullptr && there->size() > 0, "there_and_back: a drive has frames");
  return std::make_unique<ThereAndBack>(std::move(there));
}

ReturnError return_error(const std::vector<FrameRecord>& frames) {
  ReturnError error;
  for (std::size_t i = 1; i < frames.size(); ++i)
    error.path +=
        (frames[i].T_world_camera.translation() - frames[i - 1].T_world_camera.translation()).norm();
  const cairn::SE3 left = frames.front().T_world_camera.inverse() * frames.back().T_world_camera;
  error.distance = left.translation().norm();
  error.angle = left.rotation().angle();
  return error;
}

}  // namespace stereo_slam
