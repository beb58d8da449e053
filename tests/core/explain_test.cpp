// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <concepts>
#include <ostream>
#include <sstream>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/explain.hpp>
#include <cairn/field/correlation.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/geometry/alignment.hpp>
#include <cairn/geometry/line_triangulation.hpp>
#include <cairn/geometry/motion_calibration.hpp>
#include <cairn/geometry/robust_alignment.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/scan/match.hpp>
#include <cairn/slam/map_location.hpp>

namespace explain_test {
namespace {

template <class Value>
concept Prints = requires(std::ostream& out, const Value& value) {
  { out << value } -> std::same_as<std::ostream&>;
};
enum class OfSomebody { first };

static_assert(Prints<cairn::FixVerdict> && Prints<cairn::PatchVerdict>);
static_assert(Prints<cairn::AlignmentStatus> && Prints<cairn::LineStatus> && Prints<cairn::StereoPoseStatus>);
static_assert(Prints<cairn::MotionCalibrationStatus> && Prints<cairn::RobustAlignmentStatus>);
static_assert(Prints<cairn::TriangulationStatus> && Prints<cairn::MatchStatus>);
static_assert(Prints<cairn::MapLocationStatus>);
static_assert(!Prints<OfSomebody> && !Prints<cairn::Innovation<2>>);

TEST_CASE("explain: a status prints as its sentence, and so does what is a status and no more") {
  std::ostringstream out;
  out << cairn::Status::gated << '|' << cairn::UpdateResult(cairn::Status::depleted) << '|' << 3;
  CHECK(out.str() ==
        std::string(explain(cairn::Status::gated)) + '|' + explain(cairn::Status::depleted) + "|3");
  std::wostringstream wide;
  wide << cairn::TriangulationStatus{};
  CHECK(wide.str().size() == std::string(explain(cairn::TriangulationStatus{})).size());
}

}  // namespace
}  // namespace explain_test
