// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// NAME_replay FOLDER...: gives every file of the folders to a fuzz target, as scripts/fuzz once did. Ends as
// a finding ends it, or with 0; with 1 where none is read: the corpus is empty, or has another format than
// the reader.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) try {
  std::vector<std::filesystem::path> inputs;
  for (int i = 1; i < argc; ++i)
    for (const auto& entry : std::filesystem::directory_iterator(argv[i]))
      if (entry.is_regular_file()) inputs.push_back(entry.path());
  std::ranges::sort(inputs);
  for (const std::filesystem::path& input : inputs) {
    std::ifstream file(input, std::ios::binary);
    std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
    bytes.shrink_to_fit();  // a byte read behind the end is found
    std::printf("%s\n", input.filename().c_str());
    std::fflush(stdout);  // the last name is that of a finding
    static_cast<void>(LLVMFuzzerTestOneInput(bytes.data(), bytes.size()));
  }
  std::printf("%zu inputs replayed, %zu refused\n", inputs.size(), cairn_fuzz::refusals);
  return cairn_fuzz::refusals < inputs.size() ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "replay: %s\n", error.what());
  return 1;
}
