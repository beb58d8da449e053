// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "receiver_heights.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <fstream>
#include <map>
#include <system_error>

#include <cairn/io/text.hpp>

namespace stereo_slam_bench {

ReceiverHeights::ReceiverHeights(const std::filesystem::path& drive) {
  std::error_code none;
  std::map<long, std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(drive / "oxts" / "data", none))
    if (const auto number = cairn::parse_number<long>(entry.path().stem().string()))
      files.emplace(*number, entry.path());
  constexpr std::size_t altitude = 2, upward_velocity = 10;  // of the 30 numbers of a file
  std::array<double, 30> numbers{};
  double first = 0, height = 0, velocity = 0;
  for (const auto& [hundredths, path] : files) {
    std::ifstream file(path);
    for (double& number : numbers) file >> number;
    if (!file) {
      seconds_.clear();
      return;
    }
    const double now = static_cast<double>(hundredths) / 100;
    if (seconds_.empty())
      first = numbers[altitude];
    else
      height += (now - seconds_.back()) * (velocity + numbers[upward_velocity]) / 2;
    velocity = numbers[upward_velocity];
    seconds_.push_back(now);
    slips_.push_back(numbers[altitude] - first - height);
  }
}

double ReceiverHeights::slip(double seconds) const {
  const auto next = std::ranges::upper_bound(seconds_, seconds);
  if (next == seconds_.begin()) return slips_.front();
  if (next == seconds_.end()) return slips_.back();
  const auto i = static_cast<std::size_t>(next - seconds_.begin());
  const double share = (seconds - seconds_[i - 1]) / (seconds_[i] - seconds_[i - 1]);
  return slips_[i - 1] + share * (slips_[i] - slips_[i - 1]);
}

}  // namespace stereo_slam_bench
