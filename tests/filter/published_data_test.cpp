// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Other people's data with other people's answers: R KFAS by way of statsmodels, and Udacity's EKF project.
#include <cmath>
#include <cstddef>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/models/linear.hpp>

#include "support/data.hpp"

namespace published_data_test {
namespace {

using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::SO2;
using cairn::Status;
using cairn::Vector;

// Appended piecewise: gcc 12 warns wrongly about "literal" + string.
std::string numbered(const char* name, int number) {
  std::string text(name);
  return text.append(std::to_string(number));
}

// Columns by name; NA is NaN.
std::map<std::string, std::vector<double>> read_csv(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line, cell;
  std::vector<std::string> names;
  std::map<std::string, std::vector<double>> columns;
  const auto unquoted = [](const std::string& text) {
    return text.size() > 1 && text.front() == '"' ? text.substr(1, text.size() - 2) : text;
  };
  std::getline(file, line);
  for (std::istringstream cells(line); std::getline(cells, cell, ',');) names.push_back(unquoted(cell));
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    for (const std::string& name : names) {
      cell.clear();
      std::getline(cells, cell, ',');
      columns[name].push_back(cell.empty() || cell == "NA" ? std::nan("") : std::stod(cell));
    }
  }
  return columns;
}

// What an exactly diffuse filter and smoother say: nothing is believed of the state before the first
// measurement, which the information form can say; once all is known the record goes on as usual.
template <int N>
struct DiffuseRun {
  std::vector<std::optional<Gaussian<Vector<N>>>> filtered;
  std::vector<Gaussian<Vector<N>>> smoothed;  // of the last moments
  double log_likelihood = 0.0;                // of the measurements after the start

  DiffuseRun(const cairn::LinearModel<N>& process, const Matrix<1, N>& design, double variance,
             const std::vector<double>& y) {
    const cairn::LinearSensor<1, N> sensor{design, Matrix<1>(variance)};
    auto start = cairn::InformationBelief<Vector<N>>::ignorant(Vector<N>::Zero());
    std::optional<cairn::Recorder<Kalman, Vector<N>>> recorder;
    for (std::size_t k = 0; k < y.size(); ++k) {
      const Vector<1> z(y[k]);
      if (!recorder) {
        if (k > 0) REQUIRE(cairn::InformationFilter{}.predict(start, process, 1.0) == Status::accepted);
        if (!std::isnan(y[k]))
          REQUIRE(cairn::InformationFilter{}.update(start, sensor, z) == Status::accepted);
        if (k + 1 >= N && start.gaussian()) recorder.emplace(Kalman{}, *start.gaussian());
      } else {
        REQUIRE(recorder->predict(process, 1.0) == Status::accepted);
        const auto innovation = recorder->update(sensor, z);
        REQUIRE(innovation.accepted());
        log_likelihood += innovation.log_likelihood();
      }
      filtered.push_back(recorder ? std::optional(recorder->belief()) : std::nullopt);
    }
    smoothed = recorder->smoothed();
  }

