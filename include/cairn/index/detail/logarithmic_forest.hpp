// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The trees of a multi-kd-tree: those at rest, those being merged, and when which becomes which.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/reset_on_move.hpp>
#include <cairn/index/detail/tree_merge.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_tree_shape.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Points on their way into a tree.
template <class Scalar>
struct NewPoints {
  std::vector<Scalar> rows;
  std::vector<PointId> ids;
};

/// What the index knows when it asks for a change: `live` points of `dim` numbers, not erased in `states`.
template <class Metric>
struct ForestFacts {
  std::size_t dim;
  const Metric& metric;
  const std::vector<PointState>& states;
  std::size_t live;
  std::uint64_t now;
};

/// Time is counted in updates: points inserted or erased since the
/// beginning. Calls that throw leave the same points.
template <class Tree>
class LogarithmicForest {
public:
  using Scalar = typename Tree::Coordinate;
  using Facts = ForestFacts<typename Tree::Measure>;

  explicit LogarithmicForest(const MultiTreeShape& shape) : shape_(shape) {}

  [[nodiscard]] const MultiTreeShape& shape() const noexcept { return shape_; }
  /// All trees, also those that are being merged, smallest first.
  [[nodiscard]] std::span<const Tree* const> trees() const noexcept { return view_; }
  /// Points in them, the erased included.
  [[nodiscard]] std::size_t stored() const noexcept { return stored_; }
  [[nodiscard]] std::size_t merges_under_way() const noexcept { return merges_.size(); }
  [[nodiscard]] std::uint64_t points_moved() const noexcept { return points_moved_; }

  /// Puts new points into a tree, together with the trees they pull in; where merges are not done at once,
  /// with the first level's at once and with the others later.
  void add(NewPoints<Scalar> points, const Facts& facts);

  /// Ends the merges that are due by now and gets on with the others.
  void advance(std::uint64_t now);

  /// Drops what is erased, at once or in a merge of all.
  void shrink(const Facts& facts);

  /// Puts all that is not erased into one tree.
  void rebuild(const Facts& facts);

  void finish_merges();

private:
  using TreePointer = std::shared_ptr<const Tree>;
  using Task = MergeTask<Tree>;

  /// A tree of some points and all those of some trees that are not erased.
  TreePointer build(NewPoints<Scalar> points, std::span<const Tree* const> trees, const Facts& facts) {
    std::size_t count = points.ids.size();
    for (const Tree* tree : trees) count += tree->size();
    points.ids.reserve(count);
    points.rows.reserve(count * facts.dim);
    for (const Tree* tree : trees)
      tree->for_each([&](PointId id, std::span<const Scalar> row) {
        if (facts.states[id] == PointState::erased) return;
        points.ids.push_back(id);
        points.rows.insert(points.rows.end(), row.begin(), row.end());
      });
    points_moved_ += points.ids.size();
    return std::make_shared<const Tree>(
        Tree::from_rows(std::move(points.rows), facts.dim, points.ids, facts.metric));
  }

  /// Takes resting trees into a merge that will leave about so many points.
  void start_merge(Task task, const Range& pulled, std::size_t points, std::uint64_t now) {
    make_room();
    const bool on_thread =
        shape_.merging == Merging::background && points * task.sources.front()->dimension() > small_merge;
    merges_.emplace_back(std::move(task), now, now + updates_of_merge(shape_, points), on_thread);
    drop_resting(pulled);
  }

  /// Puts a merge's result in the place of its sources; these go back to rest where memory runs out.
  void end_merge(std::size_t i) {
    struct BackToRest {
      LogarithmicForest* index;
      std::size_t i;
      bool failed = true;
      ~BackToRest() {
        if (failed)
          for (const TreePointer& source : index->merges_[i].sources()) index->rest(source);
        index->merges_.erase(index->merges_.begin() + static_cast<std::ptrdiff_t>(i));
      }
    };
    resting_.reserve(resting_.size() + merges_[i].sources().size());
    {
      BackToRest guard{this, i};
      const TreePointer tree = merges_[i].finish();
      guard.failed = false;
      points_moved_ += tree->size();
      rest(tree);
    }
    update_view();
  }

