// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Recorded drives: what the readers of the public formats have in common.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <cairn/geometry/camera.hpp>

#include "dataset.hpp"

namespace stereo_slam {

struct RecordedFrame {
  std::size_t index = 0;
  double time = 0;  ///< [s]
  std::filesystem::path left;
  std::filesystem::path right;
  std::optional<cairn::SE3> truth;  ///< T_world_left
};

/// A drive as its files describe it; images are read frame by frame later.
struct Recording {
  std::string name;
  cairn::StereoRig rig;
  std::vector<RecordedFrame> frames;
  std::vector<std::string> notes;
};

/// The recording as a data set of at most `frames` frames (0 = all). Frames before the first with a known
/// pose are left out, and notes() says so: errors are measured from the first frame. Every image must have
/// the size that the rig says; where the rig says 0, the size of the first image.
[[nodiscard]] std::unique_ptr<Dataset> play(Recording recording, std::size_t frames);

/// Readers of the formats. Throw cairn::Error naming the file and what was expected. Times may be equal, as
/// those of published drives are, and may not run backwards; two images of one number or time, two poses of
/// one frame and two lines of one key are refused.
/// KITTI odometry: image_0, image_1, calib.txt with P0 and P1, times.txt, and poses in poses.txt or
/// ../../poses/<name>.txt; or image_l, image_r and a calib.txt of two rows without names.
[[nodiscard]] Recording read_kitti_odometry(const std::filesystem::path& folder);

/// KITTI raw, unrectified: image_00/data, image_01/data, calib_cam_to_cam.txt in the folder, in calib or
/// above it. A pose file of the rectified camera 0 (poses_cam0_rectified.txt: frame number, then 3 x 4
/// numbers) is used where there is one.
[[nodiscard]] Recording read_kitti_raw(const std::filesystem::path& folder);

/// EuRoC: mav0/cam0, mav0/cam1 and, where there is one, mav0/state_groundtruth_estimate0.
[[nodiscard]] Recording read_euroc(const std::filesystem::path& folder);

/// Pairs of images by the shell's patterns for their names, without a rig.
struct ImageGlobs {
  std::string left, right;     ///< as in "drive/left/*.png"
  std::optional<double> rate;  ///< frames a second; nothing: the names are times, where they look like some
};

/// Images are paired by the last number in their names where they have some in common (those without a
/// partner are left out, and notes say so), otherwise in order if they are as many. Names with 13, 16 or 19
/// digits are times since 1970 in milli-, micro- or nanoseconds, those with a decimal point seconds; names
/// are sorted as people count. Throws where there is no image or they do not pair up.
[[nodiscard]] Recording read_images(const ImageGlobs& images);

/// The image files (.png, .pgm) of a folder, sorted by name. Throws where there are none.
[[nodiscard]] std::vector<std::filesystem::path> image_files(const std::filesystem::path& folder,
                                                             const std::string& expected);

/// Whether there is such a regular file; false where that cannot be told.
[[nodiscard]] bool is_file(const std::filesystem::path& path);

/// Throws unless `folder` is one; `expected` says what should be in it.
void require_folder(const std::filesystem::path& folder, const std::string& expected);

/// A camera as calibrations say it: fx, fy, cx, cy; k1, k2, p1, p2, k3; width and height [pixels]. Throws
/// naming the file unless the size is a sensible one.
[[nodiscard]] cairn::PinholeParameters pinhole(const std::array<double, 4>& lens,
                                               const std::vector<double>& distortion,
                                               const std::vector<double>& size,
                                               const std::filesystem::path& file);

/// The number that a file's name is ("000012.png" is 12), or nothing.
[[nodiscard]] std::optional<std::size_t> number_of(const std::filesystem::path& file);

/// Frame numbers for people: "frame 3" or "frames 3, 7-9".
[[nodiscard]] std::string frames_text(const std::vector<std::size_t>& sorted);

/// Lines "key: number number ..." of a calibration file; keys whose values are no numbers are passed over.
class KeyedNumbers {
public:
  explicit KeyedNumbers(const std::filesystem::path& file);

  [[nodiscard]] bool has(const std::string& key) const { return values_.count(key) != 0; }
  /// Throws naming the file unless the key is there with `count` finite numbers.
  [[nodiscard]] const std::vector<double>& at(const std::string& key, std::size_t count) const;

private:
  std::string file_;
  std::map<std::string, std::vector<double>> values_;
};

}  // namespace stereo_slam
