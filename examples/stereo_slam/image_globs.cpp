// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <glob.h>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>

#include "recording.hpp"

namespace stereo_slam {
namespace {

using Path = std::filesystem::path;

constexpr double assumed_rate = 10;  ///< [Hz], of frames without a clock; only the axis of plots shows it

bool is_digit(char letter) {
  return letter >= '0' && letter <= '9';
}

/// Names as people count: frame2 before frame10.
bool comes_before(const std::string& a, const std::string& b) {
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!is_digit(a[i]) || !is_digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
      continue;
    }
    const auto run = [](const std::string& text, std::size_t& at) {
      std::size_t end = at;
      while (end < text.size() && is_digit(text[end])) ++end;
      std::string_view digits = std::string_view(text).substr(at, end - at);
      while (digits.size() > 1 && digits.front() == '0') digits.remove_prefix(1);
      at = end;
      return digits;
    };
    const std::string_view m = run(a, i), n = run(b, j);
    if (m.size() != n.size()) return m.size() < n.size();
    if (m != n) return m < n;
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;  // 01 and 1 are different names all the same
}

struct Glob {
  ::glob_t found{};
  Glob() = default;
  Glob(const Glob&) = delete;
  Glob& operator=(const Glob&) = delete;
  ~Glob() { ::globfree(&found); }
};

std::vector<Path> files_of(const std::string& pattern, const std::string& option) {
  Glob glob;
  const int code = ::glob(pattern.c_str(), GLOB_TILDE, nullptr, &glob.found);
  if (code == GLOB_NOSPACE || code == GLOB_ABORTED)
    cairn::raise(option + " '" + pattern + "': the folder cannot be read");
  std::vector<Path> files;
  for (std::size_t i = 0; i < glob.found.gl_pathc; ++i)
    if (is_file(glob.found.gl_pathv[i])) files.emplace_back(glob.found.gl_pathv[i]);
  if (files.empty())
    cairn::raise(option + " '" + pattern +
                 "': no file has such a name; expected images, as in 'drive/left/*.png' (in quotes)");
  std::ranges::sort(files, [](const Path& a, const Path& b) { return comes_before(a.string(), b.string()); });
  return files;
}

/// What a name says of its frame: the last number of the stem ("left_0012" is 12, "1403636579.76" a time).
struct Stamp {
  std::string digits;          ///< before the point, without leading zeros
  std::optional<double> time;  ///< [s], where it looks like a clock
};

std::optional<Stamp> stamp_of(const Path& file) {
  const std::string name = file.stem().string();
  std::size_t end = name.size();
  while (end > 0 && !is_digit(name[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && is_digit(name[begin - 1])) --begin;
  if (begin == end) return std::nullopt;
  Stamp stamp;
  stamp.digits = name.substr(begin, end - begin);
  if (begin >= 2 && name[begin - 1] == '.' && is_digit(name[begin - 2])) {  // seconds.fraction
    std::size_t whole = begin - 1;
    while (whole > 0 && is_digit(name[whole - 1])) --whole;
    stamp.digits = name.substr(whole, end - whole);
    stamp.time = cairn::parse_number(stamp.digits);
    return stamp;
  }
  stamp.digits.erase(0, std::min(stamp.digits.find_first_not_of('0'), stamp.digits.size() - 1));
  // Since 1970, in nano-, micro- or milliseconds: the years 2001 to 2286.
  const std::map<std::size_t, double> units{{19, 1e-9}, {16, 1e-6}, {13, 1e-3}};
  if (const auto unit = units.find(stamp.digits.size()); unit != units.end())
    if (const auto number = cairn::parse_number<std::uint64_t>(stamp.digits))
      stamp.time = static_cast<double>(*number) * unit->second;
  return stamp;
}

/// The files by the number in their names, where each has one of its own.
std::optional<std::map<std::string, std::size_t>> numbered(const std::vector<Path>& files) {
  std::map<std::string, std::size_t> result;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto stamp = stamp_of(files[i]);
    if (!stamp || !result.emplace(stamp->digits, i).second) return std::nullopt;
  }
  return result;
}

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

/// By the numbers in the names where they have numbers in common, otherwise in order.
Pairs paired(const std::vector<Path>& left, const std::vector<Path>& right, std::vector<std::string>& notes) {
  Pairs pairs;
  const auto a = numbered(left), b = numbered(right);
  if (a && b) {
    for (std::size_t i = 0; i < left.size(); ++i)
      if (const auto partner = b->find(stamp_of(left[i])->digits); partner != b->end())
        pairs.emplace_back(i, partner->second);
    if (!pairs.empty()) {
      if (pairs.size() < left.size() || pairs.size() < right.size())
        notes.push_back("left out, images without a partner of the same number: " +
                        std::to_string(left.size() - pairs.size()) + " left, " +
                        std::to_string(right.size() - pairs.size()) + " right");
      return pairs;
    }
  }
  if (left.size() != right.size())
    cairn::raise(std::to_string(left.size()) + " left images and " + std::to_string(right.size()) +
                 " right ones, and no numbers in their names that pair them; expected as many");
  for (std::size_t i = 0; i < left.size(); ++i) pairs.emplace_back(i, i);
  notes.push_back("the names of left and right images have no numbers in common: paired in order, " +
                  left.front().filename().string() + " with " + right.front().filename().string());
  return pairs;
}

}  // namespace

Recording read_images(const ImageGlobs& images) {
  Recording recording;
  const std::vector<Path> left = files_of(images.left, "--left"), right = files_of(images.right, "--right");
  const Pairs pairs = paired(left, right, recording.notes);
  bool clock = !images.rate;
  for (std::size_t i = 0; clock && i < pairs.size(); ++i) {
    const auto stamp = stamp_of(left[pairs[i].first]);
    clock = stamp && stamp->time;
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Path& file = left[pairs[i].first];
    if (file.lexically_normal() == right[pairs[i].second].lexically_normal())
      cairn::raise(file.string() +
                   ": expected another image of the right camera, --left and --right name the same");
    const double time =
        clock ? stamp_of(file)->time.value() : static_cast<double>(i) / images.rate.value_or(assumed_rate);
    recording.frames.push_back({i, time, file, right[pairs[i].second], std::nullopt});
  }
  if (clock)
    std::ranges::sort(recording.frames, {},
                      [](const RecordedFrame& frame) { return std::pair(frame.time, frame.index); });
  else if (!images.rate)
    recording.notes.push_back("the names of the images are no times: " + cairn::shortest(assumed_rate) +
                              " frames a second are assumed (--fps says otherwise)");
  recording.name = "images " + left.front().parent_path().lexically_normal().string();
  return recording;
}

}  // namespace stereo_slam
