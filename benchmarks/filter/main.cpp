// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The scoreboard of the filters: nanoseconds of one predict and update, ours and the rivals' in turns. A time
// counts only if it leads to the same uncertainty.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "growing.hpp"
#include "rivals.hpp"
#include "support/scoreboard.hpp"
#include "support/timing.hpp"

namespace {

using namespace cairn_bench;

constexpr int steps = 500;
// Short turns in many rounds: on a busy machine some of them are left alone.
constexpr InterleaveOptions turns{.rounds = 61, .seconds_per_round = 0.002};

struct Owed {
  std::string rival;
  std::optional<double> must, aim;
};

// A rival's answer agrees, or its row says that it does not.
bool agrees(double ours, double theirs, double tolerance) {
  return std::abs(ours - theirs) <= tolerance * std::abs(ours);
}

/// One problem: ours against all who solve it, one row a rival. What is owed is a ratio: it holds on any
/// machine.
void fight(Scoreboard& board, const std::string& name, Run Rival::* problem, const Rival& us,
           const std::vector<Rival>& rivals, const std::vector<Owed>& owed, double tolerance) {
  const Run& run = us.*problem;
  std::vector<Contender> contenders{{"ours", [&] { do_not_optimise(run(steps)); }, double(steps)}};
  std::vector<std::pair<std::string, bool>> names;
  const double answer = run(steps);
  for (const Rival& rival : rivals) {
    const Run& theirs = rival.*problem;
    if (!theirs) continue;
    names.emplace_back(rival.name, agrees(answer, theirs(steps), tolerance));
    contenders.push_back({rival.name, [&] { do_not_optimise(theirs(steps)); }, double(steps)});
  }
  const auto timings = interleave(contenders, turns);
  const double ns = timings[0].median * 1e9;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto& [rival, same] = names[i];
    Row row = against_rival(name + ", " + rival, ns, timings[i + 1].median * 1e9, rival, {}, {}, "ns");
    row.measured = ratio(timings[i + 1], timings[0]);
    if (!same) row.note += "; its answer differs";
    for (const Owed& debt : owed)
      if (debt.rival == rival) {
        row.must = debt.must;
        row.aim = debt.aim;
        if (!same && rival != "mherb") {
          std::fprintf(stderr, "scoreboard_filter: %s: the answers differ\n", row.name.c_str());
          std::exit(1);
        }
      }
    board.add(row);
  }
  for (const Owed& debt : owed) {
    bool found = false;
    for (const auto& entry : names) found = found || entry.first == debt.rival;
    if (!found)
      board.add(against_rival(name + ", " + debt.rival, ns, {}, debt.rival, debt.must, debt.aim, "ns"));
  }
}

void absolute(Scoreboard& board, const std::string& name, const Run& run, int count, double each,
              std::optional<double> must, std::optional<double> aim) {
  const auto timings =
      interleave({{"ours", [&] { do_not_optimise(run(count)); }, double(count) * each}}, turns);
  board.add({.name = name,
             .measured = timings[0].median * 1e9,
             .unit = "ns",
             .must = must,
             .aim = aim,
             .note = "fastest round " + std::to_string(timings[0].fastest * 1e9)});
}

}  // namespace

int main(int argc, char** argv) {
  if (const auto code = cairn_bench::answer(argc, argv, "scoreboard_filter")) return *code;
  Scoreboard board("filter");
  const Rival us = ours(), points = ours_unscented(), factored = ours_factored();
  const std::vector<Rival> rivals{openkf(), mherb(), tinyekf(), opencv(), bfl(), hand_written()};
  constexpr double exact = 1e-6;
  fight(board, "KF 6/3 constant velocity", &Rival::kalman_6_3, us, rivals,
        {{"OpenKF", 1.0, 186.0 / 110.0}, {"mherb", 2.0, {}}}, exact);
  fight(board, "KF 3/3 landmark", &Rival::landmark_3_3, us, rivals, {{"OpenKF", 1.0, 62.0 / 45.0}}, exact);
  if (!agrees(us.landmark_3_3(200), batch_of_1000(200), exact)) {
    std::fprintf(stderr, "scoreboard_filter: the batch and the single landmark differ\n");
    return 1;
  }
  absolute(board, "KF 3/3 landmark, batch of 1000, each", batch_of_1000, 50, 1000.0, 15.0, 10.0);
  fight(board, "EKF 5/2 range and bearing", &Rival::extended_5_2, us, rivals,
        {{"OpenKF", 1.0, 234.0 / 165.0}, {"mherb", 1.0, {}}}, exact);
  fight(board, "UKF 5/2 range and bearing", &Rival::unscented_5_2, points, rivals,
        {{"hand-written Eigen", 2.0, 1750.0 / 600.0}}, 1e-3);
  fight(board, "UKF 9/3", &Rival::unscented_9_3, points, rivals,
        {{"hand-written Eigen", 2.0, 3860.0 / 1300.0}}, 1e-3);
  fight(board, "EKF 15/6 inertial", &Rival::extended_15_6, us, rivals, {{"TinyEKF", 1.3, 2740.0 / 900.0}},
        exact);
  fight(board, "UD 6/3 and square root", &Rival::factored_6_3, factored, rivals,
        {{"mherb", 4152.0 / 400.0, 4152.0 / 350.0}}, exact);
  fight(board, "UD 15/6 and square root", &Rival::factored_15_6, factored, rivals,
        {{"mherb", 16941.0 / 3000.0, 16941.0 / 2400.0}}, exact);
  if (!agrees(us.kalman_6_3(steps), factored.factored_6_3(steps), 1e-9) ||
      !agrees(us.extended_15_6(steps), factored.factored_15_6(steps), 1e-9)) {
    std::fprintf(stderr, "scoreboard_filter: the UD form and the plain one differ\n");
    return 1;
  }
  absolute(board, "UD 6/3", factored.factored_6_3, steps, 1.0, {}, {});
  absolute(board, "UD 15/6", factored.factored_15_6, steps, 1.0, {}, {});
  add_growing_rows(board);
  return board.finish();
}
