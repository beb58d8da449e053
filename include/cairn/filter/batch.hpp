// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Many small Kalman filters stepped together, as maps of landmarks need: one filter to a SIMD lane.
///
/// A batch keeps its beliefs in blocks of as many filters as a register has lanes, number by number, so that
/// one instruction serves a whole block. The arithmetic is that of Kalman (L D L^T of S, then P - W W^T on
/// the lower triangle); every lane decides for itself whether its measurement is kept.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kernels.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/structure.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// Any number of Gaussians over Vector<N, S>, S float or double. Also the shape of a batch of measurements:
/// means are the values, covariances their noise.
template <int N, class S = double>
class GaussianBatch {
public:
  using Belief = Gaussian<Vector<N, S>>;
  static constexpr int triangle = N * (N + 1) / 2;
  static constexpr int lanes = static_cast<int>(detail::lane_bytes<64, S> / sizeof(S));
  using Lane = typename detail::RegisterOf<S, detail::lane_bytes<64, S>>::type;

  /// `lanes` filters; covariance holds the lower triangle row by row.
  struct Block {
    Lane mean[N];
    Lane covariance[triangle];
  };

  GaussianBatch() = default;
  /// `count` copies of `belief`.
  GaussianBatch(std::size_t count, const Belief& belief) {
    blocks_.reserve(count / lanes + 1);
    for (std::size_t i = 0; i < count; ++i) add(belief);
  }

  [[nodiscard]] std::size_t size() const noexcept { return size_; }

  /// Appends a belief and returns its index. Lanes of an unfinished block hold N(0, I).
  std::size_t add(const Belief& belief) {
    if (size_ % lanes == 0) blocks_.push_back(idle());
    set(size_++, belief);
    return size_ - 1;
  }
  void set(std::size_t index, const Belief& belief) {
    CAIRN_ASSERT(index < size_ + 1, "GaussianBatch: index past the end");
    Block& block = blocks_[index / lanes];
    const std::size_t lane = index % lanes;
    for (int i = 0; i < N; ++i) {
      block.mean[i][lane] = belief.mean(i);
      for (int j = 0; j <= i; ++j) block.covariance[place(i, j)][lane] = belief.covariance(i, j);
    }
  }
  [[nodiscard]] Belief get(std::size_t index) const {
    CAIRN_ASSERT(index < size_, "GaussianBatch: index past the end");
    const Block& block = blocks_[index / lanes];
    const std::size_t lane = index % lanes;
    Belief belief;
    for (int i = 0; i < N; ++i) {
      belief.mean(i) = block.mean[i][lane];
      for (int j = 0; j <= i; ++j)
        belief.covariance(i, j) = belief.covariance(j, i) = block.covariance[place(i, j)][lane];
    }
    return belief;
  }

  [[nodiscard]] std::span<Block> blocks() noexcept { return blocks_; }
  [[nodiscard]] std::span<const Block> blocks() const noexcept { return blocks_; }

  /// Where entry (i, j), j <= i, of a covariance stands in a block.
  [[nodiscard]] static constexpr int place(int i, int j) noexcept { return i * (i + 1) / 2 + j; }

private:
  [[nodiscard]] static Block idle() {
    Block block{};
    for (int i = 0; i < N; ++i) block.covariance[place(i, i)] += S(1);
    return block;
  }

  std::vector<Block> blocks_;
  std::size_t size_ = 0;
};

/// The Kalman filter for batches. Options only.
struct BatchKalman {
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0

  /// Adds the process noise Q to every belief: states that stand still but for a random walk. Throws Error
  /// where Q has another run-time size. O(size).
  template <int N, class S, MatrixOf<N, N, S> Q>
  void drift(GaussianBatch<N, S>& batch, const Q& noise) const {
    const Matrix<N, N, S> q = fitting<N, S>(noise);
    for (auto& block : batch.blocks())
      for (int i = 0; i < N; ++i)
        for (int j = 0; j <= i; ++j) block.covariance[batch.place(i, j)] += q(i, j);
  }

  /// x <- F x, P <- F P F^T + Q for every belief, the same F and Q (anything that stands for a matrix).
  /// Throws Error where one has another run-time size.
  template <int N, class S, MatrixOf<N, N, S> F, MatrixOf<N, N, S> Q>
  void predict(GaussianBatch<N, S>& batch, const F& f, const Q& noise) const;

  /// Belief i takes in measurement i = N(z_i, R_i) of all its states (H = I). Returns how many were kept;
  /// `kept`, where given, gets a 1 or 0 for each. Throws Error where the sizes differ. A lane whose numbers
  /// are not finite, whose S is not positive definite or whose NIS is above the gate stays as it was.
  template <int N, class S>
  std::size_t update(GaussianBatch<N, S>& batch, const GaussianBatch<N, S>& seen,
                     std::span<std::uint8_t> kept = {}) const;

private:
  template <int N, class S, class A>
  [[nodiscard]] static Matrix<N, N, S> fitting(const A& a) {
    bool misfit = false;
    const Matrix<N, N, S> plain = detail::plain_matrix<N, N, S>(a, N, N, misfit);
    if (misfit) raise("BatchKalman: expected a square matrix with a row for each number of a belief");
    return plain;
  }
};

