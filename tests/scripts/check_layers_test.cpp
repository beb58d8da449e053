// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// scripts/check_layers on a copy of the headers and documents, whole and broken.
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <doctest/doctest.h>

#include "support/folder.hpp"
#include "support/program.hpp"

namespace check_layers_test {
namespace {

using cairn_test::Outcome;

/// What check_layers reads, in a folder of its own.
struct Copy {
  cairn_test::Folder folder;

  Copy() {
    const std::filesystem::path project = std::filesystem::path(CAIRN_SCRIPTS).parent_path();
    for (const char* part : {"include", "docs", "examples", "README.md"})
      std::filesystem::copy(project / part, folder / part, std::filesystem::copy_options::recursive);
    std::filesystem::create_directory(folder / "scripts");
    std::filesystem::copy(project / "scripts" / "check_layers", folder / "scripts");
  }
  [[nodiscard]] Outcome check(const std::string& options = "") const {
    return cairn_test::run_program('"' + (folder / "scripts" / "check_layers").string() + "\" " + options);
  }
  [[nodiscard]] std::string read(const std::string& name) const {
    std::ifstream file(folder / name);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void append(const std::string& name, const std::string& text) const {
    std::ofstream(folder / name, std::ios::app) << text;
  }
};

void check_fault(const Copy& copy, const std::string& words) {
  const Outcome outcome = copy.check();
  CAPTURE(outcome.words);
  CAPTURE(words);
  CHECK(outcome.code == 1);
  CHECK(outcome.says(words));
}

}  // namespace

TEST_SUITE("check_layers") {
  TEST_CASE("check_layers: the headers as they are have no fault") {
    const Outcome outcome = Copy().check();
    CAPTURE(outcome.words);
    CHECK(outcome.code == 0);
  }

  TEST_CASE("check_layers: nobody includes another folder's detail/, whatever points downwards") {
    const Copy copy;
    copy.append("include/cairn/models/linear.hpp", "#include <cairn/filter/detail/products.hpp>\n");
    check_fault(copy, "cairn/models/linear.hpp: cairn/filter/detail/products.hpp is for its own folder");
  }

  TEST_CASE("check_layers: a circle through a room is a circle") {
    const Copy copy;
    copy.append("include/cairn/filter/detail/register_column.hpp", "#include <cairn/filter/kalman.hpp>\n");
    check_fault(copy, "circle: ");
  }

  TEST_CASE("check_layers: a new door belongs into cairn.hpp, which --write sees to, and into a table") {
    const Copy copy;
    copy.append("include/cairn/index/ball_tree.hpp", "#pragma once\n");
    check_fault(copy, "cairn/cairn.hpp does not include every door");
    check_fault(copy, "cairn/index/ball_tree.hpp: no table of docs/*.md names this door");
    CHECK(copy.check("--write").code == 1);  // the table is left
    CHECK(copy.read("include/cairn/cairn.hpp").find("<cairn/index/ball_tree.hpp>") != std::string::npos);
    copy.append("docs/index.md", "\nAs in `ball_tree.hpp`.\n");
    CHECK(copy.check().code == 1);  // a sentence is no table
    copy.append("docs/index.md", "\n| `ball_tree.hpp` | balls |\n");
    CHECK(copy.check().code == 0);
  }

  TEST_CASE("check_layers: a header that documents name has to be there") {
    const Copy copy;
    copy.append("docs/filters.md", "\nSee `filter/oracle.hpp`.\n");
    check_fault(copy, "there is no header filter/oracle.hpp");
  }

  TEST_CASE("check_layers: a header with a patent is reached by nobody") {
    const Copy copy;
    copy.append("include/cairn/io/netpbm.hpp", "#include <cairn/vision/surf.hpp>\n");
    check_fault(copy, "cairn/io/netpbm.hpp: reaches a header with a patent");
  }
}

}  // namespace check_layers_test
