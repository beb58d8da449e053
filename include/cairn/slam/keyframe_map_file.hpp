// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Saving a map of keyframes and loading it again, as a part of a file that the caller makes
/// (io/binary_file.hpp).
///
/// ```cpp
/// cairn::BinaryWriter out;
/// cairn::save_keyframe_map(out, map);  // then what the caller knows of the landmarks, descriptors say
/// const std::string bytes = out.file("example ", 1);
///
/// cairn::BinaryReader in(bytes, "example ", 1, "my map");
/// cairn::KeyframeMap loaded = cairn::load_keyframe_map(in);
/// in.expect_end();
/// ```
///
/// Everything that the map knows is kept: the keyframes with their joint covariance, the landmarks with their
/// lists, the rig and what it was corrected by, the options. Landmarks are numbered anew, 0, 1, 2, ... in the
/// ascending order of their ids, so that who keeps more of them than their place writes it in that order.
/// Positions are computed from the lists where they are first asked for: the same to within rounding. A map
/// of n keyframes and l landmarks with m sightings each takes 144 n^2 + (42 + 44 m) l bytes and what the
/// keyframes list.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/io/binary_file.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/slam/keyframe_map.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// A number for writing and for reading: the two cannot come apart where both name the fields once.
struct PutField {
  BinaryWriter* out;
  template <class T>
  void operator()(const T& value) const {
    out->put(value);
  }
};
struct GetField {
  BinaryReader* in;
  template <class T>
  void operator()(T& value) const {
    if constexpr (std::is_floating_point_v<T>)
      value = in->finite();
    else
      value = in->get<T>();
  }
};

template <class Options, class Field>
void fields_of_options(Options& o, const Field& field) {
  field(o.sightings_a_visit);
  field(o.sightings);
  field(o.visit_gap);
  field(o.gate_probability);
  field(o.loss_scale);
  for (auto* sigma : {&o.rig.rotation, &o.rig.direction, &o.rig.length, &o.rig.focal, &o.rig.focal_ratio,
                      &o.rig.centre, &o.rig.right_centre})
    field(*sigma);
  field(o.first_sigma);
  field(o.contradiction);
  field(o.much_vaguer);
}

template <class Parameters, class Field>
void fields_of_camera(Parameters& p, const Field& field) {
  for (auto* value : {&p.fx, &p.fy, &p.cx, &p.cy, &p.k1, &p.k2, &p.p1, &p.p2, &p.k3}) field(*value);
  field(p.width);
  field(p.height);
}

template <class M, class Field>
void fields_of_matrix(M& m, const Field& field) {
  for (Eigen::Index i = 0; i < m.size(); ++i) field(m.data()[i]);
}

struct KeyframeMapFile {
  static void put(BinaryWriter& out, const KeyframeMap& map) {
    const PutField field{&out};
    put(out, map.options_);
    put(out, map.correction_.nominal());
    field(map.pixel_factor_);
    field(map.pose_factor_);
    field(map.frame_);
    const std::vector<std::uint32_t> ids = map.landmark_ids();
    std::unordered_map<std::uint32_t, std::uint32_t> number_of_landmark, number_of_keyframe;
    for (const std::uint32_t id : ids)
      number_of_landmark.emplace(id, static_cast<std::uint32_t>(number_of_landmark.size()));
    put_keyframes(out, map, number_of_landmark, number_of_keyframe);
    out.put(std::uint64_t{ids.size()});
    for (const std::uint32_t id : ids) put(out, map.landmarks_[map.place_.at(id)], number_of_keyframe);
  }

