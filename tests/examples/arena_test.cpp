// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/io/file.hpp>

#include "arena_dataset.hpp"
#include "arena_ground.hpp"
#include "arena_renderer.hpp"
#include "arena_scene.hpp"
#include "arena_script.hpp"
#include "support/folder.hpp"

namespace arena_test {
namespace {

using stereo_slam::ArenaOptions;
using stereo_slam::ArenaScene;
using stereo_slam::Footprint;
using stereo_slam::Panel;
using stereo_slam::Shot;
using stereo_slam::Stance;
using Point = cairn::Vector<3>;

// One scene for all tests: it takes a second to make.
const std::shared_ptr<const ArenaScene>& shared_scene() {
  static const std::shared_ptr<const ArenaScene> made = std::make_shared<ArenaScene>(1, 2);
  return made;
}
const ArenaScene& scene() {
  return *shared_scene();
}

Shot clean_shot(const cairn::SE3& pose, int width = 768, int height = 576) {
  Shot shot;
  shot.T_world_camera = pose;
  shot.width = width;
  shot.height = height;
  shot.focal = width / 2.0 / std::tan(20 * std::numbers::pi / 180);
  shot.centre_x = (width - 1) / 2.0;
  shot.centre_y = (height - 1) / 2.0;
  return shot;
}

// The panel that a ray meets first and where, by testing every one; nullptr where it meets none.
struct Hit {
  const Panel* panel = nullptr;
  double a = 0, b = 0, distance = 1e9;
};
Hit cast(const Point& eye, const Point& ray) {
  Hit hit;
  for (const Panel& panel : scene().panels()) {
    const Point normal = cairn::skew(panel.along) * panel.up;
    if (normal.dot(ray) >= 0) continue;
    const double distance = normal.dot(panel.origin - eye) / normal.dot(ray);
    const Point on = eye + distance * ray - panel.origin;
    const double a = on.dot(panel.along), b = on.dot(panel.up);
    if (distance > 0 && distance < hit.distance && a >= 0 && b >= 0 && a <= panel.width && b <= panel.height)
      hit = {&panel, a, b, distance};
  }
  return hit;
}

Point ray_of(const Shot& shot, double x, double y) {
  return shot.T_world_camera.rotation() *
         Point((x - shot.centre_x) / shot.focal, (y - shot.centre_y) / shot.focal, 1);
}

// The finest texels at one point of a panel.
double point_sample(const Hit& hit) {
  Footprint f;
  f.u = static_cast<float>(hit.panel->texture_u + hit.a * ArenaScene::texels_per_metre);
  f.v = static_cast<float>(hit.panel->texture_v + (hit.panel->height - hit.b) * ArenaScene::texels_per_metre);
  return static_cast<double>(hit.panel->light * hit.panel->texture->sample(f));
}

// The mean of a grid of rays through a pixel, each to the finest texels.
double mean_of_rays(const Shot& shot, int x, int y) {
  constexpr int side = 8;
  double sum = 0;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const Hit hit = cast(shot.T_world_camera.translation(),
                           ray_of(shot, x - 0.5 + (i + 0.5) / side, y - 0.5 + (j + 0.5) / side));
      if (hit.panel == nullptr) FAIL("a ray below the fence meets no panel");
      sum += point_sample(hit);
    }
  return std::min(sum / (side * side), 255.0);  // the film saturates
}

// Whether the left and the right rim of a pixel see different panels.
bool on_edge(const Shot& shot, int x, int y) {
  const Point& eye = shot.T_world_camera.translation();
  return cast(eye, ray_of(shot, x - 0.5, y)).panel != cast(eye, ray_of(shot, x + 0.5, y)).panel;
}

// Somewhere in the arena beside the boxes.
Stance free_stance(cairn::Random& random) {
  for (;;) {
    const Stance s{random.uniform(-4, 4), random.uniform(-4, 4), random.uniform(-4, 4)};
    if (std::all_of(scene().boxes().begin(), scene().boxes().end(), [&](const stereo_slam::Box& box) {
          return std::hypot(box.x - s.x, box.y - s.y) > std::hypot(box.length, box.width) / 2 + 0.5;
        }))
      return s;
  }
}

double grey(const cairn::Image& image, double x, double y) {
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const double right = x - i, down = y - j;
  return (1 - down) * ((1 - right) * image(i, j) + right * image(i + 1, j)) +
         down * ((1 - right) * image(i, j + 1) + right * image(i + 1, j + 1));
}

// How far the picture of a patch of the scene in `second` lies from where geometry says, by least squares on
// the grey levels (Lucas and Kanade). The patch surrounds pixel (x, y) of `first`.
struct Shift {
  bool valid = false;
  double x = 0, y = 0;
};
Shift measured_shift(const Shot& first, const cairn::Image& first_image, const Shot& second,
                     const cairn::Image& second_image, int x, int y) {
  constexpr int half = 12;
  double xx = 0, xy = 0, yy = 0, xe = 0, ye = 0;
  const Panel* panel = nullptr;
  for (int j = -half; j <= half; ++j)
    for (int i = -half; i <= half; ++i) {
      const Hit hit = cast(first.T_world_camera.translation(), ray_of(first, x + i, y + j));
      if (hit.panel == nullptr || (panel != nullptr && hit.panel != panel)) return {};
      panel = hit.panel;
      const Point world = panel->origin + hit.a * panel->along + hit.b * panel->up;
      const Point seen = second.T_world_camera.inverse() * world;
      const double u = second.focal * seen(0) / seen(2) + second.centre_x;
      const double v = second.focal * seen(1) / seen(2) + second.centre_y;
      if (seen(2) <= 0 || u < 2 || v < 2 || u > second.width - 3 || v > second.height - 3) return {};
      const double g_x = 0.5 * (grey(second_image, u + 1, v) - grey(second_image, u - 1, v));
      const double g_y = 0.5 * (grey(second_image, u, v + 1) - grey(second_image, u, v - 1));
      const double error = first_image(x + i, y + j) - grey(second_image, u, v);
      xx += g_x * g_x, xy += g_x * g_y, yy += g_y * g_y, xe += g_x * error, ye += g_y * error;
    }
  const double determinant = xx * yy - xy * xy;
  if (determinant < 1e6) return {};
  return {true, (yy * xe - xy * ye) / determinant, (xx * ye - xy * xe) / determinant};
}

// Mean and spread of measured_shift over many patches of two pictures.
struct Shifts {
  cairn::RunningMoments x, y;
};
Shifts shifts_between(const Shot& first, const Shot& second, std::uint64_t seed) {
  const std::array<Shot, 2> shots{first, second};
  const std::vector<cairn::Image> images = render(scene(), shots, 2);
  cairn::Random random(seed);
  Shifts shifts;
  for (int i = 0; i < 150; ++i) {
    const int x = 20 + static_cast<int>(random.below(728)), y = 100 + static_cast<int>(random.below(450));
    const Shift shift = measured_shift(first, images[0], second, images[1], x, y);
    if (!shift.valid) continue;
    shifts.x.add(shift.x);
    shifts.y.add(shift.y);
  }
  return shifts;
}

ArenaOptions small_options(const cairn_test::Folder& folder) {
  ArenaOptions options;
  options.script = "turn";
  options.width = 192;
  options.height = 144;
  options.cache_folder = folder.path();
  return options;
}

bool same_pictures(const stereo_slam::StereoFrame& a, const stereo_slam::StereoFrame& b) {
  return a.left == b.left && a.right == b.right;
}

}  // namespace

