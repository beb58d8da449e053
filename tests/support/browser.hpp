// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Report pages as a reader sees them, in headless Chromium. CAIRN_SCREENSHOTS names a folder for pictures.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <string>

#include <cairn/io/file.hpp>

#include "support/folder.hpp"

namespace cairn_test {

inline bool has_chromium() {
  return std::system("command -v chromium >/dev/null 2>&1") == 0;
}

/// Runs Chromium with more options; its exit code as std::system gives it. `patience` is the time [ms] that
/// its pages have by their own clock, which skips what they wait for; two minutes of ours are enough for two
/// of theirs.
inline int chromium(const Folder& folder, const std::string& more, int patience = 8000) {
  const std::string command =
      "timeout " + std::to_string(std::max(120, patience / 1000)) +
      " chromium --headless --no-sandbox --disable-gpu-sandbox --use-angle=swiftshader "
      "--enable-unsafe-swiftshader --disable-dev-shm-usage --no-first-run --enable-logging=stderr "
      "--virtual-time-budget=" +
      std::to_string(patience) + " --user-data-dir='" + (folder / "profile").string() + "' " + more;
  return std::system(command.c_str());
}

struct OpenedPage {
  std::string document;  ///< after the scripts have run
  std::string console;   ///< what they said

  [[nodiscard]] bool has(const std::string& part) const { return document.find(part) != std::string::npos; }
  [[nodiscard]] std::size_t count(const std::string& part) const {
    std::size_t found = 0;
    for (std::size_t at = document.find(part); at != std::string::npos; at = document.find(part, at + 1))
      ++found;
    return found;
  }
};

/// The document that Chromium makes of what is at the address, and what it said meanwhile.
inline OpenedPage open_address(const Folder& folder, const std::string& address, int patience = 8000) {
  const int status = chromium(folder,
                              "--dump-dom '" + address + "' >'" + (folder / "dom").string() + "' 2>'" +
                                  (folder / "log").string() + "'",
                              patience);
  if (status != 0) throw std::runtime_error("chromium did not open " + address);
  OpenedPage opened{cairn::read_file(folder / "dom"), {}};
  std::istringstream log(cairn::read_file(folder / "log"));
  for (std::string line; std::getline(log, line);)
    if (line.find("CONSOLE") != std::string::npos) opened.console += line + "\n";
  return opened;
}

/// The same of a file.
inline OpenedPage open_page(const Folder& folder, const std::filesystem::path& page, int patience = 8000) {
  return open_address(folder, "file://" + page.string(), patience);
}

/// NAME-light.png and NAME-dark.png where CAIRN_SCREENSHOTS says; false where Chromium fails.
inline bool keep_picture(const Folder& folder, const std::filesystem::path& page, const std::string& name,
                         int height = 3400) {
  const char* pictures = std::getenv("CAIRN_SCREENSHOTS");
  if (pictures == nullptr) return true;
  bool kept = true;
  for (const char* theme : {"light", "dark"}) {
    const std::string target = std::string(pictures) + "/" + name + "-" + theme + ".png";
    kept = chromium(folder, "--hide-scrollbars --window-size=1280," + std::to_string(height) +
                                " --screenshot='" + target + "' 'file://" + page.string() +
                                "?theme=" + theme + "' 2>/dev/null") == 0 &&
           kept;
  }
  return kept;
}

}  // namespace cairn_test
