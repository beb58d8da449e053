// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <iostream>

#include <cairn/filter/kalman.hpp>
#include <cairn/models/linear.hpp>

int main() {
  using X = cairn::Vector<cairn::dynamic>;
  using M = cairn::Matrix<cairn::dynamic>;
  cairn::Gaussian<X> belief{X::Zero(4), M::Identity(4, 4)};
  const cairn::LinearModel<cairn::dynamic> process{M::Identity(4, 4), M::Identity(4, 4)};
  const cairn::LinearSensor<cairn::dynamic, cairn::dynamic> sensor{M::Identity(2, 4), M::Identity(2, 2)};
  const cairn::Kalman filter;
  if (filter.predict(belief, process, 0.1) != cairn::Status::accepted) return 1;
  const auto innovation = filter.update(belief, sensor, X(X::Ones(2)));
  std::cout << innovation.nis << ' ' << belief.mean.transpose() << '\n';
}
