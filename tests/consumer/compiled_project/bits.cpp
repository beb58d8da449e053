// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Every bit of what the instances of cairn::compiled answer, as a line a kind.
#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <span>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/io/file.hpp>

namespace {

// FNV-1a of all numbers shown.
class Bits {
public:
  void add(double number) noexcept { add(std::bit_cast<std::uint64_t>(number)); }
  void add(std::uint64_t number) noexcept {
    for (int i = 0; i < 8; ++i) hash_ = (hash_ ^ ((number >> (8 * i)) & 255U)) * 1099511628211U;
  }
  void print(const char* what) const {
    std::printf("%s %016llx\n", what, static_cast<unsigned long long>(hash_));
  }

private:
  std::uint64_t hash_ = 14695981039346656037U;
};

template <class Hits>
void add(Bits& bits, const Hits& hits) {
  for (const auto& [id, distance] : hits) {
    bits.add(std::uint64_t{id});
    bits.add(static_cast<double>(distance));
  }
}

template <class Scalar, std::size_t Dim>
void search(const char* what, std::size_t dim) {
  cairn::Random random(7);
  std::vector<std::vector<Scalar>> points(3000, std::vector<Scalar>(dim));
  for (auto& point : points)
    for (Scalar& number : point) number = static_cast<Scalar>(random.uniform(-1, 1));
  const cairn::KdTree<Scalar, Dim> tree(points);
  cairn::MultiKdTree<Scalar, Dim> forest({.first_size = 64});
  for (std::size_t i = 0; i < points.size(); i += 100) forest.insert(std::span(points).subspan(i, 100));
  for (cairn::PointId id = 0; id < 1000; id += 3) forest.erase(id);
  Bits bits;
  const auto ask = [&](const auto& index, const std::vector<Scalar>& query) {
    if (const auto hit = index.nearest(query)) add(bits, std::array{*hit});
    add(bits, index.nearest(query, 7));
    add(bits, index.within(query, Scalar(0.3)));
    add(bits, index.nearest(query, 3, cairn::Budget{.leaves = 4}));
  };
  for (int i = 0; i < 200; ++i) {
    std::vector<Scalar> query(dim);
    for (Scalar& number : query) number = static_cast<Scalar>(random.uniform(-1.2, 1.2));
    ask(tree, query);
    ask(forest, query);
  }
  bits.print(what);
}

void estimate_pose() {
  cairn::Random random(9);
  const cairn::StereoRig rig{{}, {}, cairn::SE3(cairn::SO3(), cairn::Vector<3>(0.1, 0, 0))};
  std::vector<cairn::StereoMatch> matches(60);
  for (cairn::StereoMatch& m : matches) {
    m.landmark = cairn::Vector<3>(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(2, 5));
    const auto seen = [&](double x) {
      return cairn::Vector<2>((m.landmark(0) - x) / m.landmark(2) + 1e-4 * random.normal(),
                              m.landmark(1) / m.landmark(2) + 1e-4 * random.normal());
    };
    m.left = seen(0);
    m.right = seen(0.1);
    m.sigma_left = m.sigma_right = 1e-4;
  }
  const cairn::StereoPose pose = cairn::estimate_stereo_pose(rig, matches);
  const cairn::StereoPose refined = cairn::refine_stereo_pose(rig, matches, pose.T_world_camera);
  Bits bits;
  for (const cairn::StereoPose& one : {pose, refined}) {
    for (int i = 0; i < 16; ++i) bits.add(one.T_world_camera.matrix()(i / 4, i % 4));
    for (int i = 0; i < 36; ++i) bits.add(one.covariance(i / 6, i % 6));
    bits.add(one.cost);
    bits.add(std::uint64_t{one.inlier_count});
  }
  std::printf("%s, ", explain(pose.status));
  bits.print("stereo pose");
}

}  // namespace

int main(int, char** argv) {
  search<float, 3>("float 3", 3);
  search<double, cairn::dynamic_dim>("double, any number", 5);
  search<double, cairn::dynamic_dim>("double, many", 20);
  estimate_pose();
  const std::filesystem::path file = std::filesystem::path(argv[0]).concat(".bytes");
  cairn::write_file_atomically(file, "bytes\n");
  std::printf("%s", cairn::read_file(file).c_str());
}
