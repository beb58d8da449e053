// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/field/random_field.hpp>
#include <cairn/io/file.hpp>

#include "acquisition.hpp"
#include "loop_mapping.hpp"
#include "outputs.hpp"
#include "planar_flight.hpp"
#include "straight_flight.hpp"
#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"
#include "terrain_file.hpp"

using namespace correlation_navigation;

namespace flights_test {
namespace {

cairn::FieldGrid ground(std::uint64_t seed, int columns = 420, int rows = 400) {
  cairn::Random random(seed);
  return cairn::RandomField{200.0, 1.0 / 500.0}.draw(columns, rows, {0, 0, 30, 30}, random);
}

}  // namespace

TEST_SUITE("correlation_navigation") {
  TEST_CASE("straight flight: errors stand at the Cramer-Rao bound and the filter knows them") {
    StraightFlight flight;
    flight.frames = 8;
    flight.seed = cairn_test::seed();
    CAPTURE(flight.seed);
    const StraightResult result = fly_straight(flight, 80);
    CHECK(result.rmse_over_bound < 1.25);
    CHECK(result.rmse_over_bound > 0.8);
    const cairn::ConsistencyBand wide = cairn::chi_square_mean_band(5, 80, 0.9999);
    CHECK(wide.contains(result.nees_mean));
    CHECK(result.refused == 0);
    for (std::size_t k = 1; k < result.bound[1].size(); ++k)
      CHECK(result.bound[1][k] <= result.bound[1][k - 1]);
  }

  TEST_CASE("straight flight: the same seed gives the same numbers for any number of threads") {
    StraightFlight flight;
    flight.frames = 3;
    const StraightResult one = fly_straight(flight, 5);
    flight.threads = 3;
    const StraightResult three = fly_straight(flight, 5);
    CHECK(one.rms_error == three.rms_error);
    CHECK(one.nees == three.nees);
  }

  TEST_CASE(
      "straight flight: the map's error limits the position more than the sensor's, as the document finds") {
    StraightFlight flight;
    flight.frames = 4;
    const auto final_sigma = [&](double sensor, double map) {
      StraightFlight variant = flight;
      variant.sensor_noise = sensor;
      variant.map_error = map;
      return fly_straight(variant, 4).bound[0].back();
    };
    const double neither = final_sigma(0.1, 0.0);
    CHECK(final_sigma(0.1, 0.1) > 2.0 * neither);  // as large an error, but shared by neighbouring samples
    CHECK(final_sigma(0.2, 0.0) == doctest::Approx(2.0 * neither).epsilon(0.05).scale(0));
  }

  TEST_CASE("divergence: a start near a correlation length loses the filter and not the search") {
    StraightFlight flight;
    const auto rows = divergence(flight, 12);
    CHECK(rows.front().start < 0.2);
    CHECK(rows.front().extended == 0.0);
    CHECK(rows.back().start >= 2.0);
    CHECK(rows.back().extended > 0.5);
    for (const DivergenceRow& row : rows) CHECK(row.searched == 0.0);
  }

  TEST_CASE("acquisition: right on a synthetic field, and nothing wrong is accepted") {
    const AcquisitionResult result = acquire(ground(4), {.starts = 12, .seed = 2});
    CHECK(result.rate >= 11.0 / 12.0);
    CHECK(result.wrong_rate == 0.0);
    CHECK(result.rms_error < 15.0);
  }

  TEST_CASE("acquisition: right on real terrain") {
    const auto data = cairn_test::real_data("terrain");
    if (!data) return;
    const auto field = read_terrain(*data / "srtm_bigtujunga30m_utm11.tif");
    const AcquisitionResult result = acquire(field, {.starts = 20, .seed = 5});
    CHECK(result.rate >= 0.95);
    CHECK(result.wrong_rate == 0.0);
  }

  TEST_CASE("acquisition: a flat field is never accepted") {
    const AcquisitionResult result =
        acquire(cairn::FieldGrid(300, 300, {0, 0, 30, 30}, 100.0), {.starts = 3});
    CHECK(result.rate == 0.0);
    CHECK(result.wrong_rate == 0.0);
    CHECK(cairn_test::message_of([] {
            static_cast<void>(acquire(cairn::FieldGrid(20, 20), {}));
          }).find("a map of at least") != std::string::npos);
  }

  TEST_CASE("acquisition: a field full of voids is refused, not searched for ever") {
    cairn::FieldGrid holed = ground(4, 200, 200);
    for (int r = 0; r < 200; r += 8)
      for (int c = 0; c < 200; c += 8) holed(c, r) = cairn::void_value;
    CHECK(cairn_test::message_of([&] {
            static_cast<void>(acquire(holed, {.starts = 2}));
          }).find("meets no void") != std::string::npos);
  }

  TEST_CASE("acquisition: among hills that repeat nothing is accepted") {
    cairn::FieldGrid hills(500, 500, {0, 0, 30, 30});  // 1885 m apart
    for (int r = 0; r < 500; ++r)
      for (int c = 0; c < 500; ++c) hills(c, r) = 50 * (std::sin(0.1 * c) + std::sin(0.1 * r));
    const AcquisitionResult result = acquire(hills, {.starts = 10, .seed = 3});
    CHECK(result.wrong_rate == 0.0);  // more than half were
    CHECK(result.rate <= 0.1);        // one in a corner of the map has no other in reach
  }

  TEST_CASE("planar flight: acquires, tracks through turns, is lost and acquires again") {
    const PlanarResult result =
        fly_planar(ground(8), {.frames = 130, .blind_from = 60, .blind_until = 85, .seed = 3});
    CHECK(result.reacquired);
    CHECK(result.frames_tracked > 85);
    CHECK(result.rms_error < 20.0);
    CHECK(result.searches >= 2);
    int inside = 0, tracked = 0;
    double coasted = 0;
    for (const PlanarPoint& point : result.points) {
      if (point.blind) coasted = std::max(coasted, point.sigma);
      if (!point.tracking) continue;
      ++tracked;
      inside += point.error < 4.0 * point.sigma ? 1 : 0;
    }
    CHECK(inside >= tracked * 95 / 100);
    CHECK(coasted > 30.0);  // blind, it says that it does not know
  }

  TEST_CASE("loop: the return corrects where the map's frames lie, and the map") {
    const LoopResult result = fly_loop(ground(6), {.seed = 4});
    CHECK(result.closed);
    CHECK(result.closing_error < 45.0);
    CHECK(result.placement_rms_after < 0.5 * result.placement_rms_before);
    CHECK(result.map_rms_after < result.map_rms_before);
    REQUIRE((result.map_error_before && result.map_error_after));
    double squares = 0, mapped = 0;
    for (const double error : result.map_error_after->values())
      if (!std::isnan(error)) {
        squares += error * error;
        mapped += 1;
      }
    CHECK(mapped > 1000);
    CHECK(mapped < 0.9 * static_cast<double>(result.map_error_after->values().size()));
    CHECK(std::sqrt(squares / mapped) == doctest::Approx(result.map_rms_after));
    cairn::FieldGrid holed = ground(6);
    for (int r = 0; r < holed.rows(); r += 40)
      for (int c = 0; c < holed.columns(); c += 40) holed(c, r) = cairn::void_value;
    const LoopResult with_holes = fly_loop(holed, {.seed = 4});
    CHECK(with_holes.field_deviation == doctest::Approx(result.field_deviation).epsilon(0.02).scale(0));
    CHECK(cairn_test::message_of([] {
            static_cast<void>(fly_loop(ground(6, 100, 100), {}));
          }).find("loop: expected a field of at least") != std::string::npos);
  }

  TEST_CASE("outputs: every figure of the summary, and nothing half-written in a bad place") {
    const cairn_test::Folder folder;
    Results results;
    results.field = "test";
    results.runs = 2;
    StraightFlight flight;
    flight.frames = 2;
    results.straight = fly_straight(flight, 2);
    results.divergence = {{0.5, 0.25, 0.0, 0.0}};
    static_cast<void>(write_outputs(results, folder / "out"));
    const auto json = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    for (const char* key : {"acquisition_rate", "rms_position_error_m", "max_position_error_m",
                            "rmse_over_crb", "nees_mean", "divergence_rate"})
      CHECK(json.contains(key));
    CHECK(json["divergence_rate"][0]["initial_error_over_correlation_length"] == 0.5);
    CHECK(json["rmse_over_crb"] == results.straight.rmse_over_bound);
    // What was not made has no figures, and what was not found no error.
    for (const char* key : {"acquisition_rate", "acquisition_rms_error_m", "planar", "loop"})
      CHECK(json[key].is_null());
    results.acquisition = AcquisitionResult{};
    results.planar = PlanarResult{};
    results.loop = LoopResult{};
    const auto none = nlohmann::json::parse(summary(results));
    CHECK(none["acquisition_rate"] == 0);
    CHECK(none["acquisition_rms_error_m"].is_null());
    CHECK(none["planar"]["rms_position_error_m"].is_null());
    CHECK(none["loop"]["closing_error_m"].is_null());
    CHECK(cairn::read_file(folder / "out" / "errors.csv").find("time,x_rms,x_sigma") == 0);
    results.straight.sigma[1][1] = std::numeric_limits<double>::quiet_NaN();
    CHECK(cairn_test::message_of([&] { static_cast<void>(errors_csv(results.straight)); }) ==
          "errors.csv: not written, V_sigma of row 2 is not finite");
    folder.put("file", "x");
    CHECK(cairn_test::message_of([&] {
            static_cast<void>(write_outputs(results, folder / "file" / "out"));
          }).find("file/out: cannot write there (Not a directory)") != std::string::npos);
  }
}

}  // namespace flights_test
