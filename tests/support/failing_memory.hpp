// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Memory that ends when a test says so: replaces operator new of the whole program, so that one file of it
/// includes this, in a folder of its own.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace cairn_test {

inline std::atomic<long> allocations_left{-1};  ///< negative: no end

inline void* taken(std::size_t size, std::size_t alignment) {
  if (allocations_left.load() >= 0 && allocations_left.fetch_sub(1) <= 0) throw std::bad_alloc();
  void* memory =
      std::aligned_alloc(alignment, (std::max<std::size_t>(size, 1) + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

/// Runs with so many allocations and no more; false where they were not enough.
template <class Run>
bool enough(long allowed, Run&& run) {
  bool done = false;
  allocations_left = allowed;
  try {
    run();
    done = true;
  } catch (const std::bad_alloc&) {
    done = false;
  }
  allocations_left = -1;
  return done;
}

}  // namespace cairn_test

// Never inlined: gcc 12, seeing one half of a pair, takes it for a mismatch.
[[gnu::noinline]] void* operator new(std::size_t size) {
  return cairn_test::taken(size, 16);
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t alignment) {
  return cairn_test::taken(size, static_cast<std::size_t>(alignment));
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}
