// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A program as a user meets it: its exit code, its words, and what becomes of it when it is interrupted.
#pragma once

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/folder.hpp"

namespace cairn_test {

struct Outcome {
  int code;           ///< of the program's end; -1 where a signal ended it
  std::string words;  ///< standard error, and standard output where that goes nowhere else

  [[nodiscard]] bool says(const std::string& word) const { return words.find(word) != std::string::npos; }
};

/// Runs a command of the shell; its standard output goes to `standard_output` where that is named.
inline Outcome run_program(const std::string& command, const std::string& standard_output = "") {
  const Folder folder;
  const std::filesystem::path words = folder / "words.txt";
  const std::string whole =
      command + " 2>\"" + words.string() + "\" >" + (standard_output.empty() ? "&2" : standard_output);
  const int status = std::system(whole.c_str());  // NOLINT(cert-env33-c): our own programs
  std::ifstream file(words);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, {std::istreambuf_iterator<char>(file), {}}};
}

inline std::set<std::string> names_in(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.insert(entry.path().filename().string());
  return names;
}

/// Whether a process has a handler of its own for the signal.
inline bool handles(pid_t process, int signal) {
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("SigCgt:"))
      return (std::stoull(line.substr(7), nullptr, 16) >> static_cast<unsigned>(signal - 1) & 1U) != 0;
  return false;
}

/// Starts the program with its words going nowhere; returns its process.
inline pid_t start_program(std::vector<std::string> command) {
  const pid_t child = ::fork();
  if (child == 0) {
    const int nowhere = ::open("/dev/null", O_WRONLY);
    ::dup2(nowhere, STDERR_FILENO);
    ::dup2(nowhere, STDOUT_FILENO);
    std::vector<char*> arguments;
    for (std::string& word : command) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  return child;
}

/// Waits until `there` is true or the program has ended (which kill_program() then tells).
template <class There>
void wait_for(pid_t child, const There& there) {
  siginfo_t ended{};
  while (!there()) {
    if (::waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT) != 0 ||
        ended.si_pid != 0)
      return;
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
}

/// Kills the program, which cannot be caught, and waits for its end. False where it had ended by itself.
inline bool kill_program(pid_t child) {
  ::kill(child, SIGKILL);
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFSIGNALED(status);
}

/// Starts the program, sends it the signals, the first when it has said `lines` lines on standard error, each
/// further one when the one before was taken. Returns its exit code; minus the signal where that ended it.
inline int interrupt_program(std::vector<std::string> command, std::initializer_list<int> signals,
                             int lines = 1) {
  int words[2];
  if (::pipe(words) != 0) throw std::runtime_error("no pipe");
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(words[1], STDERR_FILENO);
    ::dup2(::open("/dev/null", O_WRONLY), STDOUT_FILENO);
    ::close(words[0]);
    std::vector<char*> arguments;
    for (std::string& word : command) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  ::close(words[1]);
  char letter = 0;
  while (lines > 0 && ::read(words[0], &letter, 1) == 1) lines -= letter == '\n' ? 1 : 0;
  for (const int signal : signals) {
    ::kill(child, signal);
    while (handles(child, signal)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  while (::read(words[0], &letter, 1) == 1) continue;  // a pipe that nobody reads would end it as well
  ::close(words[0]);
  int status = 0;
  if (::waitpid(child, &status, 0) != child) throw std::runtime_error("no child");
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace cairn_test
