// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Parts of the image that ride along: the bonnet of the car, a robot's own chassis, a mount, dirt, a vehicle
/// that keeps its distance.
///
/// What is seen there stands still in both images however the rig moves, is found again in every frame, and
/// so outvotes a scene of which half the points are new: the rig then seems to stand, and nothing
/// contradicts. No single point can tell. But a scene that stands leaves no rest, and where the points that
/// have moved agree on a motion that would have moved the others as well, one of the two is no part of the
/// world: the one that reaches less far over the image. (Not the one with fewer points, nor the one on less
/// of the image: textured dirt had 1230 of 1340 matches of a drive, in three times as many cells as the
/// rest.) A lorry that passes a rig that stands reaches less far than the street behind it.
///
/// What is nearer covers the rest: a reach counts as many times as its points are farther. And where those
/// that moved agree, but are too few or reach too little to say so, the strongest points of the images may be
/// of what rides along: for some frames they are looked for all over the images.
///
/// A decision stands as long as the rest agrees on a motion: what a frame's motion was told by is suspected
/// in the next, however far it reaches, and a rig that stood while others moved stands until these clearly
/// reach farther. Which cells are left out for it is riding_cells.hpp's to say.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/geometry/stereo_match.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/vision/features.hpp>
#include <cairn/vision/image.hpp>

#include "hidden_cells.hpp"
#include "riding_cells.hpp"
#include "run_record.hpp"

namespace stereo_slam {

/// Where both images show a landmark: the left, then the right pixel.
struct Apparent {
  cairn::Vector<4> first;  ///< when it was first seen; not a number where that is not known
  cairn::Vector<4> now;
};

/// Matches of a frame with the map: what a pose is estimated from and, in the same order, what they look
/// like.
struct MatchesOfFrame {
  std::span<const cairn::StereoMatch> matches;
  std::span<const Apparent> apparent;
};

struct RidingAlongOptions {
  std::size_t fewest = 10;       ///< matches that can be anything
  std::size_t fewest_sure = 25;  ///< matches that can outvote others which are more
};

/// What rides along with one rig. Feed it every frame in order: watch(), then decide() where matches give a
/// pose or could, then close_frame().
class RidingAlong {
public:
  /// Of frames with images of these sizes.
  RidingAlong(cairn::ImageView left, cairn::ImageView right, const RidingAlongOptions& options = {});

  /// The points of a frame's images; cells that show others than they did are given back.
  void watch(const cairn::Features& left, const cairn::Features& right);
  /// Whether one of a pair of pixels lies where what is seen is left out.
  [[nodiscard]] bool hides(const cairn::Vector<2>& left, const cairn::Vector<2>& right) const noexcept;

  /// A motion of the rig, and what rides along by it.
  struct Decision {
    cairn::StereoPose pose;
    std::vector<std::size_t>
        riding;  ///< matches that stand still against it, ascending: no part of the world
  };
  /// Whether something rides along.
  enum Sureness { unsuspected, suspected, known };
  [[nodiscard]] Sureness sureness() const noexcept {
    return !left_alone_ ? unsuspected : left_alone_->evenly ? suspected : known;
  }

  /// Pose of some of the matches, as the first one was estimated.
  using Estimate = std::function<cairn::StereoPose(std::span<const cairn::StereoMatch>)>;
  /// Which of two motions that matches agree on is the rig's: `pose` (good or not, of all matches), or that
  /// of the others. The cells learn by it. Where there is nothing to decide this is one comparison a match,
  /// otherwise another estimate or two.
  [[nodiscard]] Decision decide(cairn::StereoPose pose, const cairn::PinholeCamera& left,
                                const MatchesOfFrame& seen, const Estimate& estimate);

  /// After a frame, whose number that is: a sentence for the notes where it is the first to say so.
  [[nodiscard]] std::optional<std::string> close_frame(std::size_t index);

  /// The frames are looked at anew from the first; the cells keep what they have learnt.
  void begin_again() noexcept { stands_against_others_ = false; }

  /// Where the next frames need points; nullptr where that is not known better. It is not another one for
  /// every cell: frames that are under way are looked at once more then.
  [[nodiscard]] const std::shared_ptr<const HiddenParts>& left_alone() const noexcept { return left_alone_; }
  [[nodiscard]] const RidingAlongRecord& record() const noexcept { return record_; }

private:
  [[nodiscard]] Decision weigh(cairn::StereoPose pose, const cairn::PinholeCamera& left,
                               const MatchesOfFrame& seen, const Estimate& estimate);
  void judge(const Decision& decision, const MatchesOfFrame& seen);

  RidingAlongOptions options_;
  std::array<RidingCells, 2> cells_;    // of the left and the right image
  bool stands_against_others_ = false;  // by the frame before: the rig, though others moved
  int doubtful_ = 0;                    // frames for which points are still to be looked for everywhere
  std::shared_ptr<const HiddenParts> left_alone_;
  RidingAlongRecord record_;
};

/// How far these points reach over the image: width times height of the rectangle that leaves a twentieth of
/// them out on each side [pixels^2].
[[nodiscard]] double reach(std::span<const cairn::Vector<2>> pixels);

}  // namespace stereo_slam
