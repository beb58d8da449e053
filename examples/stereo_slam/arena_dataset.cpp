// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "arena_dataset.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/io/text.hpp>

#include "arena_cache.hpp"
#include "arena_renderer.hpp"
#include "arena_script.hpp"

namespace stereo_slam {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double frames_a_second = 10;

void check(bool good, const char* what, double found) {
  if (!good) cairn::raise("arena: expected " + std::string(what) + ", found " + cairn::shortest(found));
}

void check(const ArenaOptions& o) {
  check(o.width >= 64 && o.width <= 4096, "a width of 64 to 4096 pixels", o.width);
  check(o.height >= 64 && o.height <= 4096, "a height of 64 to 4096 pixels", o.height);
  check(o.field_of_view >= 5 && o.field_of_view <= 120, "a field of view of 5 to 120 degrees",
        o.field_of_view);
  check(o.baseline >= 0.01 && o.baseline <= 0.5, "a baseline of 0.01 to 0.5 m", o.baseline);
  check(o.noise >= 0 && o.noise <= 50, "sensor noise of 0 to 50 grey levels", o.noise);
  check(o.exposure >= 0 && o.exposure <= 0.5, "an exposure change of 0 to 0.5", o.exposure);
  check(std::abs(o.drift) <= 5, "a drift of at most 5 degrees in 100 frames", o.drift);
}

class Arena final : public Dataset {
public:
  Arena(const ArenaOptions& options, std::vector<Stance> stances, unsigned threads,
        std::shared_ptr<const ArenaScene> scene)
      : options_(options),
        threads_(threads),
        stances_(std::move(stances)),
        cache_(options),
        scene_(std::move(scene)) {
    cairn::PinholeParameters camera;
    camera.fx = camera.fy = options.width / 2.0 / std::tan(options.field_of_view / 2 * degree);
    camera.cx = (options.width - 1) / 2.0;
    camera.cy = (options.height - 1) / 2.0;
    camera.width = options.width;
    camera.height = options.height;
    rig_.left = rig_.right = cairn::PinholeCamera(camera);
    rig_.T_left_right = {{}, {options.baseline, 0, 0}};
  }

  [[nodiscard]] std::string name() const override { return "arena " + options_.script; }
  [[nodiscard]] std::size_t size() const override { return stances_.size(); }
  [[nodiscard]] const cairn::StereoRig& rig() const override { return rig_; }
  [[nodiscard]] std::vector<std::string> notes() const override { return {}; }

  [[nodiscard]] StereoFrame frame(std::size_t i) const override {
    CAIRN_EXPECTS(i < stances_.size(), "a frame number is less than size()");
    StereoFrame frame;
    frame.index = i;
    frame.time = static_cast<double>(i) / frames_a_second;
    frame.name = name() + " frame " + std::to_string(i);
    frame.truth = left_camera_pose(stances_[i], options_.baseline);
    frame.truth_world = "arena";
    std::optional<ImagePair> pair = cache_.find(i);
    if (!pair) {
      pair = take(i, *frame.truth);
      cache_.keep(i, *pair);
    }
    frame.left = std::move(pair->first);
    frame.right = std::move(pair->second);
    return frame;
  }

private:
  [[nodiscard]] ImagePair take(std::size_t i, const cairn::SE3& T_world_left) const {
    std::array<Shot, 2> shots;
    const std::array<double, 2> exposures = exposure(i);
    for (std::size_t side = 0; side < 2; ++side) {
      Shot& shot = shots[side];
      shot.width = options_.width;
      shot.height = options_.height;
      shot.focal = rig_.left.fx();
      shot.centre_x = rig_.left.cx();
      shot.centre_y = rig_.left.cy();
      shot.noise = options_.noise;
      shot.noise_stream = cairn::Random(options_.seed, 0x6e6f6973 + 2 * i + side)();
      shot.exposure = exposures[side];
    }
    shots[0].T_world_camera = T_world_left;
    shots[1].T_world_camera = T_world_left * rig_.T_left_right * drifted(i);
    std::vector<cairn::Image> taken = render(scene(), shots, threads_);
    return {std::move(taken[0]), std::move(taken[1])};
  }

  // Both cameras follow the light of the scene; the right one lags by a few percent.
  [[nodiscard]] std::array<double, 2> exposure(std::size_t i) const {
    cairn::Random random(options_.seed, 0x6c696768 + i);
    const auto t = static_cast<double>(i);
    const double slow = std::sin(0.11 * t) * 0.6 + std::sin(0.037 * t + 1) * 0.4;
    const double both = options_.exposure * (slow + 0.15 * random.uniform(-1, 1));
    return {1 + both, 1 + 0.8 * both};
  }

  // The screws of the right camera work loose: it turns about all of its axes, most of all sideways.
  [[nodiscard]] cairn::SE3 drifted(std::size_t i) const {
    const double angle = options_.drift * degree * static_cast<double>(i) / 100;
    return {cairn::SO3::exp(angle * cairn::Vector<3>(0.48, 0.80, 0.36)), cairn::Vector<3>::Zero()};
  }

  // Made when the first picture is needed: a run whose pictures are all on disk never makes it.
  [[nodiscard]] const ArenaScene& scene() const {
    std::call_once(once_, [this] {
      if (!scene_) scene_ = std::make_shared<ArenaScene>(options_.seed, threads_);
    });
    return *scene_;
  }

  ArenaOptions options_;
  unsigned threads_;
  std::vector<Stance> stances_;
  ArenaCache cache_;
  cairn::StereoRig rig_;
  mutable std::once_flag once_;
  mutable std::shared_ptr<const ArenaScene> scene_;
};

}  // namespace

std::unique_ptr<Dataset> open_arena(const ArenaOptions& options, std::size_t frames, unsigned threads,
                                    std::shared_ptr<const ArenaScene> scene) {
  check(options);
  std::vector<Stance> stances = script_stances(options.script);
  if (frames > 0 && frames < stances.size()) stances.resize(frames);
  return std::make_unique<Arena>(options, std::move(stances), threads, std::move(scene));
}

std::unique_ptr<Dataset> open_arena_views(const ArenaOptions& options, std::vector<Stance> stances,
                                          unsigned threads) {
  check(options);
  ArenaOptions uncached = options;
  uncached.cache = false;
  return std::make_unique<Arena>(uncached, std::move(stances), threads, nullptr);
}

}  // namespace stereo_slam
