// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/simd/processor.hpp>

#include "support/processors.hpp"

namespace processor_test {
namespace {

using cairn::detail::Processor;
using Names = std::vector<std::string>;

Names split(const std::string& names, char at) {
  Names result;
  std::istringstream rest(names);
  for (std::string name; std::getline(rest, name, at);) result.push_back(name);
  return result;
}

bool holds(const Names& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// What kernels are compiled for, as the compiler is told.
const std::string compiled_for[] = {
    {},
    CAIRN_AVX2(CAIRN_NAME_OF, ","),
    CAIRN_AVX512(CAIRN_NAME_OF, ","),
    CAIRN_AVX512_VNNI(CAIRN_NAME_OF, ","),
};

/// What the answer is on a processor that has these and nothing else.
Processor answer(const Names& names) {
  const auto has = [&](std::string_view name) { return holds(names, name); };
  return CAIRN_PROCESSOR(has);
}

}  // namespace

TEST_SUITE("processor") {
  TEST_CASE("processor: no kernel is chosen where one of the instructions it is compiled for is missing") {
    CHECK(compiled_for[3] == "avx512f,avx512bw,avx512vl,avx512dq,avx2,avx512vnni");
    CHECK(answer({"sse2", "fma"}) == Processor::plain);
    CHECK(answer({"avx512vnni"}) == Processor::plain);
    for (int processor = 1; processor < 4; ++processor) {
      const Names all = split(compiled_for[processor], ',');
      CHECK(answer(all) == static_cast<Processor>(processor));
      for (const std::string& missing : all) {
        CAPTURE(missing);
        Names others;
        std::copy_if(all.begin(), all.end(), std::back_inserter(others),
                     [&](const std::string& name) { return name != missing; });
        for (const std::string& needed : split(compiled_for[static_cast<int>(answer(others))], ','))
          CHECK(needed != missing);
      }
    }
  }

  TEST_CASE("processor: has what the system says that it has") {
    std::ifstream file("/proc/cpuinfo");
    std::string line;
    while (std::getline(file, line) && !line.starts_with("flags")) {
    }
#if defined(__x86_64__) || defined(__i386__)
    const bool says = line.starts_with("flags");
#else
    const bool says = false;  // or of the machine that emulates this one
#endif
    if (!says) {
      MESSAGE("skipped: no /proc/cpuinfo with flags");
      return;
    }
    Names flags = split(line, ' ');
    std::replace(flags.begin(), flags.end(), std::string("avx512_vnni"), std::string("avx512vnni"));
    CHECK(cairn::detail::processor() == answer(flags));
  }

  TEST_CASE("with_widest_lanes, with_avx2_lanes: the body runs once, on every processor") {
    int runs = 0, sum = 0;
    cairn_test::for_each_processor([&] {
      ++runs;
      cairn::detail::with_widest_lanes([&]() CAIRN_INLINED { ++sum; });
      sum += cairn::detail::with_avx2_lanes([&]() CAIRN_INLINED { return 10; });
      CHECK(sum == 11 * runs);
    });
    CHECK(runs == 1 + static_cast<int>(cairn::detail::processor()));
  }
}

}  // namespace processor_test
