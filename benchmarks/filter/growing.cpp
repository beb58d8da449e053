// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The pose is three plain numbers here, so that a dense filter over one vector has the same answer to the
// last digits.
#include "growing.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/joint_extended.hpp>

#include "problems.hpp"
#include "support/timing.hpp"

namespace cairn_bench {
namespace {

constexpr int landmarks = 200;
constexpr int numbers = 3 + 2 * landmarks;
using Column = cairn::Vector<cairn::dynamic>;
using Square = cairn::Matrix<cairn::dynamic>;
using Reading = cairn::Product<cairn::Vector<1>, cairn::SO2>;

/// Range and bearing of (landmark) from (x, y, heading).
Reading seen_from(double x, double y, double heading, double landmark_x, double landmark_y) {
  const double dx = landmark_x - x, dy = landmark_y - y;
  return Reading(cairn::Vector<1>(std::sqrt(dx * dx + dy * dy)), cairn::SO2(std::atan2(dy, dx) - heading));
}
cairn::Matrix<2, 5> slopes(double dx, double dy) {
  const double squared = dx * dx + dy * dy, range = std::sqrt(squared);
  cairn::Matrix<2, 5> h;
  h << -dx / range, -dy / range, 0, dx / range, dy / range,  //
      dy / squared, -dx / squared, -1, -dy / squared, dx / squared;
  return h;
}
cairn::Matrix<2> reading_noise() {
  return cairn::Vector<2>(0.01, 4e-4).asDiagonal();
}

struct Sighting {
  using State = cairn::Product<cairn::Vector<3>, cairn::Vector<2>>;
  using Measurement = Reading;
  [[nodiscard]] Reading predict(const State& s) const {
    const cairn::Vector<3>& x = s.part<0>();
    return seen_from(x(0), x(1), x(2), s.part<1>()(0), s.part<1>()(1));
  }
  [[nodiscard]] cairn::Matrix<2, 5> jacobian(const State& s) const {
    return slopes(s.part<1>()(0) - s.part<0>()(0), s.part<1>()(1) - s.part<0>()(1));
  }
  [[nodiscard]] cairn::Matrix<2> noise(const State&) const { return reading_noise(); }
  [[nodiscard]] cairn::Vector<2> initialise(const cairn::Vector<3>& x, const Reading& z) const {
    const double angle = x(2) + z.part<1>().angle(), range = z.part<0>()(0);
    return {x(0) + range * std::cos(angle), x(1) + range * std::sin(angle)};
  }
};

struct Drift {
  using State = cairn::Vector<3>;
  using Control = cairn::NoControl;
  [[nodiscard]] State propagate(const State& x, const Control&, double) const {
    return {x(0) + 0.1 * std::cos(x(2)), x(1) + 0.1 * std::sin(x(2)), x(2) + 0.02};
  }
  [[nodiscard]] cairn::Matrix<3> jacobian(const State& x, const Control&, double) const {
    cairn::Matrix<3> f = cairn::Matrix<3>::Identity();
    f(0, 2) = -0.1 * std::sin(x(2));
    f(1, 2) = 0.1 * std::cos(x(2));
    return f;
  }
  [[nodiscard]] cairn::Diagonal<3> noise(const State&, const Control&, double) const {
    return {{1e-3, 1e-4, 1e-4}};
  }
};

/// The same sensor for a filter of one vector: pose, then landmarks.
struct DenseSighting {
  using State = Column;
  using Measurement = Reading;
  int landmark;
  [[nodiscard]] Reading predict(const State& x) const {
    return seen_from(x(0), x(1), x(2), x(3 + 2 * landmark), x(4 + 2 * landmark));
  }
  [[nodiscard]] cairn::Matrix<2, cairn::dynamic> jacobian(const State& x) const {
    const cairn::Matrix<2, 5> part = slopes(x(3 + 2 * landmark) - x(0), x(4 + 2 * landmark) - x(1));
    cairn::Matrix<2, cairn::dynamic> h = cairn::Matrix<2, cairn::dynamic>::Zero(2, numbers);
    h.leftCols<3>() = part.leftCols<3>();
    h.middleCols<2>(3 + 2 * landmark) = part.rightCols<2>();
    return h;
  }
  [[nodiscard]] cairn::Matrix<2> noise(const State&) const { return reading_noise(); }
};

/// Takes in readings of one landmark after the other; shows what it believes.
struct Solver {
  virtual ~Solver() = default;
  virtual bool update(int landmark, const Reading& z) = 0;
  [[nodiscard]] virtual Column mean() const = 0;
  [[nodiscard]] virtual Square covariance() const = 0;
};

struct Growing : Solver {
  cairn::JointGaussian<cairn::Vector<3>, cairn::Vector<2>> belief;
  cairn::BlockId<cairn::Vector<3>> robot;
  std::vector<cairn::BlockId<cairn::Vector<2>>> ids;
  cairn::JointExtended filter{};

