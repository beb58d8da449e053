// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/LU>
#include <Eigen/QR>
#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/geometry/anchored_line.hpp>
#include <cairn/geometry/line.hpp>
#include <cairn/geometry/line_triangulation.hpp>
#include <cairn/manifold/derivatives.hpp>

#include "support/random.hpp"

namespace line_test {
namespace {

using cairn::Line;
using cairn::LineCamera;
using cairn::LineSegment;
using cairn::LineStatus;
using cairn::LineView;
using cairn::Matrix;
using cairn::SE3;
using cairn::SO3;
using cairn::Vector;

Vector<3> somewhere(cairn::Random& random, double reach) {
  return {random.uniform(-reach, reach), random.uniform(-reach, reach), random.uniform(-reach, reach)};
}
Vector<3> some_direction(cairn::Random& random) {
  return Vector<3>(random.normal(), random.normal(), random.normal()).normalized();
}
Line some_line(cairn::Random& random, double reach = 20) {
  return Line::along(somewhere(random, reach), some_direction(random));
}
/// How far two lines are apart, of Pluecker coordinates: no step of the manifold in it.
double difference(const Line& a, const Line& b) {
  return (a.direction() - b.direction()).norm() + (a.moment() - b.moment()).norm();
}

/// Three cameras as Dailey and Parnichkun have them: in the middle, to the left of it, and above.
std::vector<LineCamera> three_cameras(double baseline = 0.5) {
  const cairn::PinholeCamera camera(
      {.fx = 400, .fy = 410, .cx = 321.5, .cy = 238, .width = 640, .height = 480});
  return {LineCamera(camera, SE3()),
          LineCamera(camera, SE3(SO3::exp({0.01, -0.02, 0.005}), {-baseline, 0.01, 0.02})),
          LineCamera(camera, SE3(SO3::exp({-0.015, 0.01, 0.01}), {0.01, -baseline, -0.01}))};
}
/// What a camera sees between two points of the rig's frame.
LineSegment view_of(const LineCamera& c, const Vector<3>& a, const Vector<3>& b) {
  return {*c.camera().project(c.T_rig_camera().inverse() * a),
          *c.camera().project(c.T_rig_camera().inverse() * b)};
}
/// Two points in front of the cameras.
std::pair<Vector<3>, Vector<3>> ends(cairn::Random& random, double near, double far) {
  const double z = random.uniform(near, far);
  const Vector<3> middle(random.uniform(-0.5, 0.5) * z, random.uniform(-0.4, 0.4) * z, z);
  Vector<3> half = random.uniform(0.1, 0.2) * z * some_direction(random);
  half(2) *= 0.5;
  return {middle - half, middle + half};
}

}  // namespace

TEST_SUITE("line") {
  TEST_CASE("line: the laws of a manifold, whatever point and frame a line is held by") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 1000; ++run) {
      const Line x = some_line(random), y = some_line(random);
      Vector<4> d;
      for (int i = 0; i < 4; ++i) d(i) = random.uniform(-1, 1) * (i < 2 ? 1.5 : 20);
      CHECK((local(x, retract(x, d)) - d).norm() < 1e-11 * (1 + d.norm()));
      CHECK(difference(retract(x, cairn::local(x, y)), y) < 1e-11);
      CHECK(difference(retract(x, Vector<4>(Vector<4>::Zero())), x) < 1e-12);
      // the same line, held elsewhere and turned about itself
      const Line same(y.frame() * SO3::exp({0, 0, random.uniform(-3, 3)}), y.at(random.uniform(-50, 50)));
      CHECK(difference(same, y) < 1e-12 * 100);
      CHECK((cairn::local(x, same) - cairn::local(x, y)).norm() < 1e-11);
      const Vector<4> tiny = 1e-9 * d;
      CHECK((local(x, retract(x, tiny)) - tiny).norm() < 1e-14);
    }
    const Line z;
    CHECK(cairn::local(z, Line::along({1, 2, 3}, {0, 0, -4})).head<2>().norm() ==
          doctest::Approx(std::numbers::pi));
    CHECK(cairn::manifold_traits<Line>::finite(z));
  }

  TEST_CASE("line: Pluecker coordinates there and back, distances, and a motion moves a line as its points") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 300; ++run) {
      const Line x = some_line(random);
      CHECK(x.moment().dot(x.direction()) == doctest::Approx(0).epsilon(1e-12).scale(20));
      CHECK(difference(Line::from_pluecker(3 * x.moment(), 3 * x.direction()), x) < 1e-12 * 100);
      const Vector<3> p = somewhere(random, 10);
      double least = std::numeric_limits<double>::infinity();
      for (double s = -1; s <= 1; s += 1e-3) least = std::min(least, (x.at(x.coordinate(p) + s) - p).norm());
      CHECK(x.distance(p) == doctest::Approx(least).epsilon(1e-6));
      const SE3 T(SO3::exp(some_direction(random)), somewhere(random, 10));
      CHECK(difference(T * x, Line::through(T * x.at(-1), T * x.at(4))) < 1e-11);
    }
    CHECK_THROWS_AS(static_cast<void>(Line::through({1, 2, 3}, {1, 2, 3})), cairn::Error);
    CHECK_THROWS_AS(static_cast<void>(Line::along({std::nan(""), 0, 0}, {1, 0, 0})), cairn::Error);
    CHECK_THROWS_AS(static_cast<void>(Line::from_pluecker({1, 0, 0}, {0, 0, 0})), cairn::Error);
  }

  TEST_CASE("line: projected points of a line lie on the projected line") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const LineCamera& c : three_cameras())
      for (int run = 0; run < 200; ++run) {
        const auto [a, b] = ends(random, 2, 30);
        const LineSegment s = view_of(c, a, b);
        CHECK(c.distance(Line::through(a, b), s).norm() < 1e-9);
        CHECK(std::abs(c.plane(s).dot(a - c.centre())) < 1e-9);
        // of a pixel beside it the distance is that in the plane of the image
        const Vector<2> along = (s.to - s.from).normalized(), across(-along(1), along(0));
        const double off = random.uniform(-5, 5);
        const auto e = cairn::distance_to(c.image(Line::through(a, b)), s.from + 2.5 * along + off * across);
        CHECK(std::abs(e.distance) == doctest::Approx(std::abs(off)).epsilon(1e-6));
      }
  }

  TEST_CASE("line: straight pixels are those of the same camera without its distortion") {
    const cairn::PinholeCamera bent({.fx = 400, .fy = 410, .cx = 320, .cy = 240, .k1 = -0.2, .k2 = 0.05});
    const cairn::PinholeCamera straight({.fx = 400, .fy = 410, .cx = 320, .cy = 240});
    const Vector<3> p(0.3, -0.2, 1.1);
    CHECK((*cairn::straight_pixel(bent, *bent.project(p)) - *straight.project(p)).norm() < 1e-9);
    CHECK_FALSE(cairn::straight_pixel(bent, {std::nan(""), 0}));
  }

  TEST_CASE("line: Jacobians of the distances are those of numeric differentiation") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const LineCamera& c : three_cameras())
      for (int run = 0; run < 100; ++run) {
        const SE3 x(SO3::exp(some_direction(random)), somewhere(random, 20));
        const auto [a, b] = ends(random, 2, 20);
        LineSegment s = view_of(c, a, b);
        s.from += Vector<2>(random.normal(0, 3), random.normal(0, 3));
        const Line m = (x * Line::through(a, b)).held_at(random.uniform(-1, 1));
        const auto given = c.see(x.inverse() * m, s);
        CHECK((given.distance - c.distance(x.inverse() * m, s)).norm() < 1e-9);
        const Matrix<2, 4> by_line =
            cairn::numeric_jacobian([&](const Line& l) { return c.distance(x.inverse() * l, s); }, m);
        const Matrix<2, 6> by_pose =
            cairn::numeric_jacobian([&](const SE3& y) { return c.distance(y.inverse() * m, s); }, x);
        CHECK((given.J_line - by_line).norm() < 1e-6 * (1 + by_line.norm()));
        CHECK((given.J_pose - by_pose).norm() < 1e-6 * (1 + by_pose.norm()));
      }
  }

  TEST_CASE("line: dual numbers go through it") {
    cairn::Random random(cairn_test::seed());
    for (int run = 0; run < 50; ++run) {
      const Line x = some_line(random);
      const Vector<3> c = somewhere(random, 5);
      const auto moment = [&](const auto& l) {
        using S = typename std::decay_t<decltype(l)>::Scalar;
        return l.moment(Vector<3, S>(c.cast<S>()));
      };
      const Matrix<3, 4> by_duals = cairn::automatic_jacobian(moment, x);
      const Matrix<3, 4> by_differences = cairn::numeric_jacobian(moment, x);
      CHECK((by_duals - by_differences).norm() < 1e-7 * (1 + by_duals.norm()));
      const SE3 T(SO3::exp(some_direction(random)), c);
      const auto moved = [&](const auto& l) {
        using S = typename std::decay_t<decltype(l)>::Scalar;
        return T.cast<S>() * l;
      };
      CHECK((cairn::automatic_jacobian(moved, x) - Matrix<4>::Identity()).norm() < 1e-12);
    }
  }

  TEST_CASE("line: a covariance is that of Bartoli and Sturm's orthonormal representation") {
    // L = (n, d) = (w1 u1, w2 u2) with U of SO(3) and W of SO(2): U exp(a), W turned by b. Both are ways to
    // step over the same four dimensions: the information of the same sightings is one of Pluecker's numbers.
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto cameras = three_cameras();
    for (int run = 0; run < 30; ++run) {
      const auto [a, b] = ends(random, 3, 15);
      const Line line = Line::through(a, b);
      const Vector<3> n = line.moment(), d = line.direction();
      Matrix<3> U0;
      U0 << n.normalized(), d, cairn::detail::cross<double>(n.normalized(), d);
      const double angle = std::atan2(1.0, n.norm());
      const auto orthonormal = [&](const Vector<4>& t) {
        const Matrix<3> U = U0 * SO3::exp(t.head<3>()).matrix();
        Vector<6> L;
        L << std::cos(angle + t(3)) * U.col(0), std::sin(angle + t(3)) * U.col(1);
        return Vector<6>(L / L.tail<3>().norm());
      };
      const auto ours = [&](const Vector<4>& t) {
        const Line l = retract(line, t);
        Vector<6> L;
        L << l.moment(), l.direction();
        return L;
      };
      const auto distances = [&](const Vector<6>& L) {
        Vector<6> e;
        for (int c = 0; c < 3; ++c)
          e.segment<2>(2 * c) = cameras[static_cast<std::size_t>(c)].distance(
              Line::from_pluecker(L.head<3>(), L.tail<3>()),
              view_of(cameras[static_cast<std::size_t>(c)], a, b));
        return e;
      };
      const Vector<4> zero = Vector<4>::Zero();
      const auto of_pluecker = [&](const auto& chart) {
        const Matrix<6, 4> H =
            cairn::numeric_jacobian([&](const Vector<4>& t) { return distances(chart(t)); }, zero);
        const Matrix<6, 4> J = cairn::numeric_jacobian(chart, zero);
        return Matrix<6>(J * (H.transpose() * H).inverse() * J.transpose());
      };
      const Matrix<6> p = of_pluecker(orthonormal), q = of_pluecker(ours);
      CHECK((p - q).norm() < 1e-4 * q.norm());
    }
  }
}

