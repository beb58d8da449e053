// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The "Starry Night" set of T. Barfoot ("State Estimation for Robotics", course AER1513 at Toronto): a stereo
// camera and a gyroscope carried over 20 landmarks, truth by Vicon, noise variances given.
#include <cmath>
#include <cstddef>
#include <string>
#include <type_traits>

#include <doctest/doctest.h>

#include <cairn/core/statistics.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/manifold/se3.hpp>

#ifdef EXAMPLES_HAVE_ZLIB
#include "support/data.hpp"
#include "support/mat_file.hpp"

namespace starry_night_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::SE3;
using cairn::SO3;
using cairn::Status;
using cairn::Vector;

// T_world_vehicle moved by measured velocities (v, w) of the vehicle, held until the next reading: for 0.05 s
// mostly, but for up to 0.6 s, in which a hand changes them by about 1 m/s^2 and 4 rad/s^2.
struct Carried {
  using State = SE3;
  using Control = Vector<6>;
  Vector<6> variance = Vector<6>::Zero();  // of the readings
  [[nodiscard]] SE3 propagate(const SE3& x, const Control& u, double dt) const {
    return x * SE3::exp(Vector<6>(dt * u));
  }
  [[nodiscard]] Matrix<6> jacobian(const SE3&, const Control& u, double dt) const {
    return SE3::exp(Vector<6>(-dt * u)).adjoint();
  }
  [[nodiscard]] Matrix<6> noise(const SE3&, const Control&, double dt) const {
    Vector<6> acceleration;
    acceleration << Vector<3>::Constant(1.0), Vector<3>::Constant(4.0);
    const Vector<6> changed = 0.5 * dt * dt * acceleration;
    return (dt * dt * variance + changed.cwiseAbs2()).asDiagonal();
  }
};

struct Stereo {
  Matrix<3> C_camera_vehicle;
  Vector<3> camera;  // in the vehicle
  double fu, fv, cu, cv, baseline;
  Matrix<4> noise;
};

// One landmark in both images: u and v left, u and v right [pixels].
struct LandmarkView {
  using State = SE3;
  using Measurement = Vector<4>;
  const Stereo* rig;
  Vector<3> landmark;
  [[nodiscard]] Vector<4> predict(const SE3& T_world_vehicle) const {
    const Vector<3> in_vehicle = T_world_vehicle.inverse() * landmark;
    const Vector<3> p = rig->C_camera_vehicle * (in_vehicle - rig->camera);
    const double v = rig->fv * p(1) / p(2) + rig->cv;
    return {rig->fu * p(0) / p(2) + rig->cu, v, rig->fu * (p(0) - rig->baseline) / p(2) + rig->cu, v};
  }
  [[nodiscard]] Matrix<4> noise(const SE3&) const { return rig->noise; }
};

template <int N>
Vector<N> column(const example::MatArray& a, std::size_t k) {
  Vector<N> v;
  for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i) v(static_cast<int>(i)) = a(i, k);
  return v;
}

struct Outcome {
  double position_error = 0.0, rotation_error = 0.0, nees = 0.0, nis = 0.0;
  int views = 0, gated = 0;
};

