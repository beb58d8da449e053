// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/scoreboard.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <system_error>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/version.hpp>

#include "../examples/support/standard_output.hpp"

#ifndef CAIRN_BENCH_FLAGS
#define CAIRN_BENCH_FLAGS "unknown"
#endif

namespace cairn_bench {
namespace {

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g", value);
  return text.data();
}

std::string number(const std::optional<double>& value, const std::string& unit) {
  if (!value) return "-";
  return unit.empty() ? number(*value) : number(*value) + " " + unit;
}

bool reaches(const Row& row, double figure) {
  return row.better == smaller ? *row.measured <= figure : *row.measured >= figure;
}

bool starts_with_reason(const std::string& note) {
  return note.starts_with("no data") || note.starts_with("no rival");
}

using Cells = std::array<std::string, 7>;

Cells cells(const Row& row) {
  std::string rival = row.rival_name;
  if (row.rival) rival = number(*row.rival) + (rival.empty() ? "" : " (" + rival + ")");
  return {row.name,
          number(row.measured, row.unit),
          rival.empty() ? "-" : rival,
          number(row.must, row.unit),
          number(row.aim, row.unit),
          verdict(row),
          starts_with_reason(row.note) && row.note.size() <= 8 ? "" : row.note};
}

void print_table(const std::vector<Row>& rows) {
  std::vector<Cells> table{{"name", "measured", "best rival", "must", "aim", "verdict", "note"}};
  for (const Row& row : rows) table.push_back(cells(row));
  std::array<std::size_t, 6> widths{};
  for (const Cells& line : table)
    for (std::size_t i = 0; i < widths.size(); ++i) widths[i] = std::max(widths[i], line[i].size());
  for (const Cells& line : table) {
    std::string text;
    for (std::size_t i = 0; i < widths.size(); ++i)
      text += line[i] + std::string(widths[i] - line[i].size() + 2, ' ');
    text += line.back();
    text.erase(text.find_last_not_of(' ') + 1);
    std::cout << text << '\n';
  }
}

template <class T>
nlohmann::ordered_json or_null(const std::optional<T>& value) {
  if constexpr (std::is_same_v<T, double>)
    if (value && !std::isfinite(*value)) return nullptr;
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json as_json(const Row& row) {
  return {{"name", row.name},
          {"measured", or_null(row.measured)},
          {"unit", row.unit},
          {"must", or_null(row.must)},
          {"aim", or_null(row.aim)},
          {"met", or_null(met(row))},
          {"verdict", verdict(row)},
          {"better", row.better == smaller ? "smaller" : "larger"},
          {"rival", or_null(row.rival)},
          {"rival_name", row.rival_name},
          {"note", row.note}};
}

std::string cpu_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
  return "unknown CPU";
}

}  // namespace

std::filesystem::path output_folder() {
  const char* folder = std::getenv("CAIRN_SCOREBOARD_DIR");
  return folder != nullptr ? folder : "build/scoreboard";
}

std::optional<int> answer(int argc, char** argv, const std::string& program,
                          std::initializer_list<std::string_view> parts) {
  std::string usage = "usage: " + program;
  for (const std::string_view part : parts) usage.append(" [").append(part).append("]");
  usage += parts.size() > 0 ? "\nWithout names all parts.\n"
                            : "\nTakes no options; CAIRN_DATA names the real data.\n";
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--help" || word == "-h" || word == "--version") {
      std::cout << (word == "--version" ? program + " " CAIRN_VERSION_STRING "\n" : usage);
      return flush_standard_output(program) ? 0 : 1;
    }
    if (std::ranges::find(parts, word) == parts.end()) {
      std::cerr << program << ": '" << word << "' is no option\n" << usage;
      return 2;
    }
  }
  return std::nullopt;
}

bool flush_standard_output(const std::string& program) {
  return example::flush_standard_output(program);
}

std::optional<bool> met(const Row& row) {
  if (!row.measured || (!row.must && !row.aim)) return std::nullopt;
  return reaches(row, row.must ? *row.must : *row.aim);
}

std::string verdict(const Row& row) {
  if (!row.measured) return row.note.starts_with("no rival") ? "no rival" : "no data";
  if (!row.must && !row.aim) return "reported";
  if (row.aim && reaches(row, *row.aim)) return "met aim";
  if (row.must && reaches(row, *row.must)) return "met must";
  return "missed";
}

Row against_rival(const std::string& name, double ours, std::optional<double> rival,
                  const std::string& rival_name, std::optional<double> must, std::optional<double> aim,
                  const std::string& unit) {
  Row row{.name = name, .unit = "x", .must = must, .aim = aim, .better = larger};
  if (!rival) {
    row.note = "no rival; ours " + number(ours) + " " + unit;
    return row;
  }
  row.measured = *rival / ours;
  row.rival = rival;
  row.rival_name = rival_name;
  row.note = "ours " + number(ours) + " " + unit + ", " + rival_name + " " + number(*rival) + " " + unit;
  return row;
}

Context context() {
#if defined(__clang__)
  const std::string compiler = "clang " __clang_version__;
#else
  const std::string compiler = "gcc " __VERSION__;
#endif
  return {cpu_name(), std::thread::hardware_concurrency(), compiler, CAIRN_BENCH_FLAGS};
}

Scoreboard::Scoreboard(std::string area) : area_(std::move(area)) {
  const Context here = context();
  std::cout << "scoreboard " << area_ << ": " << here.cpu << ", " << here.threads << " threads; "
            << here.compiler << "; " << here.flags << std::endl;
}

void Scoreboard::add(Row row) {
  if (row.measured && !std::isfinite(*row.measured)) {
    row.note = "no data: the measurement is not finite. " + row.note;
    row.measured.reset();
  }
  std::cout << "  " << row.name << ": " << number(row.measured, row.unit) << ", " << verdict(row)
            << (row.note.empty() ? "" : " (" + row.note + ")") << std::endl;
  rows_.push_back(std::move(row));
}

int Scoreboard::finish() const {
  std::cout << '\n';
  print_table(rows_);
  const Context here = context();
  nlohmann::ordered_json document{
      {"area", area_},
      {"context",
       {{"cpu", here.cpu}, {"threads", here.threads}, {"compiler", here.compiler}, {"flags", here.flags}}},
      {"rows", nlohmann::ordered_json::array()}};
  for (const Row& row : rows_) document["rows"].push_back(as_json(row));

  const std::filesystem::path file = output_folder() / (area_ + ".json");
  std::error_code ignored;
  std::filesystem::create_directories(file.parent_path(), ignored);
  try {
    cairn::write_file_atomically(file, document.dump(2) + "\n");
  } catch (const cairn::Error& error) {
    std::cerr << error.what() << "; is CAIRN_SCOREBOARD_DIR a writable folder?\n";
    return 1;
  }
  std::cout << "\nwritten to " << file.string() << '\n';
  return flush_standard_output("scoreboard_" + area_) ? 0 : 1;
}

}  // namespace cairn_bench
