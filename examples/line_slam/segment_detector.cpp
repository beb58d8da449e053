// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "segment_detector.hpp"

#include <cairn/core/check.hpp>

#ifdef LINE_SLAM_HAS_OPENCV

#include <cstddef>
#include <cstdint>
#include <string>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace line_slam {

bool has_segment_detector() noexcept {
  return true;
}

std::vector<cairn::LineSegment> segments_of(cairn::ImageView image, double shortest) {
  // OpenCV has no matrix of constant pixels; the detector does not write to its picture.
  const cv::Mat pixels(image.height(), image.width(), CV_8UC1, const_cast<std::uint8_t*>(image.row(0)),
                       static_cast<std::size_t>(image.stride()));
  std::vector<cv::Vec4f> found;
  constexpr double scale = 0.8;  // the detector looks at a smaller picture, against stairs along edges
  try {
    cv::createLineSegmentDetector(cv::LSD_REFINE_STD, scale)->detect(pixels, found);
  } catch (const cv::Exception& error) {  // OpenCV 3.4.6 to 3.4.15 and 4.1 to 4.5.3 have it in name only
    cairn::raise(std::string("OpenCV's line segment detector: ") + error.what());
  }
  // Made smaller, the middle of pixel x comes to (x + 0.5) scale - 0.5; what is found there is only divided.
  constexpr double shift = 0.5 / scale - 0.5;
  std::vector<cairn::LineSegment> segments;
  for (const cv::Vec4f& s : found) {
    const cairn::LineSegment segment{{s[0] + shift, s[1] + shift}, {s[2] + shift, s[3] + shift}};
    if (segment.length() >= shortest) segments.push_back(segment);
  }
  return segments;
}

}  // namespace line_slam

#else

namespace line_slam {

bool has_segment_detector() noexcept {
  return false;
}

std::vector<cairn::LineSegment> segments_of(cairn::ImageView, double) {
  cairn::raise(
      "line_slam: the segment detector is OpenCV's, and this program was built without (Debian: "
      "libopencv-dev)");
}

}  // namespace line_slam

#endif