template <class Filter>
Outcome fly(const example::MatFile& mat, std::size_t first, std::size_t last, const Filter& filter) {
  Stereo rig;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i)
      rig.C_camera_vehicle(i, j) = mat["C_c_v"](static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  rig.camera = column<3>(mat["rho_v_c_v"], 0);
  rig.fu = mat["fu"].numbers[0];
  rig.fv = mat["fv"].numbers[0];
  rig.cu = mat["cu"].numbers[0];
  rig.cv = mat["cv"].numbers[0];
  rig.baseline = mat["b"].numbers[0];
  // The variances of the set are those of single readings, but the errors are the same from image to image
  // (NIS is 0.3 where 4 is due, NEES 33 where 6 is): a reading is worth an eighth of what its variance says.
  rig.noise = 8.0 * column<4>(mat["y_var"], 0).asDiagonal();
  Carried process;
  process.variance << column<3>(mat["v_var"], 0), column<3>(mat["w_var"], 0);
  // theta turns world into vehicle with the opposite sign of the exponential: C_vehicle_world = exp(-theta^)
  const auto truth_at = [&](std::size_t k) {
    return SE3(SO3::exp(column<3>(mat["theta_vk_i"], k)), column<3>(mat["r_i_vk_i"], k));
  };
  Gaussian<SE3> belief{truth_at(first), Vector<6>::Constant(1e-4).asDiagonal()};
  cairn::RunningMoments position, rotation, nees, nis;
  Outcome out;
  const auto& y = mat["y_k_j"];
  for (std::size_t k = first + 1; k < last; ++k) {
    Vector<6> u;
    u << column<3>(mat["v_vk_vk_i"], k - 1), column<3>(mat["w_vk_vk_i"], k - 1);
    const double dt = mat["t"].numbers[k] - mat["t"].numbers[k - 1];
    REQUIRE(filter.predict(belief, process, dt, u) == Status::accepted);
    for (std::size_t j = 0; j < 20; ++j) {
      const std::size_t at = 4 * (1900 * j + k);
      if (y.numbers[at] < 0.0) continue;
      const Vector<4> z(y.numbers[at], y.numbers[at + 1], y.numbers[at + 2], y.numbers[at + 3]);
      const LandmarkView view{&rig, column<3>(mat["rho_i_pj_i"], j)};
      const auto in = [&] {
        if constexpr (std::is_same_v<Filter, cairn::Extended>)
          return filter.update(belief, cairn::numeric(view), z);
        else
          return filter.update(belief, view, z);
      }();
      CAPTURE(k);
      CAPTURE(cairn::explain(in.status));
      REQUIRE((in.accepted() || in.status == Status::gated));
      ++out.views;
      out.gated += in.accepted() ? 0 : 1;
      if (in.accepted()) nis.add(in.nis);
    }
    const Vector<6> error = cairn::local(belief.mean, truth_at(k));
    position.add(error.head<3>().squaredNorm());
    rotation.add(error.tail<3>().squaredNorm());
    nees.add(cairn::nees(belief, truth_at(k)));
  }
  out.position_error = std::sqrt(position.mean());
  out.rotation_error = std::sqrt(rotation.mean());
  out.nees = nees.mean();
  out.nis = nis.mean();
  return out;
}

TEST_SUITE("starry night") {
  TEST_CASE("extended and unscented: a stereo camera over known landmarks, on the true way") {
    const auto path = cairn_test::real_data("starry_night_stereo/dataset3.mat");
    if (!path) return;
    const example::MatFile mat(*path);
    const double gate = cairn::chi_square_quantile(0.9999, 4);
    // stretches in which landmarks stay in sight; between them lie up to 4 s without any, which velocities
    // this noisy do not bridge
    for (const std::size_t first : {std::size_t{130}, std::size_t{1520}}) {
      const std::size_t last = first == 130 ? 1130 : 1810;
      const Outcome extended = fly(mat, first, last, cairn::Extended{.gate = gate});
      const Outcome unscented = fly(mat, first, last, cairn::Unscented{.gate = gate});
      for (const Outcome& o : {extended, unscented}) {
        MESSAGE("steps ", first + 1, " to ", last, ": ", o.position_error, " m, ", o.rotation_error,
                " rad, NEES ", o.nees, ", NIS ", o.nis, ", ", o.gated, " of ", o.views, " gated");
        CHECK(o.position_error < 0.05);
        CHECK(o.rotation_error < 0.1);
        CHECK(o.nees > 1.5);  // of 6
        CHECK(o.nees < 9.0);
        CHECK(o.nis < 4.0);
        CHECK(o.gated < o.views / 50);
      }
    }
  }
}

}  // namespace
}  // namespace starry_night_test
#else
TEST_CASE("starry night") {
  MESSAGE("skipped: built without zlib, which MATLAB's files need");
}
#endif
