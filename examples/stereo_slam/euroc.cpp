// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>
#include <cairn/io/trajectory.hpp>

#include "recording.hpp"

namespace stereo_slam {
namespace {

using Path = std::filesystem::path;
using Nanoseconds = std::int64_t;

// The few things that sensor.yaml says, without a YAML library: "key: [numbers]", over several lines or not.
class SensorFile {
public:
  explicit SensorFile(const Path& file) : name_(file.string()) {
    cairn::TextLines lines(file, "the sensor.yaml of a EuRoC camera");
    while (lines.next()) {
      const std::string_view line = lines.line();
      text_.append(line.substr(0, line.find('#'))).push_back('\n');
    }
  }

  // The bracketed list after `key`, which must have between `least` and `most` numbers.
  [[nodiscard]] std::vector<double> list(const std::string& key, std::size_t least, std::size_t most) const {
    const std::string expected =
        "'" + key + "' with a list of " + std::to_string(least) + " finite numbers in brackets";
    const std::size_t after = place_of(key, expected) + key.size() + 1;
    const std::size_t open = text_.find('[', after);
    if (open == std::string::npos || !leads_to_list(std::string_view(text_).substr(after, open - after)))
      refuse(expected);
    const std::size_t close = text_.find(']', open);
    if (close == std::string::npos) refuse(expected);
    std::vector<double> numbers;
    std::string_view rest = std::string_view(text_).substr(open + 1, close - open - 1);
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find(','), rest.size());
      const std::optional<double> value = cairn::parse_number(without_ends(rest.substr(0, end)));
      if (!value || !std::isfinite(*value)) refuse(expected);
      numbers.push_back(*value);
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    if (numbers.size() < least || numbers.size() > most) refuse(expected);
    return numbers;
  }

  [[nodiscard]] std::string word(const std::string& key) const {
    const std::size_t start = place_of(key, "'" + key + "'") + key.size() + 1;
    return std::string(without_ends(std::string_view(text_).substr(start, text_.find('\n', start) - start)));
  }

  [[noreturn]] void refuse(const std::string& expected) const {
    cairn::raise(name_ + ": expected " + expected);
  }

private:
  [[nodiscard]] std::size_t place_of(const std::string& key, const std::string& expected) const {
    const std::string head = "\n" + key + ":";  // lines are trimmed, so a key starts its line
    const std::size_t found = text_.find(head);
    if (found == std::string::npos) cairn::raise(name_ + ": lacks the key " + key + "; expected " + expected);
    if (text_.find(head, found + 1) != std::string::npos) refuse("the key " + key + " once");
    return found + 1;
  }

  // Between a key and its list there may be what OpenCV says of a matrix, and no other key.
  static bool leads_to_list(std::string_view between) {
    while (!between.empty()) {
      const std::size_t end = std::min(between.find('\n'), between.size());
      const std::string_view line = without_ends(between.substr(0, end));
      const auto begins = [&](std::string_view word) { return line.starts_with(word); };
      if (!line.empty() && !begins("cols:") && !begins("rows:") && !begins("dt:") && !begins("data:") &&
          !begins("!!"))
        return false;
      between.remove_prefix(std::min(end + 1, between.size()));
    }
    return true;
  }

  static std::string_view without_ends(std::string_view text) {
    constexpr std::string_view blanks = " \t\r\n";
    const std::size_t first = text.find_first_not_of(blanks);
    if (first == std::string_view::npos) return {};
    return text.substr(first, text.find_last_not_of(blanks) - first + 1);
  }

