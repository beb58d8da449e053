// words: cairn: a step of a State is Vector<dof, Scalar>; Matrix<double, 3, 1
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

struct Pose {};
template <>
struct cairn::manifold_traits<Pose> {
  using Scalar = double;
  using Tangent = cairn::Vector<3>;
  static constexpr int dof = 2;
  static Pose retract(const Pose& x, const Tangent&) { return x; }
  static Tangent local(const Pose&, const Pose&) { return {}; }
};
struct Broken {
  using State = Pose;
  using Control = cairn::NoControl;
  static constexpr bool linear = true;
  Pose propagate(const Pose& x, const Control&, double) const { return x; }
  cairn::Matrix<2> jacobian(const Pose&, const Control&, double) const { return {}; }
  cairn::Matrix<2> noise(const Pose&, const Control&, double) const { return {}; }
};

static_assert(cairn::LinearProcess<Broken> || cairn::detail::explain_sizes<Broken>);
