// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A pointer to a value that several owners share until one of them writes.
///
/// Different owners may be used from different threads at once; one owner may be read by several.
/// std::shared_ptr's use_count() orders nothing between threads; unique() here does: who sees it true also
/// sees all that former owners did.
#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Copying is O(1); own() copies the value where others hold it. T may be incomplete where only a Counted<T>
/// is named: trees whose branches are shared.
template <class T>
class Counted {
public:
  Counted() = default;
  Counted(const Counted& other) noexcept : held_(other.held_) {
    if (held_ != nullptr) held_->owners.fetch_add(1, std::memory_order_relaxed);
  }
  Counted(Counted&& other) noexcept : held_(std::exchange(other.held_, nullptr)) {}
  Counted& operator=(Counted other) noexcept {
    std::swap(held_, other.held_);
    return *this;
  }
  ~Counted() {
    if (held_ != nullptr && held_->owners.fetch_sub(1, std::memory_order_acq_rel) == 1) delete held_;
  }

  [[nodiscard]] explicit operator bool() const noexcept { return held_ != nullptr; }
  [[nodiscard]] const T* get() const noexcept { return held_ == nullptr ? nullptr : &held_->value; }

  /// Others hold the value too: own() would copy it.
  [[nodiscard]] bool shared() const noexcept {
    return held_ != nullptr && held_->owners.load(std::memory_order_acquire) != 1;
  }

  /// The value for this owner alone: made where there is none, copied where others hold it too.
  [[nodiscard]] T& own() {
    if (held_ == nullptr)
      held_ = new Node{};
    else if (shared())
      *this = Counted(new Node{held_->value});
    return held_->value;
  }

private:
  struct Node {
    Node() = default;
    explicit Node(const T& v) : value(v) {}
    T value{};
    std::atomic<std::uint32_t> owners{1};
  };
  explicit Counted(Node* node) noexcept : held_(node) {}

  Node* held_ = nullptr;
};

}}  // namespace cairn::CAIRN_ABI