  // Against the columns of KFAS.
  void check(std::map<std::string, std::vector<double>>& csv, const cairn::LinearModel<N>& process,
             double from_start) const {
    const std::size_t count = filtered.size();
    for (std::size_t k = 0; k < count; ++k) {
      CAPTURE(k);
      if (!filtered[k]) continue;
      const auto& smooth = smoothed[k + smoothed.size() - count];
      for (int i = 0; i < N; ++i) {
        CHECK(filtered[k]->mean(i) == doctest::Approx(csv[numbered("att_", i + 1)][k]).epsilon(1e-11));
        CHECK(smooth.mean(i) == doctest::Approx(csv[numbered("alphahat_", i + 1)][k]).epsilon(1e-11));
      }
      const Matrix<N>& f = process.transition;
      const Matrix<N> next = f * filtered[k]->covariance * f.transpose() + process.covariance;
      if (k + 1 < count) CHECK(next.sum() == doctest::Approx(csv["sumP"][k + 1]).epsilon(1e-11));
      CHECK(smooth.covariance.sum() == doctest::Approx(csv["sumV"][k]).epsilon(1e-11));
    }
    CHECK(log_likelihood + from_start == doctest::Approx(csv["llf"][0]).epsilon(1e-12));
  }
};

const std::string folder = "filter_reference/statsmodels-statespace/";
const double nan = std::numeric_limits<double>::quiet_NaN();

TEST_SUITE("published data") {
  TEST_CASE("kalman and smoother: exactly diffuse local level and trend as in KFAS") {
    const auto level = cairn_test::real_data(folder + "results_exact_initial_local_level_R.csv");
    const auto trend = cairn_test::real_data(folder + "results_exact_initial_local_linear_trend_R.csv");
    const auto gap = cairn_test::real_data(folder + "results_exact_initial_local_linear_trend_missing_R.csv");
    if (!level || !trend || !gap) return;
    auto csv = read_csv(*level);
    const cairn::LinearModel<1> walk{Matrix<1>(1.0), Matrix<1>(8.253)};
    DiffuseRun<1>(walk, Matrix<1>(1.0), 1.993, {10.2394, 1, 1, 1, 1, 1, 1, 1, 1, 1}).check(csv, walk, 0.0);
    csv = read_csv(*trend);
    const cairn::LinearModel<2> line{(Matrix<2>() << 1, 1, 0, 1).finished(),
                                     Vector<2>(8.253, 2.334).asDiagonal()};
    const Matrix<1, 2> seen(1.0, 0.0);
    DiffuseRun<2>(line, seen, 1.993, {10.2394, 4.2039, 6.123123, 1, 1, 1, 1, 1, 1, 1}).check(csv, line, 0.0);
    csv = read_csv(*gap);
    // the slope is learnt from a step of two: log F_infinity = log 4 belongs to the diffuse likelihood
    DiffuseRun<2>(line, seen, 1.993, {10.2394, nan, 6.123123, 1, 1, 1, 1, 1, 1, 1})
        .check(csv, line, -0.5 * std::log(4.0));
  }

  // Changes of GDP, consumption and investment of the USA with long gaps in each; a vague prior of 1e6.
  TEST_CASE("kalman and smoother: three series with missing numbers as in KFAS") {
    const auto macro = cairn_test::real_data(folder + "macrodata.csv");
    const auto results = cairn_test::real_data(folder + "results_smoothing_R.csv");
    if (!macro || !results) return;
    auto data = read_csv(*macro);
    auto csv = read_csv(*results);
    const char* names[] = {"realgdp", "realcons", "realinv"};
    const cairn::LinearModel<3> walk{Matrix<3>::Identity(), Matrix<3>::Identity()};
    cairn::Recorder<Kalman, Vector<3>> recorder(Kalman{}, {Vector<3>::Zero(), 1e6 * Matrix<3>::Identity()});
    const std::size_t count = csv["a1"].size();
    REQUIRE(count == 202);
    for (std::size_t k = 0; k < count; ++k) {
      CAPTURE(k);
      for (int i = 0; i < 3; ++i) {
        if (std::isnan(csv[numbered("v", i + 1)][k])) continue;  // missing: nothing to take in
        Matrix<1, 3> design = Matrix<1, 3>::Zero();
        design(i) = 1.0;
        const auto& series = data[names[i]];
        const Vector<1> z(series[k + 1] - series[k]);
        REQUIRE(recorder.update(cairn::LinearSensor<1, 3>{design, Matrix<1>(1.0)}, z).accepted());
      }
      REQUIRE(recorder.predict(walk, 1.0) == Status::accepted);
      for (int i = 0; i < 3; ++i)
        CHECK(recorder.belief().mean(i) == doctest::Approx(csv[numbered("a", i + 1)][k]).epsilon(1e-10));
      CHECK(recorder.belief().covariance.determinant() == doctest::Approx(csv["detP"][k]).epsilon(1e-8));
    }
    const auto path = recorder.smoothed();
    for (std::size_t k = 0; k < count; ++k) {
      CAPTURE(k);
      for (int i = 0; i < 3; ++i)
        CHECK(path[k].mean(i) == doctest::Approx(csv[numbered("alphahat", i + 1)][k]).epsilon(1e-8));
      CHECK(path[k].covariance.determinant() == doctest::Approx(csv["detV"][k]).epsilon(1e-6));
    }
  }

  // Udacity's project: the accelerations' variance is 9, the noise of both sensors is given.
  struct Walker {
    using State = Vector<4>;
    using Control = cairn::NoControl;
    [[nodiscard]] Matrix<4> jacobian(const State&, const Control&, double dt) const {
      Matrix<4> f = Matrix<4>::Identity();
      f(0, 2) = f(1, 3) = dt;
      return f;
    }
    [[nodiscard]] State propagate(const State& x, const Control& u, double dt) const {
      return jacobian(x, u, dt) * x;
    }
    [[nodiscard]] Matrix<4> noise(const State&, const Control&, double dt) const {
      Matrix<4, 2> g;
      g << dt * dt / 2, 0, 0, dt * dt / 2, dt, 0, 0, dt;
      return 9.0 * g * g.transpose();
    }
  };
  struct Radar {
    using State = Vector<4>;
    using Measurement = cairn::Product<Vector<1>, SO2, Vector<1>>;
    template <class T>
    [[nodiscard]] cairn::Product<Vector<1, T>, cairn::BasicSO2<T>, Vector<1, T>> predict(
        const Vector<4, T>& x) const {
      using std::atan2;
      using std::sqrt;
      const T range = sqrt(T(x(0) * x(0) + x(1) * x(1)));
      return cairn::Product<Vector<1, T>, cairn::BasicSO2<T>, Vector<1, T>>(
          Vector<1, T>(range), cairn::BasicSO2<T>(T(atan2(x(1), x(0)))),
          Vector<1, T>(T((x(0) * x(2) + x(1) * x(3)) / range)));
    }
    [[nodiscard]] Matrix<3> noise(const State&) const { return Vector<3>(0.09, 0.0009, 0.09).asDiagonal(); }
  };
  TEST_CASE("extended: Udacity's lidar and radar walk within the project's limits") {
    const auto path =
        cairn_test::real_data("filter_reference/udacity-ekf/obj_pose-laser-radar-synthetic-input.txt");
    if (!path) return;
    std::ifstream file(*path);
    const cairn::LinearSensor<2, 4> lidar{Matrix<2, 4>::Identity(), 0.0225 * Matrix<2>::Identity()};
    Gaussian<Vector<4>> belief{Vector<4>::Zero(), Vector<4>(1, 1, 1000, 1000).asDiagonal()};
    Vector<4> squares = Vector<4>::Zero();
    double last = 0.0, lidar_nis = 0.0, radar_nis = 0.0;
    int count = 0, lidars = 0;
    std::string kind;
    while (file >> kind) {
      Vector<3> z = Vector<3>::Zero();
      for (int i = 0; i < (kind == "L" ? 2 : 3); ++i) file >> z(i);
      double stamp = 0.0;
      Vector<4> truth;
      file >> stamp >> truth(0) >> truth(1) >> truth(2) >> truth(3);
      file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
      if (count == 0) {
        belief.mean.head<2>() = z.head<2>();
      } else {
        REQUIRE(cairn::Extended{}.predict(belief, Walker{}, (stamp - last) * 1e-6) == Status::accepted);
        if (kind == "L") {
          const auto in = cairn::Extended{}.update(belief, lidar, z.head<2>());
          REQUIRE(in.accepted());
          lidar_nis += in.nis;
          ++lidars;
        } else {
          const Radar::Measurement seen(Vector<1>(z(0)), SO2(z(1)), Vector<1>(z(2)));
          const auto in = cairn::Extended{}.update(belief, cairn::automatic(Radar{}), seen);
          REQUIRE(in.accepted());
          radar_nis += in.nis;
        }
      }
      last = stamp;
      squares += (belief.mean - truth).cwiseAbs2();
      ++count;
    }
    REQUIRE(count == 500);
    const Vector<4> rmse = (squares / count).cwiseSqrt();
    MESSAGE("rmse ", rmse(0), " ", rmse(1), " ", rmse(2), " ", rmse(3), ", mean NIS of lidar ",
            lidar_nis / lidars, ", of radar ", radar_nis / (count - 1 - lidars));
    CHECK(rmse(0) <= 0.11);
    CHECK(rmse(1) <= 0.11);
    CHECK(rmse(2) <= 0.52);
    CHECK(rmse(3) <= 0.52);
  }
}

}  // namespace
}  // namespace published_data_test
