// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What the house costs who moves in: seconds to compile the programs of a README, with the headers alone and
// with cairn::compiled; lines, names that an editor finds, rooms that are reached from outside. What the
// filters owe stands here too, as their own scoreboard last measured it.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include "support/scoreboard.hpp"

namespace {

namespace fs = std::filesystem;
using cairn_bench::Row;

const fs::path root = CAIRN_HOUSE_ROOT;

// User seconds of all programs started and ended so far.
double children_seconds() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

bool run(const std::string& command) {
  return std::system(command.c_str()) == 0;
}

std::string compile(const std::string& name, const std::string& options) {
  return CAIRN_HOUSE_COMPILER " -std=c++20 -O2 -DNDEBUG " + options + " -I'" + (root / "include").string() +
         "' " CAIRN_HOUSE_EIGEN " -c -o /dev/null '" +
         (root / "benchmarks/house/programs" / (name + ".cpp")).string() + "'";
}

struct Door {
  std::string program, what;
  double must, aim;
  std::string options{};
  std::vector<double> seconds{};
};

// Medians of interleaved rounds; others may be using the machine.
void add_compile_times(cairn_bench::Scoreboard& board) {
  std::array<Door, 10> doors{{{"eigen_core", "Eigen/Core alone", 0, 0},
                              {"kd_tree", "kd_tree: nearest, k, radius", 2.0, 1.2},
                              {"multi_kd_tree", "multi_kd_tree: insert, k, radius", 4.0, 2.5},
                              {"kalman", "kalman, constant velocity 4/2", 1.8, 1.5},
                              {"kalman_run_time_size", "kalman, run-time size", 3.5, 2.5},
                              {"unscented", "unscented 4/2", 1.9, 1.6},
                              {"stereo_pose", "stereo_pose", 4.0, 3.0},
                              {"kd_tree", "kd_tree, cairn::compiled", 0, 0, "-DCAIRN_COMPILED=0"},
                              {"multi_kd_tree", "multi_kd_tree, cairn::compiled", 0, 0, "-DCAIRN_COMPILED=0"},
                              {"stereo_pose", "stereo_pose, cairn::compiled", 0, 0, "-DCAIRN_COMPILED=0"}}};
  constexpr int rounds = 3;
  for (int round = 0; round < rounds; ++round)
    for (Door& door : doors) {
      const double begin = children_seconds();
      if (run(compile(door.program, door.options))) door.seconds.push_back(children_seconds() - begin);
    }
  const auto median = [](std::vector<double> values) {
    std::ranges::sort(values);
    return values[values.size() / 2];
  };
  for (const Door& door : doors) {
    Row row{.name = "compile " + door.what, .unit = "s"};
    if (door.must > 0) row.must = door.must, row.aim = door.aim;
    if (door.seconds.size() == rounds && doors[0].seconds.size() == rounds) {
      row.measured = median(door.seconds);
      row.note =
          std::to_string(*row.measured / median(doors[0].seconds)).substr(0, 5) + " x Eigen/Core alone";
    } else {
      row.note = "does not compile";
    }
    board.add(row);
  }
}

std::vector<fs::path> headers() {
  std::vector<fs::path> found;
  for (const auto& entry : fs::recursive_directory_iterator(root / "include"))
    if (entry.path().extension() == ".hpp") found.push_back(entry.path());
  std::ranges::sort(found);
  return found;
}

// The folder of include/cairn that a header, or what stands in an #include line, belongs to.
std::string folder_of(std::string_view header) {
  header.remove_prefix(header.find("cairn/") + 6);
  return std::string(header.substr(0, header.find('/')));
}

void add_counts(cairn_bench::Scoreboard& board) {
  double lines = 0, strangers = 0;
  for (const fs::path& header : headers()) {
    std::ifstream file(header);
    bool reaches = false;
    for (std::string line; std::getline(file, line); ++lines) {
      const std::size_t at = line.find("#include <cairn/");
      if (at == std::string::npos || line.find("/detail/") == std::string::npos) continue;
      const std::string inside = fs::relative(header, root / "include").generic_string();
      reaches = reaches || folder_of(line.substr(at)) != folder_of(inside);
    }
    strangers += reaches ? 1 : 0;
  }
  board.add({.name = "lines of include/", .measured = lines, .must = 21000, .aim = 20000});
  board.add({.name = "headers that reach into another folder's detail/", .measured = strangers, .must = 0});

  Row names{.name = "names that ctags finds in include/", .must = 3900, .better = cairn_bench::larger};
  const std::string list = (fs::temp_directory_path() / "cairn_house_tags").string();
  if (run("ctags --version >/dev/null 2>&1") &&
      run("cd '" + root.string() + "' && ctags -R --languages=C++ --langmap=C++:.hpp -f '" + list +
          "' include")) {
    std::ifstream file(list);
    double count = 0;
    for (std::string line; std::getline(file, line);) count += line.starts_with("!_") ? 0 : 1;
    names.measured = count;
  } else {
    names.note = "no ctags";
  }
  std::error_code ignored;
  fs::remove(list, ignored);
  board.add(names);
}

// .ci/run leaves the seconds that it took.
void add_gate(cairn_bench::Scoreboard& board) {
  Row row{.name = ".ci/run", .unit = "min", .must = 12, .aim = 9};
  double seconds = 0;
  if (std::ifstream(root / "build/ci/seconds") >> seconds) {
    row.measured = seconds / 60;
    row.note = "the last time it ran here; cold without a compiler cache";
  } else {
    row.note = "not run here";
  }
  board.add(row);
}

// The rows of the filters' own board that carry a figure, as it last wrote them.
void add_filter_rows(cairn_bench::Scoreboard& board) {
  const char* const folder = std::getenv("CAIRN_SCOREBOARD_DIR");
  const fs::path path = (folder != nullptr ? fs::path(folder) : root / "build/scoreboard") / "filter.json";
  std::ifstream file(path);
  const auto table = nlohmann::json::parse(file, nullptr, false);
  if (table.is_discarded()) {
    board.add({.name = "filters", .note = "not run here: scripts/scoreboard filter"});
    return;
  }
  for (const auto& entry : table.at("rows")) {
    if (entry.at("must").is_null()) continue;
    const auto number = [&](const char* key) {
      return entry.at(key).is_null() ? std::optional<double>{} : entry.at(key).get<double>();
    };
    const std::string unit = entry.at("unit");
    board.add({.name = entry.at("name"),
               .measured = number("measured"),
               .unit = unit,
               .must = number("must"),
               .aim = number("aim"),
               .better = unit == "x" ? cairn_bench::larger : cairn_bench::smaller,
               .note = entry.at("note").get<std::string>() + "; scripts/scoreboard filter, the last time"});
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (const auto code = cairn_bench::answer(argc, argv, "scoreboard_house")) return *code;
  cairn_bench::Scoreboard board("house");
  add_compile_times(board);
  add_counts(board);
  add_gate(board);
  add_filter_rows(board);
  return board.finish();
}
