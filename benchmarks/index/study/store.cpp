// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "study/store.hpp"

#include <vector>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/kd_tree.hpp>

namespace cairn_study {
namespace {

using cairn::NearestTwo;

Found found_by(const NearestTwo<float>& two) {
  return {two.id(), two.first(), two.second()};
}

/// Exact search of few numbers, in a tree or a forest.
template <class Index>
Found search_exactly(const Index& index, const float* query, std::size_t dim, cairn::Work& work) {
  NearestTwo<float> two;
  index.search(std::span(query, dim), two, &work);
  return found_by(two);
}

/// Best-bin-first, with one queue for all trees of a forest.
template <class Index>
class BudgetedSearch {
public:
  Found operator()(const Index& index, const float* query, std::size_t leaves, cairn::Work& work) {
    NearestTwo<float> two;
    search_.search(index, std::span(query, index.dimension()), two, {.leaves = leaves}, &work);
    return found_by(two);
  }

private:
  cairn::BestBinFirst<Index> search_;
};

template <std::size_t Dim>
class SingleTree final : public Store {
public:
  explicit SingleTree(const StoreOptions& options) : options_(options) {}
  void stage(std::span<const float> rows) override { rows_.insert(rows_.end(), rows.begin(), rows.end()); }
  void insert(std::span<const float> rows) override {
    stage(rows);
    tree_ = cairn::KdTree<float, Dim>::from_rows(rows_, options_.dim);
    moved_ += tree_.size();
  }
  Found search(const float* query) override {
    if constexpr (Dim == 3) return search_exactly(tree_, query, options_.dim, work);
    return budgeted_(tree_, query, options_.leaves, work);
  }
  [[nodiscard]] std::size_t bytes() const override {
    return tree_.bytes() + rows_.capacity() * sizeof(float);
  }
  [[nodiscard]] std::uint64_t points_moved() const override { return moved_; }
  [[nodiscard]] std::size_t trees() const override { return 1; }

private:
  StoreOptions options_;
  std::vector<float> rows_;
  cairn::KdTree<float, Dim> tree_;
  BudgetedSearch<cairn::KdTree<float, Dim>> budgeted_;
  std::uint64_t moved_ = 0;
};

template <std::size_t Dim>
class Forest final : public Store {
public:
  Forest(const StoreOptions& options, const cairn::MultiTreeShape& shape)
      : options_(options), index_(shape) {}
  void insert(std::span<const float> rows) override { index_.insert(cairn::Rows<float>(rows, options_.dim)); }
  Found search(const float* query) override {
    if constexpr (Dim == 3)
      return search_exactly(index_, query, options_.dim, work);
    else
      return budgeted_(index_, query, options_.leaves, work);
  }
  [[nodiscard]] std::size_t bytes() const override { return index_.bytes(); }
  [[nodiscard]] std::uint64_t points_moved() const override { return index_.points_moved(); }
  [[nodiscard]] std::size_t trees() const override { return index_.tree_count(); }

private:
  StoreOptions options_;
  cairn::MultiKdTree<float, Dim> index_;
  BudgetedSearch<cairn::MultiKdTree<float, Dim>> budgeted_;
};

/// Points in blocks of sixteen, coordinate by coordinate, as the leaves of a tree hold them.
class Scan final : public Store {
public:
  explicit Scan(const StoreOptions& options) : dim_(options.dim) {}
  void insert(std::span<const float> rows) override {
    for (std::size_t i = 0; i < rows.size() / dim_; ++i, ++count_) {
      const std::size_t lane = count_ % cairn::detail::block_size;
      if (lane == 0) blocks_.resize(blocks_.size() + cairn::detail::block_size * dim_, far_away);
      float* block = blocks_.data() + blocks_.size() - cairn::detail::block_size * dim_;
      for (std::size_t a = 0; a < dim_; ++a) block[a * cairn::detail::block_size + lane] = rows[i * dim_ + a];
    }
  }
  Found search(const float* query) override {
    NearestTwo<float> two;
    cairn::detail::with_widest_lanes([&]() CAIRN_INLINED { scan(query, two); });
    work.distances += count_;
    return found_by(two);
  }
  [[nodiscard]] std::size_t bytes() const override { return blocks_.capacity() * sizeof(float); }
  [[nodiscard]] std::uint64_t points_moved() const override { return count_; }
  [[nodiscard]] std::size_t trees() const override { return 0; }

private:
  static constexpr float far_away = 1e15F;  ///< where the places not yet taken are

  [[gnu::always_inline]] void scan(const float* query, NearestTwo<float>& two) const {
    constexpr std::size_t lanes = cairn::detail::block_size;
    for (std::size_t first = 0; first < count_; first += lanes) {
      cairn::detail::Block<float> sums{};
      for (std::size_t a = 0; a < dim_; ++a) {
        cairn::detail::Block<float> numbers;
        cairn::detail::load_block<float>(&blocks_[(first / lanes * dim_ + a) * lanes], numbers);
        numbers = query[a] - numbers;
        sums = sums + numbers * numbers;
      }
      for (unsigned mask = cairn::detail::mask_below<float>(sums, two.limit()); mask != 0; mask &= mask - 1) {
        const auto lane = static_cast<unsigned>(std::countr_zero(mask));
        if (first + lane < count_) two.offer(static_cast<cairn::PointId>(first + lane), sums[lane]);
      }
    }
  }

  std::size_t dim_;
  std::size_t count_ = 0;
  std::vector<float> blocks_;
};

}  // namespace

std::unique_ptr<Store> make_single_tree(const StoreOptions& options) {
  if (options.dim == 3) return std::make_unique<SingleTree<3>>(options);
  return std::make_unique<SingleTree<cairn::dynamic_dim>>(options);
}

std::unique_ptr<Store> make_forest(const StoreOptions& options, const cairn::MultiTreeShape& shape) {
  if (options.dim == 3) return std::make_unique<Forest<3>>(options, shape);
  return std::make_unique<Forest<cairn::dynamic_dim>>(options, shape);
}

std::unique_ptr<Store> make_scan(const StoreOptions& options) {
  return std::make_unique<Scan>(options);
}

}  // namespace cairn_study
