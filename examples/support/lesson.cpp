// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "lesson.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>

#include <CLI/CLI.hpp>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>

#include "command_line.hpp"
#include "result_folder.hpp"
#include "standard_output.hpp"

namespace example {
namespace {

constexpr const char* page_file = "index.html";

std::string program;  // for words said while the program ends

/// Instead of a crash: what was thrown, as a sentence.
[[noreturn]] void end_with_a_sentence() {
  std::string what = "ended without a reason";
  if (const std::exception_ptr thrown = std::current_exception()) {
    try {
      std::rethrow_exception(thrown);
    } catch (const std::exception& error) {
      what = error.what();
    } catch (...) {
      what = "something was thrown that is no error";
    }
  }
  std::cerr << program << ": " << what << std::endl;
  std::_Exit(exit_mistake);
}

std::vector<std::string> names_of(const std::vector<Mistake>& mistakes) {
  std::vector<std::string> names;
  for (const Mistake& mistake : mistakes) names.push_back(mistake.name);
  return names;
}

/// Title, sentence, and a line for each mistake: for scripts/course and the tests.
std::string about(const LessonInfo& info) {
  std::string text = info.title + '\n' + info.sentence + '\n';
  for (const Mistake& mistake : info.mistakes) text += mistake.name + ": " + mistake.what + '\n';
  return text;
}

CLI::Validator one_of(const std::vector<std::string>& names) {
  std::string listed;
  for (const std::string& name : names) listed += (listed.empty() ? "" : ", ") + name;
  return {[=](const std::string& word) {
            if (std::ranges::find(names, word) != names.end()) return std::string();
            return "expected one of " + listed + ", found " + detail::shown(word);
          },
          listed};
}

std::string as_csv(const std::vector<std::string>& columns, const Rows& rows) {
  std::string text;
  for (const std::string& column : columns) text += (text.empty() ? "" : ",") + column;
  text += '\n';
  for (const std::vector<double>& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (i > 0) text += ',';
      cairn::append_number(text, row[i]);
    }
    text += '\n';
  }
  return text;
}

}  // namespace

std::vector<double> column(const Rows& rows, std::size_t index) {
  std::vector<double> values;
  for (const std::vector<double>& row : rows) values.push_back(row.at(index));
  return values;
}

Lesson::Lesson(LessonInfo info, int argc, char** argv)
    : info_(std::move(info)),
      steps_(info_.steps),
      out_(info_.name + "_results"),
      report_(info_.title, info_.sentence) {
  program = info_.name;
  std::set_terminate(&end_with_a_sentence);
  bool asks_about = false;
  CLI::App app{info_.title + ": " + info_.sentence, info_.name};
  app.add_option("--seed", seed_, "the same seed gives the same results")->check(whole_number(0));
  app.add_option("--steps", steps_, "size of the run; " + std::to_string(info_.steps) + " by default")
      ->check(whole_number(info_.least_steps, info_.most_steps));
  app.add_option("--out", out_, "folder for the page and the tables; " + out_.string() + " by default");
  app.add_option("--mistake", planted_, "makes a mistake that famous material made, for the verdict to see")
      ->check(one_of(names_of(info_.mistakes)));
  app.add_flag("--quiet", quiet_, "print the verdict only");
  app.add_flag("--about", asks_about, "print title, sentence and mistakes, and end");
  if (const std::optional<int> code = parse(app, info_.name, argc, argv)) std::exit(*code);
  if (asks_about) {
    std::cout << about(info_);
    std::exit(flush_standard_output(info_.name) ? exit_well : exit_mistake);
  }
  for (const Mistake& each : info_.mistakes)
    if (each.name == planted_) {
      report_.note("A mistake was planted. " + each.name + ": " + each.what);
      report_.note((each.look.empty() ? "" : each.look + ' ') + "Captions are those of the page without it.");
    }
  if (!planted_.empty()) say("planted mistake: " + planted_);
}

bool Lesson::mistake(std::string_view name) const {
  const std::vector<std::string> names = names_of(info_.mistakes);
  if (std::ranges::find(names, name) == names.end())
    cairn::raise("the lesson lists no mistake \"" + std::string(name) + "\"");
  return planted_ == name;
}

void Lesson::say(std::string_view line) const {
  if (!quiet_) std::cout << line << '\n';
}

void Lesson::verdict(const std::string& name, double value, double low, double high,
                     const std::string& hint) {
  const bool right = value >= low && value <= high;
  const std::string band = readable(low, 4) + " to " + readable(high, 4);
  std::string more = hint.empty() ? "" : ". " + hint;
  const bool is_word = hint.size() > 1 && hint[1] >= 'a' && hint[1] <= 'z';  // no symbol, s^2
  if (is_word && hint[0] >= 'a' && hint[0] <= 'z') more[2] = static_cast<char>(hint[0] - 'a' + 'A');
  say((right ? "ok     " : "WRONG  ") + name + ": " + readable(value, 4) + ", expected " + band);
  figure({.label = name,
          .value = readable(value, 4),
          .hint = "expected " + band + more,
          .verdict = right ? KeyFigure::Verdict::good : KeyFigure::Verdict::bad});
  ++verdicts_;
  if (!right) wrong_.push_back(name);
}

void Lesson::csv(const std::string& name, const std::vector<std::string>& columns, const Rows& rows) {
  for (const std::vector<double>& row : rows)
    if (row.size() != columns.size())
      cairn::raise("table \"" + name + "\": expected " + std::to_string(columns.size()) +
                   " values in a row, found " + std::to_string(row.size()));
  tables_.push_back({name + ".csv", as_csv(columns, rows)});
}

void Lesson::write_results() {
  std::vector<std::string> names{page_file};
  for (const Table& table : tables_) names.push_back(table.file);
  const std::optional<std::string> page = report_.html();
  ResultFolder(out_, names).replace([&](const std::filesystem::path& folder) {
    for (const Table& table : tables_) cairn::write_file_atomically(folder / table.file, table.text);
    if (page) cairn::write_file_atomically(folder / page_file, *page);
  });
  if (!page) say(why_no_report());
  say("results in " + (page ? out_ / page_file : out_).string());
}

int Lesson::finish() {
  try {
    write_results();
  } catch (const std::exception& error) {  // nobody above catches: what was half written would stay
    std::cerr << info_.name << ": " << error.what() << std::endl;
    return exit_mistake;
  }
  std::string names;
  for (const std::string& name : wrong_) names += (names.empty() ? "" : ", ") + name;
  if (verdicts_ == 0) names = "nothing was judged";
  std::cout << (names.empty() ? "verdict: green" : "verdict: RED (" + names + ")") << '\n';
  if (!flush_standard_output(info_.name)) return exit_mistake;
  return names.empty() ? exit_well : 1;
}

}  // namespace example