namespace detail {

/// One block: P and x with z and R; returns the mask of kept lanes (all bits set, or zero).
template <int N, class S>
[[gnu::always_inline]] inline auto update_block(typename GaussianBatch<N, S>::Block& belief,
                                                const typename GaussianBatch<N, S>::Block& seen, S gate) {
  using Batch = GaussianBatch<N, S>;
  using Lane = typename Batch::Lane;
  Lane w[N][N];  // w[m][i]: P L^-T, column m
  Lane pivot[N];
  Lane y[N];
  Lane lower[N][N];
  for (int i = 0; i < N; ++i) {
    y[i] = seen.mean[i] - belief.mean[i];
    for (int j = 0; j <= i; ++j) {
      w[j][i] = w[i][j] = belief.covariance[Batch::place(i, j)];
      lower[i][j] = belief.covariance[Batch::place(i, j)] + seen.covariance[Batch::place(i, j)];
    }
  }
  Lane nis = y[0] * S(0);
  auto good = nis == nis;
  for (int m = 0; m < N; ++m) {
    pivot[m] = S(1) / lower[m][m];
    good &= lower[m][m] > S(0);
    nis += y[m] * y[m] * pivot[m];
    for (int i = m + 1; i < N; ++i) {
      const Lane factor = lower[i][m] * pivot[m];
      for (int k = m + 1; k <= i; ++k) lower[i][k] -= factor * lower[k][m];
      y[i] -= factor * y[m];
      for (int k = 0; k < N; ++k) w[i][k] -= factor * w[m][k];
    }
  }
  good &= nis <= gate;
  typename Batch::Block next = belief;
  for (int m = 0; m < N; ++m)
    for (int i = 0; i < N; ++i) {
      const Lane scaled = w[m][i] * pivot[m];
      next.mean[i] += scaled * y[m];
      for (int j = 0; j <= i; ++j) next.covariance[Batch::place(i, j)] -= scaled * w[m][j];
    }
  for (int i = 0; i < N; ++i) {
    good &= next.covariance[Batch::place(i, i)] > S(0);
    good &= next.mean[i] - next.mean[i] == S(0);
  }
  for (int i = 0; i < N; ++i) belief.mean[i] = good ? next.mean[i] : belief.mean[i];
  for (int i = 0; i < Batch::triangle; ++i)
    belief.covariance[i] = good ? next.covariance[i] : belief.covariance[i];
  return good;
}

}  // namespace detail

template <int N, class S>
std::size_t BatchKalman::update(GaussianBatch<N, S>& batch, const GaussianBatch<N, S>& seen,
                                std::span<std::uint8_t> kept) const {
  if (batch.size() != seen.size() || (!kept.empty() && kept.size() != batch.size()))
    raise("BatchKalman::update: expected one measurement (and one flag) for each belief");
  if (!(gate > 0.0)) raise("BatchKalman::update: expected a gate above zero");
  const S limit = gate < static_cast<double>(std::numeric_limits<S>::max()) ? static_cast<S>(gate)
                                                                            : std::numeric_limits<S>::max();
  constexpr std::size_t lanes = GaussianBatch<N, S>::lanes;
  std::size_t count = 0;
  for (std::size_t b = 0; b < batch.blocks().size(); ++b) {
    const auto good = detail::update_block<N, S>(batch.blocks()[b], seen.blocks()[b], limit);
    const std::size_t first = b * lanes;
    const std::size_t used = batch.size() - first < lanes ? batch.size() - first : lanes;
    for (std::size_t lane = 0; lane < used; ++lane) {
      count += good[lane] != 0 ? 1 : 0;
      if (!kept.empty()) kept[first + lane] = good[lane] != 0 ? 1 : 0;
    }
  }
  return count;
}

template <int N, class S, MatrixOf<N, N, S> F, MatrixOf<N, N, S> Q>
void BatchKalman::predict(GaussianBatch<N, S>& batch, const F& f, const Q& noise) const {
  using Batch = GaussianBatch<N, S>;
  using Lane = typename Batch::Lane;
  const Matrix<N, N, S> a = fitting<N, S>(f);
  const Matrix<N, N, S> q = fitting<N, S>(noise);
  for (auto& block : batch.blocks()) {
    Lane u[N][N];  // F P
    Lane x[N];
    for (int i = 0; i < N; ++i) {
      x[i] = block.mean[0] * a(i, 0);
      for (int k = 1; k < N; ++k) x[i] += block.mean[k] * a(i, k);
      for (int j = 0; j < N; ++j) {
        u[i][j] = block.covariance[Batch::place(j, 0)] * a(i, 0);
        for (int k = 1; k < N; ++k)
          u[i][j] += block.covariance[k <= j ? Batch::place(j, k) : Batch::place(k, j)] * a(i, k);
      }
    }
    for (int i = 0; i < N; ++i) {
      block.mean[i] = x[i];
      for (int j = 0; j <= i; ++j) {
        Lane sum = u[i][0] * a(j, 0);
        for (int k = 1; k < N; ++k) sum += u[i][k] * a(j, k);
        block.covariance[Batch::place(i, j)] = sum + q(i, j);
      }
    }
  }
}

}  // namespace cairn::inline CAIRN_ABI
