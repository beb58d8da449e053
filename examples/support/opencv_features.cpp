// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "opencv_features.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include <cairn/core/check.hpp>

namespace example {
namespace {

/// OpenCV before 4.8 doubles the image with its corner in the wrong place: a quarter of a pixel (its #23123).
constexpr float sift_shift = CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR < 408 ? -0.25F : 0.0F;

/// OpenCV has no matrix of constant pixels; detectors do not write to theirs.
cv::Mat borrowed(cairn::ImageView image) {
  return {image.height(), image.width(), CV_8UC1, const_cast<std::uint8_t*>(image.row(0)),
          static_cast<std::size_t>(image.stride())};
}

/// Degrees, or -1 for none, in radians within (-pi, pi].
float radians(float degrees) {
  if (degrees < 0) return 0;
  return (degrees > 180 ? degrees - 360 : degrees) * std::numbers::pi_v<float> / 180;
}

void append_unit(const float* numbers, int count, std::vector<float>& to) {
  float squares = 0;
  for (int n = 0; n < count; ++n) squares += numbers[n] * numbers[n];
  const float factor = squares > 0 ? 1 / std::sqrt(squares) : 0;
  for (int n = 0; n < count; ++n) to.push_back(factor * numbers[n]);
}

void append_bits(const std::uint8_t* bytes, int count, std::vector<float>& to) {
  for (int n = 0; n < count; ++n)
    for (int bit = 0; bit < 8; ++bit) to.push_back((bytes[n] >> bit & 1) != 0 ? 1.0F / 16 : 0.0F);
}

/// A total order, so that ties do not depend on the detector's threads.
std::vector<std::size_t> strongest_first(const std::vector<cv::KeyPoint>& points) {
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto key = [&](std::size_t i) {
    const cv::KeyPoint& point = points[i];
    return std::tuple(-point.response, point.pt.y, point.pt.x, point.size, point.angle);
  };
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) { return key(a) < key(b); });
  return order;
}

}  // namespace

OpenCvFeatures::OpenCvFeatures(std::shared_ptr<cv::Feature2D> extractor, int dimension, float scale_of_size,
                               float shift)
    : extractor_(std::move(extractor)), scale_of_size_(scale_of_size), shift_(shift) {
  features_.dimension = dimension;
}

OpenCvFeatures OpenCvFeatures::sift(int count) {
  return {cv::SIFT::create(count), 128, 0.5F, sift_shift};  // the diameter is two sigmas
}

OpenCvFeatures OpenCvFeatures::orb(int count) {
  return {cv::ORB::create(count), 256, 1.2F / 31, 0.0F};  // a patch of 31 pixels about the finest corners
}

const cairn::Features& OpenCvFeatures::operator()(cairn::ImageView image) {
  features_.keypoints.clear();
  features_.descriptors.clear();
  if (image.empty()) return features_;
  std::vector<cv::KeyPoint> points;
  cv::Mat descriptors;
  try {
    extractor_->detectAndCompute(borrowed(image), cv::noArray(), points, descriptors);
  } catch (const cv::Exception& error) {
    cairn::raise(std::string("OpenCV: ") + error.what());
  }
  for (const std::size_t i : strongest_first(points)) {
    const cv::KeyPoint& point = points[i];
    features_.keypoints.push_back({.x = point.pt.x + shift_,
                                   .y = point.pt.y + shift_,
                                   .scale = point.size * scale_of_size_,
                                   .angle = radians(point.angle),
                                   .response = point.response});
    const int row = static_cast<int>(i);
    if (descriptors.type() == CV_32F)
      append_unit(descriptors.ptr<float>(row), descriptors.cols, features_.descriptors);
    else
      append_bits(descriptors.ptr<std::uint8_t>(row), descriptors.cols, features_.descriptors);
  }
  return features_;
}

}  // namespace example
