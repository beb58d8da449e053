// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Every Gaussian filter on random linear models whose P, Q and R may be singular in any direction and whose
// numbers span twelve decades of standard deviations, held against 113-bit arithmetic (exact_filter.hpp).
// CAIRN_MODELS=n takes n models of each shape instead of a few hundred; CAIRN_SEED replays.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <map>
#include <string>
#include <type_traits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/augmented_unscented.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/square_root_information.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/models/linear.hpp>

#include "filter/exact_filter.hpp"
#include "support/random.hpp"

namespace random_models_test {
namespace {

using cairn::Form;
using cairn::Gaussian;
using cairn::Matrix;
using cairn::Status;
using cairn::Vector;
using cairn_test::Distance;
using cairn_test::ExactBelief;
using cairn_test::ExactProblem;
using cairn_test::Quad;
using cairn_test::quad_abs;
using cairn_test::quad_root;
using cairn_test::quad_solve;
using cairn_test::QuadMatrix;

// A model and a belief in the numbers of the filter. Sizes may be dynamic.
template <int N, int M, class S>
struct Problem {
  Gaussian<Vector<N, S>> prior;
  cairn::LinearModel<N, S> process;
  cairn::LinearSensor<M, N, S> sensor;
  Vector<M, S> z;

  [[nodiscard]] ExactProblem exact() const {
    return {QuadMatrix(process.transition), QuadMatrix(process.covariance), QuadMatrix(sensor.design),
            QuadMatrix(sensor.covariance), QuadMatrix(z)};
  }
};

using Wide = Matrix<cairn::dynamic, cairn::dynamic, double>;

Wide normal_matrix(cairn::Random& random, int rows, int columns) {
  Wide a(rows, columns);
  for (int j = 0; j < columns; ++j)
    for (int i = 0; i < rows; ++i) a(i, j) = random.normal();
  return a;
}

// A root of a covariance: of full rank, or of any lower one, not along the axes.
Wide random_root(cairn::Random& random, int n) {
  const bool full = random.below(2) == 0;
  const int rank = full ? n : static_cast<int>(random.below(static_cast<std::uint64_t>(n)));
  return normal_matrix(random, n, rank) / std::sqrt(double(std::max(rank, 1)));
}

// Six decades to each side.
double random_scale(cairn::Random& random) {
  return std::pow(10.0, random.uniform(-6.0, 6.0));
}

template <int N, int M, class S>
Problem<N, M, S> random_problem(cairn::Random& random, int n, int m) {
  Vector<cairn::dynamic> of_state(n), of_sensor(m);
  for (int i = 0; i < n; ++i) of_state(i) = random_scale(random);
  for (int i = 0; i < m; ++i) of_sensor(i) = random_scale(random);
  Wide f = normal_matrix(random, n, n) / std::sqrt(double(n)), h = normal_matrix(random, m, n);
  Wide p = random_root(random, n), q = random_root(random, n), r = random_root(random, m);
  const bool units = random.below(2) == 0;
  p = of_state.asDiagonal() * p;
  r = of_sensor.asDiagonal() * r;
  if (units) {  // a model of one size in units that differ by all these decades
    f = of_state.asDiagonal() * f * of_state.cwiseInverse().asDiagonal();
    h = of_sensor.asDiagonal() * h * of_state.cwiseInverse().asDiagonal();
    q = of_state.asDiagonal() * q * random_scale(random);
    r *= random_scale(random);
  } else {  // all sizes mixed
    for (int i = 0; i < n; ++i) q.row(i) *= random_scale(random);
  }
  const auto square = [](const Wide& root) {
    Wide a = root * root.transpose();
    if (root.cols() == 0) a.setZero(root.rows(), root.rows());
    return Wide(cairn::symmetrised(a));
  };
  const Wide x = of_state.asDiagonal() * normal_matrix(random, n, 1);
  const auto drawn = [&](const Wide& root) {
    Wide e = root * normal_matrix(random, static_cast<int>(root.cols()), 1);
    if (root.cols() == 0) e.setZero(root.rows(), 1);
    return e;
  };
  const Wide truth = f * (x + drawn(p)) + drawn(q);
  const Wide z = h * truth + drawn(r);
  Problem<N, M, S> out{{x.cast<S>(), square(p).template cast<S>()},
                       {f.cast<S>(), square(q).template cast<S>()},
                       {h.cast<S>(), square(r).template cast<S>()},
                       z.cast<S>()};
  return out;
}

// What a belief says, exactly, in the form it is held in; `shake` moves the numbers it consists of by as many
// of their last digits.
struct Held {
  QuadMatrix mean, factor, diagonal;
  enum class Form { covariance, root, ud, information, information_root } form;