  std::string name_;
  std::string text_ = "\n";
};

struct EurocCamera {
  cairn::PinholeCamera camera;
  cairn::SE3 T_body_camera;
};

EurocCamera read_camera(const Path& file) {
  const SensorFile sensor(file);
  if (const std::string model = sensor.word("camera_model"); model != "pinhole")
    sensor.refuse("the camera model pinhole, found '" + model + "'");
  if (const std::string model = sensor.word("distortion_model"); model != "radial-tangential")
    sensor.refuse("the distortion model radial-tangential, found '" + model + "'");
  const std::vector<double> k = sensor.list("intrinsics", 4, 4);
  std::vector<double> d = sensor.list("distortion_coefficients", 4, 5);
  d.resize(5, 0.0);
  const std::vector<double> size = sensor.list("resolution", 2, 2);
  const std::vector<double> pose = sensor.list("T_BS", 16, 16);
  cairn::Matrix<4> T;
  for (int i = 0; i < 16; ++i) T(i / 4, i % 4) = pose[static_cast<std::size_t>(i)];
  const cairn::PinholeParameters p = pinhole({k[0], k[1], k[2], k[3]}, d, size, file);
  try {
    return {cairn::PinholeCamera(p), cairn::SE3::from_matrix(T)};
  } catch (const cairn::Error& error) {
    cairn::raise(file.string() + ": " + error.what());
  }
}

// data.csv: nanoseconds, file name; lines in any order, since images are paired by their times.
std::map<Nanoseconds, Path> read_images(const Path& folder) {
  const Path file = folder / "data.csv";
  cairn::TextLines lines(file, "the list of images of a EuRoC camera");
  std::map<Nanoseconds, Path> images;
  while (lines.next()) {
    const std::size_t comma = lines.line().find(',');
    const std::optional<Nanoseconds> time =
        cairn::parse_number<Nanoseconds>(cairn::trimmed(lines.line().substr(0, comma)));
    if (!time || comma == std::string_view::npos) lines.fail("nanoseconds,file name");
    const std::string name(cairn::trimmed(lines.line().substr(comma + 1)));
    if (name.empty()) lines.fail("nanoseconds,file name");
    if (!images.emplace(*time, folder / "data" / name).second) lines.fail("one image a time");
  }
  if (images.empty()) lines.fail("at least one line nanoseconds,file name");
  return images;
}

// Between the two poses around `time`, along the motion that leads from one to the other; nothing where they
// are more than 50 ms apart.
std::optional<cairn::SE3> pose_at(const cairn::Trajectory& poses, double time) {
  constexpr double widest_gap = 0.05;
  const auto after = std::lower_bound(poses.begin(), poses.end(), time,
                                      [](const cairn::StampedPose& p, double t) { return p.time < t; });
  if (after == poses.end()) return std::nullopt;
  if (after->time == time) return after->T_world_body;
  if (after == poses.begin() || after->time - (after - 1)->time > widest_gap) return std::nullopt;
  const cairn::StampedPose& before = *(after - 1);
  const double part = (time - before.time) / (after->time - before.time);
  const cairn::Vector<6> step = part * cairn::local(before.T_world_body, after->T_world_body);
  return cairn::retract(before.T_world_body, step);
}

void pair_up(const std::map<Nanoseconds, Path>& left, const std::map<Nanoseconds, Path>& right,
             Recording& recording) {
  std::size_t index = 0, left_alone = 0;
  for (const auto& entry : left) {
    const auto partner = right.find(entry.first);
    if (partner != right.end())
      recording.frames.push_back(
          {index, static_cast<double>(entry.first) / 1e9, entry.second, partner->second, std::nullopt});
    else
      ++left_alone;
    ++index;
  }
  const std::size_t right_alone = right.size() - recording.frames.size();
  if (left_alone + right_alone > 0)
    recording.notes.push_back(
        "left out, images without a partner of the same time: " + std::to_string(left_alone) + " left, " +
        std::to_string(right_alone) + " right");
}

}  // namespace

Recording read_euroc(const Path& folder) {
  require_folder(folder, "a EuRoC sequence (mav0/cam0, mav0/cam1)");
  const Path mav = folder.filename() == "mav0" ? folder : folder / "mav0";
  require_folder(mav, "a EuRoC sequence (mav0/cam0, mav0/cam1)");
  const EurocCamera left = read_camera(mav / "cam0" / "sensor.yaml");
  const EurocCamera right = read_camera(mav / "cam1" / "sensor.yaml");
  Recording recording;
  recording.name = "euroc " + folder.filename().string();
  recording.rig = {left.camera, right.camera, left.T_body_camera.inverse() * right.T_body_camera};
  pair_up(read_images(mav / "cam0"), read_images(mav / "cam1"), recording);
  if (recording.frames.empty())
    cairn::raise(mav.string() + ": no image of cam0 has the time of one of cam1; expected equal times");
  const Path truth = mav / "state_groundtruth_estimate0" / "data.csv";
  std::error_code failure;
  if (std::filesystem::exists(truth, failure)) {
    const cairn::Trajectory poses = cairn::moved_frame(cairn::read_euroc(truth), left.T_body_camera);
    for (RecordedFrame& frame : recording.frames) frame.truth = pose_at(poses, frame.time);
  }
  return recording;
}

}  // namespace stereo_slam
