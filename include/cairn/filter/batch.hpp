// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Many small Kalman filters stepped together, as maps of landmarks need: one filter to a SIMD lane.
///
/// A batch keeps its beliefs in blocks of as many filters as a register has lanes, number by number, so that
/// one instruction serves a whole block. The arithmetic is that of Kalman (L D L^T of S, then P - W W^T on
/// the lower triangle); every lane decides for itself whether its measurement is kept, and one whose digits
/// that would cost is done again by itself (array_update.hpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/simd/processor.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Any number of Gaussians over Vector<N, S>, S float or double. Also the shape of a batch of measurements:
/// means are the values, covariances their noise.
template <int N, class S = double>
class GaussianBatch {
public:
  using Belief = Gaussian<Vector<N, S>>;
  static constexpr int triangle = N * (N + 1) / 2;
  static constexpr int lanes = detail::lane_count<S, 64>;
  using Lane = detail::RegisterFor<S, 64>;

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
    CAIRN_ASSERT(index < size_, "GaussianBatch: index past the end");
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

  /// Adds the process noise Q to every belief: states that stand still but for a random walk. Refused, and
  /// nothing changed: a Q that is no covariance or of another run-time size. O(size).
  template <int N, class S, MatrixOf<N, N, S> Q>
  Status drift(GaussianBatch<N, S>& batch, const Q& noise) const {
    bool misfit = false;
    const Matrix<N, N, S> q = detail::plain_matrix<N, N, S>(noise, N, N, misfit);
    if (misfit) return Status::size_mismatch;
    if (const Status status = detail::check_noise<N, S>(q); status != Status::accepted) return status;
    typename GaussianBatch<N, S>::Lane added[GaussianBatch<N, S>::triangle]{};
    for (int i = 0; i < N; ++i)
      for (int j = 0; j <= i; ++j) added[batch.place(i, j)] += q(i, j);
    for (auto& block : batch.blocks())
      for (int k = 0; k < batch.triangle; ++k) block.covariance[k] += added[k];
    return Status::accepted;
  }

  /// x <- F x, P <- F P F^T + Q for every belief, the same F and Q (anything that stands for a matrix).
  /// Refused, and nothing changed: another run-time size, a Q that is no covariance, an F that is not finite.
  /// A lane that leaves what numbers hold takes in nothing from then on; drift() too may carry one there.
  template <int N, class S, MatrixOf<N, N, S> F, MatrixOf<N, N, S> Q>
  Status predict(GaussianBatch<N, S>& batch, const F& f, const Q& noise) const;

  /// Belief i takes in measurement i = N(z_i, R_i) of all its states (H = I). Returns how many were kept;
  /// `kept`, where given, gets a 1 or 0 for each. Throws Error where the sizes differ. A lane whose numbers
  /// are not finite, whose S or what would be left of P is not positive definite, as where R_i is no
  /// covariance, or whose NIS is above the gate stays as it was.
  template <int N, class S>
  std::size_t update(GaussianBatch<N, S>& batch, const GaussianBatch<N, S>& seen,
                     std::span<std::uint8_t> kept = {}) const;
};

