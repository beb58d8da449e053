// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>

#include "landmark_log.hpp"

namespace fastslam {

namespace {

/// The columns of numbers of a MATLAB file of level 5 without compression, as MATLAB 5 wrote them: elements
/// of a type, a size and so many bytes, rounded up to eight; an array is an element of elements, for its
/// flags, dimensions, name and numbers (MathWorks, "MAT-file format", ch. 1).
class MatlabFile {
public:
  explicit MatlabFile(const std::filesystem::path& path)
      : name_(path.string()), bytes_(cairn::read_file(path, "a MATLAB file")) {
    if (bytes_.size() < header || bytes_.substr(124, 4) != std::string_view("\0\1IM", 4))
      fail("a MATLAB file of level 5, little-endian");
    for (std::size_t at = header; at < bytes_.size();) {
      const Element array = element(at, bytes_.size());
      if (array.type != array_type) fail("arrays and nothing else, none of them compressed");
      std::size_t part = array.begin;
      const std::size_t end = array.begin + array.size;
      element(part, end);  // flags
      element(part, end);  // dimensions
      const Element name = element(part, end);
      columns_[bytes_.substr(name.begin, name.size)] = numbers(element(part, end));
    }
  }

  [[nodiscard]] const std::vector<double>& column(const std::string& name) const {
    const auto found = columns_.find(name);
    if (found == columns_.end()) fail("an array " + name);
    return found->second;
  }
  [[noreturn]] void fail(const std::string& expected) const {
    cairn::raise(name_ + ": expected " + expected);
  }

private:
  static constexpr std::size_t header = 128;
  static constexpr std::uint32_t array_type = 14;
  struct Element {
    std::uint32_t type = 0;
    std::size_t begin = 0, size = 0;
  };

  [[nodiscard]] std::uint32_t word(std::size_t at) const {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes_.data() + at, sizeof value);
    return value;
  }
  /// The element at a place, which moves on behind it.
  Element element(std::size_t& at, std::size_t end) const {
    if (at + 8 > end) fail("elements that end where their array does");
    const std::uint32_t type = word(at);
    Element found{type & 0xffffU, at + 4, type >> 16U};  // up to four bytes, in the second word
    if (found.size == 0) {
      found = {type, at + 8, word(at + 4)};
      if (found.size > end - found.begin) fail("elements that end where their array does");
      at = std::min(end, found.begin + (found.size + 7) / 8 * 8);
    } else {
      if (found.size > 4) fail("small elements of up to four bytes");
      at += 8;
    }
    return found;
  }
  template <class T>
  void append(std::vector<double>& all, const Element& e) const {
    if (e.size % sizeof(T) != 0) fail("whole numbers of bytes");
    for (std::size_t at = e.begin; at < e.begin + e.size; at += sizeof(T)) {
      T value;
      std::memcpy(&value, bytes_.data() + at, sizeof value);
      all.push_back(static_cast<double>(value));
      if (!std::isfinite(all.back())) fail("finite numbers");
    }
  }
  [[nodiscard]] std::vector<double> numbers(const Element& e) const {
    std::vector<double> all;
    switch (e.type) {
      case 2:
        append<std::uint8_t>(all, e);
        break;
      case 4:
        append<std::uint16_t>(all, e);
        break;
      case 5:
        append<std::int32_t>(all, e);
        break;
      case 6:
        append<std::uint32_t>(all, e);
        break;
      case 7:
        append<float>(all, e);
        break;
      case 9:
        append<double>(all, e);
        break;
      default:
        fail("numbers of a type that MATLAB 5 wrote");
    }
    return all;
  }

  std::string name_, bytes_;
  std::map<std::string, std::vector<double>> columns_;
};

/// Metres that the wheels have turned until each of the times, as a share of all.
std::vector<double> shares_of_way(const MatlabFile& wheels, const std::vector<double>& times) {
  const auto &time = wheels.column("time"), &speed = wheels.column("speed");
  if (time.empty() || time.size() != speed.size()) wheels.fail("as many speeds as times, and at least one");
  if (!std::ranges::is_sorted(time)) wheels.fail("times that do not fall");
  std::vector<double> way{0};
  for (std::size_t i = 1; i < time.size(); ++i)
    way.push_back(way.back() + std::abs(speed[i - 1]) * (time[i] - time[i - 1]));
  if (!(way.back() > 0 && std::isfinite(way.back()))) wheels.fail("wheels that turn");
  std::vector<double> shares;
  for (const double t : times) {
    const auto after = static_cast<std::size_t>(std::ranges::upper_bound(time, t) - time.begin());
    if (after == 0 || after == time.size()) {
      shares.push_back(after == 0 ? 0 : 1);
      continue;
    }
    const double part = (t - time[after - 1]) / (time[after] - time[after - 1]);
    shares.push_back((way[after - 1] + part * (way[after] - way[after - 1])) / way.back());
  }
  return shares;
}

}  // namespace

void read_gps(LandmarkLog& log, const std::filesystem::path& fixes, const std::filesystem::path& wheels) {
  const MatlabFile file(fixes);
  const auto &time = file.column("timeGps"), &east = file.column("Lo_m"), &north = file.column("La_m");
  if (time.size() != east.size() || time.size() != north.size()) file.fail("as many places as times");
  const std::vector<double> shares = shares_of_way(MatlabFile(wheels), time);
  // The graph has no times: the same share of the way is the same moment.
  std::vector<double> way, moment;
  cairn::SE2 last;
  std::size_t next = 0;
  const auto gone = [&](double t, const cairn::SE2& step) {
    way.push_back((way.empty() ? 0 : way.back()) + step.translation().norm());
    moment.push_back(t);
  };
  for (std::size_t k = 0; k < log.frames.size(); ++k) {
    gone(log.frames[k].time, last.inverse() * log.frames[k].moved.mean);
    last = {};
    for (; next < log.between.size() && log.between[next].frame == k; ++next) {
      gone(log.between[next].time, last.inverse() * log.between[next].moved);
      last = log.between[next].moved;
    }
  }
  if (way.empty()) return;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double gone_then = shares[i] * way.back();
    auto at = static_cast<std::size_t>(std::ranges::lower_bound(way, gone_then) - way.begin());
    at = std::min(at, way.size() - 1);
    if (at > 0 && gone_then - way[at - 1] < way[at] - gone_then) --at;
    log.gps.push_back({moment[at], {east[i], north[i]}});
  }
}

}  // namespace fastslam