  [[nodiscard]] static KeyframeMap get(BinaryReader& in) {
    const GetField field{&in};
    const KeyframeMapOptions options = get_options(in);
    const StereoRig nominal = get_rig(in);
    if (const char* const fault = KeyframeMap::fault_of(options, nominal)) raise(in.name() + ": " + fault);
    KeyframeMap map(nominal, options);
    field(map.pixel_factor_);
    field(map.pose_factor_);
    field(map.frame_);
    if (!(map.pixel_factor_ > 0 && map.pose_factor_ > 0))
      raise(in.name() + ": a variance factor is not positive");
    get_keyframes(in, map);
    constexpr std::size_t least_bytes = 3 * sizeof(double);
    const auto landmarks = in.count<std::uint64_t>(least_bytes);
    map.landmarks_.reserve(landmarks);
    for (std::uint32_t id = 0; id < landmarks; ++id) get_landmark(in, map, id);
    for (const KeyframeMap::Keyframe& keyframe : map.keyframes_)
      for (const std::uint32_t id : keyframe.saw)
        if (id >= landmarks) raise(in.name() + ": a keyframe saw a landmark that is not there");
    map.change();
    return map;
  }

private:
  static void put(BinaryWriter& out, const KeyframeMapOptions& options) {
    const PutField field{&out};
    fields_of_options(options, field);
    field(static_cast<std::int32_t>(options.loss));
    field(static_cast<std::uint64_t>(options.max_keyframes));
    field(static_cast<std::uint64_t>(options.min_matches));
  }
  [[nodiscard]] static KeyframeMapOptions get_options(BinaryReader& in) {
    KeyframeMapOptions options;
    fields_of_options(options, GetField{&in});
    const auto loss = in.get<std::int32_t>();
    if (loss < 0 || loss > static_cast<std::int32_t>(RobustLoss::cauchy))
      raise(in.name() + ": loss " + std::to_string(loss) + " is unknown");
    options.loss = static_cast<RobustLoss>(loss);
    options.max_keyframes = static_cast<std::size_t>(in.get<std::uint64_t>());
    options.min_matches = static_cast<std::size_t>(in.get<std::uint64_t>());
    return options;
  }

  static void put(BinaryWriter& out, const StereoRig& rig) {
    for (const PinholeCamera* camera : {&rig.left, &rig.right})
      fields_of_camera(camera->parameters(), PutField{&out});
    put(out, rig.T_left_right);
  }
  [[nodiscard]] static StereoRig get_rig(BinaryReader& in) {
    PinholeParameters left, right;
    fields_of_camera(left, GetField{&in});
    fields_of_camera(right, GetField{&in});
    const SE3 T_left_right = get_pose(in);
    return {PinholeCamera(left), PinholeCamera(right), T_left_right};
  }

  static void put(BinaryWriter& out, const SE3& pose) {
    const SO3& r = pose.rotation();
    for (const double value : {r.w(), r.x(), r.y(), r.z()}) out.put(value);
    fields_of_matrix(pose.translation(), PutField{&out});
  }
  [[nodiscard]] static SE3 get_pose(BinaryReader& in) {
    const double w = in.finite(), x = in.finite(), y = in.finite(), z = in.finite();
    Vector<3> translation;
    fields_of_matrix(translation, GetField{&in});
    return {SO3::from_quaternion(w, x, y, z), translation};
  }

  /// Poses and what they saw; the rig's numbers where they are estimated; the covariance of all, its lower
  /// triangle by rows.
  static void put_keyframes(BinaryWriter& out, const KeyframeMap& map,
                            const std::unordered_map<std::uint32_t, std::uint32_t>& number_of_landmark,
                            std::unordered_map<std::uint32_t, std::uint32_t>& number_of_keyframe) {
    std::vector<AnyBlockId> blocks;
    for (std::uint32_t k = 0; k < map.keyframes_.size(); ++k)
      if (map.poses_.contains(map.keyframes_[k].block)) {
        number_of_keyframe.emplace(k, static_cast<std::uint32_t>(blocks.size()));
        blocks.push_back(map.keyframes_[k].block);
      }
    out.put(std::uint64_t{blocks.size()});
    for (const KeyframeMap::Keyframe& keyframe : map.keyframes_) {
      if (!map.poses_.contains(keyframe.block)) continue;
      put(out, map.poses_.mean(keyframe.block).T_world_body);
      std::vector<std::uint32_t> saw;
      for (const std::uint32_t id : keyframe.saw)
        if (const auto found = number_of_landmark.find(id); found != number_of_landmark.end())
          saw.push_back(found->second);
      out.put(std::uint64_t{saw.size()});
      for (const std::uint32_t number : saw) out.put(number);
    }
    const bool with_rig = map.poses_.contains(map.rig_block_);
    out.put(static_cast<std::uint8_t>(with_rig));
    if (with_rig) {
      fields_of_matrix(map.poses_.mean(map.rig_block_), PutField{&out});
      blocks.push_back(map.rig_block_);
    }
    const Matrix<dynamic, dynamic> P = map.poses_.covariance(blocks);
    for (Eigen::Index i = 0; i < P.rows(); ++i)
      for (Eigen::Index j = 0; j <= i; ++j) out.put(P(i, j));
  }

