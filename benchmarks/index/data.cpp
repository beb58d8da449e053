// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "data.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <thread>

#include <cairn/core/random.hpp>

#include "support/bvecs.hpp"
#include "support/data.hpp"

#ifdef CAIRN_BENCH_PICTURES
#include <cairn/vision/surf.hpp>

#include "support/image_io.hpp"
#endif

namespace cairn_bench {
namespace {

constexpr double pi = 3.14159265358979323846;

/// A beam of a scanner 2 m above a street 20 m wide, with walls: where it ends, with 2 cm of noise.
Point3 scan_point(cairn::Random& random) {
  const double elevation = (-24.8 + 26.8 * static_cast<double>(random.below(64)) / 63) * pi / 180;
  const double azimuth = random.uniform(-pi, pi);
  const double to_wall = 10 / std::max(std::abs(std::sin(azimuth)), 0.1);
  const double to_ground = elevation < 0 ? 2 / std::tan(-elevation) : 1e9;
  const double range = std::min(to_wall, to_ground) + random.normal(0, 0.02);
  return {static_cast<float>(range * std::cos(azimuth)), static_cast<float>(range * std::sin(azimuth)),
          static_cast<float>(range * std::tan(elevation))};
}

void normalise(float* row, std::size_t dim) {
  double sum = 0;
  for (std::size_t a = 0; a < dim; ++a) sum += double{row[a]} * double{row[a]};
  for (std::size_t a = 0; a < dim; ++a) row[a] = static_cast<float>(row[a] / std::sqrt(sum));
}

}  // namespace

std::vector<Point3> points_like(const std::string& shape, std::size_t count, std::uint64_t seed) {
  cairn::Random random(seed);
  std::vector<Point3> points(count);
  for (Point3& point : points) {
    if (shape == "scan") {
      point = scan_point(random);
      continue;
    }
    const double along = random.uniform();
    for (float& number : point) {
      number = static_cast<float>(random.uniform());
      if (shape == "line") number = static_cast<float>(along);
      if (shape == "equal") number = 0.5F;
      if (shape == "lattice") number = static_cast<float>(random.below(64)) / 64;
      if (shape == "duplicates") number = static_cast<float>(random.below(10)) / 10;
    }
  }
  return points;
}

std::vector<float> clustered_descriptors(std::size_t count, std::uint64_t seed) {
  constexpr std::size_t dim = 64;
  cairn::Random random(99);  // the world's clusters are always the same
  std::vector<float> centres(300 * dim);
  for (std::size_t i = 0; i < centres.size(); ++i)
    centres[i] = static_cast<float>(random.normal(0, 1.0 / (1.0 + 0.1 * static_cast<double>(i % dim))));
  cairn::Random draw(seed, 1);
  std::vector<float> rows(count * dim);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t centre = draw.below(300);
    for (std::size_t a = 0; a < dim; ++a)
      rows[i * dim + a] = centres[centre * dim + a] +
                          static_cast<float>(draw.normal(0, 0.6 / (1.0 + 0.1 * static_cast<double>(a))));
    normalise(&rows[i * dim], dim);
  }
  return rows;
}

std::vector<float> noisy_copies(const std::vector<float>& of, std::size_t count, std::uint64_t seed) {
  constexpr std::size_t dim = 64;
  cairn::Random random(seed, 2);
  std::vector<float> queries = clustered_descriptors(count, seed + 1000);
  for (std::size_t i = 0; i < count; i += 2) {
    const std::size_t source = random.below(of.size() / dim);
    for (std::size_t a = 0; a < dim; ++a)
      queries[i * dim + a] = of[source * dim + a] + static_cast<float>(random.normal(0, 0.02));
    normalise(&queries[i * dim], dim);
  }
  return queries;
}

Descriptors features(std::size_t count, std::size_t dim, std::uint64_t seed) {
  constexpr std::size_t hidden = 30, queries = 500;
  cairn::Random random(seed, 3);
  std::vector<float> map(dim * hidden);
  for (float& weight : map) weight = static_cast<float>(random.normal());
  Descriptors result{dim, std::vector<float>(count * dim), std::vector<float>(queries * dim)};
  const auto draw = [&](float* row) {
    float factors[hidden];
    for (float& factor : factors) factor = static_cast<float>(random.normal());
    for (std::size_t a = 0; a < dim; ++a) {
      float sum = 0;
      for (std::size_t k = 0; k < hidden; ++k) sum += map[a * hidden + k] * factors[k];
      row[a] = std::max(sum, 0.0F) + static_cast<float>(random.normal(0, 0.5));
    }
    normalise(row, dim);
  };
  for (std::size_t i = 0; i < count; ++i) draw(&result.base[i * dim]);
  for (std::size_t i = 0; i < queries; ++i) {
    float* row = &result.queries[i * dim];
    if (i % 2 == 1) {
      draw(row);
      continue;
    }
    const float* source = &result.base[random.below(count) * dim];
    for (std::size_t a = 0; a < dim; ++a)
      row[a] = source[a] + static_cast<float>(random.normal(0, 0.5 / std::sqrt(static_cast<double>(dim))));
  }
  return result;
}

std::optional<Descriptors> sift() {
  const auto folder = cairn_test::real_data("sift_99k");
  if (!folder) return std::nullopt;
  return Descriptors{128, cairn_test::read_bvecs(*folder / "base.bvecs"),
                     cairn_test::read_bvecs(*folder / "query.bvecs")};
}

#ifdef CAIRN_BENCH_PICTURES
std::optional<Descriptors> surf_of_pictures(std::size_t most, std::size_t queries) {
  std::vector<std::filesystem::path> pictures;
  for (const char* name : {"kitti_raw_0926", "kitti_odometry_a", "stereo_pairs"}) {
    const auto folder = cairn_test::real_data(name);
    if (!folder) continue;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(*folder))
      if (entry.path().extension() == ".png") pictures.push_back(entry.path());
  }
  if (pictures.size() < 20) return std::nullopt;
  std::sort(pictures.begin(), pictures.end());
  cairn::SurfOptions options;
  options.threshold = 0.5F;
  options.target_count = static_cast<int>(most / pictures.size() * 5 / 4);
  cairn::Surf surf(options, std::max(1U, std::thread::hardware_concurrency()));
  Descriptors result{64, {}, {}};
  std::vector<float> held_back;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const cairn::Image picture = example::read_image(pictures[i]);
    const cairn::Features& found = surf(picture);
    std::vector<float>& rows = i % 20 == 10 ? held_back : result.base;
    for (std::size_t k = 0; k < found.size(); ++k) {
      const auto row = found.descriptor(k);
      rows.insert(rows.end(), row.begin(), row.end());
    }
  }
  result.base.resize(std::min(result.base.size(), most * 64));
  const std::size_t step = std::max<std::size_t>(1, held_back.size() / 64 / queries);
  for (std::size_t i = 0; i + 64 <= held_back.size() && result.queries.size() < queries * 64; i += step * 64)
    result.queries.insert(result.queries.end(), held_back.begin() + static_cast<std::ptrdiff_t>(i),
                          held_back.begin() + static_cast<std::ptrdiff_t>(i + 64));
  return result;
}
#else
std::optional<Descriptors> surf_of_pictures(std::size_t, std::size_t) {
  return std::nullopt;
}
#endif

}  // namespace cairn_bench
