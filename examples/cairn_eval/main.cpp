// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// How good are trajectories? ATE, RPE, the KITTI measure and NEES of files in the formats of TUM, KITTI and
// EuRoC, several estimates in one page. Exit codes: 0 well; 2 a mistake, or files that do not belong
// together.
#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>

#include "evaluate.hpp"
#include "outputs.hpp"
#include "support/command_line.hpp"

namespace {

using namespace cairn_eval;

struct Options {
  std::filesystem::path truth, times, out = "cairn_eval_out";
  std::vector<std::string> estimates, names, covariances;
  std::string format = "auto", truth_format = "auto", align = "rigid", unit = "frames";
  EvaluationOptions evaluation;
};

const std::map<std::string, Format> formats{
    {"auto", Format::automatic}, {"tum", Format::tum}, {"kitti", Format::kitti}, {"euroc", Format::euroc}};
const std::map<std::string, cairn::AlignBy> alignments{{"none", cairn::AlignBy::none},
                                                       {"first", cairn::AlignBy::first_pose},
                                                       {"rigid", cairn::AlignBy::rigid},
                                                       {"similarity", cairn::AlignBy::similarity}};

template <class Value>
std::set<std::string> keys(const std::map<std::string, Value>& map) {
  std::set<std::string> result;
  for (const auto& [key, value] : map) result.insert(key);
  return result;
}

void add_options(CLI::App& app, Options& o) {
  app.add_option("truth", o.truth, "the true trajectory: TUM, KITTI or EuRoC")->required();
  app.add_option("estimates", o.estimates, "estimates of it, one file or more")->required();
  app.option_defaults()->always_capture_default();
  app.add_option("--names", o.names, "of the estimates, for tables and pictures; else those of their files")
      ->default_str("");
  app.add_option(
         "--align", o.align,
         "none: the worlds are the same; first: first poses coincide; rigid: least squares; similarity: "
         "with scale, for monocular systems")
      ->check(CLI::IsMember(keys(alignments)));
  app.add_option("--format", o.format, "of the estimates; auto goes by the first line")
      ->check(CLI::IsMember(keys(formats)));
  app.add_option("--truth-format", o.truth_format, "of the truth")->check(CLI::IsMember(keys(formats)));
  app.add_option("--times", o.times, "times.txt of KITTI files, which have no times of their own");
  app.add_option("--covariances", o.covariances,
                 "trajectory_covariance.csv of each estimate, for NEES; - for one that has none")
      ->default_str("");
  app.add_option("--max-difference", o.evaluation.association.largest_difference,
                 "between the times of an estimated and a true pose [s]")
      ->check(example::number_between(0, 1e6));
  app.add_option("--offset", o.evaluation.association.offset, "added to the times of estimates [s]")
      ->check(example::number_between(-1e12, 1e12));
  app.add_option("--delta", o.evaluation.relative.delta, "of RPE, in --delta-unit")
      ->check(example::number_between(1e-3, 1e6));
  app.add_option("--delta-unit", o.unit, "frames or metres")->check(CLI::IsMember({"frames", "metres"}));
  app.add_flag("--all-pairs", o.evaluation.relative.all_pairs,
               "RPE from every pose; else each pair starts where the last one ended");
  app.add_option("--kitti-step", o.evaluation.kitti.step,
                 "frames between the beginnings of KITTI's stretches")
      ->check(example::whole_number(1, 1000000));
  app.add_option("--kitti-lengths", o.evaluation.kitti.lengths, "of KITTI's stretches [m]")
      ->check(example::number_between(1e-3, 1e6));
  app.add_option("--out", o.out, "folder for summary.json, errors.csv and report.html");
}

/// What two options say together.
void check(const Options& o) {
  if (!o.names.empty() && o.names.size() != o.estimates.size())
    cairn::raise("--names: expected one for each estimate");
  if (!o.covariances.empty() && o.covariances.size() != o.estimates.size())
    cairn::raise("--covariances: expected one for each estimate, - for one that has none");
  if (o.unit == "frames" && o.evaluation.relative.delta < 1)
    cairn::raise("--delta: expected at least one frame");
}

/// What estimates are called: their files, or where two are called the same, the folders that hold them, or
/// where that does not tell them apart either, all of the path.
std::vector<std::string> names_of(const std::vector<std::string>& estimates) {
  std::vector<std::string> names;
  const auto differ = [&](const auto& name_of) {
    names.clear();
    for (const std::filesystem::path path : estimates) names.push_back(name_of(path));
    return std::set<std::string>(names.begin(), names.end()).size() == names.size();
  };
  if (!differ([](const auto& path) { return path.stem().string(); }) &&
      !differ([](const auto& path) { return path.parent_path().filename().string(); }))
    differ([](const auto& path) { return path.string(); });
  return names;
}

std::vector<NamedEvaluation> evaluate_all(const Options& o) {
  const TrajectoryFile truth = read_trajectory(o.truth, formats.at(o.truth_format), o.times);
  std::vector<NamedEvaluation> all;
  const std::vector<std::string> names = o.names.empty() ? names_of(o.estimates) : o.names;
  bool takes_times = truth.format == Format::kitti;
  for (std::size_t i = 0; i < o.estimates.size(); ++i) {
    const TrajectoryFile estimate = read_trajectory(o.estimates[i], formats.at(o.format), o.times);
    takes_times = takes_times || estimate.format == Format::kitti;
    const bool covers = !o.covariances.empty() && o.covariances[i] != "-";
    all.push_back(
        {names[i],
         evaluate(truth, estimate, covers ? std::optional(read_covariances(o.covariances[i])) : std::nullopt,
                  o.evaluation)});
  }
  if (!o.times.empty() && !takes_times)
    cairn::raise("--times is for KITTI files, which have no times of their own");
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = "cairn_eval";
  Options options;
  CLI::App app{
      "Scores trajectories against the truth: ATE, RPE, the KITTI measure, and NEES where covariances are "
      "given."};
  add_options(app, options);
  if (const std::optional<int> code = example::parse(app, name, argc, argv)) return *code;
  return example::exit_code_of(name, [&]() -> int {
    check(options);
    options.evaluation.align = alignments.at(options.align);
    options.evaluation.relative.unit =
        options.unit == "metres" ? cairn::DeltaUnit::metres : cairn::DeltaUnit::frames;
    const std::vector<NamedEvaluation> all = evaluate_all(options);
    prepare_output_folder(options.out);
    const std::optional<std::string> no_report = write_outputs(options.out, all, options.evaluation);
    std::cout << in_words(all, options.evaluation) << "results in "
              << std::filesystem::absolute(options.out).lexically_normal().string() << "\n";
    if (no_report) std::clog << name << ": " << *no_report << "\n";
    return example::exit_well;
  });
}
