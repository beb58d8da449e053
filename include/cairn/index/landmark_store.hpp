// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The landmark store: descriptors that are matched, earn trust, and are kept in one tree or in several.
///
/// ```cpp
/// cairn::MultiTreeStore<64> store({.classes = 2});
/// for (const Frame& frame : frames) {
///   // against all that was added in the steps before
///   const auto matches = store.match_all(frame.descriptors, frame.labels, test, budget);
///   for (std::size_t i = 0; i < matches.size(); ++i)
///     if (matches[i])
///       store.sighted(matches[i]->id);
///     else
///       store.add(frame.descriptor(i), frame.labels[i]);
///   const cairn::StepReport report = store.advance();  // promoted, expired; the new ones can be found now
/// }
/// ```
///
/// SingleTreeStore rebuilds one tree of everything at each step: O(n log n). MultiTreeStore rebuilds a tree
/// of the landmarks on probation and keeps the base ones in a multi-kd-tree: polylogarithmic, amortised. With
/// an unlimited budget both give the same matches, up to ties. Landmarks of different classes (bright and
/// dark blobs) never match.
///
/// The first step's descriptors teach the store their mean and principal axes; everything is kept and
/// searched turned to those (principal_axes.hpp), which changes distances by no more than rounding and needs
/// about a third of the budget.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/detail/landmark_trees.hpp>
#include <cairn/index/landmark_ledger.hpp>
#include <cairn/index/principal_axes.hpp>
#include <cairn/index/ratio_test.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A landmark that passed the ratio test, with true descriptor distances. `second_distance` is infinite where
/// nothing within ratio * max_distance was met.
struct LandmarkMatch {
  LandmarkId id = no_point;
  float distance = std::numeric_limits<float>::infinity();
  float second_distance = std::numeric_limits<float>::infinity();
  bool operator==(const LandmarkMatch&) const = default;
};

/// Settings of a store.
struct LandmarkStoreOptions {
  Probation probation{};
  unsigned classes = 1;    ///< labels are 0 ... classes - 1
  MultiTreeShape shape{};  ///< of the multi-kd-tree; a single-tree store ignores it
};

/// What a pipeline needs of a store; it does not care which.
template <class S>
concept LandmarkStore = requires(S& store, const S& fixed, LandmarkId id, std::span<const float> numbers,
                                 std::span<const unsigned> labels, RatioTest test, Budget budget) {
  { store.add(numbers, 0U) } -> std::same_as<LandmarkId>;
  store.sighted(id);
  { store.erase(id) } -> std::same_as<bool>;
  { store.advance() } -> std::same_as<StepReport>;
  { fixed.match(numbers, 0U, test, budget) } -> std::same_as<std::optional<LandmarkMatch>>;
  {
    fixed.match_all(numbers, labels, test, budget, 1U)
  } -> std::same_as<std::vector<std::optional<LandmarkMatch>>>;
  { fixed.contains(id) } -> std::same_as<bool>;
  { fixed.is_base(id) } -> std::same_as<bool>;
  { fixed.size() } -> std::same_as<std::size_t>;
  { fixed.base_size() } -> std::same_as<std::size_t>;
};

/// The store over an arrangement of trees (landmark_trees.hpp). Dim float numbers a descriptor, L2. Const
/// methods may run at the same time.
template <std::size_t Dim, class Trees>
class BasicLandmarkStore {
public:
  using Tree = typename Trees::Tree;
  static constexpr std::size_t dimension = Dim;

  explicit BasicLandmarkStore(const LandmarkStoreOptions& options = {}) : ledger_(options.probation) {
    CAIRN_EXPECTS(options.classes >= 1, "LandmarkStore: there must be at least one class");
    trees_.assign(options.classes, Trees(options.shape));
  }

  [[nodiscard]] std::size_t size() const noexcept { return ledger_.size(); }
  [[nodiscard]] std::size_t base_size() const noexcept { return ledger_.base_size(); }
  [[nodiscard]] bool contains(LandmarkId id) const noexcept { return ledger_.contains(id); }
  [[nodiscard]] bool is_base(LandmarkId id) const noexcept { return ledger_.is_base(id); }
  /// Sightings and ages of the landmarks.
  [[nodiscard]] const LandmarkLedger& ledger() const noexcept { return ledger_; }
  /// Points written into trees so far: the work of updating.
  [[nodiscard]] std::uint64_t points_moved() const noexcept {
    std::uint64_t moved = 0;
    for (const Trees& trees : trees_) moved += trees.points_moved();
    return moved;
  }

  /// A new landmark of the current step, found by searches after advance(). Throws Error where a number of
  /// the descriptor is not finite, naming it.
  template <Point Descriptor>
  LandmarkId add(const Descriptor& descriptor, unsigned label = 0) {
    CAIRN_EXPECTS(label < trees_.size(), "LandmarkStore::add: the label is not below the number of classes");
    Row row;
    detail::copy_point<float>(descriptor, Dim, row.data(), {"LandmarkStore: landmark", label_.size()});
    trees_[label].reserve_one();
    detail::reserve_one_more(label_);
    const LandmarkId id = ledger_.add();  // the last that can fail
    label_.push_back(label);
    trees_[label].add(id, turned(row));
    return id;
  }

  /// The landmark was seen in this step (add() counts as a sighting).
  void sighted(LandmarkId id) { ledger_.sighted(id); }

  /// The landmark earned its trust elsewhere, in an earlier run say: it is base from the next step on.
  void trust(LandmarkId id) { ledger_.trust(id); }

  /// Removes a landmark at once; false where there is none of that id.
  bool erase(LandmarkId id) {
    if (!ledger_.contains(id)) return false;
    trees_[label_[id]].erase(id, ledger_.is_base(id));
    return ledger_.erase(id);
  }

