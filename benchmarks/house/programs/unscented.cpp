// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <iostream>

#include <cairn/filter/unscented.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

int main() {
  cairn::Gaussian<cairn::Vector<4>> belief{cairn::Vector<4>::Zero(), cairn::Matrix<4>::Identity()};
  const cairn::PositionSensor<2, 4> sensor{.covariance = cairn::Matrix<2>::Identity()};
  const cairn::Unscented filter;
  if (filter.predict(belief, cairn::ConstantVelocity<2>{}, 0.1) != cairn::Status::accepted) return 1;
  const auto innovation = filter.update(belief, sensor, cairn::Vector<2>(1, 2));
  std::cout << innovation.nis << ' ' << belief.mean.transpose() << '\n';
}
