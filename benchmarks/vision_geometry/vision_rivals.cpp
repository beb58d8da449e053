// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "vision_rivals.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#if CAIRN_BENCH_HAS_DLIB
#include <dlib/array2d.h>
#include <dlib/image_keypoint.h>
#endif
#if CAIRN_BENCH_HAS_OPENCV
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#endif

namespace vision_bench {

namespace {

#if CAIRN_BENCH_HAS_DLIB
cairn::Features dlib_surf(cairn::ImageView image, int count) {
  dlib::array2d<unsigned char> pixels(image.height(), image.width());
  for (int y = 0; y < image.height(); ++y) std::copy_n(image.row(y), image.width(), &pixels[y][0]);
  cairn::Features features;
  features.dimension = 64;
  for (const dlib::surf_point& point : dlib::get_surf_points(pixels, count, 5.0)) {
    cairn::Keypoint keypoint;
    keypoint.x = static_cast<float>(point.p.center.x());
    keypoint.y = static_cast<float>(point.p.center.y());
    keypoint.scale = static_cast<float>(point.p.scale);
    keypoint.response = static_cast<float>(point.p.score);
    keypoint.laplacian = point.p.laplacian < 0 ? -1 : 1;
    features.keypoints.push_back(keypoint);
    for (long n = 0; n < 64; ++n) features.descriptors.push_back(static_cast<float>(point.des(n)));
  }
  return features;
}
#endif

#if CAIRN_BENCH_HAS_OPENCV
cv::Mat borrowed(cairn::ImageView image) {
  // OpenCV has no matrix of constant pixels; nothing here writes to it.
  return {image.height(), image.width(), CV_8UC1, const_cast<std::uint8_t*>(image.row(0)),
          static_cast<std::size_t>(image.stride())};
}

std::vector<float> numbers_of(const cv::Mat& descriptors) {
  std::vector<float> numbers;
  for (int i = 0; i < descriptors.rows; ++i)
    for (int n = 0; n < descriptors.cols; ++n) {
      if (descriptors.type() == CV_32F) {
        numbers.push_back(descriptors.at<float>(i, n));
        continue;
      }
      for (int bit = 0; bit < 8; ++bit)
        numbers.push_back(static_cast<float>(descriptors.at<unsigned char>(i, n) >> bit & 1));
    }
  return numbers;
}

/// `shift` is added to coordinates.
cairn::Features opencv_features(const cv::Ptr<cv::Feature2D>& extractor, cairn::ImageView image, int count,
                                float shift) {
  std::vector<cv::KeyPoint> found;
  cv::Mat descriptors;
  const cv::Mat pixels = borrowed(image);
  extractor->detect(pixels, found);
  cv::KeyPointsFilter::retainBest(found, count);
  extractor->compute(pixels, found, descriptors);
  cairn::Features features;
  for (const cv::KeyPoint& point : found) {
    cairn::Keypoint keypoint;
    keypoint.x = point.pt.x + shift;
    keypoint.y = point.pt.y + shift;
    keypoint.scale = point.size / 2;
    keypoint.angle = point.angle;
    keypoint.response = point.response;
    features.keypoints.push_back(keypoint);
  }
  features.descriptors = numbers_of(descriptors);
  features.dimension = found.empty() ? 0 : static_cast<int>(features.descriptors.size() / found.size());
  return features;
}
#endif

}  // namespace

std::vector<Extractor> rival_extractors() {
  std::vector<Extractor> extractors;
#if CAIRN_BENCH_HAS_DLIB
  extractors.push_back({"dlib SURF", dlib_surf});
#endif
#if CAIRN_BENCH_HAS_OPENCV
  cv::setNumThreads(1);
  // OpenCV before 4.8 doubles the image with its corner in the wrong place: a quarter of a pixel (its
  // #23123).
  extractors.push_back({"OpenCV SIFT", [](cairn::ImageView image, int count) {
                          return opencv_features(cv::SIFT::create(count), image, count, -0.25F);
                        }});
  extractors.push_back({"OpenCV ORB", [](cairn::ImageView image, int count) {
                          return opencv_features(cv::ORB::create(count), image, count, 0);
                        }});
  extractors.push_back({"OpenCV AKAZE", [](cairn::ImageView image, int count) {
                          const auto akaze = cv::AKAZE::create(cv::AKAZE::DESCRIPTOR_MLDB, 0, 3, 0.0002F);
                          return opencv_features(akaze, image, count, 0);
                        }});
#endif
  return extractors;
}

std::optional<cairn::Image> jpeg_coded([[maybe_unused]] const cairn::Image& image,
                                       [[maybe_unused]] int quality) {
#if CAIRN_BENCH_HAS_OPENCV
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", borrowed(image), bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  const cv::Mat decoded = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  return cairn::Image(
      cairn::ImageView(decoded.data, decoded.cols, decoded.rows, static_cast<std::ptrdiff_t>(decoded.step)));
#else
  return std::nullopt;
#endif
}

}  // namespace vision_bench
