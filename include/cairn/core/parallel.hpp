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
#include <cstddef>
#include <exception>
#include <thread>
#include <vector>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

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
  const auto start = [&](std::size_t block) {
    return count / blocks * block + std::min(block, count % blocks);
  };
  std::vector<std::exception_ptr> failures(blocks);
  const auto run = [&](std::size_t block) noexcept {
#if defined(__cpp_exceptions)
    try {
      body(start(block), start(block + 1));
    } catch (...) {
      failures[block] = std::current_exception();
    }
#else
    body(start(block), start(block + 1));
#endif
  };
  {
    std::vector<std::jthread> workers;
    workers.reserve(blocks - 1);
    for (std::size_t block = 1; block < blocks; ++block) workers.emplace_back(run, block);
    run(0);
  }
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

}}  // namespace cairn::CAIRN_ABI
