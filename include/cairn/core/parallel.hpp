// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Splitting a loop over threads without changing its result.
///
/// parallel_for cuts [0, count) into contiguous blocks, one a thread; a body that writes only to its own
/// indices gives the same bits for every thread count.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <exception>
#include <memory>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A thread that is waited for where it goes out of scope: std::jthread, which libc++ has from version 20 on.
class JoiningThread {
public:
  template <std::invocable Work>
  explicit JoiningThread(Work work) : thread_(std::move(work)) {}
  JoiningThread(JoiningThread&&) noexcept = default;
  JoiningThread& operator=(JoiningThread&&) = delete;
  ~JoiningThread() {
    if (thread_.joinable()) thread_.join();
  }

private:
  std::thread thread_;
};

namespace detail {

/// body_of(body, begin, end) on `blocks` > 1 threads; compiled once, whatever the body is.
inline void run_blocks(std::size_t count, std::size_t blocks,
                       void (*body_of)(void*, std::size_t, std::size_t), void* body) {
  const auto start = [&](std::size_t block) {
    return count / blocks * block + std::min(block, count % blocks);
  };
  std::vector<std::exception_ptr> failures(blocks);
  const auto run = [&](std::size_t block) noexcept {
#if defined(__cpp_exceptions)
    try {
      body_of(body, start(block), start(block + 1));
    } catch (...) {
      failures[block] = std::current_exception();
    }
#else
    body_of(body, start(block), start(block + 1));
#endif
  };
  {
    std::vector<JoiningThread> workers;
    workers.reserve(blocks - 1);
    for (std::size_t block = 1; block < blocks; ++block) workers.emplace_back([&run, block] { run(block); });
    run(0);
  }
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

}  // namespace detail

/// Calls body(begin, end) on contiguous blocks that cover [0, count), on up to `threads` threads (0 counts as
/// 1; the caller's thread takes the first block). Returns when all are done; the first block's exception that
/// was thrown, in block order, is rethrown. Starting a thread costs tens of microseconds: not for loops
/// shorter than that.
template <class Body>
void parallel_for(std::size_t count, unsigned threads, Body&& body) {
  const std::size_t blocks = std::clamp<std::size_t>(threads, 1, std::max<std::size_t>(count, 1));
  if (blocks == 1) {
    if (count > 0) body(std::size_t{0}, count);
    return;
  }
  using Plain = std::remove_reference_t<Body>;
  detail::run_blocks(
      count, blocks,
      [](void* of, std::size_t begin, std::size_t end) { (*static_cast<Plain*>(of))(begin, end); },
      const_cast<std::remove_const_t<Plain>*>(std::addressof(body)));
}

}}  // namespace cairn::CAIRN_ABI
