// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "recording.hpp"

#include <algorithm>
#include <cmath>
#include <system_error>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>

#include "support/image_io.hpp"

namespace stereo_slam {
namespace {

std::string size_text(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height) + " pixels";
}

cairn::PinholeCamera with_size(const cairn::PinholeCamera& camera, const cairn::Image& image) {
  cairn::PinholeParameters parameters = camera.parameters();
  parameters.width = image.width();
  parameters.height = image.height();
  return cairn::PinholeCamera(parameters);
}

class Played final : public Dataset {
public:
  explicit Played(Recording recording) : recording_(std::move(recording)) {
    cairn::StereoRig& rig = recording_.rig;
    const RecordedFrame& first = recording_.frames.front();
    if (rig.left.width() == 0) rig.left = with_size(rig.left, example::read_image(first.left));
    if (rig.right.width() > 0) return;
    const cairn::Image right = example::read_image(first.right);
    if (right.width() != rig.left.width() || right.height() != rig.left.height())
      cairn::raise(first.right.string() + ": the image has " + size_text(right.width(), right.height()) +
                   "; expected " + size_text(rig.left.width(), rig.left.height()) +
                   " as the left one, where the calibration says no size of its own");
    rig.right = with_size(rig.right, right);
  }

  [[nodiscard]] std::string name() const override { return recording_.name; }
  [[nodiscard]] std::size_t size() const override { return recording_.frames.size(); }
  [[nodiscard]] const cairn::StereoRig& rig() const override { return recording_.rig; }
  [[nodiscard]] std::vector<std::string> notes() const override { return recording_.notes; }

  [[nodiscard]] StereoFrame frame(std::size_t i) const override {
    CAIRN_EXPECTS(i < recording_.frames.size(), "a frame number is less than size()");
    const RecordedFrame& recorded = recording_.frames[i];
    StereoFrame frame;
    frame.index = recorded.index;
    frame.time = recorded.time;
    frame.left = read_sized(recorded.left, recording_.rig.left);
    frame.right = read_sized(recorded.right, recording_.rig.right);
    frame.truth = recorded.truth;
    frame.truth_world = recording_.name;
    frame.name = recorded.left.filename().string();
    return frame;
  }

private:
  static cairn::Image read_sized(const std::filesystem::path& file, const cairn::PinholeCamera& camera) {
    cairn::Image image = example::read_image(file);
    if (image.width() != camera.width() || image.height() != camera.height())
      cairn::raise(file.string() + ": the image has " + size_text(image.width(), image.height()) +
                   "; expected " + size_text(camera.width(), camera.height()) + " as the calibrated camera");
    return image;
  }

  Recording recording_;
};

void start_at_first_truth(Recording& recording) {
  std::vector<RecordedFrame>& frames = recording.frames;
  const auto first =
      std::find_if(frames.begin(), frames.end(), [](const RecordedFrame& f) { return f.truth.has_value(); });
  if (first == frames.end()) {
    recording.notes.push_back("no true poses: errors cannot be computed");
    return;
  }
  if (first == frames.begin()) return;
  std::vector<std::size_t> dropped;
  for (auto frame = frames.begin(); frame != first; ++frame) dropped.push_back(frame->index);
  recording.notes.push_back("left out, before the first true pose: " + frames_text(dropped));
  frames.erase(frames.begin(), first);
}

std::optional<std::vector<double>> numbers_of(std::string_view text) {
  std::vector<double> numbers;
  for (text = cairn::trimmed(text); !text.empty();) {
    const std::size_t end = std::min(text.find_first_of(" \t"), text.size());
    const std::optional<double> value = cairn::parse_number(text.substr(0, end));
    if (!value) return std::nullopt;
    numbers.push_back(*value);
    text = cairn::trimmed(text.substr(end));
  }
  return numbers;
}

}  // namespace

std::unique_ptr<Dataset> play(Recording recording, std::size_t frames) {
  start_at_first_truth(recording);
  if (frames > 0 && frames < recording.frames.size()) recording.frames.resize(frames);
  return std::make_unique<Played>(std::move(recording));
}