  static void get_keyframes(BinaryReader& in, KeyframeMap& map) {
    constexpr std::size_t least_bytes = 7 * sizeof(double);
    const auto keyframes = in.count<std::uint64_t>(least_bytes);
    for (std::size_t k = 0; k < keyframes; ++k) {
      map.enlist(map.poses_.add(WorldPose{get_pose(in)}, Matrix<6>(Matrix<6>::Identity())).id);
      const auto saw = in.count<std::uint64_t>(sizeof(std::uint32_t));
      for (std::size_t i = 0; i < saw; ++i) map.keyframes_.back().saw.push_back(in.get<std::uint32_t>());
    }
    const bool with_rig = in.get<std::uint8_t>() != 0;
    if (with_rig != (map.with_rig() && keyframes > 0))
      raise(in.name() + ": the rig is estimated where its sigmas are positive, and only there");
    if (with_rig) {
      RigState numbers;
      fields_of_matrix(numbers, GetField{&in});
      map.rig_block_ = map.poses_.add(numbers, Matrix<rig_numbers>(Matrix<rig_numbers>::Identity())).id;
      map.rig_ = map.correction_.rig(numbers);
    }
    const auto size = static_cast<std::size_t>(map.poses_.dof());
    if (size * (size + 1) / 2 > in.left() / sizeof(double))
      raise(in.name() + ": the file promises more than it holds");
    Matrix<dynamic, dynamic> P(map.poses_.dof(), map.poses_.dof());
    for (Eigen::Index i = 0; i < P.rows(); ++i)
      for (Eigen::Index j = 0; j <= i; ++j) P(j, i) = P(i, j) = in.finite();
    if (size > 0 && map.poses_.set_covariance(P) != Status::accepted)
      raise(in.name() + ": the covariance of the keyframes is none");
  }

  static void put(BinaryWriter& out, const KeyframeLandmark& one,
                  const std::unordered_map<std::uint32_t, std::uint32_t>& number_of_keyframe) {
    const PutField field{&out};
    fields_of_matrix(one.x, field);
    field(one.last_seen);
    field(static_cast<std::uint64_t>(one.of_visit));
    field(static_cast<std::uint8_t>(one.barred));
    field(static_cast<std::uint8_t>(one.count));
    for (std::size_t i = 0; i < one.count; ++i) {
      const RecordedSighting& s = one.sightings[i];
      field(number_of_keyframe.at(s.keyframe));
      field(s.sigma);
      fields_of_matrix(s.left, field);
      fields_of_matrix(s.right, field);
    }
  }

  static void get_landmark(BinaryReader& in, KeyframeMap& map, std::uint32_t id) {
    const GetField field{&in};
    KeyframeLandmark one;
    one.id = id;
    fields_of_matrix(one.x, field);
    field(one.last_seen);
    one.of_visit = static_cast<std::size_t>(in.get<std::uint64_t>());
    one.barred = in.get<std::uint8_t>() != 0;
    one.count = in.get<std::uint8_t>();
    if (one.count < 1 || one.count > static_cast<std::size_t>(map.options_.sightings))
      raise(in.name() + ": landmark " + std::to_string(id) + " has " + std::to_string(one.count) +
            " sightings");
    if (one.last_seen > map.frame_)
      raise(in.name() + ": landmark " + std::to_string(id) + " was seen after the last frame");
    for (std::size_t i = 0; i < one.count; ++i) {
      RecordedSighting& s = one.sightings[i];
      field(s.keyframe);
      field(s.sigma);
      fields_of_matrix(s.left, field);
      fields_of_matrix(s.right, field);
      if (s.keyframe >= map.keyframes_.size() || (i > 0 && s.keyframe <= one.sightings[i - 1].keyframe))
        raise(in.name() + ": landmark " + std::to_string(id) +
              " was seen from no keyframe, or twice from one");
      const auto whitened =
          s.sigma > 0 ? WhitenedSighting::of(map.rig_, s.left, s.right, s.sigma) : std::nullopt;
      if (!whitened) raise(in.name() + ": landmark " + std::to_string(id) + " has pixels without a ray");
      s.whitened = *whitened;
      ++map.keyframes_[s.keyframe].sightings;
    }
    map.place_[id] = map.landmarks_.size();
    map.landmarks_.push_back(one);
  }
};

}  // namespace detail

/// Puts a map into a file. O(n^2 + landmarks) for n keyframes.
inline void save_keyframe_map(BinaryWriter& out, const KeyframeMap& map) {
  detail::KeyframeMapFile::put(out, map);
}

/// Takes it out again. Throws Error, with the reader's name, for numbers that are those of no map. O(n^3) for
/// n keyframes, whose covariance is checked.
[[nodiscard]] inline KeyframeMap load_keyframe_map(BinaryReader& in) {
  return detail::KeyframeMapFile::get(in);
}

}}  // namespace cairn::CAIRN_ABI
