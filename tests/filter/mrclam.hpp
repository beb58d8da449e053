// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Robots in a hall (K. Leung et al., "The UTIAS multi-robot cooperative localization and mapping dataset",
/// IJRR 30, 2011): odometry, ranges and bearings to landmarks known to the centimetre, truth by Vicon.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/se2.hpp>

namespace cairn_test {

/// The first 400 s of one robot.
class MrclamRun {
public:
  static constexpr double begin = 1248446192.0;
  static constexpr double seconds = 400.0;

  MrclamRun(const std::filesystem::path& folder, int robot) {
    const std::string name = "Robot" + std::to_string(robot);
    truth_ = read_rows(folder / (name + "_Groundtruth.dat"), begin + seconds + 1);
    odometry = read_rows(folder / (name + "_Odometry.dat"), begin + seconds);
    sightings = read_rows(folder / (name + "_Measurement.dat"), begin + seconds);
    for (const auto& row : read_rows(folder / "Barcodes.dat", 1e9))
      subject_of[static_cast<int>(row[1])] = static_cast<int>(row[0]);
    for (const auto& row : read_rows(folder / "Landmark_Groundtruth.dat", 1e9))
      landmarks[static_cast<int>(row[0])] = cairn::Vector<2>(row[1], row[2]);
  }

  /// The last true pose until then; times do not fall from call to call.
  [[nodiscard]] cairn::SE2 truth_at(double time) {
    while (now_ + 1 < truth_.size() && truth_[now_ + 1][0] <= time) ++now_;
    return {truth_[now_][1], truth_[now_][2], truth_[now_][3]};
  }

  std::vector<std::vector<double>> odometry;   ///< time, speed, turn rate
  std::vector<std::vector<double>> sightings;  ///< time, barcode, range, bearing
  std::map<int, int> subject_of;               ///< barcode -> subject
  std::map<int, cairn::Vector<2>> landmarks;   ///< subject -> where it is

private:
  // Rows of numbers until the first one later than `end`.
  static std::vector<std::vector<double>> read_rows(const std::filesystem::path& path, double end) {
    std::ifstream file(path);
    std::vector<std::vector<double>> rows;
    for (std::string line; std::getline(file, line);) {
      if (line.empty() || line[0] == '#') continue;
      std::istringstream words(line);
      std::vector<double> row;
      for (double value = 0; words >> value;) row.push_back(value);
      if (row.size() < 2) continue;
      if (row[0] > end) break;
      rows.push_back(row);
    }
    return rows;
  }

  std::vector<std::vector<double>> truth_;
  std::size_t now_ = 0;
};

}  // namespace cairn_test
