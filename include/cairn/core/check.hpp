// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How cairn says that something is wrong.
///
///   bad data from outside (files, points, sizes)   -> raise(...)          throws cairn::Error
///   a caller broke a documented promise            -> CAIRN_EXPECTS(...)  calls the violation handler
///   the same, too expensive for release builds     -> CAIRN_ASSERT(...)   only where CAIRN_CHECKED is 1
///   nothing found, not positive definite, gated    -> std::optional or a status; never an exception
///
/// With -fno-exceptions raise() hands its message to the violation handler, which must not return.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What cairn throws when data from outside cannot be used. what() names what was wrong, what was expected
/// and where.
class Error : public std::runtime_error {
public:
  using std::runtime_error::runtime_error;
};

/// A broken promise: the condition that failed, the sentence that explains it, and where it stands.
struct Violation {
  const char* condition;
  const char* sentence;
  const char* file;
  int line;
};

/// Called on a violation. A handler may throw (tests do) or end the program; if it returns, the program is
/// ended.
using ViolationHandler = void (*)(const Violation&);

namespace detail {

inline void print_violation(const Violation& violation) {
  std::fprintf(stderr, "cairn: %s\n  broken: %s\n  at: %s:%d\n", violation.sentence, violation.condition,
               violation.file, violation.line);
}

inline ViolationHandler& violation_handler() noexcept {
  static ViolationHandler handler = &print_violation;
  return handler;
}

[[noreturn, gnu::cold, gnu::noinline]] inline void violate(const Violation& violation) {
  violation_handler()(violation);
  std::abort();
}

}  // namespace detail

/// Replaces the violation handler and returns the previous one. Not synchronised: set it before starting
/// threads.
inline ViolationHandler set_violation_handler(ViolationHandler handler) noexcept {
  const ViolationHandler previous = detail::violation_handler();
  detail::violation_handler() = handler != nullptr ? handler : &detail::print_violation;
  return previous;
}

/// Throws Error(message). Kept out of line so that the functions that check stay small.
[[noreturn, gnu::cold, gnu::noinline]] inline void raise(const std::string& message) {
#if defined(__cpp_exceptions)
  throw Error(message);
#else
  detail::violate(Violation{"valid input", message.c_str(), __FILE__, __LINE__});
#endif
}

}}  // namespace cairn::CAIRN_ABI

/// A cheap precondition, checked once per call in every build.
#define CAIRN_EXPECTS(condition, sentence)                                                    \
  do {                                                                                        \
    if (!(condition)) [[unlikely]]                                                            \
      ::cairn::detail::violate(::cairn::Violation{#condition, sentence, __FILE__, __LINE__}); \
  } while (false)

/// An expensive or per-element precondition, checked where CAIRN_CHECKED is 1 (debug builds by default).
#if CAIRN_CHECKED
#define CAIRN_ASSERT(condition, sentence) CAIRN_EXPECTS(condition, sentence)
#else
#define CAIRN_ASSERT(condition, sentence) static_cast<void>(0)
#endif
