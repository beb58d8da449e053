// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A report that a browser of this machine sees growing while the program works on it.
///
///   example::LivePage live(0);                       // any free port of the loopback address
///   std::cerr << "look at " << live.address() << '\n';
///   while (work()) {
///     if (live.wanted()) live.show(report_so_far);   // made only where somebody looks
///   }
///   live.finish(html_of_the_finished_report);
///
/// The page asks once a second whether there is a newer one, and loads that unless its reader holds it.
/// Nobody but this machine can reach it, and nothing can be changed through it.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "support/report.hpp"

namespace example {

class LivePage {
public:
  /// Serves on 127.0.0.1; port 0 is any that is free. Throws cairn::Error where the port is taken, or
  /// why_no_live_page() says why.
  explicit LivePage(std::uint16_t port);
  ~LivePage();
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  /// Where to look, such as "http://127.0.0.1:8080/".
  [[nodiscard]] std::string address() const;

  /// Somebody asked for a newer page since the last was shown, which was at least `rest` ago.
  [[nodiscard]] bool wanted(std::chrono::milliseconds rest = std::chrono::milliseconds(1000)) const;

  /// What there is so far; seen by those who look within a second.
  void show(Report report);
  /// The finished page: it asks for no newer one. Waits for those who look to have it, at most for
  /// `patience`.
  void finish(std::string html, std::chrono::milliseconds patience = std::chrono::milliseconds(3000));

private:
  struct Server;
  std::unique_ptr<Server> server_;
};

/// One line that says why this program was built without live pages and how to get them, where it was.
[[nodiscard]] std::optional<std::string> why_no_live_page();

}  // namespace example
