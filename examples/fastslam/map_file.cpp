// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Mapper::save and Mapper::loaded: all that a mapper is, so that going on from a file is going on.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/models/sensor.hpp>

#include "mapper.hpp"
#include "support/archive.hpp"
#include "support/paths_archive.hpp"

namespace cairn {
inline namespace CAIRN_ABI {

// Found by the archive, beside the types.
template <class Archive>
void parts(Archive& archive, LandmarkOptions& o) {
  std::optional<double> remove_below;
  if (std::isfinite(o.remove_below)) remove_below = o.remove_below;
  archive(o.pick, o.gate, o.gate_of_named, o.new_density, o.clutter_density, o.seen, o.false_share,
          remove_below, o.most_log_odds, o.filing_distance);
  o.remove_below = remove_below.value_or(-std::numeric_limits<double>::infinity());
}
template <class Archive>
void parts(Archive& archive, LandmarkSighting<RangeBearing::Measurement>& s) {
  double range = s.z.part<0>()(0), bearing = s.z.part<1>().angle();
  archive(range, bearing, s.identity);
  if constexpr (Archive::reads) s.z = RangeBearing::measurement(range, bearing);
}
template <class Archive>
void parts(Archive& archive, LandmarkMapRecord<Vector<2>>::Landmark& l) {
  archive(l.number, l.landmark.belief, l.landmark.log_odds, l.landmark.sightings, l.filed);
}
template <class Archive>
void parts(Archive& archive, LandmarkMapRecord<Vector<2>>& r) {
  archive(r.landmarks, r.numbers, r.widest);
}

}  // namespace CAIRN_ABI
}  // namespace cairn

