// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Orocos BFL's extended Kalman filter, which serves it for linear models too. Its matrices are of run-time
// size, on Boost's uBLAS; its elements count from one.
#include "rivals.hpp"

#ifdef CAIRN_BENCH_BFL
#include <bfl/filter/extendedkalmanfilter.h>
#include <bfl/model/linearanalyticmeasurementmodel_gaussianuncertainty.h>
#include <bfl/model/linearanalyticsystemmodel_gaussianuncertainty.h>
#include <bfl/pdf/gaussian.h>
#include <bfl/pdf/linearanalyticconditionalgaussian.h>

#include "problems.hpp"

namespace cairn_bench {
namespace {

MatrixWrapper::Matrix matrix_of(const cairn::Matrix<cairn::dynamic>& a) {
  MatrixWrapper::Matrix result(static_cast<unsigned>(a.rows()), static_cast<unsigned>(a.cols()));
  for (int i = 0; i < a.rows(); ++i)
    for (int j = 0; j < a.cols(); ++j)
      result(static_cast<unsigned>(i + 1), static_cast<unsigned>(j + 1)) = a(i, j);
  return result;
}

MatrixWrapper::SymmetricMatrix symmetric_of(const cairn::Matrix<cairn::dynamic>& a) {
  MatrixWrapper::SymmetricMatrix result(static_cast<unsigned>(a.rows()));
  for (int i = 0; i < a.rows(); ++i)
    for (int j = 0; j <= i; ++j) {
      result(static_cast<unsigned>(i + 1), static_cast<unsigned>(j + 1)) = a(i, j);
      result(static_cast<unsigned>(j + 1), static_cast<unsigned>(i + 1)) = a(i, j);
    }
  return result;
}

MatrixWrapper::ColumnVector zeros(int n) {
  MatrixWrapper::ColumnVector result(static_cast<unsigned>(n));
  result = 0.0;
  return result;
}

struct Bfl {
  template <int N, int M>
  static double run(const cairn::Matrix<N>& f, const cairn::Matrix<N>& q, int steps) {
    static const auto z = noise<M>(64, 1.0);
    BFL::LinearAnalyticConditionalGaussian motion(matrix_of(f), BFL::Gaussian(zeros(N), symmetric_of(q)));
    BFL::LinearAnalyticSystemModelGaussianUncertainty process(&motion);
    const cairn::Matrix<M, N> h = cairn::Matrix<M, N>::Identity();
    const cairn::Matrix<M> r = cairn::Matrix<M>::Identity();
    BFL::LinearAnalyticConditionalGaussian look(matrix_of(h), BFL::Gaussian(zeros(M), symmetric_of(r)));
    BFL::LinearAnalyticMeasurementModelGaussianUncertainty sensor(&look);
    BFL::Gaussian prior(zeros(N), symmetric_of(cairn::Matrix<N>::Identity()));
    BFL::ExtendedKalmanFilter filter(&prior);
    filter.AllocateMeasModelExt(M);
    MatrixWrapper::ColumnVector seen = zeros(M);
    for (int k = 0; k < steps; ++k) {
      filter.Update(&process);
      for (int i = 0; i < M; ++i) seen(static_cast<unsigned>(i + 1)) = z[static_cast<std::size_t>(k % 64)](i);
      filter.Update(&sensor, seen);
    }
    double trace = 0;
    const MatrixWrapper::SymmetricMatrix covariance = filter.PostGet()->CovarianceGet();
    for (unsigned i = 1; i <= N; ++i) trace += covariance(i, i);
    return trace;
  }
};

}  // namespace

Rival bfl() {
  return linear_rival<Bfl>("BFL");
}

}  // namespace cairn_bench
#else
cairn_bench::Rival cairn_bench::bfl() {
  return {"BFL"};
}
#endif
