// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How far a long run has come: one line that rewrites itself on a terminal, one line for every tenth
/// elsewhere.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <ostream>
#include <string>
#include <string_view>

#include <unistd.h>

namespace example {

/// Counts steps towards a known total. Not for several threads at once.
class Progress {
public:
  using Clock = std::chrono::steady_clock;

  /// `total` steps of what `name` says. On a terminal the line is rewritten at most ten times a second.
  Progress(std::ostream& out, std::string name, std::size_t total, bool terminal)
      : out_(out), name_(std::move(name)), total_(total), terminal_(terminal), start_(Clock::now()) {}

  /// To standard error, which is a terminal or not.
  Progress(std::ostream& standard_error, std::string name, std::size_t total)
      : Progress(standard_error, std::move(name), total, ::isatty(STDERR_FILENO) == 1) {}

  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// Leaves the cursor on a line of its own, also after an exception.
  ~Progress() {
    if (terminal_ && shown_) out_ << '\n' << std::flush;
  }

  /// One step is done; `remark` says what it brought ("812 landmarks").
  void step(std::string_view remark = {}) {
    ++done_;
    if (terminal_) {
      const Clock::time_point now = Clock::now();
      if (shown_ && done_ != total_ && now - last_ < std::chrono::milliseconds(100)) return;
      last_ = now;
      out_ << '\r' << line(remark) << "\x1b[K" << std::flush;
      shown_ = true;
    } else if (tenths(done_) > tenths(done_ - 1)) {
      out_ << line(remark) << '\n' << std::flush;
    }
  }

  [[nodiscard]] std::size_t done() const noexcept { return done_; }

private:
  [[nodiscard]] std::size_t tenths(std::size_t done) const {
    return total_ == 0 ? 0 : std::min<std::size_t>(10, done * 10 / total_);
  }

  [[nodiscard]] std::string line(std::string_view remark) const {
    const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
    const double rate = seconds > 0 ? static_cast<double>(done_) / seconds : 0;
    const std::size_t left = total_ > done_ ? total_ - done_ : 0;
    const double share =
        total_ == 0 ? 100.0 : 100.0 * static_cast<double>(done_) / static_cast<double>(total_);
    char text[96];
    std::snprintf(text, sizeof text, " %3.0f %%  %zu/%zu  %.1f Hz  %.0f s left", share, done_, total_, rate,
                  rate > 0 ? static_cast<double>(left) / rate : 0.0);
    std::string result = name_ + text;
    if (!remark.empty()) result.append("  ").append(remark);
    return result;
  }

  std::ostream& out_;
  std::string name_;
  std::size_t total_;
  bool terminal_;
  Clock::time_point start_;
  Clock::time_point last_{};
  std::size_t done_ = 0;
  bool shown_ = false;
};

}  // namespace example
