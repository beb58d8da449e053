// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What a set that grows costs: in one tree that is rebuilt, in multi-kd-trees of
// several shapes, and in no tree at all.
#include <algorithm>
#include <array>
#include <exception>
#include <filesystem>
#include <functional>
#include <iostream>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <cairn/io/file.hpp>
#include <cairn/version.hpp>

#include "study/analysis.hpp"
#include "study/report.hpp"
#include "study/streams.hpp"
#include "support/progress.hpp"
#include "support/result_folder.hpp"
#include "support/scoreboard.hpp"

namespace {

using cairn_study::Drive;
using cairn_study::Stream;
using cairn_study::Study;

struct Options {
  bool full = false, brief = false;
  std::string only;  ///< name of one stream
  std::filesystem::path out = "build/benchmark";
};

constexpr const char* usage =
    "usage: index_study [--quick | --full | --brief] [--only points_3|clusters_64|sift_128|surf_64|recall] "
    "[--out "
    "FOLDER]\n"
    "  --quick   up to 3e5 points and 5e4 descriptors, about three minutes (the default)\n"
    "  --brief   points_3 and clusters_64 to 1e4, in seconds: to see what the page holds\n"
    "  --full    up to 1e7 points and 1e6 descriptors, half an hour\n"
    "  --version, --help\n";

constexpr std::array<std::string_view, 5> stream_names{"points_3", "clusters_64", "sift_128", "surf_64",
                                                       "recall"};

/// What the command line asks for, or the exit code of the answer to it.
std::variant<Options, int> parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--full" || word == "--quick" || word == "--brief") {
      options.full = word == "--full";
      options.brief = word == "--brief";
    } else if (word == "--only" && i + 1 < argc &&
               std::ranges::find(stream_names, std::string_view(argv[i + 1])) != stream_names.end()) {
      options.only = argv[++i];
    } else if (word == "--out" && i + 1 < argc) {
      options.out = argv[++i];
    } else if (word == "--help" || word == "-h" || word == "--version") {
      std::cout << (word == "--version" ? "index_study " CAIRN_VERSION_STRING "\n" : usage);
      return cairn_bench::flush_standard_output("index_study") ? 0 : 2;
    } else {
      std::cerr << "index_study: '" << word << "' is no option, or lacks its value\n" << usage;
      return 2;
    }
  }
  return options;
}

struct Contender {
  std::string name;
  std::size_t growth;
  std::size_t first_steps;
};

std::vector<Contender> contenders() {
  std::vector<Contender> list{{"single tree", 0, 0}};
  for (const std::size_t growth : {2U, 3U, 4U, 8U})
    for (const std::size_t first_steps : {1U, 10U, 50U})
      list.push_back(
          {"q = " + std::to_string(growth) + ", z = " + std::to_string(first_steps), growth, first_steps});
  list.push_back({"scan", 0, 0});
  return list;
}

Study study(Stream stream) {
  const cairn_study::Truth truth = make_truth(stream);
  const cairn_study::StoreOptions options{stream.dim, stream.leaves};
  const auto list = contenders();
  constexpr std::size_t repeats = 2;  // of the two that are set against each other
  example::Progress progress(std::cerr, stream.name, (list.size() + 2 * repeats) * stream.steps());
  const auto drive_of = [&](const Contender& contender) {
    const bool is_scan = contender.name == "scan";
    const bool is_single = contender.name == "single tree";
    const auto store =
        is_scan     ? cairn_study::make_scan(options)
        : is_single ? cairn_study::make_single_tree(options)
                    : cairn_study::make_forest(options, {.first_size = contender.first_steps * stream.step,
                                                         .growth = contender.growth});
    // Of those whose step grows with n, as many steps of each size; few queries where each takes long.
    const cairn_study::RunOptions how{.gap = is_scan || is_single ? 0.05 : 0.0,
                                      .timed = is_scan ? 20 : stream.timed,
                                      .exact = is_scan || stream.dim == 3};
    Drive drive = run(stream, truth, *store, how, [&] { progress.step(contender.name); });
    drive.name = contender.name;
    drive.growth = contender.growth;
    drive.first_steps = contender.first_steps;
    return drive;
  };
  std::vector<Drive> drives;
  for (const Contender& contender : list) drives.push_back(drive_of(contender));
  std::size_t best = 1;  // the first forest; the scan is the last
  for (std::size_t i = 2; i + 1 < drives.size(); ++i)
    if (total_time(drives[i]) < total_time(drives[best])) best = i;
  std::vector<double> gains{total_time(drives[0]) / total_time(drives[best])};
  while (gains.size() <= repeats) {
    const double single = total_time(drive_of(list[0]));
    gains.push_back(single / total_time(drive_of(list[best])));
  }
  Study all = analyse(std::move(stream), std::move(drives));
  all.best = best;
  all.gains = std::move(gains);
  return all;
}