TEST_SUITE("arena") {
  TEST_CASE("arena: the ground is the same for every number of threads and another for another seed") {
    stereo_slam::GroundOptions ground{.width = 700, .height = 600};
    const std::vector<std::uint8_t> one = moon_ground(ground, 1).grey;
    CHECK(moon_ground(ground, 2).grey == one);
    CHECK(moon_ground(ground, 5).grey == one);
    ground.seed = 1;
    CHECK(moon_ground(ground, 1).grey != one);
  }

  TEST_CASE("arena: a footprint is the mean of what lies below it") {
    stereo_slam::GroundOptions ground{.width = 512, .height = 512};
    const stereo_slam::Texels texels = moon_ground(ground, 2);
    const stereo_slam::Texture texture{stereo_slam::Texels(texels)};
    cairn::Random random(5);
    cairn::RunningMoments error, contrast;
    for (int trial = 0; trial < 300; ++trial) {
      // An axis-parallel box of texels, its mean taken texel by texel.
      const int width = 1 << random.below(5), height = 1 << random.below(5);
      const int x = 40 + static_cast<int>(random.below(400)), y = 40 + static_cast<int>(random.below(400));
      double sum = 0;
      for (int j = 0; j < height; ++j)
        for (int i = 0; i < width; ++i) sum += texels.at(x + i, y + j);
      Footprint f;
      f.u = static_cast<float>(x) + static_cast<float>(width) / 2;
      f.v = static_cast<float>(y) + static_cast<float>(height) / 2;
      f.du_dx = static_cast<float>(width);
      f.dv_dy = static_cast<float>(height);
      error.add(static_cast<double>(texture.sample(f)) - sum / (width * height));
      contrast.add(texels.at(x, y));
    }
    CHECK(std::abs(error.mean()) < 0.5);
    CHECK(error.standard_deviation() < 0.3 * contrast.standard_deviation());
  }

  TEST_CASE("arena: a footprint that is a texel of some level is that texel, at its place") {
    stereo_slam::GroundOptions ground{.width = 256, .height = 128};
    const stereo_slam::Texels texels = moon_ground(ground, 2);
    const stereo_slam::Texture texture{stereo_slam::Texels(texels)};
    for (const int side : {1, 2, 4, 8, 16})
      for (int y = 0; y < texels.height; y += side)
        for (int x = 0; x < texels.width; x += side) {
          double sum = 0;
          for (int j = 0; j < side; ++j)
            for (int i = 0; i < side; ++i) sum += texels.at(x + i, y + j);
          Footprint f;
          f.u = static_cast<float>(x) + static_cast<float>(side) / 2;
          f.v = static_cast<float>(y) + static_cast<float>(side) / 2;
          f.du_dx = f.dv_dy = static_cast<float>(side);
          const double rounding = side == 1 ? 1e-3 : 1.5;  // each level rounds once
          REQUIRE(std::abs(static_cast<double>(texture.sample(f)) - sum / (side * side)) <= rounding);
        }
  }

  TEST_CASE("arena: a pixel is the mean of the rays through it, wherever the camera stands") {
    cairn::Random random(6);
    cairn::RunningMoments inside, edge, truth;
    for (int view = 0; view < 8; ++view) {
      const Shot shot = clean_shot(stereo_slam::left_camera_pose(free_stance(random), 0.2));
      const cairn::Image image = render(scene(), std::array{shot}, 2)[0];
      for (int trial = 0; trial < 100; ++trial) {
        const int y = 95 + static_cast<int>(random.below(480));
        int x = static_cast<int>(random.below(768));
        if (trial % 2 == 0)  // go on to the next edge of a panel
          while (x < 767 && !on_edge(shot, x, y)) ++x;
        const double expected = mean_of_rays(shot, x, y);
        (on_edge(shot, x, y) ? edge : inside).add(image(x, y) - expected);
        truth.add(expected);
      }
    }
    REQUIRE(edge.count() > 40);
    CHECK(std::abs(inside.mean()) < 0.4);
    CHECK(std::abs(edge.mean()) < 1);
    CHECK(inside.standard_deviation() < 0.08 * truth.standard_deviation());
    CHECK(edge.standard_deviation() < 0.15 * truth.standard_deviation());
  }

  TEST_CASE("arena: a box hides the box behind it, whichever was made first") {
    int overlaps = 0;
    for (const stereo_slam::Box& near : scene().boxes())
      for (const stereo_slam::Box& far : scene().boxes()) {
        const double apart = std::hypot(far.x - near.x, far.y - near.y);
        const double heading = std::atan2(far.y - near.y, far.x - near.x);
        const Stance stance{near.x - std::cos(heading), near.y - std::sin(heading), heading};
        if (apart == 0 || apart > 3 || std::max(std::abs(stance.x), std::abs(stance.y)) > 4.8) continue;
        const Shot shot = clean_shot(stereo_slam::left_camera_pose(stance, 0));
        const cairn::Image image = render(scene(), std::array{shot}, 2)[0];
        const Point middle(near.x, near.y, 0.8 * near.height);
        const Point seen = shot.T_world_camera.inverse() * middle;
        const int x = static_cast<int>(shot.focal * seen(0) / seen(2) + shot.centre_x);
        const int y = static_cast<int>(shot.focal * seen(1) / seen(2) + shot.centre_y);
        cairn::RunningMoments error;
        for (int j = -5; j <= 5; ++j)
          for (int i = -20; i <= 20; i += 4)
            if (y + j > 95 && y + j < 575) error.add(image(x + i, y + j) - mean_of_rays(shot, x + i, y + j));
        if (error.count() == 0) continue;
        CHECK(std::abs(error.mean()) < 4);
        CHECK(error.standard_deviation() < 8);
        ++overlaps;
      }
    CHECK(overlaps > 10);
  }

  TEST_CASE("arena: what the left camera sees lies in the right image where geometry says, to 0.02 pixels") {
    for (const std::size_t stance : {0U, 50U}) {
      const cairn::SE3 left = stereo_slam::left_camera_pose(stereo_slam::script_stances("loop")[stance], 0.2);
      const Shot first = clean_shot(left);
      Shot second = first;
      second.T_world_camera = left * cairn::SE3({}, {0.2, 0, 0});
      const Shifts shifts = shifts_between(first, second, 7);
      REQUIRE(shifts.x.count() > 60);
      CHECK(std::abs(shifts.x.mean()) < 0.02);
      CHECK(std::abs(shifts.y.mean()) < 0.02);
      CHECK(shifts.x.standard_deviation() < 0.1);
      CHECK(shifts.y.standard_deviation() < 0.1);
    }
  }

  TEST_CASE("arena: what one frame sees lies in the next where geometry says, to 0.03 pixels") {
    const std::vector<Stance> stances = stereo_slam::script_stances("loop");
    const Shot first = clean_shot(stereo_slam::left_camera_pose(stances[3], 0.2));
    const Shot second = clean_shot(stereo_slam::left_camera_pose(stances[5], 0.2));
    const Shifts shifts = shifts_between(first, second, 8);
    REQUIRE(shifts.x.count() > 60);
    CHECK(std::abs(shifts.x.mean()) < 0.03);
    CHECK(std::abs(shifts.y.mean()) < 0.03);
  }

  TEST_CASE("arena: the camera is where the pixels say: floor in front, fence above it, sky on top") {
    const Shot shot = clean_shot(stereo_slam::left_camera_pose({0, 0, 0}, 0.2));
    const Hit below = cast(shot.T_world_camera.translation(), ray_of(shot, 383.5, 570));
    REQUIRE(below.panel == &scene().panels()[0]);
    CHECK(below.distance > 0.5);
    CHECK(below.distance < 2);
    const Hit ahead = cast(shot.T_world_camera.translation(), ray_of(shot, 20, 120));
    REQUIRE(ahead.panel != nullptr);
    CHECK(ahead.panel->height == ArenaScene::fence_height);
    CHECK(cast(shot.T_world_camera.translation(), ray_of(shot, 383.5, 5)).panel == nullptr);
  }

  TEST_CASE("arena: turn ends where it began and loop drives its second lap over the first") {
    const std::vector<Stance> turn = stereo_slam::script_stances("turn");
    CHECK(turn.front().heading == turn.back().heading);
    const std::vector<Stance> loop = stereo_slam::script_stances("loop");
    const std::size_t lap = stereo_slam::loop_lap();
    REQUIRE(loop.size() == 2 * lap + 1);
    for (std::size_t i = 0; i + lap < loop.size(); ++i) {
      const cairn::SE3 a = stereo_slam::left_camera_pose(loop[i], 0.2);
      const cairn::SE3 b = stereo_slam::left_camera_pose(loop[i + lap], 0.2);
      CHECK((a.inverse() * b).log().norm() < 1e-12);
    }
  }

  TEST_CASE("arena: the robot moves at most 10 cm and 4 degrees a frame, in the arena and past every box") {
    for (const char* script : {"turn", "loop", "spiral"}) {
      CAPTURE(script);
      const std::vector<Stance> stances = stereo_slam::script_stances(script);
      double nearest_box = 1e9, furthest = 0, largest_step = 0, largest_turn = 0;
      for (std::size_t i = 0; i < stances.size(); ++i) {
        const cairn::SE3 pose = stereo_slam::left_camera_pose(stances[i], 0.2);
        furthest = std::max(furthest, pose.translation().head<2>().lpNorm<Eigen::Infinity>());
        for (const stereo_slam::Box& box : scene().boxes())
          nearest_box = std::min(nearest_box, std::hypot(box.x - stances[i].x, box.y - stances[i].y) -
                                                  std::hypot(box.length, box.width) / 2);
        if (i == 0) continue;
        const cairn::Vector<6> step =
            (stereo_slam::left_camera_pose(stances[i - 1], 0.2).inverse() * pose).log();
        largest_step = std::max(largest_step, step.head<3>().norm());
        largest_turn = std::max(largest_turn, step.tail<3>().norm() * 180 / std::numbers::pi);
      }
      CHECK(stances.size() >= 100);
      CHECK(largest_step < 0.1);
      CHECK(largest_turn < 4);
      CHECK(furthest < 4.5);
      CHECK(nearest_box >= 0.3);
    }
    CHECK(scene().boxes().size() >= 8);
  }

  TEST_CASE("arena: pictures depend on options alone, not on threads or the cache") {
    const cairn_test::Folder folder;
    const ArenaOptions options = small_options(folder);
    const auto cold = stereo_slam::open_arena(options, 3, 3, shared_scene());
    REQUIRE(cold->size() == 3);
    const stereo_slam::StereoFrame first = cold->frame(2);
    CHECK(same_pictures(cold->frame(2), first));
    const auto warm = stereo_slam::open_arena(options, 0, 1);  // from disk
    REQUIRE(warm->size() == 181);
    CHECK(same_pictures(warm->frame(2), first));
    ArenaOptions fresh = options;
    fresh.cache = false;
    CHECK(same_pictures(stereo_slam::open_arena(fresh, 3, 1)->frame(2), first));  // with a ground of its own
    fresh.exposure = 0;
    CHECK_FALSE(same_pictures(stereo_slam::open_arena(fresh, 3, 1, shared_scene())->frame(2), first));
  }

  TEST_CASE("arena: a damaged picture on disk is rendered again") {
    const cairn_test::Folder folder;
    const auto arena = stereo_slam::open_arena(small_options(folder), 1, 2, shared_scene());
    const stereo_slam::StereoFrame good = arena->frame(0);
    std::filesystem::path file;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path()))
      if (entry.path().extension() == ".pgm") file = entry.path();
    REQUIRE_FALSE(file.empty());
    const std::string bytes = cairn::read_file(file);
    std::string flipped = bytes;
    flipped[bytes.size() / 2] = static_cast<char>(flipped[bytes.size() / 2] ^ 1);
    const std::array<std::string, 5> damages{flipped, bytes.substr(0, bytes.size() - 1), bytes + "x", "",
                                             "P5\n"};
    for (const std::string& damage : damages) {
      cairn::write_file_atomically(file, damage);
      CHECK(same_pictures(arena->frame(0), good));
      CHECK(cairn::read_file(file) == bytes);
    }
  }

  TEST_CASE("arena: a cache folder that cannot be made costs time, nothing else") {
    const cairn_test::Folder folder;
    folder.put("file", "not a folder");
    ArenaOptions options = small_options(folder);
    const auto with = stereo_slam::open_arena(options, 1, 2, shared_scene());
    options.cache_folder = folder / "file";
    CHECK(same_pictures(stereo_slam::open_arena(options, 1, 2, shared_scene())->frame(0), with->frame(0)));
  }

  TEST_CASE("arena: noise and exposure are as asked") {
    Shot shot = clean_shot(stereo_slam::left_camera_pose({0, 0, 0}, 0.2));
    const cairn::Image clean = render(scene(), std::array{shot}, 2)[0];
    shot.noise = 3;
    const cairn::Image noisy = render(scene(), std::array{shot}, 2)[0];
    shot.noise_stream = 1;
    const cairn::Image other = render(scene(), std::array{shot}, 2)[0];
    shot.noise = 0;
    shot.exposure = 0.5;
    const cairn::Image dim = render(scene(), std::array{shot}, 2)[0];
    cairn::RunningMoments noise, both, ratio;
    for (int y = 100; y < 576; ++y)
      for (int x = 0; x < 768; ++x) {
        if (clean(x, y) < 20 || clean(x, y) > 235) continue;
        noise.add(noisy(x, y) - clean(x, y));
        both.add((noisy(x, y) - clean(x, y)) * (other(x, y) - clean(x, y)));
        ratio.add(static_cast<double>(dim(x, y)) / clean(x, y));
      }
    CHECK(std::abs(noise.mean()) < 0.05);
    CHECK(noise.standard_deviation() == doctest::Approx(3).epsilon(0.03));
    CHECK(std::abs(both.mean()) < 0.1);
    CHECK(ratio.mean() == doctest::Approx(0.5).epsilon(0.01));
  }

  TEST_CASE("arena: drift turns the right camera and leaves the left and the rig that the program is told") {
    const cairn_test::Folder folder;
    ArenaOptions options = small_options(folder);
    options.noise = 0;
    const auto steady = stereo_slam::open_arena(options, 0, 2, shared_scene());
    options.drift = 1;
    const auto drifting = stereo_slam::open_arena(options, 0, 2, shared_scene());
    CHECK(same_pictures(drifting->frame(0), steady->frame(0)));
    CHECK(drifting->frame(60).left == steady->frame(60).left);
    CHECK_FALSE(drifting->frame(60).right == steady->frame(60).right);
    CHECK(drifting->rig().rectified());
    CHECK(drifting->rig().T_left_right.translation() == steady->rig().T_left_right.translation());
  }

  TEST_CASE("arena: options that make no camera are refused in words") {
    const auto message = [](auto change) {
      ArenaOptions options;
      options.cache = false;
      change(options);
      return cairn_test::message_of([&] { static_cast<void>(stereo_slam::open_arena(options, 1, 1)); });
    };
    CHECK(message([](ArenaOptions& o) { o.script = "dance"; }) ==
          "arena: there is no script 'dance'; expected turn, loop or spiral");
    CHECK(message([](ArenaOptions& o) { o.width = 0; }).find("width") != std::string::npos);
    CHECK(message([](ArenaOptions& o) { o.field_of_view = 180; }).find("field of view") != std::string::npos);
    CHECK(message([](ArenaOptions& o) { o.baseline = 0; }).find("baseline") != std::string::npos);
    CHECK(message([](ArenaOptions& o) { o.noise = std::nan(""); }).find("noise") != std::string::npos);
    CHECK(message([](ArenaOptions& o) { o.drift = std::nan(""); }).find("drift") != std::string::npos);
    CHECK(message([](ArenaOptions&) {}).empty());
  }
}

}  // namespace arena_test
