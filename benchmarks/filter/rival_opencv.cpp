// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// OpenCV's cv::KalmanFilter, linear only, in double.
#include "rivals.hpp"

#ifdef CAIRN_BENCH_OPENCV
#include <opencv2/video/tracking.hpp>

#include "problems.hpp"

namespace cairn_bench {
namespace {

struct OpenCv {
  template <int N, int M>
  static double run(const cairn::Matrix<N>& f, const cairn::Matrix<N>& q, int steps) {
    static const auto z = noise<M>(64, 1.0);
    cv::KalmanFilter filter(N, M, 0, CV_64F);
    cv::setIdentity(filter.measurementMatrix);
    cv::setIdentity(filter.measurementNoiseCov);
    cv::setIdentity(filter.errorCovPost);
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) {
        filter.transitionMatrix.at<double>(i, j) = f(i, j);
        filter.processNoiseCov.at<double>(i, j) = q(i, j);
      }
    cv::Mat seen(M, 1, CV_64F);
    for (int k = 0; k < steps; ++k) {
      filter.predict();
      for (int i = 0; i < M; ++i) seen.at<double>(i) = z[static_cast<std::size_t>(k % 64)](i);
      filter.correct(seen);
    }
    return cv::trace(filter.errorCovPost)[0];
  }
};

}  // namespace

Rival opencv() {
  return linear_rival<OpenCv>("OpenCV");
}

}  // namespace cairn_bench
#else
cairn_bench::Rival cairn_bench::opencv() {
  return {"OpenCV"};
}
#endif
