// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Work that is done ahead of its use: items are made by several threads at once and taken by one, in order,
/// through a queue that never holds more than it may.
///
/// One that waits for an item makes another in the meantime. So n threads are n threads at work, wherever the
/// work is cut in two, and one thread makes each item when it is asked for. What an item is may not depend on
/// when or where it is made; then the items are the same for every number of threads.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>

namespace example {

/// Items 0, 1, ..., count - 1 of type T. take() is one thread's; the end of the object waits for the items
/// that are under way, and makes no more.
template <class T>
class Ahead {
public:
  /// make(i, thread) makes item i, by many threads at once, in any order; `thread` < threads tells them
  /// apart, 0 is the one that takes. At most `bound` items are under way or waiting to be taken. Without
  /// threads or bound (0) each counts as 1.
  Ahead(std::size_t count, unsigned threads, std::size_t bound,
        std::function<T(std::size_t item, unsigned thread)> make)
      : count_(count), make_(std::move(make)), slots_(std::max<std::size_t>(bound, 1)) {
    for (unsigned thread = 1; thread < threads; ++thread)
      makers_.emplace_back([this, thread] { work(thread); });
  }
  ~Ahead() {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    changed_.notify_all();
  }  // ~JoiningThread waits
  Ahead(const Ahead&) = delete;
  Ahead& operator=(const Ahead&) = delete;

  /// The next item. Throws what making it threw; no item can be taken after that one.
  [[nodiscard]] T take() {
    std::unique_lock lock(mutex_);
    CAIRN_EXPECTS(taken_ < count_, "ahead: there is no further item to take");
    Slot& slot = slots_[taken_ % slots_.size()];
    while (!slot.made)
      if (may_make())
        make_one(lock, 0);
      else
        changed_.wait(lock);
    if (slot.failure) std::rethrow_exception(slot.failure);
    T item = std::move(*slot.item);
    slot = Slot();
    ++taken_;
    lock.unlock();
    changed_.notify_all();
    return item;
  }

private:
  struct Slot {
    std::optional<T> item;
    std::exception_ptr failure;
    bool made = false;
  };

  [[nodiscard]] bool may_make() const noexcept {
    return !ended_ && begun_ < count_ && begun_ < taken_ + slots_.size();
  }

  void work(unsigned thread) {
    std::unique_lock lock(mutex_);
    while (!ended_ && begun_ < count_)
      if (may_make())
        make_one(lock, thread);
      else
        changed_.wait(lock);
  }

  /// Called and left with the lock held, which is open while the item is made.
  void make_one(std::unique_lock<std::mutex>& lock, unsigned thread) {
    const std::size_t i = begun_++;
    Slot made;
    lock.unlock();
    try {
      made.item.emplace(make_(i, thread));
    } catch (...) {
      made.failure = std::current_exception();
    }
    lock.lock();
    made.made = true;
    if (made.failure) ended_ = true;  // the items after it are of no use
    slots_[i % slots_.size()] = std::move(made);
    changed_.notify_all();
  }

  const std::size_t count_;
  const std::function<T(std::size_t, unsigned)> make_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Slot> slots_;  // item i is in slot i modulo their number
  std::size_t begun_ = 0;    // items that are made or under way
  std::size_t taken_ = 0;
  bool ended_ = false;
  std::vector<cairn::JoiningThread> makers_;  // the last member: they are over before the rest goes
};

}  // namespace example
