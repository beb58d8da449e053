// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "saved_map.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/binary_file.hpp>
#include <cairn/io/file.hpp>
#include <cairn/slam/keyframe_map_file.hpp>

#include "levelled_rig.hpp"

namespace stereo_slam {
namespace {

constexpr const char* file_kind = "cairnmap";

/// The numbers that the keyframes go by in a file, where those that left are not counted.
std::vector<std::optional<std::uint32_t>> numbers_in_file(const cairn::KeyframeMap& map) {
  std::vector<std::optional<std::uint32_t>> numbers(map.keyframes_added());
  std::uint32_t next = 0;
  for (std::size_t k = 0; k < numbers.size(); ++k)
    if (map.keyframe_pose(k)) numbers[k] = next++;
  return numbers;
}

void put(cairn::BinaryWriter& out, const SurfacePatch& patch, std::uint32_t keyframe) {
  out.put(keyframe);
  for (const cairn::Vector<2>* const vector : {&patch.pixel, &patch.slope})
    for (int i = 0; i < 2; ++i) out.put((*vector)(i));
  for (const std::uint8_t grey : patch.grey) out.put(grey);
}

SurfacePatch get_patch(cairn::BinaryReader& in, const cairn::KeyframeMap& map) {
  SurfacePatch patch;
  patch.keyframe = in.get<std::uint32_t>();
  for (cairn::Vector<2>* const vector : {&patch.pixel, &patch.slope})
    for (int i = 0; i < 2; ++i) (*vector)(i) = in.get<double>();
  for (std::uint8_t& grey : patch.grey) grey = in.get<std::uint8_t>();
  if (!map.keyframe_pose(patch.keyframe)) cairn::raise(in.name() + ": a patch is of no keyframe");
  if (!map.nominal_rig().left.contains(patch.pixel) || !patch.slope.allFinite())
    cairn::raise(in.name() + ": a patch is not in its image");
  return patch;
}

void put(cairn::BinaryWriter& out, const Landmark& landmark,
         const std::vector<std::optional<std::uint32_t>>& keyframes) {
  const bool has_patch = landmark.patch && keyframes.at(landmark.patch->keyframe);
  out.put(static_cast<std::uint8_t>(has_patch));
  if (has_patch) put(out, *landmark.patch, *keyframes[landmark.patch->keyframe]);
  out.put(landmark.sign);
  out.put(landmark.grey);
  for (const int number : {landmark.first_seen, landmark.last_seen, landmark.sightings}) out.put(number);
  for (const float number : landmark.descriptor) out.put(number);
}

Landmark get_landmark(cairn::BinaryReader& in, LandmarkId id, int dimension, const cairn::KeyframeMap& map) {
  Landmark landmark;
  landmark.id = id;
  if (in.get<std::uint8_t>() != 0) landmark.patch = std::make_shared<const SurfacePatch>(get_patch(in, map));
  landmark.sign = in.get<std::int8_t>();
  landmark.grey = in.get<std::uint8_t>();
  for (int* number : {&landmark.first_seen, &landmark.last_seen, &landmark.sightings})
    *number = in.get<int>();
  for (int i = 0; i < dimension; ++i) {
    landmark.descriptor.push_back(in.get<float>());
    if (!std::isfinite(landmark.descriptor.back())) cairn::raise(in.name() + ": a descriptor is not finite");
  }
  return landmark;
}

void put(cairn::BinaryWriter& out, const TruthWorld& truth) {
  out.put(static_cast<std::uint32_t>(truth.name.size()));
  for (const char letter : truth.name) out.put(letter);
  const cairn::SO3& r = truth.T_truth_map.rotation();
  for (const double number : {r.w(), r.x(), r.y(), r.z()}) out.put(number);
  for (int i = 0; i < 3; ++i) out.put(truth.T_truth_map.translation()(i));
}

TruthWorld get_truth(cairn::BinaryReader& in) {
  TruthWorld truth;
  const std::size_t letters = in.count<std::uint32_t>(sizeof(char));
  for (std::size_t i = 0; i < letters; ++i) truth.name.push_back(in.get<char>());
  const double w = in.finite(), x = in.finite(), y = in.finite(), z = in.finite();
  cairn::Vector<3> translation;
  for (int i = 0; i < 3; ++i) translation(i) = in.finite();
  truth.T_truth_map = {cairn::SO3::from_quaternion(w, x, y, z), translation};
  return truth;
}

bool same(const cairn::PinholeCamera& a, const cairn::PinholeCamera& b) {
  const cairn::PinholeParameters &p = a.parameters(), &q = b.parameters();
  return p.fx == q.fx && p.fy == q.fy && p.cx == q.cx && p.cy == q.cy && p.k1 == q.k1 && p.k2 == q.k2 &&
         p.p1 == q.p1 && p.p2 == q.p2 && p.k3 == q.k3 && p.width == q.width && p.height == q.height;
}

}  // namespace

void save_map(const std::filesystem::path& path, const SavedMap& saved) {
  cairn::BinaryWriter out;
  out.put(static_cast<std::uint8_t>(saved.features));
  out.put(static_cast<std::uint8_t>(saved.oriented));
  out.put(saved.steps);
  cairn::save_keyframe_map(out, saved.map);
  const auto keyframes = numbers_in_file(saved.map);
  for (const Landmark& landmark : saved.landmarks) put(out, landmark, keyframes);
  out.put(static_cast<std::uint8_t>(saved.truth.has_value()));
  if (saved.truth) put(out, *saved.truth);
  cairn::write_file_atomically(path, std::move(out).file(file_kind, saved_map_version));
}

SavedMap load_map(const std::filesystem::path& path) {
  const std::string bytes = cairn::read_file(path);
  cairn::BinaryReader in(bytes, file_kind, saved_map_version, path.string());
  const auto features = in.get<std::uint8_t>();
  if (features >= feature_names.size()) cairn::raise(path.string() + ": the kind of features is unknown");
  const bool oriented = in.get<std::uint8_t>() != 0;
  const int steps = in.get<int>();
  SavedMap saved{static_cast<FeatureKind>(features), oriented, steps, cairn::load_keyframe_map(in), {}};
  const std::size_t count = saved.map.landmark_count();
  for (std::size_t i = 0; i < count; ++i)
    saved.landmarks.push_back(
        get_landmark(in, static_cast<LandmarkId>(i), dimension_of(saved.features), saved.map));
  if (in.get<std::uint8_t>() != 0) saved.truth = get_truth(in);
  in.expect_end();
  return saved;
}

void expect_same_rig(const cairn::StereoRig& of_map, const cairn::StereoRig& rig, const std::string& name) {
  cairn::Vector<6> apart = cairn::local(of_map.T_left_right, rig.T_left_right);
  if (std::abs(apart(3)) < largest_pitch) apart(3) = 0;  // the run that made the map may have levelled it
  if (same(of_map.left, rig.left) && same(of_map.right, rig.right) && apart.norm() < 1e-9) return;
  cairn::raise(name + ": this map was made with another rig than these images (" +
               std::to_string(of_map.left.width()) + " x " + std::to_string(of_map.left.height()) +
               " pixels, focal length " + std::to_string(of_map.left.fx()) + ", baseline " +
               std::to_string(of_map.baseline()) + " m; here " + std::to_string(rig.left.width()) + " x " +
               std::to_string(rig.left.height()) + ", " + std::to_string(rig.left.fx()) + ", " +
               std::to_string(rig.baseline()) + " m)");
}

}  // namespace stereo_slam
