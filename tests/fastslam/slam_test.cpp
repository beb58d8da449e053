// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The example's logs, runs and batch estimate.
#include "slam.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/gaussian.hpp>

#include "batch.hpp"
#include "ekf_slam.hpp"
#include "scores.hpp"
#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/matlab_file.hpp"
#include "support/random.hpp"

namespace fastslam_test {
namespace {

using namespace fastslam;
using cairn::Matrix;
using cairn::SE2;
using cairn::Vector;

/// What reading throws, or nothing.
template <class Read>
std::string complaint(const Read& read) {
  try {
    static_cast<void>(read());
  } catch (const cairn::Error& error) {
    return error.what();
  }
  return "";
}

void put_robot(const cairn_test::Folder& folder, const std::string& odometry, const std::string& sightings) {
  folder.put("Robot1_Odometry.dat", odometry);
  folder.put("Robot1_Measurement.dat", sightings);
  folder.put("Robot1_Groundtruth.dat", "# truth\n0 1 2 0\n10 2 2 0\n");
  folder.put("Barcodes.dat", "6 63\n2 14\n");
  folder.put("Landmark_Groundtruth.dat", "6 1 1 0 0\n");
}

std::vector<SE2> frame_poses(const LandmarkLog& log, const std::vector<cairn::StampedPose2>& path) {
  std::vector<SE2> poses;
  for (const auto& p : path)
    if (poses.size() < log.frames.size() && p.time == log.frames[poses.size()].time) poses.push_back(p.pose);
  return poses;
}

}  // namespace

TEST_SUITE("fastslam/slam") {
  TEST_CASE("fastslam: both proposals map the simulated loop far better than odometry, named or not") {
    for (const bool known : {true, false})
      for (const ProposalKind kind : {ProposalKind::motion, ProposalKind::landmarks}) {
        LandmarkLog log = simulated(loop_map(), 2, 400);
        if (!known) log.withhold_identities();
        const Results r = run(log, {.particles = 60, .seed = 3, .proposal = kind});
        CAPTURE(known);
        MESSAGE("path ", *r.path_error, " m, odometry ", *r.odometry_error, " m, ", r.landmarks.size(),
                " landmarks");
        CHECK(*r.path_error < 0.5 * *r.odometry_error);
        CHECK(*r.path_error < 0.4);
        CHECK(r.landmarks.size() <= 52);
        CHECK(r.landmarks.size() >= 40);
        REQUIRE(r.landmark_error.has_value());
        CHECK(*r.landmark_error < 0.4);
      }
  }

  TEST_CASE("fastslam: a map without names is measured to the nearest true landmarks, a ghost too") {
    cairn::Random random(5);
    for (int run = 0; run < 20; ++run) {
      Results r{.identities_known = false};
      const SE2 frame(cairn::SO2(random.uniform(-3, 3)), Vector<2>(random.uniform(-50, 50), 7));
      for (std::uint32_t i = 0; i < 30; ++i) {
        r.true_landmarks.emplace_back(random.uniform(0, 60), random.uniform(0, 40));
        // too little to be of a neighbour, turned by nothing
        const Vector<2> off(i % 2 == 0 ? 0.02 : -0.02, 0);
        r.landmarks.push_back(
            {i, {Vector<2>(frame * (r.true_landmarks.back() + off)), Matrix<2>::Identity()}, 10 + i, 0});
      }
      // what is of nothing counts as what it is, and pulls at nothing
      const Vector<2> ghost(30, -20);
      double nearest = 1e9;
      for (const Vector<2>& t : r.true_landmarks) nearest = std::min(nearest, (t - ghost).norm());
      r.landmarks.push_back({30, {Vector<2>(frame * ghost), Matrix<2>::Identity()}, 3, 0});
      const double sum = 30 * 0.02 * 0.02 + nearest * nearest;
      measure(r, LandmarkLog{});
      REQUIRE(r.landmark_error.has_value());
      CHECK(*r.landmark_error == doctest::Approx(std::sqrt(sum / 31)).epsilon(0.01).scale(0));
      r.landmarks.pop_back();
      measure(r, LandmarkLog{});
      CHECK(*r.landmark_error == doctest::Approx(0.02).epsilon(0.1).scale(0));
    }
    Results none{.identities_known = false};
    measure(none, LandmarkLog{});
    CHECK_FALSE(none.landmark_error.has_value());
  }

  TEST_CASE("fastslam: the batch estimate is where every slope is zero, and no worse than the truth") {
    const LandmarkLog log = simulated(loop_map(), 4, 120);
    const SE2 begin = log.truth.front().pose * log.frames.front().moved.mean.inverse();
    std::vector<SE2> start, truth;
    for (std::size_t k = 0; k < log.frames.size(); ++k) {
      start.push_back(k == 0 ? log.frames[0].moved.mean : start.back() * log.frames[k].moved.mean);
      truth.push_back(begin.inverse() * log.truth[k].pose);
    }
    const BatchOptimum best = batch_optimum(log, start);
    CHECK(best.converged);
    const BatchOptimum again = batch_optimum(log, truth);
    CHECK(again.cost == doctest::Approx(best.cost).epsilon(1e-6));
    CHECK(growing_batch_optimum(log, 25).cost == doctest::Approx(best.cost).epsilon(1e-6));
    // twice the cost is chi-square of numbers seen and moved, less those estimated
    double numbers = 0;
    for (const Frame& frame : log.frames) numbers += 2.0 * static_cast<double>(frame.seen.size());
    numbers -= 2.0 * static_cast<double>(best.landmarks.size());
    CHECK(2 * best.cost == doctest::Approx(numbers).epsilon(6 * std::sqrt(2 / numbers)));
    // FastSLAM's mean is near it, and less likely
    const Results r = run(log, {.particles = 50, .seed = 2});
    const std::vector<SE2> path = frame_poses(log, r.mean);
    REQUIRE(path.size() == best.poses.size());
    double sum = 0;
    for (std::size_t k = 0; k < path.size(); ++k)
      sum += (path[k].translation() - best.poses[k].translation()).squaredNorm();
    CHECK(std::sqrt(sum / static_cast<double>(path.size())) < 0.3);
    CHECK_THROWS_AS(static_cast<void>(batch_optimum(log, {})), cairn::Error);
  }

  TEST_CASE("fastslam: paths drawn about the optimum are spread as their density says") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const LandmarkLog log = simulated(loop_map(), seed, 60);
    const PathDensity density(log, growing_batch_optimum(log));
    const double highest = density.log_density(density.optimum().poses);
    cairn::Random random(seed);
    constexpr int draws = 200;
    double squared = 0;
    for (int i = 0; i < draws; ++i)
      squared += 2 * (highest - density.log_density(density.draw(random))) / draws;
    // landmarks are drawn with the poses, and integrated out of the density
    CHECK(cairn::chi_square_mean_band(3.0 * 60, draws, 0.999).contains(squared));
  }

