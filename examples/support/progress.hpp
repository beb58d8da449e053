// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How far a long run has come: one line that rewrites itself on a terminal and is never wider than it, one
/// line for every tenth elsewhere.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <ostream>
#include <string>
#include <string_view>

#include <sys/ioctl.h>
#include <unistd.h>

#include <cairn/io/text.hpp>

namespace example {

/// Columns of the terminal behind a file descriptor as it is now, at most what COLUMNS says; 80 where neither
/// is known.
inline std::size_t terminal_columns(int descriptor) {
  std::size_t columns = 0;
  winsize size{};
  if (::ioctl(descriptor, TIOCGWINSZ, &size) == 0) columns = size.ws_col;
  if (const char* text = std::getenv("COLUMNS"); text != nullptr) {
    const std::size_t wanted = cairn::parse_number<std::size_t>(text).value_or(0);
    if (wanted > 0) columns = columns > 0 ? std::min(columns, wanted) : wanted;
  }
  return columns > 0 ? columns : 80;
}

/// Counts steps towards a known total. Not for several threads at once.
class Progress {
public:
  using Clock = std::chrono::steady_clock;

  /// `total` steps of what `name` says. On a terminal the line is rewritten at most ten times a second, and
  /// cut to its columns: those of standard error's terminal at that moment where `columns` is 0.
  Progress(std::ostream& out, std::string name, std::size_t total, bool terminal, std::size_t columns = 0)
      : out_(out),
        name_(std::move(name)),
        total_(total),
        terminal_(terminal),
        columns_(columns),
        start_(Clock::now()) {}

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
      out_ << '\r' << cut(line(remark)) << "\x1b[K" << std::flush;
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

  /// One column less than there are: some terminals go to the next line with the last. Whole characters.
  [[nodiscard]] std::string cut(std::string text) const {
    const std::size_t columns = columns_ > 0 ? columns_ : terminal_columns(STDERR_FILENO);
    if (text.size() < columns) return text;
    std::size_t end = columns - 1;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
    text.resize(end);
    return text;
  }

  std::ostream& out_;
  std::string name_;
  std::size_t total_;
  bool terminal_;
  std::size_t columns_;
  Clock::time_point start_;
  Clock::time_point last_{};
  std::size_t done_ = 0;
  bool shown_ = false;
};

}  // namespace example
