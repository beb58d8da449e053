// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// scipy's cKDTree with its defaults, which computes in double. It lives in a python process that answers
// whole sets of queries (rival_scipy.py says how); handing over 2000 of them costs microseconds where
// searching takes milliseconds.
#include "rivals.hpp"

#ifdef CAIRN_BENCH_SCIPY
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include <spawn.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;
#endif

namespace cairn_bench {

#ifdef CAIRN_BENCH_SCIPY
namespace {

/// A running script at the other end of a socket: of a pipe whose reader is gone one would learn by a signal.
class Script {
public:
  Script(std::string python, std::string script) {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) fail("no socket for it");
    const timeval patience{.tv_sec = 120, .tv_usec = 0};  // far beyond any answer, so that nothing hangs
    setsockopt(ends[0], SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(ends[0], SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    char* arguments[] = {python.data(), script.data(), nullptr};
    const int error = posix_spawn(&process_, python.c_str(), &actions, nullptr, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    socket_ = ends[0];
    if (error != 0) process_ = -1;
  }
  Script(const Script&) = delete;
  Script& operator=(const Script&) = delete;
  ~Script() {
    close(socket_);
    if (process_ <= 0) return;
    kill(process_, SIGKILL);  // it has nothing to lose, and may be the one that does not answer
    while (waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }

  void send(const void* data, std::size_t size) {
    for (const char* next = static_cast<const char*>(data); size > 0;) {
      const ssize_t sent = ::send(socket_, next, size, MSG_NOSIGNAL);
      if (sent < 0 && errno == EINTR) continue;
      if (sent < 0) fail(errno == EAGAIN ? "does not read" : "ended early");
      next += sent;
      size -= static_cast<std::size_t>(sent);
    }
  }
  void send(const std::string& line) { send(line.data(), line.size()); }
  void send(const std::vector<Point3>& rows) { send(rows.data(), rows.size() * sizeof(Point3)); }

  template <class Number>
  std::vector<Number> receive(std::size_t count) {
    std::vector<Number> numbers(count);
    std::size_t size = count * sizeof(Number);
    for (char* next = reinterpret_cast<char*>(numbers.data()); size > 0;) {
      const ssize_t received = recv(socket_, next, size, 0);
      if (received < 0 && errno == EINTR) continue;
      if (received < 0 && errno == EAGAIN) fail("gave no answer within two minutes");
      if (received <= 0) fail("ended before it answered");
      next += received;
      size -= static_cast<std::size_t>(received);
    }
    return numbers;
  }

  /// Waits for an answer in words.
  void expect(const std::string& words) {
    const std::vector<char> answer = receive<char>(words.size());
    if (std::string(answer.begin(), answer.end()) != words) fail("answered something else than " + words);
  }

private:
  [[noreturn]] static void fail(const std::string& what) {
    throw std::runtime_error("rival scipy: the python process " + what);
  }

  int socket_ = -1;
  pid_t process_ = -1;
};

std::string ask(const std::string& command, const std::string& number, std::size_t rows) {
  return command + " " + number + " " + std::to_string(rows) + "\n";
}

}  // namespace

std::unique_ptr<StaticRival> make_scipy(const std::vector<Point3>& points) {
  auto script = std::make_shared<Script>(CAIRN_BENCH_PYTHON, CAIRN_BENCH_SCIPY);
  try {
    script->expect("ready\n");
  } catch (const std::runtime_error&) {
    return nullptr;  // no longer there, or without scipy
  }
  script->send("points " + std::to_string(points.size()) + "\n");
  script->send(points);
  auto rival = std::make_unique<StaticRival>();
  rival->name = "scipy";
  rival->build = [=] {
    script->send("build\n");
    script->expect("built\n");
  };
  rival->kth_distances = [=](const std::vector<Point3>& queries, std::size_t k) {
    script->send(ask("nearest", std::to_string(k), queries.size()));
    script->send(queries);
    return script->receive<float>(queries.size());
  };
  rival->counts_within = [=](const std::vector<Point3>& queries, float radius) {
    char exactly[32];
    std::snprintf(exactly, sizeof exactly, "%.9g", static_cast<double>(radius));
    script->send(ask("within", exactly, queries.size()));
    script->send(queries);
    const auto counts = script->receive<std::int32_t>(queries.size());
    return std::vector<std::size_t>(counts.begin(), counts.end());
  };
  return rival;
}
#else
std::unique_ptr<StaticRival> make_scipy(const std::vector<Point3>&) {
  return nullptr;
}
#endif

}  // namespace cairn_bench