  TEST_CASE("fastslam: the density at the optimum is that of a Gaussian with the covariance of its draws") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    constexpr int frames = 4, draws = 20000;
    const LandmarkLog log = simulated(loop_map(), seed, frames);
    const PathDensity density(log, growing_batch_optimum(log));
    cairn::Random random(seed);
    Eigen::MatrixXd steps(3 * frames, draws);  // what the motions are off odometry
    for (int i = 0; i < draws; ++i) {
      const std::vector<SE2> path = density.draw(random);
      for (int k = 0; k < frames; ++k) {
        const auto frame = static_cast<std::size_t>(k);
        const SE2 before = k == 0 ? SE2() : path[frame - 1];
        steps.col(i).segment<3>(3 * k) = cairn::local(before * log.frames[frame].moved.mean, path[frame]);
      }
    }
    steps.colwise() -= steps.rowwise().mean().eval();
    const Eigen::MatrixXd covariance = steps * steps.transpose() / draws;
    const double log_determinant = covariance.ldlt().vectorD().array().log().sum();
    // of 12 numbers the logarithm of a sample's determinant is spread by sqrt(2 * 12 / draws)
    CHECK(2 * density.log_density(density.optimum().poses) ==
          doctest::Approx(-log_determinant).epsilon(0.25 / std::abs(log_determinant)));
  }

  TEST_CASE("fastslam: paths drawn again come nearer to the optimum than those that never go back") {
    double drawn_again = 0, never = 0;
    cairn::RunningMoments nees;
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const LandmarkLog log = simulated(loop_map(), seed, 200);
      const std::vector<SE2> optimum = growing_batch_optimum(log).poses;
      for (const double below : {0.5, 0.0}) {
        const Results r = run(log, {.particles = 20, .seed = seed, .redraw_below = below});
        const std::vector<SE2> path = frame_poses(log, r.mean);
        for (std::size_t k = 0; k < path.size(); ++k)
          (below > 0 ? drawn_again : never) +=
              (path[k].translation() - optimum[k].translation()).squaredNorm();
        for (const StepRecord& step : r.steps)
          if (step.redrawn) nees.add(*step.nees);
      }
    }
    MESSAGE("sums of squares ", drawn_again, ", ", never, "; NEES ", nees.mean());
    CHECK(drawn_again < 0.5 * never);
    CHECK(cairn::chi_square_mean_band(3, 5, 0.999).contains(nees.mean()));
  }

  TEST_CASE("fastslam: millimetres of slip bend no path that is drawn about places known to decimetres") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    LandmarkLog log = simulated(loop_map(), seed, 400);
    for (Frame& frame : log.frames) frame.moved.covariance(1, 1) = std::pow(1e-3, 2);
    const PathDensity density(log, growing_batch_optimum(log));
    cairn::Random random(seed);
    double across = 0;  // of the motions' residuals
    constexpr int draws = 10;
    for (int i = 0; i < draws; ++i) {
      const std::vector<SE2> path = density.draw(random);
      for (std::size_t k = 1; k < path.size(); ++k)
        across += std::pow(cairn::local(path[k - 1] * log.frames[k].moved.mean, path[k])(1), 2);
    }
    across = std::sqrt(across / (draws * static_cast<double>(log.frames.size())));
    MESSAGE("across ", across, " m");
    CHECK(across < 1.5e-3);
  }

  TEST_CASE("fastslam: paths drawn again leave most of their weights, and a spread that the truth is in") {
    constexpr std::uint64_t runs = 8;
    cairn::RunningMoments nees;
    for (std::uint64_t seed = 1; seed <= runs; ++seed) {
      const LandmarkLog log = simulated(loop_map(), seed, 300);
      const Results r = run(log, {.particles = 60, .seed = seed});
      std::size_t redrawn = 0;
      for (const StepRecord& step : r.steps) {
        if (!step.redrawn) continue;
        ++redrawn;
        CHECK(*step.redrawn >= 0.5 * 60 - 1e-9);
        nees.add(*step.nees);
      }
      CHECK(redrawn >= 8);
      CHECK(redrawn <= 40);  // an eighth of the frames apart
      CHECK(r.steps.back().redrawn.has_value());
    }
    MESSAGE("NEES ", nees.mean());
    CHECK(nees.mean() > 2);
    CHECK(nees.mean() < 4.5);
  }

  TEST_CASE("fastslam: twenty particles do not grow sure of the pose as their ancestors die out") {
    // The truth is known; a median of chi^2 of 3 is 2.37, of twenty draws' t^2 a little more or less.
    constexpr std::uint64_t runs = 8;
    std::vector<double> all, late;
    for (std::uint64_t seed = 1; seed <= runs; ++seed) {
      const Results r = run(simulated(loop_map(), seed, 400), {.particles = 20, .seed = seed});
      std::size_t since = 0;
      for (const StepRecord& step : r.steps) {
        since = step.redrawn ? 0 : since + 1;
        all.push_back(*step.nees);
        if (since > 25) late.push_back(*step.nees);
      }
    }
    const auto median = [](std::vector<double>& values) {
      const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
      std::nth_element(values.begin(), middle, values.end());
      return *middle;
    };
    REQUIRE(late.size() > 200);
    MESSAGE("NEES, medians: ", median(all), "; more than 25 frames after a drawing ", median(late));
    for (std::vector<double>* nees : {&all, &late}) {
      CHECK(median(*nees) > 1);
      CHECK(median(*nees) < 4);
    }
  }

  std::size_t doubted_in(const LandmarkLog& log) {
    std::size_t count = 0;
    for (const Frame& frame : log.frames)
      for (const auto& sighting : frame.seen) count += !sighting.identity;
    return count;
  }

  TEST_CASE(
      "fastslam: names that all else contradicts are found, those and no others, and do not bend the path") {
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      CAPTURE(seed);
      const LandmarkLog clean = simulated(loop_map(), seed, 300);
      LandmarkLog log = clean;
      std::size_t wrong = 0;
      for (const std::size_t first : {60U, 61U, 62U, 150U, 222U}) {
        Frame& frame = log.frames[first];
        REQUIRE(!frame.seen.empty());
        // That of the landmark farthest from what is seen.
        const SE2& at = clean.truth[first].pose;
        const Vector<2> seen = at * Vector<2>(log.sensor.initialise(SE2(), frame.seen[0].z));
        const auto farthest = std::ranges::max_element(
            log.landmarks, {}, [&](const auto& landmark) { return (landmark.second - seen).norm(); });
        frame.seen[0].identity = farthest->first;
        ++wrong;
      }
      LandmarkLog believed = log;
      const std::vector<SE2> path = growing_batch_optimum(clean).poses;
      static_cast<void>(doubting_batch_optimum(believed, path));
      // From a start that what was read wrongly has bent there is a way only by what was settled before.
      constexpr std::size_t settled = 60;
      std::vector<SE2> bent = path;
      for (std::size_t k = settled; k < path.size(); ++k)
        bent[k] = path[settled] * SE2(cairn::SO2(2.5), Vector<2>(3, 0)) * path[settled].inverse() * path[k];
      LandmarkLog grown = log;
      const std::vector<SE2> found = doubting_batch_optimum(grown, bent, settled).poses;
      for (std::size_t k = 0; k < path.size(); ++k)
        CHECK((found[k].translation() - path[k].translation()).norm() < 0.05);
      CHECK(doubted_in(grown) == wrong);
      LandmarkLog begun_bent = log;
      static_cast<void>(doubting_batch_optimum(begun_bent, bent));
      CHECK(doubted_in(begun_bent) > 100);
      for (std::size_t k = 0; k < log.frames.size(); ++k)
        for (std::size_t i = 0; i < log.frames[k].seen.size(); ++i)
          CHECK(believed.frames[k].seen[i].identity.has_value() ==
                (log.frames[k].seen[i].identity == clean.frames[k].seen[i].identity));
      LandmarkLog as_it_was = clean;
      const BatchOptimum optimum = doubting_batch_optimum(as_it_was, growing_batch_optimum(clean).poses);
      CHECK(optimum.cost == doctest::Approx(growing_batch_optimum(clean).cost));
      for (const Frame& frame : as_it_was.frames)
        for (const auto& sighting : frame.seen) CHECK(sighting.identity.has_value());

      const Results r = run(log, {.particles = 20, .seed = seed}),
                    right = run(clean, {.particles = 20, .seed = seed});
      MESSAGE("path ", *r.path_error, " m, with right names ", *right.path_error, " m");
      CHECK(*r.path_error < 1.5 * *right.path_error + 0.02);
      REQUIRE(r.notes.size() == right.notes.size() + 1);
      CHECK(r.notes.back() == std::to_string(wrong) + " sightings are not of what the name says: left out");
    }
  }

  TEST_CASE("fastslam: by the default the spread of a hundred particles holds the truth as EKF-SLAM's does") {
    constexpr std::size_t runs = 20, frames = 100;
    std::vector<double> particles(frames, 0), never(frames, 0), joint(frames, 0);
    for (std::uint64_t seed = 1; seed <= runs; ++seed) {
      const LandmarkLog log = simulated(loop_map(), seed, frames);
      const Results r = run(log, {.particles = 100, .seed = seed});
      const Results published = run(log, {.particles = 100, .seed = seed, .redraw_below = 0});
      const EkfSlamRun ekf = ekf_slam(log);
      for (std::size_t k = 0; k < frames; ++k) {
        particles[k] += *r.steps[k].nees / runs;
        never[k] += *published.steps[k].nees / runs;
        joint[k] += cairn::nees(ekf.poses[k], log.start->inverse() * log.truth[k].pose) / runs;
      }
    }
    const auto inside = [](const std::vector<double>& nees) {
      const auto band = cairn::chi_square_mean_band(3, runs, 0.99);
      return std::count_if(nees.begin(), nees.end(), [&](double v) { return band.contains(v); });
    };
    MESSAGE("steps in the band: FastSLAM ", inside(particles), ", never drawn again ", inside(never),
            ", EKF-SLAM ", inside(joint));
    CHECK(inside(particles) >= 90);
    CHECK(inside(joint) >= 90);
    CHECK(inside(never) < inside(particles));
  }

  TEST_CASE("fastslam: the log of a robot is read, and what belongs to nothing is said") {
    const cairn_test::Folder folder;
    put_robot(folder, "# odometry\r\n0 1 0\r\n1 1 0\r\n2 1 0\r\n3 0 0\r\n",
              "1.5 63 2 0.1\n1.5 14 1 0\n2.5 99 1 0\n2.5 63 1 0.2\n");
    const LandmarkLog log = read_mrclam(folder / "", 1);
    REQUIRE(log.frames.size() == 2);
    CHECK(log.frames[0].time == 1.5);
    CHECK(log.frames[0].moved.mean.x() == doctest::Approx(1.5));
    REQUIRE(log.frames[0].seen.size() == 1);  // the other is a robot
    CHECK(log.frames[0].seen[0].identity == 6);
    CHECK(log.frames[1].moved.mean.x() == doctest::Approx(1.0));
    CHECK(log.between.size() == 2);
    CHECK(log.between[0].moved.x() == doctest::Approx(0.5));
    REQUIRE(log.notes.size() == 1);
    CHECK(log.notes[0].find("99") != std::string::npos);
    const Results r = run(log, {.particles = 3});
    CHECK(r.mean.size() == 4);
  }

  TEST_CASE(
      "fastslam: a log that is cut short ends with its last frame, and one particle has no endless NEES") {
    LandmarkLog log = simulated(loop_map(), 1, 40);
    for (const std::size_t frame : {3U, 8U, 9U, 20U}) {
      log.between.push_back({log.frames[frame].time + 0.1, frame, SE2(0.01, 0, 0)});
      log.gps.push_back({log.frames[frame].time, Vector<2>(static_cast<double>(frame), 0)});
    }
    log.keep_first(100);
    REQUIRE(log.frames.size() == 40);
    REQUIRE(log.between.size() == 4);
    log.keep_first(10);
    REQUIRE(log.frames.size() == 10);
    CHECK(log.between.size() == 2);
    const Results r = run(log, {.particles = 1});
    CHECK(r.mean.size() == 12);
    for (const StepRecord& step : r.steps) CHECK((!step.nees || std::isfinite(*step.nees)));
    CHECK_FALSE(r.gps_median.has_value());  // three fixes are no path; the fourth is of later
    CHECK(run(log, {.particles = 5}).median_nees.has_value());
  }

  TEST_CASE("fastslam: what a robot saw before its odometry begins or after it ends is left out, and said") {
    // At the very start the robot has not moved: there is nothing to draw.
    const cairn_test::Folder folder;
    put_robot(folder, "1 1 0\n2 1 0\n3 0 0\n", "0.5 63 2 0.1\n1 63 2 0\n2.5 63 2 0.1\n3.5 63 1 0\n");
    const LandmarkLog log = read_mrclam(folder / "", 1);
    REQUIRE(log.frames.size() == 1);
    CHECK(log.frames[0].time == 2.5);
    REQUIRE(log.notes.size() == 1);
    CHECK(log.notes[0] == "sightings before odometry begins or after it ends, left out: 3");
    CHECK(run(log, {.particles = 3}).steps.size() == 1);
  }

  TEST_CASE("fastslam: a landmark that codes read wrongly have put on the robot leaves the log its numbers") {
    // As set 2's robots 2 and 3 and set 9's robot 1 have it, where nothing is left of the poses' information.
    LandmarkLog log{.sensor = {.range_sigma = 0.5, .bearing_sigma = 0.05}};
    const cairn::Matrix<3> noise = Vector<3>(1e-6, 1e-6, 1e-6).asDiagonal();
    std::vector<SE2> start;
    for (int k = 0; k < 8; ++k) {
      Frame& frame = log.frames.emplace_back();
      frame.time = k;
      frame.moved = {SE2(cairn::SO2(), Vector<2>(0.001, 0)), noise};
      frame.seen.push_back({cairn::RangeBearing::measurement(1, k % 2 == 0 ? 1.5 : -1.6), 6});
      frame.seen.push_back({cairn::RangeBearing::measurement(2, 0.3), 7});
      start.emplace_back(cairn::SO2(), Vector<2>(0.001 * (k + 1), 0));
    }
    BatchOptimum optimum = batch_optimum(log, start);
    optimum.landmarks.at(6) = optimum.poses[3].translation() + Vector<2>(0, 1e-11);
    const PathDensity density(log, optimum);
    CHECK(std::isfinite(density.log_density(optimum.poses)));
  }

  TEST_CASE(
      "fastslam: lines that go back in time are put in order, a robot that nobody watched has no truth") {
    const cairn_test::Folder folder;
    put_robot(folder, "1 1 0\n0 2 0\n2 1 0\n3 0 0\n", "2.5 63 1 0\n1.5 63 2 0\n");
    std::filesystem::remove(folder / "Robot1_Groundtruth.dat");
    const LandmarkLog log = read_mrclam(folder / "", 1);
    REQUIRE(log.frames.size() == 2);
    CHECK(log.frames[0].time == 1.5);
    CHECK(log.frames[0].moved.mean.x() == doctest::Approx(2.5));
    CHECK(log.frames[1].moved.mean.x() == doctest::Approx(1.0));
    CHECK(log.truth.empty());
    REQUIRE(log.notes.size() == 3);
    CHECK(log.notes[0] == "Robot1_Odometry.dat: the time goes back 1 time, lines are taken in its order");
    CHECK(log.notes[1].find("Robot1_Measurement.dat") == 0);
    CHECK(log.notes[2] == "no Robot1_Groundtruth.dat: nobody knows how wrong the path is");
    const Results r = run(log, {.particles = 3});
    CHECK(r.mean.size() == 4);
    CHECK_FALSE(r.path_error.has_value());
  }

  TEST_CASE(
      "fastslam: what wheels make of time, of turns on the way and of turns on the spot is found by "
      "bearings") {
    // It looks to and fro, now on its way and now on the spot; what turns it is known in closed form.
    const auto heading = [](double t) { return 0.6 * std::sin(1.3 * t) + 0.3 * std::sin(2.9 * t + 1); };
    const auto rate = [](double t) {
      return 0.6 * 1.3 * std::cos(1.3 * t) + 0.3 * 2.9 * std::cos(2.9 * t + 1);
    };
    const auto goes = [](double t) { return std::fmod(t, 12) < 6; };
    const auto line = [](std::initializer_list<double> numbers) {
      std::string text;
      for (const double n : numbers) text += std::to_string(n) + " ";
      return text + "\n";
    };
    struct Wheels {
      double late, turn, turn_on_the_spot;
    };
    const Vector<2> landmark(12, 2);
    cairn::Random random(1);
    for (const Wheels& wheels :
         {Wheels{0.23, 1, 1}, {-0.1, 1, 1}, {0, 1, 1}, {0.25, 0.92, 0.8}, {0.1, 0.61, 1.02}}) {
      CAPTURE(wheels.late);
      CAPTURE(wheels.turn);
      const cairn_test::Folder folder;
      std::string odometry, sightings;
      for (int i = 0; i <= 6000; ++i) {
        const double t = 0.02 * i;
        odometry += line(
            {t, goes(t) ? 0.1 : 0.0, rate(t + 0.01) / (goes(t) ? wheels.turn : wheels.turn_on_the_spot)});
      }
      Vector<2> place = Vector<2>::Zero();
      constexpr int every = 250;  // milliseconds
      for (int ms = -1000; ms < 118000; ++ms) {
        const double t = 0.001 * ms - wheels.late;
        if (goes(t + 12)) place += 0.0001 * Vector<2>(std::cos(heading(t)), std::sin(heading(t)));
        if (ms < 1000 || ms % every != 0) continue;
        const Vector<2> seen = landmark - place;
        sightings += line({0.001 * ms, 63, seen.norm(),
                           std::atan2(seen(1), seen(0)) - heading(t) + random.normal(0, 0.01)});
      }
      put_robot(folder, odometry, sightings);
      const LandmarkLog log = read_mrclam(folder / "", 1);
      REQUIRE(log.frames.size() == 468);
      double worst = 0;
      for (std::size_t k = 1; k < log.frames.size(); ++k) {
        const double turned =
            heading(log.frames[k].time - wheels.late) - heading(log.frames[k - 1].time - wheels.late);
        worst = std::max(worst, std::abs(log.frames[k].moved.mean.rotation().angle() - turned));
      }
      CHECK(worst < 0.04);  // where it would be a quarter of a radian
      std::string notes;
      for (const std::string& note : log.notes) notes += note + "\n";
      const auto says = [&](const std::string& text) { return notes.find(text) != std::string::npos; };
      CHECK((wheels.late == 0 || says("s later than odometry")));
      CHECK((wheels.turn == 1 || says("times as far as odometry")));
      CHECK((wheels.turn_on_the_spot == 1 || says("times as far on the spot as odometry")));
    }
  }

  TEST_CASE("fastslam: bad logs are refused in words that name file and line") {
    const cairn_test::Folder folder;
    const auto robot = [&] { return read_mrclam(folder / "", 1); };
    put_robot(folder, "", "1.5 63 2 0.1\n");
    CHECK(complaint(robot).find("odometry") != std::string::npos);
    put_robot(folder, "0 1 0\n2 1 0\n", "1.5 63 2 nan\n");
    CHECK(complaint(robot).find("Robot1_Measurement.dat:1") != std::string::npos);
    put_robot(folder, "0 1 0\n2 1\n", "1.5 63 2 0\n");
    CHECK(complaint(robot).find("Robot1_Odometry.dat:2") != std::string::npos);
    for (const std::string fast : {"1e308 0", "0 -1e308", "1001 0"}) {
      put_robot(folder, "0 1 0\n2 " + fast + "\n", "1.5 63 2 0\n");
      CHECK(complaint(robot).find("Robot1_Odometry.dat:2: expected a speed of at most 1000") !=
            std::string::npos);
    }
    put_robot(folder, "0 1 0\n2 1 0\n", "1.5 99 2 0\n");
    CHECK(complaint(robot).find("saw no landmark") != std::string::npos);
    CHECK(complaint([&] { return read_mrclam(folder / "none", 1); }) != "");
    put_robot(folder, "0 1 0\n2 1 0\n", "1.5 1e300 2 0\n");
    CHECK(complaint(robot).find("Robot1_Measurement.dat:1: expected a whole number") != std::string::npos);
    put_robot(folder, "0 1 0\n2 1 0\n", "1.5 6.5 2 0\n");
    CHECK(complaint(robot).find("column 2") != std::string::npos);
    for (const std::string distance : {"-2", "0"}) {  // at zero there is no bearing
      put_robot(folder, "0 1 0\n2 1 0\n", "1.5 63 " + distance + " 0\n");
      CHECK(complaint(robot).find("Robot1_Measurement.dat:1: expected a distance above zero") !=
            std::string::npos);
    }
    put_robot(folder, "1 1 0\n2 1 0\n", "1 63 2 0\n5 63 2 0\n");
    CHECK(complaint(robot).find("while odometry was kept") != std::string::npos);
    put_robot(folder, "0 1 0\n2 1 0\n", "1.5 63 2 0\n");
    folder.put("Barcodes.dat", "-6 63\n");
    CHECK(complaint(robot).find("Barcodes.dat:1") != std::string::npos);

    const auto graph = [&](const std::string& text) {
      folder.put("graph.txt", text);
      return complaint([&] { return read_graph(folder / "graph.txt"); });
    };
    const std::string move = "ODOMETRY 0 1 1 0 0 0.1 0 0 0.1 0 0.1\n";
    CHECK(graph(move + "LANDMARK 1 2 3 4 0.4 0 0.4\n") == "");
    CHECK(graph("").find("odometry") != std::string::npos);
    CHECK(graph(move).find("sightings") != std::string::npos);
    CHECK(graph("LANDMARK 1 2 3 4 0.4 0 0.4\n").find(":1") != std::string::npos);
    CHECK(graph(move + "LANDMARK 7 2 3 4 0.4 0 0.4\n").find("newest pose") != std::string::npos);
    CHECK(graph(move + "LANDMARK 1 2 nan 4 0.4 0 0.4\n").find("finite") != std::string::npos);
    CHECK(graph(move + "LANDMARK 1 4294967295 3 4 0.4 0 0.4\n").find("2^24") != std::string::npos);
    CHECK(graph(move + "LANDMARK 1 2 3 4 0.4 0.1 0.4\n").find("covariance") != std::string::npos);
    CHECK(graph(move + "LANDMARK 1 2 0 0 0.4 0 0.4\n").find(":2: expected a landmark apart from the robot") !=
          std::string::npos);
    CHECK(graph("ODOMETRY 0 1 1 0 0 0.1 0 0 0 0 0.1\n").find("every direction") != std::string::npos);
    CHECK(graph("ODOMETRY 0 1 1e308 0 0 0.1 0 0 0.1 0 0.1\nODOMETRY 1 2 1e308 0 0 0.1 0 0 0.1 0 0.1\n")
              .find(":2: expected motions that remain finite") != std::string::npos);
    CHECK(graph("VERTEX 0\n").find("ODOMETRY or LANDMARK") != std::string::npos);

    const auto map = [&](const std::string& text) {
      folder.put("map.mat", text);
      return complaint([&] { return read_point_map(folder / "map.mat"); });
    };
    CHECK(map("lm 2 1\n1 2\n\nwp 2 2\n0 0\n1 1\n") == "");
    CHECK(map("").find("the file ends before") != std::string::npos);
    CHECK(map("lm 2 0\nwp 2 1\n0 0\n").find(":1: expected 'lm 2 COUNT' with at least one") !=
          std::string::npos);
    CHECK(map("lm 2 3\n1 2\n") != "");
    CHECK(map("lm 2 1\n1 inf\nwp 2 1\n0 0\n").find(":2") != std::string::npos);
    CHECK(map("lm 2 1\n1 2\nwp 2 1\n0 0\n").find(":4: expected a way of at least two points") !=
          std::string::npos);
  }

  TEST_CASE(
      "fastslam: fixes by satellites find their place on the path, and their jumps are left out of the fit") {
    const cairn_test::Folder folder;
    // A way of 12 m around a corner, a pose a metre; the wheels take 2 s for each, and stand for 10 s on the
    // way.
    LandmarkLog log;
    std::vector<double> time{0}, speed;
    for (int k = 1; k <= 12; ++k) {
      log.frames.push_back(
          {1.0 * k,
           {SE2(1, 0, k == 6 ? 1.5 : 0.0), cairn::Matrix<3>(1e-12 * cairn::Matrix<3>::Identity())},
           {}});
      speed.push_back(0.5);
      time.push_back(time.back() + 2);
      if (k != 4) continue;
      speed.push_back(0);
      time.push_back(time.back() + 10);
    }
    speed.push_back(0.5);
    const SE2 T_gps_world(300, -40, 2.2);
    std::vector<double> fix_time, east, north;
    SE2 pose;
    for (std::size_t k = 0; k < log.frames.size(); ++k) {
      pose = pose * log.frames[k].moved.mean;
      const Vector<2> at = T_gps_world * pose.translation();
      const bool jumps = k == 2 || k == 9;
      fix_time.push_back(k < 4 ? 2.0 * static_cast<double>(k + 1) : 10 + 2.0 * static_cast<double>(k + 1));
      east.push_back(at(0) + (jumps ? 25 : 0));
      north.push_back(at(1));
    }
    const auto fixes = [&] {
      return cairn_test::matlab_file({{"timeGps", fix_time}, {"Lo_m", east}, {"La_m", north}});
    };
    folder.put("gps.mat", fixes());
    folder.put("wheels.mat", cairn_test::matlab_file({{"time", time}, {"speed", speed}}));
    read_gps(log, folder / "gps.mat", folder / "wheels.mat");
    REQUIRE(log.gps.size() == 12);
    for (std::size_t k = 0; k < 12; ++k) CHECK(log.gps[k].time == static_cast<double>(k + 1));

    const Results mapped = run(log, {.particles = 2});
    REQUIRE(mapped.gps.size() == 12);
    CHECK(*mapped.gps_median < 1e-3);
    for (std::size_t k = 0; k < 12; ++k) {
      const double off = (mapped.gps[k] - mapped.mean[k].pose.translation()).norm();
      CHECK((k == 2 || k == 9 ? off > 20 : off < 0.05));
    }

    const auto refused = [&](const std::string& gps, const std::string& wheels) {
      folder.put("gps.mat", gps);
      folder.put("wheels.mat", wheels);
      return complaint([&] { read_gps(log, folder / "gps.mat", folder / "wheels.mat"); });
    };
    const std::string wheels = cairn_test::matlab_file({{"time", time}, {"speed", speed}});
    CHECK(refused("", wheels).find("gps.mat: expected a MATLAB file of level 5") != std::string::npos);
    CHECK(refused(fixes().substr(0, fixes().size() - 8), wheels).find("elements that end") !=
          std::string::npos);
    CHECK(refused(cairn_test::matlab_file({{"timeGps", {1}}, {"Lo_m", {1}}}), wheels).find("an array La_m") !=
          std::string::npos);
    CHECK(refused(fixes(), cairn_test::matlab_file({{"time", {2, 1}}, {"speed", {1, 1}}}))
              .find("do not fall") != std::string::npos);
    CHECK(
        refused(fixes(), cairn_test::matlab_file({{"time", {1, 2}}, {"speed", {0, 0}}})).find("that turn") !=
        std::string::npos);
    CHECK(refused(fixes(), cairn_test::matlab_file({{"time", {1, 2}}, {"speed", {NAN, 0}}})).find("finite") !=
          std::string::npos);
  }

  TEST_CASE("fastslam: landmarks that are seen from one side only are not another when they are seen again") {
    // A landmark is reported from where it faces, as a robot's bar codes: two fifths of what is in view, and
    // misses come by the dozen. Two laps.
    for (const std::uint64_t seed : {1U, 2U}) {
      CAPTURE(seed);
      LandmarkLog log = simulated(loop_map(), seed, 700);
      log.sensor.detection = 0.25;
      for (std::size_t k = 0; k < log.frames.size(); ++k)
        std::erase_if(log.frames[k].seen, [&](const auto& sighting) {
          const Vector<2> back = log.truth[k].pose.translation() - log.landmarks.at(*sighting.identity);
          const double facing = 2.4 * static_cast<double>(*sighting.identity);  // spread over the circle
          return std::abs(cairn::SO2(std::atan2(back(1), back(0)) - facing).angle()) > 1.2;
        });
      std::set<std::uint32_t> seen;
      for (const Frame& frame : log.frames)
        for (const auto& sighting : frame.seen) seen.insert(*sighting.identity);
      log.withhold_identities();
      const Results r = run(log, {.particles = 60, .seed = seed});
      const std::size_t begun = r.landmarks.back().number + std::size_t{1};
      MESSAGE("path ", *r.path_error, " m, ", begun, " landmarks begun, of ", seen.size());
      CHECK(begun >= seen.size());
      CHECK(begun <= seen.size() + 5);
      CHECK(*r.path_error < 0.2);
    }
  }

  TEST_CASE("fastslam: robots in a hall, their landmarks unknown but for who they are") {
    const auto folder = cairn_test::real_data("mrclam_7");
    if (!folder) return;
    for (const int robot : {1, 2, 3}) {
      const Results r = run(read_mrclam(*folder, robot), {.particles = 20, .seed = 1});
      MESSAGE("robot ", robot, ": path ", *r.path_error, " m, landmarks ", *r.landmark_error, " m");
      CHECK(*r.path_error < 0.4);
      CHECK(*r.landmark_error < 0.3);
      CHECK(*r.odometry_error > 0.7);
    }
  }
}

}  // namespace fastslam_test