  [[nodiscard]] std::vector<std::size_t> resting_sizes() const {
    std::vector<std::size_t> sizes;
    for (const TreePointer& tree : resting_) sizes.push_back(tree->size());
    return sizes;
  }

  /// So that what follows cannot fail half-way.
  void make_room() {
    resting_.reserve(resting_.size() + 1);
    merges_.reserve(merges_.size() + 1);
    view_.reserve(view_.size() + 1);
  }
  void rest(TreePointer tree) noexcept {
    if (tree->empty()) return;
    const auto larger = [](const TreePointer& a, const TreePointer& b) { return a->size() < b->size(); };
    resting_.insert(std::upper_bound(resting_.begin(), resting_.end(), tree, larger), std::move(tree));
  }
  void drop_resting(const Range& range) noexcept {
    resting_.erase(resting_.begin() + static_cast<std::ptrdiff_t>(range.begin),
                   resting_.begin() + static_cast<std::ptrdiff_t>(range.end));
  }
  void update_view() noexcept {
    view_.clear();
    stored_ = 0;
    for (const TreePointer& tree : resting_) view_.push_back(tree.get());
    const auto smaller = [](const Tree* a, const Tree* b) { return a->size() < b->size(); };
    for (const auto& merge : merges_)
      for (const TreePointer& tree : merge.sources())
        view_.insert(std::upper_bound(view_.begin(), view_.end(), tree.get(), smaller), tree.get());
    for (const Tree* tree : view_) stored_ += tree->size();
  }

  static constexpr std::size_t small_merge = 1 << 16;  ///< numbers; a thread would cost more than it saves

  MultiTreeShape shape_;
  std::vector<TreePointer> resting_;     ///< smallest first
  std::vector<TreeMerge<Tree>> merges_;  ///< in the order they were started
  std::vector<const Tree*> view_;
  ResetOnMove<std::size_t> stored_;
  ResetOnMove<std::uint64_t> points_moved_;
};

// Outside of the class, and so not inline: cairn::compiled may hold them (multi_kd_tree.hpp).
template <class Tree>
void LogarithmicForest<Tree>::add(NewPoints<Scalar> points, const Facts& facts) {
  const Range pulled = pulled_in(shape_, resting_sizes(), points.ids.size());
  std::vector<const Tree*> at_once;
  Task later;
  for (std::size_t i = pulled.begin; i < pulled.end; ++i)
    if (shape_.merging == Merging::at_once || shape_.level_of(resting_[i]->size()) == 0)
      at_once.push_back(resting_[i].get());
    else
      later.sources.push_back(resting_[i]);
  const TreePointer tree = build(std::move(points), at_once, facts);
  make_room();
  if (later.sources.empty()) {
    drop_resting(pulled);
    rest(tree);
  } else {
    later.sources.push_back(tree);
    if (facts.live < stored_) later.states = facts.states;
    const std::size_t count = later.points();
    start_merge(std::move(later), pulled, count, facts.now);
  }
  update_view();
}

template <class Tree>
void LogarithmicForest<Tree>::advance(std::uint64_t now) {
  for (std::size_t i = 0; i < merges_.size();)
    if (merges_[i].is_due(now))
      end_merge(i);
    else
      merges_[i++].advance(now);
}

template <class Tree>
void LogarithmicForest<Tree>::shrink(const Facts& facts) {
  if (shape_.merging == Merging::at_once || facts.live <= shape_.first_size)
    rebuild(facts);
  else if (merges_.empty())
    start_merge({resting_, facts.states}, {0, resting_.size()}, facts.live, facts.now);
}

template <class Tree>
void LogarithmicForest<Tree>::rebuild(const Facts& facts) {
  const TreePointer tree = build({}, view_, facts);
  make_room();
  merges_.clear();
  resting_.clear();
  rest(tree);
  update_view();
}

template <class Tree>
void LogarithmicForest<Tree>::finish_merges() {
  while (!merges_.empty()) end_merge(0);
}

}}}  // namespace cairn::CAIRN_ABI::detail
