// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Ctrl-C, SIGTERM and SIGHUP as a wish to end, so that a long run can write what it has.
#pragma once

#include <array>
#include <csignal>
#include <cstddef>
#include <optional>
#include <string>

namespace example {

/// While it lives, the first such signal is noted and a second ends the program as it would without this.
/// Signals that were ignored (nohup) stay ignored. One at a time.
class Interruption {
public:
  Interruption() {
    caught_ = 0;
    for (std::size_t i = 0; i < signals.size(); ++i) {
      struct sigaction action{};
      action.sa_handler = &note;
      action.sa_flags = SA_RESTART;  // a file that is being read is read to its end
      ::sigaction(signals[i], nullptr, &before_[i]);
      if (before_[i].sa_handler != SIG_IGN) ::sigaction(signals[i], &action, nullptr);
    }
  }
  ~Interruption() {
    for (std::size_t i = 0; i < signals.size(); ++i) ::sigaction(signals[i], &before_[i], nullptr);
  }
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  /// The signal's name, once there was one.
  [[nodiscard]] static std::optional<std::string> caught() {
    constexpr std::array names{"SIGINT", "SIGTERM", "SIGHUP"};
    for (std::size_t i = 0; i < signals.size(); ++i)
      if (caught_ == signals[i]) return names[i];
    return std::nullopt;
  }

private:
  static constexpr std::array signals{SIGINT, SIGTERM, SIGHUP};

  static void note(int signal) {
    caught_ = signal;
    for (const int each : signals) {
      struct sigaction now{};
      if (::sigaction(each, nullptr, &now) == 0 && now.sa_handler != SIG_IGN) std::signal(each, SIG_DFL);
    }
  }

  static inline volatile std::sig_atomic_t caught_ = 0;
  std::array<struct sigaction, 3> before_{};
};

}  // namespace example