void require_folder(const std::filesystem::path& folder, const std::string& expected) {
  std::error_code failure;
  if (std::filesystem::is_directory(folder, failure)) return;
  const bool exists = std::filesystem::exists(folder, failure);
  cairn::raise(folder.string() + ": " + (exists ? "is no folder" : "no such folder") + "; expected " +
               expected);
}

bool is_file(const std::filesystem::path& path) {
  std::error_code failure;
  return std::filesystem::is_regular_file(path, failure);
}

std::vector<std::filesystem::path> image_files(const std::filesystem::path& folder,
                                               const std::string& expected) {
  require_folder(folder, expected);
  std::vector<std::filesystem::path> files;
  std::error_code failure;
  for (std::filesystem::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const std::string extension = entry->path().extension().string();
    if (extension == ".png" || extension == ".pgm") files.push_back(entry->path());
  }
  if (failure) cairn::raise(folder.string() + ": cannot be listed (" + failure.message() + ")");
  if (files.empty()) cairn::raise(folder.string() + ": holds no .png or .pgm file; expected " + expected);
  std::sort(files.begin(), files.end());
  return files;
}

cairn::PinholeParameters pinhole(const std::array<double, 4>& lens, const std::vector<double>& distortion,
                                 const std::vector<double>& size, const std::filesystem::path& file) {
  const auto side = [&](double value) {
    constexpr double longest = 65536;
    if (!(value >= 1 && value <= longest))
      cairn::raise(file.string() + ": expected an image size of 1 to 65536 pixels a side, found " +
                   cairn::shortest(value));
    return static_cast<int>(std::lround(value));
  };
  return {.fx = lens[0],
          .fy = lens[1],
          .cx = lens[2],
          .cy = lens[3],
          .k1 = distortion[0],
          .k2 = distortion[1],
          .p1 = distortion[2],
          .p2 = distortion[3],
          .k3 = distortion[4],
          .width = side(size[0]),
          .height = side(size[1])};
}

std::optional<std::size_t> number_of(const std::filesystem::path& file) {
  return cairn::parse_number<std::size_t>(file.stem().string());
}

std::string frames_text(const std::vector<std::size_t>& sorted) {
  std::string text = sorted.size() == 1 ? "frame" : "frames";
  for (std::size_t i = 0; i < sorted.size();) {
    std::size_t last = i;
    while (last + 1 < sorted.size() && sorted[last + 1] == sorted[last] + 1) ++last;
    text += i == 0 ? " " : ", ";
    text += std::to_string(sorted[i]);
    if (last > i) text.append("-").append(std::to_string(sorted[last]));
    i = last + 1;
  }
  return text;
}

KeyedNumbers::KeyedNumbers(const std::filesystem::path& file) : file_(file.string()) {
  cairn::TextLines lines(file, "a KITTI calibration");
  while (lines.next()) {
    const std::size_t colon = lines.line().find(':');
    if (colon == std::string_view::npos) continue;
    std::optional<std::vector<double>> numbers = numbers_of(lines.line().substr(colon + 1));
    const std::string key(cairn::trimmed(lines.line().substr(0, colon)));
    if (numbers && !values_.emplace(key, std::move(*numbers)).second)
      lines.fail("one line '" + key + ":', not a second");
  }
}

const std::vector<double>& KeyedNumbers::at(const std::string& key, std::size_t count) const {
  const auto refuse = [&](const std::string& found) {
    cairn::raise(file_ + ": " + found + "; expected '" + key + ":' with " + std::to_string(count) +
                 " finite numbers");
  };
  const auto entry = values_.find(key);
  if (entry == values_.end()) refuse("lacks the key " + key);
  if (entry->second.size() != count)
    refuse("the key " + key + " has " + std::to_string(entry->second.size()) + " numbers");
  for (const double value : entry->second)
    if (!std::isfinite(value)) refuse("the key " + key + " has a number that is not finite");
  return entry->second;
}

}  // namespace stereo_slam
