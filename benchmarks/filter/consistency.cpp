// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// filter_consistency [runs]: average NEES and NIS of every filter with every ready-made model over
// independent runs, as markdown tables with the bands in which a consistent filter stays 99 % of the time.
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>

#include <cairn/filter/augmented_unscented.hpp>
#include <cairn/filter/ensemble.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/square_root_information.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/io/text.hpp>
#include <cairn/version.hpp>

#include "filter/consistency_study.hpp"
#include "support/scoreboard.hpp"

namespace {

constexpr int steps = 20;
constexpr std::uint64_t seed = 1;
int runs = 500;
int outside = 0;

std::string judged(double value, int dof) {
  if (value < 0.0) return "-";
  char text[64];
  const bool good = cairn::chi_square_mean_band(dof, runs, 0.99).contains(value);
  if (!cairn::chi_square_mean_band(dof, runs, 0.9999).contains(value)) ++outside;
  std::snprintf(text, sizeof text, good ? "%.3f" : "%.3f (out)", value);
  return text;
}

template <class Scenario, class Filter, class Begin>
void row(const char* name, const Scenario& scenario, const Filter& filter, const Begin& begin) {
  const auto found = cairn_test::study(scenario, filter, begin, runs, steps, seed);
  std::printf("| %s | %s | %s | %d |\n", name, judged(found.nees, found.dof).c_str(),
              judged(found.nis, found.measured).c_str(), found.refused);
  if (found.refused > 0) ++outside;
}

template <class Scenario>
void table(const Scenario& scenario) {
  using X = typename Scenario::State;
  const auto prior = cairn_test::as_prior;
  const auto root = [](const auto& p, cairn::Random&) { return cairn::SquareRootGaussian<X>::from(p); };
  int measured = 0;
  scenario.sense(steps - 1, [&](const auto& sensor) {
    measured = cairn::dof<typename std::decay_t<decltype(sensor)>::Measurement>;
  });
  const auto nees = cairn::chi_square_mean_band(cairn::dof<X>, runs, 0.99);
  const auto nis = cairn::chi_square_mean_band(measured, runs, 0.99);
  std::printf("\n| %s | NEES, band %.3f to %.3f | NIS, band %.3f to %.3f | refused |\n|---|---|---|---|\n",
              Scenario::name, nees.low, nees.high, nis.low, nis.high);
  if constexpr (Scenario::linear) {
    row("Kalman", scenario, cairn::Kalman{}, prior);
    row("Kalman, Joseph", scenario, cairn::Kalman{.form = cairn::Form::joseph}, prior);
    row("Kalman, sequential", scenario, cairn::Kalman{.form = cairn::Form::sequential}, prior);
  }
  row("Extended", scenario, cairn::Extended{}, prior);
  row("Extended, iterated", scenario, cairn::Extended{.iterations = 5}, prior);
  row("Unscented", scenario, cairn::Unscented{}, prior);
  row("Unscented, alpha 1e-3", scenario, cairn::Unscented{.points = {.alpha = 1e-3}}, prior);
  row("cubature", scenario, cairn::cubature(), prior);
  row("AugmentedUnscented", scenario, cairn::AugmentedUnscented{}, prior);
  row("SquareRoot", scenario, cairn::SquareRoot{}, root);
  row("SquareRootUnscented", scenario, cairn::SquareRootUnscented{}, root);
  row("UDFilter", scenario, cairn::UDFilter{},
      [](const auto& p, cairn::Random&) { return cairn::UDGaussian<X>::from(p); });
  row("InformationFilter", scenario, cairn::InformationFilter{},
      [](const auto& p, cairn::Random&) { return cairn::InformationBelief<X>::from(p).value(); });
  row("SquareRootInformationFilter", scenario, cairn::SquareRootInformationFilter{},
      [](const auto& p, cairn::Random&) { return cairn::SquareRootInformation<X>::from(p).value(); });
  row("EnsembleKalman, 500 members", scenario, cairn::EnsembleKalman{},
      [](const auto& p, cairn::Random& random) { return cairn::Ensemble<X>::draw(p, 500, random); });
  row("ParticleFilter, 10000 particles", scenario, cairn::ParticleFilter{},
      [](const auto& p, cairn::Random& random) { return cairn::draw_particles(p, 10000, random); });
}

}  // namespace

int main(int count, char** arguments) {
  constexpr const char* usage = "usage: filter_consistency [runs, 1 to 1000000]\n";
  if (count == 2) {
    const std::string_view word = arguments[1];
    if (word == "--help" || word == "-h" || word == "--version") {
      std::printf("%s", word == "--version" ? "filter_consistency " CAIRN_VERSION_STRING "\n" : usage);
      return cairn_bench::flush_standard_output("filter_consistency") ? 0 : 1;
    }
    runs = cairn::parse_number<int>(word).value_or(0);
  }
  if (count > 2 || runs < 1 || runs > 1000000) {
    std::fprintf(stderr, "%s", usage);
    return 2;
  }
  std::printf("%d runs of %d steps, seed %d\n", runs, steps, static_cast<int>(seed));
  table(cairn_test::FlyingPoint{});
  table(cairn_test::Rocket{});
  table(cairn_test::CirclingVehicle{});
  table(cairn_test::CompassVehicle{});
  std::printf("\n%d values outside the 99.99 %% band, or rows with refused steps\n", outside);
  return cairn_bench::flush_standard_output("filter_consistency") ? 0 : 1;
}
