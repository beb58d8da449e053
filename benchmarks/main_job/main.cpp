// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The main job's figures: runs the stereo_slam program as a user would and reads what it writes.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "support/scoreboard.hpp"

namespace {

namespace fs = std::filesystem;
using cairn_bench::Row;
using cairn_bench::Scoreboard;
using nlohmann::json;

/// Folder of the runs, removed at the end.
class Workspace {
public:
  Workspace() : folder_(fs::temp_directory_path() / "cairn_scoreboard_main_job") { fs::remove_all(folder_); }
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;
  ~Workspace() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  [[nodiscard]] fs::path operator/(const std::string& name) const { return folder_ / name; }

private:
  fs::path folder_;
};

json read(const fs::path& path) {
  std::ifstream file(path);
  return json::parse(file);
}

/// The summary of a run, or nothing where the program failed (it has said why).
std::optional<json> run(const std::string& options, const fs::path& out) {
  const std::string command = std::string("\"") + STEREO_SLAM_PROGRAM + "\" " + options + " --out \"" +
                              out.string() + "\" >/dev/null";
  std::cout << "running stereo_slam " << options << std::endl;
  if (std::system(command.c_str()) != 0) return std::nullopt;  // NOLINT(cert-env33-c): our own program
  return read(out / "summary.json");
}

std::optional<double> number(const std::optional<json>& summary, const std::string& key) {
  if (!summary || !summary->contains(key) || (*summary)[key].is_null()) return std::nullopt;
  return (*summary)[key].get<double>();
}

/// One figure of a summary as a row; a run that failed is a row without a measurement.
Row row(const std::string& name, std::optional<double> measured, const std::string& unit, double must,
        std::optional<double> aim) {
  Row result{.name = name, .measured = measured, .unit = unit, .must = must, .aim = aim};
  if (!measured) result.note = "the run failed";
  return result;
}

void add_arena_rows(Scoreboard& board, const Workspace& workspace) {
  const auto turn = run("--script turn", workspace / "turn");
  board.add(row("arena turn: largest heading error", number(turn, "max_heading_error_deg"), "deg", 2, 0.3));
  board.add(row("arena turn: largest position error", number(turn, "max_position_error_m"), "m", 0.10, 0.02));
  const auto loop = run("--script loop", workspace / "loop");
  const auto largest = number(loop, "max_position_error_m");
  board.add(row("arena loop: largest position error", largest, "m", 0.15, 0.03));
  board.add(row("arena loop: largest heading error", number(loop, "max_heading_error_deg"), "deg", 3, 0.5));
  const auto revisit = number(loop, "revisit_position_m");
  Row second =
      row("arena loop: second lap from first, beyond the first's error",
          revisit && largest ? std::optional(*revisit - *largest) : std::nullopt, "m", 0.02, std::nullopt);
  if (revisit) second.note = "differs by " + std::to_string(*revisit) + " m";
  board.add(second);
}

void add_drive_rows(Scoreboard& board, const Workspace& workspace, const std::string& name,
                    const std::string& kind, double must, double aim) {
  const char* data = std::getenv("CAIRN_DATA");
  const fs::path folder = fs::path(data != nullptr ? data : "../shared/data") / name;
  Row end{.name = name + ": error at the end over the path", .unit = "%", .must = must, .aim = aim};
  Row lost{.name = name + ": frames lost", .unit = "", .must = 0};
  if (!fs::exists(folder)) {
    end.note = lost.note = "no data";
  } else {
    const auto summary = run("--dataset " + kind + " \"" + folder.string() + "\"", workspace / name);
    const auto error = number(summary, "end_error_m");
    const auto path = number(summary, "path_m");
    if (error && path) end.measured = 100 * *error / *path;
    lost.measured = number(summary, "frames_lost");
    if (!summary) end.note = lost.note = "the run failed";
  }
  board.add(end);
  board.add(lost);
}

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The pictures are in the cache by now, so that the rate is that of the system and not of the renderer.
void add_rate_rows(Scoreboard& board, const Workspace& workspace) {
  const std::string options = "--script loop --frames 150 --points 2000";
  const auto two = run(options + " --threads 2", workspace / "two");
  std::optional<json> times;
  if (two) times = read(workspace / "two" / "timing.json");
  Row rate = row("rate, arena, 2000 points an image, 2 threads", number(times, "hz"), "Hz", 5, 25);
  rate.better = cairn_bench::larger;
  board.add(rate);
  const auto one = run(options + " --threads 1", workspace / "one");
  Row same{.name = "results of 1 and of 2 threads but timing.json: files that differ", .unit = "", .must = 0};
  if (one && two) {
    int differing = 0;
    for (const fs::directory_entry& entry : fs::directory_iterator(workspace / "one")) {
      const fs::path name = entry.path().filename();
      if (name != "timing.json" && bytes_of(entry.path()) != bytes_of(workspace / "two" / name.string()))
        ++differing;
    }
    same.measured = differing;
  } else {
    same.note = "the run failed";
  }
  board.add(same);
}

}  // namespace

int main(int argc, char** argv) {
  if (const auto code = cairn_bench::answer(argc, argv, "scoreboard_main_job")) return *code;
  Scoreboard board("main_job");
  const Workspace workspace;
  add_arena_rows(board, workspace);
  add_drive_rows(board, workspace, "kitti_odometry_a", "kitti_odometry", 1.5, 0.5);
  add_drive_rows(board, workspace, "kitti_raw_0926", "kitti_raw", 2.0, 0.35);
  add_rate_rows(board, workspace);
  return board.finish();
}