TEST_SUITE("line triangulation") {
  TEST_CASE("triangulate_line: exact segments of two or three cameras give the line back") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto cameras = three_cameras();
    for (int run = 0; run < 200; ++run) {
      const auto [a, b] = ends(random, 2, 20);
      std::vector<LineView> views;
      for (const LineCamera& c : cameras) {
        // each camera sees another piece of it
        const double s = random.uniform(0, 0.3), t = random.uniform(0.7, 1);
        views.push_back({&c, view_of(c, a + s * (b - a), a + t * (b - a))});
      }
      const auto found = cairn::triangulate_line(views);
      REQUIRE(found.good());
      CHECK(found.line.distance(a) < 1e-7);
      CHECK(found.line.distance(b) < 1e-7);
      CHECK(found.chi2 < 1e-9);
      CHECK(found.high - found.low <= (b - a).norm() * 1.0001);
      CHECK(found.high - found.low >= 0.4 * (b - a).norm());
      CHECK(found.low == doctest::Approx(-found.high).epsilon(1e-3));
      const auto by_two = cairn::triangulate_line(std::span(views).first(2));
      if (by_two.good()) CHECK(by_two.line.distance(a) < 1e-5);
    }
  }

  TEST_CASE("triangulate_line: two cameras are blind along their baseline, a third above them is not") {
    const cairn::PinholeCamera camera({.fx = 400, .fy = 400, .cx = 320, .cy = 240});
    const LineCamera middle(camera, SE3()), left(camera, SE3(SO3(), {-0.5, 0, 0})),
        above(camera, SE3(SO3(), {0, -0.5, 0}));
    const Vector<3> a(-1, 0.7, 6), b(2, 0.7, 6);
    std::vector<LineView> views;
    for (const LineCamera* c : {&middle, &left, &above}) views.push_back({c, view_of(*c, a, b)});
    CHECK(cairn::triangulate_line(std::span(views).first(2)).status == LineStatus::parallel);
    CHECK(cairn::triangulate_line(std::span(views).first(1)).status == LineStatus::parallel);
    CHECK(cairn::triangulate_line({}).status == LineStatus::parallel);
    const auto found = cairn::triangulate_line(views);
    REQUIRE(found.good());
    CHECK(found.line.distance(a) < 1e-9);
    // seen to the wrong side: behind the cameras
    views = {{&middle, {{300, 100}, {300, 300}}}, {&left, {{280, 100}, {280, 300}}}};
    CHECK(cairn::triangulate_line(views).status == LineStatus::behind);
    views = {{&middle, {{300, 100}, {300, 100}}}, {&left, {{std::nan(""), 100}, {280, 300}}}};
    CHECK(cairn::triangulate_line(views).status == LineStatus::parallel);
    for (const LineStatus s :
         {LineStatus::good, LineStatus::parallel, LineStatus::behind, LineStatus::not_converged})
      CHECK(std::string(cairn::explain(s)).size() > 3);
  }

  TEST_CASE("triangulate_line: NEES of 500 lines and their residuals are in their bands") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto cameras = three_cameras();
    constexpr int runs = 500;
    constexpr double sigma = 0.1;  // a covariance is one to first order
    double nees = 0, chi2 = 0;
    for (int run = 0; run < runs;) {
      const auto [a, b] = ends(random, 3, 12);
      std::vector<LineView> views;
      for (const LineCamera& c : cameras) {
        LineSegment s = view_of(c, a, b);
        for (Vector<2>* end : {&s.from, &s.to})
          *end += Vector<2>(random.normal(0, sigma), random.normal(0, sigma));
        views.push_back({&c, s});
      }
      if (std::ranges::any_of(views,
                              [](const LineView& v) { return (v.segment.to - v.segment.from).norm() < 10; }))
        continue;  // seen from its end
      const auto found = cairn::triangulate_line(views, {.sigma = sigma});
      REQUIRE(found.good());
      ++run;
      Vector<4> error = cairn::local(found.line, Line::through(a, b));
      if (error.head<2>().norm() > 1.6) error = cairn::local(found.line, Line::through(b, a));
      nees += error.dot(found.covariance.inverse() * error) / runs;
      chi2 += found.chi2 / runs;
    }
    CHECK(cairn::chi_square_mean_band(4, runs, cairn_test::almost_sure).contains(nees));
    CHECK(cairn::chi_square_mean_band(2, runs, cairn_test::almost_sure).contains(chi2));
  }
}