namespace fastslam {

using example::expect_covariance;
using example::expect_place;
using example::Reader;
using example::Writer;

/// A mapper as plain values, with the frames that it has mapped: it can only go on with a log that begins
/// with them, for paths are drawn again over all of it.
struct SavedMapper {
  SlamOptions options{};
  PointSensor sensor{};
  std::vector<Frame> frames{};
  cairn::PathsRecord<cairn::SE2> paths{};
  std::vector<cairn::LandmarkMapRecord<cairn::Vector<2>>> maps{};
  std::uint64_t drawn_at = 0;
  cairn::Gaussian<cairn::SE2> drawn{};
  std::vector<cairn::SE2> optimum{};
  std::vector<Reading> other_names{};
  std::vector<StepRecord> steps{};
  std::size_t doubted = 0;
};

template <class Archive>
void parts(Archive& archive, PointSensor& s) {
  archive(s.range_sigma, s.bearing_sigma, s.across_sigma, s.farthest, s.half_view, s.detection);
}
template <class Archive>
void parts(Archive& archive, Frame& f) {
  archive(f.time, f.moved, f.seen);
}
template <class Archive>
void parts(Archive& archive, Reading& r) {
  archive(r.poses, r.associations, r.log_density);
}
template <class Archive>
void parts(Archive& archive, StepRecord& s) {
  archive(s.time, s.effective_size, s.resampled, s.redrawn, s.sightings, s.landmarks, s.pose, s.nees);
}
template <class Archive>
void parts(Archive& archive, SlamOptions& o) {
  archive(o.particles, o.seed, o.proposal, o.resample_below, o.redraw_below, o.landmarks);
}
template <class Archive>
void parts(Archive& archive, SavedMapper& s) {
  archive(s.options, s.sensor, s.frames, s.paths, s.maps, s.drawn_at, s.drawn, s.optimum, s.other_names,
          s.steps, s.doubted);
}

namespace {

constexpr std::string_view kind_of_file = "cairnlmk";
constexpr std::uint64_t version_of_file = 1;

/// The numbers that stand for it: the same for the same values.
template <class T>
std::string numbers_of(T value) {
  Writer writer;
  writer(value);
  return std::move(writer).file(kind_of_file, version_of_file);
}

void expect_options(const Reader& reader, const SlamOptions& o) {
  const auto is_share = [](double v) { return v >= 0 && v <= 1; };
  if (o.proposal > ProposalKind::landmarks || o.landmarks.pick > cairn::Pick::drawn ||
      !is_share(o.resample_below) || !is_share(o.redraw_below) || !o.landmarks.valid())
    reader.refuse("the map was made with settings that there are not");
}

/// Associations of the first frames, numbered as a map would: no landmark before the sighting that begins it.
void expect_reading(const Reader& reader, const Reading& reading, const std::vector<Frame>& frames) {
  if (reading.poses.size() != reading.associations.size() || reading.poses.size() > frames.size())
    reader.refuse("other names are not of the frames");
  std::uint32_t begun = 0;
  for (std::size_t k = 0; k < reading.poses.size(); ++k) {
    expect_place(reader, reading.poses[k]);
    if (reading.associations[k].size() != frames[k].seen.size())
      reader.refuse("other names are not of the sightings");
    for (const std::uint32_t number : reading.associations[k])
      if (number < cairn::no_landmark && number >= begun) reader.refuse("other names are of no landmark");
    begun += static_cast<std::uint32_t>(std::ranges::count(reading.associations[k], cairn::new_landmark));
  }
}

void expect_sound(const Reader& reader, const SavedMapper& s) {
  const std::size_t frames = s.frames.size();
  if (s.paths.particles.size() != s.options.particles || s.maps.size() != s.options.particles)
    reader.refuse("the map has other particles than it says");
  expect_paths(reader, s.paths, frames + 1, 1);
  if (s.steps.size() != frames || s.drawn_at > frames || s.optimum.size() > frames)
    reader.refuse("the map has not as many steps as frames");
  for (std::size_t k = 0; k < frames; ++k) {
    if (s.steps[k].time != s.frames[k].time) reader.refuse("the steps are not at the times of the frames");
    expect_place(reader, s.steps[k].pose.mean);
    expect_covariance(reader, s.steps[k].pose.covariance);
  }
  expect_place(reader, s.drawn.mean);
  expect_covariance(reader, s.drawn.covariance);
  for (const cairn::SE2& pose : s.optimum) expect_place(reader, pose);
  for (const Reading& reading : s.other_names) expect_reading(reader, reading, s.frames);
}

void expect_log(const Reader& reader, const SavedMapper& s, const LandmarkLog& log) {
  const auto hint = " (the same --data, --folder, --name, --robot and --identities are asked for)";
  if (s.frames.size() > log.frames.size())
    reader.refuse("a map of " + std::to_string(s.frames.size()) + " frames, and the log has " +
                  std::to_string(log.frames.size()) + hint);
  if (numbers_of(s.sensor) != numbers_of(log.sensor))
    reader.refuse(std::string("the log's sensor is not the map's") + hint);
  for (std::size_t k = 0; k < s.frames.size(); ++k)
    if (numbers_of(s.frames[k]) != numbers_of(log.frames[k]))
      reader.refuse("frame " + std::to_string(k) + " of the log is not that of the map" + hint);
}

/// Calls visit(reader); what it throws names the file.
template <class Visit>
auto read_map(const std::filesystem::path& path, Visit&& visit) {
  const std::string bytes = cairn::read_file(path, "a map of fastslam");
  Reader reader(bytes, kind_of_file, version_of_file, path.string());
  try {
    return visit(reader);
  } catch (const cairn::Error& error) {  // of what the numbers were given to
    if (std::string_view(error.what()).starts_with(path.string())) throw;
    reader.refuse(error.what());
  }
}

std::vector<Map> restored(const SavedMapper& saved, const LandmarkLog& log) {
  const Map empty(log.sensor, saved.options.landmarks);
  std::vector<Map> maps;
  for (const auto& record : saved.maps) maps.push_back(empty.restored(record));
  return maps;
}

}  // namespace

void Mapper::save(const std::filesystem::path& path) const {
  if (steps_.empty()) cairn::raise("a map without a frame is not saved");
  const auto end = log_.frames.begin() + static_cast<std::ptrdiff_t>(steps_.size());
  SavedMapper saved{.options = options_,
                    .sensor = log_.sensor,
                    .frames = {log_.frames.begin(), end},
                    .paths = belief_.record(),
                    .drawn_at = spread_.step(),
                    .drawn = spread_.drawn(),
                    .optimum = optimum_,
                    .other_names = others_.kept(),
                    .steps = steps_,
                    .doubted = doubted_};
  for (std::size_t i = 0; i < belief_.size(); ++i) saved.maps.push_back(belief_[i].map.record());
  cairn::write_file_atomically(path, numbers_of(std::move(saved)));
}

Mapper::Mapper(const LandmarkLog& log, SavedMapper saved)
    : log_(log),
      options_(saved.options),
      belief_(saved.paths, restored(saved, log)),
      spread_(saved.drawn_at, saved.drawn),
      others_(log, saved.options, std::move(saved.other_names)),
      optimum_(std::move(saved.optimum)),
      steps_(std::move(saved.steps)),
      doubted_(saved.doubted) {}

Mapper Mapper::loaded(const std::filesystem::path& path, const LandmarkLog& log, unsigned threads) {
  return read_map(path, [&](Reader& reader) {
    SavedMapper saved;
    reader(saved);
    reader.expect_end();
    expect_options(reader, saved.options);
    expect_sound(reader, saved);
    expect_log(reader, saved, log);
    saved.options.threads = threads;
    return Mapper(log, std::move(saved));
  });
}

SlamOptions saved_options(const std::filesystem::path& path) {
  return read_map(path, [](Reader& reader) {
    SlamOptions options;
    reader(options);
    expect_options(reader, options);
    return options;
  });
}

}  // namespace fastslam
