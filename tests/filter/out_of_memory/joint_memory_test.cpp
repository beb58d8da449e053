// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The growing state and memory: a step at a size that was there before takes none; where an allocation fails,
// every bit is as before.
#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/joint_extended.hpp>
#include <cairn/models/motion.hpp>

#include "filter/planar_slam.hpp"
#include "support/failing_memory.hpp"
#include "support/random.hpp"

namespace joint_memory_test {
namespace {

using cairn::AnyBlockId;
using cairn::BlockId;
using cairn::JointExtended;
using cairn::JointGaussian;
using cairn::Matrix;
using cairn::SE2;
using cairn::Status;
using cairn::Vector;
using cairn_test::enough;
using cairn_test::Sighting;

using Belief = JointGaussian<SE2, Vector<2>>;

std::vector<double> numbers(const Belief& belief) {
  std::vector<double> all{double(belief.size()), double(belief.dof())};
  for (const AnyBlockId id : belief.blocks()) {
    all.insert(all.end(), {double(id.slot), double(id.generation), belief.considered(id) ? 1.0 : 0.0});
    if (const auto pose = belief.as<SE2>(id))
      all.insert(all.end(), {belief.mean(*pose).x(), belief.mean(*pose).y(), belief.mean(*pose).angle()});
    else
      all.insert(all.end(),
                 {belief.mean(*belief.as<Vector<2>>(id))(0), belief.mean(*belief.as<Vector<2>>(id))(1)});
  }
  const Matrix<cairn::dynamic> p = belief.covariance();
  all.insert(all.end(), p.data(), p.data() + p.size());
  return all;
}

struct Scene {
  Belief belief;
  BlockId<SE2> robot = belief.add(SE2(1, 2, 0.3), 0.01 * Matrix<3>::Identity()).id;
  std::vector<BlockId<Vector<2>>> landmarks;

