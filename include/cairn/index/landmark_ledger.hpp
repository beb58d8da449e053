// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The life of landmarks by number alone: who is on probation, who has become base, who is gone.
///
/// A new landmark is on probation. Seen in `base_seen_times` steps it becomes base and stays; first seen more
/// than `max_nonbase_time` steps ago and still not base, it expires. Nothing here knows of descriptors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/index/collectors.hpp>

namespace cairn { inline namespace CAIRN_ABI {

using LandmarkId = PointId;

namespace detail {

/// Room for one element more, growing as push_back() does.
template <class T>
void reserve_one_more(std::vector<T>& elements) {
  if (elements.size() == elements.capacity()) elements.reserve(2 * elements.size() + 1);
}

}  // namespace detail

/// When a landmark is to be trusted, and how long it may take to earn that; the thesis's constants.
struct Probation {
  std::uint32_t base_seen_times = 3;   ///< steps in which it was seen, the first included
  std::uint32_t max_nonbase_time = 7;  ///< steps after the first
};

/// What the end of a step changed, in the order of the ids.
struct StepReport {
  std::vector<LandmarkId> promoted;  ///< became base
  std::vector<LandmarkId> expired;   ///< ran out of time, and are gone
};

/// Counts sightings and steps. Ids are 0, 1, 2, ... and never given twice.
class LandmarkLedger {
public:
  explicit LandmarkLedger(Probation probation = {}) noexcept : probation_(probation) {}

  [[nodiscard]] std::uint32_t step() const noexcept { return step_; }
  [[nodiscard]] std::size_t size() const noexcept { return probation_size() + base_size_; }
  [[nodiscard]] std::size_t base_size() const noexcept { return base_size_; }
  [[nodiscard]] std::size_t probation_size() const noexcept { return probation_size_; }
  [[nodiscard]] bool contains(LandmarkId id) const noexcept {
    return id < records_.size() && records_[id].standing != Standing::gone;
  }
  [[nodiscard]] bool is_base(LandmarkId id) const noexcept {
    return id < records_.size() && records_[id].standing == Standing::base;
  }
  /// Steps in which a landmark was seen, and the first and the last of them. The id must be in the ledger.
  [[nodiscard]] std::uint32_t sightings(LandmarkId id) const { return at(id).sightings; }
  [[nodiscard]] std::uint32_t first_seen(LandmarkId id) const { return at(id).first; }
  [[nodiscard]] std::uint32_t last_seen(LandmarkId id) const { return at(id).last; }

  /// A new landmark, seen in the current step.
  LandmarkId add() {
    CAIRN_EXPECTS(records_.size() < no_point, "LandmarkLedger: 2^32 - 1 landmarks have been numbered");
    const auto id = static_cast<LandmarkId>(records_.size());
    detail::reserve_one_more(on_probation_);  // so that nothing fails once the record stands
    records_.push_back({step_, step_, 1, Standing::probation});
    on_probation_.push_back(id);
    ++probation_size_;
    return id;
  }

  /// The landmark was seen in the current step; saying so again in the same step changes nothing.
  void sighted(LandmarkId id) {
    CAIRN_EXPECTS(contains(id), "LandmarkLedger::sighted: no such landmark");
    Record& record = records_[id];
    if (record.last == step_) return;
    record.last = step_;
    ++record.sightings;
  }

  /// The landmark earned its trust elsewhere, in an earlier run say: it is base from the next step on.
  void trust(LandmarkId id) {
    CAIRN_EXPECTS(contains(id), "LandmarkLedger::trust: no such landmark");
    records_[id].sightings = std::max(records_[id].sightings, probation_.base_seen_times);
  }

  /// Removes a landmark; false where there is none of that id.
  bool erase(LandmarkId id) {
    if (!contains(id)) return false;
    --(is_base(id) ? base_size_ : probation_size_);
    records_[id].standing = Standing::gone;
    return true;
  }

  /// Two landmarks turned out to be one: `twin` goes, `kept` takes over its sightings (a step in which both
  /// were seen counts twice) and its age; where either was base, `kept` is from the next step on.
  void merge(LandmarkId kept, LandmarkId twin) {
    CAIRN_EXPECTS(contains(kept) && contains(twin), "LandmarkLedger::merge: no such landmark");
    CAIRN_EXPECTS(kept != twin, "LandmarkLedger::merge: a landmark is no twin of itself");
    Record& record = records_[kept];
    record.first = std::min(record.first, records_[twin].first);
    record.last = std::max(record.last, records_[twin].last);
    record.sightings += records_[twin].sightings;
    if (is_base(twin)) record.sightings = std::max(record.sightings, probation_.base_seen_times);
    erase(twin);
  }

  /// Landmarks not seen for more than `steps` steps, in the order of their ids. O(ids given so far).
  [[nodiscard]] std::vector<LandmarkId> unseen_for(std::uint32_t steps) const {
    std::vector<LandmarkId> found;
    for (LandmarkId id = 0; id < records_.size(); ++id)
      if (contains(id) && step_ - records_[id].last > steps) found.push_back(id);
    return found;
  }

  /// Ends the step: promotes and expires. Where memory runs out the step has not ended.
  StepReport advance() {
    StepReport report;
    for (const LandmarkId id : on_probation_) switch (verdict_on(records_[id])) {
        case Verdict::promoted:
          report.promoted.push_back(id);
          break;
        case Verdict::expired:
          report.expired.push_back(id);
          break;
        case Verdict::stays:
        case Verdict::gone:
          break;
      }
    const auto done = [&](LandmarkId id) { return verdict_on(records_[id]) != Verdict::stays; };
    on_probation_.erase(std::remove_if(on_probation_.begin(), on_probation_.end(), done),
                        on_probation_.end());
    for (const LandmarkId id : report.promoted) records_[id].standing = Standing::base;
    probation_size_ -= report.promoted.size();
    base_size_ += report.promoted.size();
    for (const LandmarkId id : report.expired) erase(id);
    ++step_;
    return report;
  }

private:
  enum class Standing : std::uint8_t { probation, base, gone };
  struct Record {
    std::uint32_t first;
    std::uint32_t last;
    std::uint32_t sightings;
    Standing standing;
  };

  /// What the end of this step makes of a landmark that was on probation.
  enum class Verdict { promoted, expired, stays, gone };
  [[nodiscard]] Verdict verdict_on(const Record& record) const noexcept {
    if (record.standing != Standing::probation) return Verdict::gone;  // erased meanwhile
    if (record.sightings >= probation_.base_seen_times) return Verdict::promoted;
    return step_ + 1 - record.first > probation_.max_nonbase_time ? Verdict::expired : Verdict::stays;
  }

  [[nodiscard]] const Record& at(LandmarkId id) const {
    CAIRN_EXPECTS(contains(id), "LandmarkLedger: no such landmark");
    return records_[id];
  }

  Probation probation_;
  ResetOnMove<std::uint32_t> step_;
  std::vector<Record> records_;
  std::vector<LandmarkId> on_probation_;
  ResetOnMove<std::size_t> probation_size_;
  ResetOnMove<std::size_t> base_size_;
};

}}  // namespace cairn::CAIRN_ABI