std::vector<Study> run_all(const Options& options) {
  using Make = std::function<std::optional<Stream>()>;
  const bool full = options.full;
  const std::size_t steps = full ? 1000 : options.brief ? 50 : 250;
  const std::size_t points = full ? 10000000 : options.brief ? 10000 : 300000;
  const std::size_t clusters = full ? 1000000 : options.brief ? 10000 : 50000;
  std::vector<std::pair<std::string_view, Make>> streams{
      {stream_names[0], [&] { return cairn_study::uniform_points(points, steps); }},
      {stream_names[1], [&] { return cairn_study::clustered(clusters, steps); }},
      {stream_names[2], [&] { return cairn_study::sift_descriptors(full ? 99000 : 40000, steps); }},
      {stream_names[3], [&] { return cairn_study::arena_descriptors(full ? 0 : 40, steps); }}};
  if (options.brief) streams.resize(2);
  std::vector<Study> studies;
  for (const auto& [name, make] : streams) {
    if (!options.only.empty() && options.only != name) continue;
    std::cerr << name << ": making the data\n";
    std::optional<Stream> stream = make();
    if (stream)
      studies.push_back(study(std::move(*stream)));
    else
      std::cerr << name << ": skipped, there is no such data here\n";
  }
  return studies;
}

example::ResultFolder results_in(const std::filesystem::path& folder) {
  return {folder, {"index_study.json", "index_study.csv", "index_recall.csv", "index_study.html"}};
}

/// Writes everything; returns how many answers were wrong.
std::size_t finish(const std::vector<Study>& studies, const std::vector<cairn_study::RecallStudy>& recalls,
                   const Options& options) {
  const cairn_bench::Context here = cairn_bench::context();
  const std::string subtitle = here.cpu + ", one thread; " + here.compiler + "; " + here.flags +
                               (options.full    ? "; full"
                                : options.brief ? "; brief"
                                                : "; quick");
  const auto page = make_report(studies, recalls, subtitle).html();
  results_in(options.out).replace([&](const std::filesystem::path& staging) {
    cairn::write_file_atomically(staging / "index_study.json", to_json(studies));
    cairn::write_file_atomically(staging / "index_study.csv", to_csv(studies));
    cairn::write_file_atomically(staging / "index_recall.csv", recall_csv(recalls));
    if (page) cairn::write_file_atomically(staging / "index_study.html", *page);
  });
  std::cout << "The results are in " << options.out.string() << ":\n";
  for (const char* name : {"index_study.json", "index_study.csv", "index_recall.csv", "index_study.html"})
    if (page || std::string_view(name) != "index_study.html")
      std::cout << "  " << (options.out / name).string() << '\n';
  if (!page) std::cout << "  " << example::why_no_report() << '\n';
  std::size_t wrong = 0;
  for (const Study& study : studies)
    for (const auto& result : study.results) wrong += result.drive.wrong;
  return wrong;
}

}  // namespace

int main(int argc, char** argv) try {
  const std::variant<Options, int> asked = parse(argc, argv);
  if (const int* code = std::get_if<int>(&asked)) return *code;
  const Options& options = std::get<Options>(asked);
  results_in(options.out).prepare();
  const std::vector<Study> studies = run_all(options);
  const std::vector<cairn_study::RecallStudy> recalls =
      (options.only.empty() && !options.brief) || options.only == "recall"
          ? cairn_study::recall_studies()
          : std::vector<cairn_study::RecallStudy>{};
  if (studies.empty() && recalls.empty()) {
    std::cerr << "index_study: nothing was run\n" << usage;
    return 2;
  }
  if (const std::size_t wrong = finish(studies, recalls, options); wrong > 0) {
    std::cerr << "index_study: " << wrong << " answers were wrong\n";
    return 1;
  }
  return cairn_bench::flush_standard_output("index_study") ? 0 : 2;
} catch (const std::exception& error) {
  std::cerr << "index_study: " << error.what() << '\n';
  return 2;
}