  /// `twin` turned out to be `kept`: it goes, its sightings and its age are kept's now.
  void merge(LandmarkId kept, LandmarkId twin) {
    CAIRN_EXPECTS(contains(kept) && contains(twin) && kept != twin,
                  "LandmarkStore::merge: two landmarks of the store are needed");
    trees_[label_[twin]].erase(twin, ledger_.is_base(twin));
    ledger_.merge(kept, twin);
  }

  /// Removes the landmarks, base ones too, that were not seen for more than `steps` steps; returns them.
  /// Where memory runs out the others are removed by the next call.
  std::vector<LandmarkId> forget_unseen(std::uint32_t steps) {
    std::vector<LandmarkId> forgotten = ledger_.unseen_for(steps);
    for (const LandmarkId id : forgotten) erase(id);
    return forgotten;
  }

  /// Ends the step: promotes, expires, and makes what was added searchable. Where memory runs out no landmark
  /// is lost and matching stays right, but the step may have ended without a report, and what was added in it
  /// becomes searchable by the next call.
  StepReport advance() {
    if (!axes_ && size() > 0) learn_axes();
    StepReport report = ledger_.advance();
    for (Trees& trees : trees_) trees.settle(ledger_);
    return report;
  }

  /// The landmark of class `label` that passes the ratio test. Throws Error for a query that is not finite.
  template <Point Descriptor>
  [[nodiscard]] std::optional<LandmarkMatch> match(const Descriptor& query, unsigned label,
                                                   const RatioTest& test, Budget budget = {},
                                                   Work* work = nullptr) const {
    BestBinFirst<Tree> search;
    return match(search, query, label, test, budget, work, 0);
  }

  /// match() for each of the queries (Dim numbers each, one after the other). No labels mean label 0 for all.
  /// The answers do not depend on the number of threads.
  [[nodiscard]] std::vector<std::optional<LandmarkMatch>> match_all(std::span<const float> queries,
                                                                    std::span<const unsigned> labels,
                                                                    const RatioTest& test, Budget budget = {},
                                                                    unsigned threads = 1,
                                                                    Work* work = nullptr) const {
    const Rows<float> rows(queries, Dim);
    CAIRN_EXPECTS(labels.empty() || labels.size() == rows.size(),
                  "LandmarkStore::match_all: one label a query");
    std::vector<std::optional<LandmarkMatch>> matches(rows.size());
    std::vector<Work> works(work != nullptr ? rows.size() : 0);
    parallel_for(rows.size(), threads, [&](std::size_t begin, std::size_t end) {
      BestBinFirst<Tree> search;
      for (std::size_t i = begin; i < end; ++i)
        matches[i] = match(search, rows[i], labels.empty() ? 0 : labels[i], test, budget,
                           work != nullptr ? &works[i] : nullptr, i);
    });
    for (const Work& one : works) *work += one;
    return matches;
  }

private:
  using Row = std::array<float, Dim>;

  /// Turns `row` where the axes are known, and returns it.
  Row& turned(Row& row) const noexcept {
    if (!axes_) return row;
    const Row before = row;
    axes_->turn_about_mean(before.data(), row.data());
    return row;
  }

  /// From the landmarks of the first step, which are all there are and not yet in any tree.
  void learn_axes() {
    std::vector<float> all;
    for (Trees& trees : trees_) all.insert(all.end(), trees.rows().begin(), trees.rows().end());
    axes_.emplace(Rows<float>(all, Dim), std::size_t{2048});
    for (Trees& trees : trees_)
      for (std::size_t i = 0; i < trees.rows().size(); i += Dim) {
        Row row;
        std::copy_n(trees.rows().data() + i, Dim, row.data());
        axes_->turn_about_mean(row.data(), trees.rows().data() + i);
      }
  }

  /// Passes on the landmarks that are not gone.
  struct Present {
    const LandmarkLedger* ledger;
    RatioTestMatch<float> best;
    [[nodiscard]] float limit() const noexcept { return best.limit(); }
    void offer(LandmarkId id, float reduced) noexcept {
      if (ledger->contains(id)) best.offer(id, reduced);
    }
  };

  template <Point Descriptor>
  std::optional<LandmarkMatch> match(BestBinFirst<Tree>& search, const Descriptor& query, unsigned label,
                                     const RatioTest& test, Budget budget, Work* work,
                                     std::size_t number) const {
    CAIRN_EXPECTS(label < trees_.size(),
                  "LandmarkStore::match: the label is not below the number of classes");
    Row row;
    detail::copy_point<float>(query, Dim, row.data(), {"LandmarkStore: query", number});
    const Row& in_tree = turned(row);
    Present present{&ledger_, RatioTestMatch<float>(test, L2{})};
    search.search(trees_[label].list().get(), in_tree.data(), present, budget, work);
    if (!present.best.accepted()) return std::nullopt;
    return LandmarkMatch{present.best.id(), present.best.first(), present.best.second()};
  }

  LandmarkLedger ledger_;
  std::vector<unsigned> label_;
  std::optional<PrincipalAxes> axes_;
  std::vector<Trees> trees_;
};

/// One tree of everything, rebuilt at each step.
template <std::size_t Dim>
using SingleTreeStore = BasicLandmarkStore<Dim, detail::SingleTree<Dim>>;

/// A tree of the landmarks on probation, rebuilt at each step, and a multi-kd-tree of the base ones.
template <std::size_t Dim>
using MultiTreeStore = BasicLandmarkStore<Dim, detail::ProbationAndMultiTree<Dim>>;

}}  // namespace cairn::CAIRN_ABI
