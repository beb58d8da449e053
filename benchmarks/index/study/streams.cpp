// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "study/streams.hpp"

#include <algorithm>
#include <utility>

#include "data.hpp"

#ifdef CAIRN_STUDY_ARENA
#include <cairn/vision/surf.hpp>

#include "arena_dataset.hpp"
#endif

namespace cairn_study {
namespace {

constexpr std::size_t held_back = 1000;

/// Cuts the points into steps; what does not fill a step is left out.
Stream in_steps(Stream stream, std::size_t steps) {
  stream.held_back = held_back;
  stream.step = std::max<std::size_t>(1, stream.points() / steps);
  stream.queries = 4 * stream.step;
  stream.timed = std::min<std::size_t>(stream.queries, stream.dim == 3 ? 500 : 60);
  const std::size_t used = stream.step * steps + held_back;
  if (used * stream.dim < stream.rows.size()) stream.rows.resize(used * stream.dim);
  return stream;
}

}  // namespace

Stream uniform_points(std::size_t count, std::size_t steps) {
  Stream stream{.name = "points_3", .title = "Uniform points of 3 numbers, exact search", .dim = 3};
  for (const auto& point : cairn_bench::points_like("uniform", count + held_back, 5))
    stream.rows.insert(stream.rows.end(), point.begin(), point.end());
  stream.noise = 0.01F;
  return in_steps(std::move(stream), steps);
}

Stream clustered(std::size_t count, std::size_t steps) {
  Stream stream{
      .name = "clusters_64", .title = "Clustered descriptors of 64 numbers, best-bin-first", .dim = 64};
  stream.rows = cairn_bench::clustered_descriptors(count + held_back, 5);
  stream.noise = 0.02F;
  return in_steps(std::move(stream), steps);
}

std::optional<Stream> sift_descriptors(std::size_t count, std::size_t steps) {
  auto descriptors = cairn_bench::sift();
  if (!descriptors) return std::nullopt;
  Stream stream{
      .name = "sift_128", .title = "SIFT descriptors of pictures, 128 numbers, best-bin-first", .dim = 128};
  stream.rows = std::move(descriptors->base);
  if ((count + held_back) * stream.dim < stream.rows.size())
    stream.rows.resize((count + held_back) * stream.dim);
  stream.noise = 8;
  return in_steps(std::move(stream), steps);
}

std::optional<Stream> arena_descriptors([[maybe_unused]] std::size_t frames,
                                        [[maybe_unused]] std::size_t steps) {
#ifdef CAIRN_STUDY_ARENA
  Stream stream{.name = "surf_64",
                .title = "SURF descriptors of the rendered arena, 64 numbers, best-bin-first",
                .dim = 64};
  const auto arena = stereo_slam::open_arena({}, frames, 1);
  cairn::Surf surf({.upright = true, .target_count = 1500});
  for (std::size_t i = 0; i < arena->size(); ++i) {
    const auto frame = arena->frame(i);
    const auto& found = surf(frame.left);
    stream.rows.insert(stream.rows.end(), found.descriptors.begin(), found.descriptors.end());
  }
  if (stream.rows.size() / stream.dim < held_back + steps) return std::nullopt;
  stream.noise = 0.01F;
  return in_steps(std::move(stream), steps);
#else
  return std::nullopt;
#endif
}

}  // namespace cairn_study
