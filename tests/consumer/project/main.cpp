// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstdio>

#include <cairn/core/statistics.hpp>
#include <cairn/version.hpp>

#include "every_header.hpp"

double gate_of_the_other_file();

int main() {
  const double gate = cairn::chi_square_quantile(0.95, 3);
  std::printf("cairn %s, gate %.6f\n", CAIRN_VERSION_STRING, gate);
  return gate == gate_of_the_other_file() ? 0 : 1;
}