namespace detail {

/// Which lanes of a block may take their measurement in, and which would have lost their digits (all bits
/// set, or zero).
template <class Mask>
struct BlockVerdict {
  Mask good, doubtful;
};

/// Every bit of a mask is set. Asked of one byte a lane: fewer words.
template <class Mask>
[[gnu::always_inline]] [[nodiscard]] inline bool all_lanes(const Mask& mask) {
  using Bytes [[gnu::vector_size(sizeof(Mask) / sizeof(mask[0]))]] = signed char;
  const Bytes bytes = __builtin_convertvector(mask, Bytes);
  Bytes all{};
  all = ~all;
  return std::memcmp(&bytes, &all, sizeof(Bytes)) == 0;
}

/// One block: P and x with z and R, to `next`. What of it is kept is the caller's: where all lanes are good,
/// as they mostly are, nothing is mixed.
template <int N, class S>
[[gnu::always_inline]] inline auto update_block(const typename GaussianBatch<N, S>::Block& belief,
                                                const typename GaussianBatch<N, S>::Block& seen, S gate,
                                                typename GaussianBatch<N, S>::Block& next) {
  using Batch = GaussianBatch<N, S>;
  using Lane = typename Batch::Lane;
  Lane w[N][N];  // w[m][i]: P L^-T, column m
  Lane pivot[N];
  Lane y[N];
  Lane lower[N][N];
  each<N>([&](int i) CAIRN_INLINED {
    y[i] = seen.mean[i] - belief.mean[i];
    each<N>(0, i + 1, [&](int j) CAIRN_INLINED {
      w[j][i] = w[i][j] = belief.covariance[Batch::place(i, j)];
      lower[i][j] = belief.covariance[Batch::place(i, j)] + seen.covariance[Batch::place(i, j)];
    });
  });
  constexpr S least = S(4) * digits_left<S>;
  Lane nis{};
  Lane in_s = lower[0][0];  // what is left of a pivot of S above its rounding; NaN shows in the NIS
  each<N>([&](int m) CAIRN_INLINED {
    pivot[m] = S(1) / lower[m][m];
    const int place = Batch::place(m, m);
    if (m > 0) in_s = lesser(in_s, lower[m][m] - (belief.covariance[place] + seen.covariance[place]) * least);
    nis = m == 0 ? y[m] * y[m] * pivot[m] : nis + y[m] * y[m] * pivot[m];
    each<N>(m + 1, N, [&](int i) CAIRN_INLINED {
      const Lane factor = lower[i][m] * pivot[m];
      each<N>(m + 1, i + 1, [&](int k) CAIRN_INLINED { lower[i][k] -= factor * lower[k][m]; });
      y[i] -= factor * y[m];
      each<N>([&](int k) CAIRN_INLINED { w[i][k] -= factor * w[m][k]; });
    });
  });
  each<N>([&](int m) CAIRN_INLINED {
    const typename Batch::Block& before = m == 0 ? belief : next;
    each<N>([&](int i) CAIRN_INLINED {
      const Lane scaled = w[m][i] * pivot[m];
      next.mean[i] = before.mean[i] + scaled * y[m];
      each<N>(0, i + 1, [&](int j) CAIRN_INLINED {
        const int place = Batch::place(i, j);
        next.covariance[place] = before.covariance[place] - scaled * w[m][j];
      });
    });
  });
  // And of what is left of P. That has as many negative pivots as R: with both S and P positive, one says
  // that R is no covariance. Three doubles do without a division, a tenth of the time: row i is then `scale`
  // times what elimination leaves of it, a product of four variances at the most. Where that is out of the
  // range of numbers that have all their digits, the lane is done by itself.
  constexpr bool divides = N > 3 || sizeof(S) < sizeof(double);
  constexpr S floor = divides ? S(0) : std::numeric_limits<S>::min() / std::numeric_limits<S>::epsilon();
  Lane in_p = next.covariance[0] - belief.covariance[0] * least;
  Lane none = next.mean[0] + seen.covariance[0];  // not finite beside what is not
  Lane scale{};
  each<N>([&](int i) CAIRN_INLINED {
    each<N>(0, i + 1, [&](int j) CAIRN_INLINED { lower[i][j] = next.covariance[Batch::place(i, j)]; });
  });
  each<N>(0, N - 1, [&](int m) CAIRN_INLINED {
    const Lane lead = lower[m][m];
    const Lane inverse = divides ? S(1) / lead : lead;
    each<N>(m + 1, N, [&](int i) CAIRN_INLINED {
      const Lane factor = divides ? lower[i][m] * inverse : lower[i][m];
      each<N>(m + 1, i + 1, [&](int k) CAIRN_INLINED {
        lower[i][k] = (divides ? lower[i][k] : lead * lower[i][k]) - factor * lower[k][m];
      });
    });
    scale = m == 0 ? lead : scale * lead;
    const int place = Batch::place(m + 1, m + 1);
    const Lane rounding = belief.covariance[place] * least;
    in_p = lesser(in_p, lower[m + 1][m + 1] - (divides ? rounding : rounding * scale));
    none += next.mean[m + 1] + seen.covariance[place] + lower[m + 1][m + 1];
  });
  const auto sound = in_s > S(0);
  const auto taken = nis <= gate;
  const auto good = sound & taken & (in_p > floor) & (none - none == S(0));
  // Doubtful too: a sum of finite numbers that is not.
  return BlockVerdict<std::remove_const_t<decltype(good)>>{good, ~sound | (taken & ~good)};
}

/// Calls take(number, its next) for all numbers of a block. One by one: a copy of the whole would keep `next`
/// in memory.
template <class Block, class Take>
[[gnu::always_inline]] inline void each_number(Block& belief, const Block& next, const Take& take) {
  constexpr int means = static_cast<int>(std::extent_v<decltype(belief.mean)>);
  constexpr int covariances = static_cast<int>(std::extent_v<decltype(belief.covariance)>);
  each<means>([&](int i) CAIRN_INLINED { take(belief.mean[i], next.mean[i]); });
  each<covariances>([&](int i) CAIRN_INLINED { take(belief.covariance[i], next.covariance[i]); });
}

/// The filter of one lane alone.
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool update_lane(GaussianBatch<N, S>& batch,
                                                         const GaussianBatch<N, S>& seen, std::size_t index,
                                                         double gate) {
  auto belief = batch.get(index);
  const auto z = seen.get(index);
  const bool good = correct<Vector<N, S>, N>(belief, Identity<N, S>{}, z.covariance,
                                             Vector<N, S>(z.mean - belief.mean), gate, Form::standard)
                        .accepted();
  if (good) batch.set(index, belief);
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
    typename GaussianBatch<N, S>::Block next;
    const auto verdict = detail::update_block<N, S>(batch.blocks()[b], seen.blocks()[b], limit, next);
    const std::size_t first = b * lanes;
    const std::size_t used = batch.size() - first < lanes ? batch.size() - first : lanes;
    if (kept.empty() && used == lanes && detail::all_lanes(verdict.good)) [[likely]] {
      detail::each_number(batch.blocks()[b], next,
                          [](auto& before, const auto& after) CAIRN_INLINED { before = after; });
      count += lanes;
      continue;
    }
    detail::each_number(batch.blocks()[b], next, [&](auto& before, const auto& after) CAIRN_INLINED {
      before = verdict.good ? after : before;
    });
    for (std::size_t lane = 0; lane < used; ++lane) {
      bool good = verdict.good[lane] != 0;
      if (verdict.doubtful[lane] != 0) [[unlikely]]
        good = detail::update_lane(batch, seen, first + lane, gate);
      count += good ? 1 : 0;
      if (!kept.empty()) kept[first + lane] = good ? 1 : 0;
    }
  }
  return count;
}

template <int N, class S, MatrixOf<N, N, S> F, MatrixOf<N, N, S> Q>
Status BatchKalman::predict(GaussianBatch<N, S>& batch, const F& f, const Q& noise) const {
  using Batch = GaussianBatch<N, S>;
  using Lane = typename Batch::Lane;
  bool misfit = false;
  const Matrix<N, N, S> a = detail::plain_matrix<N, N, S>(f, N, N, misfit);
  const Matrix<N, N, S> q = detail::plain_matrix<N, N, S>(noise, N, N, misfit);
  if (misfit) return Status::size_mismatch;
  if (!all_finite(a)) return Status::not_finite;
  if (const Status status = detail::check_noise<N, S>(q); status != Status::accepted) return status;
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
  return Status::accepted;
}

}}  // namespace cairn::CAIRN_ABI