  explicit Scene(int count) {
    cairn::Random random(3);
    for (int i = 0; i < count; ++i)
      landmarks.push_back(belief
                              .augment(cairn::inverted(Sighting{}),
                                       Sighting::measurement(random.uniform(2, 8), random.uniform(-2, 2)),
                                       robot)
                              .id);
  }
  [[nodiscard]] Sighting::Measurement seen(int i) const {
    return Sighting{}.predict(
        Sighting::State(belief.mean(robot), belief.mean(landmarks[static_cast<std::size_t>(i)])));
  }
};

TEST_SUITE("joint_memory") {
  TEST_CASE("joint_gaussian: a step at a size that was there before allocates nothing") {
    Scene scene(30);
    const JointExtended filter{};
    const Vector<2> u(1, 0.1);
    const auto everything = [&](int i) {
      REQUIRE(filter.predict(scene.belief, cairn::Unicycle{}, 0.1, u, scene.robot) == Status::accepted);
      REQUIRE(filter
                  .update(scene.belief, Sighting{}, scene.seen(i), scene.robot,
                          scene.landmarks[static_cast<std::size_t>(i)])
                  .accepted());
      const auto clone = scene.belief.clone(scene.robot);
      REQUIRE(clone.accepted());
      REQUIRE(scene.belief.consider(clone.id) == Status::accepted);
      REQUIRE(filter.update(scene.belief, cairn_test::Passage{}, SE2(), clone.id, scene.robot).accepted());
      REQUIRE(filter.innovation(scene.belief, Sighting{}, scene.seen(i), scene.robot, scene.landmarks[0])
                  .accepted());
      REQUIRE(scene.belief.marginalise(clone.id) == Status::accepted);
      REQUIRE(scene.belief.marginalise(scene.landmarks[static_cast<std::size_t>(i + 1)]) == Status::accepted);
      const auto added =
          scene.belief.augment(cairn::inverted(Sighting{}), Sighting::measurement(3, 0.1), scene.robot);
      REQUIRE(added.accepted());
      scene.landmarks[static_cast<std::size_t>(i + 1)] = added.id;
    };
    everything(0);
    const bool none = enough(0, [&] {
      for (int i = 1; i < 10; ++i) everything(i);
    });
    CHECK(none);
    // and many go without any, gaps closed on the way
    const bool gone = enough(0, [&] {
      for (int i = 0; i < 25; ++i)
        REQUIRE(scene.belief.marginalise(scene.landmarks[static_cast<std::size_t>(i)]) == Status::accepted);
    });
    CHECK(gone);
    CHECK(scene.belief.size() == 6);
  }

  TEST_CASE("joint_gaussian: where any allocation of any operation fails, every bit is as before") {
    const Scene scene(8);  // its copies have no workspace and no room to grow
    const std::array<AnyBlockId, 2> two{scene.robot, scene.landmarks[3]};
    const Vector<cairn::dynamic> still = Vector<cairn::dynamic>::Constant(5, 0.01);
    const Matrix<cairn::dynamic> posterior = 0.5 * scene.belief.covariance(two);
    Matrix<cairn::dynamic> with_new = Matrix<cairn::dynamic>::Identity(8, 8);
    with_new.topLeftCorner(5, 5) = posterior;
    cairn::StackedMeasurement<> stack;
    for (int i = 0; i < 4; ++i)
      REQUIRE(stack.add(scene.belief, Sighting{}, scene.seen(i), scene.robot,
                        scene.landmarks[static_cast<std::size_t>(i)]) == Status::accepted);
    const auto reordered = [&] {
      std::vector<AnyBlockId> ids(scene.belief.blocks().begin(), scene.belief.blocks().end());
      std::reverse(ids.begin(), ids.end());
      return ids;
    }();
    int failures = 0;
    const auto fails_cleanly = [&](const char* what, const auto& operation) {
      CAPTURE(what);
      const std::vector<double> before = numbers(scene.belief);
      Belief expected = scene.belief;
      operation(expected);
      const std::vector<double> after = numbers(expected);
      CHECK(after != before);
      for (long allowed = 0; allowed < 1000; ++allowed) {
        CAPTURE(allowed);
        Belief belief = scene.belief;
        const bool done = enough(allowed, [&] { operation(belief); });
        CHECK(numbers(belief) == (done ? after : before));
        if (done) break;
        ++failures;
        operation(belief);  // and it works as if nothing had happened
        CHECK(numbers(belief) == after);
      }
    };
    const JointExtended filter{};
    const auto robot = scene.robot;
    const auto landmark = scene.landmarks[2];
    const auto z = cairn::retract(scene.seen(2), Vector<2>(0.1, 0.01));
    fails_cleanly("add",
                  [&](Belief& b) { static_cast<void>(b.add(Vector<2>(1, 2), Matrix<2>::Identity())); });
    fails_cleanly("clone", [&](Belief& b) { static_cast<void>(b.clone(robot)); });
    fails_cleanly("augment", [&](Belief& b) {
      static_cast<void>(b.augment(cairn::inverted(Sighting{}), Sighting::measurement(3, 0.1), robot));
    });
    fails_cleanly("predict", [&](Belief& b) {
      static_cast<void>(filter.predict(b, cairn::Unicycle{}, 0.5, Vector<2>(1, 0.1), robot));
    });
    fails_cleanly("update",
                  [&](Belief& b) { static_cast<void>(filter.update(b, Sighting{}, z, robot, landmark)); });
    fails_cleanly("iterated update", [&](Belief& b) {
      static_cast<void>(JointExtended{.iterations = 4}.update(b, Sighting{}, z, robot, landmark));
    });
    fails_cleanly("update with a considered block", [&](Belief& b) {
      if (b.consider(landmark) == Status::accepted) static_cast<void>(0);
      try {
        static_cast<void>(filter.update(b, Sighting{}, z, robot, landmark));
      } catch (const std::bad_alloc&) {
        static_cast<void>(b.consider(landmark, false));
        throw;
      }
    });
    fails_cleanly("stack", [&](Belief& b) { static_cast<void>(filter.update(b, stack)); });
    fails_cleanly("condition", [&](Belief& b) { static_cast<void>(b.condition(landmark, Vector<2>(3, 3))); });
    fails_cleanly("commit", [&](Belief& b) { static_cast<void>(b.commit(two, still, posterior)); });
    fails_cleanly("commit with a new block",
                  [&](Belief& b) { static_cast<void>(b.commit(two, still, with_new, SE2())); });
    fails_cleanly("marginalise some", [&](Belief& b) { static_cast<void>(b.marginalise(two)); });
    fails_cleanly("reorder", [&](Belief& b) { static_cast<void>(b.reorder(reordered)); });
    CHECK(failures > 40);
  }
}

}  // namespace
}  // namespace joint_memory_test