  Growing() {
    cairn::Random random(1);
    robot = belief.add(cairn::Vector<3>(0, 0, 0), 0.01 * cairn::Matrix<3>::Identity()).id;
    for (int i = 0; i < landmarks; ++i) {
      const Reading z(cairn::Vector<1>(random.uniform(2, 30)), cairn::SO2(random.uniform(-3, 3)));
      ids.push_back(belief.augment(cairn::inverted(Sighting{}), z, robot).id);
      if (filter.predict(belief, Drift{}, 1.0, robot) != cairn::Status::accepted) std::exit(1);
    }
  }
  bool update(int landmark, const Reading& z) override {
    return filter.update(belief, Sighting{}, z, robot, ids[static_cast<std::size_t>(landmark)]).accepted();
  }
  [[nodiscard]] Column mean() const override {
    Column x(numbers);
    x.head<3>() = belief.mean(robot);
    for (int i = 0; i < landmarks; ++i)
      x.segment<2>(3 + 2 * i) = belief.mean(ids[static_cast<std::size_t>(i)]);
    return x;
  }
  [[nodiscard]] Square covariance() const override { return belief.covariance(); }
};

struct OurDense : Solver {
  cairn::Gaussian<Column> belief;
  explicit OurDense(const Solver& start) : belief{start.mean(), start.covariance()} {}
  bool update(int landmark, const Reading& z) override {
    return cairn::Extended{}.update(belief, DenseSighting{landmark}, z).accepted();
  }
  [[nodiscard]] Column mean() const override { return belief.mean; }
  [[nodiscard]] Square covariance() const override { return belief.covariance; }
};

struct HandWritten : Solver {
  Column x;
  Square p;
  explicit HandWritten(const Solver& start) : x(start.mean()), p(start.covariance()) {}
  [[nodiscard]] Column mean() const override { return x; }
  [[nodiscard]] Square covariance() const override { return p; }
};
/// As textbooks write it.
struct Textbook : HandWritten {
  using HandWritten::HandWritten;
  bool update(int landmark, const Reading& z) override {
    const DenseSighting sensor{landmark};
    const cairn::Matrix<2, cairn::dynamic> h = sensor.jacobian(x);
    const cairn::Matrix<2> s = h * p * h.transpose() + reading_noise();
    const Square k = p * h.transpose() * cairn::Cholesky<2>(s).inverse();
    x += k * cairn::local(sensor.predict(x), z);
    p = ((Square::Identity(numbers, numbers) - k * h) * p).eval();
    return true;
  }
};
/// By someone who knows where H is zero, and that P - K (H P) is of rank two.
struct Careful : HandWritten {
  using HandWritten::HandWritten;
  bool update(int landmark, const Reading& z) override {
    const int at = 3 + 2 * landmark;
    const cairn::Matrix<2, 5> h = slopes(x(at) - x(0), x(at + 1) - x(1));
    const cairn::Matrix<cairn::dynamic, 2> ph =
        p.leftCols<3>() * h.leftCols<3>().transpose() + p.middleCols<2>(at) * h.rightCols<2>().transpose();
    const cairn::Matrix<2> s =
        h.leftCols<3>() * ph.topRows<3>() + h.rightCols<2>() * ph.middleRows<2>(at) + reading_noise();
    const cairn::Matrix<cairn::dynamic, 2> k = ph * cairn::Cholesky<2>(s).inverse();
    x += k * cairn::local(DenseSighting{landmark}.predict(x), z);
    p.noalias() -= k * ph.transpose();
    return true;
  }
};

/// Readings as if the start were the truth.
class Readings {
public:
  explicit Readings(const Column& truth) : truth_(truth) {}
  [[nodiscard]] std::pair<int, Reading> operator()(int k) const {
    static const auto errors = noise<2>(64, 1.0);
    const int landmark = 37 * k % landmarks;
    const cairn::Vector<2>& e = errors[static_cast<std::size_t>(k % 64)];
    return {landmark, cairn::retract(DenseSighting{landmark}.predict(truth_),
                                     cairn::Vector<2>(0.1 * e(0), 0.02 * e(1)))};
  }

private:
  Column truth_;
};

/// Largest difference of two beliefs, of covariances in units of the deviations.
double difference(const Solver& a, const Solver& b) {
  const Column x = a.mean() - b.mean();
  const Square p = a.covariance(), q = b.covariance();
  double largest = x.lpNorm<Eigen::Infinity>();
  for (int j = 0; j < numbers; ++j)
    for (int i = 0; i < numbers; ++i)
      largest = std::max(largest, std::abs(p(i, j) - q(i, j)) / std::sqrt(p(i, i) * p(j, j)));
  return largest;
}

}  // namespace

void add_growing_rows(Scoreboard& board) {
  struct Entry {
    std::string name;
    std::unique_ptr<Solver> solver;
    int updates;  // of one turn
    bool owed;
    int next = 0;
  };
  std::vector<Entry> entries;
  entries.push_back({"ours", std::make_unique<Growing>(), 16, false});
  const Solver& start = *entries.front().solver;
  const Readings readings(start.mean());
  entries.push_back({"cairn::Extended of 403 states", std::make_unique<OurDense>(start), 1, true});
  entries.push_back({"hand-written (I - K H) P", std::make_unique<Textbook>(start), 1, true});
  entries.push_back({"hand-written, rank two", std::make_unique<Careful>(start), 16, false});
  const auto take = [&](Entry& entry) {
    const auto [landmark, z] = readings(entry.next++);
    if (!entry.solver->update(landmark, z)) {
      std::fprintf(stderr, "scoreboard_filter: growing state: an update was refused\n");
      std::exit(1);
    }
  };
  double worst = 0.0;
  for (int k = 0; k < 10; ++k) {
    for (Entry& entry : entries) take(entry);
    for (const Entry& entry : entries)
      worst = std::max(worst, difference(*entries.front().solver, *entry.solver));
  }
  if (!(worst <= 1e-9)) {
    std::fprintf(stderr, "scoreboard_filter: growing state: the answers differ by %g\n", worst);
    std::exit(1);
  }
  std::vector<Contender> contenders;
  for (Entry& entry : entries)
    contenders.push_back({entry.name,
                          [&] {
                            for (int k = 0; k < entry.updates; ++k) take(entry);
                          },
                          double(entry.updates)});
  const auto timings = interleave(contenders, {.rounds = 31, .seconds_per_round = 0.002});
  const std::string name = "growing state, 200 landmarks, range and bearing, ";
  char same[64];
  std::snprintf(same, sizeof same, "; same numbers to %.0e", worst);
  for (std::size_t i = 1; i < entries.size(); ++i) {
    Row row = entries[i].owed ? against_rival(name + entries[i].name, timings[0].median * 1e6,
                                              timings[i].median * 1e6, entries[i].name, 5.0, 20.0, "us")
                              : against_rival(name + entries[i].name, timings[0].median * 1e6,
                                              timings[i].median * 1e6, entries[i].name, {}, {}, "us");
    row.measured = ratio(timings[i], timings[0]);
    row.note += same;
    board.add(row);
  }
}

}  // namespace cairn_bench
