// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A merge of several trees into one that is under way: done in pieces by whoever owns it, or on a thread.
///
/// The trees merged are shared and never change, and what is erased is known from a copy taken at the start,
/// so the thread reads nothing that anybody writes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <future>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <cairn/index/detail/kd_builder.hpp>
#include <cairn/index/kd_tree.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

enum class PointState : std::uint8_t { unknown, entering, live, erased };

/// Sources to merge, without the points that are erased in `states` (empty: none is).
template <class Tree>
struct MergeTask {
  std::vector<std::shared_ptr<const Tree>> sources;
  std::vector<PointState> states;

  [[nodiscard]] std::size_t points() const noexcept {
    std::size_t points = 0;
    for (const auto& source : sources) points += source->size();
    return points;
  }
};

/// The work of a merge, a piece at a time.
template <class Tree>
class MergeWork {
public:
  explicit MergeWork(MergeTask<Tree> task)
      : task_(std::move(task)), builder_(task_.sources.front()->dimension()) {
    builder_.reserve(task_.points());
  }

  /// Work of a whole merge, in points that are moved.
  [[nodiscard]] static std::uint64_t work(std::size_t points) noexcept {
    return points + Builder::work(points);
  }

  /// Goes on until so much work has been done since the start.
  void advance(std::uint64_t until) {
    while (done_ < until) {
      const std::uint64_t piece = source_ < task_.sources.size() ? gather() : builder_.advance();
      if (piece == 0) return;
      done_ += piece;
    }
  }

  [[nodiscard]] std::shared_ptr<const Tree> finish() {
    advance(std::numeric_limits<std::uint64_t>::max());
    const Tree& any = *task_.sources.front();
    return std::make_shared<const Tree>(
        TreeAccess::from_parts<Tree>(builder_.finish(), any.dimension(), any.metric()));
  }

private:
  using Builder = KdBuilder<typename Tree::Coordinate, Tree::fixed_dimension>;
  static constexpr std::size_t leaves_in_piece = 256;

  std::uint64_t gather() {
    const Tree& source = *task_.sources[source_];
    const Range leaves{leaf_, std::min(leaf_ + leaves_in_piece, source.leaves())};
    std::uint64_t points = 0;
    TreeAccess::blocks(source).for_each(leaves, [&](PointId id, auto row) {
      ++points;
      if (task_.states.empty() || task_.states[id] != PointState::erased) builder_.add(id, row.data());
    });
    leaf_ = leaves.end;
    if (leaf_ == source.leaves()) {
      ++source_;
      leaf_ = 0;
    }
    return points;
  }

  MergeTask<Tree> task_;
  Builder builder_;
  std::size_t source_ = 0;
  std::size_t leaf_ = 0;
  std::uint64_t done_ = 0;
};

/// A merge and when it ends, counted in updates of the index.
template <class Tree>
class TreeMerge {
public:
  /// Throws std::system_error where no thread can be started.
  TreeMerge(MergeTask<Tree> task, std::uint64_t begin, std::uint64_t due, bool on_thread)
      : sources_(task.sources), work_of_all_(MergeWork<Tree>::work(task.points())), begin_(begin), due_(due) {
    if (on_thread) {
      result_ = std::async(std::launch::async, [task = std::move(task)]() mutable {
                  return MergeWork<Tree>(std::move(task)).finish();
                }).share();
    } else {
      work_.emplace(std::move(task));
    }
  }

  [[nodiscard]] std::span<const std::shared_ptr<const Tree>> sources() const noexcept { return sources_; }
  [[nodiscard]] bool is_due(std::uint64_t updates) const noexcept { return updates >= due_; }

  /// Does the share of the work that is to be done by now.
  void advance(std::uint64_t updates) {
    if (!work_) return;
    const double share = static_cast<double>(updates - begin_) / static_cast<double>(due_ - begin_);
    work_->advance(static_cast<std::uint64_t>(share * static_cast<double>(work_of_all_)));
  }

  /// The merged tree; waits for the thread, or does what is left.
  [[nodiscard]] std::shared_ptr<const Tree> finish() { return work_ ? work_->finish() : result_.get(); }

private:
  std::vector<std::shared_ptr<const Tree>> sources_;
  std::uint64_t work_of_all_;
  std::uint64_t begin_;
  std::uint64_t due_;
  std::optional<MergeWork<Tree>> work_;
  std::shared_future<std::shared_ptr<const Tree>> result_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
