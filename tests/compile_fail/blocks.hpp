// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// A joint belief and a sensor of two of its blocks, without a Jacobian.
#pragma once

#include <cmath>

#include <cairn/filter/joint_gaussian.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>

using Blocks = cairn::JointGaussian<cairn::SE2, cairn::Vector<2>>;
using Robot = cairn::BlockId<cairn::SE2>;
using Landmark = cairn::BlockId<cairn::Vector<2>>;

struct Bearing {
  using State = cairn::Product<cairn::SE2, cairn::Vector<2>>;
  using Measurement = cairn::SO2;
  Measurement predict(const State& x) const {
    const cairn::Vector<2> p = x.part<0>().inverse() * x.part<1>();
    return Measurement(std::atan2(p(1), p(0)));
  }
  cairn::Matrix<1> noise(const State&) const { return cairn::Matrix<1>(1e-4); }
};
