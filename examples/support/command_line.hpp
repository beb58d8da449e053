// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the example programs' command lines have in common: --version, exit code 2 for every mistake, and
/// mistakes said in a line.
#pragma once

#include <cmath>
#include <cstdint>
#include <exception>
#include <initializer_list>
#include <iostream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>
#include <cairn/version.hpp>

#include "support/standard_output.hpp"

namespace example {

/// Exit codes of the example programs.
enum Exit : int {
  exit_well = 0,
  exit_mistake = 2,      ///< of the command line, or what was asked for cannot be done
  exit_data_ended = 3,   ///< the data broke off: what there was until then is written
  exit_interrupted = 4,  ///< by SIGINT, SIGTERM or SIGHUP: what there was until then is written
};

namespace detail {

/// A word of the command line for a message.
inline std::string shown(std::string_view word) {
  constexpr std::size_t most = 20;
  return word.size() <= most ? "'" + std::string(word) + "'"
                             : "'" + std::string(word.substr(0, most)) + "...'";
}

}  // namespace detail

/// Takes whole numbers from `low` to `high`.
inline CLI::Validator whole_number(std::uint64_t low,
                                   std::uint64_t high = std::numeric_limits<std::uint64_t>::max()) {
  const bool bounded = high != std::numeric_limits<std::uint64_t>::max();
  const std::string range = bounded ? "from " + std::to_string(low) + " to " + std::to_string(high)
                                    : "of at least " + std::to_string(low);
  return {[=](const std::string& word) {
            const std::optional<std::uint64_t> value = cairn::parse_number<std::uint64_t>(word);
            if (value && *value >= low && *value <= high) return std::string();
            return "expected a whole number " + range + ", found " + detail::shown(word);
          },
          bounded ? std::to_string(low) + "-" + std::to_string(high) : ">= " + std::to_string(low)};
}

/// Takes finite numbers from `low` to `high`.
inline CLI::Validator number_between(double low, double high) {
  std::string range;
  cairn::append_number(range, low);
  range += " to ";
  cairn::append_number(range, high);
  return {[=](const std::string& word) {
            const std::optional<double> value = cairn::parse_number(word);
            if (value && *value >= low && *value <= high) return std::string();
            return "expected a number from " + range + ", found " + detail::shown(word);
          },
          range};
}

/// Takes one of the names and sets the enumerator that it stands for: option->transform(one_of<Kind>({...})).
/// Their order is that of --help.
template <class Enumeration>
CLI::Validator one_of(std::vector<std::pair<std::string, Enumeration>> named) {
  std::string names;
  for (const auto& [name, value] : named) names += (names.empty() ? "" : ", ") + name;
  return {[named = std::move(named), names](std::string& word) {
            for (const auto& [name, value] : named) {
              if (word != name) continue;
              word = std::to_string(static_cast<int>(value));  // as CLI11 reads enumerators
              return std::string();
            }
            return "expected one of " + names + ", found " + detail::shown(word);
          },
          names};
}

/// Throws cairn::Error naming an option that was given and would do nothing: one that is `for_what`, which is
/// not so.
inline void expect_absent(const CLI::App& app, std::initializer_list<const char*> options,
                          const std::string& for_what) {
  for (const char* option : options)
    if (app.count(option) > 0) cairn::raise(std::string(option) + " is " + for_what);
}

/// Does a program's work, which returns an exit code. What it throws is said in a line, and so is a standard
/// output that did not take its words: mistakes both.
template <class Work>
[[nodiscard]] int exit_code_of(const std::string& name, const Work& work) {
  try {
    const int code = work();
    return flush_standard_output(name) ? code : exit_mistake;
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << '\n';
    return exit_mistake;
  }
}

/// Parses the command line of the program `name`. Returns an exit code where the program is to end with it:
/// --help and --version were answered, or a mistake was named.
inline std::optional<int> parse(CLI::App& app, const std::string& name, int argc, char** argv) {
  app.set_version_flag("--version", name + " " CAIRN_VERSION_STRING);
  try {
    app.parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    // A misspelt option is the mistake, not the file that was left out while looking up how to spell it.
    const bool misspelt =
        error.get_exit_code() == static_cast<int>(CLI::ExitCodes::RequiredError) && app.remaining_size() > 0;
    std::ostringstream asked_for;
    const int code = misspelt ? app.exit(CLI::ExtrasError(app.remaining()), asked_for, std::cerr)
                              : app.exit(error, asked_for, std::cerr);
    if (code != 0) return exit_mistake;
    std::cout << asked_for.str();
    return flush_standard_output(name) ? exit_well : exit_mistake;
  }
}

}  // namespace example