TEST_SUITE("anchored line") {
  TEST_CASE(
      "anchored line: there and back, its points lie on the line, and dual to its Pluecker coordinates") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 200; ++run) {
      const SE3 anchor(SO3::exp(some_direction(random)), somewhere(random, 20));
      const auto [a, b] = ends(random, 2, 30);
      const LineSegment normalised{{a(0) / a(2), a(1) / a(2)}, {b(0) / b(2) + 0.01, b(1) / b(2)}};
      if ((normalised.to - normalised.from).norm() < 0.05) continue;  // the rays would be beside it
      const auto x = cairn::AnchoredLine::at(anchor, normalised, Line::through(a, b));
      REQUIRE(x);
      const Line line = x->line();
      CHECK(line.distance(anchor * a) < 1e-9);
      CHECK(line.distance(anchor * b) < 1e-9);
      for (const double share : {-0.2, 0.0, 0.4, 1.0}) {
        const auto p = x->point(share);
        if (!p) continue;
        CHECK(line.distance(*p) < 1e-8);
        CHECK(*x->share(*p) == doctest::Approx(share).epsilon(0.02));
      }
      const auto again = x->with(Vector<4>(0.01, -0.02, 0.3, 0.2)).about(line);
      REQUIRE(again);
      CHECK(cairn::local(*x, *again).norm() < 1e-12);
      const Matrix<6, 4> J =
          cairn::numeric_jacobian([](const cairn::AnchoredLine& y) { return y.pluecker(); }, *x);
      CHECK((x->pluecker_jacobian() - J).norm() < 1e-8);
      // Across the line the point of a ray moves by this for a step of the numbers.
      const Vector<4> step =
          1e-6 * Vector<4>(random.normal(), random.normal(), random.normal(), random.normal());
      const Matrix<4> P = step * step.transpose();
      for (const int end : {0, 1}) {
        const double moved = line.distance(*retract(*x, step).point(end));
        CHECK(x->sigma_across(end, P) == doctest::Approx(moved).epsilon(1e-3).scale(1e-9));
      }
    }
    const Line behind = Line::through({-1, 0, -5}, {1, 0, -5});
    CHECK_FALSE(cairn::AnchoredLine::at(SE3(), {{-0.2, 0}, {0.2, 0}}, behind));
    const cairn::AnchoredLine parallel = cairn::AnchoredLine().with({0, 0, 0, 1});  // to its first ray
    CHECK(std::isinf(parallel.sigma_across(0, cairn::Matrix<4>::Identity())));
    CHECK(std::isfinite(parallel.sigma_across(1, cairn::Matrix<4>::Identity())));
    CHECK_FALSE(cairn::AnchoredLine::at(SE3(), {{0.1, 0}, {0.1, 0}}, Line::through({-1, 0, 5}, {1, 0, 5})));
  }

  TEST_CASE("anchored line: distances and Jacobians by Pluecker coordinates are those by the line") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const LineCamera& c : three_cameras())
      for (int run = 0; run < 50; ++run) {
        const auto [a, b] = ends(random, 2, 20);
        const Line line = Line::through(a, b);
        LineSegment s = view_of(c, a, b);
        s.to += Vector<2>(random.normal(0, 2), random.normal(0, 2));
        const double factor = random.uniform(0.1, 10);
        const auto by_line = c.see(line, s);
        const auto by_pluecker = c.see(factor * line.moment(), factor * line.direction(), s);
        CHECK((by_line.distance - by_pluecker.distance).norm() < 1e-9);
        CHECK((by_line.J_pose - by_pluecker.J_pose).norm() < 1e-8 * (1 + by_line.J_pose.norm()));
        Vector<6> L;
        L << factor * line.moment(), factor * line.direction();
        const Matrix<2, 6> J = cairn::numeric_jacobian(
            [&](const Vector<6>& l) { return c.see(l.head<3>(), l.tail<3>(), s).distance; }, L);
        CHECK((by_pluecker.J_line - J).norm() < 1e-5 * (1 + J.norm()));
      }
  }
}

}  // namespace line_test