  [[nodiscard]] Held shaken(cairn::Random& random, double part) const {
    Held other = *this;
    for (QuadMatrix* m : {&other.mean, &other.factor, &other.diagonal})
      for (Quad& x : m->numbers) x *= 1 + Quad(part * random.uniform(-1.0, 1.0));
    if (form == Form::covariance || form == Form::information)
      for (int i = 0; i < factor.rows; ++i)
        for (int j = 0; j < i; ++j) other.factor.at(j, i) = other.factor.at(i, j);
    return other;
  }
  // False where an information is singular. `diagonal` of an information is its vector.
  [[nodiscard]] bool open(ExactBelief& out) const {
    const QuadMatrix t = turned(factor);
    out.mean = mean;
    if (form == Form::covariance) out.covariance = factor;
    if (form == Form::root) out.covariance = times(factor, t);
    if (form == Form::ud) {
      QuadMatrix scaled = factor;
      for (int i = 0; i < factor.rows; ++i)
        for (int j = 0; j < factor.rows; ++j) scaled.at(i, j) *= diagonal.at(j, 0);
      out.covariance = times(scaled, t);
    }
    if (form == Form::information || form == Form::information_root) {
      const QuadMatrix y = form == Form::information ? factor : times(t, factor);
      QuadMatrix step = form == Form::information ? diagonal : times(t, diagonal);
      out.covariance = cairn_test::quad_identity(y.rows);
      if (!quad_solve(y, out.covariance) || !quad_solve(y, step)) return false;
      out.mean = plus(out.mean, step);
    }
    return true;
  }
};

template <class Belief>
Held hold(const Belief& b) {
  if constexpr (requires { b.diagonal; })
    return {QuadMatrix(b.mean), QuadMatrix(b.upper), QuadMatrix(b.diagonal), Held::Form::ud};
  else if constexpr (requires { b.information; })
    return {QuadMatrix(b.point), QuadMatrix(b.information), QuadMatrix(b.vector), Held::Form::information};
  else if constexpr (requires { b.vector; })
    return {QuadMatrix(b.point), QuadMatrix(b.root), QuadMatrix(b.vector), Held::Form::information_root};
  else if constexpr (requires { b.root; })
    return {QuadMatrix(b.mean), QuadMatrix(b.root), {}, Held::Form::root};
  else
    return {QuadMatrix(b.mean), QuadMatrix(b.covariance), {}, Held::Form::covariance};
}

// Mean and covariance as the belief gives them out; false where it does not.
template <class Belief>
bool give(const Belief& belief, ExactBelief& out) {
  if constexpr (requires { belief.gaussian().has_value(); }) {
    const auto plain = belief.gaussian();
    if (!plain) return false;
    out = {QuadMatrix(plain->mean), QuadMatrix(plain->covariance)};
  } else if constexpr (requires { belief.gaussian(); }) {
    const auto plain = belief.gaussian();
    out = {QuadMatrix(plain.mean), QuadMatrix(plain.covariance)};
  } else {
    out = {QuadMatrix(belief.mean), QuadMatrix(belief.covariance)};
  }
  return true;
}

// One kind of step of one filter.
struct Tally {
  std::string name;
  int runs = 0, solvable = 0, wrong = 0, refused = 0, loose = 0, unlikely = 0;
  double worst_mean = 0.0, worst_covariance = 0.0;
};
using Tallies = std::map<std::string, Tally>;

// The inverses of two covariances are alike in units of the first one's diagonal.
bool inverses_agree(const QuadMatrix& a, const QuadMatrix& b) {
  QuadMatrix y = cairn_test::quad_identity(a.rows), other = y;
  if (!quad_solve(a, y) || !quad_solve(b, other)) return false;
  for (int i = 0; i < a.rows; ++i)
    for (int j = 0; j < a.rows; ++j) {
      const Quad size = quad_root(y.at(i, i)) * quad_root(y.at(j, j));
      if (!(cairn_test::plain(quad_abs(y.at(i, j) - other.at(i, j)) / size) < 1e-3 / 30)) return false;
    }
  return true;
}

// The numbers of a problem are known to a digit in the last place. It counts as solvable where eight of
// those, taken anywhere, move the answer by less than a thirtieth of what is allowed; for a form that holds
// information, that and the inverse of R.
template <class S, class Exact>
void judge(Tally& tally, const Held& held, const ExactProblem& problem, const Exact& solve, bool accepted,
           const ExactBelief& found, cairn::Random& random, bool informs = false) {
  const double ulp = static_cast<double>(std::numeric_limits<S>::epsilon());
  const double floor = 1e3 * ulp;
  ExactBelief start, size, exact;
  bool solvable = held.open(start) && solve(problem, start, size, exact);
  for (int k = 0; k < 4 && solvable; ++k) {
    ExactBelief begin, unused, other;
    const ExactProblem moved = problem.shaken(random, 8 * ulp);
    solvable =
        held.shaken(random, 8 * ulp).open(begin) && solve(moved, begin, unused, other) &&
        (!informs || (inverses_agree(exact.covariance, other.covariance) &&
                      inverses_agree(problem.sensor_noise, moved.sensor_noise))) &&
        distance_in_sigmas(other, exact, size, floor).worst() < 1e-3 / 30 &&
        std::abs(other.log_determinant - exact.log_determinant) < 1e-3 &&
        std::abs(other.log_likelihood - exact.log_likelihood) < 1e-3 * (1 + std::abs(exact.log_likelihood));
  }
  ++tally.runs;
  tally.solvable += solvable ? 1 : 0;
  tally.refused += solvable && !accepted ? 1 : 0;
  const double odds =
      std::abs(found.log_likelihood - exact.log_likelihood) / (1 + std::abs(exact.log_likelihood));
  if (solvable && accepted && found.log_likelihood != 0.0 && !(odds < 1e-2)) ++tally.unlikely;
  if (!accepted) return;
  const Distance d = distance_in_sigmas(found, exact, size, floor);
  if (solvable) {
    tally.worst_mean = std::max(tally.worst_mean, d.mean);
    tally.worst_covariance = std::max(tally.worst_covariance, d.covariance);
    tally.wrong += d.worst() > 1e-3 ? 1 : 0;
  } else {
    tally.loose += d.worst() > 1e-3 ? 1 : 0;
  }
}

bool by_prediction(const ExactProblem& p, const ExactBelief& start, ExactBelief& size, ExactBelief& out) {
  size = out = exact_prediction(p, start);
  return true;
}
bool by_update(const ExactProblem& p, const ExactBelief& start, ExactBelief& size, ExactBelief& out) {
  size = start;
  out = exact_update(p, start);
  return out.solvable;
}

template <class S, class Filter, class Belief, class P>
void run(Tallies& tallies, const std::string& name, const Filter& filter, Belief belief, const P& problem,
         cairn::Random random) {
  const ExactProblem exact = problem.exact();
  ExactBelief found;
  for (int step = 0; step < 3; ++step) {  // a prediction and two updates
    const Held held = hold(belief);
    const bool informs = held.form == Held::Form::information || held.form == Held::Form::information_root;
    bool accepted = false;
    double log_likelihood = 0.0;
    if (step == 0) {
      accepted = filter.predict(belief, problem.process, 1.0) == Status::accepted;
    } else {
      const auto taken = filter.update(belief, problem.sensor, problem.z);
      accepted = taken.accepted();
      if constexpr (requires { taken.log_likelihood(); })
        if (accepted) log_likelihood = static_cast<double>(taken.log_likelihood());
    }
    const bool kept = accepted;
    accepted = accepted && give(belief, found);
    found.log_likelihood = log_likelihood;
    Tally& tally = tallies[name + (step == 0 ? ", predict" : step == 1 ? ", update" : ", update again")];
    tally.name = name + std::to_string(step);
    if (step == 0)
      judge<S>(tally, held, exact, by_prediction, accepted, found, random, informs);
    else
      judge<S>(tally, held, exact, by_update, accepted, found, random, informs);
    if (!kept) return;
  }
}

// The covariance taken into another form.
template <class S, class X, class Belief>
void convert(Tallies& tallies, const std::string& name, const Gaussian<X>& prior, cairn::Random random,
             Belief& out, bool& good) {
  good = true;
  if constexpr (requires { Belief::from(prior).has_value(); }) {
    const auto made = Belief::from(prior);
    good = made.has_value();
    if (good) out = *made;
  } else {
    out = Belief::from(prior);
  }
  ExactBelief found;
  const bool given = good && give(out, found);
  judge<S>(
      tallies[name + ", from"], hold(prior), ExactProblem{},
      [](const ExactProblem&, const ExactBelief& a, ExactBelief& size, ExactBelief& b) {
        size = b = a;
        return true;
      },
      given, found, random, requires { out.vector; });
}

template <int N, int M, class S>
void all_filters(Tallies& tallies, cairn::Random& random, int n, int m) {
  const auto problem = random_problem<N, M, S>(random, n, m);
  const auto& prior = problem.prior;
  const auto on = [&](const char* name, const auto& filter) {
    run<S>(tallies, name, filter, prior, problem, random);
  };
  on("standard", cairn::Kalman{});
  on("joseph", cairn::Kalman{.form = Form::joseph});
  on("sequential", cairn::Kalman{.form = Form::sequential});
  on("iterated", cairn::Extended{.iterations = 4});
  on("unscented", cairn::Unscented{});
  on("cubature", cairn::cubature());
  on("augmented", cairn::AugmentedUnscented{});
  using X = Vector<N, S>;
  const auto in_form = [&](const char* name, const auto& filter, auto belief) {
    bool good = false;
    convert<S>(tallies, name, prior, random, belief, good);
    if (good) run<S>(tallies, name, filter, belief, problem, random);
  };
  in_form("square root", cairn::SquareRoot{}, cairn::SquareRootGaussian<X>{});
  in_form("square-root unscented", cairn::SquareRootUnscented{}, cairn::SquareRootGaussian<X>{});
  in_form("information", cairn::InformationFilter{}, cairn::InformationBelief<X>{});
  in_form("square-root information", cairn::SquareRootInformationFilter{}, cairn::SquareRootInformation<X>{});
  if constexpr (N != cairn::dynamic) in_form("UD", cairn::UDFilter{}, cairn::UDGaussian<X>{});
}

int models(int usual) {
  const char* text = std::getenv("CAIRN_MODELS");
  return text != nullptr ? std::atoi(text) : usual;
}

// Prints the table of a longer run.
void report(const char* title, const Tallies& tallies) {
  for (const auto& [name, t] : tallies) {
    CAPTURE(name);
    CHECK(t.wrong == 0);
    CHECK(t.unlikely == 0);
  }
  if (std::getenv("CAIRN_MODELS") == nullptr) return;
  std::printf("%s\n  %-32s %8s %8s %8s %8s %8s %10s %10s %8s %8s\n", title, "filter", "models", "solvable",
              "wrong", "refused", "share", "mean", "covariance", "loose", "odds");
  for (const auto& [name, t] : tallies) {
    std::printf("  %-32s %8d %8d %8d %8d %7.2f%% %10.1e %10.1e %8d %8d\n", name.c_str(), t.runs, t.solvable,
                t.wrong, t.refused, 100.0 * t.refused / std::max(1, t.solvable), t.worst_mean,
                t.worst_covariance, t.loose, t.unlikely);
  }
}

TEST_SUITE("random models") {
  TEST_CASE("filters: an accepted answer to a solvable random model is right, in double and fixed sizes") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    Tallies tallies;
    for (int k = 0; k < models(300); ++k) {
      all_filters<1, 1, double>(tallies, random, 1, 1);
      all_filters<3, 2, double>(tallies, random, 3, 2);
      all_filters<4, 4, double>(tallies, random, 4, 4);
    }
    report("double, fixed sizes", tallies);
  }
  TEST_CASE("filters: the same in float") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed, 1);
    Tallies tallies;
    for (int k = 0; k < models(300); ++k) all_filters<3, 2, float>(tallies, random, 3, 2);
    report("float, fixed sizes", tallies);
  }
  TEST_CASE("filters: the same in sizes known at run time") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed, 2);
    Tallies tallies;
    for (int k = 0; k < models(300); ++k)
      all_filters<cairn::dynamic, cairn::dynamic, double>(
          tallies, random, 1 + static_cast<int>(random.below(6)), 1 + static_cast<int>(random.below(4)));
    report("double, sizes known at run time", tallies);
  }
}

}  // namespace
}  // namespace random_models_test
