// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "ancestors.hpp"

#include <algorithm>
#include <cstddef>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/filter/conditional.hpp>
#include <cairn/grid/ancestry.hpp>

#include "floor_plan.hpp"
#include "outputs.hpp"
#include "run.hpp"
#include "stop_mapper.hpp"
#include "support/random.hpp"

namespace ancestors_test {
namespace {

using namespace cairn;
using namespace grid_slam;

/// Counts how often it was at each step: a map of one cell a step.
struct CountMap {
  using Pose = SE2;
  using Observation = int;
  Ancestry<int> cells;

  [[nodiscard]] double log_likelihood(const Pose& x, Observation) const { return -200 * x.x() * x.x(); }
  void insert(const Pose&, Observation z) { ++cells.write({z, 0}); }
};

/// The panel of this title as the page reads it, or null.
nlohmann::json panel_of(const std::string& page, const std::string& title) {
  const std::string begin = "id=\"data\">";
  const std::size_t from = page.find(begin) + begin.size();
  const auto data = nlohmann::json::parse(page.substr(from, page.find("</script>", from) - from));
  for (const auto& panel : data["panels"])
    if (panel["title"] == title) return panel;
  return nullptr;
}

}  // namespace

TEST_SUITE("grid_slam/ancestors") {
  TEST_CASE("ancestors: they are the nodes of the maps' tree, and no two lines of their picture cross") {
    const std::uint64_t seed = cairn_test::seed(3);
    CAPTURE(seed);
    constexpr std::size_t particles = 12;
    MappedPaths<CountMap> belief(SE2(), CountMap{}, particles);
    const ConditionalFilter filter{.resample_below = 0.6, .seed = seed};
    const auto motion = [](const SE2& x, std::size_t) {
      return Gaussian<SE2>{x, Matrix<3>(Vector<3>(0.01, 0.01, 0.01).asDiagonal())};
    };
    for (int step = 1; step <= 60; ++step) {
      CAPTURE(step);
      REQUIRE(filter.step(belief, motion, FromMotion{}, step).accepted());
      const auto record = belief.record();
      const std::vector<Ancestor> all = ancestors_of(record);
      REQUIRE(all.size() == belief[0].map.cells.nodes());
      std::size_t ends = 0;
      std::set<double> places;
      for (std::size_t i = 0; i < all.size(); ++i) {
        const Ancestor& a = all[i];
        ends += a.particles;
        if (a.particles > 0) places.insert(a.place);
        REQUIRE((a.end == static_cast<std::uint64_t>(step)) == (a.particles > 0));
        REQUIRE(a.born == (a.parent ? all[*a.parent].end : 0));
        REQUIRE((!a.parent || *a.parent < i));
        REQUIRE((a.parent.has_value() || i == 0));
      }
      CHECK(ends == particles);
      CHECK(*places.rbegin() + 1 == static_cast<double>(places.size()));
      // Of two that live at one time, all that comes of one stands on one side of all that comes of the
      // other.
      const auto span = [&](std::size_t of) {
        std::pair<double, double> reach{1e9, -1e9};
        for (std::size_t i = 0; i < all.size(); ++i) {
          std::size_t at = i;
          while (at != of && all[at].parent) at = *all[at].parent;
          if (at == of) reach = {std::min(reach.first, all[i].place), std::max(reach.second, all[i].place)};
        }
        return reach;
      };
      for (std::size_t i = 0; i < all.size(); ++i)
        for (std::size_t k = 0; k < i; ++k)
          if (all[i].parent == all[k].parent)
            REQUIRE((span(i).first > span(k).second || span(k).first > span(i).second));
    }
  }

  TEST_CASE("ancestors: a tree's report says what shared tiles would have taken, which is what they take") {
    CarmenLog log = simulated_drive({.seed = 2}).log;
    log.scans.resize(90);
    StopMapperOptions options{.particles = 8, .seed = 4};
    const auto with = [&](StopStorage storage) {
      options.storage = storage;
      return run_stop_mapper(log, options, {}, {}, 6);
    };
    const Results tree = with(StopStorage::ancestry), tiles = with(StopStorage::tiles);
    REQUIRE(tree.snapshots.size() == tiles.snapshots.size());
    for (std::size_t i = 0; i < tree.snapshots.size(); ++i) {
      const Snapshot &a = tree.snapshots[i], &b = tiles.snapshots[i];
      CHECK(a.tile_bytes == b.bytes);
      CHECK(a.separate_bytes == b.separate_bytes);
      CHECK(b.bytes < b.separate_bytes);
      CHECK(a.ancestors.size() <= 2 * options.particles - 1);
      CHECK(b.ancestors.empty());
      CHECK(b.tile_bytes == 0);
    }
    const auto page = report(tree);
    if (!page) return;
    const auto memory = panel_of(*page, "Memory of the maps");
    REQUIRE(memory["curves"].size() == 3);
    CHECK(memory["curves"][1]["name"] == "if they were shared tiles");
    CHECK(memory["curves"][1]["values"].back().get<double>() ==
          doctest::Approx(static_cast<double>(tiles.snapshots.back().bytes) / 1048576).epsilon(1e-4));
    CHECK(panel_of(*report(tiles), "Memory of the maps")["curves"].size() == 2);
    CHECK(panel_of(*report(tiles), "The tree of ancestors").is_null());
    const auto film = panel_of(*page, "The tree of ancestors");
    REQUIRE(film["frames"].size() == tree.snapshots.size());
    std::size_t dots = 0;
    for (const auto& curve : film["frames"].back()["curves"]) {
      const auto name = curve["name"].get<std::string>();
      if (!curve["dots"].get<bool>()) continue;
      dots += curve["x"].size();
      for (const auto& x : curve["x"]) CHECK(x.get<double>() <= 0);
    }
    CHECK(dots == tree.snapshots.back().ancestors.size());
  }

  TEST_CASE(
      "report: the proposal's ellipses lie on the path, as long along the corridor as its covariance says") {
    // A path of two legs; what is drawn from is 3 cm wide ahead and 1 cm to the side.
    Results r;
    r.steps.resize(80);
    for (std::size_t k = 0; k < 80; ++k) {
      const double at = 0.3 * static_cast<double>(k);
      const SE2 pose = k < 40 ? SE2(at, 0, 0) : SE2(12, at - 12, std::numbers::pi / 2);
      r.drawn_from.push_back({pose, Matrix<3>(Vector<3>(9e-4, 1e-4, 1e-4).asDiagonal())});
      r.means.push_back({static_cast<double>(k), pose});
    }
    const auto page = report(r);
    if (!page) return;
    const auto panel = panel_of(*page, "Spread of the proposal");
    const auto& curve = panel["curves"][1];
    const auto name = curve["name"].get<std::string>();
    REQUIRE(name.starts_with("3 sigma, "));
    const double scale = std::stod(name.substr(9));
    CHECK(panel["caption"].get<std::string>().find("drawn " + name.substr(9)) != std::string::npos);
    std::vector<Vector<2>> low{{1e9, 1e9}}, high{{-1e9, -1e9}};
    for (std::size_t i = 0; i < curve["x"].size(); ++i) {
      if (curve["x"][i].is_null()) {
        low.emplace_back(1e9, 1e9);
        high.emplace_back(-1e9, -1e9);
        continue;
      }
      const Vector<2> at(curve["x"][i].get<double>(), curve["y"][i].get<double>());
      low.back() = low.back().cwiseMin(at);
      high.back() = high.back().cwiseMax(at);
    }
    low.pop_back();  // a gap ends the last one too
    high.pop_back();
    CHECK(low.size() > 10);
    Vector<2> before(-1e9, -1e9);
    for (std::size_t i = 0; i < low.size(); ++i) {
      const Vector<2> middle = 0.5 * (low[i] + high[i]), half = 0.5 * (high[i] - low[i]) / scale;
      const bool first_leg = middle(0) < 11.99;
      CHECK(middle(first_leg ? 1 : 0) == doctest::Approx(first_leg ? 0 : 12).epsilon(1e-3));
      CHECK(half(first_leg ? 0 : 1) == doctest::Approx(3 * 0.03).epsilon(0.01));
      CHECK(half(first_leg ? 1 : 0) == doctest::Approx(3 * 0.01).epsilon(0.01));
      CHECK((middle - before).norm() > 2 * 3 * 0.03 * scale * 0.99);  // none covers the next
      before = middle;
    }
    r.drawn_by_scans = false;
    CHECK(panel_of(*report(r), "Spread of the proposal")["caption"].get<std::string>().find(
              "by odometry, before it is drawn") != std::string::npos);
    r.drawn_from.clear();
    CHECK(panel_of(*report(r), "Spread of the proposal").is_null());
  }
}

}  // namespace ancestors_test
