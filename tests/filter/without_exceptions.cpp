// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Compiled with -fno-exceptions: the filters instantiate, run and refuse by status there too.
#include <cmath>

#include <cairn/core/random.hpp>
#include <cairn/filter/ensemble.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/filter/timeline.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#ifdef __cpp_exceptions
#error "to be compiled without exceptions"
#endif

using cairn::Compass;
using cairn::SE2;
using cairn::SO2;
using cairn::Status;
using cairn::Vector;

int main() {
  const cairn::Gaussian<SE2> prior{SE2(0, 0, 0), 0.01 * cairn::Matrix<3>::Identity()};
  const Vector<2> u(1.0, 0.1);
  cairn::Random random(1);
  auto belief = prior;
  bool good = cairn::Extended{}.predict(belief, cairn::Unicycle{}, 0.1, u) == Status::accepted &&
              cairn::Extended{}.update(belief, Compass{}, SO2(0.1)).accepted() &&
              cairn::Unscented{}.predict(belief, cairn::Unicycle{}, 0.1, u) == Status::accepted &&
              cairn::Unscented{}.update(belief, Compass{}, SO2(std::nan(""))).status == Status::not_finite;
  auto particles = cairn::draw_particles(prior, 100, random);
  good = good && cairn::ParticleFilter{}.update(particles, Compass{}, SO2(0.0), random) == Status::accepted;
  auto ensemble = cairn::Ensemble<SE2>::draw(prior, 10, random);
  good = good && cairn::EnsembleKalman{}.update(ensemble, Compass{}, SO2(0.0), random).accepted();
  cairn::Timeline<cairn::Extended, cairn::Unicycle, Compass> timeline(cairn::Extended{}, cairn::Unicycle{},
                                                                      prior, 0.0, u, 1.0);
  good = good && timeline.measure(Compass{}, SO2(0.1), 1.0).accepted() &&
         timeline.measure(Compass{}, SO2(0.1), 0.5).accepted();
  return good ? 0 : 1;
}
